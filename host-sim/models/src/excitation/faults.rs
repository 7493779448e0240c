//! Faults of recordings: what a sensor, an amplifier, a mount or a clock adds to the readings, found in what no film explains.
//!
//! Each cause is a change of the [film](super::explained) along the recordings: columns that are added to it, another voltage, or rows that are
//! left out. A cause is reported if with it less than 70 % of the unexplained squares are left; the best first, then what is left is asked again.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::explained::{Basis, Blocks, Course};

/// Share of the unexplained squares that a cause leaves.
const WORTH: f64 = 0.7;
/// Smallest RMS part of the readings that is worth a cause, as a share of the stroke.
const SIZE: f64 = 2.5e-3;
/// Most causes.
const MAX_CAUSES: usize = 4;
/// Addition to the score of a cause for each of its columns.
const COMPLEXITY: f64 = 0.02;
/// Unexplained part of the readings that is reported without a cause, as a share of the stroke.
const UNEXPLAINED: f64 = 0.02;

/// A cause of less than this share of the first is not reported beside it.
const REMNANT: f64 = 0.3;
/// Smallest lag that is reported, in periods of the fastest cycle, and the shortest creep that differs from a lag, likewise.
const LATE: f64 = 0.01;
const SLOW: f64 = 0.3;

/// A cause of what no film explains.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Fault {
    /// The recording; none where it is about all of them.
    pub(super) file: Option<String>,
    pub(super) finding: String,
    pub(super) advice: &'static str,
    /// RMS size as a share of the stroke.
    pub(super) size: f64,
}

/// A possible cause.
struct Cause {
    finding: String,
    advice: &'static str,
    recording: Option<usize>,
    change: Change,
}

enum Change {
    Columns(Vec<Vec<f64>>),
    Drives(Vec<Vec<f64>>),
    Without(std::ops::Range<usize>),
}

/// The film as it is explained so far.
struct State {
    blocks: Blocks,
    drives: Vec<Vec<f64>>,
    added: Vec<Vec<f64>>,
    basis: Basis,
}

/// The causes of what no film explains in `courses`, largest first.
pub(super) fn faults(courses: Vec<Course>, fastest_hz: f64) -> Vec<Fault> {
    let Some(blocks) = Blocks::new(courses) else { return Vec::new() };
    let mut faults = Vec::new();
    let drives: Vec<Vec<f64>> = blocks.courses.iter().map(|course| course.drive.clone()).collect();
    let mut state = State { basis: blocks.film(&drives), blocks, drives, added: Vec::new() };
    if let Some(fault) = state.reversed() {
        return vec![fault];
    }
    faults.extend(state.late(fastest_hz));
    while faults.len() < MAX_CAUSES {
        // What is much smaller may be a remnant of the first.
        let largest = faults.first().map_or(0.0, |fault: &Fault| fault.size);
        let Some(fault) = state.next_fault().filter(|fault| fault.size > REMNANT * largest) else { break };
        faults.push(fault);
    }
    let left = state.rms(state.basis.square());
    if faults.is_empty() && left > UNEXPLAINED {
        faults.push(Fault {
            file: None,
            finding: format!("no film explains {:.1} % of the stroke (RMS) by the drive", 100.0 * left),
            advice: "look at the readings beside the drive: something else moves the film or the sensor",
            size: left,
        });
    }
    faults
}

impl State {
    /// RMS of a `square` as a share of the stroke.
    fn rms(&self, square: f64) -> f64 {
        (square.max(0.0) / self.blocks.reading.len() as f64).sqrt() / self.blocks.stroke_m
    }

    /// The film with this change.
    fn with(&self, change: &Change) -> (Blocks, Vec<Vec<f64>>, Vec<Vec<f64>>, Basis) {
        let (mut blocks, mut drives, mut added) = (self.blocks.clone(), self.drives.clone(), self.added.clone());
        match change {
            Change::Columns(columns) => added.extend(columns.iter().cloned()),
            Change::Drives(changed) => drives.clone_from(changed),
            Change::Without(rows) => blocks.kept[rows.clone()].fill(0.0),
        }
        let mut basis = blocks.film(&drives);
        added.iter().for_each(|column| {
            basis.add(column);
        });
        (blocks, drives, added, basis)
    }

