//! Faults of a bench: the cause, what was measured, and what to do.

use host_io::choice;
use host_io::choice::{Choice, by_name};
use serde::Serialize;

use super::bench::{ROWS_HZ, Row};
use super::ramp::{self, MEAN_S, RISE_S, STEP_S, solved};
use crate::excitation::check::{self, Severity};
use crate::files::recording::Recording;
use crate::statistics::{self, differences, median, percentile, range, sorted};

choice! {
    /// A cause of a failure.
    pub enum Cause {
        /// Turn the sensor, or the sign of its calibration.
        SensorSign = "sensor sign",
        /// Calibrate the sensor with the gauge, and check the range that it is set to.
        SensorScale = "sensor scale",
        /// Compare the monitor with a high-voltage probe, and correct its calibration or the amplifier's.
        MonitorGain = "monitor gain",
        /// State the lag of the amplifier (`rise_s`, `fall_s`) or of the sensor (`delay_s`), or record without filters.
        Lag = "lag",
        /// Stiffen the mount of film and sensor, or lower the band.
        Resonance = "resonance in the band",
        /// Fix clamps and mount, and begin again with a rested film.
        Slip = "slip",
        /// Look for corona and wet insulation, clean the edges of the film, or lower the largest voltage.
        Leak = "leak",
        /// Clean or replace the film, round its electrodes, and lower the largest voltage.
        Arc = "arc",
        /// Align the sensor and its target, and keep the stroke within its range.
        DropOuts = "drop-outs",
        /// Keep the stroke within the sensor's range and the voltage within the amplifier's.
        Saturation = "saturation",
        /// Raise the largest voltage, take a softer film, or a sensor with less noise.
        LittleStroke = "too little stroke",
        /// Check the controller's crystal and its rate.
        Clock = "clock",
        /// Let the sensor warm up, keep the temperature, and rest the film for ten minutes.
        Drift = "drift",
        /// Look whether the sensor is late, at the end of its range, or without its target.
        Frozen = "frozen sensor",
        /// Free the mount from friction and play.
        Friction = "friction",
        /// Find out why, then acknowledge the trip.
        Trip = "trip",
        /// Lower the largest displacement or the largest voltage, so that the film stays away from pull-in.
        Limits = "limits",
        /// See the parts that fail, with the film disconnected.
        SelfTest = "self-test",
        /// Look at the recording beside the model: something that the model does not have moves the film or the sensor.
        Unexplained = "unexplained",
        /// Excite the film in the band and the stroke of its use, for longer; or allow a larger error.
        Error = "error",
    }
}

/// A cause that was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// The cause.
    #[serde(serialize_with = "by_name")]
    pub cause: Cause,
    /// The measurement that shows it.
    pub measured: String,
    /// The remedy.
    pub advice: &'static str,
}

impl Finding {
    /// `cause`, of which this was `measured`.
    pub fn new(cause: Cause, measured: impl Into<String>) -> Self {
        let advice =
            Cause::CHOICES.iter().find(|(known, ..)| *known == cause).map_or("", |(_, _, advice)| advice.trim());
        Self { cause, measured: measured.into(), advice }
    }
}

/// Share by which gauge and sensor, or command and monitor, may differ.
const SCALE: f64 = 0.02;
/// Share by which the monitor may fall behind the command over the ramp, with the square of the voltage.
const LEAK: f64 = 0.003;
/// Lag of an amplifier or a sensor beyond what is stated, s.
pub(super) const MAX_LAG_S: f64 = 0.015;
/// Share of a step by which a film may swing at a frequency within [`MARGIN`] times the band.
const SWING: f64 = 0.015;
const MARGIN: f64 = 7.0;
/// Difference of two clocks.
const CLOCK: f64 = 0.005;

/// The sensor with a gauge under its target: `true_m` and what it read, m.
pub fn of_gauge([true_m, read_m]: [f64; 2]) -> Option<Finding> {
    let ratio = read_m / true_m;
    let measured = format!("a gauge of {:.3} mm reads {:.3} mm", 1e3 * true_m, 1e3 * read_m);
    match ratio {
        _ if ratio < 0.0 => Some(Finding::new(Cause::SensorSign, measured)),
        _ if !((1.0 - SCALE)..=(1.0 + SCALE)).contains(&ratio) => Some(Finding::new(Cause::SensorScale, measured)),
        _ => None,
    }
}

