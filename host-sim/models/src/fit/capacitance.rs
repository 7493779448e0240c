//! The relation of capacitance and displacement, from a recording that has both.

use dea_driver::SelfSensor;
use host_io::terminal::rounded;
use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use springpot::{
    Actuator, CapacitanceRelation, EPSILON_0, FilmReading, Law, LawOptions, Maxwell, SelfSensing, SelfSensingOptions,
    Springpot, Topology,
};

use crate::error::{Error, Result};
use crate::files::capacitance::{CapacitanceFile, ToneRecording};
use crate::files::parameters::Board;
use crate::files::parameters::plausibility::self_sensing_faults;
use crate::statistics::{self, differences, noise, peak, sorted};

/// Capacitance and displacement of the same block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CapacitanceSample {
    /// Capacitance of film and cable, F.
    pub capacitance_f: f64,
    /// Displacement, m.
    pub displacement_m: f64,
}

/// A relation that was fitted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CapacitanceFit {
    /// The relation. Its uncertainty is the RMS of what it does not explain.
    #[serde(skip)]
    pub relation: CapacitanceRelation,
    /// RMS of what it does not explain, m.
    pub rms_m: f64,
    /// The same without creep, m.
    pub rms_without_creep_m: f64,
    /// Largest displacement, m.
    pub stroke_m: f64,
}

const ORDERS: [f64; 12] = [0.03, 0.06, 0.1, 0.14, 0.18, 0.23, 0.28, 0.34, 0.4, 0.5, 0.6, 0.75];
/// Rounds in which the polynomial and what creeps of it agree.
const ROUNDS: usize = 5;
/// Samples that are needed: ten for a number.
const MIN_SAMPLES: usize = 50;
/// Share of the largest singular value below which a column is not used.
const RANK: f64 = 1e-9;

/// Time over which samples are averaged, s: their noise would bias the relation, which has nothing as fast.
const AVERAGED_S: f64 = 0.1;

/// Fits the relation to `samples`, one every `interval_s` (s), of a film that was at rest at x = 0 in the first.
///
/// For each order α the coefficients of x = P(q) + k D^α P(q) by linear least squares, with D^α P of the last round; the order with the
/// least residual.
///
/// # Errors
///
/// [`Error::Computation`] for too few samples, none in motion, and a displacement that does not rise with the capacitance.
pub fn fit(samples: &[CapacitanceSample], interval_s: f64) -> Result<CapacitanceFit> {
    let refused = Error::Computation;
    if samples.len() < MIN_SAMPLES {
        return Err(refused(format!("{} blocks with a capacitance; {MIN_SAMPLES} are needed", samples.len())));
    }
    let each = ((AVERAGED_S / interval_s).round() as usize).clamp(1, samples.len() / MIN_SAMPLES);
    let mean = |block: &[CapacitanceSample], of: fn(&CapacitanceSample) -> f64| {
        block.iter().map(of).sum::<f64>() / block.len() as f64
    };
    let averaged: Vec<CapacitanceSample> = samples
        .chunks_exact(each)
        .map(|block| CapacitanceSample {
            capacitance_f: mean(block, |sample| sample.capacitance_f),
            displacement_m: mean(block, |sample| sample.displacement_m),
        })
        .collect();
    let (samples, interval_s) = (averaged.as_slice(), interval_s * each as f64);
    let rest_f = samples[0].capacitance_f;
    let max_f = samples.iter().map(|s| s.capacitance_f).fold(0.0, f64::max);
    let stroke_m = samples.iter().map(|s| s.displacement_m).fold(0.0, f64::max);
    let straight = solve(samples, interval_s, (rest_f, max_f), None)?;
    let crept = ORDERS.iter().map(|&alpha| solve(samples, interval_s, (rest_f, max_f), Some(alpha)));
    let crept = crept.collect::<Result<Vec<_>>>()?;
    let (relation, rms_m) = crept.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or(straight);
    let [a, b, c] = relation.stroke_m;
    let range = relation.max_f / relation.rest_f - 1.0;
    let rises = (0..=32).all(|k| {
        let q = range * f64::from(k) / 32.0;
        a + q * (2.0 * b + 3.0 * c * q) > 0.0
    });
    if !rises {
        return Err(refused(
            "the displacement does not rise with the capacitance: is the current that of the film?".into(),
        ));
    }
    Ok(CapacitanceFit { relation, rms_m, rms_without_creep_m: straight.1, stroke_m })
}

