//! Files that are written completely or not at all.

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::{Error, Result, shown};
use crate::interrupt::HalfWritten;
use crate::terminal;

/// Refuses, before long work begins, a file that could not be written later or that is one of `inputs`. With
/// [`Folders::AreMade`] missing folders are no fault.
pub fn check(path: &Path, inputs: &[&Path], made: Folders) -> Result<()> {
    if path.as_os_str() == "-" {
        return Err(Error::file(path, "is no file: results are written to files; name one"));
    }
    if let Ok(target) = path.canonicalize()
        && let Some(input) = inputs.iter().find(|input| input.canonicalize().is_ok_and(|input| input == target))
    {
        return Err(Error::file(path, format!("would overwrite {}, which is read", shown(input))));
    }
    if let Ok(there) = fs::metadata(path) {
        if there.is_dir() {
            return Err(Error::file(path, "is a directory; name a file to write"));
        }
        if !there.is_file() {
            return Err(Error::file(path, "is a device or a pipe; name a file to write"));
        }
        if there.permissions().readonly() {
            return Err(Error::file(path, "is write-protected; name another file"));
        }
        fs::OpenOptions::new().append(true).open(path).map_err(|e| Error::file(path, e))?;
    }
    let folder = match made {
        Folders::Exist => folder_of(path),
        Folders::AreMade => path.ancestors().skip(1).find(|folder| folder.exists()).unwrap_or(Path::new(".")),
    };
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    if folder.is_file() {
        return Err(Error::file(path, format!("{} is a file, not a folder; name another one", shown(folder))));
    }
    if !folder.is_dir() {
        return Err(Error::file(path, format!("there is no folder {}; make it first", shown(folder))));
    }
    tempfile::tempfile_in(folder).map(drop).map_err(|e| Error::file(path, e))
}

/// Folders of an output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Folders {
    /// They must exist.
    Exist,
    /// Missing ones are made when the output is written.
    AreMade,
}

/// A complete file that has not been moved to its path yet.
#[derive(Debug)]
pub struct Staged {
    file: NamedTempFile,
    /// As it was asked for.
    path: PathBuf,
    /// The file that it is or links to.
    target: PathBuf,
    half_written: HalfWritten,
}

