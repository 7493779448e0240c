//! Random copies of a recording are found, and random repetitions of a measurement are not taken for copies.

use std::f64::consts::TAU;

use host_io::files::recording::{Direction, Recording};
use host_models::fit::{self, observation};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::recorded::recording;
use crate::sweep::full_sweep;

/// Rows of time (s), voltage (V) and displacement (m).
type Rows = Vec<[f64; 3]>;

const ROWS: usize = 6000;

/// Voltages at 100 Hz: a sine, a triangle, steps or a smooth random walk.
fn drive(random: &mut Pcg64) -> Vec<f64> {
    let (hz, peak) = (random.random_range(0.08..0.5), random.random_range(2000.0..5000.0));
    let kind = random.random_range(0..4);
    let mut level = 0.0;
    let mut walk = [0.0; 2];
    let at = |k: usize| {
        let t = 0.01 * k as f64;
        match kind {
            0 => 0.5 * (1.0 - (TAU * hz * t).cos()),
            1 => 2.0 * ((hz * t).fract() - 0.5).abs(),
            2 => {
                if k.is_multiple_of(300) {
                    level = random.random_range(0.0..1.0);
                }
                level
            }
            _ => {
                walk[0] += 0.003 * (random.random_range(-1.0..1.0) - 5.0 * (walk[1] - 0.5) - walk[0]);
                walk[1] += 0.01 * walk[0];
                walk[1]
            }
        }
    };
    (0..ROWS).map(at).map(|share| peak * share).collect()
}

/// The stroke of a film with five times of creep, stiffening, as a share of 1 at 5 kV.
fn stroke(volts: &[f64], creep: f64) -> Vec<f64> {
    let mut states = [0.0; 5];
    let stroke = |volts: &f64| {
        let load = (volts / 5000.0).powi(2);
        let mut sum = 0.8 * load;
        for (state, tau_s) in states.iter_mut().zip([0.1, 1.0, 10.0, 100.0, 1000.0]) {
            *state += (load - *state) * (1.0 - (-0.01_f64 / tau_s).exp());
            sum += creep * *state;
        }
        sum / (1.0 + 0.2 * sum)
    };
    volts.iter().map(stroke).collect()
}

fn noise(random: &mut Pcg64, size: f64) -> f64 {
    (0..6).map(|_| random.random_range(-1.0..1.0)).sum::<f64>() / 1.41 * size
}

fn measured(random: &mut Pcg64, volts: &[f64], creep: f64, size: f64) -> Rows {
    let stroke = stroke(volts, creep);
    let row = |k: usize| [0.01 * k as f64, volts[k] + noise(random, 1.0), 1e-3 * (stroke[k] + noise(random, size))];
    (0..volts.len()).map(row).collect()
}

fn is_copy(one: &Rows, other: &Rows) -> bool {
    are_copies(&[recording("one.csv", one), recording("other.csv", other)])
}

fn are_copies(recordings: &[Recording]) -> bool {
    let observe = |recording| observation::observe(recording, Direction::Force, 1.0).expect("valid").0;
    fit::repeated(&recordings.iter().map(observe).collect::<Vec<_>>()).is_some()
}

/// The rows of `other` behind those of `one`, after a pause.
fn joined(one: &Rows, other: &Rows, pause_s: f64) -> Rows {
    let late_s = one[one.len() - 1][0] - other[0][0] + pause_s;
    one.iter().copied().chain(other.iter().map(|[t, volts, stroke]| [t + late_s, *volts, *stroke])).collect()
}

/// At a multiple of the rate.
fn resampled(rows: &Rows, share: f64) -> Rows {
    let count = ((rows.len() - 2) as f64 * share) as usize;
    let at = |j: usize| {
        let place = 0.3 + j as f64 / share;
        let (k, part) = (place as usize, place.fract());
        std::array::from_fn(|column| rows[k][column] + part * (rows[k + 1][column] - rows[k][column]))
    };
    (0..count).map(at).collect()
}

type Change = fn(&mut Rows, &mut Pcg64, f64);

