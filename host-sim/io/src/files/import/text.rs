//! Text with rows of numbers: what separates them, where they begin, and the lines above.

use super::clock;
use super::header::{self, Head, TopRow};
use super::names::Title;
use super::numbers::{self, Cell, Decimal, Signs};
use super::separator::{Separator, bare};
use super::shape::{Kind, Shape};

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
    /// Columns whose numbers can be read in two ways.
    pub ambiguous: Vec<bool>,
    /// Lines below the rows that are not numbers, and the first of them.
    pub footer: Option<(usize, &'a str)>,
    /// Whether the ends of rows may be missing, as in a spreadsheet.
    pub sheet: bool,
    /// Number of columns.
    columns: usize,
    /// The first row of numbers.
    first: Line<'a>,
    /// First line and text of each run of rows; headers are between them.
    segments: Vec<(u64, &'a str)>,
}

/// Properties of a text that are known before it is read.
#[derive(Clone, Copy, Debug, Default)]
pub struct Dialect<'a> {
    /// The decimal sign.
    pub decimal: Option<Decimal>,
    /// Line of the names.
    pub header_line: Option<u64>,
    /// Which run of rows is read, from one.
    pub segment: Option<usize>,
    /// Words for a reading that is missing.
    pub words: &'a [String],
    /// Whether a single column is a table: its times follow from a rate.
    pub single: bool,
    /// Whether it is the text of a spreadsheet: tabs and decimal points.
    pub sheet: bool,
}

