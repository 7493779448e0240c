//! Digests that identify the files that were read.

use std::fs;
use std::path::Path;

use sha2::{Digest, Sha256};

use crate::error::{Error, Result};

/// SHA-256 of the file at `path`, in hexadecimal digits.
pub fn sha256(path: &Path) -> Result<String> {
    fs::read(path).map(|bytes| of_bytes(&bytes)).map_err(|e| Error::file(path, e))
}

/// SHA-256 of `bytes`, in hexadecimal digits.
pub(super) fn of_bytes(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}
