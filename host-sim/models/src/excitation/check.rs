//! Check of whether recordings identify a film, and advice on what to record instead.

use serde::Serialize;

use super::drive::{DriveFacts, HOLD_S, distinct};
use super::finding::Severity::{Prevents, Weakens};
pub use super::finding::{Finding, Severity};
use super::rows;
use crate::error::shown;
use crate::files::recording::{Direction, Input, Recording};
use crate::fit::explained::Course;
use crate::fit::observation::{self, Observation};
use crate::fit::{self, faults};
use crate::grid::Samples;
use crate::statistics::{differences, median, noise, range, sorted};

/// The findings about recordings.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Whether they identify a film: nothing that was found prevents it.
    pub identifies: bool,
    /// Each of them.
    pub recordings: Vec<Facts>,
    /// Problems, worst first.
    pub findings: Vec<Finding>,
}

/// The contents of a recording.
#[derive(Clone, Debug, Serialize)]
pub struct Facts {
    /// The file.
    pub file: String,
    /// Rows.
    pub rows: usize,
    /// Rate of the median interval.
    pub rate_hz: f64,
    /// Length, s.
    pub duration_s: f64,
    /// The drive: `voltage` (V), `force` (N), or `displacement` (m) of a test whose force relaxes.
    pub driven_by: &'static str,
    /// The drive, in V, N or m.
    pub drive: DriveFacts,
    /// Smallest and largest displacement, m.
    pub displacement_m: Option<[f64; 2]>,
    /// Displacement at the start, m.
    pub start_m: Option<f64>,
    /// Readings far from those before and after them.
    pub outliers: usize,
    /// Rows without a reading.
    pub empty: usize,
    /// Whether its readings can be compared with a film, row by row.
    #[serde(skip)]
    is_comparable: bool,
}

/// A finding that follows from another, words of which are the second.
const UPPER_HALF: &str = "the film begins in the upper half of its stroke although nothing drives it";
const TURNED: &str = "falls where the";
/// Rest that a film needs before a recording, in words.
const RECORD_REST: &str = "begin with 2 s at 0 V, after ten minutes without voltage (the command profile does)";

/// Checks `recordings` of one film.
pub fn check(recordings: &[Recording]) -> Report {
    let mut findings = Vec::new();
    for recording in recordings {
        of_values(recording, &mut findings);
    }
    let facts: Vec<Facts> =
        recordings.iter().filter_map(|recording| Facts::from_recording(recording, &mut findings)).collect();
    of_all(&facts, &mut findings);
    of_copies(recordings, &mut findings);
    // In another unit a film looks like no film.
    if recordings.iter().all(|recording| recording.implausible().is_empty()) {
        of_faults(recordings, &facts, &mut findings);
    }
    findings.sort_by_key(|finding| finding.severity);
    let identifies = findings.iter().all(|finding| finding.severity != Prevents);
    Report { identifies, recordings: facts, findings }
}

/// Values that are implausible, before what results from them, and what the reader left out.
fn of_values(recording: &Recording, findings: &mut Vec<Finding>) {
    let implausible = recording.implausible().into_iter().map(|finding| (Prevents, finding));
    let notes = recording.notes().iter().cloned().chain(recording.doubts()).map(|note| (Weakens, note));
    let file = shown(recording.path());
    findings.extend(implausible.chain(notes).map(|(severity, finding)| Finding {
        severity,
        file: Some(file.clone()),
        finding,
        advice: String::new(),
    }));
}

/// Those of `recordings` that a fit takes.
fn observed<'a>(recordings: impl IntoIterator<Item = &'a Recording>) -> Vec<Observation> {
    let observed = |recording| observation::observe(recording, Direction::Force, 1.0).ok();
    recordings.into_iter().filter_map(observed).map(|(observation, _)| observation).collect()
}

