//! Recordings as a fit uses them, with checks and warnings before the fit.

use std::path::Path;

use super::candidate::Variable;
use super::preparation::{Gaps, Preparation, Window, sample_weights};
use super::warnings::{Severity, Warning};
use crate::error::{Error, Result};
use crate::files::recording::{Direction, Input, Recording};
use crate::grid::{Grid, Samples};

/// A recording as a fit uses it.
#[derive(Clone, Debug)]
pub struct Observation {
    /// Name of the recording.
    pub name: String,
    /// Input of the model.
    pub input: Input,
    /// What was measured: displacement (m), or force (N) where displacement is the input.
    pub measured: Samples,
    /// Steps per second.
    pub rate_hz: f64,
    /// Factor of its residuals.
    pub weight: f64,
    /// Factors of the single residuals, one per measured value; empty where all are 1.
    pub sample_weights: Vec<f64>,
    /// How its readings may differ from those of the other recordings.
    pub reading: Reading,
}

/// What of a recording's readings is its own: solved with the model's response, linearly, in every evaluation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reading {
    /// An offset: a sensor that was zeroed anew.
    pub own_offset: bool,
    /// A factor: another specimen. It is relative to the first recording, whose factor is 1.
    pub own_gain: bool,
}

/// Smaller changes are below the resolution of any sensor, m or N.
const MIN_CHANGE: f64 = 1e-12;

/// Fewest measured values of a fit.
pub(super) const MIN_VALUES: usize = 10;

/// Name and SI unit of what is measured.
fn measured_quantity(direction: Direction) -> (&'static str, &'static str) {
    match direction {
        Direction::Force => ("displacement", "m"),
        Direction::Displacement => ("force", "N"),
    }
}

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
    let steps: Vec<f64> = drive.time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let median_step_s = median(&steps);
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let (rate_hz, uneven) = rate(&steps, median_step_s, drive);
    let gap = if preparation.gaps == Gaps::Interpolate { gap(&steps, median_step_s, drive) } else { skipped };
    let of = |severity: Severity| move |text: String| (severity, text);
    let warnings = gap
        .into_iter()
        .chain(saturation(direction, &measured.value))
        .map(of(Severity::Caution))
        .chain(uneven.map(of(Severity::Note)))
        .chain(between_steps(drive, rate_hz).map(of(Severity::Caution)))
        .chain(turned(&input, &measured).map(of(Severity::Serious)));
    let warnings = warnings.map(|(severity, text)| severity.warning(format!("{name}: {text}"))).collect();
    let sample_weights = sample_weights(recording, &measured, preparation.log_time)?;
    let reading = Reading::default();
    Ok((Observation { name, input, measured, rate_hz, weight, sample_weights, reading }, warnings))
}

/// Input that the steps of the model do not follow: it is sampled at them, with straight lines between.
fn between_steps(drive: &Samples, rate_hz: f64) -> Option<String> {
    /// Share of the input's change that is not noise.
    const ALLOWED: f64 = 0.05;
    let grid = Grid::covering(drive.time_s.last().copied()?, rate_hz).ok()?;
    let followed = grid.at(&grid.resample(drive), &drive.time_s);
    let size = change(&drive.value);
    let off = |(value, followed): (&f64, &f64)| (value - followed).abs() / size;
    let worst = drive.value.iter().zip(&followed).map(off).fold(0.0, f64::max);
    (worst > ALLOWED).then(|| {
        format!(
            "the input moves between the model's steps of {:.4} s, by up to {:.0} % of its range: what happens there is not \
             fitted",
            grid.step_s(),
            100.0 * worst
        )
    })
}

/// A measured quantity that falls where the input grows.
fn turned(input: &Input, measured: &Samples) -> Option<String> {
    let drive = input.samples();
    let load: Vec<f64> =
        drive.value.iter().map(|v| if matches!(input, Input::Voltage(_)) { v * v } else { *v }).collect();
    let at = |t: f64| load[drive.time_s.partition_point(|&s| s <= t).saturating_sub(1)];
    let pairs: Vec<(f64, f64)> = measured.time_s.iter().zip(&measured.value).map(|(&t, &y)| (at(t), y)).collect();
    let n = pairs.len() as f64;
    let (what, of, centre) = match input {
        Input::Voltage(_) => ("displacement", "voltage", true),
        Input::Force(_) => ("displacement", "force", true),
        // Both are 0 at rest, and a force relaxes while the displacement grows slowly.
        Input::Displacement(_) => ("force", "displacement", false),
    };
    let mean = |of: fn(&(f64, f64)) -> f64| if centre { pairs.iter().map(of).sum::<f64>() / n } else { 0.0 };
    let (load_mean, value_mean) = (mean(|p| p.0), mean(|p| p.1));
    let sum = |of: &dyn Fn(f64, f64) -> f64| pairs.iter().map(|p| of(p.0 - load_mean, p.1 - value_mean)).sum::<f64>();
    let correlation = sum(&|u, y| u * y) / (sum(&|u, _| u * u) * sum(&|_, y| y * y)).sqrt();
    (correlation < -0.3).then(|| format!("the {what} falls where the {of} grows: --invert turns its sign"))
}

