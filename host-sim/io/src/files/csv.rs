//! Tables: CSV files with a column of times and columns of numbers.
//!
//! A header names the columns with their units; unknown columns are ignored and lines that begin with `#` are comments.
//! A file is checked while it is read: the first fault ends the reading, and its line is reported.

use std::collections::VecDeque;
use std::io::{self, Read};
use std::path::Path;

use crate::error::{Error, Result};
use crate::files::import::{Separator, more_cells};
use crate::grid::Samples;

/// Names that a column may have, with their factors to SI units.
pub type Names = [(&'static str, f64)];

/// The column of times.
const TIME: &Names = &[("time_s", 1.0), ("time_ms", 1e-3), ("Time (s)", 1.0)];

/// Largest value, in any unit.
pub(super) const MAX_VALUE: f64 = 1e15;

/// Columns in SI units, time from the first row.
#[derive(Clone, Debug, PartialEq)]
pub struct Table<const N: usize> {
    /// Times in s, increasing from 0.
    pub time_s: Vec<f64>,
    /// Time of the first row by the file's clock, s.
    pub start_s: f64,
    /// The requested columns; `None` for a column that is missing or empty throughout.
    pub columns: [Option<Column>; N],
}

/// One quantity over the rows; a cell may be empty where nothing was measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    name: String,
    cells: Vec<Option<f64>>,
    /// Line of the first empty cell.
    first_gap: Option<u64>,
}

impl<const N: usize> Table<N> {
    /// Reads the columns `names` from CSV text; `path` is what errors name. Of every set in `needed` at least one
    /// column must be there.
    ///
    /// # Errors
    ///
    /// [`Error`] naming the file and line of the first thing that cannot be used.
    pub fn from_csv(path: &Path, csv: impl Read, names: [&Names; N], needed: &[&[usize]]) -> Result<Self> {
        let mut records = Records::new(path, csv);
        let header = Header::read(&mut records)?;
        let time = header.find(TIME)?.ok_or_else(|| header.missing(&[TIME]))?;
        let mut fields = [None; N];
        for (field, names) in fields.iter_mut().zip(names) {
            *field = header.find(names)?;
        }
        for set in needed {
            if set.iter().all(|&index| fields[index].is_none()) {
                let set: Vec<&Names> = set.iter().map(|&index| names[index]).collect();
                return Err(header.missing(&set));
            }
        }

        let mut time_s = Vec::new();
        let mut columns = fields.map(|field| field.map(|field| (field, Column::empty(field.name.to_owned()))));
        while let Some(line) = records.next()? {
            let at = |cause: String| Error::line(path, line, cause);
            header.refuse_more_cells(&records.record).map_err(at)?;
            let now = time.time(&records.record, time_s.last().copied()).map_err(at)?;
            time_s.push(now);
            for (field, column) in columns.iter_mut().flatten() {
                column.push(field.number(&records.record).map_err(at)?, line);
            }
        }
        if time_s.len() < 2 {
            return Err(Error::file(path, format!("{} data rows; a recording needs at least 2", time_s.len())));
        }
        let start_s = time_s[0];
        time_s.iter_mut().for_each(|t| *t -= start_s);
        let columns = columns.map(|found| found.map(|(_, column)| column).filter(Column::has_values));
        Ok(Self { time_s, start_s, columns })
    }
}

/// The records of a CSV file with their lines.
struct Records<'a, R> {
    path: &'a Path,
    reader: csv::Reader<Lines<R>>,
    /// The record that was read last.
    record: csv::ByteRecord,
}

