//! Causes in the voltage: what is on the film is not what was recorded.

use rayon::prelude::*;

use super::{Cause, Change, Effect, Fault, SIZE, State};
use crate::grid::Samples;
use crate::statistics::{mean, noise, peak, percentile, sorted};

/// Voltages with one parameter: its grid, the voltage on the film, the finding with `{}` for the parameter, how that is written, the advice, and
/// the effect.
type Family<'a> = (
    &'a [f64],
    &'a (dyn Fn(f64, &[f64], &[f64]) -> Vec<f64> + Sync),
    &'a str,
    fn(f64) -> String,
    &'static str,
    fn(f64) -> Effect,
);

pub(super) const ZERO: &str = "check the zero of the monitor and the amplifier's smallest voltage";
/// Largest share of the squares of a plain film without a dead band, and of any film, that one with a dead band may leave.
const PLAINER: f64 = 0.25;
const AS_GOOD: f64 = 1.5;
/// Voltages of a wrong zero, as shares of the largest, and its size as a fault over that.
const OFF_ZERO: std::ops::Range<f64> = 0.002..0.04;
const OF_ZERO: f64 = 0.6;
/// Shortest time, s, and fewest rows at one voltage that are a rest, and the voltages that are one, as a share of the largest.
const REST_S: f64 = 0.1;
const REST_ROWS: usize = 5;
const SAME: f64 = 5e-4;
/// Share of the rows under voltage that a dead band contains at least.
const CROSSED: f64 = 0.03;

impl State {
    /// A dead band with which a plain film explains as much as a strongly nonlinear one without it.
    pub(super) fn dead_band(&self) -> Option<Fault> {
        if !self.blocks.courses.iter().all(|course| course.is_voltage) {
            return None;
        }
        let left = |share: f64| {
            let drives: Vec<Vec<f64>> = self.drives.iter().map(|volts| beyond(share, volts)).collect();
            (self.blocks.plain_film(&drives).square(), share)
        };
        let least = |shares: Vec<f64>| shares.into_par_iter().map(left).min_by(|a, b| a.0.total_cmp(&b.0));
        let (_, near) = least((1..=10).map(|k| 0.04 * f64::from(k)).collect())?;
        let (with, share) = least((-3..=3).map(|k| near + 0.01 * f64::from(k)).collect())?;
        let (without, _) = left(0.0);
        let size = self.rms(without - with);
        // The drive must have been within the band, or a wrong zero looks the same.
        let sizes = || self.drives.iter().flatten().map(|volts| volts.abs()).filter(|volts| *volts > 0.01);
        let is_crossed = sizes().filter(|volts| *volts < share).count() as f64 > CROSSED * sizes().count() as f64;
        let is_better = with < PLAINER * without && with < AS_GOOD * self.basis.square() && size > SIZE;
        let fault = Fault::of_all(DEAD_BAND.replace("{}", &percent(share)), ZERO, size);
        (is_better && is_crossed).then_some(fault)
    }

    /// Voltages that are near 0, and not 0, where the drive rests or turns: a film does not show them.
    pub(super) fn zero_of_monitor(&self) -> Option<Fault> {
        let courses = &self.blocks.courses;
        if !courses.iter().all(|course| course.is_voltage) {
            return None;
        }
        let lowest = courses.iter().zip(&self.drives).map(|(course, volts)| lowest(&course.time_s, volts));
        let lowest: Vec<f64> = lowest.collect::<Option<_>>()?;
        let mean = mean(&lowest);
        let are_alike = lowest.iter().all(|low| (low - mean).abs() < 0.5 * mean.abs());
        let finding = format!(
            "the voltage is {:.2} % of the largest where it is lowest: a zero of the monitor that is off, unless the amplifier gives it",
            100.0 * mean
        );
        let advice = "measure the monitor while the amplifier is off, and subtract that from the voltages";
        let fault = Fault::of_all(finding, advice, OF_ZERO * mean.abs());
        (are_alike && OFF_ZERO.contains(&mean.abs())).then_some(fault)
    }

