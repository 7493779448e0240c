//! The firmware's log: what it calls by the name `defmt`, without defmt.

use std::sync::{Mutex, PoisonError};

pub use std::fmt::Debug as Format;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    Warning,
    Error,
}

pub type Line = (Level, String);

static LINES: Mutex<Vec<Line>> = Mutex::new(Vec::new());

pub fn add(level: Level, text: String) {
    LINES.lock().unwrap_or_else(PoisonError::into_inner).push((level, text));
}

pub fn take() -> Vec<Line> {
    std::mem::take(&mut *LINES.lock().unwrap_or_else(PoisonError::into_inner))
}

#[macro_export]
macro_rules! warn {
    ($($text:tt)*) => { $crate::log::add($crate::log::Level::Warning, format!($($text)*)) };
}

#[macro_export]
macro_rules! error {
    ($($text:tt)*) => { $crate::log::add($crate::log::Level::Error, format!($($text)*)) };
}
