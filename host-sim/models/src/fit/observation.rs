//! Recordings as a fit uses them, with checks and warnings before the fit.

use std::path::Path;

use springpot::TemperatureDependence;

use super::candidate::Variable;
use super::preparation::{
    Gaps, MIN_VALUES, Preparation, Severity, Warning, Window, between_steps, measured_quantity, sample_weights,
    saturation, slack, turned,
};
use super::readings::Reading;
use crate::error::{Error, Result, shown};
use crate::files::recording::{Direction, Input, Recording};
use crate::grid::Samples;
use crate::sampling;
use crate::statistics::{change, differences, mean, median, range, sorted};

/// A recording as a fit uses it.
#[derive(Clone, Debug)]
pub struct Observation {
    /// Path of the recording, or its name where it is no file.
    pub name: String,
    /// Input of the model.
    pub input: Input,
    /// The measured quantity: displacement (m), or force (N) where displacement is the input.
    pub measured: Samples,
    /// Steps per second.
    pub rate_hz: f64,
    /// Factor of its residuals.
    pub weight: f64,
    /// Factors of the single residuals, one per measured value; empty where all are 1.
    pub sample_weights: Vec<f64>,
    /// How its readings may differ from those of the other recordings.
    pub reading: Reading,
    /// Mean temperature of the film, °C, if it was recorded.
    pub temperature_c: Option<f64>,
}

/// Smaller changes are below the resolution of any sensor, m or N.
const MIN_CHANGE: f64 = 1e-12;

/// The observation of `recording`, and warnings about it.
///
/// # Errors
///
/// [`Error`] naming a recording that cannot be fitted.
pub fn observe(recording: &Recording, direction: Direction, weight: f64) -> Result<(Observation, Vec<Warning>)> {
    observe_prepared(recording, direction, weight, Preparation::NONE)
}

/// As [`observe`], prepared.
///
/// # Errors
///
/// As [`observe`], and for what leaves too few values, or weights that are not.
pub fn observe_prepared(
    recording: &Recording,
    direction: Direction,
    weight: f64,
    preparation: Preparation,
) -> Result<(Observation, Vec<Warning>)> {
    let path = recording.path();
    let (input, mut measured) = match direction {
        Direction::Force => (recording.drive()?, recording.displacement()?),
        Direction::Displacement => {
            let force = recording.force().ok_or_else(|| Error::file(path, "no column force_n to fit"))?;
            (recording.displacement_drive()?, force)
        }
    };
    if preparation.inverted {
        measured.value.iter_mut().for_each(|value| *value = -*value);
    }
    let (window, skipped) = preparation.gaps.apply(preparation.window, input.samples(), &mut measured);
    let (input, measured) =
        if window == Window::ALL { (input, measured) } else { window.cut(path, &input, &measured)? };
    let drive = input.samples();
    check(path, direction, &measured, drive)?;
    let steps: Vec<f64> = differences(&drive.time_s).collect();
    let median_step_s = median(&steps);
    let name = shown(path);
    let (rate_hz, uneven) = rate(&steps, median_step_s, drive);
    let rate_hz = rate_hz * steps_per_row(&load(&input), 1.0 / rate_hz, drive);
    let gap = if preparation.gaps == Gaps::Interpolate {
        let remark = sampling::gap(&drive.time_s);
        remark.map(|remark| remark + " (`gap_s` ends there, or skips it)")
    } else {
        skipped
    };
    let (temperature_c, varies) = temperature(recording)?;
    let of = |severity: Severity| move |text: String| (severity, text);
    let warnings = gap
        .into_iter()
        .chain(saturation(direction, &input, &measured))
        .chain(slack(&input, &measured))
        .map(of(Severity::Caution))
        .chain(uneven.map(of(Severity::Note)))
        .chain(between_steps(drive, rate_hz).map(of(Severity::Caution)))
        .chain(varies.map(of(Severity::Caution)))
        .chain(turned(&input, &measured).map(of(Severity::Serious)));
    let warnings = warnings.map(|(severity, text)| severity.warning(format!("{name}: {text}"))).collect();
    let sample_weights = sample_weights(recording, &measured, preparation.log_time)?;
    let reading = Reading::default();
    Ok((Observation { name, input, measured, rate_hz, weight, sample_weights, reading, temperature_c }, warnings))
}

