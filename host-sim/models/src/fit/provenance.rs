//! The parameter file of a fit: the model, and where it comes from.

use toml::{Table, Value};

use super::loss::Loss;
use super::outcome::Fit;
use super::settings::Settings;
use super::uncertainty::Uncertainty;
use crate::agreement::Agreement;
use crate::error::Result;
use crate::files::parameters::Parameters;
use crate::files::recording::{Direction, Recording};

impl Fit {
    /// The parameters of this fit to `recordings`, with their provenance.
    ///
    /// # Errors
    ///
    /// [`Error`](crate::error::Error) for a file that cannot be read again, or elements out of range.
    pub fn parameters(
        &self,
        settings: &Settings,
        direction: Direction,
        recordings: &[&Recording],
    ) -> Result<Parameters> {
        let name =
            |recording: &&Recording| recording.path().file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let names: Vec<String> = recordings.iter().map(name).collect();
        Ok(Parameters {
            curve: self.candidate.bend.elastic().map_err(springpot::LawError::from)?,
            method: springpot::Discretisation::Gl,
            name: format!("fit to {}", names.join(", ")),
            actuator: self.candidate.actuator,
            assumed_sizes: settings.assumed_sizes,
            model: self.candidate.model()?,
            sensor_offset_m: self.candidate.offset_m,
            board: None,
            provenance: Some(self.provenance(settings, direction, recordings)?),
        })
    }

    fn provenance(&self, settings: &Settings, direction: Direction, recordings: &[&Recording]) -> Result<Table> {
        let drive = match direction {
            Direction::Force => "force",
            Direction::Displacement => "displacement",
        };
        let loss = match settings.loss {
            Loss::Square => "square",
            Loss::Huber => "huber",
        };
        let recordings =
            recordings.iter().zip(&self.agreements).map(|(source, agreement)| recording(source, agreement));
        let warnings = self.warnings.iter().map(|warning| Value::from(warning.text.as_str()));
        let mut table = Table::new();
        let mut put = |key: &str, value: Value| {
            table.insert(key.into(), value);
        };
        put("tool", format!("host-sim {} fit", env!("CARGO_PKG_VERSION")).into());
        put("method", format!("{}, seed {}", settings.method.name(), settings.seed).into());
        put("drive", drive.into());
        put("loss", loss.into());
        put("evaluations", integer(self.evaluations));
        put("r2_mean", self.r2_mean.into());
        if self.interrupted {
            put("interrupted", true.into());
        }
        put("recordings", recordings.collect::<Result<Vec<Value>>>()?.into());
        if let Some(uncertainty) = &self.uncertainty {
            put("intervals_95_pct", intervals(uncertainty).into());
        }
        put("warnings", warnings.collect::<Vec<Value>>().into());
        Ok(table)
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