/// The clock of a bench that has run for `bench_s` while this host has counted `host_s`.
pub fn of_clock(bench_s: f64, host_s: f64) -> Option<Finding> {
    let off = bench_s / host_s - 1.0;
    let measured =
        || format!("the bench counts {bench_s:.2} s in {host_s:.2} s of this computer ({:+.2} %)", 100.0 * off);
    (host_s > 10.0 && off.abs() > CLOCK + 0.1 / host_s).then(|| Finding::new(Cause::Clock, measured()))
}

/// A trip of the controller, in its words, after `rows`.
pub fn of_trip(trip: &str, rows: &[Row]) -> Finding {
    let cause = match trip {
        _ if trip.contains("Arcs") => Cause::Arc,
        _ if trip.contains("Monitor") => of_monitor(rows),
        _ if trip.contains("Stuck") => Cause::Frozen,
        _ if trip.contains("Sensor") => Cause::DropOuts,
        _ if trip.contains("Disturbance") => Cause::Unexplained,
        _ => Cause::Trip,
    };
    Finding::new(cause, trip)
}

/// Why a monitor differs from the command at the end of `rows`.
fn of_monitor(rows: &[Row]) -> Cause {
    let command_v = rows.last().map_or(0.0, |row| row.command_v);
    let lower: Vec<&Row> = rows.iter().filter(|row| (300.0..0.8 * command_v).contains(&row.command_v)).collect();
    let sum = |value: fn(&Row) -> f64| lower.iter().map(|row| value(row)).sum::<f64>();
    if rows.iter().rev().take(3).any(|row| row.monitor_v < 0.5 * row.command_v) && lower.len() > 50 {
        return Cause::Arc;
    }
    let moves = rows.iter().rev().nth(30).is_none_or(|row| (row.command_v - command_v).abs() > 0.05 * command_v);
    match sum(|row| row.monitor_v) / sum(|row| row.command_v) {
        ratio if lower.len() > 50 && (ratio - 1.0).abs() < SCALE => Cause::Saturation,
        _ if moves => Cause::Lag,
        _ => Cause::MonitorGain,
    }
}

/// A jump of the reading in `rows` of a drive that is smooth.
pub fn of_jumps(rows: &[Row], noise_m: f64) -> Option<Finding> {
    const BLOCK: usize = 5;
    let mean = |rows: &[Row]| rows.iter().map(|row| row.displacement_m).sum::<f64>() / rows.len() as f64;
    let means: Vec<f64> = rows.chunks_exact(BLOCK).map(mean).collect();
    let (low, high) = range(&means);
    // Beside the changes before and after it.
    let jump = |four: &[f64]| (four[2] - four[1] - 0.5 * (four[1] - four[0] + four[3] - four[2])).abs();
    let largest = (6.0 * noise_m).max(0.02 * (high - low));
    let at = means.windows(4).position(|four| jump(four) > largest)?;
    let row = &rows[(at + 2) * BLOCK];
    Some(Finding::new(
        Cause::Slip,
        format!("the reading jumps by {:.0} µm at {:.1} s", 1e6 * jump(&means[at..at + 4]), row.time_s),
    ))
}

