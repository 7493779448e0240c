//! Faults of recordings: what a sensor, an amplifier, a mount or a clock adds to the readings, found in what no film explains.
//!
//! Each cause is a change of the [film](super::explained) along the recordings: columns that are added to it, another voltage, or rows that are
//! left out. A cause is reported if with it less than 70 % of the unexplained squares are left; the best first, then what is left is asked again.
//! A fit estimates zeros that differ, drift or settle; for the other faults it widens the interval of the error to expect.

mod causes;
mod stuck;
mod voltage;

use std::cmp::Ordering;
use std::f64::consts::TAU;

use super::explained::{Basis, Blocks, Course};
use super::observation::{self, Observation};
use super::preparation::{Severity, Warning};
use super::readings::Reading;
use crate::statistics::{mean, peaks, range};

/// A fault of this size, as a share of the stroke, is of no film.
pub(crate) const SERIOUS: f64 = 0.1;
/// Rows of all recordings of which each is compared.
const MAX_ROWS: usize = 1 << 16;
/// Share of a fault that may be left where it is estimated.
const ESTIMATED: f64 = 0.1;
/// Share of the unexplained squares that a cause leaves.
const WORTH: f64 = 0.7;
/// Smallest RMS part of the readings that is worth a cause, as a share of the stroke.
const SIZE: f64 = 2.5e-3;
/// The same of a cause that leaves no more than this share.
const CLEAR_SIZE: f64 = 1.2e-3;
const CLEAR: f64 = 0.1;
/// Both of zeros that differ, which a fit estimates with one number for each recording.
const CLEAR_ZEROS_SIZE: f64 = 0.5e-3;
const CLEAR_ZEROS: f64 = 0.3;
const MAX_CAUSES: usize = 4;
/// Addition to the score of a cause for each of its columns.
const COMPLEXITY: f64 = 0.02;
/// A cause of one column for each recording is taken instead of another one that leaves less: at least this part of it, or so much less of all
/// unexplained squares.
const AS_PLAIN: f64 = 3.0;
const NEARLY: f64 = 0.03;
/// Unexplained part of the readings that is reported without a cause, as a share of the stroke.
const UNEXPLAINED: f64 = 6e-3;
/// Share of the variance of the readings that is of another drive.
const UNRELATED: f64 = 0.5;
/// Largest share of the unexplained squares that rows in the reverse order leave.
const BACKWARDS: f64 = 0.25;
/// A cause of less than this share of the first is not reported beside it.
const REMNANT: f64 = 0.3;
/// Remark on a cause that is found again.
const MORE: &str = ", and more of it";
/// Lags that are tried, in periods of the fastest cycle.
const LAGS: [f64; 5] = [0.04, 0.08, 0.12, 0.18, 0.25];
/// Smallest lag that is reported, in periods of the fastest cycle, and the shortest creep that differs from a lag, likewise.
const LATE: f64 = 0.01;
const SLOW: f64 = 0.3;

/// A cause of what no film explains.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Fault {
    /// The recording; none where it is about all of them.
    pub(crate) file: Option<String>,
    pub(crate) finding: String,
    pub(crate) advice: &'static str,
    /// RMS size as a share of the stroke.
    pub(crate) size: f64,
    pub(super) effect: Effect,
}

impl Fault {
    /// A fault of all recordings.
    fn of_all(finding: String, advice: &'static str, size: f64) -> Self {
        Self { file: None, finding, advice, size, effect: Effect::Other }
    }
}

/// The effect of a fault on a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Effect {
    /// Each recording has a zero of its own.
    Offset,
    /// It drifts.
    Drift,
    /// The reading settles from the first row on.
    Settling,
    /// The stroke lags the drive by so much, s.
    Lag(f64),
    /// Another one, as large as the fault.
    Other,
}

struct Cause {
    finding: String,
    advice: &'static str,
    recording: Option<usize>,
    change: Change,
    effect: Effect,
}

impl Cause {
    /// Columns that are added to all recordings.
    fn of_all(finding: &str, advice: &'static str, columns: Vec<Vec<f64>>) -> Self {
        let change = Change::Columns(columns);
        Self { finding: finding.into(), advice, recording: None, change, effect: Effect::Other }
    }

