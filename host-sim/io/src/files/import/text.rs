//! Text with rows of numbers: what separates them, where they begin, and the lines above.

use super::header::{self, Head, TopRow};
use super::names::Title;
use super::numbers::{self, Cell, Decimal, Signs};

/// Separator of the cells of a row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Separator {
    /// Tab stops.
    Tab,
    /// Semicolons.
    Semicolon,
    /// Commas.
    Comma,
    /// Blanks, any number of them.
    Blanks,
}

impl Separator {
    /// In their order; blanks occur beside other separators as well.
    const ALL: [Self; 4] = [Self::Tab, Self::Semicolon, Self::Comma, Self::Blanks];

    /// For a sentence: separated by …
    pub fn name(self) -> &'static str {
        match self {
            Self::Tab => "tabs",
            Self::Semicolon => "semicolons",
            Self::Comma => "commas",
            Self::Blanks => "blanks",
        }
    }

    fn is(self, c: char) -> bool {
        match self {
            Self::Tab => c == '\t',
            Self::Semicolon => c == ';',
            Self::Comma => c == ',',
            Self::Blanks => c == ' ' || c == '\t',
        }
    }

    /// The cells of `line`, without the quotes around them.
    pub fn split(self, line: &str) -> Vec<&str> {
        self.cells(line).0
    }

    /// The cells of `line`, and whether the last has a quote that is not closed. A quote inside a cell is a letter; one that begins a
    /// cell holds separators in it.
    fn cells(self, line: &str) -> (Vec<&str>, bool) {
        let mut cells = Vec::new();
        let line = if self == Self::Blanks { line.trim() } else { line };
        let (mut start, mut quoted) = (0, false);
        for (at, c) in line.char_indices() {
            if c == '"' {
                // Two quotes in a quoted cell are a letter: the second opens it again.
                let opens = line[start..at].trim_start();
                quoted = !quoted && (opens.is_empty() || opens.ends_with('"'));
            } else if !quoted && self.is(c) {
                cells.push(bare(&line[start..at]));
                start = at + c.len_utf8();
            }
        }
        cells.push(bare(&line[start..]));
        if self == Self::Blanks {
            cells.retain(|cell| !cell.is_empty());
        }
        (cells, quoted)
    }
}

fn bare(cell: &str) -> &str {
    let cell = cell.trim();
    cell.strip_prefix('"').and_then(|cell| cell.strip_suffix('"')).map_or(cell, str::trim)
}

/// A line of the text.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Line<'a> {
    number: u64,
    text: &'a str,
    /// Text from its beginning on.
    rest: &'a str,
}

/// Rows of numbers in a text.
#[derive(Clone, Debug, PartialEq)]
pub struct TextTable<'a> {
    /// Lines above them.
    pub head: Head,
    /// Separator of the cells.
    pub separator: Separator,
    /// How numbers are written.
    pub decimal: Decimal,
    /// Number of columns.
    columns: usize,
    /// The first row of numbers.
    first: Line<'a>,
    /// Text from that row on.
    rows: &'a str,
}

/// Longest line, in bytes.
const MAX_LINE: usize = 1 << 16;

impl<'a> TextTable<'a> {
    /// The rows in a `text` whose first line has the names: the dialect of this tool, with commas and decimal points.
    ///
    /// # Errors
    ///
    /// Line and cause where the names cannot be read.
    pub fn below_names(text: &'a str) -> Result<Self, (u64, String)> {
        let mut lines = lines(text, 1).filter(|line| !is_comment(line.text));
        let end = text.lines().count() as u64 + 1;
        let header = lines.next().unwrap_or(Line { number: end, text: "", rest: "" });
        let titles: Vec<Title> = header.cells(Separator::Comma)?.into_iter().map(Title::new).collect();
        let first = lines.next().unwrap_or(Line { number: end, text: "", rest: "" });
        let head = Head { line: header.number, titles, ..Head::default() };
        let (columns, rows) = (head.titles.len(), first.rest);
        Ok(Self { head, separator: Separator::Comma, decimal: Decimal::Point, columns, first, rows })
    }

    /// Finds the rows of numbers in `text`.
    ///
    /// # Errors
    ///
    /// Line (0 for the whole file) and cause if they are missing, or can be read in two ways.
    pub fn find(text: &'a str) -> Result<Self, (u64, String)> {
        let lines: Vec<Line<'_>> = lines(text, 1).collect();
        let mut found: Vec<Self> = Vec::new();
        for separator in Separator::ALL {
            // Blanks occur between other separators too: they count where nothing else does.
            if separator == Separator::Blanks && !found.is_empty() {
                break;
            }
            found.extend(Self::with(&lines, separator)?);
        }
        match found.as_slice() {
            [one] => Ok(one.clone()),
            [first, second, ..] => {
                let row = first.first;
                let shown = |table: &Self| {
                    format!("separated by {}: {}", table.separator.name(), table.separator.split(row.text).join(" | "))
                };
                Err((row.number, format!("can be read in two ways: {}; or {}", shown(first), shown(second))))
            }
            [] => Err((0, no_rows(&lines))),
        }
    }