/// Rows of any run: arcs, drop-outs and ends of ranges.
pub fn of_rows(rows: &[Row]) -> Vec<Finding> {
    let mut findings = Vec::new();
    let is_up = |row: &Row| row.command_v > 300.0;
    let dips = rows.windows(3).filter(|three| three.iter().all(is_up)).filter(|three| {
        let low = |row: &Row| row.monitor_v < 0.75 * row.command_v;
        low(&three[1]) && !(low(&three[0]) && low(&three[2]))
    });
    let dips = dips.count();
    if dips > 0 {
        findings.push(Finding::new(Cause::Arc, format!("the monitor falls by more than a quarter in {dips} rows")));
    }
    let finite: Vec<f64> = rows.iter().map(|row| row.displacement_m).filter(|x| x.is_finite()).collect();
    if finite.is_empty() {
        return findings;
    }
    let sorted = sorted(finite.iter().copied());
    let at = |share: f64| percentile(&sorted, share);
    let changes: Vec<f64> = differences(&finite).map(f64::abs).collect();
    let stroke = (at(0.99) - at(0.01)).max(50.0 * median(&changes));
    let jumps = |k: usize| {
        let (before, after) = (finite[k] - finite[k - 1], finite[k] - finite[k + 1]);
        before * after > 0.0 && before.abs().min(after.abs()) > 0.3 * stroke
    };
    let lost = rows.len() - finite.len() + (1..finite.len().saturating_sub(1)).filter(|k| jumps(*k)).count();
    if lost > 0 {
        findings
            .push(Finding::new(Cause::DropOuts, format!("{lost} of {} rows have no reading of the film", rows.len())));
    }
    // At the end of a range readings are flat, whatever the noise is elsewhere.
    let top = at(1.0);
    let flat = finite.windows(20).filter(|run| run.iter().all(|x| (x - top).abs() < 0.02 * stroke)).filter(|run| {
        let mean = statistics::mean(run);
        run.iter().all(|x| (x - mean).abs() < 1e-9)
    });
    let flat = flat.count();
    if flat > 0 {
        findings.push(Finding::new(Cause::Saturation, format!("the sensor stays at {:.4} mm", 1e3 * top)));
    }
    findings
}

/// The rows of a ramp with this `report`, in a band up to `band_hz`.
pub fn of_ramp(rows: &[Row], report: &ramp::Report, band_hz: f64) -> Vec<Finding> {
    let mut findings = Vec::new();
    let noise_m = report.noise_m;
    if let Some(drift_m_per_s) = report.drift_m_per_s {
        let measured = format!("the reading of the film at 0 V drifts by {:+.1} µm/s", 1e6 * drift_m_per_s);
        return vec![Finding::new(Cause::Drift, measured)];
    }
    let falls = report.steps.iter().rev().take(2).filter(|step| step.measured_m < -6.0 * noise_m).count();
    if falls == 2 {
        let last = report.steps[report.steps.len() - 1];
        let measured = format!("{:+.4} mm at {:.0} V", 1e3 * last.measured_m, last.voltage_v);
        return vec![Finding::new(Cause::SensorSign, measured)];
    }
    if ramp::is_flat(&report.steps, noise_m) {
        let last = report.steps[report.steps.len() - 1];
        let measured =
            format!("the sensor stays at {:.4} mm of stroke up to {:.0} V", 1e3 * last.measured_m, last.voltage_v);
        findings.push(Finding::new(Cause::Saturation, measured));
    }
    if let Some([expected_m, moved_m]) = report.stays_behind_m {
        let measured = format!(
            "as a part of the load was taken back, the reading moved by {:.4} mm of {:.4}",
            1e3 * moved_m,
            1e3 * expected_m
        );
        findings.push(Finding::new(Cause::Friction, measured));
    }
    let of_step = |step: &ramp::Step| -> Vec<&Row> {
        rows.iter().filter(|row| (step.from_s..step.from_s + STEP_S).contains(&row.time_s)).collect()
    };
    let steps: Vec<Vec<&Row>> = report.steps.iter().map(of_step).collect();
    findings.extend(of_voltage(&steps, &report.steps));
    findings.extend(ringing(&steps, report, band_hz));
    if !report.moves && report.is_complete {
        let measured = format!(
            "{:.1} µm at {:.0} V, with a noise of {:.1} µm RMS",
            1e6 * report.stroke_m,
            report.peak_v,
            1e6 * noise_m
        );
        findings.push(Finding::new(Cause::LittleStroke, measured));
    }
    findings
}