impl<'a, R: Read> Records<'a, R> {
    fn new(path: &'a Path, csv: R) -> Records<'a, WithoutMark<R>> {
        let reader = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .trim(csv::Trim::All)
            .flexible(true)
            .from_reader(Lines::new(WithoutMark { inner: csv, start: None }));
        Records { path, reader, record: csv::ByteRecord::new() }
    }

    /// Reads the next record and gives its line, or `None` at the end.
    fn next(&mut self) -> Result<Option<u64>> {
        match self.reader.read_byte_record(&mut self.record) {
            Ok(true) => Ok(Some(self.reader.get_mut().next_record())),
            Ok(false) => Ok(None),
            Err(e) => Err(csv_error(self.path, self.reader.get_ref(), &e)),
        }
    }
}

/// The names of a file's columns.
struct Header<'a> {
    path: &'a Path,
    line: u64,
    names: Vec<String>,
}

impl<'a> Header<'a> {
    fn read<R: Read>(records: &mut Records<'a, R>) -> Result<Self> {
        let names = match records.reader.byte_headers() {
            Ok(header) => header.iter().map(|name| String::from_utf8_lossy(name).into_owned()).collect(),
            Err(e) => return Err(csv_error(records.path, records.reader.get_ref(), &e)),
        };
        Ok(Self { path: records.path, line: records.reader.get_mut().next_record(), names })
    }

    /// The column with one of `names`, if there is one.
    fn find(&self, names: &Names) -> Result<Option<Field>> {
        let mut found = None;
        for &(name, factor) in names {
            for (index, _) in self.names.iter().enumerate().filter(|(_, column)| *column == name) {
                if let Some(Field { name: other, .. }) = found {
                    let cause = format!("both {other} and {name}; leave one of them");
                    return Err(Error::line(self.path, self.line, cause));
                }
                found = Some(Field { name, index, factor });
            }
        }
        Ok(found)
    }

    /// Refuses a record in which a value is behind the last column: its values are not those of the names.
    fn refuse_more_cells(&self, record: &csv::ByteRecord) -> std::result::Result<(), String> {
        let names = self.names.len();
        if record.iter().skip(names).all(<[u8]>::is_empty) {
            return Ok(());
        }
        Err(more_cells(record.len(), names, Separator::Comma))
    }

    /// The error where all columns of `groups` are missing.
    fn missing(&self, groups: &[&Names]) -> Error {
        let names: Vec<&str> = groups.iter().flat_map(|group| group.iter().map(|(name, _)| *name)).collect();
        let header = shortened(&self.names.join(","));
        Error::line(self.path, self.line, format!("no column {}; the header is {header:?}", names.join(" or ")))
    }
}

impl Column {
    /// A column without cells yet.
    pub(super) fn empty(name: String) -> Self {
        Self { name, cells: Vec::new(), first_gap: None }
    }

    /// Adds the cell of `line`.
    pub(super) fn push(&mut self, cell: Option<f64>, line: u64) {
        if cell.is_none() && self.first_gap.is_none() {
            self.first_gap = Some(line);
        }
        self.cells.push(cell);
    }

    /// Whether any cell has a value.
    pub(super) fn has_values(&self) -> bool {
        self.cells.iter().any(Option::is_some)
    }

    /// Its name in the file.
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// The cells, row by row.
    pub(super) fn cells(&self) -> &[Option<f64>] {
        &self.cells
    }

    /// The same column with other cells, whose gaps are at no line of the file.
    pub(super) fn with_cells(&self, cells: Vec<Option<f64>>) -> Self {
        let first_gap = cells.iter().any(Option::is_none).then_some(self.first_gap).flatten();
        Self { name: self.name.clone(), cells, first_gap }
    }

    /// The cells that are not empty, at their times.
    pub fn present(&self, time_s: &[f64]) -> Samples {
        let (time_s, value) = time_s.iter().zip(&self.cells).filter_map(|(&t, cell)| cell.map(|v| (t, v))).unzip();
        Samples { time_s, value }
    }

