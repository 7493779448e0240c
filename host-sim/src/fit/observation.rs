//! Recordings as a fit sees them, with what should be known about them beforehand.

use crate::error::{Error, Result};
use crate::files::recording::{Direction, Input, Recording};
use crate::grid::Samples;

use super::objective::Observation;
use super::starts::Scales;

/// No sensor sees smaller changes, m or N.
const SMALLEST: f64 = 1e-12;

/// The observation of `recording`, and warnings about it.
///
/// # Errors
///
/// [`Error`] for a recording from which nothing can be learnt, naming it.
pub fn observe(recording: &Recording, direction: Direction, weight: f64) -> Result<(Observation, Vec<String>)> {
    let path = recording.path();
    let (input, measured) = match direction {
        Direction::Force => (recording.drive()?, recording.displacement()?),
        Direction::Displacement => {
            let force = recording.force().ok_or_else(|| Error::file(path, "no column force_n to fit"))?;
            (recording.displacement_drive()?, force)
        }
    };
    let drive = input.samples();
    let (what, unit) = match direction {
        Direction::Force => ("displacement", "m"),
        Direction::Displacement => ("force", "N"),
    };
    if measured.value.len() < 10 {
        return Err(Error::file(path, format!("{} values of {what}; a fit needs at least 10", measured.value.len())));
    }
    let (low, high) = range(&measured.value);
    if low == high {
        return Err(Error::file(path, format!("the {what} is {low} {unit} throughout; there is nothing to fit")));
    }
    if high - low < SMALLEST {
        let cause = format!("the {what} changes by {:.1e} {unit} only; check its unit", high - low);
        return Err(Error::file(path, cause));
    }
    let (low_drive, high_drive) = range(&drive.value);
    if low_drive == high_drive && high_drive == 0.0 {
        return Err(Error::file(path, "what drives the film is 0 throughout; there is nothing to fit"));
    }

    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut warnings = Vec::new();
    let steps: Vec<f64> = drive.time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let usual = median(&steps);
    if let Some(k) = (0..steps.len()).find(|&k| steps[k] > 5.0 * usual) {
        warnings.push(format!(
            "{name}: a gap of {:.3} s at {:.3} s; what drives the film is interpolated across it",
            steps[k], drive.time_s[k]
        ));
    }
    for (value, end) in [(high, "largest"), (low, "smallest")] {
        let at_end = runs_at(&measured.value, value);
        if at_end * 50 > measured.value.len() && value != measured.value[0] {
            warnings.push(format!(
                "{name}: {at_end} values stand at the {end} {what} of {value} {unit}; if the sensor is saturated there, \
                 leave those cells empty"
            ));
        }
    }
    // Bursts with long pauses are followed no finer than eight steps per row.
    let duration = drive.time_s.last().copied().unwrap_or(0.0);
    let rate_hz = (1.0 / usual).min(8.0 * drive.time_s.len() as f64 / duration);
    let observation = Observation { name, input, measured, rate_hz, weight };
    Ok((observation, warnings))
}

/// A recording with fewer samples that still follows what drives the film: where searches begin.
#[must_use]
pub fn thinned(observation: &Observation) -> Observation {
    const FEWEST: usize = 800;
    const ALLOWED: f64 = 0.005;
    let drive = observation.input.samples();
    let load: Vec<f64> = match observation.input {
        Input::Voltage(_) => drive.value.iter().map(|v| v * v).collect(),
        Input::Force(_) | Input::Displacement(_) => drive.value.clone(),
    };
    let (low, high) = range(&load);
    let follows = |every: usize| {
        let error: f64 = load
            .chunks(every)
            .zip(load.chunks(every).skip(1))
            .map(|(chunk, next)| {
                let slope = (next[0] - chunk[0]) / every as f64;
                chunk.iter().enumerate().map(|(k, value)| (chunk[0] + slope * k as f64 - value).powi(2)).sum::<f64>()
            })
            .sum();
        (error / load.len() as f64).sqrt() <= ALLOWED * (high - low)
    };
    let every = [1000, 400, 200, 100, 80, 50, 40, 25, 20, 10, 8, 5, 4, 2]
        .into_iter()
        .find(|&every| load.len() / every >= FEWEST && follows(every))
        .unwrap_or(1);
    let measured = &observation.measured;
    // As many measurements as there are steps, if there are that many.
    let every_measured = (measured.value.len() * every / load.len()).max(1);
    let pick = |values: &[f64]| values.iter().copied().step_by(every_measured).collect();
    Observation {
        rate_hz: observation.rate_hz / every as f64,
        measured: Samples { time_s: pick(&measured.time_s), value: pick(&measured.value) },
        ..observation.clone()
    }
}

/// What the observations tell before anything is fitted; `force_per_square_volt` turns voltage into force.
#[must_use]
pub fn scales(observations: &[Observation], force_per_square_volt: f64) -> Scales {
    let mut stiffness = Vec::new();
    let (mut longest, mut shortest, mut stroke) = (0f64, f64::INFINITY, 0f64);
    for observation in observations {
        let drive = observation.input.samples();
        let (low, high) = range(&observation.measured.value);
        let measured = high - low;
        stiffness.push(match observation.input {
            Input::Voltage(_) => {
                let squared: Vec<f64> = drive.value.iter().map(|v| v * v).collect();
                let (low, high) = range(&squared);
                let change = if high > low { high - low } else { high };
                force_per_square_volt * change / measured
            }
            Input::Force(_) => {
                let (low, high) = range(&drive.value);
                (if high > low { high - low } else { high.abs() }) / measured
            }
            Input::Displacement(_) => {
                let (low, high) = range(&drive.value);
                measured / (high - low).max(f64::MIN_POSITIVE)
            }
        });
        if !matches!(observation.input, Input::Displacement(_)) {
            stroke = stroke.max(measured);
        }
        longest = longest.max(drive.time_s.last().copied().unwrap_or(0.0));
        shortest = shortest.min(10.0 / observation.rate_hz);
    }
    let stiffness = median(&stiffness).max(1e-3);
    Scales {
        stiffness,
        times_s: (shortest.min(0.1 * longest), 2.0 * longest),
        coupling: if stroke > 0.0 { (0.15 / stroke).min(1e3) } else { 0.0 },
    }
}

fn range(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)))
}

/// The middle value; NaN of nothing.
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
