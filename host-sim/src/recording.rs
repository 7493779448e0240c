//! Recordings: CSV files of what was applied and what was measured.
//!
//! A header names the columns with their units; unknown columns are ignored and lines that begin with `#` are comments.
//! A file is checked as it is read: the first thing that is wrong ends the reading and names its line.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};
use crate::series::Grid;

/// A recording in SI units, time from its first sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    path: PathBuf,
    time_s: Vec<f64>,
    voltage_v: Option<Column>,
    force_n: Option<Column>,
    displacement_m: Option<Column>,
}

/// One quantity over the rows of a recording; a cell may be empty where nothing was measured.
#[derive(Clone, Debug, PartialEq)]
struct Column {
    name: &'static str,
    cells: Vec<Option<f64>>,
    /// Line of the first empty cell.
    first_gap: Option<u64>,
}

/// Samples of one quantity at their times.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Samples {
    /// Times in seconds from the recording's first sample, increasing.
    pub time_s: Vec<f64>,
    /// Values in SI units.
    pub value: Vec<f64>,
}

/// What drives a run.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// Voltage on the electrodes, V.
    Voltage(Samples),
    /// Total force on the film, N.
    Force(Samples),
    /// Displacement of the film, m.
    Displacement(Samples),
}

/// No value is larger, in any unit.
const LARGEST: f64 = 1e15;

/// Column names with the factor to SI units.
const TIME: &[(&str, f64)] = &[("time_s", 1.0), ("time_ms", 1e-3)];
const VOLTAGE: &[(&str, f64)] = &[("voltage_v", 1.0), ("voltage_kv", 1e3)];
const FORCE: &[(&str, f64)] = &[("force_n", 1.0)];
const DISPLACEMENT: &[(&str, f64)] = &[("displacement_m", 1.0), ("displacement_mm", 1e-3), ("displacement_um", 1e-6)];

impl Recording {
    /// Reads the recording at `path`.
    ///
    /// # Errors
    ///
    /// [`Error`] naming the file and line of the first thing that cannot be used.
    pub fn read(path: &Path) -> Result<Self> {
        if path.is_dir() {
            return Err(Error::file(path, "is a directory; name a CSV recording in it"));
        }
        let file = File::open(path).map_err(|e| Error::file(path, e))?;
        Self::from_csv(path, file)
    }

