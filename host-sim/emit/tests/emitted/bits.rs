//! Equal bits on this host.

use std::fs;
use std::path::Path;
use std::process::Command;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::SensorSample;

use crate::circuit;
use crate::films::{self, Case};
use crate::job::{self, FORGET_CHANGES, HOLD, Input, Kind, LEARN, OFF, RESTORE, TEMPERATURE};
use crate::program::{STRICT, Sources, with};
use crate::recordings::recordings;

/// Voltage and displacement of a recording every millisecond, linear between its rows, for `seconds`.
pub fn recorded(path: &Path, seconds: usize) -> Vec<(f32, f32)> {
    let text = fs::read_to_string(path).expect("committed");
    let rows: Vec<[f32; 3]> = text
        .lines()
        .filter(|line| !line.starts_with(['#', 't']))
        .map(|line| {
            let mut cells = line.split(',').map(|cell| cell.parse().expect("a number"));
            std::array::from_fn(|_| cells.next().expect("three cells"))
        })
        .collect();
    // Recorded at 100 Hz.
    let (count, steps) = (10_usize, 1000 * seconds);
    let between = |k: usize, column: usize| {
        let (row, share) = (k / count, (k % count) as f32 / count as f32);
        let next = (row + 1).min(rows.len() - 1);
        rows[row][column] + share * (rows[next][column] - rows[row][column])
    };
    (0..steps).map(|k| (between(k, 1), between(k, 2))).collect()
}

/// A reference along the displacement of a recording: its mean over 0.2 s, so that its noise does not meet the limits, less and higher.
fn smoothed(recorded: &[(f32, f32)]) -> Vec<f32> {
    let mean = |rows: &[(f32, f32)]| rows.iter().map(|row| row.1).sum::<f32>() / rows.len() as f32;
    (0..recorded.len()).map(|k| 0.8e-3 + 0.15 * mean(&recorded[k.saturating_sub(200)..=k])).collect()
}

/// Inputs of `kind` along a recording: what a bench would give, with a sensor that is late and lost for a while, an amplifier that is off
/// by a percent, values that are not finite, and orders now and then.
pub fn inputs(kind: Kind, recorded: &[(f32, f32)]) -> Vec<Input> {
    let mut random = Pcg64::seed_from_u64(5);
    let mut noise = |size: f32| size * random.random_range(-1.0..1.0_f32);
    let steps = recorded.len();
    // A stroke that a film can follow, and what a sensor shows of a film that is a little stiffer.
    let wanted = smoothed(recorded);
    recorded
        .iter()
        .enumerate()
        .map(|(k, &(voltage, displacement))| {
            let lost = (steps * 3 / 5..steps * 5 / 8).contains(&k);
            let sample = (k % 10 == 3 && !lost).then(|| SensorSample {
                displacement_m: if k % 7000 == 13 {
                    f32::NAN
                } else {
                    0.97 * wanted[k.saturating_sub(10)] + noise(4e-6)
                },
                age_ticks: if k % 9000 == 23 { 64 } else { 10 },
            });
            let follows = matches!(kind, Kind::Feedforward | Kind::Tracking | Kind::Learning);
            let order = match k {
                _ if k == steps / 2 => 1,
                _ if k == steps * 2 / 3 => 2,
                _ if !follows => 0,
                // The law follows its film from here on.
                _ if k == steps / 4 || k == steps / 2 + 1 => LEARN,
                _ if k == steps * 7 / 10 => RESTORE,
                _ if k == steps * 4 / 5 || k == steps * 23 / 24 => TEMPERATURE,
                _ if k == steps * 11 / 12 => OFF,
                _ => 0,
            };
            // Now and then less than the command is put out.
            let halved = follows && (k % 20_000).abs_diff(1_100) < 5;
            let unknown = halved && k % 5 == 2;
            let (a, b) = match kind {
                Kind::Displacement => (4e-6 * voltage * voltage, 0.0),
                Kind::Force => (displacement, displacement + 1e-5),
                Kind::Observer => (voltage, 0.0),
                // Beyond what 6 kV can do for a while, and a jump.
                _ => {
                    let wanted = if k > steps * 3 / 4 { 1.5 * displacement } else { wanted[k] };
                    let read = if k % 11 == 5 { f32::NAN } else { 1.01 + noise(1e-3) };
                    (if k % 8000 == 77 { f32::NAN } else { wanted }, read)
                }
            };
            Input { a, b, sample, flags: order + 4 * u32::from(halved) + 8 * u32::from(unknown) }
        })
        .collect()
}

