//! The command line: one file per command.

mod amplifier;
mod check;
mod choice;
mod closed_loop;
mod commission;
mod compare;
mod completions;
mod convert;
mod demo;
mod examples;
mod export;
mod feedforward;
mod fit;
mod flags;
mod frequency_response;
mod import;
mod link;
mod man;
mod observe;
mod options;
mod pil;
mod plant;
mod profile;
mod recordings;
mod reduce;
mod reference;
mod replay;
mod run;
mod simulate;
mod study;
mod usage;

use std::ffi::OsString;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};

pub use self::flags::with_flags;
use crate::error::{Error, Result};
use crate::files::parameters::controller_rate;
use crate::interrupt;
use crate::terminal::{self, Verbosity};

/// Creep compensation for dielectric elastomer actuators, on the bench.
///
/// Runs the controller's own code against recordings of high-voltage runs. Files and options are in SI units: metres,
/// newtons, volts, seconds, kilograms. Options take units as well: 6kV, 2.5mm, 10s, 1kHz, 50kV/s.
#[derive(Debug, Parser)]
#[command(name = "springpot", version)]
struct Cli {
    #[command(subcommand)]
    command: CliCommand,
    /// Print one JSON document on standard output, and nothing else there.
    #[arg(long, global = true)]
    json: bool,
    /// No progress and no warnings on standard error: errors alone.
    #[arg(short, long, global = true)]
    quiet: bool,
    /// Report each stage of the work on standard error.
    #[arg(short, long, global = true, conflicts_with = "quiet")]
    verbose: bool,
}

/// Result of a command for scripts: the exit status is 0 for yes and 1 for no.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The work is done, and what was asked for holds.
    Yes,
    /// The work is done, and what was asked for does not hold.
    No,
}

#[derive(Debug, Subcommand)]
enum CliCommand {
    /// Do everything once: fit recordings, replay them, follow a sine; three simulated recordings if none are given.
    Demo(demo::Arguments),
    /// Take a film that is not known yet to one that follows, on a bench, with a record. Exit status 1 if it does not.
    Commission(Box<commission::Arguments>),
    /// Show whether a record of commissioning and its files are as they were sealed. Exit status 1 if it does not pass.
    Verify(commission::VerifyArguments),
    /// Turn files of other programs (text, .xlsx, .mat) into recordings, and report how they were read.
    Import(import::Arguments),
    /// Report whether recordings identify a film, and what to record instead. Exit status 1 if they do not.
    Check(check::Arguments),
    /// Write a voltage over time that identifies a film, within a board's limits.
    Profile(profile::Arguments),
    /// Compute the response to a recorded input.
    Simulate(simulate::Arguments),
    /// Compute the response to recorded inputs and compare it with what was measured.
    Replay(replay::Arguments),
    /// Find the parameters of the model from recordings.
    Fit(Box<fit::Arguments>),
    /// Compute the voltage that makes the film follow a reference, or check whether there is one.
    Feedforward(feedforward::Arguments),
    /// Run the observer over a recording: estimate, disturbance, innovation.
    Observe(observe::Arguments),
    /// Let a controller follow a reference on a nonlinear film.
    ClosedLoop(Box<closed_loop::Arguments>),
    /// Find how fast an amplifier follows, from a log of command and monitor.
    Amplifier(amplifier::Arguments),
    /// Write a reference to follow: sine, triangle, steps or random walk.
    Reference(reference::Arguments),
    /// Fit other models of creep to the same recordings, in one table.
    Compare(Box<compare::Arguments>),
    /// Repeat the paper's study on recordings: joint and single fits, both methods and topologies, tables and figures.
    Study(study::Arguments),
    /// Turn a material test (stretch and stress) into a recording of a body (displacement and force).
    Convert(convert::Arguments),
    /// Write the parameter blob for the firmware.
    Export(export::Arguments),
    /// Step recordings through the firmware, in QEMU or on a board, and compare it with this host bit by bit.
    Pil(pil::Arguments),
    /// Talk to a controller.
    Link(Box<link::Arguments>),
    /// Follow a reference through a high-voltage supply at a serial port, with this host as the controller.
    Run(run::Arguments),
    /// Find a smaller model with the same response.
    Reduce(reduce::Arguments),
    /// Tabulate displacement over force against frequency.
    FrequencyResponse(frequency_response::Arguments),
    /// Simulate a recording of a nonlinear film.
    #[command(visible_alias = "twin")]
    Plant(plant::Arguments),
    /// Print the completion script for a shell.
    Completions(completions::Arguments),
    /// Print the man page, or write those of all commands into a folder.
    Man(man::Arguments),
}

