//! Reads the columns of a file in SI units.

use std::borrow::Cow;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::chosen::{By, Chosen};
use super::lines::{Fault, Line, comments_between, empty_rows};
use super::mapping;
use super::numbers::{self, Cell, Decimal};
use super::reading::Reading;
use super::series::{Series, Understood, UnderstoodColumn};
use super::source::{Source, si};
use super::text::{Dialect, TextTable};
use super::times::{Origin, Times};
use super::{
    Hints, Quantity, Request, doubts, encoding, fractions, kind, mat, mat_hdf5, names, other_times, own_names, rates,
    reshaped, status, workbook,
};
use crate::error::{Error, shown};
use crate::files::table::Column;

/// Bytes from which the kind of a file is found.
const HEAD: u64 = 1 << 16;
/// Largest file, in bytes; hours of a recording are more than a laboratory's file.
const MAX_FILE: u64 = 1 << 29;
const MAX_OWN_FILE: u64 = 1 << 33;

/// Reads the `file` at `path`.
///
/// # Errors
///
/// [`Error`] naming file and line, the cause and what to do.
pub fn read(path: &Path, mut file: File, request: &Request<'_>, hints: &Hints) -> Result<Series, Error> {
    let unreadable = |error: std::io::Error| Error::file(path, error);
    let refused = |cause: String| Error::file(path, cause);
    let mut bytes = Vec::new();
    file.by_ref().take(HEAD).read_to_end(&mut bytes).map_err(unreadable)?;
    let own = hints.allow_own_names() && has_own_names(&String::from_utf8_lossy(&bytes), request);
    let kind = if own { kind::Kind::Text } else { kind::detect(&bytes).map_err(refused)? };
    let text_end = encoding::without_zeros(&bytes);
    if !own && kind == kind::Kind::Text && (text_end == 0 || bytes[..text_end].contains(&0)) {
        // Before a gigabyte of it is read.
        encoding::readings(&bytes).map_err(refused)?;
    }
    let most = if own { MAX_OWN_FILE } else { MAX_FILE };
    file.take(most).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 >= most {
        let cause = format!("more than {} MiB; export it as CSV with the names of recordings, or in parts", most >> 20);
        return Err(refused(cause));
    }
    if hints.sheet.is_some() && kind != kind::Kind::Workbook {
        return Err(Error::field("sheet", format!("{} is no workbook", shown(path))));
    }
    let zeros = if kind == kind::Kind::Text { bytes.len() - encoding::without_zeros(&bytes) } else { 0 };
    bytes.truncate(bytes.len() - zeros);
    let series = match kind {
        _ if own => own_names(bytes, request, hints),
        kind::Kind::Text => text(&bytes, request, hints),
        kind::Kind::Workbook => spreadsheet(bytes, request, hints),
        kind::Kind::Mat => variables(mat::contents(&bytes), request, hints),
        kind::Kind::OldMat => variables(mat::contents_of_version_4(&bytes), request, hints),
        kind::Kind::MatHdf5 => variables(mat_hdf5::contents(bytes), request, hints),
    };
    let mut series = named(path, series)?;
    if zeros > 0 {
        let note = "the file ends with zero bytes, as after a loss of power: rows may be missing at its end";
        series.understood.notes.push(note.into());
    }
    Ok(series)
}

/// Reads CSV text with the names of this tool; `path` is what errors name.
pub fn from_csv(path: &Path, mut csv: impl Read, request: &Request<'_>) -> Result<Series, Error> {
    let mut bytes = Vec::new();
    csv.read_to_end(&mut bytes).map_err(|error| Error::file(path, error))?;
    named(path, own_names(bytes, request, &Hints::default()))
}

/// Names the file at `path` in what was read of it, or in the error.
fn named(path: &Path, read: Result<Series, Fault>) -> Result<Series, Error> {
    let mut series = read.map_err(|(line, cause)| match line {
        0 => Error::file(path, cause),
        line => Error::line(path, line, cause),
    })?;
    series.understood.file = shown(path);
    Ok(series)
}

/// The fault of a file as a whole.
fn of_file(cause: impl Into<String>) -> Fault {
    (0, cause.into())
}