    fn with(self, effect: Effect) -> Self {
        Self { effect, ..self }
    }

    /// Number of values that are chosen so that little is left.
    fn columns(&self) -> usize {
        if let Change::Columns(columns) = &self.change { columns.len() } else { 2 }
    }
}

enum Change {
    Columns(Vec<Vec<f64>>),
    Drives(Vec<Vec<f64>>),
    Without(std::ops::Range<usize>),
    /// The recordings with their rows in the reverse order.
    Reversed(Blocks),
}

/// The film as it is explained so far.
#[derive(Clone)]
struct State {
    blocks: Blocks,
    drives: Vec<Vec<f64>>,
    added: Vec<Vec<f64>>,
    basis: Basis,
    /// Whether the drives are changed already.
    is_shifted: bool,
}

/// The faults of the recordings of a fit.
#[derive(Clone, Debug, Default)]
pub(super) struct Found(Vec<Fault>);

impl Found {
    pub(super) fn new(observations: &[Observation]) -> Self {
        let cycles = |observation: &Observation| {
            let drive = observation.input.samples();
            peaks(&drive.value).len() as f64 / drive.time_s.last().copied().unwrap_or(f64::INFINITY)
        };
        let fastest_hz = observations.iter().map(cycles).fold(0.0, f64::max);
        // Of long recordings the rows that follow their drives.
        let is_long = observations.iter().map(|o| o.measured.value.len()).sum::<usize>() > MAX_ROWS;
        let course = |observation: &Observation| {
            let thinner = observation.rate_hz / observation::thinned(observation).rate_hz;
            Course::from_observation(observation, if is_long { thinner.round() as usize } else { 1 })
        };
        let mut faults = faults_at_temperatures(observations, |o| o.temperature_c, course, fastest_hz);
        faults.retain(|fault| fault.effect != Effect::Offset || !observations.iter().all(|o| o.reading.own_offset));
        Self(faults)
    }

    /// The zeros that recordings have for themselves by these faults.
    pub(super) fn reading(&self) -> Reading {
        let has = |effect: Effect| self.0.iter().any(|fault| fault.effect == effect);
        let [differs, drifts, settles] = [Effect::Offset, Effect::Drift, Effect::Settling].map(has);
        // A sensor that was zeroed while the film still moved has a zero of its own as well.
        Reading { own_offset: differs || settles, drifts, settles, own_gain: false }
    }

    /// Without lags, which a sensor's delay explains.
    pub(super) fn without_lags(&self) -> Self {
        Self(self.0.iter().filter(|fault| !matches!(fault.effect, Effect::Lag(_))).cloned().collect())
    }

    /// Without those that a fit with `estimated` zeros has estimated.
    pub(super) fn left(&self, estimated: Reading) -> Self {
        let is_left = |fault: &&Fault| match fault.effect {
            Effect::Offset => !estimated.own_offset,
            Effect::Drift => !estimated.drifts,
            Effect::Settling => !estimated.settles,
            Effect::Lag(_) | Effect::Other => true,
        };
        Self(self.0.iter().filter(is_left).cloned().collect())
    }

    /// RMS size of all but lags as a share of the stroke, of which those that are not `left` are estimated, and the sum of the lags, s.
    pub(super) fn size_and_lag_s(&self, left: &Self) -> (f64, f64) {
        self.0.iter().fold((0.0, 0.0), |(size, lag_s), fault| {
            let share = if left.0.contains(fault) { 1.0 } else { ESTIMATED };
            match fault.effect {
                Effect::Lag(lag) => (size, lag_s + lag.abs()),
                _ => ((share * fault.size).hypot(size), lag_s),
            }
        })
    }