/// The relation of this order, or without creep, and the RMS of what it does not explain, m.
fn solve(
    samples: &[CapacitanceSample],
    interval_s: f64,
    (mut rest_f, max_f): (f64, f64),
    alpha: Option<f64>,
) -> Result<(CapacitanceRelation, f64)> {
    let measured = DVector::from_iterator(samples.len(), samples.iter().map(|s| s.displacement_m));
    let mut relation = CapacitanceRelation {
        rest_f,
        max_f,
        stroke_m: [1.0, 0.0, 0.0],
        creep: 0.0,
        alpha: alpha.unwrap_or(0.2),
        uncertainty_m: 0.0,
    };
    let mut rms_m = f64::INFINITY;
    for _ in 0..ROUNDS {
        let changes: Vec<f64> = samples.iter().map(|s| s.capacitance_f / rest_f - 1.0).collect();
        let crept = match alpha {
            None => Vec::new(),
            Some(alpha) => fractional(alpha, interval_s, changes.iter().map(|&q| relation.displacement_of_change(q)))?,
        };
        let columns = if alpha.is_some() { 5 } else { 4 };
        let matrix = DMatrix::from_fn(samples.len(), columns, |row, column| match column {
            4 => crept[row],
            power => changes[row].powi(power as i32),
        });
        // Columns of like size.
        let sizes: Vec<f64> = matrix.column_iter().map(|column| column.norm().max(f64::MIN_POSITIVE)).collect();
        let scaled = DMatrix::from_fn(samples.len(), columns, |row, column| matrix[(row, column)] / sizes[column]);
        let solution = (scaled.transpose() * &scaled)
            .svd(true, true)
            .solve(&(scaled.transpose() * &measured), RANK)
            .map_err(|error| Error::Computation(error.to_owned()))?;
        rms_m = ((&scaled * &solution - &measured).norm_squared() / samples.len() as f64).sqrt();
        let value = |column: usize| solution[column] / sizes[column];
        relation = CapacitanceRelation {
            rest_f,
            stroke_m: [1, 2, 3].map(value),
            creep: if alpha.is_some() { value(4) } else { 0.0 },
            uncertainty_m: rms_m,
            ..relation
        };
        // Where the polynomial is 0 the film is at rest.
        let shift = -value(0) / relation.stroke_m[0];
        if !shift.is_finite() {
            return Err(Error::Computation("the capacitance does not change: move the film".into()));
        }
        rest_f *= 1.0 + shift.clamp(-0.02, 0.02);
    }
    Ok((relation, rms_m))
}

/// D^α of `values`, one every `interval_s` (s), from 0.
fn fractional(alpha: f64, interval_s: f64, values: impl Iterator<Item = f64>) -> Result<Vec<f64>> {
    let model = Maxwell::new(Springpot::new(1.0, alpha), &[], Topology::Eq11, 0.0)?;
    let law: Law<f64> = Law::compressed(&model, LawOptions::at_step(interval_s))?;
    let mut state = law.state();
    Ok(values.map(|value| law.force(&mut state, value)).collect())
}

