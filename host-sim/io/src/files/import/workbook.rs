//! Workbooks of spreadsheets (.xlsx).

use std::io::Cursor;
use std::panic::{self, AssertUnwindSafe};

use calamine::{DataRef, Reader, Xlsx};

use super::clock::DAY_S;
use super::numbers::{self, Decimal, Signs};

/// A spreadsheet as text: cells between tabs, numbers with a decimal point.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// Its name.
    pub name: String,
    /// Its rows, a line each.
    pub text: String,
    /// Columns of texts that can be read as numbers in two ways, or beside numbers: a spreadsheet of another country reads 1.234 as 1234.
    pub ambiguous: Vec<bool>,
}

/// Cells of a column.
#[derive(Clone, Copy, Default)]
struct Cells {
    numbers: usize,
    texts: Signs,
}

impl Cells {
    fn are_ambiguous(self) -> bool {
        let signs = Signs { plain: 0, ..self.texts };
        let beside_numbers = self.numbers > 0 && signs != Signs::default();
        beside_numbers || signs.commas > 0 || signs.is_ambiguous(signs.decimal().ok().flatten())
    }
}

/// Most columns: a workbook may have cells far out.
const MAX_COLUMNS: u32 = 1000;
/// Most rows that a workbook can have.
const MAX_ROWS: u32 = 1 << 20;

/// The sheets of the workbook `bytes`; the one that is named `only`, if a name is given. Texts are numbers with the sign `decimal` if it is
/// given.
pub fn sheets(bytes: Vec<u8>, only: Option<&str>, decimal: Option<Decimal>) -> Result<Vec<Sheet>, String> {
    // The reader of the workbook is another's, and some damaged ones make it panic: that is a finding here, and no report of it is
    // printed.
    let hook = panic::take_hook();
    panic::set_hook(Box::new(|_| {}));
    let sheets = panic::catch_unwind(AssertUnwindSafe(|| read(bytes, only, decimal)));
    panic::set_hook(hook);
    sheets.unwrap_or_else(|_| Err("a damaged workbook; save it again".into()))
}

fn read(bytes: Vec<u8>, only: Option<&str>, decimal: Option<Decimal>) -> Result<Vec<Sheet>, String> {
    let mut book = Xlsx::new(Cursor::new(bytes)).map_err(|error| {
        format!("this is a ZIP archive and no workbook that can be read ({error}); unpack it, or save the spreadsheet as .xlsx")
    })?;
    let names = book.sheet_names();
    if let Some(only) = only.filter(|only| !names.iter().any(|name| name == only)) {
        return Err(format!("no spreadsheet {only:?}; there are {}", names.join(", ")));
    }
    let read = |name: String| {
        let (text, cells) = rows(&mut book, &name, decimal)?;
        Ok(Sheet { name, text, ambiguous: cells.into_iter().map(Cells::are_ambiguous).collect() })
    };
    names.into_iter().filter(|name| only.is_none_or(|only| only == name)).map(read).collect()
}

/// A date with its time, or a duration, as [`super::clock`] reads it. Days have a resolution of a microsecond.
fn stamp(days: f64) -> String {
    let seconds = (days - days.floor()) * DAY_S;
    format!("@{} {}", days.floor(), (seconds * 1e5).round() / 1e5)
}

/// The rows of a sheet, and the kinds of cells in its columns.
fn rows(
    book: &mut Xlsx<Cursor<Vec<u8>>>,
    name: &str,
    decimal: Option<Decimal>,
) -> Result<(String, Vec<Cells>), String> {
    let fault = |error: calamine::XlsxError| format!("spreadsheet {name:?}: {error}; save it again");
    let mut reader = book.worksheet_cells_reader(name).map_err(fault)?;
    let (mut cells, mut columns) = (Vec::new(), Vec::new());
    while let Some(cell) = reader.next_cell().map_err(fault)? {
        let (row, column) = cell.get_position();
        if column >= MAX_COLUMNS || row >= MAX_ROWS {
            continue;
        }
        columns.resize(columns.len().max(column as usize + 1), Cells::default());
        let kinds: &mut Cells = &mut columns[column as usize];
        let mut as_number = |text: &str| match decimal.and_then(|decimal| numbers::number(text.trim(), decimal)) {
            Some(number) => number.to_string(),
            None => {
                kinds.texts.count(text);
                text.replace(char::is_control, " ")
            }
        };
        let value = match cell.get_value() {
            DataRef::Int(value) => value.to_string(),
            DataRef::Float(value) => {
                kinds.numbers += 1;
                value.to_string()
            }
            DataRef::String(text) => as_number(text),
            DataRef::SharedString(text) => as_number(text),
            DataRef::Bool(value) => value.to_string(),
            DataRef::DateTime(days) => stamp(days.as_f64()),
            DataRef::DateTimeIso(text) | DataRef::DurationIso(text) => text.clone(),
            // Such as #N/A: no reading.
            DataRef::Error(_) | DataRef::Empty => continue,
        };
        cells.push(((row, column), value));
    }
    // Some writers have rows in another order.
    cells.sort_by_key(|(place, _)| *place);
    cells.dedup_by_key(|(place, _)| *place);
    let mut text = String::new();
    let mut place = (0, 0);
    for ((row, column), value) in cells {
        while place.0 < row {
            text.push('\n');
            place = (place.0 + 1, 0);
        }
        while place.1 < column {
            text.push('\t');
            place.1 += 1;
        }
        // Quotes are letters here.
        text.push_str(&value.replace('"', "'"));
    }
    Ok((text, columns))
}
