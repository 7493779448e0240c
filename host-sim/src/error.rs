//! Errors: one line each, naming the place and the mend.

use std::path::{Path, PathBuf};

use springpot::{ActuatorError, LawError, ModelError};

/// A result of this library.
pub type Result<T> = std::result::Result<T, Error>;

/// What can be wrong, as one line.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A file that cannot be read or written.
    #[error("{}: {cause}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system says, or what is wrong with it as a whole.
        cause: String,
    },
    /// A line of a file that cannot be used.
    #[error("{}:{line}: {cause}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, counted from one.
        line: u64,
        /// What is wrong, and what would be right.
        cause: String,
    },
    /// A command line that cannot be understood.
    #[error("{0}")]
    Usage(String),
    /// An option that cannot be used.
    #[error("{option}: {cause}")]
    Option {
        /// The option as the user writes it.
        option: &'static str,
        /// What is wrong, and what would be right.
        cause: String,
    },
    /// A model that was refused.
    #[error("model: {0}")]
    Model(#[from] ModelError),
    /// A law that was refused.
    #[error("law: {0}")]
    Law(#[from] LawError),
    /// An actuator that was refused.
    #[error("actuator: {0}")]
    Actuator(#[from] ActuatorError),
    /// A computation that gave no answer.
    #[error("{0}")]
    Computation(String),
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
    pub fn option(option: &'static str, cause: impl Into<String>) -> Self {
        Self::Option { option, cause: cause.into() }
    }
}
