//! Output: results on standard output, messages and warnings on standard error.
//!
//! Colours are left out where the output is not a terminal, or where `NO_COLOR` or `CLICOLOR` ask for that.

use std::fmt::Display;
use std::io::{self, ErrorKind, Write};
use std::sync::atomic::{AtomicU8, Ordering};

use serde::Serialize;

use crate::error::{Error, Result};

/// Amount of messages on standard error besides errors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Verbosity {
    /// Nothing.
    Quiet,
    /// Warnings and progress.
    #[default]
    Normal,
    /// Each stage as well.
    Verbose,
}

static VERBOSITY: AtomicU8 = AtomicU8::new(Verbosity::Normal as u8);

/// Sets the amount of messages.
pub fn set_verbosity(verbosity: Verbosity) {
    VERBOSITY.store(verbosity as u8, Ordering::Relaxed);
}

/// Amount of messages.
pub fn verbosity() -> Verbosity {
    match VERBOSITY.load(Ordering::Relaxed) {
        0 => Verbosity::Quiet,
        1 => Verbosity::Normal,
        _ => Verbosity::Verbose,
    }
}

/// Prints `text` on standard output. A closed pipe is no error.
pub fn print(text: &str) -> Result<()> {
    let mut out = anstream::AutoStream::auto(io::stdout()).lock();
    let written = out.write_all(text.as_bytes()).and_then(|()| out.write_all(b"\n")).and_then(|()| out.flush());
    match written {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Error::Computation(format!("standard output: {e}"))),
        _ => Ok(()),
    }
}

/// Prints `document` as JSON, or else `text`.
pub fn report<D: Serialize>(json: bool, document: &D, text: impl FnOnce() -> String) -> Result<()> {
    if json {
        print(&serde_json::to_string(document).map_err(|e| Error::Computation(format!("JSON: {e}")))?)
    } else {
        print(&text())
    }
}

/// `value` with `digits` decimals; in scientific notation from 1e9 on; a dash for NaN.
pub fn decimals(value: f64, digits: usize) -> String {
    const MAX_PLAIN: f64 = 1e9;
    match value {
        _ if value.is_nan() => "–".into(),
        _ if value.is_infinite() => if value > 0.0 { "∞" } else { "-∞" }.into(),
        _ if value.abs() < MAX_PLAIN => format!("{value:.digits$}"),
        _ => format!("{value:.2e}"),
    }
}

/// A number that a person chose, such as a rate, with six digits at the most.
pub fn rounded(value: f64) -> String {
    let six: f64 = format!("{value:.5e}").parse().unwrap_or(value);
    if six == 0.0 || (1e-4..1e9).contains(&six.abs()) { format!("{six}") } else { format!("{six:e}") }
}

/// Prints `warnings` on standard error, unless they are in the JSON that is printed.
pub fn warnings<W: Display>(json: bool, warnings: impl IntoIterator<Item = W>) {
    if json || verbosity() == Verbosity::Quiet {
        return;
    }
    for warning in warnings {
        line(&format!("\x1b[1;33mwarning:\x1b[0m {warning}"));
    }
}

/// Prints `error` on standard error.
pub fn error(error: impl Display) {
    line(&format!("\x1b[1;31mspringpot:\x1b[0m {error}"));
}

/// Prints what the user must know now, even with `-q`.
pub fn message(text: impl Display) {
    line(&format!("springpot: {text}"));
}

/// Prints how an input was read, except with `-q`.
pub fn information(text: impl Display) {
    if verbosity() >= Verbosity::Normal {
        message(text);
    }
}

/// Prints details for `-v`.
pub fn note(text: impl Display) {
    if verbosity() == Verbosity::Verbose {
        message(text);
    }
}

/// A line on standard error. Where that is gone, as after a hang-up, the line is lost.
fn line(text: &str) {
    let mut stderr = anstream::AutoStream::auto(io::stderr()).lock();
    let _ = writeln!(stderr, "{}", shortened(text));
}

/// `text` with the middle left out of lines that are too long to read, as where names of columns are pages of text.
pub fn shortened(text: &str) -> String {
    const MAX_LINE: usize = 1000;
    const KEPT: [usize; 2] = [600, 300];
    let short = |line: &str| {
        let count = line.chars().count();
        if count <= MAX_LINE {
            return line.to_owned();
        }
        let (begin, end) = (line.chars().take(KEPT[0]), line.chars().skip(count - KEPT[1]));
        format!("{} … {}", begin.collect::<String>(), end.collect::<String>())
    };
    text.split('\n').map(short).collect::<Vec<_>>().join("\n")
}