/// The same, or readings of a film that is its own sensor.
fn inputs_of(kind: Kind, case: &Case, recorded: &[(f32, f32)]) -> Vec<Input> {
    match (kind, &case.sensed) {
        (Kind::SelfSensing, Some(sensed)) => circuit::readings(sensed, recorded),
        _ => inputs(kind, recorded),
    }
}

/// Compares what C wrote with what Rust computes, and returns that.
pub fn compare(kind: Kind, case: &Case, inputs: &[Input], written: &[u8]) -> Vec<job::Row> {
    let (c, rust) = (job::rows(written), job::run(kind, case, inputs));
    assert_eq!(c.len(), rust.len(), "{kind:?}, {}", case.name);
    for (k, (c, rust)) in c.iter().zip(&rust).enumerate() {
        let numbers = |row: &job::Row| row.map(f32::from_bits);
        assert!(c == rust, "{kind:?} of {}, step {k}: C {:?}, Rust {:?}", case.name, numbers(c), numbers(rust));
    }
    rust
}

/// Runs every kind along `recorded` by `run`, from the job's bytes to rows of it, and here. Returns what was shown on the way.
pub fn all_kinds(run: impl Fn(&[u8]) -> Vec<u8>, (index, case): (usize, &Case), recorded: &[(f32, f32)]) -> Shown {
    let mut shown = Shown::default();
    for kind in Kind::ALL {
        let inputs = inputs_of(kind, case, recorded);
        let written = run(&job::bytes(kind, index, &inputs));
        let rows = compare(kind, case, &inputs, &written);
        if matches!(kind, Kind::Feedforward | Kind::Tracking | Kind::Learning) {
            shown.limits |= rows.iter().fold(0, |all, row| all | row[5]);
        }
        if kind == Kind::Tracking {
            shown.aged += rows.iter().filter(|row| f32::from_bits(row[2]) > 0.05).count();
        }
        if kind == Kind::Learning {
            shown.learned += rows.iter().filter(|row| f32::from_bits(row[2]) != 0.0).count();
        }
        if kind == Kind::SelfSensing {
            shown.sensed += rows.iter().filter(|row| row[5] >= 16).count();
            shown.faults |= rows.iter().fold(0, |all, row| all | 1 << (row[5] % 16));
        }
    }
    shown
}

/// Branches that runs have taken.
#[derive(Default)]
pub struct Shown {
    limits: u32,
    learned: usize,
    /// Ticks of a law that has followed its film.
    aged: usize,
    sensed: usize,
    faults: u32,
}

/// Three recordings of 155 s, forwards, backwards and under each law of control: the bits of every step.
#[test]
fn three_recordings_have_the_bits_of_rust() {
    let cases = [films::plain(), films::rich(), films::periodic(), films::richest(), films::in_series()];
    let sources = Sources::new(&cases);
    let program = sources.compile("gcc", &with(&STRICT, &["-O2"]));
    let (mut limits, mut learned, mut aged) = (0, [0; 5], [0; 5]);
    let (mut faults, mut sensed) = (0, 0);
    for path in recordings("hossain") {
        let recorded = recorded(&path, 155);
        for (index, case) in cases.iter().enumerate() {
            let shown = all_kinds(|job| sources.run(&mut Command::new(&program), job), (index, case), &recorded);
            limits |= shown.limits;
            learned[index] += shown.learned;
            aged[index] += shown.aged;
            faults |= shown.faults;
            sensed += shown.sensed;
        }
    }
    assert_eq!(limits, 0xff, "all limits were met somewhere");
    assert!(faults == 0b11111 && sensed > 10_000, "faults {faults:b}, {sensed} samples");
    let [plain, found, given, ..] = learned;
    assert!(plain == 0 && found > 20_000 && given > 20_000, "ticks with something learned: {learned:?}");
    assert!(aged.iter().all(|&ticks| ticks > 100_000), "ticks with a law that has followed its film: {aged:?}");
}