    /// Sum of squares that `change` leaves.
    fn square(&self, change: &Change) -> f64 {
        match change {
            Change::Columns(columns) => self.basis.square_with(columns),
            Change::Without(rows) => {
                self.basis.square() - self.basis.rest[rows.clone()].iter().map(|rest| rest * rest).sum::<f64>()
            }
            Change::Drives(_) => self.with(change).3.square(),
        }
    }

    /// The cause that explains most of what is left, which the film then includes.
    fn next_fault(&mut self) -> Option<Fault> {
        let before = self.basis.square();
        if self.rms(before) < SIZE {
            return None;
        }
        let score = |cause: &Cause| {
            let columns = if let Change::Columns(columns) = &cause.change { columns.len() } else { 2 };
            self.square(&cause.change) * (1.0 + COMPLEXITY * columns as f64)
        };
        let scored = self.causes().into_iter().map(|cause| (score(&cause), cause));
        let (_, cause) = scored.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let (blocks, drives, added, basis) = self.with(&cause.change);
        let explained = before - basis.square();
        let size = self.rms(explained);
        if explained < (1.0 - WORTH) * before || size < SIZE {
            return None;
        }
        (self.blocks, self.drives, self.added, self.basis) = (blocks, drives, added, basis);
        let finding = format!("{} ({:.2} % of the stroke RMS)", cause.finding, 100.0 * size);
        let file = cause.recording.map(|j| self.blocks.courses[j].file.clone());
        Some(Fault { file, finding, advice: cause.advice, size })
    }

    /// A stroke that lags the drive, or leads it, by more than what creeps slowly explains; the film then follows the shifted drive.
    fn late(&mut self, fastest_hz: f64) -> Option<Fault> {
        if fastest_hz <= 0.0 {
            return None;
        }
        let lag_s = self.blocks.lag_s(&self.drives, SLOW / fastest_hz);
        if lag_s.abs() < LATE / fastest_hz {
            return None;
        }
        let pairs = self.blocks.courses.iter().zip(&self.drives);
        self.drives = pairs.map(|(course, drive)| shifted(lag_s, &course.time_s, drive)).collect();
        self.basis = self.blocks.film(&self.drives);
        let ms = 1e3 * lag_s.abs();
        let (finding, advice) = if lag_s > 0.0 {
            let finding = format!(
                "the stroke lags the drive by about {ms:.0} ms: a late sensor, or an amplifier behind its command, unless the film itself is \
                 that slow, which these cycles do not show"
            );
            (
                finding,
                "record the amplifier's monitor and the stroke with one clock and without filters, and steps or faster cycles; `sensor_delay_s` states a known delay",
            )
        } else {
            let finding =
                format!("the drive lags the stroke by about {ms:.0} ms: a slow monitor, or clocks that differ");
            (finding, "record both with one clock and without filters; `sensor_delay_s` states a known difference")
        };
        Some(Fault { file: None, finding, advice, size: TAU * fastest_hz * lag_s.abs() / 3.0 })
    }

    /// Rows in the wrong order of time.
    fn reversed(&self) -> Option<Fault> {
        let turned = |course: &Course| {
            let mut turned = course.clone();
            let last_s = course.time_s[course.time_s.len() - 1];
            turned.time_s = course.time_s.iter().rev().map(|t| last_s - t).collect();
            turned.drive.reverse();
            turned.reading.reverse();
            turned
        };
        let blocks = Blocks::new(self.blocks.courses.iter().map(turned).collect())?;
        let drives: Vec<Vec<f64>> = blocks.courses.iter().map(|course| course.drive.clone()).collect();
        let (forwards, backwards) = (self.basis.square(), blocks.film(&drives).square());
        let size = self.rms(forwards - backwards);
        (backwards < 0.25 * forwards && size > SIZE).then(|| Fault {
            file: None,
            finding: "the stroke answers the drive before it comes: the rows are in reversed order of time".into(),
            advice: "sort the rows by time",
            size,
        })
    }

