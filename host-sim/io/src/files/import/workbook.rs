//! Workbooks of spreadsheets (.xlsx).

use std::io::Cursor;
use std::panic::{self, AssertUnwindSafe};

use calamine::{DataRef, Reader, Xlsx};

use super::header::{self, Head, TopRow};
use super::names::Title;
use super::numbers::{self, Decimal};

/// A cell of a spreadsheet.
#[derive(Clone, Debug, PartialEq)]
pub enum SheetCell {
    /// Empty, or an error such as #N/A.
    Nothing,
    /// A number.
    Number(f64),
    /// Text, or anything else that is not a number.
    Text(String),
}

/// A spreadsheet with rows of numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// Its name.
    pub name: String,
    /// Lines above the numbers.
    pub head: Head,
    /// The rows, with their numbers.
    pub rows: Vec<(u64, Vec<SheetCell>)>,
}

/// Most columns: a workbook may have cells far out.
const MAX_COLUMNS: u32 = 1000;

/// The sheets of the workbook `bytes` that have rows of numbers; those that are named `only`, if a name is given.
///
/// # Errors
///
/// What is wrong with the file.
pub fn sheets(bytes: Vec<u8>, only: Option<&str>) -> Result<Vec<Sheet>, String> {
    // The reader of the workbook is another's, and some damaged ones make it panic: that is a finding here, and no report of it is
    // printed.
    let hook = panic::take_hook();
    panic::set_hook(Box::new(|_| {}));
    let sheets = panic::catch_unwind(AssertUnwindSafe(|| read(bytes, only)));
    panic::set_hook(hook);
    sheets.unwrap_or_else(|_| Err("a damaged workbook; save it again".into()))
}

fn read(bytes: Vec<u8>, only: Option<&str>) -> Result<Vec<Sheet>, String> {
    let mut book = Xlsx::new(Cursor::new(bytes)).map_err(|error| {
        format!("this is a ZIP archive and no workbook that can be read ({error}); unpack it, or save the spreadsheet as .xlsx")
    })?;
    let names = book.sheet_names();
    if let Some(only) = only.filter(|only| !names.iter().any(|name| name == only)) {
        return Err(format!("no spreadsheet {only:?}; there are {}", names.join(", ")));
    }
    let mut sheets = Vec::new();
    for name in names.into_iter().filter(|name| only.is_none_or(|only| only == name)) {
        let rows = rows(&mut book, &name)?;
        sheets.extend(Sheet::find(name, rows));
    }
    if sheets.is_empty() {
        return Err("a workbook without rows of numbers below a header".into());
    }
    Ok(sheets)
}

/// The rows of a sheet that are not empty, with their numbers.
fn rows(book: &mut Xlsx<Cursor<Vec<u8>>>, name: &str) -> Result<Vec<(u64, Vec<SheetCell>)>, String> {
    let fault = |error: calamine::XlsxError| format!("spreadsheet {name:?}: {error}; save it again");
    let mut reader = book.worksheet_cells_reader(name).map_err(fault)?;
    let mut rows: Vec<(u64, Vec<SheetCell>)> = Vec::new();
    while let Some(cell) = reader.next_cell().map_err(fault)? {
        let (row, column) = cell.get_position();
        let value = match cell.get_value() {
            DataRef::Int(value) => SheetCell::Number(*value as f64),
            DataRef::Float(value) => SheetCell::Number(*value),
            DataRef::String(text) => text_cell(text),
            DataRef::SharedString(text) => text_cell(text),
            DataRef::Bool(value) => SheetCell::Text(value.to_string()),
            DataRef::DateTime(_) | DataRef::DateTimeIso(_) | DataRef::DurationIso(_) => {
                SheetCell::Text("a date or a time of day".into())
            }
            DataRef::Error(_) | DataRef::Empty => SheetCell::Nothing,
        };
        if value == SheetCell::Nothing || column >= MAX_COLUMNS {
            continue;
        }
        let number = u64::from(row) + 1;
        if rows.last().is_none_or(|(last, _)| *last != number) {
            rows.push((number, Vec::new()));
        }
        if let Some((_, cells)) = rows.last_mut() {
            cells.resize((column as usize + 1).max(cells.len()), SheetCell::Nothing);
            cells[column as usize] = value;
        }
    }
    Ok(rows)
}

/// A text that is a number, which sheets hold where a program wrote them as text, or a text.
fn text_cell(text: &str) -> SheetCell {
    match numbers::cell(text, Decimal::Point) {
        numbers::Cell::Nothing => SheetCell::Nothing,
        numbers::Cell::Number(value) => SheetCell::Number(value),
        numbers::Cell::Text(text) => SheetCell::Text(text.into()),
    }
}

impl Sheet {
    fn find(name: String, mut rows: Vec<(u64, Vec<SheetCell>)>) -> Option<Self> {
        let numbers = |cells: &[SheetCell]| cells.iter().filter(|cell| matches!(cell, SheetCell::Number(_))).count();
        let first =
            (0..rows.len()).find(|&k| rows[k..rows.len().min(k + 3)].iter().all(|(_, cells)| numbers(cells) > 1))?;
        let columns = rows[first].1.len();
        let text = |cell: &SheetCell| match cell {
            SheetCell::Nothing => String::new(),
            SheetCell::Number(value) => value.to_string(),
            SheetCell::Text(text) => text.clone(),
        };
        let above: Vec<TopRow> = rows[..first]
            .iter()
            .map(|(line, cells)| TopRow { line: *line, cells: cells.iter().map(text).collect(), comment: false })
            .collect();
        let head = header::find(&above, columns);
        Some(Self { name, head, rows: rows.split_off(first) })
    }

    /// Titles of all columns.
    pub fn titles(&self) -> Vec<Title> {
        let mut titles = self.head.titles.clone();
        titles.resize(titles.len().max(self.rows[0].1.len()), Title::default());
        titles
    }
}