/// Whether a text that begins with `head` has the names of this tool for what is needed, with numbers below them. Decimal commas in
/// quotes are the dialect of another program, and so is a displacement in another unit than the names have.
fn has_own_names(head: &str, request: &Request<'_>) -> bool {
    let Ok(table) = TextTable::below_names(head.trim_start_matches(MARK)) else { return false };
    match own_names::own(&table.titles(), request) {
        // Two columns of a kind.
        Err(_) => true,
        Ok(None) => false,
        Ok(Some(chosen)) if own_names::has_another_displacement(&table.titles(), request, &chosen) => false,
        Ok(Some(chosen)) => table.rows().take(100).flatten().enumerate().all(|(k, (_, cells))| {
            let is_text = |text: &str| k == 0 && matches!(numbers::cell(text, Decimal::Point), Cell::Text(_));
            let is_ours = |text: &str| !text.contains(',') && !is_text(text);
            chosen.iter().all(|column| cells.get(column.index).is_none_or(|text| is_ours(text)))
        }),
    }
}

/// Reads CSV text with the names of this tool. Programs that join files leave more than one byte order mark.
fn own_names(bytes: Vec<u8>, request: &Request<'_>, hints: &Hints) -> Result<Series, Fault> {
    let text = String::from_utf8(bytes).unwrap_or_else(|error| String::from_utf8_lossy(error.as_bytes()).into_owned());
    let text = text.trim_start_matches(MARK);
    let table = TextTable::below_names(text)?;
    let own = own_names::own(&table.titles(), request).map_err(|cause| (table.head.line, cause))?;
    let source = Source::Text("text (UTF-8)".into(), Box::new(table));
    let chosen = own.map_or_else(|| map(&source, request, hints), Ok)?;
    extract(&source, &chosen, hints)
}

/// A byte order mark.
const MARK: char = '\u{feff}';

/// Reads text; in each of the encodings that it may be in.
fn text(bytes: &[u8], request: &Request<'_>, hints: &Hints) -> Result<Series, Fault> {
    let decoded = encoding::readings(bytes).map_err(of_file)?;
    let texts: Vec<(String, Cow<'_, str>)> = decoded.iter().map(shaped).collect();
    let mut understood: Vec<(Source<'_>, Vec<Chosen>)> = Vec::new();
    let mut fault = None;
    for (format, text) in &texts {
        match table(format, text, &hints.dialect(), request) {
            Ok(reading) => understood.push(reading),
            Err(error) => fault = Some(error),
        }
    }
    let meaning =
        |chosen: &[Chosen]| chosen.iter().map(|c| (c.quantity, c.index, c.factor.to_bits())).collect::<Vec<_>>();
    let by_name = |chosen: &[Chosen]| chosen.iter().filter(|column| column.by == By::Name).count();
    // In the wrong encoding units may be left of a header and no names, or some of the columns.
    let is_rival = |one: &[Chosen], other: &[Chosen]| {
        let (few, many) =
            if one.len() < other.len() { (meaning(one), meaning(other)) } else { (meaning(other), meaning(one)) };
        few.iter().any(|column| !many.contains(column)) && by_name(one).min(by_name(other)) > 0
    };
    let mut pairs = (1..understood.len()).flat_map(|k| understood[..k].iter().map(move |first| (first, k)));
    let rivals = pairs.find(|((_, one), k)| is_rival(one, &understood[*k].1));
    match (rivals.map(|(first, k)| [first, &understood[k]]), understood.as_slice(), fault) {
        (_, [], Some(fault)) => Err(fault),
        (Some([(first, one), (second, other)]), ..) => {
            let shown = |source: &Source<'_>, chosen: &[Chosen]| {
                let titles = source.titles();
                let names: Vec<&str> = chosen.iter().map(|column| titles[column.index].name.as_str()).collect();
                format!("{}: {}", source.format(), names.join(", "))
            };
            Err(of_file(format!(
                "can be read in two ways: {}; or {}; save it as UTF-8, or name the columns by number with `columns`",
                shown(first, one),
                shown(second, other)
            )))
        }
        // More columns that are known by their names: the better reading of the letters.
        (None, readings, _) => {
            let best = readings.iter().rev().max_by_key(|(_, chosen)| by_name(chosen));
            let (source, chosen) = best.ok_or_else(|| of_file("no text"))?;
            extract(source, chosen, hints)
        }
    }
}

/// The format of a text, and the text with cells on one line each, and columns where it has rows for them.
fn shaped(encoding::Decoded { encoding, text }: &encoding::Decoded) -> (String, Cow<'_, str>) {
    match reshaped::transposed(text, names::is_time) {
        Some(turned) => (format!("text ({encoding}) with rows for columns"), turned.into()),
        None => (format!("text ({encoding})"), reshaped::unwrapped(text)),
    }
}

/// The table in `text`, and its columns.
fn table<'a>(
    format: &str,
    text: &'a str,
    dialect: &Dialect<'_>,
    request: &Request<'_>,
) -> Result<(Source<'a>, Vec<Chosen>), Fault> {
    let find = |dialect: &Dialect<'_>| TextTable::find(text, dialect);
    // A single column is a table where the preamble states its rate.
    let states_rate = |table: &TextTable<'_>| table.head.interval.is_some();
    let table = find(dialect)
        .or_else(|error| find(&Dialect { single: true, ..*dialect }).ok().filter(states_rate).ok_or(error))?;
    let source = Source::Text(format.into(), Box::new(table));
    let chosen = map(&source, request, dialect.hints)?;
    Ok((source, chosen))
}

