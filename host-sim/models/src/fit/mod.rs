//! Fits of the model to recordings: parameters, structure, and their uncertainty.
//!
//! [`fit`] takes observations of recordings ([`observation`]) and [`Settings`], and returns a [`Fit`]. It minimises the
//! [`objective`], model minus measurement, over the variables of a [`candidate`] model: from many starts for one structure
//! (`descent`), for all structures of the settings (`search`), of which `selection` selects one, or by the paper's procedure
//! (`pattern_search`).
//! Before it `faults` of the recordings are looked for; the `uncertainty` of the parameters comes last.

pub mod bend;
pub mod candidate;
pub mod capacitance;
pub mod checks;
mod delay;
pub(crate) mod descent;
pub(crate) mod explained;
pub(crate) mod faults;
mod jitter;
pub(crate) mod left_out;
pub mod objective;
pub mod observation;
pub mod options;
pub(crate) mod pattern_search;
mod plain;
pub mod preparation;
mod provenance;
pub mod readings;
mod repeats;
pub mod report;
pub mod residuals;
mod resolution;
pub mod rising;
mod search;
pub mod selection;
pub mod settings;
pub(crate) mod starts;
mod transfer;
pub mod uncertainty;

use std::f64::consts::PI;
use std::sync::atomic::{AtomicBool, Ordering};

use springpot::Actuator;

use crate::agreement::{Agreement, mean_r2};
use crate::error::{Error, Result};
use crate::files::recording::Input;
use crate::progress::Stage;
use crate::replay::expectation::Recorded;
use crate::statistics::{mean, peak, range};
use bend::Elastic;
use candidate::{Candidate, Variable};
use checks::Misfit;
use descent::{Context, PreparedObservations};
use observation::{Excitation, Observation};
pub use options::FitOptions;
pub use preparation::{Severity, Warning};
pub use provenance::check_recorded;
use readings::Reading;
pub use readings::ReadingFit;
pub use report::FitReport;
pub use residuals::Loss;
use search::{Search, Selected};
pub use selection::StructureRow;
use settings::Stages;
pub use settings::{CurveChoice, Method, Settings};
use starts::Kind;
pub use uncertainty::{Estimate, Uncertainty};

/// A fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The best candidate.
    pub candidate: Candidate,
    /// Its structure fitted to parts of the recordings.
    pub refits: Vec<Candidate>,
    /// Modelled values at the measured times of every observation.
    pub modelled: Vec<Vec<f64>>,
    /// Offset and gain of every observation's readings.
    pub readings: Vec<ReadingFit>,
    /// Rate of the model along every observation, Hz.
    pub rates_hz: Vec<f64>,
    /// Agreement with every observation.
    pub agreements: Vec<Agreement>,
    /// Mean of the observations' R².
    pub r2_mean: f64,
    /// Structures that were compared; empty for a single structure.
    pub structures: Vec<StructureRow>,
    /// The range of the recordings, and the error on what was left out.
    pub recorded: Recorded,
    /// Largest RMS error to expect of feedforward, or of a predicted force, within what was recorded, % of the stroke or of the force's range.
    pub expected_pct: f64,
    /// Uncertainty of the parameters, if it was computed.
    pub uncertainty: Option<Uncertainty>,
    /// Warnings to the user.
    pub warnings: Vec<Warning>,
    /// Number of residual evaluations.
    pub evaluations: usize,
    /// Whether the search was ended early.
    pub interrupted: bool,
}