    fn causes(&self) -> Vec<Cause> {
        let mut causes = self.of_sensor();
        causes.extend(self.of_film());
        causes.extend(self.at_a_time());
        causes.extend(self.of_voltage());
        causes
    }

    /// A column for each recording, of `value` of its blocks: of the block's number, its time and the recording's length.
    fn each(&self, value: impl Fn(usize, f64, f64) -> f64) -> Vec<Vec<f64>> {
        let places = &self.blocks.places;
        (0..self.blocks.courses.len())
            .map(|j| {
                let last_s = self.last_s(j);
                let of = |(k, &(i, t)): (usize, &(usize, f64))| if i == j { value(k, t, last_s) } else { 0.0 };
                places.iter().enumerate().map(of).collect()
            })
            .collect()
    }

    fn last_s(&self, j: usize) -> f64 {
        let time_s = &self.blocks.courses[j].time_s;
        time_s[time_s.len() - 1]
    }

    /// Changes of the zero of the sensor, and of what it reads.
    fn of_sensor(&self) -> Vec<Cause> {
        let all = |finding: &str, advice, columns| Cause {
            finding: finding.into(),
            advice,
            recording: None,
            change: Change::Columns(columns),
        };
        let mut causes = Vec::new();
        if self.blocks.courses.len() > 1 {
            let offsets = self.each(|_, _, _| 1.0);
            causes.push(all(
                "the zero of the sensor differs between the recordings",
                "fit with `offset` per-recording",
                offsets,
            ));
        }
        let warm = |share: f64| self.each(move |_, t, last_s| (-t / (share * last_s)).exp());
        let recovers = [0.01, 0.03, 0.1, 0.3].into_iter().flat_map(warm).collect();
        causes.push(all(
            "the stroke settles from the first row on without a cause in the drive: the film was driven before, or the sensor warms up",
            "rest for ten minutes before recording, with the sensor switched on; or fit from where it has settled (`from_s`)",
            recovers,
        ));
        causes.push(all(
            "the zero of the sensor drifts",
            "let it warm up, keep the temperature, or record shorter",
            self.each(|_, t, _| t),
        ));
        let wave = |n: f64| self.each(move |_, t, last_s| (n * std::f64::consts::PI * t / last_s).cos());
        causes.push(all(
            "the zero of the sensor wanders",
            "keep the temperature, shield the sensor, and fix its mount",
            [1.0, 2.0, 3.0, 4.0, 5.0, 6.0].into_iter().flat_map(wave).collect(),
        ));
        let mut lines = Vec::new();
        let mut strongest = (0.0, 0.0);
        for j in 0..self.blocks.courses.len() {
            let (hz, size) = self.line(j);
            if size > strongest.1 {
                strongest = (hz, size);
            }
            let phase = |t: f64| TAU * hz * t;
            let waves = [self.each(move |_, t, _| phase(t).cos()), self.each(move |_, t, _| phase(t).sin())];
            lines.extend(waves.map(|mut waves| waves.swap_remove(j)));
        }
        causes.push(all(
            &format!("the reading swings at {:.2} Hz whatever the drive does: a mount that rings, or mains between slow rows", strongest.0),
            "stiffen the mount, or shield the sensor's cable and record more rows a second",
            lines,
        ));
        causes
    }