/// Reads the spreadsheet of a workbook that is understood.
fn spreadsheet(bytes: Vec<u8>, request: &Request<'_>, hints: &Hints) -> Result<Series, Fault> {
    let sheets = workbook::sheets(bytes, hints.sheet.as_deref(), hints.decimal).map_err(of_file)?;
    let mut found = Vec::new();
    let (mut fault, mut has_rows) = (None, false);
    let mut unread = Vec::new();
    for sheet in &sheets {
        let dialect = Dialect { sheet: Some(&sheet.ambiguous), ..hints.dialect() };
        match table(&format!("spreadsheet {:?}", sheet.name), &sheet.text, &dialect, request) {
            Ok(reading) => found.push((&sheet.name, reading)),
            Err(error) => {
                // A sheet of notes has no rows of numbers; that of another is the fault.
                let of_rows = TextTable::find(&sheet.text, &dialect).is_ok() || error.0 > 0;
                if fault.is_none() || (of_rows && !has_rows) {
                    fault = Some(error);
                }
                has_rows |= of_rows;
                unread.extend(of_rows.then(|| format!("{:?}", sheet.name)));
            }
        }
    }
    match (found.as_slice(), fault) {
        ([(_, (source, chosen))], _) => {
            let mut series = extract(source, chosen, hints)?;
            if !unread.is_empty() {
                let note = format!("rows of numbers in the spreadsheets {} are not read", unread.join(", "));
                series.understood.notes.push(note);
            }
            Ok(series)
        }
        ([], Some(fault)) if has_rows => Err(fault),
        ([], _) => Err(of_file("a workbook without rows of numbers below a header")),
        (several, _) => {
            let names: Vec<String> = several.iter().map(|(name, ..)| format!("{name:?}")).collect();
            let (count, names) = (names.len(), names.join(", "));
            Err(of_file(format!("{count} spreadsheets may be meant: {names}; choose one with `sheet` NAME")))
        }
    }
}

/// Reads variables of MATLAB.
fn variables(contents: Result<mat::Contents, String>, request: &Request<'_>, hints: &Hints) -> Result<Series, Fault> {
    let contents = contents.map_err(of_file)?;
    if contents.series.is_empty() {
        return Err(match contents.objects.first() {
            Some(name) => of_file(format!(
                "{name:?} is an object, such as a table or a timeseries, which only MATLAB can read; write it with writetable, \
                 or save vectors or a structure of them"
            )),
            None => of_file("no series of numbers; save vectors of time, voltage and displacement"),
        });
    }
    let skipped: Vec<String> =
        contents.skipped.iter().map(|name| format!("{name} is complex or sparse and is not read")).collect();
    let source = Source::Series(contents.series);
    let chosen = map(&source, request, hints).map_err(|error| match error {
        (0, cause) if !skipped.is_empty() => of_file(format!("{cause}; {}", skipped.join("; "))),
        other => other,
    })?;
    let mut series = extract(&source, &chosen, hints)?;
    series.understood.notes.extend(skipped);
    Ok(series)
}

fn map(source: &Source<'_>, request: &Request<'_>, hints: &Hints) -> Result<Vec<Chosen>, Fault> {
    let line = source.head().map_or(0, |head| head.line);
    let times = match (hints.rate_hz, source.head().and_then(|head| head.interval.as_ref())) {
        (Some(_), _) => Origin::Person,
        (None, Some(_)) => Origin::Preamble,
        (None, None) => Origin::Column,
    };
    mapping::map(&source.titles(), request, &hints.choices, times).map_err(|cause| (line, cause))
}

