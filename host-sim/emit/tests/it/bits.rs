//! Equal bits on this host.

use std::fs;
use std::path::Path;
use std::process::Command;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::SensorSample;

use crate::films::{self, Case};
use crate::job::{self, Input, Kind};
use crate::program::{STRICT, Sources};
use crate::recordings::recordings;

/// Voltage and displacement of a recording every millisecond, linear between its rows, for `seconds`.
fn recorded(path: &Path, seconds: usize) -> Vec<(f32, f32)> {
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

/// Inputs of `kind` along a recording: what a bench would give, with a sensor that is late and lost for a while, an amplifier that is off
/// by a percent, values that are not finite, and orders now and then.
fn inputs(kind: Kind, recorded: &[(f32, f32)]) -> Vec<Input> {
    let mut random = Pcg64::seed_from_u64(5);
    let mut noise = |size: f32| size * random.random_range(-1.0..1.0_f32);
    let steps = recorded.len();
    recorded
        .iter()
        .enumerate()
        .map(|(k, &(voltage, displacement))| {
            let lost = (steps / 2..steps / 2 + steps / 20).contains(&k);
            let sample = (k % 10 == 3 && !lost).then(|| SensorSample {
                displacement: if k % 7000 == 13 { f32::NAN } else { 0.97 * recorded[k.saturating_sub(10)].1 + noise(4e-6) },
                age_ticks: if k % 9000 == 23 { 64 } else { 10 },
            });
            let order = u32::from(k == steps / 3) + 2 * u32::from(k == steps / 4);
            let (a, b) = match kind {
                Kind::Displacement => (4e-6 * voltage * voltage, 0.0),
                Kind::Force => (displacement, displacement + 1e-5),
                Kind::Observer => (voltage, 0.0),
                // Beyond what 6 kV can do for a while, and a jump.
                _ => {
                    let wanted = if k > steps * 3 / 4 { 1.5 * displacement } else { displacement };
                    let read = if k % 11 == 5 { f32::NAN } else { 1.01 + noise(1e-3) };
                    (if k % 8000 == 77 { f32::INFINITY } else { wanted }, read)
                }
            };
            Input { a, b, sample, flags: order }
        })
        .collect()
}

/// The first difference between what C wrote and what Rust computes.
pub fn compare(kind: Kind, case: &Case, inputs: &[Input], written: &[u8]) {
    let (c, rust) = (job::rows(written), job::run(kind, case, inputs));
    assert_eq!(c.len(), rust.len(), "{kind:?}, {}", case.name);
    for (k, (c, rust)) in c.iter().zip(&rust).enumerate() {
        let numbers = |row: &job::Row| row.map(f32::from_bits);
        assert!(c == rust, "{kind:?} of {}, step {k}: C {:?}, Rust {:?}", case.name, numbers(c), numbers(rust));
    }
}

/// Runs every kind along `recorded` in the program and here.
fn all_kinds(sources: &Sources, program: &Path, cases: &[Case], recorded: &[(f32, f32)]) {
    for (index, case) in cases.iter().enumerate() {
        for kind in Kind::ALL {
            let inputs = inputs(kind, recorded);
            let written = sources.run(&mut Command::new(program), &job::bytes(kind, index, &inputs));
            compare(kind, case, &inputs, &written);
        }
    }
}

/// Three recordings of 155 s, forwards, backwards and under each law of control: the bits of every step.
#[test]
fn three_recordings_have_the_bits_of_rust() {
    let cases = [films::plain(), films::rich(), films::periodic()];
    let sources = Sources::of(&cases);
    let program = sources.compile("gcc", &[STRICT.as_slice(), &["-O2"]].concat(), &["host.c"]);
    for path in recordings("hossain") {
        all_kinds(&sources, &program, &cases, &recorded(&path, 155));
    }
}