/// Fits `observations`. `progress` is called with each stage as it begins; `stop` ends the search early with the best so far.
///
/// # Errors
///
/// [`Error`] for invalid settings, or recordings that cannot be fitted.
pub fn fit(
    observations: &[Observation],
    settings: &Settings,
    stop: &AtomicBool,
    progress: &dyn Fn(&Stage),
) -> Result<Fit> {
    settings.check()?;
    if settings.curve == CurveChoice::Series && Kind::for_choice(settings.curve, observations).len() == 1 {
        let cause = "a spring in series is fitted to displacements under a voltage or a force, not to forces along a displacement";
        return Err(Error::field("curve", cause));
    }
    refuse_copies(observations)?;
    let stages = Stages::new(settings, Kind::for_choice(settings.curve, observations).len() - 1, progress);
    stages.note("faults of the recordings");
    let faults = faults::Found::new(observations);
    // Zeros are solved by least squares.
    let is_solved = settings.method == Method::Lm && settings.loss == Loss::Square;
    let observations = with_zeros(observations, if is_solved { faults.reading() } else { Reading::default() });
    let observations = &with_temperatures(observations, settings, is_solved)?;
    let prepared = PreparedObservations::new(observations, &settings.actuator)?;
    let mut context = prepared.context(settings, stop);
    if observations.iter().all(|observation| observation.reading.own_offset) {
        context.freed.retain(|variable| *variable != Variable::Offset);
    }
    if settings.branches.iter().all(|&branches| context.variables(branches).is_empty()) {
        return Err(Error::field("hold", "nothing is left to fit"));
    }
    let best = |context: &Context<'_>| Search { context, observations, settings, stages: &stages }.best();
    let mut selected = best(&context)?;
    if settings.sensor_delay_s.is_none() && settings.method == Method::Lm && !stop.load(Ordering::Relaxed) {
        stages.note("the sensor's delay");
        if let Some(delay_s) = delay::suspected(&context, &selected.found) {
            let late = best(&context.with_delay(delay_s))?;
            if delay::is_kept(&context, &late.found, &selected.found) {
                selected = late;
            }
        }
    }
    let Selected { found, rows, mut refits } = selected;
    // A start gave the order of its branches.
    let mut found = if settings.start.is_none() { context.in_order(found, settings.method) } else { found };
    if settings.method == Method::Lm {
        found = uncertainty::at_minimum(&context, found);
    }
    let interrupted = stop.load(Ordering::Relaxed);
    let mut uncertainty = None;
    if settings.uncertainty && settings.method == Method::Lm && !interrupted {
        stages.note("uncertainty of the parameters");
        uncertainty = Uncertainty::from_fit(&context, &found);
        if refits.is_empty() && context.excitation.voltage_driven {
            stages.note("fits to parts of the recordings");
            refits = search::refits(&context, observations, &found)?;
        }
    }
    if settings.method == Method::Lm && !interrupted {
        found = plain::with_plain_orders(&context, found);
        if let Some(uncertainty) = &mut uncertainty {
            uncertainty.state(&found);
        }
    }
    Fit::new(&context, observations, settings, &faults, Selected { found, rows, refits }, uncertainty, interrupted)
}

/// The delay (s) of the sensor that the beginning of the thinned `observations` shows, whichever small structure the film has, and its
/// interval.
pub(crate) fn late_s(observations: &[Observation]) -> Option<(f64, [f64; 2])> {
    if Excitation::new(observations).temperatures {
        return None;
    }
    // Its inertia is not known.
    let settings = Settings { actuator: Actuator { mass_kg: 0.0, ..Actuator::KARNER_2022 }, ..Settings::default() };
    let prepared = PreparedObservations::beginnings(observations, &settings.actuator).ok()?;
    delay::of_small_structures(&prepared.context(&settings, &AtomicBool::new(false)))
}

/// `observations` whose readings have the zeros of `reading` as well.
fn with_zeros(observations: &[Observation], reading: Reading) -> Vec<Observation> {
    let with = |observation: &Observation| {
        let Reading { own_offset, own_gain, .. } = observation.reading;
        let reading = Reading { own_offset: own_offset || reading.own_offset, own_gain, ..reading };
        Observation { reading, ..observation.clone() }
    };
    observations.iter().map(with).collect()
}

/// `observations` for a fit of the temperature. Where neither they nor a start show its effect, they are at the mean of their temperatures. Where they do, each has a
/// zero of its own, since a film rests elsewhere at another temperature.
fn with_temperatures(
    mut observations: Vec<Observation>,
    settings: &Settings,
    is_solved: bool,
) -> Result<Vec<Observation>> {
    let differ = Excitation::new(&observations).temperatures && settings.method == Method::Lm;
    let is_known = settings.start.as_ref().is_some_and(|start| start.temperature.is_some());
    if let Some(without) = observations.iter().find(|o| (differ || is_known) && o.temperature_c.is_none()) {
        let others = if is_known {
            "the start is of several temperatures"
        } else {
            "the others are at temperatures that differ"
        };
        let cause = format!(
            "{} has no column temperature_c, and {others}: add the column, or leave the recording out",
            without.name
        );
        return Err(Error::Computation(cause));
    }
    if differ && settings.loss != Loss::Square {
        let cause = "recordings at temperatures that differ have zeros of their own, which are solved by least squares";
        return Err(Error::field("loss", cause));
    }
    let keeps_spring = settings.start.as_ref().is_some_and(|start| matches!(start.spring, Some(Elastic::Held(_))));
    if differ && keeps_spring {
        let cause = "its spring is not one that a fit changes, and these recordings are at temperatures that differ: fit them without a start";
        return Err(Error::field("start", cause));
    }
    let near = observation::temperatures_c(&observations).filter(|(low, high)| high - low < observation::MIN_SPAN_K);
    for observation in &mut observations {
        if let Some((low, high)) = near.filter(|_| !is_known) {
            observation.temperature_c = observation.temperature_c.map(|_| 0.5 * (low + high));
        }
        let is_free =
            !settings.held.contains(&Variable::Offset) && !matches!(observation.input, Input::Displacement(_));
        observation.reading.own_offset |= differ && is_solved && is_free;
    }
    Ok(observations)
}