/// A film and its monitors by a recording with a tone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Report {
    /// Whether the film can be its own sensor here: noise and residual of at most 1 % of the stroke.
    pub senses: bool,
    /// Amplitude of the tone at the voltage monitor, V.
    pub tone_v: f64,
    /// Standard deviations of the monitors' readings, resolution included, V and A.
    pub voltage_noise_v: f64,
    /// As that of the voltage.
    pub current_noise_a: f64,
    /// Smallest difference of two readings, V and A.
    pub voltage_step_v: f64,
    /// As that of the voltage.
    pub current_step_a: f64,
    /// Noise of the displacement over 50 ms, in % of the stroke.
    pub noise_pct: f64,
    /// RMS of what the relation does not explain, in % of the stroke.
    pub residual_pct: f64,
    /// The same without creep.
    pub residual_without_creep_pct: f64,
    /// Largest displacement, m.
    pub stroke_m: f64,
    /// Capacitance of film and cable at rest, F.
    pub rest_f: f64,
    /// The largest, F.
    pub max_f: f64,
}

/// Time over which noise is stated, s.
const WINDOW_S: f64 = 0.05;
/// Largest noise and residual of a film that senses itself, in % of the stroke.
const MAX_PCT: f64 = 1.0;
/// Least share of the tone that an amplifier passes: with more lag its steps last beyond a tick, and the electrodes' resistance shows.
const MIN_PASSED: f64 = 0.5;
/// Least tone, in standard deviations of a phasor.
const MIN_TONE: f64 = 20.0;

/// Reasons for which the amplifier and the limits of `board` do not pass a tone of `tone_v` (V) at ticks of `step_s` (s).
#[must_use]
pub fn refusals(board: &Board, tone_v: f64, step_s: f64) -> Vec<String> {
    let mut refusals = Vec::from_iter(slow(step_s));
    let options = SelfSensingOptions { tone_v, step_s, ..SelfSensingOptions::BENCH };
    let (needed, allowed) = (options.tone_slew_v_per_s(), f64::from(board.limits.max_slew_v_per_s));
    if needed > allowed {
        refusals.push(format!(
            "a tone of {tone_v:.0} V slews {:.0} kV/s, limits.max_slew_v_per_s is {:.0} kV/s: raise it if the amplifier is as fast, or use {:.0} V",
            needed / 1e3,
            allowed / 1e3,
            (tone_v * allowed / needed).floor()
        ));
    }
    let lag_s = board.amplifier_lag.rise_s.max(board.amplifier_lag.fall_s);
    // Of steps of 0, 1, 0 and −1 at the ends of the ticks.
    let left = if lag_s > 0.0 { (-step_s / lag_s).exp() } else { 0.0 };
    let passed = (1.0 - left) / (1.0 + left * left).sqrt();
    if passed < MIN_PASSED {
        refusals.push(format!(
            "the amplifier takes {lag_s:.3} s and passes {:.0} % of a tone of {:.0} Hz, half of it is needed: use a faster amplifier",
            100.0 * passed,
            0.25 / step_s
        ));
    }
    refusals
}

/// Why ticks of `step_s` (s) are too slow, if they are.
fn slow(step_s: f64) -> Option<String> {
    // A block of as few periods as possible, thrice, and a tick, within 100 ms.
    (SelfSensor::max_periods(step_s) < SelfSensingOptions::MIN_PERIODS).then(|| {
        format!(
            "ticks of {:.3} ms are too slow for a fault of the film to end at 0 V within 100 ms: use 250 Hz or more",
            1e3 * step_s
        )
    })
}

/// The film as its own sensor before there is a recording with a tone: how far amplifier and voltage monitor suffice.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Prospect {
    /// Amplitude of the tone, V.
    pub tone_v: f64,
    /// Standard deviation of a reading of the voltage monitor, resolution included, V.
    pub voltage_noise_v: f64,
    /// Noise of the displacement over 50 ms by that alone, in % of the stroke.
    pub noise_pct: f64,
    /// Reasons for which they do not.
    pub refusals: Vec<String>,
}

