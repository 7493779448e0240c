//! The campaign: what takes too long for every change. Simulated faults, random fits, fuzzing, and mutants of the driver's own source.

use std::path::PathBuf;
use std::process::Command;

use clap::ValueEnum;

use crate::process::{Result, cargo, command, make, root, run as run_command};
use crate::{mutants, setup, test};

/// A part of the campaign.
#[derive(Clone, Copy, ValueEnum)]
pub enum Part {
    /// The driver's campaign of simulated faults, all cases.
    Driver,
    /// 10 000 fits of random recordings with random options, of which `cargo xtask test` runs 40: no panic, no NaN, no fit without a
    /// stated agreement. Over an hour.
    Fits,
    /// Faulty recordings, all cases of which `cargo xtask test` runs a sample: each is reported with its cause or does no harm.
    Recordings,
    /// Commissioning of 300 sound films and 300 bad benches, of which `cargo xtask test` runs a sample, 1 000 sittings that are ended, and 100 000 changed bytes. Hours.
    Commission,
    /// The page of `bench`: a million forged requests, of which `cargo xtask test` sends 10 000, 10 000 clicks on its stop button, with their times, and in a browser a whole sitting and ten hours of states. Two hours.
    Bench,
    /// Each fuzzer for ten minutes: no panic, nothing obeyed that must not be.
    Fuzz,
    /// Mutants of the driver's source, each of which its tests should notice.
    Mutants,
}

/// The fuzzers, with the largest input of each, bytes.
const FUZZERS: [(&str, &str); 4] =
    [("frames", "2048"), ("blobs", "2048"), ("recordings", "4096"), ("parameter-files", "4096")];

/// Time of each fuzzer, s.
const SECONDS: &str = "600";

/// Runs a part, or all of them; a part that fails does not keep the others from running.
pub fn run(part: Option<Part>, sample: Option<usize>, only: Option<&str>) -> Result<()> {
    let parts = part.map_or_else(|| Part::value_variants().to_vec(), |part| vec![part]);
    let failed = parts.into_iter().filter_map(|part| match part {
        Part::Driver => driver().err(),
        Part::Fits => models(&["random_fits"]).err(),
        Part::Recordings => models(&["bad_recordings"]).err(),
        Part::Commission => models(&["commission", "sealed_records"]).err(),
        Part::Bench => bench().err(),
        Part::Fuzz => fuzz().err(),
        Part::Mutants => mutants(sample, only).err(),
    });
    none(failed)
}

/// Nothing failed, or all that did.
fn none(failed: impl Iterator<Item = String>) -> Result<()> {
    let failed: Vec<String> = failed.collect();
    if failed.is_empty() { Ok(()) } else { Err(failed.join("\n")) }
}

/// All faults in the test `campaign`, of which `cargo xtask test` runs a sample.
fn driver() -> Result<()> {
    let mut test = cargo("test --release --package dea-driver --test campaign -- --nocapture");
    test.env("SPRINGPOT_CAMPAIGN", "full");
    run_command(test)
}

/// The tests of these names of the libraries behind the commands, all cases.
fn models(names: &[&str]) -> Result<()> {
    let mut test = cargo("test --workspace --features tests/qemu --test it");
    test.arg("--").args(names).arg("--nocapture").env("SPRINGPOT_SWEEP", "full");
    run_command(test)
}

/// The page, in this process and in a browser.
fn bench() -> Result<()> {
    let mut test = cargo("test --workspace --features tests/qemu --test link_commands");
    test.args(["page::no_forged", "page_served::every_click", "--", "--nocapture"]).env("SPRINGPOT_SWEEP", "full");
    run_command(test)?;
    let browser = setup::chromium()?;
    let [tool, _] = test::programs()?;
    for run in ["sitting", "10"] {
        let mut hours = command(setup::python()?, &["host-sim/tests/browser/hours.py", browser]);
        hours.arg(&tool).arg(run);
        run_command(hours)?;
    }
    Ok(())
}

/// Builds the fuzzers and runs one after another, from the committed corpora on. What they find new stays below `target`.
fn fuzz() -> Result<()> {
    setup::ensure(setup::CPP_COMPILER)?;
    run_command(fuzzers("fmt --check"))?;
    run_command(fuzzers("build --release"))?;
    none(FUZZERS.into_iter().filter_map(|(fuzzer, longest)| fuzz_one(fuzzer, longest).err()))
}

fn fuzz_one(fuzzer: &str, longest: &str) -> Result<()> {
    let target = root().join("tests/fuzz/target");
    let found = made(target.join("corpus").join(fuzzer))?;
    let crashes = made(target.join("crashes").join(fuzzer))?;
    let corpus = root().join("tests/fuzz/corpus").join(fuzzer).display().to_string();
    let limits = [format!("-max_total_time={SECONDS}"), format!("-max_len={longest}")];
    let [time, length] = &limits;
    let prefix = format!("-artifact_prefix={crashes}/");
    // An input of a few kilobytes that takes 10 s or 1 GB is a fault as well.
    let options = [time, length, &prefix, "-timeout=10", "-rss_limit_mb=1024", "-print_final_stats=1"];
    let words = format!("-dict={}", root().join("tests/fuzz/words").join(fuzzer).display());
    let mut run = fuzzers(&format!("run --release --bin {fuzzer} --"));
    run.args(options).args([words, found, corpus]);
    run_command(run)
}

fn made(folder: PathBuf) -> Result<String> {
    make(&folder)?;
    Ok(folder.display().to_string())
}

/// A cargo command on the fuzzers, which are a workspace of their own with flags of their own.
fn fuzzers(line: &str) -> Command {
    let mut command = cargo(line);
    command.current_dir(root().join("tests/fuzz"));
    command.env_remove("RUSTFLAGS").env_remove("CARGO_ENCODED_RUSTFLAGS");
    command
}

/// Mutants of ours, or a sample of them; with all of them those of cargo-mutants as `.cargo/mutants.toml` states, which is installed if it is missing.
fn mutants(sample: Option<usize>, only: Option<&str>) -> Result<()> {
    let ours = mutants::run(sample, only);
    if sample.is_some() || only.is_some() {
        return ours;
    }
    let mut theirs =
        command(&setup::tool("cargo-mutants", "27.1.0", "")?.to_string_lossy(), &["mutants", "--output", "target"]);
    theirs.env("CARGO_INCREMENTAL", "0");
    none([ours, run_command(theirs)].into_iter().filter_map(Result::err))
}
