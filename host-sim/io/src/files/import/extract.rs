//! Columns in SI units from a file, and what was understood of it.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use serde::Serialize;

use super::choice::Choices;
use super::mapping::{self, By, Chosen};
use super::numbers::{self, Cell, Decimal};
use super::source::{Source, Value};
use super::text::TextTable;
use super::{Hints, Quantity, Request, encoding, kind, mat, workbook};
use crate::error::{Error, Result, shown};
use crate::files::table::{Column, MAX_VALUE};

/// Bytes from which the kind of a file is found.
const HEAD: u64 = 1 << 16;
/// Largest file, in bytes; hours of a recording are more than a laboratory's file.
const MAX_FILE: u64 = 1 << 29;
const MAX_OWN_FILE: u64 = 1 << 33;

/// The columns of a file.
#[derive(Clone, Debug)]
pub struct Series {
    /// Times as the file has them, s; increasing.
    pub clock_s: Vec<f64>,
    /// The other columns.
    pub columns: Vec<(Quantity, Column)>,
    /// Interpretation.
    pub understood: Understood,
}

impl Series {
    /// The column of `quantity`.
    pub fn column(&self, quantity: Quantity) -> Option<&Column> {
        self.columns.iter().find(|(which, _)| *which == quantity).map(|(_, column)| column)
    }
}

/// Interpretation of a file.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Understood {
    /// The file.
    pub file: String,
    /// Kind, encoding, separator and decimal sign.
    pub format: String,
    /// Line of the names; 0 if it is missing.
    pub header_line: u64,
    /// Lines above the names.
    pub preamble_lines: usize,
    /// The columns that are used.
    pub columns: Vec<UnderstoodColumn>,
    /// Names of the others.
    pub ignored: Vec<String>,
}

/// A column that is used.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct UnderstoodColumn {
    /// The quantity.
    pub quantity: Quantity,
    /// Its number, from one.
    pub column: usize,
    /// Its name in the file.
    pub name: String,
    /// Its unit there; empty where a factor alone was given.
    pub unit: String,
    /// From the file's numbers to SI.
    pub factor: f64,
    /// Source of the interpretation.
    pub by: By,
}

impl Understood {
    /// Whether the file is CSV with the names of this tool, or no file.
    pub fn is_own(&self) -> bool {
        self.columns.iter().all(|column| column.by == By::OwnName)
    }

    /// From the numbers of the file to SI, for `quantity`.
    pub fn factor(&self, quantity: Quantity) -> Option<f64> {
        self.columns.iter().find(|column| column.quantity == quantity).map(|column| column.factor)
    }

    /// One line: `time = "Zeit [s]" (s), …`.
    pub fn line(&self) -> String {
        let column = |column: &UnderstoodColumn| {
            let unit = match (column.unit.as_str(), column.by) {
                ("", _) => format!("× {}", column.factor),
                (unit, By::Unit) => format!("{unit}, by its unit"),
                (unit, _) => unit.to_owned(),
            };
            format!("{} = {:?} ({unit})", column.quantity.name(), column.name)
        };
        let columns: Vec<String> = self.columns.iter().map(column).collect();
        format!("{}: {}: {}", self.file, self.format, columns.join(", "))
    }
}

/// Reads the `file` at `path`.
///
/// # Errors
///
/// [`Error`] naming file and line, the cause and what to do.
pub fn read(path: &Path, mut file: File, request: &Request<'_>, hints: &Hints) -> Result<Series> {
    let unreadable = |error: std::io::Error| Error::file(path, error);
    let mut bytes = Vec::new();
    file.by_ref().take(HEAD).read_to_end(&mut bytes).map_err(unreadable)?;
    let own = *hints == Hints::default() && has_own_names(&String::from_utf8_lossy(&bytes), request);
    let kind = if own { kind::Kind::Text } else { kind::detect(&bytes).map_err(|cause| Error::file(path, cause))? };
    if !own && kind == kind::Kind::Text && bytes.contains(&0) {
        // Before a gigabyte of it is read.
        encoding::readings(&bytes).map_err(|cause| Error::file(path, cause))?;
    }
    let most = if own { MAX_OWN_FILE } else { MAX_FILE };
    file.take(most).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 >= most {
        let cause = format!("more than {} MiB; export it as CSV with the names of recordings, or in parts", most >> 20);
        return Err(Error::file(path, cause));
    }
    if hints.sheet.is_some() && kind != kind::Kind::Workbook {
        return Err(Error::field("sheet", format!("{} is no workbook", shown(path))));
    }
    match kind {
        _ if own => own_names(path, bytes, request),
        kind::Kind::Text => text(path, &bytes, request, &hints.choices),
        kind::Kind::Workbook => spreadsheet(path, bytes, request, hints),
        kind::Kind::Mat => variables(path, &bytes, request, &hints.choices),
    }
}

/// Reads CSV text with the names of this tool; `path` is what errors name.
///
/// # Errors
///
/// As [`read`].
pub fn from_csv(path: &Path, mut csv: impl Read, request: &Request<'_>) -> Result<Series> {
    let mut bytes = Vec::new();
    csv.read_to_end(&mut bytes).map_err(|error| Error::file(path, error))?;
    own_names(path, bytes, request)
}

