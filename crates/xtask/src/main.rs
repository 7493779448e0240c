//! Chores of the project: `cargo xtask help`.
#![forbid(unsafe_code)]

mod advisories;
mod benchmark;
mod board;
mod book;
mod campaign;
#[cfg(test)]
mod circles;
mod cycles;
mod embedded;
mod faces;
mod firmware;
mod lint;
mod mutants;
mod other_board;
mod packages;
mod page;
mod process;
mod programs;
mod python;
mod recordings;
mod release;
mod setup;
mod test;
mod windows;
mod wiring;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

use embedded::Films;
use release::Making;

/// Chores of the project.
#[derive(Parser)]
#[command(name = "cargo xtask")]
struct Cli {
    /// Install nothing: a chore ends where something is missing, and names it.
    #[arg(long, global = true)]
    no_install: bool,
    #[command(subcommand)]
    chore: Chore,
}

#[derive(Subcommand)]
enum Chore {
    /// Install what is missing, then run every test, on the host and in QEMU. Names what it will install, and asks once on a terminal.
    Test,
    /// Format and lints of all code: the workspace, each feature of the libraries, the images for the chips.
    Lint,
    /// Run the tests with all cases of their sweeps, of which `test` runs a sample: some 20 minutes on two cores.
    Sweep,
    /// Install what is missing: compiler targets, QEMU, and what decodes the firmware's log.
    Setup,
    /// Run the images in QEMU: the host's bits, and the instruction counts that docs/results.md states.
    Embedded,
    /// Build the firmware for QEMU, as springpot pil starts it.
    Image,
    /// Build the firmware for QEMU and for a board, and run it in QEMU: the host's bits, and how faults end.
    Firmware,
    /// Start the virtual board: the firmware in QEMU with a simulated film, for springpot link. Installs what is missing.
    Board {
        /// TCP port of its link; 4050 by default, or another one if that is taken.
        #[arg(long, value_name = "PORT")]
        port: Option<u16>,
        /// Start this image instead of building one.
        #[arg(long, value_name = "ELF")]
        image: Option<std::path::PathBuf>,
    },
    /// Test the law in other languages, and the Rust crates with each feature, as packages and on other boards (docs/c.md, python.md,
    /// simulink.md, fmi.md): compilers, sanitizers, chips in QEMU, Python, Octave. Installs what is missing, some 2.5 GB on Debian.
    Faces {
        /// Only this one.
        face: Option<faces::Face>,
    },
    /// Compare the model with others on simulated films, as docs/results.md reports: some 15 minutes. Installs packages of Python into target/faces.
    Benchmark {
        /// A tensile test of a film as well: a CSV file with time_s, stretch, nominal_stress_pa.
        #[arg(long, value_name = "TEST.csv")]
        measured: Option<std::path::PathBuf>,
    },
    /// Make the recordings under tests/recordings again.
    Recordings,
    /// Draw the boards of docs/boards.md from their tables.
    Wiring,
    /// Run what takes too long for every change: all simulated faults, the fuzzers, and mutants of the driver. Installs
    /// what is missing. Fuzzing takes 40 minutes and its build; mutants take hours.
    Campaign {
        /// Only this part.
        part: Option<campaign::Part>,
        /// Only so many of the mutants, at random, and none of cargo-mutants.
        #[arg(long, value_name = "N")]
        sample: Option<usize>,
        /// Only mutants of files with this in their path, and none of cargo-mutants.
        #[arg(long, value_name = "PART")]
        only: Option<String>,
    },
    /// Look at the page of a demo in Chromium: plots drawn, numbers those of --json, no console message; light, dark, phone, print.
    /// Installs Chromium where it is missing (some 300 MB), which is why `test` does not do it.
    Page,
    /// Build the documentation in the sources without a warning, and the book of docs/ into target/book, and follow its links. Installs
    /// mdBook where it is missing, which takes minutes.
    Book,
    /// Make the files of a release in target/dist/files, from the last commit (docs/CONTRIBUTING.md lists them). Uploads nothing; installs
    /// compiler targets, MinGW, and tools of cargo and Python into target/tools.
    Release {
        /// Make them again in another folder, as another user and in another time zone, and compare the digests.
        #[arg(long)]
        twice: bool,
        /// The second time of --twice alone, in target/dist/files-again.
        #[arg(long, hide = true, conflicts_with = "twice")]
        again: bool,
        /// Only the tool for this target, such as x86_64-unknown-linux-musl.
        #[arg(long)]
        target: Option<String>,
    },
    /// Check licences, advisories and yanked versions of all dependencies with cargo-deny, which it installs into target/tools.
    Deny,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    setup::allow_installing(!cli.no_install);
    let done = match cli.chore {
        Chore::Test => test::run(),
        Chore::Lint => lint::run(),
        Chore::Sweep => test::sweep(),
        Chore::Setup => setup::run().map(drop),
        Chore::Embedded => {
            let run = |toolchain| embedded::libraries(&toolchain).and_then(|()| embedded::run(&toolchain, Films::All));
            setup::run().and_then(run)
        }
        Chore::Image => setup::toolchain(&setup::TARGETS).and_then(|toolchain| firmware::image(&toolchain)),
        Chore::Firmware => setup::run().and_then(|toolchain| firmware::run(&toolchain)),
        Chore::Board { port, image } => board::run(port, image),
        Chore::Faces { face } => faces::run(face),
        Chore::Benchmark { measured } => benchmark::run(measured.as_deref()),
        Chore::Recordings => recordings::run(),
        Chore::Wiring => wiring::run(),
        Chore::Campaign { part, sample, only } => campaign::run(part, sample, only.as_deref()),
        Chore::Page => page::run(),
        Chore::Book => book::run(),
        Chore::Release { twice, again, target } => {
            let making = match (twice, again) {
                (true, _) => Making::Twice,
                (_, true) => Making::Again,
                _ => Making::Once,
            };
            release::run(target.as_deref(), making)
        }
        Chore::Deny => advisories::deny(),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("xtask: {error}");
            ExitCode::FAILURE
        }
    }
}
