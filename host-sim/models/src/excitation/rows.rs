//! Faults that single rows show: interference, noise, coarse steps, rows out of order, and a clock coarser than the rows.

use host_fft::Planner;

use super::finding::Severity::{self, Prevents, Weakens};
use crate::grid::{Grid, Samples};
use crate::statistics::{differences, mean, median, noise, percentile, range, sorted};

/// Noise of a reading that is reported, and noise of a drive, as shares of the stroke and the peak; beyond the last the rows are out of order.
const NOISY: f64 = 0.05;
const HUM: f64 = 0.02;
const SHUFFLED: f64 = 0.2;
/// Resolution of the readings that is reported, as a share of the stroke.
const COARSE: f64 = 0.015;
/// The end of the finding about such readings.
const STARTS_AGAIN: &str = ": it starts again at the end of a range";
/// Smallest jump from row to row without one of the drive, as a share of the stroke.
const JUMP: f64 = 0.15;
/// Part of the fastest cycle over which a reading that is shaken bends, how far beyond what is usual, and as a share of the stroke.
const SHAKEN_CYCLE: f64 = 0.02;
const SHAKEN_BEYOND: f64 = 6.0;
const SHAKEN: f64 = 0.04;
/// Amplitude of an interference that is reported, as a share of the stroke, and how far it is above the frequencies around it.
const LINE: f64 = 5e-3;
const ABOVE: f64 = 12.0;

/// Judges the rows of `drive`, of which `peak` is the largest size, and the `measured` readings. `fastest_hz` is the fastest cycle. Returns
/// whether the readings can be compared with a film: they are in order, and none start again at the end of a range.
pub(super) fn judge(
    drive: &Samples,
    peak: f64,
    measured: &Samples,
    fastest_hz: f64,
    add: &mut impl FnMut(Severity, String, &str),
) -> bool {
    let readings = sorted(measured.value.iter().copied());
    let stroke = percentile(&readings, 0.99) - percentile(&readings, 0.01);
    let steps: Vec<f64> = differences(&drive.time_s).collect();
    // Without the longest, which may be a gap; a coarse clock has many long ones.
    let usual = sorted(steps.iter().copied());
    let mean_s = mean(&usual[..usual.len() - usual.len() / 25]);
    if stroke <= 0.0 || measured.value.len() < 50 {
        return true;
    }
    if noise(&drive.value) > SHUFFLED * peak {
        add(
            Prevents,
            "the drive jumps from row to row: the rows are not in the order of time".into(),
            "sort the rows by time",
        );
        return false;
    }
    let bunched = steps.iter().filter(|step| **step < 0.2 * mean_s).count();
    if 2 * bunched > steps.len() {
        let finding =
            format!("{bunched} of {} rows follow the one before at once: a clock coarser than the rows", steps.len());
        add(Weakens, finding, "replace the times by the rate of the rows (`rate`)");
    }
    let hum = noise(&drive.value);
    if hum > HUM * peak {
        let finding = format!("hum or noise of {:.1} % of the largest on the drive (RMS)", 100.0 * hum / peak);
        add(Weakens, finding, "shield the monitor's cable, and record through its own ground");
    }
    if let Some((finding, advice)) = disturbance(drive, peak, measured, stroke, fastest_hz * mean_s) {
        let starts_again = finding.ends_with(STARTS_AGAIN);
        add(Weakens, finding, advice);
        return !starts_again;
    }
    let step = differences(&readings).filter(|step| *step > 1e-6 * stroke).fold(f64::MAX, f64::min);
    if step > COARSE * stroke {
        let finding =
            format!("the sensor resolves {:.4} mm only, {:.1} % of the stroke", 1e3 * step, 100.0 * step / stroke);
        add(Weakens, finding, "use a finer range of the sensor, or more digits");
    }
    let line = interference(measured, drive, peak, fastest_hz).filter(|(_, size)| *size > LINE * stroke);
    if let Some((hz, size)) = line {
        let share = 100.0 * size / stroke;
        let finding = format!("interference of {hz:.1} Hz with {:.4} mm, {share:.1} % of the stroke", 1e3 * size);
        add(
            Weakens,
            finding,
            "shield the sensor's cable; mains at 50 or 60 Hz appear at lower frequencies where rows are fewer than 100 or 120 a second",
        );
    } else if noise(&measured.value) > NOISY * stroke {
        let finding = format!("noise of {:.1} % of the stroke (RMS)", 100.0 * noise(&measured.value) / stroke);
        add(Weakens, finding, "shield the sensor's cable, or use a finer sensor");
    }
    true
}