/// Whether a text that begins with `head` has the names of this tool for what is needed, with numbers below them. Decimal commas in
/// quotes are the dialect of another program.
fn has_own_names(head: &str, request: &Request<'_>) -> bool {
    let Ok(table) = TextTable::below_names(head.trim_start_matches(MARK)) else { return false };
    match mapping::own(&table.titles(), request) {
        // Two columns of a kind.
        Err(_) => true,
        Ok(None) => false,
        Ok(Some(chosen)) => match table.rows().next() {
            Some(Ok((_, cells))) => chosen.iter().all(|column| {
                let cell = cells.get(column.index).map(|text| numbers::cell(text, Decimal::Point));
                !matches!(cell, Some(Cell::Text(_)))
            }),
            _ => true,
        },
    }
}

/// Reads CSV text with the names of this tool. Programs that join files leave more than one byte order mark.
fn own_names(path: &Path, bytes: Vec<u8>, request: &Request<'_>) -> Result<Series> {
    let text = String::from_utf8(bytes).unwrap_or_else(|error| String::from_utf8_lossy(error.as_bytes()).into_owned());
    let text = text.trim_start_matches(MARK);
    let table = TextTable::below_names(text).map_err(|(line, cause)| at(path, line, cause))?;
    let line = table.head.line;
    let own = mapping::own(&table.titles(), request).map_err(|cause| at(path, line, cause))?;
    let source = Source::Text("UTF-8", table);
    let chosen = own.map_or_else(|| map(path, &source, request, &Choices::default()), Ok)?;
    extract(path, &source, &chosen)
}

/// A byte order mark.
const MARK: char = '\u{feff}';

/// Reads text; in each of the encodings that it may be in.
fn text(path: &Path, bytes: &[u8], request: &Request<'_>, choices: &Choices) -> Result<Series> {
    let decoded = encoding::readings(bytes).map_err(|cause| Error::file(path, cause))?;
    let mut readings = Vec::new();
    for decoded in &decoded {
        let reading = TextTable::find(&decoded.text).map_err(|(line, cause)| at(path, line, cause)).and_then(|table| {
            let source = Source::Text(decoded.encoding, table);
            let chosen = map(path, &source, request, choices)?;
            Ok((source, chosen))
        });
        readings.push(reading);
    }
    let mut understood: Vec<(Source<'_>, Vec<Chosen>)> = Vec::new();
    let mut fault = None;
    for reading in readings {
        match reading {
            Ok(reading) => understood.push(reading),
            Err(error) => fault = Some(error),
        }
    }
    let meaning =
        |chosen: &[Chosen]| chosen.iter().map(|c| (c.quantity, c.index, c.factor.to_bits())).collect::<Vec<_>>();
    match (understood.as_slice(), fault) {
        ([], Some(fault)) => Err(fault),
        ([(first, one), (second, other)], _) if meaning(one) != meaning(other) => {
            let shown = |source: &Source<'_>, chosen: &[Chosen]| {
                let titles = source.titles();
                let names: Vec<&str> = chosen.iter().map(|column| titles[column.index].name.as_str()).collect();
                format!("{}: {}", source.format(), names.join(", "))
            };
            let cause = format!(
                "can be read in two ways: {}; or {}; save it as UTF-8, or name the columns by number with `columns`",
                shown(first, one),
                shown(second, other)
            );
            Err(Error::file(path, cause))
        }
        // More columns that are known by their names: the better reading of the letters.
        (readings, _) => {
            let by_name = |chosen: &[Chosen]| chosen.iter().filter(|column| column.by == By::Name).count();
            let best = readings.iter().rev().max_by_key(|(_, chosen)| by_name(chosen));
            best.map_or_else(|| Err(Error::file(path, "no text")), |(source, chosen)| extract(path, source, chosen))
        }
    }
}

/// Reads the spreadsheet of a workbook that is understood.
fn spreadsheet(path: &Path, bytes: Vec<u8>, request: &Request<'_>, hints: &Hints) -> Result<Series> {
    let sheets = workbook::sheets(bytes, hints.sheet.as_deref()).map_err(|cause| Error::file(path, cause))?;
    let mut found = Vec::new();
    let mut fault = None;
    for sheet in sheets {
        let name = sheet.name.clone();
        let source = Source::Sheet(sheet);
        match map(path, &source, request, &hints.choices) {
            Ok(chosen) => found.push((name, source, chosen)),
            Err(error) => fault = fault.or(Some(error)),
        }
    }
    match (found.as_slice(), fault) {
        ([(_, source, chosen)], _) => extract(path, source, chosen),
        ([], Some(fault)) => Err(fault),
        (several, _) => {
            let names: Vec<String> = several.iter().map(|(name, ..)| format!("{name:?}")).collect();
            let cause = format!(
                "{} spreadsheets may be meant: {}; choose one with `sheet` NAME",
                names.len(),
                names.join(", ")
            );
            Err(Error::file(path, cause))
        }
    }
}

