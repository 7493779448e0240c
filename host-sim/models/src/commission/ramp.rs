//! The ramp: a film that is not known yet is driven in small steps, each predicted before it is taken.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::bench::{ROWS_HZ, Row};
use crate::files::parameters::Board;
use crate::references::minimum_jerk;
use crate::statistics::{differences, mean};
use springpot::Actuator;

/// Rest before the first step and after the last, s.
const REST_S: f64 = 6.0;
const RECOVERY_S: f64 = 20.0;
/// Length of a step, of the end of it that is averaged, and of its rise, s.
pub(super) const STEP_S: f64 = 3.0;
pub(super) const MEAN_S: f64 = 0.5;
pub(super) const RISE_S: f64 = 0.4;
const FALL_S: f64 = 2.0;
/// Share of a limit that no step may pass within a minute, by its prediction.
const SHARE: f64 = 0.9;
const AHEAD_S: f64 = 60.0;
/// Growth of the slope of stroke over V² that announces pull-in.
const PULL_IN: f64 = 2.0;
/// Time from which creep is logarithmic, s.
const CREEP_S: f64 = 0.3;
/// Share of its largest growth before that one of two steps must have, where that is so many times the noise: what grows less is a sensor at the end of
/// its range.
const FLAT: f64 = 0.1;
/// Share of that growth, and of the predicted one, that a single step must have.
const SHORT: f64 = 0.5;
const SURE: f64 = 5.0;
/// Share of the largest stroke by which the reading of a film at rest may drift over an excitation of so many seconds.
const DRIFT: f64 = 0.1;
const EXCITATION_S: f64 = 300.0;
/// Share of the last load that is taken back at the end, and shares of that movement and of the stroke by which the reading may stay behind it.
const BACK: f64 = 0.125;
const BEHIND: f64 = 0.3;
const HYSTERESIS: f64 = 0.015;
/// A stroke below so many times the noise does not identify a film.
const MIN_STROKE: f64 = 30.0;
/// A step is seen from so many times the noise on.
const SEEN: f64 = 3.0;

/// Limits of a film on its bench.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Limits {
    /// Largest voltage, V.
    pub voltage_v: f64,
    /// Largest field, V/m.
    pub field_v_per_m: f64,
    /// Largest displacement, m.
    pub stroke_m: f64,
    /// Largest change of voltage, V/s.
    pub slew_v_per_s: f64,
    /// Thickness of the film at rest, m, and its thinning with the stroke, 1/m.
    pub thickness_m: f64,
    /// Relative thinning with the stroke, 1/m.
    pub thinning_per_m: f64,
}

impl Limits {
    /// The limits of `actuator` on `board`.
    pub fn new(actuator: &Actuator, board: &Board) -> Self {
        let limits = &board.limits;
        Self {
            voltage_v: limits.max_voltage_v.into(),
            field_v_per_m: limits.max_field_v_per_m.into(),
            stroke_m: limits.max_displacement_m.into(),
            slew_v_per_s: limits.max_slew_v_per_s.into(),
            thickness_m: limits.thickness_m.into(),
            thinning_per_m: actuator.thinning_per_m().max(1.0 / actuator.length_m),
        }
    }
}

/// A step of the ramp.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Step {
    /// When it began, by the bench's clock, s.
    pub from_s: f64,
    /// Its voltage, V.
    pub voltage_v: f64,
    /// Displacement at its end as predicted before it, m; none where nothing was known.
    pub predicted_m: Option<f64>,
    /// Displacement a minute later, held, as predicted before it, m.
    pub minute_m: Option<f64>,
    /// Displacement at its end, m.
    pub measured_m: f64,
    /// Growth of the displacement with V², as a multiple of what it was at first.
    pub slope: Option<f64>,
}