/// Monitor and command at the end of each step, and the monitor's way there.
fn of_voltage(steps: &[Vec<&Row>], of: &[ramp::Step]) -> Vec<Finding> {
    let mut ratios: Vec<(f64, f64)> = Vec::new();
    let mut lags_s: Vec<f64> = Vec::new();
    for (rows, step) in steps.iter().zip(of).filter(|(_, step)| step.voltage_v > 600.0) {
        let last = &rows[rows.len().saturating_sub((MEAN_S * ROWS_HZ) as usize)..];
        let sum = |value: fn(&Row) -> f64| last.iter().map(|row| value(row)).sum::<f64>();
        ratios.push((step.voltage_v, sum(|row| row.monitor_v) / sum(|row| row.command_v)));
        // The area between both, beyond what is left at the end.
        let (Some(first), Some(end)) = (rows.first(), ratios.last()) else { continue };
        let rise_v = step.voltage_v - first.command_v;
        let behind: f64 = rows.iter().map(|row| end.1 * row.command_v - row.monitor_v).sum();
        lags_s.push(behind / ROWS_HZ / rise_v);
    }
    let mut findings = Vec::new();
    let (Some(first), Some(last)) = (ratios.first(), ratios.last()) else { return findings };
    let percent = |ratio: f64| 100.0 * (ratio - 1.0);
    let measured = format!(
        "the monitor differs from the command by {:+.1} % at {:.0} V and {:+.1} % at {:.0} V",
        percent(first.1),
        first.0,
        percent(last.1),
        last.0
    );
    // A zero that is off is as many volts at every voltage.
    let offsets_v: Vec<f64> = ratios.iter().map(|(v, ratio)| v * (ratio - 1.0)).collect();
    let offset_v = statistics::mean(&offsets_v);
    let is_constant = offsets_v.iter().all(|volts| (volts - offset_v).abs() < 0.2 * offset_v.abs());
    if is_constant && offset_v.abs() > 0.5 * SCALE * first.0 {
        findings.push(Finding::new(Cause::MonitorGain, format!("{measured}: {offset_v:+.0} V at every voltage")));
    } else if first.1 - last.1 > 0.5 * SCALE || fall(&ratios).is_some_and(|fall| fall > LEAK) {
        // A range ends at once, a leak grows.
        let before = ratios.iter().rev().nth(1).map_or(first.1, |ratio| ratio.1);
        let ends = ratios.len() > 2 && first.1 - before < 0.15 * (first.1 - last.1);
        findings.push(Finding::new(if ends { Cause::Saturation } else { Cause::Leak }, measured));
    } else if (last.1 - 1.0).abs() > SCALE {
        findings.push(Finding::new(Cause::MonitorGain, measured));
    }
    let lag_s = median(&lags_s);
    if lag_s > MAX_LAG_S {
        findings.push(Finding::new(Cause::Lag, format!("the monitor is {:.0} ms behind the command", 1e3 * lag_s)));
    }
    findings
}

/// By how much the ratio of monitor and command falls with the square of the voltage up to the last of `ratios`, beyond five standard errors; none where that
/// is not known.
fn fall(ratios: &[(f64, f64)]) -> Option<f64> {
    // The monitor's noise is the same at all voltages.
    let weighed =
        |value: &dyn Fn(f64, f64) -> f64| -> f64 { ratios.iter().map(|&(v, r)| v * v * value(v * v, r)).sum() };
    let weight = weighed(&|_, _| 1.0);
    let [square, ratio] = [weighed(&|s, _| s) / weight, weighed(&|_, r| r) / weight];
    let spread = weighed(&|s, _| (s - square).powi(2));
    let slope = weighed(&|s, r| (s - square) * (r - ratio)) / spread;
    let left = weighed(&|s, r| (r - ratio - slope * (s - square)).powi(2));
    let freedom = ratios.len().checked_sub(2).filter(|freedom| *freedom > 1)? as f64;
    let sure = slope + 5.0 * (left / freedom / spread).sqrt();
    (sure < 0.0).then(|| -slope * ratios[ratios.len() - 1].0.powi(2))
}