    /// Reads a recording from CSV text; `path` is what errors name.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read).
    pub fn from_csv(path: &Path, csv: impl Read) -> Result<Self> {
        let mut reader = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .flexible(true)
            .from_reader(Lines::new(csv));
        let header = match reader.byte_headers() {
            Ok(header) => header.iter().map(|name| String::from_utf8_lossy(name).into_owned()).collect::<Vec<_>>(),
            Err(e) => return Err(csv_error(path, reader.get_ref(), &e)),
        };
        let header_line = reader.get_mut().next_record();

        let find = |names: &[(&'static str, f64)]| -> Result<Option<Field>> {
            let mut found = None;
            for &(name, factor) in names {
                for (index, _) in header.iter().enumerate().filter(|(_, column)| *column == name) {
                    if let Some(Field { name: other, .. }) = found {
                        let cause = format!("both {other} and {name}; leave one of them");
                        return Err(Error::line(path, header_line, cause));
                    }
                    found = Some(Field { name, index, factor });
                }
            }
            Ok(found)
        };
        let time = find(TIME)?
            .ok_or_else(|| Error::line(path, header_line, format!("no column {}", alternatives(&[TIME], &header))))?;
        let fields = [find(VOLTAGE)?, find(FORCE)?, find(DISPLACEMENT)?];
        if fields[0].is_none() && fields[1].is_none() {
            let cause = format!("no column {}", alternatives(&[VOLTAGE, FORCE], &header));
            return Err(Error::line(path, header_line, cause));
        }

        let mut time_s = Vec::new();
        let mut columns =
            fields.map(|field| field.map(|f| (f, Column { name: f.name, cells: Vec::new(), first_gap: None })));
        let mut record = csv::ByteRecord::new();
        loop {
            match reader.read_byte_record(&mut record) {
                Ok(true) => {}
                Ok(false) => break,
                Err(e) => return Err(csv_error(path, reader.get_ref(), &e)),
            }
            let line = reader.get_mut().next_record();
            let at = |cause: String| Error::line(path, line, cause);
            let now = time.number(&record).map_err(at)?;
            let now = now.ok_or_else(|| at(format!("no value for {}; every row needs its time", time.name)))?;
            if let Some(&before) = time_s.last()
                && now <= before
            {
                let way = if now < before { "goes backwards" } else { "stands still" };
                return Err(at(format!("{} {way} at {now} s; sort the rows and remove doubles", time.name)));
            }
            time_s.push(now);
            for (field, column) in columns.iter_mut().flatten() {
                let cell = field.number(&record).map_err(at)?;
                if cell.is_none() && column.first_gap.is_none() {
                    column.first_gap = Some(line);
                }
                column.cells.push(cell);
            }
        }
        if time_s.len() < 2 {
            return Err(Error::file(path, format!("{} data rows; a recording needs at least 2", time_s.len())));
        }
        let start = time_s[0];
        time_s.iter_mut().for_each(|t| *t -= start);
        let [voltage_v, force_n, displacement_m] = columns.map(|found| {
            // A column that is empty throughout is as good as none.
            found.map(|(_, column)| column).filter(|column| column.cells.iter().any(Option::is_some))
        });
        Ok(Self { path: path.into(), time_s, voltage_v, force_n, displacement_m })
    }

    /// Where the recording came from.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Length in seconds.
    pub fn duration_s(&self) -> f64 {
        self.time_s.last().copied().unwrap_or(0.0)
    }

    /// The grid at `rate_hz` that covers the recording.
    ///
    /// # Errors
    ///
    /// [`Error`] for a rate that is not positive and finite, or a recording that is too long for it.
    pub fn grid(&self, rate_hz: f64) -> Result<Grid> {
        Grid::covering(self.duration_s(), rate_hz)
            .map_err(|error| if rate_hz > 0.0 && rate_hz.is_finite() { Error::file(&self.path, error) } else { error })
    }

    /// What drove the film: the voltage, or the force where there is none.
    ///
    /// # Errors
    ///
    /// [`Error`] for a column with gaps.
    pub fn drive(&self) -> Result<Input> {
        match (&self.voltage_v, &self.force_n) {
            (Some(voltage), _) => Ok(Input::Voltage(self.complete(voltage)?)),
            (None, Some(force)) => Ok(Input::Force(self.complete(force)?)),
            (None, None) => Err(Error::file(&self.path, "neither voltage_v nor force_n has a value")),
        }
    }

    /// The displacement as a drive.
    ///
    /// # Errors
    ///
    /// [`Error`] where there is none or it has gaps.
    pub fn displacement_drive(&self) -> Result<Input> {
        let column = self.displacement_m.as_ref().ok_or_else(|| self.no_displacement())?;
        Ok(Input::Displacement(self.complete(column)?))
    }

    /// The measured displacement in m.
    ///
    /// # Errors
    ///
    /// [`Error`] where there is none.
    pub fn displacement(&self) -> Result<Samples> {
        self.displacement_m.as_ref().map(|column| self.present(column)).ok_or_else(|| self.no_displacement())
    }

    /// The force in N, where it was measured.
    pub fn force(&self) -> Option<Samples> {
        self.force_n.as_ref().map(|column| self.present(column))
    }

    /// The voltage in V, where it was measured.
    pub fn voltage(&self) -> Option<Samples> {
        self.voltage_v.as_ref().map(|column| self.present(column))
    }

    fn no_displacement(&self) -> Error {
        Error::file(&self.path, "no column displacement_m, displacement_mm or displacement_um with values")
    }

    fn present(&self, column: &Column) -> Samples {
        let pairs = self.time_s.iter().zip(&column.cells);
        let (time_s, value) = pairs.filter_map(|(&t, cell)| cell.map(|v| (t, v))).unzip();
        Samples { time_s, value }
    }

    fn complete(&self, column: &Column) -> Result<Samples> {
        if let Some(line) = column.first_gap {
            let cause = format!("{} is empty; what drives the film must be complete", column.name);
            return Err(Error::line(&self.path, line, cause));
        }
        Ok(self.present(column))
    }
}

/// A column of the file.
#[derive(Clone, Copy)]
struct Field {
    name: &'static str,
    index: usize,
    factor: f64,
}

impl Field {
    fn number(&self, record: &csv::ByteRecord) -> std::result::Result<Option<f64>, String> {
        let text = record.get(self.index).ok_or_else(|| format!("the row ends before {}", self.name))?;
        let text = String::from_utf8_lossy(text);
        if text.is_empty() {
            return Ok(None);
        }
        match text.parse::<f64>() {
            Ok(value) if value.abs() <= LARGEST => Ok(Some(value * self.factor)),
            Ok(value) if value.is_finite() => Err(format!("{} is {text}; no instrument reads that", self.name)),
            Ok(_) => Err(format!("{} is {text}; leave the cell empty where nothing was measured", self.name)),
            Err(_) => Err(format!("{} is {:?}, which is not a number", self.name, shortened(&text))),
        }
    }
}

fn alternatives(groups: &[&[(&str, f64)]], header: &[String]) -> String {
    let names: Vec<&str> = groups.iter().flat_map(|group| group.iter().map(|(name, _)| *name)).collect();
    format!("{}; the header is {:?}", names.join(" or "), shortened(&header.join(",")))
}

fn shortened(text: &str) -> String {
    const LONGEST: usize = 60;
    if text.chars().count() <= LONGEST { text.into() } else { text.chars().take(LONGEST).chain(['…']).collect() }
}

fn csv_error<R>(path: &Path, lines: &Lines<R>, error: &csv::Error) -> Error {
    match (&lines.fault, error.kind()) {
        (Some(fault), _) => Error::line(path, lines.line, *fault),
        (None, csv::ErrorKind::Io(e)) => Error::file(path, e),
        (None, _) => Error::file(path, error),
    }
}

/// A reader that gives a CSV reader lines as it likes them, and knows which line a record stood on.
///
/// Line ends of all systems become `\n`, a byte order mark is taken off, and text that can be no recording ends the
/// reading before it fills the memory. A CSV reader skips empty lines and comments, so every other line is a record.
struct Lines<R> {
    inner: R,
    /// The line that is being read, counted from one.
    line: u64,
    /// Bytes of it so far.
    length: usize,
    comment: bool,
    quoted: bool,
    /// The last byte was `\r`, so that `\n` would belong to it.
    carriage_return: bool,
    /// Lines of the records that were read and not asked for yet.
    records: VecDeque<u64>,
    fault: Option<&'static str>,
}

impl<R: Read> Lines<R> {
    fn new(inner: R) -> Lines<impl Read> {
        Lines {
            inner: WithoutMark { inner, start: None },
            line: 1,
            length: 0,
            comment: false,
            quoted: false,
            carriage_return: false,
            records: VecDeque::new(),
            fault: None,
        }
    }
}

impl<R> Lines<R> {
    /// The line of the next record, in their order.
    fn next_record(&mut self) -> u64 {
        self.records.pop_front().unwrap_or(self.line)
    }