    /// Warnings about all, of which `left` are not estimated.
    pub(super) fn warnings(&self, left: &Self) -> Vec<Warning> {
        let warning = |fault: &Fault| {
            let file = fault.file.as_ref().map_or_else(String::new, |file| format!("{file}: "));
            let Fault { finding, advice, size, .. } = fault;
            if !left.0.contains(fault) {
                return Severity::Caution
                    .warning(format!("{file}{finding}: it is estimated with the film; or {advice}"));
            }
            let severity = if *size > SERIOUS { Severity::Serious } else { Severity::Caution };
            severity.warning(format!("{file}{finding}: {advice}"))
        };
        self.0.iter().map(warning).collect()
    }
}

/// The causes of what no film explains in the courses of `recordings`, in groups at the same temperature (°C), between which a film is another one. A
/// lag is compared between cycles of all, which such groups do not have.
pub(crate) fn faults_at_temperatures<R>(
    recordings: &[R],
    temperature_c: impl Fn(&R) -> Option<f64>,
    course: impl Fn(&R) -> Option<Course>,
    fastest_hz: f64,
) -> Vec<Fault> {
    let mut sorted: Vec<(Option<f64>, &R)> =
        recordings.iter().map(|recording| (temperature_c(recording), recording)).collect();
    let known: Vec<f64> = sorted.iter().filter_map(|(temperature_c, _)| *temperature_c).collect();
    let (low, high) = range(&known);
    let is_one = high - low < observation::MIN_SPAN_K || high < low;
    if !is_one {
        sorted.sort_by(|(a, _), (b, _)| a.partial_cmp(b).unwrap_or(Ordering::Equal));
    }
    let mut groups: Vec<(Option<f64>, Vec<&R>)> = Vec::new();
    for (own, recording) in sorted {
        let is_near = |other: Option<f64>| match (own, other) {
            (Some(own), Some(other)) => own - other < observation::MIN_SPAN_K,
            (own, other) => own == other,
        };
        match groups.last_mut().filter(|(other, _)| is_one || is_near(*other)) {
            Some((_, group)) => group.push(recording),
            None => groups.push((own, vec![recording])),
        }
    }
    let found =
        groups.into_iter().flat_map(|(_, group)| faults(group.into_iter().filter_map(&course).collect(), fastest_hz));
    found.filter(|fault| is_one || !matches!(fault.effect, Effect::Lag(_))).collect()
}

/// The causes of what no film explains in `courses`, largest first.
fn faults(courses: Vec<Course>, fastest_hz: f64) -> Vec<Fault> {
    let Some(blocks) = Blocks::new(courses, 1.0 / fastest_hz) else { return Vec::new() };
    let drives: Vec<Vec<f64>> = blocks.courses.iter().map(|course| course.drive.clone()).collect();
    let mut state = State { basis: blocks.film(&drives), blocks, drives, added: Vec::new(), is_shifted: false };
    let mut faults = state.stuck();
    if let Some(fault) = state.unrelated().filter(|_| faults.is_empty()) {
        return vec![fault];
    }
    while faults.len() < MAX_CAUSES {
        // What is much smaller may be a remnant of the first.
        let largest = faults.iter().fold(0.0_f64, |largest, fault: &Fault| largest.max(fault.size));
        let Some(fault) = state.next_fault().filter(|fault| fault.size > REMNANT * largest) else { break };
        faults.push(fault);
    }
    once_each(&mut faults);
    if faults.is_empty() {
        faults.extend(state.dead_band());
    }
    if !faults.iter().any(|fault| fault.advice == voltage::ZERO) {
        faults.extend(state.zero_of_monitor());
    }
    // Causes that explain more than a lag are known by now.
    if !state.is_shifted {
        faults.extend(state.late(fastest_hz));
    }
    let left = state.rms(state.basis.square());
    if faults.is_empty() && left > UNEXPLAINED {
        let finding = format!("no film explains {:.1} % of the stroke (RMS) by the drive", 100.0 * left);
        let advice = "look at the readings beside the drive: something else moves the film or the sensor";
        faults.push(Fault::of_all(finding, advice, left));
    }
    faults
}