    /// The rows of numbers, if `separator` is between them.
    fn with(lines: &[Line<'a>], separator: Separator) -> Result<Option<Self>, (u64, String)> {
        let (comments, rows): (Vec<Line<'a>>, Vec<Line<'a>>) = lines.iter().partition(|line| is_comment(line.text));
        // Cells of a row, and numbers among them.
        let counts = |line: &Line<'_>| {
            let cells = separator.split(line.text);
            let numbers =
                |decimal| cells.iter().filter(|cell| matches!(numbers::cell(cell, decimal), Cell::Number(_))).count();
            (cells.len(), numbers(Decimal::Point).max(numbers(Decimal::Comma)))
        };
        // Three rows of numbers: a preamble may have one of its own. A fault in the second or third row does not concern the header.
        let begins = |k: &usize| {
            let (columns, numbers) = counts(&rows[*k]);
            let follows = |line: &Line<'_>| matches!(counts(line), (cells, n) if n > 1 || n == 1 && cells == columns);
            numbers > 1 && rows[k + 1..rows.len().min(k + 3)].iter().all(follows)
        };
        let Some(first) = (0..rows.len()).find(begins) else {
            return Ok(None);
        };
        let sample: Vec<Line<'a>> = sample(&rows[first..]);
        if sample.iter().any(|line| separator.split(line.text).iter().any(|cell| hides_numbers(cell, separator))) {
            return Ok(None);
        }
        let mut signs = Signs::default();
        for line in &rows[first..] {
            separator.split(line.text).iter().for_each(|cell| signs.count(cell));
        }
        let data_line = rows[first].number;
        let decimal = decimal(signs, separator).map_err(|cause| (data_line, cause))?;
        let columns = separator.split(rows[first].text).len();
        let top = |line: &Line<'a>, comment: bool| {
            let text = if comment { line.text.trim_start_matches(['#', '%', '!', ' ']) } else { line.text };
            TopRow { line: line.number, cells: header_cells(text, separator, columns), comment }
        };
        let mut above: Vec<TopRow> = rows[..first].iter().map(|line| top(line, false)).collect();
        above.extend(comments.iter().filter(|line| line.number < data_line).map(|line| top(line, true)));
        let mut head = header::find(&above, columns);
        refuse_shifted(&head, &rows[first], columns, separator)?;
        // A separator at the end of a row or of the header is no column.
        while head.titles.len() > columns && head.titles.last().is_some_and(|title| title.name.is_empty()) {
            head.titles.pop();
        }
        let (titles, first) = (head.titles.len(), rows[first]);
        let columns = if titles == 0 { columns } else { titles };
        Ok(Some(Self { head, separator, decimal, columns, first, rows: first.rest }))
    }

    /// Titles of all columns, empty where there is no header.
    pub fn titles(&self) -> Vec<Title> {
        let mut titles = self.head.titles.clone();
        titles.resize(self.columns, Title::default());
        titles
    }

    /// Line and cells of every row, or line and cause where it cannot be used.
    pub fn rows(&self) -> impl Iterator<Item = Result<(u64, Vec<&'a str>), (u64, String)>> {
        lines(self.rows, self.first.number).filter(|line| !is_comment(line.text)).map(|line| {
            let cells = line.cells(self.separator)?;
            if cells.iter().skip(self.columns).any(|cell| !cell.is_empty()) {
                return Err((line.number, more_cells(cells.len(), self.columns, self.separator)));
            }
            Ok((line.number, cells))
        })
    }
}

impl<'a> Line<'a> {
    /// Its cells, between `separator`.
    ///
    /// # Errors
    ///
    /// Its number and why it cannot be used.
    fn cells(&self, separator: Separator) -> Result<Vec<&'a str>, (u64, String)> {
        if self.text.len() > MAX_LINE {
            let cause = format!("a line of more than {MAX_LINE} characters; this is not a table of numbers");
            return Err((self.number, cause));
        }
        match separator.cells(self.text) {
            (_, true) => Err((self.number, "a quote is not closed on this line".into())),
            (cells, false) => Ok(cells),
        }
    }
}

/// The lines of `text` that are not blank; the first of all is number `number`. Line ends of all systems end them.
fn lines(text: &str, mut number: u64) -> impl Iterator<Item = Line<'_>> {
    let mut rest = text;
    let next = move || {
        if rest.is_empty() {
            return None;
        }
        let (number_here, begin) = (number, rest);
        let end = rest.find(['\n', '\r']).unwrap_or(rest.len());
        let (line, after) = rest.split_at(end);
        rest = after.strip_prefix("\r\n").or_else(|| after.strip_prefix(['\n', '\r'])).unwrap_or(after);
        number += 1;
        Some(Line { number: number_here, text: line, rest: begin })
    };
    std::iter::from_fn(next).filter(|line| !line.text.trim().is_empty())
}

