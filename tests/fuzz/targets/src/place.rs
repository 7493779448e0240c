//! The place of a fault in an error message.

use std::path::Path;

use host_io::Error;

/// Names in errors.
pub const PATH: &str = "fuzzed";

/// The line that `error` names, if it is about one. Any error names the file in its text, on one line.
pub fn line_of(error: &Error) -> Option<u64> {
    let shown = error.to_string();
    assert!(!shown.contains(['\n', '\r']), "more than one line: {shown:?}");
    assert!(shown.starts_with(PATH), "no place: {shown:?}");
    match error {
        Error::Line { path, line, cause } => {
            assert_eq!(path, Path::new(PATH));
            assert!(!cause.is_empty() && shown == format!("{PATH}:{line}: {cause}"), "{shown:?}");
            Some(*line)
        }
        Error::File { cause, .. } => {
            assert!(!cause.is_empty(), "no cause: {shown:?}");
            None
        }
        other => panic!("neither a file nor a line: {other}"),
    }
}