/// A stroke that lags the drive by about `lag_s`, within an `interval`, or leads it.
fn lag(lag_s: f64, interval: &str, but: &str, size: f64) -> Fault {
    let ms = 1e3 * lag_s.abs();
    let (finding, advice) = if lag_s > 0.0 {
        (
            format!(
                "the stroke lags the drive by about {ms:.0} ms{interval}: a late sensor, or an amplifier behind its command{but}"
            ),
            "record the amplifier's monitor and the stroke with one clock and without filters, and steps or faster cycles; fit `sensor_delay_s` states a known delay",
        )
    } else {
        (
            format!(
                "the drive lags the stroke by about {ms:.0} ms{interval}: a slow monitor, clocks that differ, or a stroke that was smoothed without delay{but}"
            ),
            "record both with one clock and without filters; fit `sensor_delay_s` states a known difference",
        )
    };
    Fault { effect: Effect::Lag(lag_s), ..Fault::of_all(finding, advice, size) }
}

/// A delay of the sensor that a film is fitted with, which is too short to be seen as a lag of the cycles.
pub(crate) fn delay(observations: &[Observation]) -> Option<Fault> {
    let (delay_s, interval_s) = super::late_s(observations)?;
    let [low, high] = interval_s.map(|end_s| 1e3 * delay_s.signum() * end_s);
    Some(lag(delay_s, &format!(" ({:.0} to {:.0} ms)", low.min(high), low.max(high)), "", 0.0))
}

/// One of each kind of `faults`, with a remark for those in other places.
fn once_each(faults: &mut Vec<Fault>) {
    let mut kept: Vec<Fault> = Vec::new();
    for fault in faults.drain(..) {
        let words =
            |fault: &Fault| fault.finding.split(|c: char| c.is_ascii_digit()).next().unwrap_or_default().to_owned();
        let is_same = |other: &&mut Fault| {
            (&other.file, other.advice, words(other)) == (&fault.file, fault.advice, words(&fault))
        };
        match kept.iter_mut().find(is_same) {
            Some(first) if !first.finding.ends_with(MORE) => first.finding.push_str(MORE),
            Some(_) => {}
            None => kept.push(fault),
        }
    }
    *faults = kept;
}

impl State {
    /// RMS of a `square` as a share of the stroke.
    fn rms(&self, square: f64) -> f64 {
        (square.max(0.0) / self.blocks.reading.len() as f64).sqrt() / self.blocks.stroke_m
    }

    fn with(&self, change: &Change) -> Self {
        let mut with = self.clone();
        match change {
            Change::Columns(columns) => with.added.extend(columns.iter().cloned()),
            Change::Drives(changed) => with.drives.clone_from(changed),
            Change::Without(rows) => with.blocks.kept[rows.clone()].fill(0.0),
            Change::Reversed(blocks) => {
                with.drives = blocks.courses.iter().map(|course| course.drive.clone()).collect();
                with.blocks.clone_from(blocks);
            }
        }
        with.is_shifted |= matches!(change, Change::Drives(_));
        with.basis = with.blocks.film(&with.drives);
        with.basis.extend(&with.added);
        with
    }

    /// Sum of squares that `change` leaves; rows that are left out count as the others.
    fn square(&self, change: &Change) -> f64 {
        let kept = |state: &Self| state.blocks.kept.iter().sum::<f64>();
        match change {
            Change::Columns(columns) => self.basis.square_with(columns),
            _ => {
                let with = self.with(change);
                with.basis.square() * kept(self) / kept(&with)
            }
        }
    }

    /// The cause that explains most of what is left, which the film then includes.
    fn next_fault(&mut self) -> Option<Fault> {
        let before = self.basis.square();
        if self.rms(before) < CLEAR_ZEROS_SIZE {
            return None;
        }
        let (left, cause) = self.likeliest(before)?;
        let explained = before - left;
        let size = self.rms(explained);
        let of_zeros = cause.effect == Effect::Offset;
        let (share, least) = if of_zeros { (CLEAR_ZEROS, CLEAR_ZEROS_SIZE) } else { (CLEAR, CLEAR_SIZE) };
        let is_clear = left < share * before && size > least;
        if !is_clear && (explained < (1.0 - WORTH) * before || size < SIZE) {
            return None;
        }
        *self = self.with(&cause.change);
        let finding = format!("{} ({:.2} % of the stroke RMS)", cause.finding, 100.0 * size);
        let file = cause.recording.map(|j| self.blocks.courses[j].file.clone());
        Some(Fault { file, finding, advice: cause.advice, size, effect: cause.effect })
    }