/// Cycles of 0.5 s with whatever can happen between ticks: limits, stretches without a sensor, values that are not finite, all orders at any
/// time, and voltages that something else sets for a while.
fn with_orders(ticks: usize) -> Vec<Input> {
    let mut random = Pcg64::seed_from_u64(27);
    let (mut standby, mut blind) = (0_u32, 0_u32);
    (0..ticks)
        .map(|k| {
            let mut rare = |one_in: u32| random.random_range(0..one_in) == 0;
            let (is_nan, is_unread, is_halved, is_unknown) = (rare(700), rare(2), rare(500), rare(500));
            let (begins, ends, is_wrong, is_old) = (rare(6000), rare(6000), rare(300), rare(300));
            standby = if begins { random.random_range(1..300) } else { standby.saturating_sub(1) };
            blind = if ends { random.random_range(1..500) } else { blind.saturating_sub(1) };
            let stroke = if k % 9000 > 8000 { 3e-3 } else { 0.2e-3 };
            let reference = 1e-3 - stroke * (std::f32::consts::TAU * k as f32 / 500.0).cos();
            let noise = random.random_range(-4e-6..4e-6_f32);
            let sample = (k % 10 == 3 && blind == 0).then_some(SensorSample {
                displacement_m: if is_wrong { f32::NAN } else { 1.03 * reference + noise },
                age_ticks: if is_old { random.random_range(50..80) } else { random.random_range(0..15) },
            });
            let of_changes = [LEARN, LEARN, HOLD, OFF, OFF, RESTORE, RESTORE, FORGET_CHANGES, TEMPERATURE, TEMPERATURE];
            let orders = [[1, 16, 16, 32, 32, 64, 128, 256].as_slice(), &of_changes].concat();
            let order = orders.get(random.random_range(0..8000)).copied().unwrap_or(0);
            Input {
                a: if is_nan || k == 0 { f32::NAN } else { reference },
                b: if is_unread { f32::NAN } else { 1.01 + 1e-3 * noise },
                sample,
                flags: order + 2 * u32::from(standby > 0) + 4 * u32::from(is_halved) + 8 * u32::from(is_unknown),
            }
        })
        .collect()
}

/// C is the second implementation of a follower. An observer gets the references as voltages of some kV.
#[test]
fn orders_at_any_time_have_the_bits_of_rust() {
    let cases = films::cycles();
    let sources = Sources::new(&cases);
    let program = sources.compile("gcc", &with(&STRICT, &["-O2"]));
    let inputs = with_orders(120_000);
    for (index, case) in cases.iter().enumerate() {
        for kind in [Kind::Observer, Kind::Feedforward, Kind::Tracking, Kind::Learning] {
            let gain = if kind == Kind::Observer { 3e6 } else { 1.0 };
            let inputs: Vec<Input> = inputs.iter().map(|input| Input { a: gain * input.a, ..*input }).collect();
            let written = sources.run(&mut Command::new(&program), &job::bytes(kind, index, &inputs));
            let rows = compare(kind, case, &inputs, &written);
            let learned = rows.iter().filter(|row| f32::from_bits(row[2]).abs() > 1e-6).count();
            assert!(kind != Kind::Learning || learned > 1000, "{learned} ticks with something learned");
        }
    }
}

/// Inputs of `kind` for each of `cases` along `recorded`, and their jobs.
pub fn jobs(kind: Kind, cases: &[Case], recorded: &[(f32, f32)]) -> (Vec<Vec<Input>>, Vec<u8>) {
    let inputs: Vec<_> = cases.iter().map(|case| inputs_of(kind, case, recorded)).collect();
    let jobs = inputs.iter().enumerate().flat_map(|(index, inputs)| job::bytes(kind, index, inputs)).collect();
    (inputs, jobs)
}

/// Compares what C wrote of all these jobs with what Rust computes.
pub fn compare_all(kind: Kind, cases: &[Case], inputs: &[Vec<Input>], written: &[u8]) {
    let chunks = written.chunks(24 * inputs[0].len());
    assert_eq!(chunks.len(), cases.len());
    for ((case, inputs), written) in cases.iter().zip(inputs).zip(chunks) {
        compare(kind, case, inputs, written);
    }
}

/// 200 random laws, with and without curves, first-order and second-order, with amplifiers that lag and with learning: the bits of 2 s each.
#[test]
fn two_hundred_random_laws_have_the_bits_of_rust() {
    let cases = films::random(200);
    let sources = Sources::new(&cases);
    let program = sources.compile("gcc", &with(&STRICT, &["-O1"]));
    let [fast, ..] = recordings("wang");
    let recorded = recorded(&fast, 2);
    for kind in Kind::ALL {
        let (inputs, jobs) = jobs(kind, &cases, &recorded);
        let written = sources.run(&mut Command::new(&program), &jobs);
        compare_all(kind, &cases, &inputs, &written);
    }
}