/// Reads variables of MATLAB.
fn variables(path: &Path, bytes: &[u8], request: &Request<'_>, choices: &Choices) -> Result<Series> {
    let fault = |cause: String| Error::file(path, cause);
    let contents = mat::contents(bytes).map_err(fault)?;
    if contents.series.is_empty() {
        let cause = match contents.objects.first() {
            Some(name) => format!(
                "{name:?} is an object, such as a table or a timeseries, which only MATLAB can read; write it with writetable, \
                 or save vectors or a structure of them"
            ),
            None => "no series of numbers; save vectors of time, voltage and displacement".into(),
        };
        return Err(fault(cause));
    }
    let source = Source::Series(contents.series);
    let chosen = map(path, &source, request, choices)?;
    extract(path, &source, &chosen)
}

fn at(path: &Path, line: u64, cause: String) -> Error {
    if line == 0 { Error::file(path, cause) } else { Error::line(path, line, cause) }
}

fn map(path: &Path, source: &Source<'_>, request: &Request<'_>, choices: &Choices) -> Result<Vec<Chosen>> {
    let line = source.head().map_or(0, |head| head.line);
    mapping::map(&source.titles(), request, choices).map_err(|cause| at(path, line, cause))
}

/// The `chosen` columns in SI units.
fn extract(path: &Path, source: &Source<'_>, chosen: &[Chosen]) -> Result<Series> {
    let titles = source.titles();
    let indices: Vec<usize> = chosen.iter().map(|column| column.index).collect();
    let name = |column: &Chosen| match titles[column.index].name.as_str() {
        "" => format!("column {}", column.index + 1),
        name => name.chars().take(40).collect(),
    };
    let names: Vec<String> = chosen.iter().map(name).collect();
    let mut clock_s: Vec<f64> = Vec::new();
    let mut columns: Vec<Column> = names.iter().map(|name| Column::empty(name.clone())).collect();
    source
        .each(&indices, |line, place, value| {
            let Chosen { quantity, factor, .. } = &chosen[place];
            let cell = si(&names[place], value, *factor)?;
            if *quantity == Quantity::Time {
                clock_s.push(next_time(&names[place], cell, clock_s.last().copied())?);
            } else {
                columns[place].push(cell, line);
            }
            Ok(())
        })
        .map_err(|(line, cause)| at(path, line, cause))?;
    if clock_s.len() < 2 {
        return Err(Error::file(path, format!("{} data rows; a recording needs at least 2", clock_s.len())));
    }
    let used = |index: &usize| !indices.contains(index);
    let head = source.head();
    let understood = Understood {
        file: shown(path),
        format: source.format(),
        header_line: head.map_or(0, |head| head.line),
        preamble_lines: head.map_or(0, |head| head.preamble),
        columns: chosen
            .iter()
            .zip(&names)
            .map(|(column, name)| UnderstoodColumn {
                quantity: column.quantity,
                column: column.index + 1,
                name: name.clone(),
                unit: column.unit.clone(),
                factor: column.factor,
                by: column.by,
            })
            .collect(),
        ignored: (0..titles.len())
            .filter(used)
            .map(|index| titles[index].name.clone())
            .filter(|n| !n.is_empty())
            .collect(),
    };
    let columns = chosen
        .iter()
        .map(|column| column.quantity)
        .zip(columns)
        .filter(|(q, c)| *q != Quantity::Time && c.has_values());
    Ok(Series { clock_s, columns: columns.collect(), understood })
}

/// The value of a cell in SI units; nothing where nothing was measured.
fn si(name: &str, value: Value<'_>, factor: f64) -> std::result::Result<Option<f64>, String> {
    match value {
        Value::Nothing => Ok(None),
        Value::Ended => Err(format!("the row ends before {name}")),
        Value::Number(number) if number.is_finite() && (number * factor).abs() <= MAX_VALUE => {
            Ok(Some(number * factor))
        }
        Value::Number(number) => Err(format!("{name} is {number:?}; no instrument reads that")),
        Value::Text(text) if is_clock(text) => {
            Err(format!("{name} is {text:?}, a time of day; export the seconds since the start"))
        }
        Value::Text(text) => {
            let begin: String = text.chars().take(40).collect();
            Err(format!(
                "{name} is {begin:?}, which is not a number here; leave the cell empty where nothing was measured"
            ))
        }
    }
}

fn is_clock(text: &str) -> bool {
    text.contains(':') && text.bytes().filter(u8::is_ascii_digit).count() >= 4
}

fn next_time(name: &str, cell: Option<f64>, before: Option<f64>) -> std::result::Result<f64, String> {
    let now = cell.ok_or_else(|| format!("no value for {name}; every row needs its time"))?;
    match before {
        Some(before) if now <= before => {
            let way = if now < before { "goes backwards" } else { "does not increase" };
            Err(format!("{name} {way} at {now} s; sort the rows and remove doubles"))
        }
        _ => Ok(now),
    }
}