/// Warnings of what the reader remarks on a `recording`.
pub fn remarks(recording: &Recording) -> impl Iterator<Item = Warning> {
    let remarks = recording.remarks().into_iter();
    remarks.map(|remark| Severity::Caution.warning(format!("{}: {remark}", shown(recording.path()))))
}

/// The observations of all `recordings` with weight 1, as of one temperature, without the warnings.
pub fn observe_all(recordings: &[Recording], direction: Direction) -> Result<Vec<Observation>> {
    let observed = |recording| Ok(observe(recording, direction, 1.0)?.0.at_one_temperature());
    recordings.iter().map(observed).collect()
}

/// Refuses recordings with too few values, or whose input or measurement does not change.
fn check(path: &Path, direction: Direction, measured: &Samples, drive: &Samples) -> Result<()> {
    let (what, unit) = measured_quantity(direction);
    if measured.value.len() < MIN_VALUES {
        let cause = format!("{} values of {what}; a fit needs at least {MIN_VALUES}", measured.value.len());
        return Err(Error::file(path, cause));
    }
    let (low, high) = range(&measured.value);
    if low == high {
        return Err(Error::file(path, format!("the {what} is {low} {unit} throughout; there is nothing to fit")));
    }
    if high - low < MIN_CHANGE {
        let cause = format!("the {what} changes by {:.1e} {unit} only; check its unit", high - low);
        return Err(Error::file(path, cause));
    }
    if range(&drive.value) == (0.0, 0.0) {
        return Err(Error::file(path, "the input is 0 throughout; there is nothing to fit"));
    }
    Ok(())
}

/// Most steps of a recording whose rows are not even: a fit of five branches then takes minutes.
const MAX_UNEVEN_STEPS: f64 = 65_536.0;

/// The rate (Hz) at which the model runs along `drive`, and a warning where its rows are not even.
///
/// It is the median rate of even rows. Rows that begin densely, such as logarithmic ones, need the rate of their dense tenth,
/// and the time between a held load and the first row needs eight steps: the first-order error of the Grünwald–Letnikov
/// derivative j steps after a jump is about α (1 − α) / (2 j).
fn rate(steps: &[f64], median_step_s: f64, drive: &Samples) -> (f64, Option<String>) {
    let duration_s = drive.time_s.last().copied().unwrap_or(0.0);
    // For bursts with long pauses: at most eight steps per row.
    let even_hz = (1.0 / median_step_s).min(8.0 * drive.time_s.len() as f64 / duration_s);
    let sorted = sorted(steps.iter().copied());
    let dense_s = sorted[sorted.len() / 10];
    let lead_s = drive.time_s[0];
    let dense_hz = if dense_s < 0.5 * median_step_s { 1.0 / dense_s } else { 0.0 };
    let lead_hz = if lead_s > 0.0 { 8.0 / lead_s } else { 0.0 };
    let wanted_hz = dense_hz.max(lead_hz);
    if wanted_hz <= even_hz {
        return (even_hz, None);
    }
    let rate_hz = wanted_hz.min(MAX_UNEVEN_STEPS / duration_s).max(even_hz);
    let between = steps.iter().filter(|&&step| step < 0.5 / rate_hz).count();
    let mut warning = format!("rows from {:.3e} to {:.3e} s apart", sorted[0], sorted[sorted.len() - 1]);
    if lead_s > 0.0 {
        warning += &format!(", the load applied {lead_s:.3e} s before the first");
    }
    warning += &format!(": the model runs at {rate_hz:.4} Hz");
    if between > 0 {
        warning +=
            &format!("; {between} rows fall between its steps and count less: cut the recording's end to resolve them");
    }
    (rate_hz, Some(warning))
}