/// Changes that make a copy of a recording with noise of a known size (m).
const CHANGES: &[(&str, Change)] = &[
    ("nothing", |_, _, _| ()),
    ("scaled stroke", |rows, random, _| {
        let gain = random.random_range(0.5..2.0);
        rows.iter_mut().for_each(|row| row[2] *= gain);
    }),
    ("turned stroke", |rows, _, _| rows.iter_mut().for_each(|row| row[2] = -row[2])),
    ("zeroed anew", |rows, random, _| {
        let offset = random.random_range(-5e-3..5e-3);
        rows.iter_mut().for_each(|row| row[2] += offset);
    }),
    ("scaled voltage", |rows, random, _| {
        let gain = random.random_range(0.8..1.2);
        rows.iter_mut().for_each(|row| row[1] *= gain);
    }),
    ("turned voltage", |rows, _, _| rows.iter_mut().for_each(|row| row[1] = -row[1])),
    ("voltage with an offset", |rows, _, _| rows.iter_mut().for_each(|row| row[1] += 30.0)),
    ("scaled times", |rows, random, _| {
        let scale = [1.0001, 0.999, random.random_range(0.8..1.25)][random.random_range(0..3)];
        rows.iter_mut().for_each(|row| row[0] *= scale);
    }),
    ("later times", |rows, random, _| {
        let late = random.random_range(0.0..100.0);
        rows.iter_mut().for_each(|row| row[0] += late);
    }),
    ("thinned", |rows, random, _| {
        let every = random.random_range(2..8);
        *rows = rows.iter().skip(random.random_range(0..every)).step_by(every).copied().collect();
    }),
    ("resampled", |rows, random, _| *rows = resampled(rows, random.random_range(0.55..0.95))),
    ("between its rows", |rows, _, _| *rows = resampled(rows, 1.0)),
    ("noise added", |rows, random, size| {
        let added = random.random_range(0.3..1.5) * size;
        rows.iter_mut().for_each(|row| row[2] += noise(random, added));
    }),
    ("a part", |rows, random, _| {
        let count = random.random_range(rows.len() * 2 / 5..rows.len() * 4 / 5);
        let from = random.random_range(0..rows.len() - count);
        *rows = rows[from..from + count].to_vec();
    }),
    ("rows lost", |rows, random, _| rows.retain(|_| random.random_bool(0.98))),
    ("rounded", |rows, _, size| {
        let digit = 10f64.powf(size.log10().floor());
        rows.iter_mut().for_each(|row| row[2] = (row[2] / digit).round() * digit);
    }),
    ("means of three rows", |rows, _, _| {
        let mean = |three: &[[f64; 3]]| std::array::from_fn(|k| three.iter().map(|row| row[k]).sum::<f64>() / 3.0);
        *rows = rows.chunks_exact(3).map(mean).collect();
    }),
    ("filtered", |rows, random, _| {
        let share = random.random_range(0.2..0.8);
        let mut state = rows[0][2];
        for row in rows {
            state += share * (row[2] - state);
            row[2] = state;
        }
    }),
];

/// Each change alone, and pairs of them.
#[test]
fn copies_of_any_kind_are_found() {
    let count = CHANGES.len() as u64;
    let seeds = if full_sweep() { 0..600 } else { 0..3 * count };
    let missed: Vec<String> = seeds
        .clone()
        .filter_map(|seed| {
            let mut random = Pcg64::seed_from_u64(seed);
            let size = 10f64.powf(random.random_range(-3.5..-2.0));
            let volts = drive(&mut random);
            let rows = measured(&mut random, &volts, 0.05, size);
            let (first, second) = (&CHANGES[(seed % count) as usize], &CHANGES[random.random_range(0..CHANGES.len())]);
            let mut copy = rows.clone();
            first.1(&mut copy, &mut random, 1e-3 * size);
            if seed >= count && first.0 != second.0 {
                second.1(&mut copy, &mut random, 1e-3 * size);
            }
            (!is_copy(&rows, &copy)).then(|| format!("{seed}: {}, {}, noise {size:.1e}", first.0, second.0))
        })
        .collect();
    println!("{missed:#?}");
    // Two changes may leave too little of the noise: a filter and new noise.
    assert!(missed.len() * 20 <= seeds.count(), "{missed:#?}");
    assert!(
        !missed
            .iter()
            .any(|text| text.split(':').next().is_some_and(|seed| seed.parse::<u64>().is_ok_and(|s| s < count))),
        "{missed:#?}"
    );
}

/// A run that is twice in one file, with or without a pause; not one that is measured twice, and not one with cycles that are alike.
#[test]
fn a_run_that_is_twice_in_a_file_is_found() {
    for seed in 0..if full_sweep() { 600 } else { 40 } {
        let mut random = Pcg64::seed_from_u64(4000 + seed);
        let size = 10f64.powf(random.random_range(-3.5..-2.0));
        let volts = drive(&mut random);
        let rows = measured(&mut random, &volts, 0.05, size);
        let mut again = rows.clone();
        let (name, change) = &CHANGES[(seed % 4) as usize];
        change(&mut again, &mut random, 1e-3 * size);
        let pause_s = if seed % 3 == 0 { 0.01 } else { random.random_range(0.05..20.0) };
        assert!(are_copies(&[recording("twice.csv", &joined(&rows, &again, pause_s))]), "{seed}: {name}");
        let twice = [volts.clone(), volts].concat();
        let mut other = measured(&mut random, &twice, 0.05, size);
        if seed % 2 == 0 {
            other.iter_mut().for_each(|row| row[2] = (row[2] / (2e-3 * size)).round() * 2e-3 * size);
        }
        assert!(!are_copies(&[recording("measured.csv", &other)]), "{seed}: noise {size:.1e}");
    }
}

