//! Findings about recordings.

use serde::Serialize;

/// Something that is wrong with recordings.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// How bad it is.
    pub severity: Severity,
    /// The file; none where it is about all of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// The problem.
    pub finding: String,
    /// The action, or the recording to make instead; empty where the finding says it.
    pub advice: String,
}

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// A film is not identified.
    Prevents,
    /// It is, with more error or wider intervals.
    Weakens,
}