impl Prospect {
    /// That of `board` with ticks of `step_s` (s) around a film of `actuator`'s sizes that moves by `stroke_m` (m); `monitor_v` are readings of its monitor (V)
    /// while the voltage changes slowly. None for a film that does not move.
    #[must_use]
    pub fn new(actuator: &Actuator, board: &Board, stroke_m: f64, step_s: f64, monitor_v: &[f64]) -> Option<Self> {
        let voltage_noise_v = noise(monitor_v).max(smallest_step(monitor_v) / 12f64.sqrt());
        // The current monitor is not known: as if it had no noise.
        let options = SelfSensingOptions {
            step_s,
            voltage_noise_v: voltage_noise_v.max(1e-9),
            current_noise_a: 1e-15,
            cable_f: 0.0,
            ..SelfSensingOptions::BENCH
        };
        let Actuator { relative_permittivity, length_m, width_m, thickness_m, .. } = *actuator;
        let rest_f = EPSILON_0 * relative_permittivity * length_m * width_m / thickness_m;
        let max_f = rest_f * (1.0 + stroke_m / length_m).powi(2);
        let relation = CapacitanceRelation::of_geometry(rest_f, length_m, 2.0, max_f);
        let sensing = SelfSensing::<f64>::new(&relation, options).ok()?;
        let noise_m = sensing.noise_m(options.tone_v, WINDOW_S / options.sample_interval_s());
        let noise_pct = 100.0 * noise_m / stroke_m;
        let mut refusals = refusals(board, options.tone_v, step_s);
        if noise_pct > MAX_PCT {
            refusals.push(format!(
                "the voltage monitor's noise of {voltage_noise_v:.2} V is {noise_pct:.1} % of the stroke over 50 ms, {MAX_PCT} % is the most: use \
                 a converter with more bits, or a monitor with less noise"
            ));
        }
        Some(Self { tone_v: options.tone_v, voltage_noise_v, noise_pct, refusals })
    }

    /// In a sentence.
    #[must_use]
    pub fn sentence(&self) -> String {
        match self.refusals.as_slice() {
            [] => format!(
                "amplifier and voltage monitor pass a tone of {:.0} V; the monitor's noise is {:.2} % of the stroke over 50 ms. A monitor of the current is needed, \
                 and a recording with the tone for springpot self-sensing",
                self.tone_v, self.noise_pct
            ),
            refusals => format!("not on this bench: {}", refusals.join("; ")),
        }
    }
}

