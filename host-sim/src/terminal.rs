//! Output: results on standard output, progress on standard error.

use std::io::{self, ErrorKind, IsTerminal, Write};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;

use crate::error::{Error, Result};

/// Prints `text` on standard output. A closed pipe is no error.
///
/// # Errors
///
/// [`Error::Computation`] where standard output cannot be written.
pub fn print(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    let written = out.write_all(text.as_bytes()).and_then(|()| out.write_all(b"\n")).and_then(|()| out.flush());
    match written {
        Err(e) if e.kind() != ErrorKind::BrokenPipe => Err(Error::Computation(format!("standard output: {e}"))),
        _ => Ok(()),
    }
}

/// Prints `document` as JSON, or else `text`.
///
/// # Errors
///
/// As [`print()`].
pub fn report<D: Serialize>(json: bool, document: &D, text: impl FnOnce() -> String) -> Result<()> {
    if json {
        print(&serde_json::to_string(document).map_err(|e| Error::Computation(format!("JSON: {e}")))?)
    } else {
        print(&text())
    }
}

/// A progress bar over `length` units of work: on standard error, and only where that is a terminal.
pub fn progress(length: u64, what: &str) -> ProgressBar {
    styled(Some(length), "{msg} [{bar:30}] {percent:>3} % {eta}").with_message(what.to_owned())
}

/// A spinner for work of unknown length: on standard error, and only where that is a terminal.
pub fn spinner() -> ProgressBar {
    styled(None, "{spinner} {msg} {elapsed}")
}

fn styled(length: Option<u64>, template: &str) -> ProgressBar {
    let target = if io::stderr().is_terminal() { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
    let bar = ProgressBar::with_draw_target(length, target);
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style.progress_chars("=> "));
    }
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}
