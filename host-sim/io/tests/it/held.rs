//! Columns that were logged more slowly than the rows.

use std::f64::consts::TAU;

use host_io::files::import::Quantity;
use host_io::files::recording::Recording;

use super::cut_files::Noise;

const ROWS: usize = 3000;

/// A drive (V) of two tones with a rest before, at row `k` of 100 a second.
fn tones(hz: [f64; 2], k: f64) -> f64 {
    let t = (0.01 * k - 2.0).max(0.0);
    let share = hz.map(|hz| 0.25 - 0.25 * (TAU * hz * t).cos());
    3000.0 * (share[0] + share[1])
}

/// The first rows of values that are logged every `every` rows, or one more now and then.
fn beginnings(every: usize, uneven: bool, random: &mut Noise) -> Vec<usize> {
    let mut rows = vec![0];
    while rows[rows.len() - 1] < ROWS {
        let more = usize::from(uneven && random.below(3) == 0);
        rows.push(rows[rows.len() - 1] + every + more);
    }
    rows
}

/// `values` of which each is repeated from one of the `rows` to the next.
fn repeated(values: &[f64], rows: &[usize]) -> Vec<f64> {
    (0..values.len()).map(|k| values[rows[rows.partition_point(|row| *row <= k) - 1]]).collect()
}

/// Readings (m) of a film that creeps under `volts`, `late` by some rows.
fn stroke(volts: &[f64], late: usize, noise: f64, random: &mut Noise) -> Vec<f64> {
    let mut crept = 0.0;
    let moves = volts.iter().map(|v| {
        let load = (v / 3e3).powi(2);
        crept += (load - crept) / 300.0;
        1e-3 * (load + 0.2 * crept)
    });
    let moves: Vec<f64> = moves.collect();
    (0..ROWS).map(|k| moves[k.saturating_sub(late)] + noise * random.next()).collect()
}

fn recording(volts: &[f64], reading: &[f64]) -> Recording {
    let columns = vec![(Quantity::Voltage, volts.to_vec()), (Quantity::Displacement, reading.to_vec())];
    Recording::of_values("film.csv", (0..ROWS).map(|k| 0.01 * k as f64).collect(), columns).expect("a recording")
}

/// RMS of the difference.
fn rms(a: &[f64], b: &[f64]) -> f64 {
    (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
}

#[test]
fn what_was_logged_slowly_is_taken_as_the_film_shows() {
    let mut random = Noise(41);
    for run in 0..60 {
        let hz = [0.1 + 0.3 * random.share(), 0.4 + 0.4 * random.share()];
        let noise = [0.0, 2e-6, 1e-5][random.below(3)];
        let (every, late) = (2 + random.below(18), random.below(3));
        let rows = beginnings(every, run % 2 == 1, &mut random);
        let volts: Vec<f64> = (0..ROWS).map(|k| tones(hz, k as f64)).collect();
        let held = repeated(&volts, &rows);
        let case = format!("run {run}: every {every} rows, late by {late}, noise {noise}, {hz:?} Hz");

        // The film was driven in between.
        let smooth = recording(&held, &stroke(&volts, late, noise, &mut random));
        let drive = &smooth.drive().expect("complete").samples().value.clone();
        assert!(rms(drive, &volts) < 0.2 * rms(&held, &volts), "{case}");
        assert!(smooth.notes().iter().any(|note| note.starts_with("a new value of the drive")), "{case}");

        // The film was driven in steps.
        let reading = stroke(&held, late, noise, &mut random);
        let stepped = recording(&held, &reading);
        assert!(stepped.drive().expect("complete").samples().value == held, "{case}");
        assert!(stepped.notes().is_empty(), "{case}: {:?}", stepped.notes());

        // The sensor was read slowly.
        let slow = recording(&volts, &repeated(&stroke(&volts, late, noise.max(1e-7), &mut random), &rows));
        assert!(slow.drive().expect("complete").samples().value == volts, "{case}");
        let read = slow.displacement().expect("readings").value.len();
        assert!(read.abs_diff(rows.len()) <= 1 + ROWS / 100 + 200 / every, "{case}: {read} readings of {}", rows.len());
        assert!(slow.notes().iter().any(|note| note.starts_with("a new reading")), "{case}");
        assert_eq!(slow.repeated(), ROWS - read, "{case}");
        // With a reading that is missing, and with a force that drives, it is noticed as well.
        let mut reading = repeated(&stroke(&volts, late, noise.max(1e-7), &mut random), &rows);
        reading[ROWS / 2] = f64::NAN;
        for drive in [Quantity::Voltage, Quantity::Force] {
            let columns = vec![(drive, volts.clone()), (Quantity::Displacement, reading.clone())];
            let time_s = (0..ROWS).map(|k| 0.01 * k as f64).collect();
            let slow = Recording::of_values("film.csv", time_s, columns).expect("a recording");
            assert!(slow.notes().iter().any(|note| note.starts_with("a new reading")), "{case}, {drive:?}");
        }

        // Both were.
        let both = recording(&held, &repeated(&stroke(&volts, late, noise.max(1e-7), &mut random), &rows));
        let drive = &both.drive().expect("complete").samples().value.clone();
        assert!(rms(drive, &volts) < 0.2 * rms(&held, &volts), "{case}");
    }
}

/// Coarse values repeat as well, and levels that are held are no slow log.
#[test]
fn coarse_values_and_levels_stay_as_they_are() {
    let mut random = Noise(42);
    for run in 0..100 {
        let hz = [0.05 + 0.1 * random.share(), 0.2 + 0.2 * random.share()];
        let step = 1.0 + 100.0 * random.share();
        let level = 100 + random.below(300);
        let rows = beginnings(level, false, &mut random);
        let levels: Vec<f64> = rows.iter().map(|_| 3000.0 * random.share()).collect();
        let levels: Vec<f64> = (0..ROWS).map(|k| levels[k / level]).collect();
        let coarse: Vec<f64> = (0..ROWS).map(|k| (tones(hz, k as f64) / step).round() * step).collect();
        for volts in [levels, coarse] {
            let resolution = 1e-7 * 300f64.powf(random.share());
            let reading = stroke(&volts, run % 3, 0.0, &mut random);
            let reading: Vec<f64> = reading.iter().map(|x| (x / resolution).round() * resolution).collect();
            let read = recording(&volts, &reading);
            assert!(read.drive().expect("complete").samples().value == volts, "run {run}: {:?}", read.notes());
            assert!(read.displacement().expect("readings").value == reading, "run {run}: {:?}", read.notes());
        }
    }
}