/// Recordings of no noise, as they are simulated.
#[test]
fn copies_without_noise_are_found() {
    let mut random = Pcg64::seed_from_u64(5);
    let volts: Vec<f64> = (0..ROWS).map(|k| 2000.0 * (1.0 - (TAU * 0.2e-2 * k as f64).cos())).collect();
    let smooth = |volts: &[f64], creep: f64| -> Rows {
        let stroke = stroke(volts, creep);
        (0..volts.len()).map(|k| [0.01 * k as f64, volts[k], 1e-3 * stroke[k]]).collect()
    };
    let rows = smooth(&volts, 0.05);
    for (name, change) in CHANGES {
        let is_equal =
            ["nothing", "turned stroke", "zeroed anew", "turned voltage", "later times", "thinned", "rows lost"];
        let mut copy = rows.clone();
        change(&mut copy, &mut random, 1e-8);
        assert!(!is_equal.contains(name) || is_copy(&rows, &copy), "{name}");
    }
    let scaled = |by: [f64; 3]| rows.iter().map(|row| std::array::from_fn(|k| by[k] * row[k])).collect::<Rows>();
    assert!(is_copy(&rows, &scaled([1.0, 1.0, 1.01])) && is_copy(&rows, &scaled([1.0001, 1.0, 1.0])));
    // Other creep, another amplitude, another frequency.
    let smaller: Vec<f64> = volts.iter().map(|volts| 0.7 * volts).collect();
    let faster: Vec<f64> = (0..ROWS).map(|k| 2000.0 * (1.0 - (TAU * 0.3e-2 * k as f64).cos())).collect();
    for other in [smooth(&volts, 0.06), smooth(&smaller, 0.05), smooth(&faster, 0.05)] {
        assert!(!is_copy(&rows, &other));
    }
}

/// Simulated with the same seed of noise, but another drive, or another amplitude.
#[test]
fn the_noise_of_one_seed_makes_no_copy() {
    for seed in 0..30 {
        let mut random = Pcg64::seed_from_u64(700 + seed);
        let size = 10f64.powf(random.random_range(-3.5..-2.0));
        let volts = drive(&mut random);
        let scale = [0.25, 0.5, 2.0][random.random_range(0..3)];
        let other = if seed % 2 == 0 { drive(&mut random) } else { volts.iter().map(|volts| scale * volts).collect() };
        let one = [volts, other].map(|volts| measured(&mut Pcg64::seed_from_u64(seed), &volts, 0.05, size));
        assert!(!is_copy(&one[0], &one[1]), "{seed}: {scale}, noise {size:.1e}");
    }
}

/// The same drive measured again, with noise of its own.
#[test]
fn repetitions_are_not_accused() {
    let seeds = if full_sweep() { 0..600 } else { 0..60 };
    let accused: Vec<String> = seeds
        .filter_map(|seed| {
            let mut random = Pcg64::seed_from_u64(9000 + seed);
            let size = 10f64.powf(random.random_range(-4.0..-2.0));
            let volts = drive(&mut random);
            let creep = 0.05 * random.random_range(0.9..1.1);
            let other_size = size * random.random_range(0.2..1.0);
            let mut pair =
                [(0.05, size), (creep, other_size)].map(|(creep, size)| measured(&mut random, &volts, creep, size));
            let what = seed % 5;
            match what {
                // Mains, in no phase.
                1 => pair.iter_mut().for_each(|rows| {
                    let phase = random.random_range(0.0..TAU);
                    rows.iter_mut().for_each(|row| row[2] += 4e-3 * size * (TAU * 49.95 * row[0] + phase).sin());
                }),
                // Readings in coarse steps.
                2 => pair.iter_mut().flatten().for_each(|row| row[2] = (row[2] / (2e-3 * size)).round() * 2e-3 * size),
                3 => pair[1] = pair[1].iter().step_by(2).copied().collect(),
                4 => pair[1].iter_mut().for_each(|row| row[2] = 1e-3 - row[2]),
                _ => {}
            }
            is_copy(&pair[0], &pair[1]).then(|| format!("{seed}: {what}, noise {size:.1e} and {other_size:.1e}"))
        })
        .collect();
    assert!(accused.is_empty(), "{accused:#?}");
}