/// A swing after the steps that is within or near the band.
fn ringing(steps: &[Vec<&Row>], report: &ramp::Report, band_hz: f64) -> Option<Finding> {
    let mut sums = Vec::new();
    // The square of all rises, and by how much the squares of noise fall with a swing, by chance.
    let (mut all_m, mut by_noise) = (0.0, (0.0, 0.0));
    let frequencies: Vec<f64> = (3..60).map(|k| 0.1 * f64::from(k)).collect();
    let mut before_m = 0.0;
    for (rows, step) in steps.iter().zip(&report.steps) {
        let rise_m = step.measured_m - before_m;
        before_m = step.measured_m;
        let after: Vec<(f64, f64)> = rows
            .iter()
            .map(|row| (row.time_s - step.from_s - RISE_S - 0.05, row.displacement_m))
            .filter(|(t, x)| *t > 0.0 && x.is_finite())
            .collect();
        if rise_m < 6.0 * report.noise_m || after.len() < 100 {
            continue;
        }
        let values: Vec<f64> = after.iter().map(|(_, x)| *x).collect();
        let left = |columns: &dyn Fn(f64) -> Vec<f64>| -> Option<f64> {
            let rows: Vec<Vec<f64>> = after.iter().map(|(t, _)| columns(*t)).collect();
            let found = solved(&rows, &values)?;
            let at = |row: &Vec<f64>| row.iter().zip(&found).map(|(x, c)| x * c).sum::<f64>();
            Some(rows.iter().zip(&values).map(|(row, x)| (x - at(row)).powi(2)).sum())
        };
        // Creep, and a swing that dies away within a second or two.
        let creep = |t: f64| vec![1.0, t, (-t / 0.15).exp(), (-t / 0.6).exp(), (-t / 2.0).exp()];
        let plain = left(&creep)?;
        sums.resize(frequencies.len(), 0.0);
        for (hz, sum) in frequencies.iter().zip(&mut sums) {
            let swings = |t: f64| {
                let (angle, dies) = (std::f64::consts::TAU * hz * t, (-0.5 * hz * t).exp());
                [creep(t), vec![dies * angle.cos(), dies * angle.sin()]].concat()
            };
            *sum += plain - left(&swings)?;
        }
        all_m += rise_m * rise_m * after.len() as f64;
        // The two columns of a swing take as much as two rows have.
        let row = plain / after.len() as f64;
        by_noise = (by_noise.0 + 2.0 * row, by_noise.1 + 4.0 * row * row);
    }
    let (hz, gained) = frequencies.into_iter().zip(sums).max_by(|a, b| a.1.total_cmp(&b.1))?;
    let share = ((gained - by_noise.0 - 3.0 * by_noise.1.sqrt()).max(0.0) / all_m).sqrt();
    let measured = format!("after a step the reading swings at {hz:.1} Hz by {:.0} % of it", 100.0 * share);
    (share > SWING && hz < MARGIN * band_hz).then(|| Finding::new(Cause::Resonance, measured))
}

/// Faults that `check` finds in `recording`, without its remarks on the excitation.
pub fn of_recording(recording: Recording) -> Vec<Finding> {
    let report = check::check(&[recording]);
    let of_excitation =
        ["amplitude only", "one frequency", "no full cycle", "periods of the slowest", "in the first row"];
    let words: [(&str, Cause); 17] = [
        ("falls where", Cause::SensorSign),
        ("slides under load", Cause::Slip),
        ("reading jumps", Cause::Slip),
        ("lag", Cause::Lag),
        ("swings at", Cause::Resonance),
        ("clocks", Cause::Clock),
        ("shifted against", Cause::Clock),
        ("drop-out", Cause::DropOuts),
        ("no reading", Cause::DropOuts),
        ("an arc", Cause::Arc),
        ("end of", Cause::Saturation),
        ("ends at", Cause::Saturation),
        ("saturat", Cause::Saturation),
        ("zero of the sensor", Cause::Drift),
        ("settles from the first", Cause::Drift),
        ("friction", Cause::Friction),
        ("", Cause::Unexplained),
    ];
    let is_fault = |finding: &&check::Finding| {
        finding.severity == Severity::Prevents || !of_excitation.iter().any(|words| finding.finding.contains(words))
    };
    let cause = |text: &str| {
        words.iter().find(|(words, _)| text.contains(words)).map_or(Cause::Unexplained, |(_, cause)| *cause)
    };
    report
        .findings
        .iter()
        .filter(is_fault)
        .map(|finding| Finding::new(cause(&finding.finding), finding.finding.clone()))
        .collect()
}