    /// All cells.
    ///
    /// # Errors
    ///
    /// [`Error::Line`] where a cell is empty; `why` is the reason that it must not be.
    pub fn complete(&self, path: &Path, time_s: &[f64], why: &str) -> Result<Samples> {
        let empty = |at: &str| format!("{} is empty{at}; {why}", self.name);
        match (self.first_gap, self.cells.iter().position(Option::is_none)) {
            (_, None) => Ok(self.present(time_s)),
            (Some(line), _) => Err(Error::line(path, line, empty(""))),
            (None, Some(row)) => Err(Error::file(path, empty(&format!(" at {} s", time_s[row])))),
        }
    }
}

/// Checks whether a file that begins with `head` has a time and, of every set in `needed`, one of the columns `names`, with numbers below them
/// and below the others that it has.
pub fn has_names<const N: usize>(head: &[u8], names: [&Names; N], needed: &[&[usize]]) -> bool {
    let mut records = Records::new(Path::new(""), head);
    let Ok(header) = Header::read(&mut records) else { return false };
    // Two columns of a kind are an error of a recording.
    let Ok(time) = header.find(TIME) else { return true };
    let Ok(fields) = names.iter().map(|names| header.find(names)).collect::<Result<Vec<_>>>() else { return true };
    if time.is_none() || needed.iter().any(|set| set.iter().all(|&index| fields[index].is_none())) {
        return false;
    }
    let fields: Vec<Field> = [time].into_iter().chain(fields).flatten().collect();
    if !matches!(records.next(), Ok(Some(_))) {
        return true;
    }
    let is_number = |field: &Field| {
        let cell = records.record.get(field.index).map(String::from_utf8_lossy);
        cell.is_none_or(|cell| cell.is_empty() || cell.parse::<f64>().is_ok())
    };
    fields.iter().all(is_number)
}

/// A column of the file.
#[derive(Clone, Copy)]
struct Field {
    name: &'static str,
    index: usize,
    factor: f64,
}

impl Field {
    /// The time in `record`, which must lie after `before`.
    fn time(&self, record: &csv::ByteRecord, before: Option<f64>) -> std::result::Result<f64, String> {
        let now =
            self.number(record)?.ok_or_else(|| format!("no value for {}; every row needs its time", self.name))?;
        match before {
            Some(before) if now <= before => {
                let way = if now < before { "goes backwards" } else { "does not increase" };
                Err(format!("{} {way} at {now} s; sort the rows and remove doubles", self.name))
            }
            _ => Ok(now),
        }
    }

    fn number(&self, record: &csv::ByteRecord) -> std::result::Result<Option<f64>, String> {
        let text = record.get(self.index).ok_or_else(|| format!("the row ends before {}", self.name))?;
        let text = String::from_utf8_lossy(text);
        if text.is_empty() {
            return Ok(None);
        }
        match text.parse::<f64>() {
            Ok(value) if value.abs() <= MAX_VALUE => Ok(Some(value * self.factor)),
            Ok(value) if value.is_finite() => Err(format!("{} is {text}; no instrument reads that", self.name)),
            Ok(_) => Err(format!("{} is {text}; leave the cell empty where nothing was measured", self.name)),
            Err(_) => Err(format!("{} is {:?}, which is not a number", self.name, shortened(&text))),
        }
    }
}

fn shortened(text: &str) -> String {
    const MAX_SHOWN: usize = 60;
    if text.chars().count() <= MAX_SHOWN { text.into() } else { text.chars().take(MAX_SHOWN).chain(['…']).collect() }
}

fn csv_error<R>(path: &Path, lines: &Lines<R>, error: &csv::Error) -> Error {
    match (&lines.fault, error.kind()) {
        (Some(fault), _) => Error::line(path, lines.line, *fault),
        (None, csv::ErrorKind::Io(e)) => Error::file(path, e),
        (None, _) => Error::file(path, error),
    }
}

const OPEN_QUOTE: &str = "a quote is not closed on this line";

