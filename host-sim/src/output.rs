//! Files that are written whole or not at all, and progress on the terminal.

use std::fs;
use std::io::{self, BufWriter, IsTerminal, Write};
use std::path::Path;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;

use crate::error::{Error, Result};

/// Writes a file through `fill`; it appears at `path` when it is complete, and not at all if anything fails.
///
/// # Errors
///
/// [`Error::File`] where the file cannot be written.
pub fn write_whole(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<()> {
    let fault = |e: io::Error| Error::file(path, e);
    if path.is_dir() {
        return Err(Error::file(path, "is a directory; name a file to write"));
    }
    let folder = folder_of(path);
    if !folder.is_dir() {
        return Err(Error::file(path, format!("there is no folder {}; make it first", folder.display())));
    }
    let mut builder = tempfile::Builder::new();
    #[cfg(unix)]
    {
        // As any other new file: the umask takes from this.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    let mut file = builder.prefix(".host-sim-").tempfile_in(folder).map_err(fault)?;
    {
        let mut writer = BufWriter::new(file.as_file_mut());
        fill(&mut writer).and_then(|()| writer.flush()).map_err(fault)?;
    }
    file.persist(path).map_err(|e| fault(e.error))?;
    Ok(())
}

/// Refuses a file that could not be written later, before long work begins.
///
/// # Errors
///
/// [`Error::File`] where the folder is missing or closed, or the path is a folder itself.
pub fn check_writable(path: &Path) -> Result<()> {
    if path.is_dir() {
        return Err(Error::file(path, "is a directory; name a file to write"));
    }
    let folder = folder_of(path);
    if !folder.is_dir() {
        return Err(Error::file(path, format!("there is no folder {}; make it first", folder.display())));
    }
    tempfile::Builder::new().prefix(".host-sim-").tempfile_in(folder).map(drop).map_err(|e| Error::file(path, e))
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Writes columns of equal length as CSV; a column of `None` leaves its cells empty.
///
/// # Errors
///
/// As [`write_whole`].
pub fn write_columns(path: &Path, comments: &[String], columns: &[(&str, Option<&[f64]>)]) -> Result<()> {
    write_whole(path, |out| {
        for comment in comments {
            writeln!(out, "# {comment}")?;
        }
        let names: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
        writeln!(out, "{}", names.join(","))?;
        let rows = columns.iter().filter_map(|(_, values)| values.map(<[f64]>::len)).max().unwrap_or(0);
        for row in 0..rows {
            for (index, (_, values)) in columns.iter().enumerate() {
                if index > 0 {
                    out.write_all(b",")?;
                }
                if let Some(value) = values.and_then(|values| values.get(row)) {
                    write!(out, "{value}")?;
                }
            }
            out.write_all(b"\n")?;
        }
        Ok(())
    })
}

/// Makes a folder for results, if it is not there.
///
/// # Errors
///
/// [`Error::File`] where it cannot be made.
pub fn make_folder(path: &Path) -> Result<()> {
    fs::create_dir_all(path).map_err(|e| Error::file(path, e))
}

/// Prints `text` on standard output. A reader that has gone away is no error.
pub fn print(text: &str) {
    let mut out = io::stdout().lock();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.write_all(b"\n")).and_then(|()| out.flush());
}

/// Prints `document` as JSON, or else `text`.
pub fn report<D: Serialize>(json: bool, document: &D, text: impl FnOnce() -> String) {
    if json {
        // Documents are plain structs of numbers and strings, which serialise always.
        print(&serde_json::to_string(document).unwrap_or_default());
    } else {
        print(&text());
    }
}

/// A progress bar over `length` units of work: on standard error, and only where that is a terminal.
pub fn progress(length: u64, what: &str) -> ProgressBar {
    let target = if io::stderr().is_terminal() { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
    let bar = ProgressBar::with_draw_target(Some(length), target).with_message(what.to_owned());
    if let Ok(style) = ProgressStyle::with_template("{msg} [{bar:30}] {percent:>3} % {eta}") {
        bar.set_style(style.progress_chars("=> "));
    }
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}

/// A sign of life for work of unknown length: on standard error, and only where that is a terminal.
pub fn spinner() -> ProgressBar {
    let target = if io::stderr().is_terminal() { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
    let bar = ProgressBar::with_draw_target(None, target);
    if let Ok(style) = ProgressStyle::with_template("{spinner} {msg} {elapsed}") {
        bar.set_style(style);
    }
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}
