//! Digests that identify the files that were read.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use sha2::{Digest, Sha256};

use crate::error::{Error, Result};

/// SHA-256 of the file at `path`, in hexadecimal digits.
pub fn sha256(path: &Path) -> Result<String> {
    let bytes = fs::read(path).map_err(|e| Error::file(path, e))?;
    Ok(Sha256::digest(&bytes).iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    }))
}