/// The interval of the rows, s, where a person or the preamble states it.
/// Fails where it is needed and not certain.
fn interval_s(reading: Reading<'_>, hints: &Hints) -> Result<Option<f64>, Fault> {
    if let Some(rate_hz) = hints.rate_hz {
        return Ok(Some(1.0 / rate_hz));
    }
    let Some(stated) = reading.source.head().and_then(|head| head.interval.clone()) else { return Ok(None) };
    match (stated, reading.time()) {
        (Ok(interval_s), _) => Ok(Some(interval_s)),
        (Err(question), None) => Err(*question),
        (Err(question), Some(time)) if time.by == By::Preamble => {
            let (line, cause) = *question;
            Err((line, format!("{cause}, or state the unit of the times with `columns` time={}:s", time.index + 1)))
        }
        (Err(_), Some(_)) => Ok(None),
    }
}

/// The `chosen` columns in SI units.
fn extract(source: &Source<'_>, chosen: &[Chosen], hints: &Hints) -> Result<Series, Fault> {
    let titles = source.titles();
    let mut chosen = chosen.to_vec();
    for column in chosen.iter_mut().filter(|column| hints.invert && column.quantity == Quantity::Displacement) {
        column.factor = -column.factor;
    }
    let reading = Reading { source, chosen: &chosen, titles: &titles };
    let names: Vec<String> = chosen.iter().map(|column| column.name(&titles)).collect();
    let may_repeat = hints.repeated_times.is_some();
    // What all rows together show is no fault of one of them.
    let of_all = |(line, cause)| of_file(format!("line {line}: {cause}"));
    let mut doubt = doubts::refuse_cells(reading, may_repeat).err();
    let mut times = Times::new(interval_s(reading, hints)?, may_repeat, source.starts());
    let mut columns: Vec<Column> = names.iter().map(|name| Column::empty(name.clone())).collect();
    let mut out_of_range = vec![0; chosen.len()];
    let fractions = fractions::beside(reading)?;
    let indices = chosen.iter().map(|column| column.index);
    let read: Vec<usize> = indices.chain(fractions.iter().map(|fraction| fraction.index)).collect();
    let read_rows = source
        .each(&read, |line, values| {
            // The fault of a row comes before what is doubtful behind it.
            if let Some((_, cause)) = doubt.take_if(|(doubtful, _)| *doubtful <= line) {
                return Err(cause);
            }
            let of_second = |(cell, fraction): (&Cell<'_>, &fractions::Fraction)| {
                cell.number().map_or(0.0, |number| number * fraction.unit_s)
            };
            let fraction_s = values[chosen.len()..].iter().zip(&fractions).map(of_second).sum();
            if reading.time().is_none() {
                times.count();
            }
            for (place, Chosen { quantity, factor, .. }) in chosen.iter().enumerate() {
                if *quantity == Quantity::Time {
                    times.push(line, &names[place], values[place], *factor, fraction_s)?;
                    continue;
                }
                let value = match values[place] {
                    Cell::Text(text) if hints.words.iter().any(|word| word == text) => Cell::OutOfRange,
                    value => value,
                };
                out_of_range[place] += usize::from(matches!(value, Cell::OutOfRange));
                columns[place].push(si(&names[place], value, *factor)?, line);
            }
            Ok(())
        })
        .and_then(|()| doubt.map_or(Ok(()), Err));
    if let (Some(table), None) = (source.text(), reading.time())
        && let Some((line, _)) = empty_rows(&table.segments)
    {
        let cause = "an empty row, where rows have no times: was a reading missed? Fill it, or remove it if not";
        return Err((line, cause.into()));
    }
    let until = read_rows.as_ref().err().map_or(u64::MAX, |(line, _)| *line);
    doubts::refuse_commas(reading, until).map_err(of_all)?;
    read_rows?;
    let understood = |(column, name): (&Chosen, &String)| {
        let Chosen { quantity, index, unit, factor, by } = column.clone();
        UnderstoodColumn { quantity, column: index + 1, name: name.clone(), unit, factor, by }
    };
    let mut used: Vec<UnderstoodColumn> = chosen.iter().zip(&names).map(understood).collect();
    let without_unit = used.iter_mut().find(|c| c.quantity == Quantity::Time && c.by == By::Preamble);
    let named = without_unit.as_ref().map(|column| (column.column, column.name.as_str()));
    let (clock_s, unit) = times.finish(named, || source.runs()).map_err(of_file)?;
    if let (Some(column), Some(unit)) = (without_unit, unit) {
        (column.unit, column.factor) = (unit.name.into(), unit.factor);
    }
    doubts::refuse_rows(reading, &clock_s).map_err(of_all)?;
    let columns = chosen.iter().map(|column| column.quantity).zip(columns);
    let columns = columns.filter(|(quantity, column)| *quantity != Quantity::Time && column.has_values()).collect();
    let head = source.head();
    let ignored = || (0..titles.len()).filter(|index| !read.contains(index)).map(|index| &titles[index].name);
    let understood = Understood {
        format: source.format(),
        header_line: head.map_or(0, |head| head.line),
        preamble_lines: head.map_or(0, |head| head.preamble),
        columns: used,
        ignored: ignored().filter(|name| !name.is_empty()).cloned().collect(),
        ..Understood::default()
    };
    let mut series = Series { clock_s, columns, understood };
    // What drives the film must be complete: there it is an error.
    for (count, column) in out_of_range.iter_mut().zip(&chosen) {
        if matches!(column.quantity, Quantity::Voltage | Quantity::Command) {
            *count = 0;
        }
    }
    let mut notes = remarks(source, &names, &out_of_range);
    let added = fractions.iter().map(|fraction| &titles[fraction.index].name);
    notes.extend(added.map(|name| format!("{name:?} is added to the times of day beside it")));
    if let Some(meaning) = hints.repeated_times {
        rates::refuse_repeated(reading, &series.clock_s, meaning).map_err(of_file)?;
        series.without_repeated_times(meaning);
    }
    if let Some(filled) = hints.fill.map(|fill| series.fill(fill)).filter(|filled| *filled > 0) {
        notes.push(format!("{filled} empty cells of what drives the film are filled"));
    }
    notes.extend(other_times::remarks(reading));
    notes.extend(status::remarks(reading));
    notes.extend(rates::remarks(reading, &series.clock_s));
    if hints.rate_hz.is_some()
        && hints.choices.get(Quantity::Time).is_none()
        && let Some(name) = ignored().find(|name| names::is_time(name))
    {
        notes.push(format!("the times in {name:?} are not used: the rate of the rows is stated with `rate_hz`"));
    }
    series.understood.notes = notes;
    match series.clock_s.len() {
        0 => Err(of_file("no data rows; a recording needs at least 2")),
        1 => Err(of_file("1 data row; a recording needs at least 2")),
        _ => Ok(series),
    }
}