/// Identifies the relation of a film from `recording`; `cable_f` is the capacitance of the cable alone (F), 0 if it is not known.
///
/// # Errors
///
/// [`Error::Computation`] for a recording without a tone, or with too few rows a second, and as [`fit`].
pub fn identify(recording: &ToneRecording, cable_f: f64) -> Result<(CapacitanceFile, Report)> {
    let ToneRecording { step_s, voltage_v, current_a, displacement_m } = recording;
    let refused = Error::Computation;
    let most = SelfSensor::max_periods(*step_s).max(SelfSensingOptions::MIN_PERIODS);
    let periods = SelfSensingOptions::BENCH.periods.min(most);
    let ticks = 4 * usize::from(periods);
    let [voltage, current] = [voltage_v, current_a].map(|values| Tones::new(values, ticks));
    let tone_v = voltage.amplitude;
    if !(tone_v > MIN_TONE * voltage.phasor_noise() && tone_v > 0.0) {
        return Err(refused(format!(
            "the voltage has no tone of four rows a period ({tone_v:.2} V, of which noise is {:.2} V): record every tick, with the tone on",
            voltage.phasor_noise()
        )));
    }
    if let Some(slow) = slow(*step_s) {
        return Err(refused(slow));
    }
    let capacitance_f = current.amplitude / tone_v * step_s / 2f64.sqrt();
    let options = SelfSensingOptions {
        step_s: *step_s,
        tone_v,
        periods,
        voltage_noise_v: voltage.noise.max(1e-9),
        current_noise_a: current.noise.max(1e-15),
        max_current_a: 4.0 * peak(current_a).max(1e-12),
        cable_f,
        ..SelfSensingOptions::BENCH
    };
    // Any relation shows the capacitance.
    let guess = CapacitanceRelation::of_geometry(capacitance_f.max(1.01 * cable_f), 1.0, 2.0, 4.0 * capacitance_f);
    let sensing = SelfSensing::<f64>::new(&guess, SelfSensingOptions { cable_f: 0.0, ..options })
        .map_err(|error| refused(error.to_string()))?;
    let (mut state, mut samples, mut variances) = (sensing.state(), Vec::new(), Vec::new());
    for (k, (&voltage_v, &current_a)) in voltage_v.iter().zip(current_a).enumerate() {
        let Some(sensed) = sensing.sense(&mut state, FilmReading { voltage_v, current_a }) else { continue };
        let middle = k.saturating_sub(sensed.sample.age_ticks);
        let block = displacement_m.get(middle.saturating_sub(ticks / 2)..middle + ticks / 2).unwrap_or_default();
        let (sum, count) = block.iter().filter(|x| x.is_finite()).fold((0.0, 0.0), |(s, n), x| (s + x, n + 1.0));
        if count > 0.0 {
            samples.push(CapacitanceSample { capacitance_f: sensed.capacitance_f, displacement_m: sum / count });
            variances.push(sensed.variance_m2);
        }
    }
    let blocks = voltage_v.len() / ticks;
    if samples.len() + blocks / 20 + 2 < blocks {
        return Err(refused(format!(
            "{} of {blocks} blocks of the tone have a capacitance and a displacement; drive without jumps, and record the displacement in every block",
            samples.len()
        )));
    }
    let fitted = fit(&samples, options.sample_interval_s())?;
    let relation = fitted.relation;
    check_units(&relation, &options)?;
    // Noise by the relation that was found.
    let sensing = SelfSensing::<f64>::new(&CapacitanceRelation { uncertainty_m: 1e-12, ..relation }, options)
        .map_err(|error| refused(error.to_string()))?;
    let noise_m = sensing.noise_m(tone_v, WINDOW_S / options.sample_interval_s());
    let percent = 100.0 / fitted.stroke_m;
    let report = Report {
        senses: percent * noise_m <= MAX_PCT && percent * fitted.rms_m <= MAX_PCT,
        tone_v,
        voltage_noise_v: options.voltage_noise_v,
        current_noise_a: options.current_noise_a,
        voltage_step_v: smallest_step(voltage_v),
        current_step_a: smallest_step(current_a),
        noise_pct: percent * noise_m,
        residual_pct: percent * fitted.rms_m,
        residual_without_creep_pct: percent * fitted.rms_without_creep_m,
        stroke_m: fitted.stroke_m,
        rest_f: relation.rest_f,
        max_f: relation.max_f,
    };
    Ok((CapacitanceFile { relation, options }, report))
}

/// Units that columns of such recordings are written in by mistake, with their sizes.
const OTHER_UNITS: [(&str, &str, f64); 8] = [
    ("voltage_v", "kV", 1e3),
    ("voltage_v", "mV", 1e-3),
    ("current_a", "mA", 1e-3),
    ("current_a", "µA", 1e-6),
    ("current_a", "nA", 1e-9),
    ("current_a", "pA", 1e-12),
    ("displacement_m", "mm", 1e-3),
    ("displacement_m", "µm", 1e-6),
];
/// Capacitance (F), tone (V) and stroke (m) of a usual film, beside which the likeliest unit is found.
const USUAL: [f64; 3] = [1e-9, 50.0, 1e-3];

