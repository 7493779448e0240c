//! Rows that reach the disk while they are measured: what a program that is killed has seen is not lost.

use std::fs::{self, File};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::error::{Error, Result, shown};
use crate::files::output::{self, Folders};
use crate::terminal;

/// Rows wait this long at the most.
const FLUSH_EVERY: Duration = Duration::from_secs(1);

/// A CSV file that grows beside its target, as `NAME.part`, and gets the target's name at the end.
#[derive(Debug)]
pub struct Journal {
    target: PathBuf,
    part: PathBuf,
    rows: BufWriter<File>,
    flushed: Instant,
}

/// Rows of an earlier program that was killed.
#[derive(Debug, PartialEq, Eq)]
pub struct Recovered {
    /// Where they are kept.
    pub path: PathBuf,
    /// How many they are.
    pub rows: usize,
}

impl Journal {
    /// Begins a file for `target` with these columns. What an earlier program has left half written is kept under a name of its
    /// own.
    ///
    /// # Errors
    ///
    /// [`Error::File`] where nothing can be written beside `target`.
    pub fn begin(target: &Path, columns: &[&str]) -> Result<(Self, Option<Recovered>)> {
        output::check(target, &[], Folders::Exist)?;
        // A link stays, and its target is replaced.
        let target = target.canonicalize().unwrap_or_else(|_| target.into());
        let mut name = target.file_name().unwrap_or_default().to_owned();
        name.push(".part");
        let part = target.with_file_name(name);
        let header = columns.join(",");
        let recovered = recover(&part, &target, &header)?;
        let file = File::create_new(&part).map_err(|e| Error::file(&part, e))?;
        // Until this program ends, however it ends.
        file.lock().map_err(|e| Error::file(&part, e))?;
        let mut journal = Self { target, part, rows: BufWriter::new(file), flushed: Instant::now() };
        let fault = |e| Error::file(&journal.part, e);
        writeln!(journal.rows, "{header}").and_then(|()| journal.rows.flush()).map_err(fault)?;
        Ok((journal, recovered))
    }

    /// The same; what an earlier program has left is reported.
    ///
    /// # Errors
    ///
    /// As [`Self::begin`].
    pub fn begin_and_report(target: &Path, columns: &[&str]) -> Result<Self> {
        let (journal, recovered) = Self::begin(target, columns)?;
        if let Some(Recovered { path, rows }) = recovered {
            let (target, path) = (shown(target), shown(&path));
            terminal::message(format!("an earlier run for {target} was killed: its {rows} samples are kept in {path}"));
        }
        Ok(journal)
    }

    /// Adds a row; a value that is not a number leaves its cell empty.
    pub fn push(&mut self, row: &[f64]) -> Result<()> {
        let cells: Vec<String> =
            row.iter().map(|value| if value.is_nan() { String::new() } else { value.to_string() }).collect();
        writeln!(self.rows, "{}", cells.join(",")).map_err(|e| Error::file(&self.part, e))
    }

    /// Flushes what has waited for long enough.
    pub fn flush_if_due(&mut self) -> Result<()> {
        if self.flushed.elapsed() >= FLUSH_EVERY {
            self.flushed = Instant::now();
            self.rows.flush().map_err(|e| Error::file(&self.part, e))?;
        }
        Ok(())
    }

    /// Gives the file its name.
    ///
    /// # Errors
    ///
    /// [`Error::File`] where that fails; the rows stay in `NAME.part`.
    pub fn finish(mut self) -> Result<()> {
        self.rows.flush().map_err(|e| Error::file(&self.part, e))?;
        fs::rename(&self.part, &self.target).map_err(|e| Error::file(&self.part, e))
    }

    /// Leaves the target as it is.
    pub fn discard(self) -> Result<()> {
        fs::remove_file(&self.part).map_err(|e| Error::file(&self.part, e))
    }
}

const FOREIGN: &str = "is not what this tool has left half written; move it away, or name another `out`";

/// Keeps the complete rows of `part`, if there are any, in a file of their own.
fn recover(part: &Path, target: &Path, header: &str) -> Result<Option<Recovered>> {
    let fault = |e| Error::file(part, e);
    match fs::symlink_metadata(part) {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Ok(found) if found.is_file() => {}
        _ => return Err(Error::file(part, FOREIGN)),
    }
    let file = File::open(part).map_err(fault)?;
    if file.try_lock().is_err() {
        return Err(Error::file(part, "in use by another springpot: choose another `out`"));
    }
    let bytes = fs::read(part).map_err(fault)?;
    if !header.as_bytes().starts_with(bytes.get(..header.len()).unwrap_or(&bytes)) {
        return Err(Error::file(part, FOREIGN));
    }
    // The last row may have been cut in two.
    let end = bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |last| last + 1);
    let rows = bytes[..end].iter().filter(|&&byte| byte == b'\n').count().saturating_sub(1);
    if rows == 0 {
        fs::remove_file(part).map_err(fault)?;
        return Ok(None);
    }
    let stem = target.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let named = |index: u32| target.with_file_name(format!("{stem}.recovered-{index}.csv"));
    let path = (1..).map(named).find(|path| !path.exists()).unwrap_or_else(|| named(0));
    output::write_whole(&path, |out| out.write_all(&bytes[..end]))?;
    fs::remove_file(part).map_err(fault)?;
    Ok(Some(Recovered { path, rows }))
}