/// Remarks on rows that were left out, and on readings out of range.
fn remarks(source: &Source<'_>, names: &[String], out_of_range: &[usize]) -> Vec<String> {
    let missing = names.iter().zip(out_of_range).filter(|(_, count)| **count > 0);
    let remark = |(name, count): (&String, &usize)| {
        format!("{count} readings of {name:?} are out of range or blanked: they are missing")
    };
    let mut notes: Vec<String> = missing.map(remark).collect();
    if let Some(table) = source.text() {
        if let Some((line, count)) = empty_rows(&table.segments) {
            notes.push(format!("empty rows are left out: {count}, the first in line {line}"));
        }
        let starts = source.starts();
        if starts.len() > 1 {
            notes.push(format!("{} runs of rows below repeated headers are joined", starts.len()));
        }
        if let Some((count, first)) = table.footer {
            let first: String = first.chars().take(40).collect();
            let lines = if count == 1 { "line" } else { "lines" };
            notes.push(format!("{count} {lines} below the rows left out, from {first:?} on"));
        }
        let comments: Vec<Line<'_>> =
            table.segments.iter().flat_map(|(line, text)| comments_between(text, *line)).collect();
        if let [first, more @ ..] = comments.as_slice() {
            let text: String = first.text.trim().chars().take(40).collect();
            let more = if more.is_empty() { String::new() } else { format!(", and {} more", more.len()) };
            notes.push(format!("left out: the comment {text:?} between the rows, in line {}{more}", first.number));
        }
        if let Some(row) = table.cut_off {
            let end = table.separator.split(row).pop().unwrap_or_default();
            notes.push(format!(
                "the file ends in the middle of its last row, whose end is {end:?}: it was cut off; the row is left out"
            ));
        }
        if let Some(line) = table.head.gains {
            notes.push(format!(
                "line {line} is neither a sample nor names: its numbers are not applied (use `columns` with factors)"
            ));
        }
    }
    notes
}
