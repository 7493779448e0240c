//! The parameters of a fit, with their provenance.

use host_io::choice::Choice;
use toml::{Table, Value};

use super::candidate::Candidate;
use super::{Fit, Settings, Uncertainty, Warning};
use crate::agreement::Agreement;
use crate::error::{Error, Result, with_names};
use crate::files::parameters::{Parameters, plausibility};
use crate::files::recording::{Direction, Recording};
use crate::replay::expectation::{Recorded, Refit};

impl Fit {
    /// The parameters of this fit to `recordings`, with their provenance.
    ///
    /// # Errors
    ///
    /// [`Error`] for a file that cannot be read again, elements out of range, or a film that no controller can step.
    pub fn parameters(
        &self,
        settings: &Settings,
        direction: Direction,
        recordings: &[&Recording],
    ) -> Result<Parameters> {
        let name =
            |recording: &&Recording| recording.path().file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let names: Vec<String> = recordings.iter().map(name).collect();
        let Candidate { actuator, offset_m, delay_s, .. } = self.candidate;
        let plain = Parameters {
            // A size that was freed may be one that no film has: then nothing is claimed of the field.
            assumed_sizes: settings.assumed_sizes || plausibility::check(&actuator).is_err(),
            sensor_offset_m: offset_m,
            sensor_delay_s: delay_s,
            ..Parameters::new(format!("fit to {}", names.join(", ")), actuator, self.candidate.model()?)
        };
        let film = |candidate: &Candidate| -> Result<Parameters> {
            Ok(Parameters {
                curve: candidate.bend.elastic().map_err(springpot::LawError::from)?,
                spring: candidate.elastic_spring().map_err(springpot::LawError::from)?,
                temperature: candidate.temperature,
                actuator: candidate.actuator,
                model: candidate.model()?,
                ..plain.clone()
            })
        };
        let mut parameters = film(&self.candidate)?;
        plausibility::check_offset(parameters.sensor_offset_m).map_err(|cause| {
            Error::Computation(format!(
                "the readings at rest: {cause}; state the unit of the displacement in the recordings"
            ))
        })?;
        if parameters.spring.is_some() {
            // As the file is read: over the whole of its curves, of which a recording may show a part.
            parameters.film().compressed_law::<f64>(1000.0).map_err(|error| {
                Error::Computation(format!("no controller can step the fitted film: {error}; fit with `curve` none"))
            })?;
        }
        let refit = |refit: &Candidate| film(refit).ok().map(|film| Refit::new(&film));
        let refits = self.refits.iter().map(refit).collect::<Option<_>>().unwrap_or_default();
        let recorded = Recorded { refits, ..self.recorded.clone() };
        parameters.provenance = Some(self.provenance(settings, direction, recordings, &recorded)?);
        Ok(parameters)
    }

    fn provenance(
        &self,
        settings: &Settings,
        direction: Direction,
        recordings: &[&Recording],
        recorded: &Recorded,
    ) -> Result<Table> {
        let recordings =
            recordings.iter().zip(&self.agreements).map(|(source, agreement)| recording(source, agreement));
        // A file names the fields, from the command line as from Python.
        let plain = |warning: &Warning| with_names(&warning.text, |field| Some(field.into()));
        let warnings = self.warnings.iter().map(|warning| Value::from(plain(warning)));
        let mut table = Table::new();
        let mut put = |key: &str, value: Value| {
            table.insert(key.into(), value);
        };
        put("tool", format!("springpot {} fit", env!("CARGO_PKG_VERSION")).into());
        put("method", format!("{}, seed {}", settings.method.name(), settings.seed).into());
        put("drive", direction.name().into());
        put("loss", settings.loss.name().into());
        put("evaluations", integer(self.evaluations));
        put("r2_mean", self.r2_mean.into());
        if self.interrupted {
            put("interrupted", true.into());
        }
        put("recordings", recordings.collect::<Result<Vec<Value>>>()?.into());
        // Of a force along a displacement no voltage follows.
        if let Some((key, value)) = recorded.entry().filter(|_| direction == Direction::Force) {
            put(key, value);
        }
        if let Some(uncertainty) = self.uncertainty.as_ref().filter(|uncertainty| uncertainty.no_intervals.is_none()) {
            put("intervals_95_pct", intervals(uncertainty).into());
        }
        put("warnings", warnings.collect::<Vec<Value>>().into());
        Ok(table)
    }
}