/// Description of the first recording that repeats another: no second measurement, with which intervals would be too narrow and left-out
/// errors those of the copy.
pub fn repeated(observations: &[Observation]) -> Option<String> {
    let (later, earlier) = repeats::first(observations)?;
    let name = &later.name;
    Some(if std::ptr::eq(later, earlier) {
        format!("{name}: its second half is a copy of its first: the noise is the same; leave one of them out")
    } else {
        let changes = "perhaps scaled, shifted, resampled, cut or smoothed";
        format!("{name}: is a copy of {}, {changes}: the noise is the same; leave it out", earlier.name)
    })
}

/// Refuses observations of which one is a copy of another.
pub(crate) fn refuse_copies(observations: &[Observation]) -> Result<()> {
    repeated(observations).map_or(Ok(()), |cause| Err(Error::Computation(cause)))
}

/// Part of a lead of the stroke over the drive that may be smoothing: calibrated on centred averages of 0.3 and 0.5 s.
const SMOOTHED: f64 = 0.55;

impl Fit {
    fn new(
        context: &Context<'_>,
        observations: &[Observation],
        settings: &Settings,
        faults: &faults::Found,
        selected: Selected,
        uncertainty: Option<Uncertainty>,
        interrupted: bool,
    ) -> Result<Self> {
        let Selected { found, rows: structures, refits } = selected;
        let objective = context.fine;
        let no_response = || Error::Computation("the fit has no response; check the units of the recordings".into());
        let mut candidate = found.candidate.clone();
        let evaluation = objective.evaluate(&candidate).ok_or_else(no_response)?;
        let (modelled, mut readings) = (evaluation.modelled, evaluation.readings);
        // Offsets are of the sensor; the file's is that of the first recording.
        if observations[0].reading.own_offset && !matches!(observations[0].input, Input::Displacement(_)) {
            for reading in &mut readings {
                reading.offset += reading.gain * candidate.offset_m;
            }
            candidate.offset_m = readings[0].offset;
        }
        let pairs = || objective.measured().zip(&modelled);
        let agreements: Vec<Agreement> = pairs().map(|(y, x)| Agreement::new(y, x)).collect();
        let r2_mean = mean_r2(&agreements);
        let residuals: Vec<Vec<f64>> = pairs().map(|(y, x)| y.iter().zip(x).map(|(y, x)| x - y).collect()).collect();
        let misfit = Misfit::new(observations, &residuals, structures.iter().find(|row| row.chosen));
        let mut recorded = recorded(observations, &modelled, &readings, &candidate, misfit);
        let faults = if candidate.delay_s == 0.0 { faults } else { &faults.without_lags() };
        let left = faults.left(observations[0].reading);
        let (size, lag_s) = faults.size_and_lag_s(&left);
        recorded.jitter_s = jitter::jitter_s(observations, &modelled, &residuals);
        // A stroke that was smoothed without delay leads as well, and has lost of its fast part what such a lag explains.
        let lag_s = lag_s + SMOOTHED * (-candidate.delay_s).max(0.0);
        (recorded.fault_m, recorded.lag_s) = (size * (recorded.stroke_m[1] - recorded.stroke_m[0]), lag_s);
        let expected_pct = expected_pct(context, &found.candidate, &refits, &recorded);

        let mut warnings = faults.warnings(&left);
        checks::of_sizes(settings, &candidate.actuator, context.excitation, &mut warnings);
        checks::of_excitation(context.excitation, &mut warnings);
        if settings.sensor_delay_s.is_none() && candidate.delay_s != 0.0 {
            checks::of_delay(&candidate, uncertainty.as_ref(), &mut warnings);
        }
        checks::of_temperatures(observations, &candidate, &mut warnings);
        jitter::warn(recorded.jitter_s, &mut warnings);
        checks::of_structures(&structures, &mut warnings);
        checks::of_order(&candidate, &mut warnings);
        checks::of_amplitudes(observations, &candidate, &mut warnings);
        if let Some(uncertainty) = &uncertainty {
            checks::of_uncertainty(uncertainty, &candidate, &mut warnings);
            let input = &observations[0].input;
            checks::of_whiteness(uncertainty.white, misfit, expected_pct, input, &mut warnings);
        }
        checks::of_convergence(found.minimum.converged || interrupted, &mut warnings);
        checks::of_outliers(&residuals.concat(), settings.loss, &mut warnings);
        checks::of_units(observations, &settings.actuator, r2_mean, settings.loss, &mut warnings);
        warnings.sort_by_key(|warning| warning.severity);
        Ok(Self {
            candidate,
            refits,
            readings,
            rates_hz: observations.iter().map(|observation| observation.rate_hz).collect(),
            modelled,
            agreements,
            r2_mean,
            structures,
            recorded,
            expected_pct,
            uncertainty,
            warnings,
            evaluations: context.evaluations.load(Ordering::Relaxed),
            interrupted,
        })
    }
}