/// A reader that normalises lines for a CSV reader and keeps the line number of every record.
///
/// Line ends of all systems become `\n`. Text that cannot be a recording ends the reading before it fills the memory. A CSV
/// reader skips empty lines and comments, so every other line is a record.
struct Lines<R> {
    inner: R,
    /// Number of the current line, from one.
    line: u64,
    /// Bytes of it so far.
    length: usize,
    comment: bool,
    /// Quotes on it are odd in number.
    odd_quotes: bool,
    /// State of a CSV reader after its last byte, for which a quote inside a field is a letter.
    place: Place,
    /// The last byte was `\r`: a `\n` that follows belongs to it.
    carriage_return: bool,
    /// Lines of the records that were read ahead.
    records: VecDeque<u64>,
    fault: Option<&'static str>,
}

/// A place in a field of a CSV file.
#[derive(Clone, Copy, PartialEq)]
enum Place {
    /// Before its first byte.
    Start,
    /// Not between quotes.
    Plain,
    /// Between quotes: delimiters and line ends belong to it.
    Quoted,
    /// Behind a quote between quotes: the closing one, or the first of two that mean one.
    Closing,
}

impl Place {
    fn after(self, byte: u8) -> Self {
        match (self, byte) {
            (Self::Start | Self::Closing, b'"') => Self::Quoted,
            (Self::Quoted, b'"') => Self::Closing,
            (Self::Quoted, _) => Self::Quoted,
            (_, b',') => Self::Start,
            _ => Self::Plain,
        }
    }
}

impl<R: Read> Lines<R> {
    fn new(inner: R) -> Self {
        Self {
            inner,
            line: 1,
            length: 0,
            comment: false,
            odd_quotes: false,
            place: Place::Start,
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

    /// Whether a quote of this line is still open.
    fn is_open(&self) -> bool {
        self.odd_quotes || self.place == Place::Quoted
    }

    /// Counts `byte` and returns what the CSV reader gets.
    fn take(&mut self, byte: u8) -> std::result::Result<u8, &'static str> {
        const MAX_LINE: usize = 1 << 16;
        let second_half = byte == b'\n' && self.carriage_return;
        self.carriage_return = byte == b'\r';
        if second_half {
            return Ok(b'\n');
        }
        if matches!(byte, b'\n' | b'\r') {
            if self.is_open() {
                return Err(OPEN_QUOTE);
            }
            self.line += 1;
            (self.length, self.comment, self.place) = (0, false, Place::Start);
            return Ok(b'\n');
        }
        if self.length == 0 {
            self.comment = byte == b'#';
            if !self.comment {
                self.records.push_back(self.line);
            }
        }
        self.length += 1;
        if !self.comment {
            self.odd_quotes ^= byte == b'"';
            self.place = self.place.after(byte);
        }
        if self.length > MAX_LINE {
            return Err("a line of more than 65536 characters; this is not a CSV recording");
        }
        Ok(byte)
    }
}

impl<R: Read> Read for Lines<R> {
    /// Ends before a line that cannot be used: the lines before it are checked first.
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let failed = || io::Error::from(io::ErrorKind::InvalidData);
        if self.fault.is_some() {
            return Err(failed());
        }
        let n = self.inner.read(buffer)?;
        if n == 0 && self.is_open() {
            self.fault = Some(OPEN_QUOTE);
            return Err(failed());
        }
        let mut whole = 0;
        for (index, byte) in buffer[..n].iter_mut().enumerate() {
            match self.take(*byte) {
                Ok(taken) => *byte = taken,
                Err(fault) => {
                    self.fault = Some(fault);
                    return if whole > 0 { Ok(whole) } else { Err(failed()) };
                }
            }
            if *byte == b'\n' {
                whole = index + 1;
            }
        }
        Ok(n)
    }
}

/// A reader that removes byte order marks at the start.
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
                // A CSV reader would take a second one for nothing, and the lines would not be counted as it does.
                while first == MARK {
                    first.clear();
                    self.inner.by_ref().take(MARK.len() as u64).read_to_end(&mut first)?;
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