    /// Takes note of `byte` and gives what the CSV reader is to see.
    fn take(&mut self, byte: u8) -> std::result::Result<u8, &'static str> {
        const LONGEST: usize = 1 << 16;
        let second_half = byte == b'\n' && self.carriage_return;
        self.carriage_return = byte == b'\r';
        if second_half {
            return Ok(b'\n');
        }
        if matches!(byte, b'\n' | b'\r') {
            if self.quoted {
                return Err("a quote is not closed on this line");
            }
            self.line += 1;
            (self.length, self.comment) = (0, false);
            return Ok(b'\n');
        }
        if self.length == 0 {
            self.comment = byte == b'#';
            if !self.comment {
                self.records.push_back(self.line);
            }
        }
        self.length += 1;
        self.quoted ^= byte == b'"' && !self.comment;
        if self.length > LONGEST {
            return Err("a line of more than 65536 characters; this is not a CSV recording");
        }
        Ok(byte)
    }
}

impl<R: Read> Read for Lines<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.inner.read(buffer)?;
        if n == 0 && self.quoted {
            self.fault = Some("a quote is not closed on this line");
            return Err(io::ErrorKind::InvalidData.into());
        }
        for byte in &mut buffer[..n] {
            *byte = self.take(*byte).map_err(|fault| {
                self.fault = Some(fault);
                io::Error::from(io::ErrorKind::InvalidData)
            })?;
        }
        Ok(n)
    }
}

/// A reader without the byte order mark that some programs put in front.
struct WithoutMark<R> {
    inner: R,
    start: Option<io::Cursor<Vec<u8>>>,
}

impl<R: Read> Read for WithoutMark<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        const MARK: &[u8] = b"\xef\xbb\xbf";
        let start = match &mut self.start {
            Some(start) => start,
            none => {
                let mut first = Vec::new();
                self.inner.by_ref().take(MARK.len() as u64).read_to_end(&mut first)?;
                if first == MARK {
                    first.clear();
                }
                none.insert(io::Cursor::new(first))
            }
        };
        match start.read(buffer)? {
            0 => self.inner.read(buffer),
            n => Ok(n),
        }
    }
}

impl Input {
    /// The samples, whatever they are of.
    pub fn samples(&self) -> &Samples {
        match self {
            Self::Voltage(samples) | Self::Force(samples) | Self::Displacement(samples) => samples,
        }
    }
}