/// The result of a ramp.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Its steps.
    pub steps: Vec<Step>,
    /// The limit or the fault that ended it.
    pub ended_by: String,
    /// The largest voltage that the film may be driven with, V.
    pub peak_v: f64,
    /// Displacement there, m.
    pub stroke_m: f64,
    /// RMS noise of the sensor at rest, m.
    pub noise_m: f64,
    /// Change of its reading at rest where that is too large to identify a film, m/s.
    #[serde(default)]
    pub drift_m_per_s: Option<f64>,
    /// Movement at the end of the ramp, when a part of the load is taken back, m: by the steps before, and as it is read. None where the reading
    /// does not stay behind.
    #[serde(default)]
    pub stays_behind_m: Option<[f64; 2]>,
    /// Whether it ended as planned, not by a trip.
    pub is_complete: bool,
    /// Whether the film can be identified: it moves enough.
    pub moves: bool,
}

#[derive(Default)]
enum Phase {
    #[default]
    Rest,
    Step,
    Back,
    Down,
}

/// A ramp in motion; a [pilot](super::bench::Pilot) asks it for the next target.
#[derive(Default)]
pub struct Ramp {
    limits: Limits,
    phase: Phase,
    began_s: Option<f64>,
    /// Voltages of the present step, V, and when it began, s.
    from_v: f64,
    to_v: f64,
    since_s: f64,
    /// Time, (V/V limit)², and displacement of rows ten a second; displacements of the present step.
    history: Vec<(f64, f64, f64)>,
    present: Vec<f64>,
    zero_m: f64,
    noise_m: f64,
    drift_m_per_s: Option<f64>,
    stays_behind_m: Option<[f64; 2]>,
    predicted: (Option<f64>, Option<f64>),
    /// Displacement at the end of the present step as if it were not taken, m.
    without_m: f64,
    steps: Vec<Step>,
    /// Growth of the load and movement within a second, m, of each step.
    quick: Vec<(f64, f64)>,
    /// Movement within the last second of the step before, m.
    creep_m: f64,
    first_slope: Option<f64>,
    ended_by: Option<String>,
    rows: u64,
}

impl Ramp {
    /// A ramp within `limits`.
    pub fn new(limits: Limits) -> Self {
        Self { limits, ..Self::default() }
    }

    /// The target after `row`, V; none at the end.
    pub fn next(&mut self, row: &Row) -> Option<f64> {
        let now_s = row.time_s;
        let began_s = *self.began_s.get_or_insert(now_s);
        if row.displacement_m.is_finite() {
            self.present.push(row.displacement_m);
        }
        if self.rows.is_multiple_of(10) && row.displacement_m.is_finite() {
            self.history.push((now_s, self.share(row.monitor_v.max(0.0)), row.displacement_m - self.zero_m));
        }
        self.rows += 1;
        let ahead_s = now_s + 1.0 / ROWS_HZ;
        match self.phase {
            Phase::Rest if now_s - began_s < REST_S => return Some(0.0),
            Phase::Rest => {
                self.zero_m = mean(&self.present);
                // Of neighbours: a drift is not noise.
                let square: f64 = differences(&self.present).map(|step| step.powi(2)).sum();
                self.noise_m = (0.5 * square / self.present.len().max(1) as f64).sqrt();
                self.drift_m_per_s = self.drift();
                self.history.iter_mut().for_each(|row| row.2 -= self.zero_m);
                self.go_on(now_s);
            }
            Phase::Step if now_s - self.since_s >= STEP_S => {
                self.measure();
                self.go_on(now_s);
            }
            Phase::Back if now_s - self.since_s >= STEP_S => {
                self.stays_behind_m = self.behind();
                self.down(now_s);
            }
            Phase::Down if now_s - self.since_s > FALL_S + RECOVERY_S => return None,
            _ => {}
        }
        let rise_s = match self.phase {
            Phase::Down => FALL_S,
            _ => RISE_S.max(4.0 * (self.to_v - self.from_v).abs() / self.limits.slew_v_per_s),
        };
        Some(self.from_v + (self.to_v - self.from_v) * minimum_jerk((ahead_s - self.since_s) / rise_s))
    }