    /// The cause that leaves least of the squares `before`, and what it leaves; or a plain one that leaves about as little.
    fn likeliest(&self, before: f64) -> Option<(f64, Cause)> {
        let left = |cause: Cause| (self.square(&cause.change), cause);
        let mut causes: Vec<(f64, Cause)> = self.causes().into_iter().map(left).collect();
        let score = |(square, cause): &(f64, Cause)| square * (1.0 + COMPLEXITY * cause.columns() as f64);
        causes.sort_by(|a, b| score(a).total_cmp(&score(b)));
        let least = causes.first()?.0;
        let is_plain = |(square, cause): &(f64, Cause)| {
            cause.columns() <= self.blocks.courses.len()
                && matches!(cause.change, Change::Columns(_))
                && *square < (AS_PLAIN * least).max(least + NEARLY * before)
        };
        let chosen = causes.iter().position(is_plain).unwrap_or(0);
        Some(causes.swap_remove(chosen))
    }

    /// A stroke that lags the drive, or leads it, by more than what creeps slowly explains.
    fn late(&self, fastest_hz: f64) -> Option<Fault> {
        if fastest_hz <= 0.0 {
            return None;
        }
        // A long lag is one of drives that are late by most of it already.
        let beside = |share: &f64| {
            let shift_s = share / fastest_hz;
            let courses = self.blocks.courses.iter().zip(&self.drives);
            let drives: Vec<Vec<f64>> =
                courses.map(|(course, volts)| voltage::shifted(shift_s, &course.time_s, volts)).collect();
            let (lag_s, square) = self.blocks.lag_s(&drives, &self.added, SLOW / fastest_hz);
            (square, shift_s + lag_s)
        };
        let (least, lag_s) = LAGS.iter().map(beside).min_by(|a, b| a.0.total_cmp(&b.0))?;
        let (square, plain_s) = beside(&0.0);
        let lag_s = if least < WORTH * square { lag_s } else { plain_s };
        if lag_s.abs() < LATE / fastest_hz {
            return None;
        }
        let but = ", unless the film itself is that slow, which these cycles do not show";
        Some(lag(lag_s, "", if lag_s > 0.0 { but } else { "" }, TAU * fastest_hz * lag_s.abs() / 3.0))
    }

    /// Readings of which the drive explains less than half.
    fn unrelated(&self) -> Option<Fault> {
        let readings = &self.blocks.reading;
        let mean = mean(readings);
        // A zero that goes away may be most of them.
        let share = self.basis.square_with(&self.slips()) / readings.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
        let finding =
            format!("no film explains the stroke by this drive: {:.0} % of its variance are left", 100.0 * share);
        let advice = "check that drive and stroke are of the same run and film, and in the same rows";
        let fault = Fault::of_all(finding, advice, self.rms(self.basis.square()));
        (share > UNRELATED && self.reversed().is_none()).then_some(fault)
    }

    /// Rows in the wrong order of time: a film that explains them far better the other way round, before anything else is changed.
    fn reversed(&self) -> Option<Cause> {
        let is_as_read = self.added.is_empty() && !self.is_shifted && self.blocks.kept.iter().all(|kept| *kept > 0.0);
        let change = Change::Reversed(self.blocks.reversed().filter(|_| is_as_read)?);
        (self.square(&change) < BACKWARDS * self.basis.square()).then(|| Cause {
            finding: "the stroke answers the drive before it comes: the rows are in reversed order of time".into(),
            advice: "sort the rows by time",
            recording: None,
            change,
            effect: Effect::Other,
        })
    }

    fn causes(&self) -> Vec<Cause> {
        let mut causes = self.of_sensor();
        causes.extend(self.reversed());
        causes.extend(self.of_film());
        causes.extend(self.at_a_time());
        causes.extend(self.of_voltage());
        causes
    }
}
