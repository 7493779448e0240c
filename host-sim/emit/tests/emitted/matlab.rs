//! The MEX gateway in Octave and the S-function before a stub of Simulink: the bits of Rust.

use std::fs;
use std::path::Path;
use std::process::Command;

use host_emit::{matlab, symbol};
use springpot::SensorSample;
use tempfile::TempDir;

use crate::bits::{inputs, recorded};
use crate::films::{self, Case};
use crate::job::{self, Input, Kind, LEARN, Row, TEMPERATURE};
use crate::program::{STRICT, source, succeeds};
use crate::recordings::recordings;

/// Modes by number and name, and the law that each is compared with; `None`: the film under a voltage.
const MODES: [(&str, Option<Kind>); 7] = [
    ("displacement", Some(Kind::Displacement)),
    ("force", Some(Kind::Force)),
    ("film", None),
    ("feedforward", Some(Kind::Feedforward)),
    ("observer", Some(Kind::Observer)),
    ("tracking", Some(Kind::Learning)),
    ("adaptive", Some(Kind::Learning)),
];

/// How old samples are.
const AGE: usize = 10;

/// Inputs along a recording, without what a gateway does not have: orders, samples that are not numbers or of another age, and, unless
/// `is_monitored`, the reading of a monitor.
fn plain_inputs(case: &Case, kind: Option<Kind>, recorded: &[(f32, f32)], is_monitored: bool) -> Vec<Input> {
    let mut inputs = inputs(kind.unwrap_or(Kind::Observer), recorded);
    for (k, input) in inputs.iter_mut().enumerate() {
        // Of the orders a caller has the voltage that was applied, and the temperature of a film that was fitted at several.
        let warms =
            case.temperature.is_some() && kind == Some(Kind::Learning) && k % 5000 == 2500 && input.a.is_finite();
        input.flags = match input.flags {
            4 => 4,
            _ if warms => TEMPERATURE,
            _ => 0,
        };
        input.sample = input.sample.filter(|s| s.displacement_m.is_finite() && s.age_ticks == AGE);
        if !is_monitored {
            input.b = f32::NAN;
        }
    }
    inputs
}

/// Bits of displacement, voltage, force, shaped reference, disturbance, force scale and limits in every tick, where Rust has them.
type Expected = [Option<u32>; 7];

const BEYOND_CURVE: u32 = 64;
const MAX_VOLTAGE: u32 = 2;

/// The results of Rust.
fn expected((mode, kind): (&str, Option<Kind>), case: &Case, inputs: &[Input]) -> Vec<Expected> {
    let some = |number: f32| Some(number.to_bits());
    let nan = some(f32::NAN);
    let (none, one) = (some(0.0), some(1.0));
    let Some(kind) = kind else {
        let drive = case.tracking.observer().drive();
        let mut state = case.law.state();
        return inputs
            .iter()
            .map(|input| {
                let load = drive.load(input.a);
                let x = case.law.displacement_under(&mut state, load);
                let limits = BEYOND_CURVE * u32::from(state.beyond_curve()) + MAX_VOLTAGE * u32::from(input.a > 6000.0);
                [some(x), some(input.a), some(load.force_n + load.slope_n_per_m * x), nan, none, one, Some(limits)]
            })
            .collect();
    };
    let row = |(input, row): (&Input, &Row)| {
        let [a, b, c, d, _, last] = row.map(Some);
        let beyond = Some(BEYOND_CURVE * row[5]);
        match kind {
            Kind::Displacement => [a, nan, some(input.a), nan, none, one, beyond],
            Kind::Force => [some(input.a), nan, a, nan, none, one, beyond],
            Kind::Feedforward => [a, b, d, c, none, one, last],
            Kind::Observer => [a, some(input.a), None, nan, b, c, None],
            Kind::Tracking | Kind::Learning => [a, b, None, None, d, None, last],
            Kind::SelfSensing => panic!("a mode of MATLAB is no self-sensing"),
        }
    };
    let mut ordered = inputs.to_vec();
    if mode == "adaptive" {
        ordered[0].flags |= LEARN;
    }
    inputs.iter().zip(&job::run(kind, case, &ordered)).map(row).collect()
}

/// Compares what was written, in the order of `columns` of [`Expected`], with Rust's. Returns all limits that were met.
fn compare(what: &str, expected: &[Expected], columns: &[usize], written: &[Vec<u32>]) -> u32 {
    assert_eq!(written.len(), expected.len(), "{what}");
    let mut limits = 0;
    for (k, (row, expected)) in written.iter().zip(expected).enumerate() {
        for (&column, &has) in columns.iter().zip(row) {
            let Some(wants) = expected[column] else { continue };
            let (number, wanted) = (f32::from_bits(has), f32::from_bits(wants));
            let same = has == wants || (column < 6 && number.is_nan() && wanted.is_nan());
            assert!(same, "{what}, step {k}, column {column}: {number:?}, Rust {wanted:?}");
        }
        limits |= expected[6].unwrap_or(0);
    }
    limits
}