    /// The result.
    pub fn report(self) -> Report {
        let last = self.steps.last();
        let stroke_m = last.map_or(0.0, |step| step.measured_m);
        Report {
            peak_v: last.map_or(0.0, |step| step.voltage_v),
            stroke_m,
            noise_m: self.noise_m,
            drift_m_per_s: self.drift_m_per_s,
            stays_behind_m: self.stays_behind_m,
            moves: stroke_m > MIN_STROKE * self.noise_m,
            is_complete: self.ended_by.is_some(),
            ended_by: self.ended_by.unwrap_or_else(|| "the run ended".into()),
            steps: self.steps,
        }
    }

    /// Slope of the readings at rest, m/s, where it is larger than its own error and than what identifies a film.
    fn drift(&self) -> Option<f64> {
        let (count, middle) = (self.present.len() as f64, 0.5 * (self.present.len() as f64 - 1.0));
        let moment: f64 = self.present.iter().zip(0..).map(|(x, k)| (x - self.zero_m) * (f64::from(k) - middle)).sum();
        let spread = count * (count * count - 1.0) / 12.0;
        let slope = moment / spread * ROWS_HZ;
        let error = self.noise_m / spread.sqrt() * ROWS_HZ;
        Some(slope).filter(|slope| slope.abs() > (DRIFT * self.limits.stroke_m / EXCITATION_S).max(2.0 * SURE * error))
    }

    fn share(&self, volts: f64) -> f64 {
        (volts / self.limits.voltage_v).powi(2)
    }

    /// Movement within the first second of the present step, beyond what the one before went on creeping, m.
    fn quick_m(&self) -> f64 {
        let mean = |from_s: f64, to_s: f64| self.present.get(rows(from_s)..rows(to_s)).map_or(f64::NAN, mean);
        mean(0.8, 1.2) - mean(0.0, 0.1) - self.creep_m
    }

    /// The movements of a step back, by the last steps and as it was read, m, where the reading stays behind.
    fn behind(&self) -> Option<[f64; 2]> {
        let (moved_m, back) = (-self.quick_m(), self.share(self.from_v) - self.share(self.to_v));
        // As far up.
        let (mut loaded, mut grown_m) = (0.0, 0.0);
        for (load, quick_m) in self.quick.iter().rev() {
            if loaded >= back {
                break;
            }
            grown_m += quick_m;
            loaded += load;
        }
        let expected_m = grown_m * back / loaded;
        let stroke_m = self.steps.last()?.measured_m;
        // Of means of ten rows and more.
        let noise_m = 0.5 * SURE * self.noise_m;
        let least_m = (HYSTERESIS * stroke_m).max(BEHIND * expected_m).max(noise_m);
        (expected_m - moved_m > least_m).then_some([expected_m, moved_m])
    }

    /// Ends the present step.
    fn measure(&mut self) {
        let measured_m = mean(last(&self.present, MEAN_S)) - self.zero_m;
        self.quick.push((self.share(self.to_v) - self.share(self.from_v), self.quick_m()));
        // What the steps before still creep is no part of it.
        let moved_m = measured_m - self.without_m;
        let slope = moved_m / (self.share(self.to_v) - self.share(self.from_v));
        let is_seen = moved_m.abs() > SEEN * self.noise_m;
        // Friction may have held most of the first one.
        if is_seen && self.steps.iter().filter(|step| step.slope.is_some()).count() < 2 {
            self.first_slope = self.first_slope.into_iter().chain([slope]).reduce(f64::max);
        }
        let (predicted_m, minute_m) = self.predicted;
        let slope = self.first_slope.filter(|_| is_seen).map(|first| slope / first);
        self.steps.push(Step { from_s: self.since_s, voltage_v: self.to_v, predicted_m, minute_m, measured_m, slope });
    }