impl Observation {
    /// The file name of the recording.
    pub fn file_name(&self) -> String {
        Path::new(&self.name).file_name().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// The same without its temperature, for models that know none.
    #[must_use]
    pub fn at_one_temperature(self) -> Self {
        Self { temperature_c: None, ..self }
    }

    /// Whether the load, 0 before the first row, jumps by more than a tenth of its range from one row to the next, and not as fast everywhere.
    pub(super) fn jumps(&self) -> bool {
        const LARGE: f64 = 0.1;
        let load = load(&self.input);
        let size = change(&load);
        let changes = sorted(differences(&load).map(f64::abs));
        let usual = changes.get(changes.len() * 9 / 10).copied().unwrap_or(0.0);
        let starts = load.first().is_some_and(|first| first.abs() > LARGE * size);
        starts || changes.last().is_some_and(|most| *most > (LARGE * size).max(5.0 * usual))
    }
}

/// The quantity that a response is nearly proportional to, for each row: the square of a voltage.
pub(super) fn load(input: &Input) -> Vec<f64> {
    let values = &input.samples().value;
    match input {
        Input::Voltage(_) => values.iter().map(|v| v * v).collect(),
        Input::Force(_) | Input::Displacement(_) => values.clone(),
    }
}

/// Steps of the model for each row of a `load` with so coarse rows that it bends between them: a line through two rows would miss it by more
/// than 0.02 % of its range. Corners, steps and noise are not finer with more steps.
fn steps_per_row(load: &[f64], step_s: f64, drive: &Samples) -> f64 {
    const ALLOWED: f64 = 2e-4;
    const MAX_STEPS: f64 = 8.0;
    let duration_s = drive.time_s.last().copied().unwrap_or(0.0);
    // Mean square of second differences over so many rows, without corners and steps.
    let bend = |rows: usize| {
        let even = |k: &usize| {
            let [a, b, c] = [0, rows, 2 * rows].map(|ahead| drive.time_s[k + ahead]);
            (b - a - rows as f64 * step_s).abs().max((c - b - rows as f64 * step_s).abs()) < 0.1 * step_s
        };
        let count = load.len().saturating_sub(2 * rows);
        let second = |k: usize| (load[k] - 2.0 * load[k + rows] + load[k + 2 * rows]).powi(2);
        let squares = sorted((0..count).filter(even).map(second));
        mean(&squares[..squares.len() * 49 / 50])
    };
    // Of a smooth load it grows with the fourth power, of noise not at all.
    let smooth = ((bend(2) - bend(1)) / 15.0).max(0.0).sqrt();
    let steps = (smooth / 8.0 / (ALLOWED * change(load))).sqrt().ceil();
    steps.min(MAX_UNEVEN_STEPS * step_s / duration_s).clamp(1.0, MAX_STEPS)
}

/// The observation with fewer samples, of which the input is still followed to 0.2 % of its range: some 30 for a period of a sine.
#[must_use]
pub fn thinned(observation: &Observation) -> Observation {
    const MIN_SAMPLES: usize = 800;
    const ALLOWED: f64 = 0.002;
    let load = load(&observation.input);
    let size = change(&load);
    let follows = |every: usize| {
        let error: f64 = load
            .chunks(every)
            .zip(load.chunks(every).skip(1))
            .map(|(chunk, next)| {
                let slope = (next[0] - chunk[0]) / every as f64;
                chunk.iter().enumerate().map(|(k, value)| (chunk[0] + slope * k as f64 - value).powi(2)).sum::<f64>()
            })
            .sum();
        (error / load.len() as f64).sqrt() <= ALLOWED * size
    };
    let every = [1000, 400, 200, 100, 80, 50, 40, 25, 20, 10, 8, 5, 4, 2]
        .into_iter()
        .find(|&every| load.len() / every >= MIN_SAMPLES && follows(every))
        .unwrap_or(1);
    let Observation { measured, sample_weights, .. } = observation;
    // Rows that do not count would take the places of those that do.
    let counts = |k: &usize| sample_weights.get(*k).is_none_or(|weight| *weight > 0.0);
    let counted: Vec<usize> = (0..measured.value.len()).filter(counts).collect();
    // As many measurements as there are steps, if there are that many.
    let every_measured = (counted.len() * every / load.len()).max(1);
    let pick =
        |values: &[f64]| counted.iter().step_by(every_measured).filter_map(|k| values.get(*k)).copied().collect();
    Observation {
        rate_hz: observation.rate_hz / every as f64,
        measured: Samples { time_s: pick(&measured.time_s), value: pick(&measured.value) },
        sample_weights: pick(sample_weights),
        ..observation.clone()
    }
}

/// The beginning of the observation, at most `steps` of its rate: for the first search of a long recording.
#[must_use]
pub fn beginning(observation: &Observation, steps: usize) -> Observation {
    let last_s = steps as f64 / observation.rate_hz;
    let kept = |samples: &Samples| {
        let count = samples.time_s.partition_point(|&t| t <= last_s);
        Samples { time_s: samples.time_s[..count].to_vec(), value: samples.value[..count].to_vec() }
    };
    let measured = kept(&observation.measured);
    let mut sample_weights = observation.sample_weights.clone();
    sample_weights.truncate(measured.value.len());
    Observation { input: observation.input.map(kept), measured, sample_weights, ..observation.clone() }
}

/// The mean temperature of `recording`, °C, and a warning where it varies.
fn temperature(recording: &Recording) -> Result<(Option<f64>, Option<String>)> {
    /// Range of temperatures, K, over which a film is as good as the same.
    const SAME_K: f64 = 2.0;
    let Some(temperature_c) = recording.mean_temperature_c()? else { return Ok((None, None)) };
    let (low, high) = recording.temperature_c().map_or((temperature_c, temperature_c), |of| range(&of.value));
    let varies = high - low > SAME_K;
    let warning = varies.then(|| {
        format!("temperature_c goes from {low:.1} to {high:.1} °C within the recording, whose film is fitted at the mean: keep it within {SAME_K} K")
    });
    Ok((Some(temperature_c), warning))
}

/// The excitation in a set of observations: from it quantities of the actuator and the sensor are identified.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Excitation {
    /// Whether any input is a voltage.
    pub voltage_driven: bool,
    /// Whether any measurement is of displacement.
    pub displacement_fitted: bool,
    /// Whether the size of any input varies by more than 1 %.
    pub varies: bool,
    /// Whether the recordings are at temperatures that differ.
    pub temperatures: bool,
}