/// A folder with the sources of `case`, as `export --emit sfunction --out film.c` writes them.
fn exported(case: &Case, name: &str) -> TempDir {
    let folder = TempDir::new().expect("a folder");
    write(folder.path(), case, name);
    folder
}

fn write(folder: &Path, case: &Case, name: &str) {
    for (file, text) in matlab::sources(&case.film(&symbol(name)), name) {
        assert!(!text.contains('@'), "{file} has a gap that was not filled");
        fs::write(folder.join(file), text).expect("written");
    }
}

/// The block with the stub of Simulink as a program.
fn block(folder: &Path, name: &str) -> Command {
    let include = format!("-I{}", source("simulink").display());
    let mut gcc = Command::new("gcc");
    gcc.current_dir(folder).args(STRICT).args(["-O2", "-DMATLAB_MEX_FILE", &include]);
    gcc.args([format!("{name}_sfun.c"), format!("{name}.c")]).args(["-lm", "-o", "block"]);
    succeeds(&mut gcc);
    Command::new(folder.join("block"))
}

/// The block in every mode along `seconds` of recordings.
fn block_has_the_bits(seconds: usize, count: usize) {
    let mut limits = 0;
    for case in [films::plain(), films::rich()] {
        let folder = exported(&case, "film");
        block(folder.path(), "film");
        for path in recordings("hossain").iter().take(count) {
            let recorded = recorded(path, seconds);
            for (number, (mode, kind)) in MODES.into_iter().enumerate() {
                let inputs = plain_inputs(&case, kind, &recorded, false);
                let job = job::bytes(Kind::Displacement, 0, &inputs);
                let file = folder.path().join("input");
                // Without the head of a job.
                fs::write(&file, &job[12..]).expect("written");
                let mut command = Command::new(folder.path().join("block"));
                command.args([(number + 1).to_string(), AGE.to_string()]);
                command.stdin(fs::File::open(&file).expect("written"));
                // The block does not write the two columns between.
                let written = job::rows(&succeeds(&mut command));
                let written: Vec<_> = written.iter().map(|&[a, b, c, _, _, limits]| vec![a, b, c, limits]).collect();
                let what = format!("{mode} of {}, {}", case.name, path.display());
                limits |= compare(&what, &expected((mode, kind), &case, &inputs), &[0, 1, 2, 6], &written);
            }
        }
    }
    assert!(limits & 3 != 0, "limits that were met: {limits:b}");
}

/// The S-function compiles as strictly as can be against a stub of Simulink's headers, and steps as Simulink calls it, with other inputs in
/// front: a copy of the state is stepped until the update.
#[test]
fn the_block_has_the_bits_of_rust() {
    block_has_the_bits(20, 1);
}

#[test]
#[ignore = "minutes: cargo xtask faces"]
fn the_block_has_the_bits_of_rust_over_three_recordings() {
    block_has_the_bits(155, 3);
}

/// Invalid modes and ages, inputs that a film would keep for good, and the sample time.
#[test]
fn the_block_refuses_what_it_cannot_step() {
    // Of the second film the temperature is an input.
    let folders = [films::plain(), films::rich()].map(|case| exported(&case, "film"));
    folders.iter().for_each(|folder| drop(block(folder.path(), "film")));
    let run_of = |folder: &Path, parameters: &[&str], first: f32, second: Option<f32>, flags: u32| {
        let sample = second.map(|displacement_m| SensorSample { displacement_m, age_ticks: 0 });
        let input = Input { a: first, b: 0.0, sample, flags };
        let file = folder.join("input");
        fs::write(&file, &job::bytes(Kind::Force, 0, &[input])[12..]).expect("written");
        let mut command = Command::new(folder.join("block"));
        let output = command.args(parameters).stdin(fs::File::open(&file).expect("written")).output().expect("runs");
        (output.status.success(), String::from_utf8(output.stderr).expect("text"))
    };
    let run = |parameters: &[&str], first, second| run_of(folders[0].path(), parameters, first, second, 0);
    let infinite = Some(f32::NEG_INFINITY);
    for (parameters, first, second, words) in [
        (["0", "0"].as_slice(), 0.0, None, "film_sfun: the mode"),
        (&["8", "0"], 0.0, None, "film_sfun: the mode"),
        (&["1.5", "0"], 0.0, None, "film_sfun: the mode"),
        (&["nan", "0"], 0.0, None, "film_sfun: the mode"),
        (&["6", "64"], 0.0, None, "film_sfun: the age"),
        (&["6", "-1"], 0.0, None, "film_sfun: the age"),
        (&["6"], 0.0, None, "number of parameters"),
        (&["3", "0"], f32::INFINITY, None, "film_sfun: the first input"),
        (&["5", "0"], f32::NAN, None, "film_sfun: the first input"),
        (&["6", "0"], f32::INFINITY, None, "film_sfun: the first input"),
        (&["5", "0"], 0.0, infinite, "film_sfun: a sample"),
        (&["6", "0"], 0.0, infinite, "film_sfun: a sample"),
    ] {
        let (good, stderr) = run(parameters, first, second);
        assert!(!good && stderr.contains(words), "{parameters:?}: {stderr}");
    }
    for (mode, inputs) in [("1", 1), ("4", 2), ("5", 2), ("6", 3), ("7", 3)] {
        let (good, stderr) = run(&[mode, "0"], if mode == "6" { f32::NAN } else { 0.0 }, None);
        assert!(good, "{stderr}");
        assert_eq!(stderr, format!("{inputs} inputs every 0.001 s from 0 s\n"));
    }
    // 23 °C, and beyond its reach.
    for (mode, first, good) in [("6", 1e-3, true), ("7", 1e-3, true), ("6", 0.05, false), ("7", -0.05, false)] {
        let (is_good, stderr) = run_of(folders[1].path(), &[mode, "0"], first, None, TEMPERATURE);
        let words = if good { "4 inputs" } else { "film_sfun: the temperature is too far" };
        assert!(is_good == good && stderr.contains(words), "{mode}, {first}: {stderr}");
    }
}