    /// The next step, or the way down.
    fn go_on(&mut self, now_s: f64) {
        let before = last(&self.present, 1.0 + MEAN_S);
        self.creep_m = mean(last(before, MEAN_S)) - mean(&before[..before.len().min(rows(MEAN_S))]);
        self.present.clear();
        (self.from_v, self.since_s) = (self.to_v, now_s);
        match self.next_voltage() {
            Ok(volts) => {
                self.phase = Phase::Step;
                self.to_v = volts;
                self.without_m = self.prediction(self.from_v, STEP_S).unwrap_or(0.0);
                self.predicted = (self.prediction(volts, STEP_S), self.prediction(volts, AHEAD_S));
            }
            Err(why) => {
                self.ended_by = Some(why);
                if self.drift_m_per_s.is_some() || is_flat(&self.steps, self.noise_m) {
                    self.down(now_s);
                    return;
                }
                self.phase = Phase::Back;
                self.to_v = (1.0 - BACK).sqrt() * self.from_v;
            }
        }
    }

    fn down(&mut self, now_s: f64) {
        (self.from_v, self.to_v, self.since_s) = (self.to_v, 0.0, now_s);
        self.phase = Phase::Down;
    }

    /// The voltage of the next step, V, or why there are no more.
    fn next_voltage(&self) -> Result<f64, String> {
        // Doubled at first, then by equal parts of the force.
        if self.drift_m_per_s.is_some() {
            return Err("the reading drifts at 0 V".into());
        }
        let now = self.share(self.from_v);
        let wanted = if now < 1.0 / 17.0 { (2.0 * now).max(1.0 / 256.0) } else { now + 1.0 / 16.0 };
        if let [.., before, last] = self.steps.as_slice() {
            let falls = |step: &Step| step.measured_m < -2.0 * SEEN * self.noise_m;
            if falls(before) && falls(last) {
                return Err("the stroke falls as the voltage rises".into());
            }
            if is_flat(&self.steps, self.noise_m) {
                return Err("the displacement no longer grows with the voltage".into());
            }
            let growth = last.slope.unwrap_or(1.0).max(0.0);
            let next = growth * (growth / before.slope.unwrap_or(growth).max(f64::MIN_POSITIVE)).max(1.0);
            if growth.max(next) > PULL_IN {
                return Err(format!(
                    "the stroke grows {:.1} times as fast with V² as at first: pull-in is near",
                    growth.max(next)
                ));
            }
        }
        let end_v = SHARE * self.limits.voltage_v;
        if self.from_v >= 0.999 * end_v {
            return Err(format!("{:.0} % of the largest voltage", 100.0 * SHARE));
        }
        let allowed = |share: f64| {
            let volts = share.sqrt() * self.limits.voltage_v;
            let stroke_m = self.prediction(volts, AHEAD_S).unwrap_or(0.0);
            let field = volts * (1.0 + self.limits.thinning_per_m * stroke_m.max(0.0)) / self.limits.thickness_m;
            match () {
                () if stroke_m > SHARE * self.limits.stroke_m => Err("stroke"),
                () if field > SHARE * self.limits.field_v_per_m => Err("field"),
                () => Ok(volts),
            }
        };
        let wanted = wanted.min(self.share(end_v));
        let Err(limit) = allowed(wanted) else { return Ok(wanted.sqrt() * self.limits.voltage_v) };
        let (mut fits, mut passes) = (now, wanted);
        for _ in 0..20 {
            let middle = 0.5 * (fits + passes);
            if allowed(middle).is_ok() { fits = middle } else { passes = middle }
        }
        if fits - now < 0.2 * (wanted - now) {
            return Err(format!(
                "the next step would pass {:.0} % of the largest {limit} within a minute",
                100.0 * SHARE
            ));
        }
        Ok(fits.sqrt() * self.limits.voltage_v)
    }