/// The observations of all `recordings` with weight 1, without the warnings.
///
/// # Errors
///
/// As [`observe`].
pub fn observe_all(recordings: &[Recording], direction: Direction) -> Result<Vec<Observation>> {
    recordings.iter().map(|recording| observe(recording, direction, 1.0).map(|(observation, _)| observation)).collect()
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
    let mut sorted = steps.to_vec();
    sorted.sort_by(f64::total_cmp);
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

/// The first gap in the input.
fn gap(steps: &[f64], median_step_s: f64, drive: &Samples) -> Option<String> {
    // Steps that grow little by little, such as logarithmic ones, are no gap.
    let is_gap = |k: usize| steps[k] > 5.0 * median_step_s && (k == 0 || steps[k] > 2.0 * steps[k - 1]);
    let k = (0..steps.len()).find(|&k| is_gap(k))?;
    let (step, time) = (steps[k], drive.time_s[k]);
    Some(format!(
        "a gap of {step:.3} s at {time:.3} s; the input is interpolated across it (--gap ends there, or skips it)"
    ))
}

/// Measured values that repeat at the ends of their range.
fn saturation(direction: Direction, values: &[f64]) -> Vec<String> {
    let (what, unit) = measured_quantity(direction);
    let (low, high) = range(values);
    [(high, "largest"), (low, "smallest")]
        .into_iter()
        .filter_map(|(value, end)| {
            let at_end = runs_at(values, value);
            (at_end * 50 > values.len() && value != values[0]).then(|| {
                format!(
                    "{at_end} values are at the {end} {what} of {value} {unit}; if the sensor saturates there, leave \
                     those cells empty"
                )
            })
        })
        .collect()
}

/// The observation with fewer samples, of which the input is still followed to 0.5 % of its range: for first searches.
#[must_use]
pub fn thinned(observation: &Observation) -> Observation {
    const MIN_SAMPLES: usize = 800;
    const ALLOWED: f64 = 0.005;
    let drive = observation.input.samples();
    let load: Vec<f64> = match observation.input {
        Input::Voltage(_) => drive.value.iter().map(|v| v * v).collect(),
        Input::Force(_) | Input::Displacement(_) => drive.value.clone(),
    };
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
    let measured = &observation.measured;
    // As many measurements as there are steps, if there are that many.
    let every_measured = (measured.value.len() * every / load.len()).max(1);
    let pick = |values: &[f64]| values.iter().copied().step_by(every_measured).collect::<Vec<f64>>();
    Observation {
        rate_hz: observation.rate_hz / every as f64,
        measured: Samples { time_s: pick(&measured.time_s), value: pick(&measured.value) },
        sample_weights: pick(&observation.sample_weights),
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

/// What a set of observations contains that quantities of the actuator and the sensor can be identified from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Excitation {
    /// Whether any input is a voltage.
    pub voltage_driven: bool,
    /// Whether any measurement is of displacement.
    pub displacement_fitted: bool,
    /// Whether the size of any input varies by more than 1 %.
    pub varies: bool,
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
        }
    }

    /// Whether `variable`, of the actuator or the sensor, has an effect on the observations.
    pub fn identifies(self, variable: Variable) -> bool {
        match variable {
            Variable::StretchCoupling | Variable::Saturation => self.voltage_driven && self.varies,
            Variable::Offset => self.displacement_fitted,
            Variable::Mass => true,
            _ if variable.is_of_curve() => true,
            _ => self.voltage_driven,
        }
    }
}

/// Smallest and largest value.
pub(super) fn range(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)))
}

/// Peak to peak of a load; its size where it varies by at most 1 %, because it was applied at once and held.
pub(super) fn change(load: &[f64]) -> f64 {
    let (low, high) = range(load);
    let size = low.abs().max(high.abs());
    if high - low > 0.01 * size { high - low } else { size }
}

/// The median; NaN if empty.
#[must_use]
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Values that equal `value` in runs of at least four.
fn runs_at(values: &[f64], value: f64) -> usize {
    values.chunk_by(|a, b| a == b).filter(|run| run[0] == value && run.len() >= 4).map(<[f64]>::len).sum()
}
