//! Progress on standard error: a bar on a terminal, elsewhere a line every 10 s. A caller that shows it otherwise, or that may end
//! the work, is a [`Watch`].

use std::io::{self, IsTerminal};
use std::ops::Deref;
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::thread;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use crate::error::Result;
use crate::terminal::{self, Verbosity};

/// Time from one line to the next where standard error is not a terminal, s.
pub const LINE_EVERY_S: f64 = 10.0;

/// Progress of one piece of work; ends with this value.
pub struct Progress {
    bar: ProgressBar,
    /// Ends the thread of the lines when it is dropped.
    _lines: Option<Sender<()>>,
}

/// Receiver of progress, which may end the work.
pub trait Watch: Sync {
    /// Counts `units` of work that are done.
    ///
    /// # Errors
    ///
    /// [`Error::Interrupted`](crate::error::Error::Interrupted) where the work is to end here, without a result.
    fn advance(&self, units: u64) -> Result<()>;
}

impl Watch for ProgressBar {
    fn advance(&self, units: u64) -> Result<()> {
        self.inc(units);
        Ok(())
    }
}

impl Watch for Progress {
    fn advance(&self, units: u64) -> Result<()> {
        self.bar.advance(units)
    }
}

/// How far a piece of work has come.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Stage {
    /// Present stage.
    pub what: String,
    /// Number of this stage, from one, and of those that there are at the most.
    pub count: Option<(usize, usize)>,
    /// Work before this stage, and all of it, in any unit.
    pub work: (u64, u64),
}

impl Stage {
    /// A stage of which nothing but its name is known.
    pub fn named(what: impl Into<String>) -> Self {
        Self { what: what.into(), ..Self::default() }
    }

    /// Stage number `number` of `all`, which take about the same time each.
    pub fn numbered(what: impl Into<String>, number: usize, all: usize) -> Self {
        let work = (number.saturating_sub(1) as u64, all as u64);
        Self { what: what.into(), count: Some((number, all)), work }
    }
}

impl Progress {
    /// Over `length` units of work, counted by the bar.
    pub fn over(length: u64, what: &str) -> Self {
        Self::new(Some(length).filter(|&length| length > 0), what)
    }

    /// Over work of unknown length.
    pub fn unknown(what: &str) -> Self {
        Self::new(None, what)
    }

    fn new(length: Option<u64>, what: &str) -> Self {
        let to_terminal = io::stderr().is_terminal();
        let quiet = terminal::verbosity() == Verbosity::Quiet;
        let target = if to_terminal && !quiet { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(length, target).with_message(what.to_owned());
        set_style(&bar);
        let lines = if quiet || to_terminal {
            bar.enable_steady_tick(Duration::from_millis(250));
            None
        } else {
            Some(print_lines(bar.clone()))
        };
        Self { bar, _lines: lines }
    }

    /// Goes on to `stage`.
    pub fn enter(&self, stage: &Stage) {
        let Stage { what, count, work: (before, all) } = stage;
        let text = match count {
            Some((number, of)) => format!("{what} ({number} of {of})"),
            None => what.clone(),
        };
        if self.bar.message() != text {
            self.bar.suspend(|| terminal::note(&text));
        }
        if *all > 0 {
            // Where more is planned on the way the share does not change.
            let share = self.bar.position() as f64 / self.bar.length().unwrap_or(0).max(1) as f64;
            self.bar.set_length(*all);
            self.bar.set_position((*before).max((share * *all as f64) as u64));
            set_style(&self.bar);
        }
        self.bar.set_message(text);
    }
}

impl Deref for Progress {
    type Target = ProgressBar;

    fn deref(&self) -> &ProgressBar {
        &self.bar
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

fn set_style(bar: &ProgressBar) {
    let template = match bar.length() {
        Some(_) => "{msg} [{bar:30}] {percent:>3} %, {elapsed}{left}",
        None => "{spinner} {msg} {elapsed}",
    };
    if let Ok(style) = ProgressStyle::with_template(template) {
        let left = |state: &ProgressState, out: &mut dyn std::fmt::Write| {
            let left = remaining(state.elapsed(), state.pos(), state.len().unwrap_or(0));
            let _ = out.write_str(&left);
        };
        bar.set_style(style.progress_chars("=> ").with_key("left", left));
    }
}

/// Prints a line about `bar` now and then, until the sender that is returned is dropped.
fn print_lines(bar: ProgressBar) -> Sender<()> {
    let (sender, ended) = mpsc::channel();
    let every = Duration::from_secs_f64(every_s());
    thread::spawn(move || {
        while let Err(RecvTimeoutError::Timeout) = ended.recv_timeout(every) {
            if !bar.is_finished() {
                terminal::message(line(&bar.message(), bar.elapsed(), bar.position(), bar.length()));
            }
        }
    });
    sender
}

/// Time between two lines, s. A test does not wait for 10 s.
fn every_s() -> f64 {
    let asked = std::env::var("HOST_SIM_PROGRESS_S").ok().and_then(|text| text.parse::<f64>().ok());
    asked.filter(|seconds| (0.01..=86_400.0).contains(seconds)).unwrap_or(LINE_EVERY_S)
}

/// A line that reports the progress of the work.
fn line(what: &str, elapsed: Duration, position: u64, length: Option<u64>) -> String {
    let elapsed_s = duration(elapsed.as_secs());
    match length {
        Some(length) if length > 0 => {
            let share = 100 * position.min(length) / length;
            format!("{what}: {share} % after {elapsed_s}{}", remaining(elapsed, position, length))
        }
        _ => format!("{what}: {elapsed_s} so far"),
    }
}

/// The time that is left if the rest goes as fast as what is done.
fn remaining(elapsed: Duration, position: u64, length: u64) -> String {
    if position == 0 || position >= length {
        return String::new();
    }
    let left_s = elapsed.as_secs_f64() * (length - position) as f64 / position as f64;
    format!(", about {} left", duration(left_s.round() as u64))
}

/// A duration in the two largest units.
fn duration(seconds: u64) -> String {
    match (seconds / 3600, seconds / 60 % 60, seconds % 60) {
        (0, 0, seconds) => format!("{seconds} s"),
        (0, minutes, seconds) => format!("{minutes} min {seconds} s"),
        (hours, minutes, _) => format!("{hours} h {minutes} min"),
    }
}