    /// Voltages on the film that are not the recorded ones.
    pub(super) fn of_voltage(&self) -> Vec<Cause> {
        const MONITOR: &str = "record the amplifier's monitor, not the command";
        const CLOCK: &str = "record both with one clock and without filters";
        const OTHER: fn(f64) -> Effect = |_| Effect::Other;
        let courses = &self.blocks.courses;
        if !courses.iter().all(|course| course.is_voltage) {
            return Vec::new();
        }
        let slopes = courses.iter().zip(&self.drives).flat_map(|(course, volts)| {
            course.time_s.windows(2).zip(volts.windows(2)).map(|(t, v)| (v[1] - v[0]).abs() / (t[1] - t[0]))
        });
        let steepest = percentile(&sorted(slopes), 0.995);
        let has_both = self.drives.iter().flatten().any(|volts| *volts < -0.05);
        let families: [Family<'_>; 12] = [
            (
                &[0.05, 0.1, 0.2, 0.4],
                &ahead,
                "the recorded voltage lags the one on the film by about {}: a slow monitor, or a stroke that was smoothed without delay",
                milliseconds,
                CLOCK,
                |lag_s| Effect::Lag(-lag_s),
            ),
            (
                &[0.05, 0.1, 0.2, 0.4, 0.8],
                &|lag_s, time_s, volts| lagged(time_s, volts, lag_s, lag_s),
                "the voltage on the film lags the recorded one by about {}: an amplifier behind its command, or a late sensor",
                milliseconds,
                MONITOR,
                Effect::Lag,
            ),
            (
                &[0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2],
                &|lag_s, time_s, volts| lagged(time_s, volts, 0.0, lag_s),
                "the voltage on the film lags the recorded one by about {} as it falls: an amplifier without a bleeder",
                milliseconds,
                MONITOR,
                Effect::Lag,
            ),
            (
                &[-0.05, -0.1, -0.2, -0.4, -0.8],
                &shifted,
                "the voltage lags the stroke by about {}: a slow monitor, clocks that differ, or a stroke that was smoothed without delay",
                milliseconds,
                CLOCK,
                Effect::Lag,
            ),
            (
                &[0.9, 0.7, 0.5, 0.35, 0.2, 0.1, 0.05, 0.02],
                &|share, time_s, volts| limited(time_s, volts, share * steepest),
                "the voltage on the film changes by at most {} of the recorded slope: an amplifier at its current limit",
                percent,
                MONITOR,
                OTHER,
            ),
            (
                &[0.95, 0.85, 0.75, 0.65, 0.55, 0.4],
                &|share, _, volts| volts.iter().map(|v| v.clamp(-share, share)).collect(),
                "the voltage on the film ends at about {} of the largest recorded: an amplifier at the end of its range",
                percent,
                MONITOR,
                OTHER,
            ),
            (&[0.03, 0.1, 0.2, 0.3, 0.4], &|share, _, volts| beyond(share, volts), DEAD_BAND, percent, ZERO, OTHER),
            (
                &[-0.2, -0.1, -0.04, 0.04, 0.1, 0.2],
                &|share, _, volts| volts.iter().map(|v| v + share).collect(),
                "the voltage on the film differs from the recorded one by about {} of the largest: a wrong zero of the monitor",
                percent,
                ZERO,
                OTHER,
            ),
            (
                &[0.05, 0.1, 0.2, 0.4, 0.8],
                &shifted,
                "the stroke lags the drive by about {}: a late sensor, or an amplifier behind its command",
                milliseconds,
                "fit `sensor_delay_s` states a known delay; record both with one clock and without filters",
                Effect::Lag,
            ),
            (
                &[0.0],
                &|_, time_s, volts| arched(time_s, volts),
                "the drive ends at one level beyond which the film goes on: a monitor at the end of its range",
                percent,
                "use a larger range of the monitor",
                OTHER,
            ),
            (
                &[0.005],
                &smoothed,
                "the voltage is recorded in steps that the film does not follow",
                percent,
                "record the voltage as finely as the stroke",
                OTHER,
            ),
            (
                &[0.0],
                &|_, _, volts| volts.iter().map(|v| if has_both { v.max(0.0) } else { *v }).collect(),
                "the film follows one polarity only: an amplifier of one polarity",
                percent,
                MONITOR,
                OTHER,
            ),
        ];
        let best = |(grid, drive, finding, written, advice, effect): &Family<'_>| {
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
            let finding = finding.replace("{}", &written(p));
            Some(Cause { finding, advice, recording: None, change: change(p), effect: effect(p) })
        };
        families.par_iter().filter_map(best).collect()
    }
}