/// Readings that start again at the end of a range, or that are shaken, and what to do. `cycles` is the part of the fastest
/// cycle that a row takes.
fn disturbance(
    drive: &Samples,
    peak: f64,
    measured: &Samples,
    stroke: f64,
    cycles: f64,
) -> Option<(String, &'static str)> {
    let (values, count) = (&measured.value, measured.value.len());
    let volts = drive.at(measured.time_s.iter().copied());
    let changes: Vec<f64> = differences(values).collect();
    let least = (JUMP * stroke).max(10.0 * noise(values));
    let is_jump = |&k: &usize| changes[k].abs() > least && (volts[k + 1] - volts[k]).abs() < 0.03 * peak;
    let jumps: Vec<f64> = (0..changes.len()).filter(is_jump).map(|k| changes[k]).collect();
    let size = median(&jumps.iter().map(|jump| jump.abs()).collect::<Vec<f64>>());
    let alike = jumps.iter().filter(|jump| (jump.abs() / size - 1.0).abs() < 0.2).count();
    if alike >= 4 && 3 * alike > 2 * jumps.len() && jumps.iter().any(|j| *j > 0.0) && jumps.iter().any(|j| *j < 0.0) {
        return Some((
            format!("the reading jumps by about {:.4} mm and back, {} times{STARTS_AGAIN}", 1e3 * size, jumps.len()),
            "record with a range that holds the stroke",
        ));
    }
    let reach = ((SHAKEN_CYCLE / cycles) as usize).clamp(2, count / 10);
    let bend = |values: &[f64]| -> Vec<f64> {
        (reach..count - reach).map(|k| values[k - reach] - 2.0 * values[k] + values[k + reach]).collect()
    };
    let (bends, of_drive) = (bend(values), bend(&volts));
    let usual = |bends: &[f64]| sorted(bends.iter().map(|bend| bend.abs()))[bends.len() * 19 / 20];
    let (limit, of_drive_limit) =
        ((SHAKEN_BEYOND * usual(&bends)).max(SHAKEN * stroke), (2.0 * usual(&of_drive)).max(0.02 * peak));
    let shaken: Vec<usize> =
        (0..bends.len()).filter(|&k| bends[k].abs() > limit && of_drive[k].abs() < of_drive_limit).collect();
    // Apart by more than a few of the reaches, each to and fro.
    let moments = shaken
        .chunk_by(|a, b| b - a < 10 * reach)
        .filter(|part| part.windows(2).filter(|pair| bends[pair[0]] * bends[pair[1]] < 0.0).count() >= 2);
    let at_s: Vec<f64> = moments.map(|part| measured.time_s[part[0] + reach]).collect();
    (!at_s.is_empty() && 10 * shaken.len() < count).then(|| {
        let shown: Vec<String> = at_s.iter().take(4).map(|t| format!("{t:.1}")).collect();
        let more = if at_s.len() > 4 { " and more" } else { "" };
        (
            format!(
                "the reading is not of the film for moments, at {}{more} s: a bench that was touched, or an arc",
                shown.join(", ")
            ),
            "empty the readings there (import `blank`), or record again",
        )
    })
}

/// Frequency (Hz) and amplitude of the strongest line of `measured`, far above the cycles of the drive and not one of the drive.
fn interference(measured: &Samples, drive: &Samples, peak: f64, fastest_hz: f64) -> Option<(f64, f64)> {
    let duration_s = measured.time_s.last()? - measured.time_s[0];
    let rate_hz = (measured.value.len() - 1) as f64 / duration_s;
    let grid = Grid::covering(duration_s, rate_hz).ok()?;
    let (lines, of_drive) = (amplitudes(&grid.resample(measured)), amplitudes(&grid.resample(drive)));
    let bin_hz = rate_hz / (2.0 * (lines.len() - 1) as f64);
    let lowest = ((10.0 * fastest_hz).max(3.0) / bin_hz) as usize;
    let (k, size) = lines.iter().enumerate().skip(lowest.max(20)).max_by(|a, b| a.1.total_cmp(b.1))?;
    let around = &lines[k - 20..(k + 20).min(lines.len())];
    let (_, stroke) = range(&lines);
    let of_drive = of_drive.get(k)? / peak;
    (*size > ABOVE * median(around) && of_drive < 0.3 * size / stroke.max(f64::MIN_POSITIVE))
        .then_some((k as f64 * bin_hz, *size))
}

/// Amplitude of each frequency up to half of the rate, through a Hann window.
fn amplitudes(values: &[f64]) -> Vec<f64> {
    let count = values.len();
    let points = count.next_power_of_two();
    let mean = mean(values);
    let window = |k: usize| 1.0 - (std::f64::consts::TAU * (k as f64 + 0.5) / count as f64).cos();
    let windowed = values.iter().enumerate().map(|(k, value)| window(k) * (value - mean));
    let spectrum = host_fft::spectrum(&*Planner::new().forward(points), windowed);
    spectrum.iter().map(|line| 2.0 * line.norm() / count as f64).collect()
}