fn of_copies(recordings: &[Recording], findings: &mut Vec<Finding>) {
    if let Some(finding) = fit::repeated(&observed(recordings)) {
        findings.push(Finding { severity: Prevents, file: None, finding, advice: String::new() });
    }
}

/// Adds the faults that no film explains, with their causes.
fn of_faults(recordings: &[Recording], facts: &[Facts], findings: &mut Vec<Finding>) {
    let course = |recording: &Recording| Course::new(recording, shown(recording.path()));
    let fastest_hz = facts.iter().filter_map(|facts| facts.drive.frequencies_hz.last().copied()).fold(0.0, f64::max);
    let is_comparable =
        |recording: &&Recording| facts.iter().any(|row| row.is_comparable && row.file == shown(recording.path()));
    let comparable: Vec<&Recording> = recordings.iter().filter(is_comparable).collect();
    let temperature_c = |recording: &&Recording| recording.mean_temperature_c().ok()?;
    let mut faults =
        faults::faults_at_temperatures(&comparable, temperature_c, |recording| course(recording), fastest_hz);
    if faults.is_empty() {
        faults.extend(faults::delay(&observed(comparable)));
    }
    for fault in faults {
        let severity = if fault.size > faults::SERIOUS { Prevents } else { Weakens };
        findings.push(Finding { severity, file: fault.file, finding: fault.finding, advice: fault.advice.into() });
    }
}

/// The excitation of all recordings together.
fn of_all(facts: &[Facts], findings: &mut Vec<Finding>) {
    if facts.is_empty() {
        return;
    }
    let mut add = |severity, finding: String, advice: &str| {
        findings.push(Finding { severity, file: None, finding, advice: advice.into() });
    };
    let frequencies = distinct(facts.iter().flat_map(|facts| facts.drive.frequencies_hz.clone()));
    let amplitudes = distinct(facts.iter().flat_map(|facts| facts.drive.amplitudes.clone()));
    let hold_s = facts.iter().map(|facts| facts.drive.hold_s).fold(0.0, f64::max);
    match frequencies.as_slice() {
        [] if hold_s < HOLD_S => add(
            Prevents,
            "no full cycle and no hold of 10 s".into(),
            "record sines of two or three frequencies for minutes, and a hold (the command profile makes them)",
        ),
        [] => add(
            Weakens,
            if facts.iter().all(|facts| facts.driven_by == "displacement") {
                format!(
                    "a hold of {hold_s:.0} s and no cycle: relaxation at one displacement only (fit with `drive` displacement)"
                )
            } else {
                format!("a hold of {hold_s:.0} s and no cycle: creep under one load only")
            },
            "record sines of two or three frequencies of the band that you will use as well",
        ),
        [one] if hold_s < HOLD_S && amplitudes.len() < 2 => add(
            Prevents,
            format!(
                "one frequency ({one:.3} Hz) at one amplitude, and no hold: the orders of the springpots stay open"
            ),
            "record a second frequency, or a hold of 60 s, and a second amplitude, half as large",
        ),
        [one] => add(
            Weakens,
            format!("one frequency only ({one:.3} Hz)"),
            "record a second one, two or three times as fast or as slow",
        ),
        _ => {}
    }
    if amplitudes.len() == 1 && !frequencies.is_empty() {
        add(
            Weakens,
            "one amplitude only: creep and stiffening look alike there".into(),
            "record a second amplitude, half as large",
        );
    }
    let slowest_s = frequencies.first().map_or(0.0, |slowest| 1.0 / slowest);
    let longest_s = facts.iter().map(|facts| facts.duration_s).fold(0.0, f64::max);
    if slowest_s > 0.0 && hold_s < HOLD_S && longest_s < 5.0 * slowest_s {
        add(
            Weakens,
            format!(
                "{longest_s:.0} s are {:.1} periods of the slowest cycle: creep over minutes is not seen",
                longest_s / slowest_s
            ),
            "record two minutes of each frequency, or a hold of 60 s",
        );
    }
}