/// The gateway as Octave's compiler driver builds it, here without a warning.
fn build_mex(folder: &Path, name: &str) {
    let mut build = Command::new("mkoctfile");
    build.current_dir(folder).env("CFLAGS", "-O2 -Wall -Wextra -Werror");
    succeeds(build.args(["--mex", &format!("{name}_mex.c"), &format!("{name}.c")]));
}

/// Runs a script of `tests/octave` in `folder` and returns what it printed.
fn octave(folder: &Path, script: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/octave").join(script);
    let mut octave = Command::new("octave-cli");
    octave.current_dir(folder).args(["--no-init-file", "--no-history", "--quiet"]).arg(path);
    String::from_utf8(succeeds(&mut octave)).expect("text")
}

/// Three recordings of 155 s through the MEX function in every mode, in three calls that hand the state on.
#[test]
#[ignore = "needs Octave: cargo xtask faces"]
fn the_mex_function_has_the_bits_of_rust() {
    let folder = TempDir::new().expect("a folder");
    let cases = [("plain", films::plain()), ("rich", films::rich())];
    for (name, case) in &cases {
        write(folder.path(), case, name);
        build_mex(folder.path(), name);
    }
    let mut limits = 0;
    for path in recordings("hossain") {
        let recorded = recorded(&path, 155);
        let mut lines = String::new();
        let mut wanted = Vec::new();
        for (name, case) in &cases {
            for (mode, kind) in MODES {
                let inputs = plain_inputs(case, kind, &recorded, true);
                let expected = expected((mode, kind), case, &inputs);
                let mut before = 0.0_f32;
                let mut bytes = Vec::new();
                for (k, (input, expected)) in inputs.iter().zip(&expected).enumerate() {
                    let sample = input.sample.map_or(f32::NAN, |sample| sample.displacement_m);
                    let is_halved = input.flags == 4;
                    let celsius = if input.flags == TEMPERATURE { input.celsius() } else { f32::NAN };
                    let put_out = if is_halved { 0.5 * before } else { before };
                    // Where it is what was commanded, it is given now and then.
                    let applied = if is_halved || k % 3 == 0 { put_out } else { f32::NAN };
                    let row = [input.a, sample, celsius, applied, input.b * put_out];
                    bytes.extend(row.iter().flat_map(|number| number.to_le_bytes()));
                    before = expected[1].map_or(0.0, f32::from_bits);
                }
                let file = format!("{name}-{mode}");
                fs::write(folder.path().join(format!("{file}.in")), bytes).expect("written");
                lines += &format!("{name}_mex {mode} {file}.in {file}.out\n");
                wanted.push((file, expected));
            }
        }
        fs::write(folder.path().join("jobs.txt"), lines).expect("written");
        octave(folder.path(), "jobs.m");
        for (file, expected) in wanted {
            let bytes = fs::read(folder.path().join(format!("{file}.out"))).expect("the script has written it");
            let (words, rest) = bytes.as_chunks::<4>();
            assert!(rest.is_empty());
            let words: Vec<u32> = words.iter().map(|word| u32::from_le_bytes(*word)).collect();
            // A count, which is written as a number.
            let count = |row: &[u32]| [&row[..6], &[f32::from_bits(row[6]) as u32]].concat();
            let written: Vec<Vec<u32>> = words.chunks(7).map(count).collect();
            limits |= compare(&format!("{file}, {}", path.display()), &expected, &[0, 1, 2, 3, 4, 5, 6], &written);
        }
    }
    assert!(limits.count_ones() >= 5, "limits that were met: {limits:b}");
}

/// Bad input ends in one clear message, and neither a wrong call nor a state of noise ends Octave.
#[test]
#[ignore = "needs Octave: cargo xtask faces"]
fn the_mex_function_refuses_bad_input() {
    let folder = TempDir::new().expect("a folder");
    write(folder.path(), &films::plain(), "film");
    write(folder.path(), &films::learned(), "other");
    write(folder.path(), &films::rich(), "warm");
    ["film", "other", "warm"].iter().for_each(|name| build_mex(folder.path(), name));
    assert_eq!(octave(folder.path(), "errors.m"), "good\tfilm\t0.001 s\n");
}
