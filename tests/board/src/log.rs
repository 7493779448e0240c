//! The firmware's log: what it calls by the name `defmt`, without defmt.

use std::sync::{Mutex, PoisonError};

pub use std::fmt::Debug as Format;

/// How serious a message is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    Warning,
    Error,
}

/// A message.
pub type Line = (Level, String);

static LINES: Mutex<Vec<Line>> = Mutex::new(Vec::new());

/// Adds a message.
pub fn add(level: Level, text: String) {
    LINES.lock().unwrap_or_else(PoisonError::into_inner).push((level, text));
}

/// Takes what was logged so far.
pub fn take() -> Vec<Line> {
    std::mem::take(&mut *LINES.lock().unwrap_or_else(PoisonError::into_inner))
}

/// Logs a warning.
#[macro_export]
macro_rules! warn {
    ($($text:tt)*) => { $crate::log::add($crate::log::Level::Warning, format!($($text)*)) };
}

/// Logs an error.
#[macro_export]
macro_rules! error {
    ($($text:tt)*) => { $crate::log::add($crate::log::Level::Error, format!($($text)*)) };
}
