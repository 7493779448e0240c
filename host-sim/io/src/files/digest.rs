//! Digests that identify the files that were read.

use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::path::Path;

use sha2::{Digest, Sha256};

use crate::error::{Error, Result};

/// Bytes that are read at once.
const BLOCK: usize = 1 << 16;

/// SHA-256 of the file at `path`, in hexadecimal digits.
pub fn sha256(path: &Path) -> Result<String> {
    let fault = |e: io::Error| Error::file(path, e);
    let mut hasher = Sha256::new();
    let mut file = BufReader::with_capacity(BLOCK, File::open(path).map_err(fault)?);
    loop {
        let block = file.fill_buf().map_err(fault)?;
        if block.is_empty() {
            return Ok(hexadecimal(&hasher.finalize()));
        }
        hasher.update(block);
        let length = block.len();
        file.consume(length);
    }
}

/// SHA-256 of `bytes`, in hexadecimal digits.
pub(super) fn of_bytes(bytes: &[u8]) -> String {
    hexadecimal(&Sha256::digest(bytes))
}

fn hexadecimal(digest: &[u8]) -> String {
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}