/// Largest error (RMS, % of the stroke) to expect of a voltage of the recordings: from what the `refits` to parts of them differ from
/// `candidate` along it, or from the error on what was left out.
fn expected_pct(context: &Context<'_>, candidate: &Candidate, refits: &[Candidate], recorded: &Recorded) -> f64 {
    let stroke_m = recorded.stroke_m[1] - recorded.stroke_m[0];
    let moved = |candidate: &Candidate| context.coarse.evaluate(candidate).map(|found| found.responses.concat());
    let difference = || {
        let whole = moved(candidate)?;
        let square = |refit: &Candidate| {
            let off = moved(refit)?;
            Some(off.iter().zip(&whole).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / whole.len() as f64)
        };
        let squares: Vec<f64> = refits.iter().map(square).collect::<Option<_>>()?;
        (!squares.is_empty()).then(|| mean(&squares).sqrt())
    };
    let [_, largest_m] = recorded.error_m(difference(), recorded.speed_m_per_s / std::f64::consts::SQRT_2);
    100.0 * largest_m / stroke_m.max(f64::MIN_POSITIVE)
}

/// The ranges of `observations`, of which the displacements (m) are `modelled`, without noise.
fn recorded(
    observations: &[Observation],
    modelled: &[Vec<f64>],
    readings: &[ReadingFit],
    candidate: &Candidate,
    misfit: Misfit,
) -> Recorded {
    let temperature_c = observation::temperatures_c(observations).map(<[f64; 2]>::from);
    let mut recorded = Recorded { temperature_c, ..Recorded::default() };
    for ((observation, modelled), reading) in observations.iter().zip(modelled).zip(readings) {
        let (low, high) = range(modelled);
        let offset_m = reading.own_offset().unwrap_or(candidate.offset_m);
        recorded.stroke_m[0] = recorded.stroke_m[0].min(low - offset_m);
        recorded.stroke_m[1] = recorded.stroke_m[1].max(high - offset_m);
        let rises = modelled.windows(2).zip(observation.measured.time_s.windows(2));
        let speed = |(x, t): (&[f64], &[f64])| ((x[1] - x[0]) / (t[1] - t[0])).abs();
        let speed_m_per_s = rises.map(speed).fold(0.0, f64::max);
        recorded.speed_m_per_s = recorded.speed_m_per_s.max(speed_m_per_s);
        if high > low {
            recorded.frequency_hz = recorded.frequency_hz.max(speed_m_per_s / (PI * (high - low)));
        }
        let drive = observation.input.samples();
        if let Input::Voltage(_) = observation.input {
            recorded.voltage_v = recorded.voltage_v.max(peak(&drive.value));
        }
        recorded.time_s = recorded.time_s.max(drive.time_s.last().copied().unwrap_or(0.0));
    }
    [recorded.left_out_m, recorded.misfit_m] = [misfit.left_out_pct, misfit.systematic_pct]
        .map(|pct| 0.01 * pct * (recorded.stroke_m[1] - recorded.stroke_m[0]));
    recorded
}