/// Refuses what no film has, with the column whose unit is likely another.
fn check_units(relation: &CapacitanceRelation, options: &SelfSensingOptions) -> Result<()> {
    let faults = self_sensing_faults(relation, options);
    if faults.is_empty() {
        return Ok(());
    }
    let [rest_f, tone_v] = [relation.rest_f, options.tone_v];
    let stroke_m = relation.displacement_of_change(relation.max_f / rest_f - 1.0);
    // How far from usual films it is with a column in that unit, if it is plausible then.
    let with = |&(column, _, size): &(&str, &str, f64)| -> Option<f64> {
        let size_of = |name: &str| if name == column { size } else { 1.0 };
        let (volts, metres) = (size_of("voltage_v"), size_of("displacement_m"));
        let farads = size_of("current_a") / volts;
        let scaled = CapacitanceRelation {
            rest_f: farads * rest_f,
            max_f: farads * relation.max_f,
            stroke_m: relation.stroke_m.map(|term| metres * term),
            ..*relation
        };
        let found = SelfSensingOptions { tone_v: volts * tone_v, ..*options };
        let values = [scaled.rest_f, found.tone_v, metres * stroke_m];
        let distance = values.iter().zip(USUAL).map(|(value, usual)| (value / usual).ln().abs()).sum();
        self_sensing_faults(&scaled, &found).is_empty().then_some(distance)
    };
    let likely = OTHER_UNITS.iter().filter_map(|unit| Some((unit, with(unit)?)));
    let advice = match likely.min_by(|(_, one), (_, other)| one.total_cmp(other)) {
        Some(((column, unit, size), _)) => format!("is {column} in {unit}? multiply it by {size:e}"),
        None => format!("check the units of the columns and of the cable ({})", faults.join("; ")),
    };
    Err(Error::Computation(format!(
        "a tone of {} V, {} F at rest and a stroke of {} m are not those of a film: {advice}",
        rounded(tone_v),
        rounded(rest_f),
        rounded(stroke_m)
    )))
}

/// Smallest difference of two values that are not the same.
fn smallest_step(values: &[f64]) -> f64 {
    // Decimals of a file are no resolution.
    let least = 1e-9 * peak(values);
    differences(&sorted(values.iter().copied())).filter(|step| *step > least).fold(f64::INFINITY, f64::min)
}

/// The tone in a signal, block by block.
struct Tones {
    /// Median of its amplitude.
    amplitude: f64,
    /// Standard deviation of a value.
    noise: f64,
    ticks: f64,
}

impl Tones {
    /// The tone of `values` in blocks of so many `ticks`.
    fn new(values: &[f64], ticks: usize) -> Self {
        // Without what is constant, linear and quadratic: eight times the tone.
        let steep = |v: &[f64]| v[6] - 3.0 * (v[4] - v[2]) - v[0];
        let parts: Vec<f64> = values.windows(7).map(steep).collect();
        let sum = |block: &[f64], first: usize| -> f64 {
            block.iter().skip(first).step_by(2).enumerate().map(|(k, y)| if k % 2 == 0 { *y } else { -y }).sum()
        };
        let phasors: Vec<[f64; 2]> = parts.chunks_exact(ticks).map(|block| [sum(block, 0), sum(block, 1)]).collect();
        let square = |[a, b]: [f64; 2]| a * a + b * b;
        // 0 without a block.
        let median = |squares: Vec<f64>| statistics::median(&squares).max(0.0);
        let ticks = ticks as f64;
        let amplitude = median(phasors.iter().map(|&z| square(z)).collect()).sqrt() / (4.0 * ticks);
        // Each part of a phasor has 32 n variances of a value; the square of a difference of two has the median ln 2 times its mean.
        let differences = phasors.windows(2).map(|z| square([z[1][0] - z[0][0], z[1][1] - z[0][1]])).collect();
        let noise = (median(differences) / (4.0 * 32.0 * ticks * std::f64::consts::LN_2)).sqrt();
        Self { amplitude, noise, ticks }
    }

    /// Standard deviation of the amplitude in a block.
    fn phasor_noise(&self) -> f64 {
        self.noise * (2.0 / self.ticks).sqrt()
    }
}