    /// Frequency (Hz) and size of the strongest line of what is left in recording `j`.
    fn line(&self, j: usize) -> (f64, f64) {
        let rest = || self.blocks.places.iter().zip(&self.basis.rest).filter(|(place, _)| place.0 == j);
        let (count, last_s) = (rest().count(), self.last_s(j));
        let size = |hz: f64| {
            let (mut cos, mut sin) = (0.0, 0.0);
            for (&(_, t), rest) in rest() {
                let phase = TAU * hz * t;
                cos += rest * phase.cos();
                sin += rest * phase.sin();
            }
            cos.hypot(sin)
        };
        let lines = (1..count).map(|n| 0.5 * n as f64 / last_s);
        lines.map(|hz| (hz, size(hz))).max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0.0, 0.0))
    }

    /// Changes of what the film answers.
    fn of_film(&self) -> Vec<Cause> {
        let film = self.blocks.modelled(&self.basis);
        let (low, high) = crate::fit::statistics::range(&film);
        let all = |finding: &str, advice, columns| Cause {
            finding: finding.into(),
            advice,
            recording: None,
            change: Change::Columns(columns),
        };
        let mut causes = Vec::new();
        if self.blocks.courses.len() > 1 {
            let mut columns = self.each(|k, _, _| film[k]);
            columns.extend(self.each(|_, _, _| 1.0));
            causes.push(all(
                "the strokes of the recordings differ in scale: another film, or another range of the sensor or of the amplifier's monitor",
                "check the ranges; fit with `gain` per-recording, or each film for itself",
                columns,
            ));
        }
        causes.push(all(
            "the response to the drive changes steadily: the film ages or warms, or the sensor's scale drifts",
            "record shorter, and keep the temperature",
            self.each(|k, t, _| t * film[k]).into_iter().chain(self.each(|_, t, _| t)).collect(),
        ));
        let slope = self.slope(&film);
        causes.push(all(
            "the clocks of drive and stroke run apart",
            "record both with one clock",
            self.each(|k, t, _| t * slope[k]),
        ));
        for width in [0.01, 0.02, 0.05, 0.1, 0.2] {
            causes.push(all(
                "the stroke stays behind at each turn: friction or play in the mount",
                "free the mount from friction, and preload what has play",
                vec![self.play(&film, width * (high - low))],
            ));
        }
        for share in [0.05, 0.1, 0.2, 0.4, 0.6, 0.8, 0.9] {
            let knee = low + share * (high - low);
            causes.push(all(
                "the reading bends at one level: the end of the sensor's range, or a stop",
                "keep the stroke within the sensor's range, and empty the readings beyond it",
                vec![film.iter().map(|x| (x - knee).max(0.0)).collect()],
            ));
        }
        causes
    }

    /// Time derivative of `values` within each recording.
    fn slope(&self, values: &[f64]) -> Vec<f64> {
        let places = &self.blocks.places;
        let count = values.len();
        (0..count)
            .map(|k| {
                let beside = |other: usize| if places[other].0 == places[k].0 { other } else { k };
                let (from, to) = (beside(k.saturating_sub(1)), beside((k + 1).min(count - 1)));
                let step_s = places[to].1 - places[from].1;
                if step_s > 0.0 { (values[to] - values[from]) / step_s } else { 0.0 }
            })
            .collect()
    }

    /// `values` behind a play of so much to either side.
    fn play(&self, values: &[f64], width: f64) -> Vec<f64> {
        let (mut at, mut recording) = (0.0, usize::MAX);
        let mut follow = |(&value, &(j, _)): (&f64, &(usize, f64))| {
            at = if j == recording { f64::clamp(at, value - width, value + width) } else { value };
            recording = j;
            at
        };
        values.iter().zip(&self.blocks.places).map(&mut follow).collect()
    }

    /// Changes at one time, and in a part of a recording.
    fn at_a_time(&self) -> Vec<Cause> {
        let film = self.blocks.modelled(&self.basis);
        let loads: Vec<Vec<f64>> =
            self.drives.iter().map(|drive| drive.iter().map(|value| value * value).collect()).collect();
        let load = self.blocks.means(&loads);
        let slope = self.slope(&film);
        let mut causes = Vec::new();
        for j in 0..self.blocks.courses.len() {
            let after = |from_s: f64, values: &dyn Fn(usize) -> f64| -> Vec<f64> {
                let of = |(k, &(i, t)): (usize, &(usize, f64))| if i == j && t >= from_s { values(k) } else { 0.0 };
                self.blocks.places.iter().enumerate().map(of).collect()
            };
            let jump = |from_s: f64| vec![after(from_s, &|_| 1.0)];
            let gain =
                |from_s: f64| vec![after(from_s, &|_| 1.0), after(from_s, &|k| film[k]), after(from_s, &|k| load[k])];
            let clock = |from_s: f64| vec![after(from_s, &|k| slope[k])];
            let kinds: [(&From, &str, &'static str); 3] = [
                (
                    &jump,
                    "the reading jumps",
                    "fix the mount and the sensor, and record again or end the recording there (`to_s`)",
                ),
                (
                    &gain,
                    "the response to the drive changes",
                    "another film, a failing one, or another range of the sensor: end the recording there (`to_s`)",
                ),
                (
                    &clock,
                    "drive and stroke are shifted against each other",
                    "rows were lost on one side: end the recording there (`to_s`)",
                ),
            ];
            for (columns, what, advice) in kinds {
                let (at_s, columns) = self.scan(j, columns);
                causes.push(Cause {
                    finding: format!("{what} at {at_s:.1} s"),
                    advice,
                    recording: Some(j),
                    change: Change::Columns(columns),
                });
            }
            causes.extend(self.part(j));
        }
        causes
    }

    /// The time in recording `j` from which `columns` leave least.
    fn scan(&self, j: usize, columns: &From<'_>) -> (f64, Vec<Vec<f64>>) {
        const STEPS: i32 = 40;
        let last_s = self.last_s(j);
        let (mut middle_s, mut half_s) = (0.5 * last_s, 0.48 * last_s);
        for _ in 0..3 {
            let times = (-STEPS / 2..=STEPS / 2).map(|k| middle_s + half_s * f64::from(k) / f64::from(STEPS / 2));
            let times = times.filter(|t| (0.02 * last_s..=0.98 * last_s).contains(t));
            let squares = times.map(|t| (self.basis.square_with(&columns(t)), t));
            middle_s = squares.min_by(|a, b| a.0.total_cmp(&b.0)).map_or(middle_s, |(_, t)| t);
            half_s /= f64::from(STEPS) / 4.0;
        }
        (middle_s, columns(middle_s))
    }

    /// The part of recording `j`, at most a quarter, that has most of the unexplained squares.
    fn part(&self, j: usize) -> Option<Cause> {
        let first = self.blocks.places.iter().position(|place| place.0 == j)?;
        let count = self.blocks.places.iter().filter(|place| place.0 == j).count();
        let squares = |rows: std::ops::Range<usize>| self.basis.rest[rows].iter().map(|rest| rest * rest).sum::<f64>();
        let lengths = [0.005, 0.01, 0.02, 0.04, 0.08, 0.15, 0.25].map(|share| (share * count as f64) as usize);
        let windows = lengths.into_iter().filter(|length| *length > 1).flat_map(|length| {
            (0..=count - length).step_by((length / 4).max(1)).map(move |from| first + from..first + from + length)
        });
        // Per block, less for longer ones.
        let score = |rows: &std::ops::Range<usize>| squares(rows.clone()) / (rows.len() as f64).sqrt();
        let rows = windows.max_by(|a, b| score(a).total_cmp(&score(b)))?;
        let [from_s, to_s] = [rows.start, rows.end - 1].map(|k| self.blocks.places[k].1);
        Some(Cause {
            finding: format!("from {from_s:.1} to {to_s:.1} s the reading is not of the film under this drive"),
            advice: "a sensor without its target, an arc, or rows from elsewhere: empty the readings there",
            recording: Some(j),
            change: Change::Without(rows),
        })
    }

    /// Voltages on the film that are not the recorded ones.
    fn of_voltage(&self) -> Vec<Cause> {
        const MONITOR: &str = "record the amplifier's monitor, not the command";
        const ZERO: &str = "check the zero of the monitor and the amplifier's smallest voltage";
        const CLOCK: &str = "record both with one clock and without filters";
        let courses = &self.blocks.courses;
        if !courses.iter().all(|course| course.is_voltage) {
            return Vec::new();
        }
        let slopes = courses.iter().zip(&self.drives).flat_map(|(course, volts)| {
            course.time_s.windows(2).zip(volts.windows(2)).map(|(t, v)| (v[1] - v[0]).abs() / (t[1] - t[0]))
        });
        let steepest = percentile(slopes.collect(), 0.995);
        let has_both = self.drives.iter().flatten().any(|volts| *volts < -0.05);
        let percent = |share: f64| format!("{:.0} %", 100.0 * share.abs());
        let families: [Family<'_>; 9] = [
            (
                &[0.05, 0.1, 0.2, 0.4, 0.8],
                &|lag_s, time_s, volts| lagged(time_s, volts, lag_s, lag_s),
                &|lag_s| {
                    format!(
                        "the voltage on the film lags the recorded one by about {:.0} ms: an amplifier behind its command",
                        1e3 * lag_s
                    )
                },
                MONITOR,
            ),
            (
                &[0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2],
                &|lag_s, time_s, volts| lagged(time_s, volts, 0.0, lag_s),
                &|lag_s| {
                    format!(
                        "the voltage on the film lags the recorded one by about {:.0} ms as it falls: an amplifier without a bleeder",
                        1e3 * lag_s
                    )
                },
                MONITOR,
            ),
            (
                &[-0.05, -0.1, -0.2, -0.4, -0.8],
                &shifted,
                &|s| {
                    format!(
                        "the voltage lags the stroke by about {:.0} ms: a slow monitor, or clocks that differ",
                        -1e3 * s
                    )
                },
                CLOCK,
            ),
            (
                &[0.9, 0.7, 0.5, 0.35, 0.2, 0.1, 0.05, 0.02],
                &|share, time_s, volts| limited(time_s, volts, share * steepest),
                &|share| {
                    format!(
                        "the voltage on the film changes by at most {} of the recorded slope: an amplifier at its current limit",
                        percent(share)
                    )
                },
                MONITOR,
            ),
            (
                &[0.95, 0.85, 0.75, 0.65, 0.55, 0.4],
                &|share, _, volts| volts.iter().map(|v| v.clamp(-share, share)).collect(),
                &|share| {
                    format!(
                        "the voltage on the film ends at about {} of the largest recorded: an amplifier at the end of its range",
                        percent(share)
                    )
                },
                MONITOR,
            ),
            (
                &[0.03, 0.1, 0.2, 0.3, 0.4],
                &|share, _, volts| volts.iter().map(|v| v.signum() * (v.abs() - share).max(0.0)).collect(),
                &|share| {
                    format!(
                        "the film does not follow voltages below about {} of the largest: a dead band of the amplifier",
                        percent(share)
                    )
                },
                ZERO,
            ),
            (
                &[-0.2, -0.1, -0.04, 0.04, 0.1, 0.2],
                &|share, _, volts| volts.iter().map(|v| v + share).collect(),
                &|share| {
                    format!(
                        "the voltage on the film differs from the recorded one by about {} of the largest: a wrong zero of the monitor",
                        percent(share)
                    )
                },
                ZERO,
            ),
            (
                &[0.005],
                &smoothed,
                &|_| "the voltage is recorded in steps that the film does not follow".into(),
                "record the voltage as finely as the stroke",
            ),
            (
                &[0.0],
                &|_, _, volts| volts.iter().map(|v| if has_both { v.max(0.0) } else { *v }).collect(),
                &|_| "the film follows one polarity only: an amplifier of one polarity".into(),
                MONITOR,
            ),
        ];
        let best = |(grid, drive, finding, advice): &Family<'_>| {
            let change = |p: f64| {
                let drives = courses.iter().zip(&self.drives).map(|(course, volts)| drive(p, &course.time_s, volts));
                Change::Drives(drives.collect())
            };
            let square = |p: f64| self.square(&change(p));
            let least =
                |grid: &[f64]| grid.iter().map(|&p| (square(p), p)).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, p)| p);
            let mut p = least(grid)?;
            if grid.len() > 1 {
                // Between the neighbours on the grid, which are about a third away.
                for reach in [0.24, 0.08] {
                    p = least(&[p * (1.0 - reach), p, p * (1.0 + reach)])?;
                }
            }
            Some(Cause { finding: finding(p), advice, recording: None, change: change(p) })
        };
        families.par_iter().filter_map(best).collect()
    }
}

