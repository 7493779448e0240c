//! An FMU as an archive, with a library for this machine where there is a compiler.

use std::fs;
use std::io::{Cursor, Write};
use std::path::Path;
use std::process::Command;

use host_io::error::shown;
use host_io::{Error, Result};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use crate::fmu::{Fmu, Version};

/// Compiled library of an FMU's sources.
#[derive(Default)]
pub(super) struct Library {
    /// Platform of the library.
    pub(super) platform: Option<&'static str>,
    /// Reason why there is no library.
    pub(super) note: Option<String>,
    /// Its path within the archive, and its bytes.
    file: Option<(String, Vec<u8>)>,
}

/// Compilers, the first that is there.
const COMPILERS: [&str; 2] = ["gcc", "cc"];

/// No debug information, no symbols but the functions of the standard: nothing of this machine gets into the library but its compiler.
const OPTIONS: [&str; 7] = ["-std=c99", "-O2", "-fPIC", "-shared", "-fvisibility=hidden", "-s", "-o"];

impl Library {
    /// The library of `fmu`, whose identifier is `symbol`. Without a compiler there is a note instead.
    pub(super) fn new(fmu: &Fmu, symbol: &str, version: Version) -> Result<Self> {
        let without = |why: String| {
            let note = format!("{why}: the FMU has its sources alone, and is to be compiled where it is used");
            Self { note: Some(note), ..Self::default() }
        };
        if !cfg!(all(target_os = "linux", target_arch = "x86_64")) {
            return Ok(without("libraries are compiled on Linux for x86-64 alone".into()));
        }
        let folder = tempfile::tempdir().map_err(|e| {
            Error::Computation(format!("no folder for sources: {e}; set TMPDIR to a folder that can be written"))
        })?;
        for (path, text) in &fmu.files {
            if let Some(name) = path.strip_prefix("sources/") {
                let path = folder.path().join(name);
                fs::write(&path, text).map_err(|e| Error::file(&path, e))?;
            }
        }
        let name = format!("{symbol}.so");
        let compiled = COMPILERS.iter().find_map(|compiler| {
            let mut command = Command::new(compiler);
            command.current_dir(folder.path()).args(OPTIONS).arg(&name).args(&fmu.compiled).arg("-lm");
            Some((compiler, command.output().ok()?))
        });
        let Some((compiler, output)) = compiled else {
            return Ok(without(format!("there is no C compiler ({})", COMPILERS.join(", "))));
        };
        if !output.status.success() {
            let errors = String::from_utf8_lossy(&output.stderr);
            let first = errors.lines().find(|line| line.contains("error")).unwrap_or("no reason given");
            return Ok(without(format!("{compiler} failed ({first})")));
        }
        let path = folder.path().join(&name);
        let bytes = fs::read(&path).map_err(|e| Error::file(&path, e))?;
        let (folder, platform) = match version {
            Version::Fmi2 => ("linux64", "Linux on x86-64"),
            Version::Fmi3 => ("x86_64-linux", "Linux on x86-64"),
        };
        Ok(Self { platform: Some(platform), note: None, file: Some((format!("binaries/{folder}/{name}"), bytes)) })
    }
}

/// The bytes of the FMU for `out`: the same for the same content, since they do not depend on when and where it was written.
pub(super) fn archive(fmu: &Fmu, library: &Library, out: &Path) -> Result<Vec<u8>> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(DateTime::default())
        .unix_permissions(0o644);
    let texts = fmu.files.iter().map(|(path, text)| (path, text.as_bytes()));
    let all = texts.chain(library.file.iter().map(|(path, bytes)| (path, bytes.as_slice())));
    let written = || {
        let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
        for (path, content) in all {
            zip.start_file(path.as_str(), options)?;
            zip.write_all(content)?;
        }
        Ok(zip.finish()?.into_inner())
    };
    written().map_err(|e: zip::result::ZipError| Error::Computation(format!("{}: {e}", shown(out))))
}