const DEAD_BAND: &str = "the film does not follow voltages below about {} of the largest: a dead band of the amplifier";

fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share.abs())
}

fn milliseconds(time_s: f64) -> String {
    format!("{:.0} ms", 1e3 * time_s.abs())
}

/// The voltage at which `volts` of one polarity stay for a while where they are lowest; none where they do not stay.
fn lowest(time_s: &[f64], volts: &[f64]) -> Option<f64> {
    let polarity = volts.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs()))?.signum();
    let smooth: Vec<f64> = volts.windows(REST_ROWS).map(mean).collect();
    let least = smooth.iter().copied().min_by(|a, b| (polarity * a).total_cmp(&(polarity * b)))?;
    let near = SAME.max(4.0 * noise(volts));
    let is_near = |k: &usize| (smooth[*k] - least).abs() <= near;
    let rows: Vec<usize> = (0..smooth.len()).filter(is_near).collect();
    let runs = rows.chunk_by(|a, b| a + 1 == *b).map(|run| run[0]..run[run.len() - 1] + REST_ROWS);
    let longest = runs.max_by(|a, b| a.len().cmp(&b.len()))?;
    (time_s[longest.end - 1] - time_s[longest.start] >= REST_S).then(|| mean(&volts[longest]))
}

/// `volts` without the part within `share`.
fn beyond(share: f64, volts: &[f64]) -> Vec<f64> {
    volts.iter().map(|v| v.signum() * (v.abs() - share).max(0.0)).collect()
}

/// `volts` later by `shift_s`.
pub(super) fn shifted(shift_s: f64, time_s: &[f64], volts: &[f64]) -> Vec<f64> {
    Samples { time_s: time_s.to_vec(), value: volts.to_vec() }.at(time_s.iter().map(|t| t - shift_s))
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
    let (corner_s, value) = corners.into_iter().unzip();
    Samples { time_s: corner_s, value }.at(time_s.iter().copied())
}

/// `volts` with the tops that end at the largest value replaced by parabolas, as the slopes beside them continue.
fn arched(time_s: &[f64], volts: &[f64]) -> Vec<f64> {
    let peak = peak(volts);
    let near = |k: usize| volts[k].abs() > 0.99 * peak;
    let mut arched = volts.to_vec();
    let mut from = 0;
    while from < volts.len() {
        let to = (from..volts.len()).take_while(|&k| near(k)).last();
        let Some(to) = to else {
            from += 1;
            continue;
        };
        let reach = ((to - from) / 4).max(3);
        if from >= reach && to + reach < volts.len() && to > from + 2 {
            let slope = |a: usize, b: usize| (volts[b] - volts[a]) / (time_s[b] - time_s[a]);
            let (rise, fall) = (slope(from - reach, from), slope(to, to + reach));
            let width_s = time_s[to] - time_s[from];
            for k in from..=to {
                let share = (time_s[k] - time_s[from]) / width_s;
                arched[k] += 0.5 * (rise - fall) * width_s * share * (1.0 - share);
            }
        }
        from = to + 1;
    }
    arched
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

/// The voltages that a first-order filter of `lag_s` would turn into `volts`, whose slopes are those over a third of that time.
fn ahead(lag_s: f64, time_s: &[f64], volts: &[f64]) -> Vec<f64> {
    let reach_s = lag_s / 6.0;
    let (mut from, mut to) = (0, 0);
    let mut at = |k: usize| {
        while time_s[k] - time_s[from] > reach_s {
            from += 1;
        }
        while to + 1 < time_s.len() && time_s[to] - time_s[k] < reach_s {
            to += 1;
        }
        let span_s = time_s[to] - time_s[from];
        volts[k] + if span_s > 0.0 { lag_s * (volts[to] - volts[from]) / span_s } else { 0.0 }
    };
    (0..volts.len()).map(&mut at).collect()
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