impl Excitation {
    /// The excitation of `observations`.
    pub fn new(observations: &[Observation]) -> Self {
        let varies = |observation: &Observation| {
            let values = &observation.input.samples().value;
            let (low, high) =
                values.iter().fold((f64::INFINITY, 0f64), |(low, high), v| (low.min(v.abs()), high.max(v.abs())));
            high - low > 0.01 * high
        };
        Self {
            voltage_driven: observations.iter().any(|o| matches!(o.input, Input::Voltage(_))),
            displacement_fitted: observations.iter().any(|o| !matches!(o.input, Input::Displacement(_))),
            varies: observations.iter().any(varies),
            temperatures: temperatures_c(observations).is_some_and(|(low, high)| high - low >= MIN_SPAN_K),
        }
    }

    /// Whether `variable`, of the actuator or the sensor, has an effect on the observations.
    pub fn identifies(self, variable: Variable) -> bool {
        match variable {
            Variable::StretchCoupling | Variable::Saturation => self.voltage_driven && self.varies,
            Variable::Offset => self.displacement_fitted,
            Variable::Delay => self.displacement_fitted && self.varies,
            Variable::Mass => true,
            _ if variable.is_of_temperature() => self.temperatures,
            _ if variable.is_of_curve() => true,
            _ => self.voltage_driven,
        }
    }
}

/// Difference of temperatures, K, from which their effect is fitted.
pub(super) const MIN_SPAN_K: f64 = 3.0;

/// Lowest and highest temperature of the observations that have one, °C.
pub(super) fn temperatures_c(observations: &[Observation]) -> Option<(f64, f64)> {
    let values: Vec<f64> = observations.iter().filter_map(|observation| observation.temperature_c).collect();
    (!values.is_empty()).then(|| range(&values))
}

/// A dependence on the temperature that is not known yet, about the mean of the temperatures; none where these do not differ.
pub(super) fn unknown_dependence(observations: &[Observation]) -> Option<TemperatureDependence> {
    /// Digits of the reference, °C.
    const TENTH: f64 = 10.0;
    let values: Vec<f64> = observations.iter().filter_map(|observation| observation.temperature_c).collect();
    let mean = mean(&values);
    Excitation::new(observations).temperatures.then(|| TemperatureDependence::none((TENTH * mean).round() / TENTH))
}