/// Checks the record of the recordings in the provenance of `parameters`, from which the error of feedforward is expected, if there is one.
///
/// # Errors
///
/// The key that cannot be used, and what to do.
pub fn check_recorded(parameters: &Parameters) -> std::result::Result<(), String> {
    let Some(value) = parameters.provenance.as_ref().and_then(|provenance| provenance.get("recorded")) else {
        return Ok(());
    };
    let refused = |fault: &str| {
        format!("[provenance.recorded] {fault}: fit again, or remove the table, without which no error is expected")
    };
    let recorded: Recorded = value
        .clone()
        .try_into()
        .map_err(|error: toml::de::Error| refused(&error.to_string().trim().replace('\n', ", ").replace('`', "\"")))?;
    if let Some((key, _)) = value.as_table().into_iter().flatten().find(|(_, value)| !is_finite(value)) {
        return Err(refused(&format!("{key} must be finite")));
    }
    let Recorded { voltage_v, speed_m_per_s, frequency_hz, time_s, .. } = recorded;
    let Recorded { left_out_m, misfit_m, fault_m, lag_s, jitter_s, .. } = recorded;
    let sizes = [
        ("voltage_v", voltage_v),
        ("speed_m_per_s", speed_m_per_s),
        ("frequency_hz", frequency_hz),
        ("time_s", time_s),
        ("left_out_m", left_out_m),
        ("misfit_m", misfit_m),
        ("fault_m", fault_m),
        ("lag_s", lag_s),
        ("jitter_s", jitter_s),
    ];
    if let Some((key, value)) = sizes.iter().find(|(_, value)| *value < 0.0) {
        return Err(refused(&format!("{key} = {value} must not be negative")));
    }
    let [low_m, high_m] = recorded.stroke_m;
    if low_m > high_m {
        return Err(refused(&format!("stroke_m = [{low_m}, {high_m}] must not fall")));
    }
    Ok(())
}

/// Whether all numbers in `value` are finite.
fn is_finite(value: &Value) -> bool {
    match value {
        Value::Float(number) => number.is_finite(),
        Value::Array(values) => values.iter().all(is_finite),
        Value::Table(table) => table.values().all(is_finite),
        _ => true,
    }
}

/// A recording with the digest of its file, and the agreement with it.
fn recording(source: &Recording, agreement: &Agreement) -> Result<Value> {
    let mut table = Table::new();
    table.insert("file".into(), source.path().display().to_string().into());
    if let Some(digest) = source.sha256()? {
        table.insert("sha256".into(), digest.into());
    }
    table.insert("r2".into(), agreement.r2.into());
    table.insert("nrmse_pct".into(), agreement.nrmse_pct.into());
    table.insert("samples".into(), integer(agreement.samples));
    Ok(table.into())
}

/// The 95 % intervals; an end that the data do not set is infinite.
fn intervals(uncertainty: &Uncertainty) -> Table {
    uncertainty
        .estimates
        .iter()
        .map(|estimate| {
            let ends = [estimate.low.unwrap_or(f64::NEG_INFINITY), estimate.high.unwrap_or(f64::INFINITY)];
            (estimate.name.clone(), Value::from(ends.map(Value::from).to_vec()))
        })
        .collect()
}

fn integer(count: usize) -> Value {
    i64::try_from(count).unwrap_or(i64::MAX).into()
}