/// The direction in which `recording` is a test: its displacement drives where it is held longer than the force beside it.
fn direction(recording: &Recording) -> Direction {
    let hold_s = |samples: &Samples| DriveFacts::new(samples).hold_s;
    let Ok(Input::Force(force)) = recording.drive() else { return Direction::Force };
    match recording.displacement_drive() {
        Ok(drive) if hold_s(drive.samples()) > hold_s(&force) => Direction::Displacement,
        _ => Direction::Force,
    }
}

impl Facts {
    /// The facts of `recording`; its problems are added to `findings`. None where nothing can be found.
    fn from_recording(recording: &Recording, findings: &mut Vec<Finding>) -> Option<Self> {
        let file = shown(recording.path());
        let mut add = |severity, finding: String, advice: &str| {
            findings.push(Finding { severity, file: Some(file.clone()), finding, advice: advice.into() });
        };
        let direction = direction(recording);
        let drive = match direction {
            Direction::Force => recording.drive(),
            Direction::Displacement => recording.displacement_drive(),
        };
        let drive = match drive {
            Ok(drive) => drive,
            Err(error) => {
                add(Prevents, error.to_string(), "record the voltage on the electrodes in every row");
                return None;
            }
        };
        let (driven_by, unit) = match drive {
            Input::Voltage(_) => ("voltage", "V"),
            Input::Force(_) => ("force", "N"),
            Input::Displacement(_) => ("displacement", "m"),
        };
        let facts = DriveFacts::new(drive.samples());
        let rate_hz = 1.0 / median(&differences(recording.time_s()).collect::<Vec<f64>>());
        if facts.peak == 0.0 {
            add(Prevents, format!("the {driven_by} is 0 throughout"), "name the column of the voltage on the film");
            return None;
        }
        judge_drive(driven_by, unit, &facts, (&drive, rate_hz, recording.duration_s()), &mut add);
        let measured = match direction {
            Direction::Force => recording.displacement().ok(),
            Direction::Displacement => recording.force(),
        };
        let measured = measured.filter(|measured| !measured.value.is_empty());
        let mut row = Self {
            file: file.clone(),
            rows: recording.time_s().len(),
            rate_hz,
            duration_s: recording.duration_s(),
            driven_by,
            drive: facts,
            displacement_m: None,
            start_m: None,
            outliers: 0,
            is_comparable: true,
            empty: recording.time_s().len()
                - recording.repeated()
                - measured.as_ref().map_or(0, |measured| measured.value.len()),
        };
        match measured {
            // Its force jumps where the displacement does.
            Some(_) if direction == Direction::Displacement => {
                (row.is_comparable, row.displacement_m) = (false, Some(range(&drive.samples().value).into()));
            }
            Some(measured) => {
                let coded_m = recording.drop_outs().map(|drop_outs| drop_outs.value_m);
                row.judge(&measured, coded_m, &mut add);
                // Drop-outs have lines of their own.
                if row.outliers == 0 {
                    let fastest_hz = row.drive.frequencies_hz.last().copied().unwrap_or(0.0);
                    row.is_comparable = rows::judge(drive.samples(), row.drive.peak, &measured, fastest_hz, &mut add);
                }
            }
            None => add(Prevents, "no displacement".into(), "record the stroke beside the voltage, or name its column"),
        }
        if row.displacement_m.is_some() {
            judge_as_fit(recording, direction, &mut add);
            // One line for one cause.
            let is_turned = findings.iter().any(|f| f.file.as_ref() == Some(&file) && f.finding.contains(TURNED));
            findings.retain(|f| !(is_turned && f.file.as_ref() == Some(&file) && f.finding == UPPER_HALF));
        }
        Some(row)
    }

