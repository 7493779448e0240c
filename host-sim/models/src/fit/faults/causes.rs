//! Causes in the sensor, the film and the mount, at all times or from one time on.

use std::f64::consts::TAU;

use rayon::prelude::*;

use super::super::explained::Basis;
use super::super::readings::SETTLES;
use super::{Cause, Change, Effect, State};
use crate::statistics::range;

/// Columns that begin in a recording at a time, s.
type From<'a> = dyn Fn(usize, f64) -> Vec<Vec<f64>> + Sync + 'a;

const WANDERS: &str = "the zero of the sensor wanders";
const STEADY: &str = "keep the temperature, shield the sensor, and fix its mount";
/// Fewer periods in a recording are a wandering zero.
const SWINGS: f64 = 8.0;
/// Share of a recording at both ends in which no change is looked for: it would explain what the film begins with.
const EDGE: f64 = 0.12;
/// Share of what changes in each recording explain that one of them explains alone.
const OF_ONE: f64 = 0.7;
/// Largest share of the squares of a jump that a cause with more columns may leave.
const BEYOND_JUMP: f64 = 0.6;

impl State {
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

    /// The squares of the drives in the blocks.
    fn loads(&self) -> Vec<f64> {
        let square = |drive: &Vec<f64>| drive.iter().map(|value| value * value).collect();
        self.blocks.means(&self.drives.iter().map(square).collect::<Vec<_>>())
    }

    fn last_s(&self, j: usize) -> f64 {
        let time_s = &self.blocks.courses[j].time_s;
        time_s[time_s.len() - 1]
    }

