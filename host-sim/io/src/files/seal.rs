//! Records that are sealed together with their files: a change of any byte shows.
//!
//! A record is a JSON object. Its last keys are `files`, each with its digest and the link of a chain over all files before it, and `seal`, the
//! digest of every byte of the record before that key. Who changes a record can seal it again; a signature beside it says who vouches for it.

use std::path::{Path, PathBuf};

use minisign_verify::{PublicKey, Signature};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::{bounded, digest, output};
use crate::error::{Error, Result};

const KEY: &str = ",\"seal\":\"";
const END: &str = "\"}\n";
/// Hexadecimal digits of SHA-256.
const DIGITS: usize = 64;
/// Largest record, and largest key or signature, in bytes.
const MAX_RECORD: u64 = 1 << 26;
const MAX_KEY: u64 = 1 << 16;

/// A file of a record.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SealedFile {
    /// Its name, in the folder of the record.
    pub file: String,
    /// Its SHA-256.
    pub sha256: String,
    /// SHA-256 of the link before, its name and its digest.
    pub chain: String,
}

/// The chain over `files`.
pub fn chain(files: &[PathBuf]) -> Result<Vec<SealedFile>> {
    let mut before = String::new();
    let link = |path: &PathBuf| {
        let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        // A device has no end.
        if path.metadata().is_ok_and(|there| !there.is_file()) {
            return Err(Error::file(path, "is not a file; take the original"));
        }
        let sha256 = digest::sha256(path)?;
        before = digest::of_bytes(format!("{before}\n{file}\n{sha256}").as_bytes());
        Ok(SealedFile { file, sha256, chain: before.clone() })
    };
    files.iter().map(link).collect()
}

/// Writes `record` (an object) to `path`, sealed with `files`, which are in the same folder.
pub fn write(path: &Path, record: &impl Serialize, files: &[PathBuf]) -> Result<()> {
    let fault = |e: serde_json::Error| Error::file(path, e);
    let body = serde_json::to_string(record).map_err(fault)?;
    let files = serde_json::to_string(&chain(files)?).map_err(fault)?;
    let Some(open) = body.strip_suffix('}').filter(|body| body.len() > 1) else {
        return Err(Error::file(path, "the record is not an object with a key"));
    };
    let sealed = format!("{open},\"files\":{files}");
    let seal = digest::of_bytes(sealed.as_bytes());
    output::write_whole(path, |file| file.write_all(format!("{sealed}{KEY}{seal}{END}").as_bytes()))
}

/// The record at `path`, if neither it nor a file of it was changed since it was sealed.
///
/// # Errors
///
/// [`Error::File`] naming the file that was changed, or that cannot be read.
pub fn verify(path: &Path) -> Result<Map<String, Value>> {
    let bytes = bounded::read(path, MAX_RECORD, "a record")?;
    let changed = || Error::file(path, "was changed since it was sealed, or is no record; take the original");
    let text = String::from_utf8(bytes).map_err(|_| changed())?;
    let at = text.len().checked_sub(KEY.len() + DIGITS + END.len()).ok_or_else(changed)?;
    let sealed = text.get(..at).ok_or_else(changed)?;
    if text[at..] != format!("{KEY}{}{END}", digest::of_bytes(sealed.as_bytes())) {
        return Err(changed());
    }
    let record: Map<String, Value> = serde_json::from_str(&text).map_err(|e| Error::file(path, e))?;
    let files: Vec<SealedFile> = record
        .get("files")
        .and_then(|files| serde_json::from_value(files.clone()).ok())
        .ok_or_else(|| Error::file(path, "has no list of files; it is no record"))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let paths: Vec<PathBuf> = files.iter().map(|file| folder.join(&file.file)).collect();
    for ((file, found), path) in files.iter().zip(chain(&paths)?).zip(&paths) {
        // A name that leads elsewhere is another one here.
        if *file != found {
            return Err(Error::file(path, "was changed since the record was sealed; take the original"));
        }
    }
    Ok(record)
}

/// Checks the signature of the record at `path` with a public `key`, and returns its trusted comment. Both are files of minisign; that of the
/// signature has the record's name and `.minisig`.
///
/// # Errors
///
/// [`Error::File`] for a file that cannot be read or is of another kind, and for a signature of another file or by another key.
pub fn signed(path: &Path, key: &Path) -> Result<String> {
    let text = |path: &Path, kind: &str| {
        Ok::<_, Error>(String::from_utf8_lossy(&bounded::read(path, MAX_KEY, kind)?).into_owned())
    };
    let mut name = path.as_os_str().to_owned();
    name.push(".minisig");
    let beside = Path::new(&name);
    let public = PublicKey::decode(&text(key, "a public key of minisign")?).map_err(|_| {
        Error::file(key, "is no public key of minisign; give the file that `minisign -G` wrote as .pub")
    })?;
    if !beside.exists() {
        return Err(Error::file(beside, "there is no signature beside the record; `minisign -S` writes one"));
    }
    let signature = Signature::decode(&text(beside, "a signature of minisign")?)
        .map_err(|_| Error::file(beside, "is no signature of minisign; sign the record again with `minisign -S`"))?;
    public.verify(&bounded::read(path, MAX_RECORD, "a record")?, &signature, false).map_err(|_| {
        Error::file(beside, format!("is no signature of {} by the key in {}", path.display(), key.display()))
    })?;
    Ok(signature.trusted_comment().to_owned())
}