impl Dialect<'_> {
    fn kind(&self, cell: &str) -> Kind {
        let is_number = |cell: &str| {
            [Decimal::Point, Decimal::Comma]
                .iter()
                .any(|d| matches!(numbers::cell(cell, *d), Cell::Number(_) | Cell::OutOfRange))
        };
        match numbers::cell(cell, Decimal::Point) {
            Cell::Nothing => Kind::Nothing,
            _ if is_number(cell) || clock::is_clock(cell) => Kind::Number,
            _ if self.words.iter().any(|word| word == cell) => Kind::Nothing,
            _ => Kind::Text,
        }
    }
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
        let mut rows = lines(text, 1).filter(|line| !is_comment(line.text));
        let end = || Line { number: lines(text, 1).last().map_or(1, |line| line.number + 1), text: "", rest: "" };
        let header = rows.next().unwrap_or_else(end);
        let titles: Vec<Title> = header.cells(Separator::Comma)?.into_iter().map(Title::new).collect();
        let first = rows.next().unwrap_or_else(end);
        let head = Head { line: header.number, titles, ..Head::default() };
        Ok(Self {
            columns: head.titles.len(),
            head,
            separator: Separator::Comma,
            decimal: Decimal::Point,
            ambiguous: Vec::new(),
            footer: None,
            sheet: false,
            first,
            segments: vec![(first.number, first.rest)],
        })
    }

    /// Finds the rows of numbers in `text`.
    ///
    /// # Errors
    ///
    /// Line (0 for the whole file) and cause if they are missing, or can be read in two ways.
    pub fn find(text: &'a str, dialect: &Dialect<'_>) -> Result<Self, (u64, String)> {
        let lines: Vec<Line<'_>> = lines(text, 1).collect();
        let mut found: Vec<Self> = Vec::new();
        let possible: &[Separator] = if dialect.sheet { &[Separator::Tab] } else { &Separator::ALL };
        for &separator in possible {
            // Blanks occur between other separators too: they count where nothing else does.
            if separator == Separator::Blanks && !found.is_empty() {
                break;
            }
            // A single column has no separator.
            if !(dialect.single && dialect.decimal == Some(Decimal::Comma) && separator == Separator::Comma) {
                found.extend(Self::with(&lines, separator, dialect, 2)?);
            }
        }
        for separator in possible.iter().take_while(|_| dialect.single) {
            if found.is_empty() {
                found.extend(Self::with(&lines, *separator, dialect, 1)?);
            }
        }
        // Of several readings, those that separate the names as the numbers.
        let has_names = |table: &Self| {
            let names = lines.iter().find(|line| line.number == table.head.line);
            let count = |line: &Line<'_>| table.separator.split(line.text).len();
            names.is_some_and(|names| count(names) == count(&table.first))
        };
        if found.len() > 1 && found.iter().any(has_names) {
            found.retain(has_names);
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

    /// The rows of at least `fewest` numbers, if `separator` is between them.
    fn with(
        lines: &[Line<'a>],
        separator: Separator,
        dialect: &Dialect<'_>,
        fewest: usize,
    ) -> Result<Option<Self>, (u64, String)> {
        let (comments, rows): (Vec<Line<'a>>, Vec<Line<'a>>) = lines.iter().partition(|line| is_comment(line.text));
        let kinds = |row: &Line<'_>| -> Vec<Kind> {
            separator.split(row.text).into_iter().map(|cell| dialect.kind(cell)).collect()
        };
        let Some(shape) = Shape::of_most(rows.len(), |row| kinds(&rows[row]), fewest) else { return Ok(None) };
        let below = dialect.header_line.unwrap_or(0);
        // Three rows of numbers: a preamble may have one of its own. A fault in the second or third row does not concern the header.
        let begins = |k: &usize| {
            rows[*k].number > below
                && shape.has(&kinds(&rows[*k]))
                && rows[k + 1..rows.len().min(k + 3)].iter().all(|row| shape.may_have(&kinds(row)))
        };
        // Settings may be beside the first rows of a file without names.
        let begins_at_once =
            below == 0 && !rows.is_empty() && rows.iter().take(3).all(|row| shape.may_have_settings(&kinds(row)));
        let first = if begins_at_once { Some(0) } else { (0..rows.len()).find(begins) };
        let Some(first) = first else { return Ok(None) };
        if sample(&rows[first..])
            .iter()
            .any(|line| separator.split(line.text).iter().any(|cell| hides_numbers(cell, separator)))
        {
            return Ok(None);
        }
        let data_line = rows[first].number;
        let columns = separator.split(rows[first].text).len();
        let top = |line: &Line<'a>, comment: bool| {
            let text = if comment { line.text.trim_start_matches(['#', '%', '!', ' ']) } else { line.text };
            TopRow { line: line.number, cells: header_cells(text, separator, columns), comment }
        };
        let mut above: Vec<TopRow> = rows[..first].iter().map(|line| top(line, false)).collect();
        above.extend(comments.iter().filter(|line| line.number < data_line).map(|line| top(line, true)));
        above.sort_by_key(|row| row.line);
        let mut head = header::find(&above, columns, dialect.header_line)?;
        refuse_shifted(&head, &rows[first], columns, separator)?;
        // A separator at the end of a row or of the header is no column.
        while head.titles.len() > columns && head.titles.last().is_some_and(|title| title.name.is_empty()) {
            head.titles.pop();
        }
        let columns = if head.titles.is_empty() { columns } else { head.titles.len() };
        let mut signs = vec![Signs::default(); columns];
        for line in &rows[first..] {
            signs.iter_mut().zip(separator.split(line.text)).for_each(|(signs, cell)| signs.count(cell));
        }
        let known = if dialect.sheet { Some(Decimal::Point) } else { dialect.decimal };
        let all = signs.iter().fold(Signs::default(), |all, column| all.and(*column));
        let shifted = |cause| (data_line, if separator == Separator::Comma { SHIFTED.into() } else { cause });
        let decimal = known.map_or_else(|| all.decimal().map_err(shifted), |known| Ok(Some(known)))?;
        let is_ambiguous = |column: &Signs| dialect.decimal.is_none() && column.is_ambiguous(decimal, dialect.sheet);
        let ambiguous = signs.iter().map(is_ambiguous).collect();
        let mut table = Self {
            head,
            separator,
            decimal: decimal.unwrap_or(Decimal::Point),
            ambiguous,
            footer: None,
            sheet: dialect.sheet,
            columns,
            first: rows[first],
            segments: Vec::new(),
        };
        table.cut(&rows[first..], lines, |row| shape.is_remark(&kinds(row), &separator.split(row.text)));
        if let Some(wanted) = dialect.segment {
            let found = table.segments.len();
            let segment = wanted.checked_sub(1).and_then(|index| table.segments.get(index));
            table.segments = vec![*segment.ok_or_else(|| (0, format!("`segment` {wanted}: there are {found}")))?];
        }
        // Where the cells of a column are times of day.
        let starts: Vec<Vec<&str>> = rows[first..].iter().take(3).map(|row| separator.split(row.text)).collect();
        let is_clock =
            |index: usize| starts.iter().any(|cells| cells.get(index).is_some_and(|cell| clock::is_clock(cell)));
        let mut titles = table.titles();
        titles.iter_mut().enumerate().for_each(|(index, title)| title.clock = is_clock(index));
        if !table.head.titles.is_empty() || titles.iter().any(|title| title.clock) {
            table.head.titles = titles;
        }
        Ok(Some(table))
    }

    /// Cuts `rows`, the first and all lines below it, where the header is repeated, and at the remarks behind the last of them.
    fn cut(&mut self, rows: &[Line<'a>], lines: &[Line<'a>], is_remark: impl Fn(&Line<'_>) -> bool) {
        let header = lines.iter().find(|line| line.number == self.head.line).map(|line| line.text.trim());
        let until = |from: usize, to: usize| {
            let whole = rows[from].rest;
            let text = rows.get(to).map_or(whole, |next| &whole[..whole.len() - next.rest.len()]);
            (rows[from].number, text)
        };
        let before = |from: usize, mut to: usize| {
            while to > from && is_remark(&rows[to - 1]) {
                to -= 1;
            }
            to
        };
        let mut start = 0;
        for again in (1..rows.len()).filter(|&row| header == Some(rows[row].text.trim())) {
            if again > start {
                self.segments.push(until(start, before(start, again)));
            }
            start = (again..rows.len()).find(|&row| !is_remark(&rows[row])).unwrap_or(rows.len());
        }
        if start < rows.len() {
            let end = before(start, rows.len());
            self.segments.push(until(start, end));
            self.footer = rows.get(end).map(|first| (rows.len() - end, first.text.trim()));
        }
    }

    /// Titles of all columns, empty where there is no header.
    pub fn titles(&self) -> Vec<Title> {
        let mut titles = self.head.titles.clone();
        titles.resize(self.columns, Title::default());
        titles
    }

    /// First lines of the runs of rows.
    pub fn starts(&self) -> Vec<u64> {
        self.segments.iter().map(|(line, _)| *line).collect()
    }

    /// Line and cells of every row, or line and cause where it cannot be used.
    pub fn rows(&self) -> impl Iterator<Item = Result<(u64, Vec<&'a str>), (u64, String)>> {
        let all = self.segments.iter().flat_map(|(first, text)| lines(text, *first));
        all.filter(|line| !is_comment(line.text)).map(|line| {
            let cells = line.cells(self.separator)?;
            if cells.iter().skip(self.columns).any(|cell| !cell.is_empty()) {
                return Err((line.number, more_cells(cells.len(), self.columns, self.separator)));
            }
            Ok((line.number, cells))
        })
    }
}

/// The same table as `text` with rows for columns, if its last lines are a name and numbers each, and one of the names `is_time`.
pub fn transposed(text: &str, is_time: impl Fn(&str) -> bool) -> Option<String> {
    let lines: Vec<Line<'_>> = lines(text, 1).filter(|line| !is_comment(line.text)).collect();
    let dialect = Dialect::default();
    for separator in Separator::ALL {
        let rows: Vec<Vec<&str>> = lines.iter().map(|line| separator.split(line.text)).collect();
        let length = rows.last().map_or(0, Vec::len);
        let is_series = |row: &Vec<&str>| {
            row.len() == length
                && dialect.kind(row[0]) == Kind::Text
                && row[1..].iter().all(|cell| dialect.kind(cell) != Kind::Text)
        };
        let begin = rows.iter().rposition(|row| !is_series(row)).map_or(0, |last| last + 1);
        let (above, series) = rows.split_at(begin);
        if length < 4
            || series.len() < 2
            || above.iter().any(|row| row.len() >= 3)
            || !series.iter().any(|row| is_time(row[0]))
        {
            continue;
        }
        let sign = if separator == Separator::Blanks { "\t" } else { separator.sign() };
        let row = |index: usize| series.iter().map(|row| row[index]).collect::<Vec<_>>();
        let names: Vec<String> = row(0).iter().map(|name| format!("\"{}\"", name.replace('"', ""))).collect();
        let rows = (1..length).map(row).filter(|row| row.iter().any(|cell| !cell.is_empty())).map(|row| row.join(sign));
        return Some(std::iter::once(names.join(sign)).chain(rows).collect::<Vec<_>>().join("\n"));
    }
    None
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

/// Whether `cell` is several numbers that another separator separates: then `separator` is not the file's. Blanks may group the digits of
/// one number, but commas separate two.
fn hides_numbers(cell: &str, separator: Separator) -> bool {
    let is_one = |decimal: &Decimal| numbers::number(cell, *decimal).is_some();
    if separator != Separator::Comma && [Decimal::Point, Decimal::Comma].iter().any(is_one) {
        return false;
    }
    Separator::ALL.iter().filter(|other| **other != separator && **other != Separator::Comma).any(|other| {
        let parts = other.split(cell);
        let is_number = |part: &&str| {
            [Decimal::Point, Decimal::Comma].iter().any(|d| matches!(numbers::cell(part, *d), Cell::Number(_)))
        };
        parts.len() > 1 && parts.iter().all(is_number)
    })
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