/// The command line with its examples, for help, completions and man pages.
pub fn command_line() -> clap::Command {
    examples::added_to(usage::with_signed_numbers(Cli::command()))
}

/// Runs the command line `arguments`, the program's name first.
///
/// # Errors
///
/// [`Error`], one line that names the place and the remedy.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> Result<Verdict> {
    let arguments: Vec<OsString> = arguments.into_iter().collect();
    let parsed = command_line().try_get_matches_from(&arguments).and_then(|matches| Cli::from_arg_matches(&matches));
    let cli = match parsed {
        Ok(cli) => cli,
        Err(error) if error.use_stderr() => return Err(usage::error(&error, &arguments)),
        Err(help) => {
            terminal::print(help.render().ansi().to_string().trim_end())?;
            return Ok(Verdict::Yes);
        }
    };
    terminal::set_verbosity(match (cli.quiet, cli.verbose) {
        (true, _) => Verbosity::Quiet,
        (false, false) => Verbosity::Normal,
        (false, true) => Verbosity::Verbose,
    });
    interrupt::install();
    match cli.command {
        CliCommand::Commission(arguments) => return commission::run(&arguments, cli.json),
        CliCommand::Verify(arguments) => return commission::verify(&arguments, cli.json),
        CliCommand::Check(arguments) => return check::run(&arguments, cli.json),
        CliCommand::Feedforward(arguments) => return feedforward::run(&arguments, cli.json),
        CliCommand::Demo(arguments) => demo::run(&arguments, cli.json),
        CliCommand::Import(arguments) => import::run(&arguments, cli.json),
        CliCommand::Profile(arguments) => profile::run(&arguments, cli.json),
        CliCommand::Simulate(arguments) => simulate::run(&arguments, cli.json),
        CliCommand::Replay(arguments) => replay::run(&arguments, cli.json),
        CliCommand::Fit(arguments) => fit::run(&arguments, cli.json),
        CliCommand::Observe(arguments) => observe::run(&arguments, cli.json),
        CliCommand::ClosedLoop(arguments) => closed_loop::run(&arguments, cli.json),
        CliCommand::Amplifier(arguments) => amplifier::run(&arguments, cli.json),
        CliCommand::Reference(arguments) => reference::run(&arguments, cli.json),
        CliCommand::Compare(arguments) => compare::run(&arguments, cli.json),
        CliCommand::Study(arguments) => study::run(&arguments, cli.json),
        CliCommand::Convert(arguments) => convert::run(&arguments, cli.json),
        CliCommand::Export(arguments) => export::run(&arguments, cli.json),
        CliCommand::Pil(arguments) => pil::run(&arguments, cli.json),
        CliCommand::Link(arguments) => link::run(&arguments, cli.json),
        CliCommand::Run(arguments) => run::run(&arguments, cli.json),
        CliCommand::Reduce(arguments) => reduce::run(&arguments, cli.json),
        CliCommand::FrequencyResponse(arguments) => frequency_response::run(&arguments, cli.json),
        CliCommand::Plant(arguments) => plant::run(&arguments, cli.json),
        CliCommand::Completions(arguments) => completions::run(&arguments, cli.json),
        CliCommand::Man(arguments) => man::run(&arguments, cli.json),
    }
    .map(|()| Verdict::Yes)
}

/// Checks the rate (Hz) of a controller and rounds it to single precision, as the controller stores it.
fn board_rate(rate_hz: f64) -> Result<f64> {
    if !(1.0..=100_000.0).contains(&rate_hz) {
        return Err(Error::field("rate", format!("{rate_hz:?} Hz must be from 1 to 100000")));
    }
    Ok(controller_rate(rate_hz))
}