impl Staged {
    /// Writes the file for `path` through `fill`.
    ///
    /// # Errors
    ///
    /// [`Error::File`] where it cannot be written; nothing is left behind.
    pub fn new(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<Self> {
        check(path, &[], Folders::Exist)?;
        let fault = |e: io::Error| Error::file(path, e);
        // A link stays, and its target is replaced.
        let target = path.canonicalize().unwrap_or_else(|_| path.into());
        let mut builder = tempfile::Builder::new();
        #[cfg(unix)]
        {
            // As any other new file: the umask takes from this.
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(fs::Permissions::from_mode(0o666));
        }
        let mut file = builder.prefix(".host-sim-").tempfile_in(folder_of(&target)).map_err(fault)?;
        let half_written = HalfWritten::new(file.path());
        {
            let mut writer = BufWriter::new(file.as_file_mut());
            fill(&mut writer).and_then(|()| writer.flush()).map_err(fault)?;
        }
        Ok(Self { file, path: path.into(), target, half_written })
    }

    /// Path of the complete file, as it was asked for.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Moves the file to its path.
    pub fn commit(self) -> Result<()> {
        self.file.persist(&self.target).map_err(|e| Error::file(&self.path, e.error))?;
        drop(self.half_written);
        Ok(())
    }
}

/// Writes a file through `fill`. It appears at `path` once it is complete, and not at all if anything fails.
pub fn write_whole(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    Staged::new(path, fill)?.commit()
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Writes columns of equal length as CSV; a column of `None`, or a value that is not a number,
/// leaves its cells empty. Nothing but the header is above them, which other programs expect by default.
pub fn write_columns(path: &Path, columns: &[(&str, Option<&[f64]>)]) -> Result<()> {
    stage_columns(path, columns)?.commit()
}

/// The same, staged.
pub fn stage_columns(path: &Path, columns: &[(&str, Option<&[f64]>)]) -> Result<Staged> {
    let rows = columns.iter().filter_map(|(_, values)| values.map(<[f64]>::len)).max().unwrap_or(0);
    stage_rows(path, columns, 0..rows)
}

/// Those `rows` of the columns, staged; a large file is announced before it is written.
///
/// # Errors
///
/// As [`Staged::new`], and where the disk has no room for it.
pub fn stage_rows(
    path: &Path,
    columns: &[(&str, Option<&[f64]>)],
    rows: impl ExactSizeIterator<Item = usize> + Clone,
) -> Result<Staged> {
    const SAMPLE: usize = 1000;
    let write = |out: &mut dyn Write, row: usize| -> io::Result<()> {
        for (index, (_, values)) in columns.iter().enumerate() {
            if index > 0 {
                out.write_all(b",")?;
            }
            // What was not measured is an empty cell.
            if let Some(value) = values.and_then(|values| values.get(row)).filter(|value| !value.is_nan()) {
                write!(out, "{value}")?;
            }
        }
        out.write_all(b"\n")
    };
    // A file of that many rows, from rows of all of its parts.
    let mut sample = Vec::new();
    for row in rows.clone().step_by((rows.len() / SAMPLE).max(1)).take(SAMPLE) {
        write(&mut sample, row).map_err(|e| Error::file(path, e))?;
    }
    let bytes = sample.len() as f64 / rows.len().clamp(1, SAMPLE) as f64 * rows.len() as f64;
    if let Some(notice) = size_notice(bytes, free_bytes(folder_of(path))).map_err(|cause| Error::file(path, cause))? {
        terminal::message(format!("{}: {notice}", shown(path)));
    }
    Staged::new(path, |out| {
        let names: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
        writeln!(out, "{}", names.join(","))?;
        rows.into_iter().try_for_each(|row| write(out, row))
    })
}

/// The announcement of a file of so many `bytes`, if it is large, on a disk with so many `free` ones.
///
/// # Errors
///
/// The refusal of a file that the disk has no room for.
pub fn size_notice(bytes: f64, free: Option<u64>) -> std::result::Result<Option<String>, String> {
    const LARGE: f64 = 500e6;
    let shown = size(bytes);
    match free {
        Some(free) if bytes > free as f64 => {
            let free = size(free as f64);
            Err(format!("needs about {shown}, the disk has {free}; write fewer rows or to another disk"))
        }
        _ if bytes > LARGE => Ok(Some(format!("about {shown} are written"))),
        _ => Ok(None),
    }
}

/// So many `bytes` with their unit.
fn size(bytes: f64) -> String {
    let units = [("GB", 1e9), ("MB", 1e6)];
    let (unit, each) = units.into_iter().find(|(_, each)| bytes >= 0.1 * each).unwrap_or(("kB", 1e3));
    format!("{:.1} {unit}", bytes / each)
}

/// Bytes that the disk of `folder` has for its user; none where the system does not say.
fn free_bytes(folder: &Path) -> Option<u64> {
    #[cfg(unix)]
    return rustix::fs::statvfs(folder).ok().map(|disk| disk.f_bavail.saturating_mul(disk.f_frsize));
    #[cfg(not(unix))]
    return {
        let _ = folder;
        None
    };
}

/// A folder for results. If it was made here and is still empty when this is dropped, it is removed again: a run that is refused, or
/// that finds the disk full, leaves nothing behind.
#[derive(Debug)]
#[must_use]
pub struct Folder {
    /// The folders that were made, the outermost first.
    made: Vec<(PathBuf, HalfWritten)>,
}

impl Folder {
    /// The folder at `path`; it and those around it are made where they are missing.
    pub fn at(path: &Path) -> Result<Self> {
        if path.is_file() {
            return Err(Error::file(path, "is a file; name a folder"));
        }
        let missing: Vec<&Path> =
            path.ancestors().take_while(|folder| !folder.as_os_str().is_empty() && !folder.exists()).collect();
        let mut folder = Self { made: Vec::new() };
        for missing in missing.into_iter().rev() {
            match fs::create_dir(missing) {
                Ok(()) => folder.made.push((missing.into(), HalfWritten::new(missing))),
                // Another process was faster, or the path names one twice.
                Err(_) if missing.is_dir() => {}
                Err(e) => return Err(Error::file(missing, e)),
            }
        }
        Ok(folder)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        while let Some((path, _half_written)) = self.made.pop() {
            // Only an empty one can be removed.
            let _ = fs::remove_dir(path);
        }
    }
}