fn is_comment(line: &str) -> bool {
    line.trim_start().starts_with(['#', '%'])
}

/// The beginning of `rows` and some all over them.
fn sample<'a>(rows: &[Line<'a>]) -> Vec<Line<'a>> {
    const COUNT: usize = 200;
    let every = (rows.len() / COUNT).max(1);
    rows.iter().take(COUNT).chain(rows.iter().step_by(every)).copied().collect()
}

/// Whether `cell` is several numbers that another separator separates: then `separator` is not the file's.
fn hides_numbers(cell: &str, separator: Separator) -> bool {
    Separator::ALL.iter().filter(|other| **other != separator && **other != Separator::Comma).any(|other| {
        let parts = other.split(cell);
        let is_number = |part: &&str| {
            [Decimal::Point, Decimal::Comma].iter().any(|d| matches!(numbers::cell(part, *d), Cell::Number(_)))
        };
        parts.len() > 1 && parts.iter().all(is_number)
    })
}

/// How numbers are written, from their `signs`.
fn decimal(signs: Signs, separator: Separator) -> Result<Decimal, String> {
    let Signs { points, commas, thousands, both } = signs;
    if both > 0 {
        return Err("numbers have a separator of thousands, such as 1,234.5; export them without it".into());
    }
    match (points, commas) {
        (0, 0) => Ok(Decimal::Point),
        (_, 0) => Ok(Decimal::Point),
        (0, _) if thousands == commas => {
            Err("can be read in two ways: numbers such as 1,234 are 1.234 with a decimal comma, or 1234 with a separator of \
                 thousands; export them with a decimal point"
                .into())
        }
        (0, _) => Ok(Decimal::Comma),
        _ if separator == Separator::Comma => Err(SHIFTED.into()),
        _ => Err("numbers have decimal points and decimal commas in one file; export them with one of both".into()),
    }
}

const SHIFTED: &str = "some numbers have a decimal comma and some a decimal point; export them with a decimal point";

/// The names of a header, which may be separated otherwise than the `columns` of numbers.
fn header_cells(text: &str, separator: Separator, columns: usize) -> Vec<String> {
    let owned = |cells: Vec<&str>| cells.into_iter().map(str::to_owned).collect::<Vec<String>>();
    let cells = separator.split(text);
    if cells.len() == columns {
        return owned(cells);
    }
    if separator == Separator::Blanks {
        let wide: Vec<&str> =
            text.split("  ").flat_map(|part| part.split('\t')).map(bare).filter(|c| !c.is_empty()).collect();
        if wide.len() == columns {
            return owned(wide);
        }
        let merged = with_units(&cells);
        if merged.len() == columns {
            return merged;
        }
    }
    let other =
        Separator::ALL.iter().map(|other| other.split(text)).find(|cells| cells.len() == columns && columns > 1);
    match other {
        Some(other) if cells.len() == 1 => owned(other),
        _ => owned(cells),
    }
}

/// Words with the unit in brackets that follows them: `Time (s)` is one cell.
fn with_units(cells: &[&str]) -> Vec<String> {
    let mut merged: Vec<String> = Vec::new();
    for cell in cells {
        match merged.last_mut() {
            Some(last) if cell.starts_with(['(', '[', '{', '/']) => {
                last.push(' ');
                last.push_str(cell);
            }
            _ => merged.push((*cell).to_owned()),
        }
    }
    merged
}

/// Refuses rows with more cells than the header.
fn refuse_shifted(head: &Head, row: &Line<'_>, columns: usize, separator: Separator) -> Result<(), (u64, String)> {
    let titles = head.titles.len();
    if titles == 0 || columns <= titles {
        return Ok(());
    }
    if separator.split(row.text)[titles..].iter().all(|cell| cell.is_empty()) {
        return Ok(());
    }
    Err((row.number, more_cells(columns, titles, separator)))
}

/// The error about a row of `cells` below a header of `titles`.
fn more_cells(cells: usize, titles: usize, separator: Separator) -> String {
    let cause = match separator {
        Separator::Comma => {
            "; decimal commas in a file separated by commas shift every value: export with a decimal point, or separated by \
             semicolons"
        }
        Separator::Blanks => "; names with blanks in them need quotes, or name the columns by number with `columns`",
        _ => "; every column needs a name",
    };
    format!("{cells} cells below a header of {titles}{cause}")
}

/// Why there are no rows of numbers.
fn no_rows(lines: &[Line<'_>]) -> String {
    let first = lines.first().map_or("", |line| line.text.trim());
    let begin: String = first.chars().take(60).collect();
    format!(
        "no rows of numbers; there must be a header, such as time_s,voltage_v,displacement_m of a recording, and two rows of numbers at \
         least, separated by commas, semicolons, tabs or blanks; this begins with {begin:?}"
    )
}