/// Columns that begin at a time, s.
type From<'a> = dyn Fn(f64) -> Vec<Vec<f64>> + 'a;

/// Voltages with one parameter: its grid, the voltage on the film, the finding, and the advice.
type Family<'a> =
    (&'a [f64], &'a (dyn Fn(f64, &[f64], &[f64]) -> Vec<f64> + Sync), &'a (dyn Fn(f64) -> String + Sync), &'static str);

fn percentile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share) as usize]
}

/// `volts` later by `shift_s`.
fn shifted(shift_s: f64, time_s: &[f64], volts: &[f64]) -> Vec<f64> {
    let at = |t: f64| {
        let k = time_s.partition_point(|time| *time <= t).clamp(1, time_s.len() - 1);
        let share = ((t - time_s[k - 1]) / (time_s[k] - time_s[k - 1])).clamp(0.0, 1.0);
        volts[k - 1] + share * (volts[k] - volts[k - 1])
    };
    time_s.iter().map(|t| at(t - shift_s)).collect()
}

/// `volts` in straight lines between the middles of the steps in which they stay within `band`.
fn smoothed(band: f64, time_s: &[f64], volts: &[f64]) -> Vec<f64> {
    let mut from = 0;
    let mut corners = vec![(time_s[0], volts[0])];
    for k in 1..=volts.len() {
        if k == volts.len() || (volts[k] - volts[from]).abs() > band {
            corners.push((0.5 * (time_s[from] + time_s[k - 1]), volts[from]));
            from = k;
        }
    }
    corners.push((time_s[time_s.len() - 1], volts[volts.len() - 1]));
    corners.dedup_by(|a, b| a.0 <= b.0);
    let (times, values): (Vec<f64>, Vec<f64>) = corners.into_iter().unzip();
    let at = |t: &f64| {
        let k = times.partition_point(|time| time <= t).clamp(1, times.len() - 1);
        let share = ((t - times[k - 1]) / (times[k] - times[k - 1])).clamp(0.0, 1.0);
        values[k - 1] + share * (values[k] - values[k - 1])
    };
    time_s.iter().map(at).collect()
}

/// `volts` behind an amplifier with these time constants.
fn lagged(time_s: &[f64], volts: &[f64], rise_s: f64, fall_s: f64) -> Vec<f64> {
    let mut value = volts[0];
    let mut follow = |k: usize| {
        let step_s = if k == 0 { 0.0 } else { time_s[k] - time_s[k - 1] };
        let lag_s = if volts[k] > value { rise_s } else { fall_s };
        value += (volts[k] - value) * (1.0 - (-step_s / lag_s.max(1e-9)).exp());
        value
    };
    (0..volts.len()).map(&mut follow).collect()
}

/// `volts` that change by at most `slew` a second.
fn limited(time_s: &[f64], volts: &[f64], slew: f64) -> Vec<f64> {
    let mut value = volts[0];
    let mut follow = |k: usize| {
        let most = if k == 0 { 0.0 } else { slew * (time_s[k] - time_s[k - 1]) };
        value += (volts[k] - value).clamp(-most, most);
        value
    };
    (0..volts.len()).map(&mut follow).collect()
}
