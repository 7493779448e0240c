//! The command line: one file per command.

mod amplifier;
mod bench;
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
mod following;
mod frequency_response;
mod import;
mod link;
mod man;
mod observe;
mod options;
mod pil;
mod plant;
mod prelude;
mod profile;
mod recordings;
mod reduce;
mod reference;
mod replay;
mod run;
mod self_sensing;
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

/// An enum of the commands with their arguments, and the function that runs one of them.
macro_rules! commands {
    ($($(#[$meta:meta])* $Command:ident($arguments:ty, $run:path),)*) => {
        #[derive(Debug, Subcommand)]
        enum CliCommand {
            $($(#[$meta])* $Command(Box<$arguments>)),*
        }

        impl CliCommand {
            fn run(&self, json: bool) -> Result<Verdict> {
                match self {
                    $(Self::$Command(arguments) => $run(arguments, json).map(Into::into)),*
                }
            }
        }
    };
}

/// A command that only does its work.
impl From<()> for Verdict {
    fn from((): ()) -> Self {
        Self::Yes
    }
}

commands! {
    /// Do everything once: fit recordings, replay them, follow a sine; three simulated recordings if none are given.
    Demo(demo::Arguments, demo::run),
    /// Take a film that is not known yet to one that follows, on a bench, with a record. Exit status 1 if it does not.
    Commission(commission::Arguments, commission::run),
    /// Show whether a record of commissioning and its files are as they were sealed. Exit status 1 if it does not pass.
    Verify(commission::VerifyArguments, commission::verify),
    /// Open a page on this computer that shows a bench live: arm, play, tune, commission, and a stop button.
    Bench(bench::Arguments, bench::run),
    /// Show a bench that runs in the terminal, and stop it with the space bar.
    Monitor(bench::MonitorArguments, bench::monitor),
    /// Turn files of other programs (text, .xlsx, .mat) into recordings, and report how they were read.
    Import(import::Arguments, import::run),
    /// Report whether recordings identify a film, and what to record instead. Exit status 1 if they do not.
    Check(check::Arguments, check::run),
    /// Write a voltage over time that identifies a film, within a board's limits.
    Profile(profile::Arguments, profile::run),
    /// Compute the response to a recorded input.
    Simulate(simulate::Arguments, simulate::run),
    /// Compute the response to recorded inputs and compare it with what was measured.
    Replay(replay::Arguments, replay::run),
    /// Find the parameters of the model from recordings.
    Fit(fit::Arguments, fit::run),
    /// Compute the voltage that makes the film follow a reference, or check whether there is one.
    Feedforward(feedforward::Arguments, feedforward::run),
    /// Run the observer over a recording: estimate, disturbance, innovation.
    Observe(observe::Arguments, observe::run),
    /// Let a controller follow a reference on a nonlinear film.
    ClosedLoop(closed_loop::Arguments, closed_loop::run),
    /// Find how fast an amplifier follows, from a log of command and monitor.
    Amplifier(amplifier::Arguments, amplifier::run),
    /// Find how the displacement follows from a film's capacitance, and whether the monitors suffice. Exit status 1 if they do not.
    SelfSensing(self_sensing::Arguments, self_sensing::run),
    /// Write a reference to follow: sine, triangle, steps or random walk.
    Reference(reference::Arguments, reference::run),
    /// Fit other models of creep to the same recordings, in one table.
    Compare(compare::Arguments, compare::run),
    /// Repeat the paper's study on recordings: joint and single fits, both methods and topologies, tables and figures.
    Study(study::Arguments, study::run),
    /// Turn a material test (stretch and stress) into a recording of a body (displacement and force).
    Convert(convert::Arguments, convert::run),
    /// Write the parameter blob for the firmware.
    Export(export::Arguments, export::run),
    /// Step recordings through the firmware, in QEMU or on a board, and compare it with this host bit by bit.
    Pil(pil::Arguments, pil::run),
    /// Talk to a controller.
    Link(link::Arguments, link::run),
    /// Follow a reference through a high-voltage supply at a serial port, with this host as the controller.
    Run(run::Arguments, run::run),
    /// Find a smaller model with the same response.
    Reduce(reduce::Arguments, reduce::run),
    /// Tabulate displacement over force against frequency.
    FrequencyResponse(frequency_response::Arguments, frequency_response::run),
    /// Simulate a recording of a nonlinear film.
    #[command(visible_alias = "twin")]
    Plant(plant::Arguments, plant::run),
    /// Print the completion script for a shell.
    Completions(completions::Arguments, completions::run),
    /// Print the man page, or write those of all commands into a folder.
    Man(man::Arguments, man::run),
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
    cli.command.run(cli.json)
}

/// Checks the rate (Hz) of a controller and rounds it to single precision, as the controller stores it.
fn board_rate(rate_hz: f64) -> Result<f64> {
    if !(1.0..=100_000.0).contains(&rate_hz) {
        return Err(Error::field("rate", format!("{rate_hz:?} Hz must be from 1 to 100000")));
    }
    Ok(controller_rate(rate_hz))
}
