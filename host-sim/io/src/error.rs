//! Errors: one line each, with the place, the cause and the remedy.
//!
//! Options are named by their fields, in backticks: `rate_hz`. [`with_names`] puts the names in that a caller knows: a command line its flags, Python
//! its arguments.

use std::fmt;
use std::path::{Path, PathBuf};

use springpot::{ActuatorError, ControlError, LawError, ModelError};

/// A result of this library.
pub type Result<T> = std::result::Result<T, Error>;

/// An error, printed as one line.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file that cannot be read or written.
    #[error("{}: {cause}", shown(path))]
    File {
        /// The file.
        path: PathBuf,
        /// The system's message, or what is wrong with the file as a whole.
        cause: String,
    },
    /// A line of a file that cannot be used.
    #[error("{}:{line}: {cause}", shown(path))]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, counted from one.
        line: u64,
        /// The fault, and what would be right.
        cause: String,
    },
    /// An error about the content of a file, or about a result computed from it.
    #[error("{place}: {error}")]
    At {
        /// The file, or the preset.
        place: String,
        /// The fault.
        error: Box<Error>,
    },
    /// A command line that cannot be parsed.
    #[error("{0}")]
    Usage(String),
    /// An option that cannot be used.
    #[error("`{field}`: {cause}")]
    Field {
        /// Name of the field that holds the option, with its unit, such as `rate_hz`.
        field: &'static str,
        /// The fault, and what would be right.
        cause: String,
    },
    /// A model that was refused.
    #[error("model: {}", short(.0))]
    Model(#[from] ModelError),
    /// A law that was refused.
    #[error("law: {}", short(.0))]
    Law(#[from] LawError),
    /// An actuator that was refused.
    #[error("actuator: {}", short(.0))]
    Actuator(#[from] ActuatorError),
    /// A controller that does not answer, or that refuses.
    #[error("{port}: {cause}")]
    Link {
        /// Its port.
        port: String,
        /// The fault, and what would be right.
        cause: String,
    },
    /// A controller's settings that were refused.
    #[error("control: {}", short(.0))]
    Control(#[from] ControlError),
    /// A computation that has no result.
    #[error("{0}")]
    Computation(String),
    /// Work that its caller ended.
    #[error("interrupted")]
    Interrupted,
}

impl Error {
    /// An error about a file as a whole.
    pub fn file(path: &Path, cause: impl ToString) -> Self {
        Self::File { path: path.into(), cause: cause.to_string() }
    }

    /// An error about a line of a file.
    pub fn line(path: &Path, line: u64, cause: impl Into<String>) -> Self {
        Self::Line { path: path.into(), line, cause: cause.into() }
    }

    /// An error about an option.
    pub fn field(field: &'static str, cause: impl Into<String>) -> Self {
        Self::Field { field, cause: cause.into() }
    }

    /// Names the file and the value in it that a controller refuses.
    #[must_use]
    pub fn about_value(self, path: &Path, value: f64) -> Self {
        Self::At { place: format!("{}, value {value}", shown(path)), error: Box::new(self) }
    }

    /// Names the file that caused this: `parameters` as named on the command line, or else the `recording`.
    #[must_use]
    pub fn about(self, parameters: &str, recording: &Path) -> Self {
        let place = match self {
            Self::Model(_) | Self::Law(_) | Self::Actuator(_) | Self::Control(_) => parameters.into(),
            Self::Computation(_) => shown(recording),
            _ => return self,
        };
        Self::At { place, error: Box::new(self) }
    }
}

/// The text of an error with its long numbers shortened: scientific notation, and single precision with its own digits. The laws' errors are those of a microcontroller, which spends no memory on that.
pub fn short(error: &impl fmt::Display) -> String {
    const MAX_DIGITS: usize = 12;
    let text = error.to_string();
    let is_digit = |c: char| c.is_ascii_digit() || c == '.';
    let mut short = String::new();
    let mut rest = text.as_str();
    while let Some(start) = rest.find(is_digit) {
        let (before, number) = rest.split_at(start);
        let (number, after) = number.split_at(number.find(|c| !is_digit(c)).unwrap_or(number.len()));
        short.push_str(before);
        match number.parse::<f64>() {
            Ok(value) if number.len() > MAX_DIGITS => {
                let single = value as f32;
                let digits = if f64::from(single) == value { format!("{single:?}") } else { format!("{value:?}") };
                short.push_str(&digits);
            }
            _ => short.push_str(number),
        }
        rest = after;
    }
    short + rest
}

/// The `text` of an error or a warning with the names that `name` gives for the fields in it.
pub fn with_names(text: &str, name: impl Fn(&str) -> Option<String>) -> String {
    let mut named = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('`') {
        named.push_str(before);
        let is_field =
            |field: &str| !field.is_empty() && field.bytes().all(|b| matches!(b, b'a'..=b'z' | b'0'..=b'9' | b'_'));
        let field = after.split_once('`').filter(|(field, _)| is_field(field));
        let (name, after) = field.and_then(|(field, after)| Some((name(field)?, after))).unwrap_or(("`".into(), after));
        named.push_str(&name);
        rest = after;
    }
    named + rest
}

/// A path for an error or a report: on one line, control characters escaped.
pub fn shown(path: &Path) -> String {
    let name = path.display().to_string();
    if name.contains(char::is_control) { name.escape_debug().to_string() } else { name }
}