    /// Judges the `measured` displacement, whose drop-outs may be `coded_m`.
    fn judge(&mut self, measured: &Samples, coded_m: Option<f64>, add: &mut impl FnMut(Severity, String, &str)) {
        let values = &measured.value;
        let sorted = sorted(values.iter().copied());
        let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share).round() as usize];
        // Without the outermost hundredth at both ends, which drop-outs may be.
        let (low, high) = (at(0.01), at(0.99));
        let stroke = high - low;
        self.displacement_m = Some([low, high]);
        self.start_m = values.first().copied();
        // A third of the stroke, and more than noise.
        let jump = (0.3 * stroke).max(6.0 * noise(values));
        let is_outlier = |&k: &usize| {
            let far = values[k] > high + stroke || values[k] < low - stroke;
            let jumps = k > 0 && k + 1 < values.len() && {
                let (before, after) = (values[k] - values[k - 1], values[k] - values[k + 1]);
                before * after > 0.0 && before.abs().min(after.abs()) > jump
            };
            stroke > 0.0 && (far || jumps)
        };
        let (coded, outliers): (Vec<usize>, Vec<usize>) =
            (0..values.len()).filter(is_outlier).partition(|&k| coded_m == Some(values[k]));
        self.outliers = coded.len() + outliers.len();
        // Those of one number have a line already.
        if !outliers.is_empty() {
            add(
                Weakens,
                format!("{} readings of the sensor jump by more than a third of the stroke: drop-outs", outliers.len()),
                "empty them with import `blank`, or fit with `loss` huber",
            );
        }
        if 10 * self.empty > self.rows {
            let finding = format!("{} of {} rows have no reading", self.empty, self.rows);
            add(Weakens, finding, "check the sensor's range and its target");
        }
        if self.start_m.is_some_and(|start| start - low > 0.5 * stroke && self.drive.rest_s > 0.0) {
            add(Weakens, UPPER_HALF.into(), "rest for ten minutes before recording, and check the sensor's sign");
        }
    }
}

/// Judges a drive: its size, its rest before the first row, and its rows per cycle.
fn judge_drive(
    driven_by: &str,
    unit: &str,
    facts: &DriveFacts,
    (drive, rate_hz, duration_s): (&Input, f64, f64),
    add: &mut impl FnMut(Severity, String, &str),
) {
    let first = drive.samples().value.first().map_or(0.0, |value| value.abs());
    if facts.cycles.is_empty() && facts.hold_s > 0.9 * duration_s {
        // A held load: the step itself is left out.
    } else if first > 0.2 * facts.peak {
        add(
            Prevents,
            format!(
                "the {driven_by} is {first:.4} {unit} in the first row: what the film remembers of before is not known"
            ),
            RECORD_REST,
        );
    } else if first > 0.02 * facts.peak {
        add(Weakens, format!("the {driven_by} is {first:.4} {unit} in the first row"), RECORD_REST);
    }
    let fastest = facts.frequencies_hz.last().copied().unwrap_or(0.0);
    if fastest > 0.0 && rate_hz < 20.0 * fastest {
        let severity = if rate_hz < 8.0 * fastest { Prevents } else { Weakens };
        let finding = format!("{:.1} rows per cycle of {fastest:.3} Hz", rate_hz / fastest);
        add(severity, finding, "record at 20 rows per cycle at least; 100 Hz serves well");
    }
}

/// Gaps, saturation and a turned sign, as a fit reports them.
fn judge_as_fit(recording: &Recording, direction: Direction, add: &mut impl FnMut(Severity, String, &str)) {
    match observation::observe(recording, direction, 1.0) {
        Ok((_, warnings)) => {
            for warning in warnings {
                let severity = match warning.severity {
                    fit::Severity::Serious => Prevents,
                    fit::Severity::Caution | fit::Severity::Note => Weakens,
                };
                // The finding names its file by itself.
                let text = warning.text.strip_prefix(&shown(recording.path())).and_then(|text| text.strip_prefix(": "));
                add(severity, text.unwrap_or(&warning.text).to_owned(), "");
            }
        }
        Err(error) => add(Prevents, error.to_string(), "record at least a full cycle"),
    }
}
