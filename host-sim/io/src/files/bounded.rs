//! Files that are read as a whole, up to a size that none of their kind has: a device has no end.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use crate::error::{Error, Result};

/// Bytes of the beginning, which has none of 0 in text.
const HEAD: u64 = 1 << 16;

/// Returns the bytes of the file at `path`, of which `kind` has at most `max`.
pub(crate) fn read(path: &Path, max: u64, kind: &str) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    read_on(path, &mut open(path, kind)?, &mut bytes, max, kind)?;
    Ok(bytes)
}

/// The same as text: UTF-8, without bytes of 0 at its beginning.
pub(crate) fn read_text(path: &Path, max: u64, kind: &str) -> Result<String> {
    let (mut file, mut bytes) = (open(path, kind)?, Vec::new());
    file.by_ref().take(HEAD).read_to_end(&mut bytes).map_err(|error| Error::file(path, error))?;
    let not_text = |text: &[u8]| {
        let line = 1 + text.iter().filter(|byte| **byte == b'\n').count();
        Error::line(path, line as u64, format!("not UTF-8 text; this is not {kind}"))
    };
    // Before all of it is read.
    if let Some(end) = bytes.iter().position(|byte| *byte == 0) {
        return Err(not_text(&bytes[..end]));
    }
    read_on(path, &mut file, &mut bytes, max, kind)?;
    String::from_utf8(bytes).map_err(|error| not_text(&error.as_bytes()[..error.utf8_error().valid_up_to()]))
}

/// Opens the file at `path`, which is `kind`.
pub(crate) fn open(path: &Path, kind: &str) -> Result<File> {
    if path.is_dir() {
        return Err(Error::file(path, format!("is a directory; name {kind} in it")));
    }
    File::open(path).map_err(|error| Error::file(path, error))
}

/// Reads the rest of `file` behind `bytes`.
fn read_on(path: &Path, file: &mut File, bytes: &mut Vec<u8>, max: u64, kind: &str) -> Result<()> {
    // A pipe has no length beforehand.
    let rest = (max + 1).saturating_sub(bytes.len() as u64);
    file.take(rest).read_to_end(bytes).map_err(|error| Error::file(path, error))?;
    if bytes.len() as u64 > max {
        return Err(Error::file(path, format!("more than {max} bytes; this is not {kind}")));
    }
    Ok(())
}
