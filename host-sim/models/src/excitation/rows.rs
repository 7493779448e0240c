//! Faults that single rows show: interference, noise, coarse steps, rows out of order, and a clock coarser than the rows.

use host_fft::Planner;

use super::finding::Severity;
use crate::fit::statistics::{median, range, robust_deviation};
use crate::grid::{Grid, Samples};

/// Noise of a reading that is reported, and noise of a drive, as shares of the stroke and the peak; beyond the last the rows are out of order.
const NOISY: f64 = 0.05;
const HUM: f64 = 0.02;
const SHUFFLED: f64 = 0.2;
/// Resolution of the readings that is reported, as a share of the stroke.
const COARSE: f64 = 0.015;
/// Amplitude of an interference that is reported, as a share of the stroke, and how far it is above the frequencies around it.
const LINE: f64 = 5e-3;
const ABOVE: f64 = 12.0;

/// Judges the rows of `drive`, of which `peak` is the largest size, and the `measured` readings. `fastest_hz` is the fastest cycle.
pub(super) fn judge(
    drive: &Samples,
    peak: f64,
    measured: &Samples,
    fastest_hz: f64,
    add: &mut impl FnMut(Severity, String, &str),
) {
    let mut sorted = measured.value.clone();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share) as usize];
    let stroke = at(0.99) - at(0.01);
    let steps: Vec<f64> = drive.time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    // Without the longest, which may be a gap; a coarse clock has many long ones.
    let mut ordered = steps.clone();
    ordered.sort_by(f64::total_cmp);
    let usual = &ordered[..ordered.len() - ordered.len() / 25];
    let mean_s = usual.iter().sum::<f64>() / usual.len() as f64;
    if stroke <= 0.0 || measured.value.len() < 50 {
        return;
    }
    if noise(&drive.value) > SHUFFLED * peak {
        add(
            Severity::Prevents,
            "the drive jumps from row to row: the rows are not in the order of time".into(),
            "sort the rows by time",
        );
        return;
    }
    let bunched = steps.iter().filter(|step| **step < 0.2 * mean_s).count();
    if 2 * bunched > steps.len() {
        let finding =
            format!("{bunched} of {} rows follow the one before at once: a clock coarser than the rows", steps.len());
        add(Severity::Weakens, finding, "replace the times by the rate of the rows (`rate`)");
    }
    let hum = noise(&drive.value);
    if hum > HUM * peak {
        let finding = format!("hum or noise of {:.1} % of the largest on the drive (RMS)", 100.0 * hum / peak);
        add(Severity::Weakens, finding, "shield the monitor's cable, and record through its own ground");
    }
    let step =
        sorted.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 1e-6 * stroke).fold(f64::MAX, f64::min);
    if step > COARSE * stroke {
        let finding =
            format!("the sensor resolves {:.4} mm only, {:.1} % of the stroke", 1e3 * step, 100.0 * step / stroke);
        add(Severity::Weakens, finding, "use a finer range of the sensor, or more digits");
    }
    let line = interference(measured, drive, peak, fastest_hz).filter(|(_, size)| *size > LINE * stroke);
    if let Some((hz, size)) = line {
        let share = 100.0 * size / stroke;
        let finding = format!("interference of {hz:.1} Hz with {:.4} mm, {share:.1} % of the stroke", 1e3 * size);
        add(
            Severity::Weakens,
            finding,
            "shield the sensor's cable; mains at 50 or 60 Hz appear at lower frequencies where rows are fewer than 100 or 120 a second",
        );
    } else if noise(&measured.value) > NOISY * stroke {
        let finding = format!("noise of {:.1} % of the stroke (RMS)", 100.0 * noise(&measured.value) / stroke);
        add(Severity::Weakens, finding, "shield the sensor's cable, or use a finer sensor");
    }
}

/// RMS noise from row to row, from fourth differences.
pub(super) fn noise(values: &[f64]) -> f64 {
    let fourth: Vec<f64> = values.windows(5).map(|v| v[0] - 4.0 * v[1] + 6.0 * v[2] - 4.0 * v[3] + v[4]).collect();
    robust_deviation(&fourth) / 70f64.sqrt()
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
    let mean = values.iter().sum::<f64>() / count as f64;
    let forward = Planner::new().forward(points);
    let (mut time, mut spectrum) = (forward.make_input_vec(), forward.make_output_vec());
    for (k, (slot, value)) in time.iter_mut().zip(values).enumerate() {
        let window = 1.0 - (std::f64::consts::TAU * (k as f64 + 0.5) / count as f64).cos();
        *slot = window * (value - mean);
    }
    forward.process(&mut time, &mut spectrum).expect("lengths are the plan's own");
    spectrum.iter().map(|line| 2.0 * line.norm() / count as f64).collect()
}