    /// Changes of the zero of the sensor, and of what it reads.
    pub(super) fn of_sensor(&self) -> Vec<Cause> {
        let mut causes = Vec::new();
        if self.blocks.courses.len() > 1 {
            let finding = "the zero of the sensor differs between the recordings";
            let cause = Cause::of_all(finding, "fit with `offset` per-recording", self.each(|_, _, _| 1.0));
            causes.push(cause.with(Effect::Offset));
        }
        let warm = |share: f64| self.each(move |_, t, last_s| (-t / (share * last_s)).exp());
        let mut recovers: Vec<Vec<f64>> = SETTLES.into_iter().flat_map(warm).collect();
        // The sensor was zeroed while the film still moved.
        if self.blocks.courses.len() > 1 {
            recovers.extend(self.each(|_, _, _| 1.0));
        }
        let cause = Cause::of_all(
            "the stroke settles from the first row on without a cause in the drive: the film was driven before, or the sensor warms up",
            "rest for ten minutes before recording, with the sensor switched on; or fit from where it has settled (`from_s`)",
            recovers,
        );
        causes.push(cause.with(Effect::Settling));
        let cause = Cause::of_all(
            "the zero of the sensor drifts",
            "let it warm up, keep the temperature, or record shorter",
            self.each(|_, t, _| t),
        );
        causes.push(cause.with(Effect::Drift));
        let wave = |n: f64| self.each(move |_, t, last_s| (n * std::f64::consts::PI * t / last_s).cos());
        let waves = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0].into_iter().flat_map(wave);
        causes.push(Cause::of_all(WANDERS, STEADY, waves.collect()));
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
        let longest_s = (0..self.blocks.courses.len()).map(|j| self.last_s(j)).fold(0.0, f64::max);
        let (finding, advice) = if strongest.0 * longest_s < SWINGS {
            (WANDERS.into(), STEADY)
        } else {
            (
                format!(
                    "the reading swings at {:.2} Hz whatever the drive does: a mount that rings, or mains between slow rows",
                    strongest.0
                ),
                "stiffen the mount, or shield the sensor's cable and record more rows a second",
            )
        };
        causes.push(Cause::of_all(&finding, advice, lines));
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
    pub(super) fn of_film(&self) -> Vec<Cause> {
        let film = self.blocks.modelled(&self.basis);
        let (low, high) = range(&film);
        let mut causes = Vec::new();
        if self.blocks.courses.len() > 1 {
            let mut columns = self.each(|k, _, _| film[k]);
            columns.extend(self.each(|_, _, _| 1.0));
            causes.push(Cause::of_all(
                "the strokes of the recordings differ in scale: another film, or another range of the sensor or of the amplifier's monitor",
                "check the ranges; fit with `gain` per-recording, or each film for itself",
                columns,
            ));
        }
        causes.push(Cause::of_all(
            "the response to the drive changes steadily: the film ages or warms, or the sensor's scale drifts",
            "record shorter, and keep the temperature",
            self.each(|k, t, _| t * film[k]).into_iter().chain(self.each(|_, t, _| t)).collect(),
        ));
        let slope = self.slope(&film);
        causes.push(Cause::of_all(
            "the clocks of drive and stroke run apart",
            "record both with one clock",
            self.each(|k, t, _| t * slope[k]),
        ));
        for width in [0.01, 0.02, 0.05, 0.1, 0.2] {
            causes.push(Cause::of_all(
                "the stroke stays behind at each turn: friction or play in the mount",
                "free the mount from friction, and preload what has play",
                vec![self.play(&film, width * (high - low))],
            ));
        }
        causes.push(Cause::of_all(
            "the zero of the sensor slips in each cycle: a mount that slides under load",
            "fix the mount, and record again",
            self.slips(),
        ));
        let bend = |share: f64| {
            let knee = low + share * (high - low);
            vec![film.iter().map(|x| (x - knee).max(0.0)).collect::<Vec<f64>>()]
        };
        let left = |share: f64| (self.basis.square_with(&bend(share)), share);
        let least = |shares: Vec<f64>| {
            shares.into_par_iter().map(left).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, share)| share)
        };
        if let Some(near) = least((1..20).map(|k| 0.05 * f64::from(k)).collect())
            && let Some(share) = least((-4..=4).map(|k| near + 0.01 * f64::from(k)).collect())
        {
            causes.push(Cause::of_all(
                "the reading bends at one level: the end of the sensor's range, or a stop",
                "keep the stroke within the sensor's range, and empty the readings beyond it",
                bend(share),
            ));
        }
        causes
    }

    /// For each recording, the sum of the tops of the load that are past: those after which it falls below half of the largest.
    pub(super) fn slips(&self) -> Vec<Vec<f64>> {
        let loads = self.loads();
        let mut columns = vec![vec![0.0; loads.len()]; self.blocks.courses.len()];
        let (mut recording, mut top, mut sum) = (usize::MAX, 0.0_f64, 0.0);
        for (k, &(j, _)) in self.blocks.places.iter().enumerate() {
            if j != recording {
                (recording, top, sum) = (j, 0.0, 0.0);
            }
            if loads[k] < 0.5 * top {
                sum += top;
                top = 0.0;
            }
            top = top.max(loads[k]);
            columns[j][k] = sum;
        }
        columns
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
    pub(super) fn at_a_time(&self) -> Vec<Cause> {
        let film = self.blocks.modelled(&self.basis);
        let load = self.loads();
        let slope = self.slope(&film);
        let after = |j: usize, from_s: f64, values: &dyn Fn(usize) -> f64| -> Vec<f64> {
            let of = |(k, &(i, t)): (usize, &(usize, f64))| if i == j && t >= from_s { values(k) } else { 0.0 };
            self.blocks.places.iter().enumerate().map(of).collect()
        };
        let jump = |j: usize, from_s: f64| vec![after(j, from_s, &|_| 1.0)];
        let gain = |j: usize, from_s: f64| {
            vec![after(j, from_s, &|_| 1.0), after(j, from_s, &|k| film[k]), after(j, from_s, &|k| load[k])]
        };
        let clock = |j: usize, from_s: f64| vec![after(j, from_s, &|k| slope[k])];
        let kinds: [(&From, &str, &'static str); 3] = [
            (
                &jump,
                "the reading jumps",
                "fix the mount and the sensor, and record again or end the recording there (`to_s`)",
            ),
            (
                &clock,
                "drive and stroke are shifted against each other",
                "rows were lost on one side: end the recording there (`to_s`)",
            ),
            (
                &gain,
                "the response to the drive changes",
                "another film, a failing one, or another range of the sensor: end the recording there (`to_s`)",
            ),
        ];
        let count = self.blocks.courses.len();
        let mut causes: Vec<Cause> = (0..count).filter_map(|j| self.part(j)).collect();
        // In each recording, and in all of them.
        let mut least = vec![f64::INFINITY; count + 1];
        for (columns, what, advice) in kinds {
            let scan = |basis: &Basis, j: usize| self.scan(basis, &|t| columns(j, t), j);
            let mut found: Vec<(f64, Vec<Vec<f64>>)> =
                (0..count).into_par_iter().map(|j| scan(&self.basis, j)).collect();
            let mut places: Vec<(Option<usize>, String, Vec<Vec<f64>>)> = found
                .iter()
                .enumerate()
                .map(|(j, (at_s, columns))| (Some(j), format!("{what} at {at_s:.1} s"), columns.clone()))
                .collect();
            if count > 1 {
                // Each beside those of the others.
                for j in (0..count).chain(0..count) {
                    let mut basis = self.basis.clone();
                    let others = found.iter().enumerate().filter(|(other, _)| *other != j);
                    basis.extend(others.flat_map(|(_, (_, columns))| columns));
                    found[j] = scan(&basis, j);
                }
                let times: Vec<String> = found.iter().map(|(at_s, _)| format!("{at_s:.1}")).collect();
                let columns = found.into_iter().flat_map(|(_, columns)| columns).collect();
                places.push((None, format!("{what} in each recording, at {} s", times.join(", ")), columns));
            }
            // What one recording has is not one of each.
            let squares: Vec<f64> = places.iter().map(|(.., columns)| self.basis.square_with(columns)).collect();
            let before = self.basis.square();
            if let [singles @ .., each] = squares.as_slice()
                && singles.len() > 1
                && singles.iter().any(|single| before - single > OF_ONE * (before - each))
            {
                places.pop();
            }
            for (recording, finding, columns) in places {
                let square = self.basis.square_with(&columns);
                let least = &mut least[recording.unwrap_or(count)];
                if square < *least {
                    *least = least.min(BEYOND_JUMP * square);
                    let change = Change::Columns(columns);
                    causes.push(Cause { finding, advice, recording, change, effect: Effect::Other });
                }
            }
        }
        causes
    }

    /// The time in recording `j` from which `columns` leave least.
    fn scan(&self, basis: &Basis, columns: &dyn Fn(f64) -> Vec<Vec<f64>>, j: usize) -> (f64, Vec<Vec<f64>>) {
        const STEPS: i32 = 40;
        let last_s = self.last_s(j);
        let (mut middle_s, mut half_s) = (0.5 * last_s, (0.5 - EDGE) * last_s);
        for _ in 0..3 {
            let times = (-STEPS / 2..=STEPS / 2).map(|k| middle_s + half_s * f64::from(k) / f64::from(STEPS / 2));
            let times = times.filter(|t| (EDGE * last_s..=(1.0 - EDGE) * last_s).contains(t));
            let squares = times.map(|t| (basis.square_with(&columns(t)), t));
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
            effect: Effect::Other,
        })
    }
}