    /// Displacement (m) at `volts`, held for `after_s`, by what was measured so far; none before the second step.
    fn prediction(&self, volts: f64, after_s: f64) -> Option<f64> {
        let last = self.steps.last()?;
        let now_s = self.since_s;
        // Past steps, and the one to come.
        let rises: Vec<(f64, f64)> = std::iter::once((0.0, 0.0))
            .chain(self.steps.iter().map(|step| (step.from_s, self.share(step.voltage_v))))
            .collect();
        let creep = |t: f64| -> f64 {
            let of = |pair: &[(f64, f64)]| (pair[1].1 - pair[0].1) * (1.0 + (t - pair[1].0).max(0.0) / CREEP_S).log10();
            rises.windows(2).map(of).sum()
        };
        let (share, rise) = (self.share(volts), self.share(volts) - self.share(last.voltage_v));
        let creep_then = creep(now_s + after_s) + rise * (1.0 + after_s / CREEP_S).log10();
        let is_curved = self.steps.len() > 5;
        let row = |share: f64, creep: f64| {
            let mut row = vec![1.0, share, creep];
            row.extend(is_curved.then_some(share * share));
            row
        };
        let rows: Vec<Vec<f64>> = self.history.iter().map(|(t, share, _)| row(*share, creep(*t))).collect();
        let measured: Vec<f64> = self.history.iter().map(|row| row.2).collect();
        let found = solved(&rows, &measured)?;
        let at = |row: &[f64]| row.iter().zip(&found).map(|(x, c)| x * c).sum::<f64>();
        // From where it is, and no less than the last step's slope has it.
        let line = last.measured_m + at(&row(share, creep_then)) - at(&row(self.share(last.voltage_v), creep(now_s)));
        let slope = self.first_slope.unwrap_or(0.0) * last.slope.unwrap_or(0.0);
        Some(line.max(last.measured_m + slope * rise))
    }
}

fn rows(time_s: f64) -> usize {
    (time_s * ROWS_HZ) as usize
}

/// The last so many seconds of `present`.
fn last(present: &[f64], time_s: f64) -> &[f64] {
    &present[present.len().saturating_sub(rows(time_s))..]
}

/// Whether the displacement has grown by less than half of what was predicted in the last step, or not at all in the last two, although it did in those
/// before.
pub(super) fn is_flat(steps: &[Step], noise_m: f64) -> bool {
    let growths: Vec<[f64; 2]> = steps
        .windows(2)
        .map(|pair| [pair[1].voltage_v.powi(2) - pair[0].voltage_v.powi(2), pair[1].measured_m - pair[0].measured_m])
        .collect();
    let [before @ .., last_but_one, last] = growths.as_slice() else { return false };
    let usual = before.iter().map(|[squares, grown_m]| grown_m / squares).fold(0.0, f64::max);
    let is_below = |share: f64, [squares, grown_m]: &[f64; 2]| {
        let expected_m = usual * squares;
        expected_m > SURE * noise_m && *grown_m < share * expected_m
    };
    let is_short = steps.windows(2).next_back().is_some_and(|pair| {
        let predicted_m = pair[1].predicted_m.map_or(0.0, |predicted_m| predicted_m - pair[0].measured_m);
        last[1] < SHORT * predicted_m && is_below(SHORT, last)
    });
    is_short || (is_below(FLAT, last_but_one) && is_below(FLAT, last))
}

/// Least squares; none where the columns do not differ.
pub(super) fn solved(rows: &[Vec<f64>], values: &[f64]) -> Option<Vec<f64>> {
    let columns = rows.first()?.len();
    let matrix = DMatrix::from_fn(rows.len(), columns, |i, j| rows[i][j]);
    let scale: Vec<f64> = (0..columns).map(|j| matrix.column(j).norm().max(f64::MIN_POSITIVE)).collect();
    let matrix = DMatrix::from_fn(rows.len(), columns, |i, j| matrix[(i, j)] / scale[j]);
    let mut normal = matrix.transpose() * &matrix;
    // What two columns share alike is shared between them.
    (0..columns).for_each(|j| normal[(j, j)] += 1e-9);
    let right = matrix.transpose() * DVector::from_column_slice(values);
    let found = normal.cholesky()?.solve(&right);
    Some(found.iter().zip(scale).map(|(c, scale)| c / scale).collect())
}
