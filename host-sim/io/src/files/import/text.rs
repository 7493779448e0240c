//! Text with rows of numbers: what separates them, where they begin, and the lines above.

use super::Hints;
use super::beginnings;
use super::clock;
use super::cut_off;
use super::header::{self, Head, TopRow};
use super::interval;
use super::lines::{Fault, Line, Row, is_comment, is_event, lines};
use super::names::Title;
use super::numbers::{self, Cell, Decimal, Signs};
use super::runs;
use super::separator::{Separator, bare};
use super::shape::{Kind, Shape};
use super::shifted::{SHIFTED, fewer_cells, more_cells, refuse_counted, refuse_other_separator, refuse_shifted};
use super::units::{self, Unit};

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
    /// The last row if its end is missing; it is left out.
    pub cut_off: Option<&'a str>,
    /// Whether the ends of rows may be missing, as in a spreadsheet.
    pub sheet: bool,
    /// Number of columns.
    columns: usize,
    /// The first row of numbers.
    first: Line<'a>,
    /// First line and text of each run of rows; headers are between them.
    pub segments: Vec<(u64, &'a str)>,
}

/// Properties of a text that are known before it is read.
#[derive(Clone, Copy, Debug)]
pub struct Dialect<'a> {
    /// Options of the user.
    pub hints: &'a Hints,
    /// Whether a single column is a table: its times follow from a rate.
    pub single: bool,
    /// For the text of a spreadsheet, with tabs and decimal points: which of its columns have texts that can be read in two ways.
    pub sheet: Option<&'a [bool]>,
}

impl Dialect<'_> {
    /// The kind of a cell.
    pub fn kind(&self, cell: &str) -> Kind {
        let is_number = |sign: &Decimal| matches!(numbers::cell(cell, *sign), Cell::Number(_) | Cell::OutOfRange);
        if numbers::is_plain(cell) {
            return Kind::Number;
        }
        match numbers::cell(cell, Decimal::Point) {
            Cell::Nothing => Kind::Nothing,
            _ if [Decimal::Point, Decimal::Comma].iter().any(is_number) || clock::is_clock(cell) => Kind::Number,
            _ if self.hints.words.iter().any(|word| word == cell) => Kind::Nothing,
            _ => Kind::Text,
        }
    }
}

/// Rows of which the first cells are compared.
const FIRST: usize = 200;

impl<'a> TextTable<'a> {
    /// The rows in a `text` whose first line has the names: the dialect of this tool, with commas and decimal points.
    pub fn below_names(text: &'a str) -> Result<Self, Fault> {
        let mut rows = lines(text, 1).filter(|line| !is_comment(line.text));
        let end = || Line { number: lines(text, 1).last().map_or(1, |line| line.number + 1), text: "", rest: "" };
        let header = rows.next().unwrap_or_else(end);
        let titles: Vec<Title> = header.cells(Separator::Comma)?.into_iter().map(Title::new).collect();
        let first = rows.next().unwrap_or_else(end);
        let head = Head { line: header.number, titles, ..Head::default() };
        Ok(Self {
            cut_off: cut_off::row(first.rest, Separator::Comma, Decimal::Point),
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
    /// Fails where they are missing, or can be read in two ways.
    pub fn find(text: &'a str, dialect: &Dialect<'_>) -> Result<Self, Fault> {
        let lines: Vec<Line<'_>> = lines(text, 1).collect();
        let mut found: Vec<Self> = Vec::new();
        let possible: &[Separator] = if dialect.sheet.is_some() { &[Separator::Tab] } else { &Separator::ALL };
        for &separator in possible {
            // Blanks occur between other separators too: they count where nothing else does.
            if separator == Separator::Blanks && !found.is_empty() {
                break;
            }
            // A single column has no separator.
            if !(dialect.single && dialect.hints.decimal == Some(Decimal::Comma) && separator == Separator::Comma) {
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
            [one] => {
                refuse_other_separator(
                    &lines,
                    dialect.hints.header_line.unwrap_or(0),
                    one.first.number,
                    one.separator,
                )?;
                Ok(one.clone())
            }
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
    ) -> Result<Option<Self>, Fault> {
        let (comments, rows): (Vec<Line<'a>>, Vec<Line<'a>>) = lines.iter().partition(|line| is_comment(line.text));
        let kinds = |row: &Line<'_>| -> Vec<Kind> {
            separator.split(row.text).into_iter().map(|cell| dialect.kind(cell)).collect()
        };
        let Some(shape) = Shape::of_most(rows.len(), |row| kinds(&rows[row]), fewest) else { return Ok(None) };
        let below = dialect.hints.header_line.unwrap_or(0);
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
        let hides = |line: &Line<'_>| separator.split(line.text).iter().any(|cell| hides_numbers(cell, separator));
        if sample(&rows[first..]).iter().any(hides) {
            return Ok(None);
        }
        let data_line = rows[first].number;
        let cells = separator.split(rows[first].text);
        let columns = cells.iter().position(|cell| is_event(cell)).unwrap_or(cells.len());
        let top = |line: &Line<'a>, comment: bool| {
            let text = if comment { line.text.trim_start_matches(['#', '%', '!', ' ']) } else { line.text };
            TopRow { line: line.number, cells: header_cells(text, separator, columns), comment }
        };
        let mut above: Vec<TopRow> = rows[..first].iter().map(|line| top(line, false)).collect();
        above.extend(comments.iter().filter(|line| line.number < data_line).map(|line| top(line, true)));
        above.sort_by_key(|row| row.line);
        let mut head = header::find(&above, columns, dialect.hints.header_line)?;
        if is_of_r(&head, &rows[first], columns, separator) {
            head.titles.insert(0, Title::default());
        }
        // Columns that are known by their numbers need no names.
        if dialect.hints.choices.are_numbers() {
            head.titles.resize(head.titles.len().max(columns), Title::default());
        }
        if head.titles.iter().all(|title| title.name.is_empty()) {
            refuse_counted(&rows[first..], separator)?;
        }
        refuse_shifted(head.titles.len(), &rows[first], columns, separator)?;
        // A separator at the end of a row or of the header is no column.
        while head.titles.len() > columns && head.titles.last().is_some_and(|title| title.name.is_empty()) {
            head.titles.pop();
        }
        let columns = if head.titles.is_empty() { columns } else { head.titles.len() };
        let mut signs = vec![Signs::default(); columns];
        for line in &rows[first..] {
            signs.iter_mut().zip(separator.split(line.text)).for_each(|(signs, cell)| signs.count(cell));
        }
        let known = if dialect.sheet.is_some() { Some(Decimal::Point) } else { dialect.hints.decimal };
        let all = signs.iter().fold(Signs::default(), |all, column| all.and(*column));
        let shifted = |cause| (data_line, if separator == Separator::Comma { SHIFTED.into() } else { cause });
        let decimal = known.map_or_else(|| all.decimal().map_err(shifted), |known| Ok(Some(known)))?;
        let is_ambiguous = |(k, column): (usize, &Signs)| match dialect.sheet {
            _ if dialect.hints.decimal.is_some() => false,
            Some(texts) => texts.get(k) == Some(&true),
            None => column.is_ambiguous(decimal),
        };
        let ambiguous = signs.iter().enumerate().map(is_ambiguous).collect();
        let mut table = Self {
            head,
            separator,
            decimal: decimal.unwrap_or(Decimal::Point),
            ambiguous,
            footer: None,
            cut_off: None,
            sheet: dialect.sheet.is_some(),
            columns,
            first: rows[first],
            segments: Vec::new(),
        };
        let is_remark = |row: &Line<'_>| shape.is_remark(&kinds(row), &separator.split(row.text));
        let is_header = |row: &Line<'_>| {
            let cells = separator.split(row.text);
            cells.len() == columns && columns > 1 && cells.iter().all(|cell| dialect.kind(cell) == Kind::Text)
        };
        let faults = table.cut(&rows[first..], lines, is_remark, is_header, &|line| top(line, false));
        if let Some(wanted) = dialect.hints.segment {
            table.segments = table.runs();
            let found = table.segments.len();
            let segment = wanted.checked_sub(1).and_then(|index| table.segments.get(index));
            table.segments = vec![*segment.ok_or_else(|| (0, format!("`segment` {wanted}: there are {found}")))?];
        }
        if let Some((_, last)) = table.segments.last()
            && table.footer.is_none()
            && !table.sheet
        {
            table.cut_off = cut_off::row(last, separator, table.decimal);
        }
        let is_name = |row: &&TopRow| row.line == table.head.line;
        let above: Vec<(u64, &[String])> =
            above.iter().filter(|row| !is_name(row)).map(|row| (row.line, row.cells.as_slice())).collect();
        // Whole numbers do not show the decimal sign of the file.
        let sign = known.or(decimal.filter(|_| all.has_signs()));
        table.head.beginnings = beginnings::stated(&above, sign);
        if table.head.interval.is_none() {
            table.head.interval = interval::stated(&above, sign, || table.rows().count());
        }
        // Names and units are those of the first.
        let is_read = |line: u64| table.segments.iter().any(|(start, _)| *start == line);
        if let Some((_, fault)) = faults.into_iter().find(|(start, _)| is_read(*start)) {
            return Err(fault);
        }
        // Where the cells of a column are times of day, or increase.
        let starts: Vec<Vec<&str>> = rows[first..].iter().take(FIRST).map(|row| separator.split(row.text)).collect();
        let first_cells = |index: usize| starts.iter().filter_map(move |cells| cells.get(index).copied());
        let mut titles = table.titles();
        for (index, title) in titles.iter_mut().enumerate() {
            title.clock = first_cells(index).take(3).any(clock::is_clock);
            title.text = first_cells(index).take(3).all(|cell| dialect.kind(cell) == Kind::Text);
            let values: Vec<f64> = first_cells(index).filter_map(|cell| numbers::number(cell, table.decimal)).collect();
            title.increases = numbers::increase(&values);
        }
        if !table.head.titles.is_empty() || titles.iter().any(|title| title.clock) {
            table.head.titles = titles;
        }
        Ok(Some(table))
    }

    /// Cuts `rows`, the first and all lines below it, where the header is repeated, and at the remarks behind the last of them. Returns the
    /// first lines of runs below other names or units, with the error of each.
    fn cut(
        &mut self,
        rows: &[Line<'a>],
        lines: &[Line<'a>],
        is_remark: impl Fn(&Line<'_>) -> bool,
        is_header: impl Fn(&Line<'_>) -> bool,
        top: &dyn Fn(&Line<'a>) -> TopRow,
    ) -> Vec<(u64, Fault)> {
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
        let mut faults = Vec::new();
        let mut start = 0;
        for again in 1..rows.len() {
            let is_same = header == Some(rows[again].text.trim());
            if again <= start || !(is_same || is_header(&rows[again])) {
                continue;
            }
            let Some(next) = (again..rows.len()).find(|&row| !is_remark(&rows[row])) else { break };
            let end = before(start, again);
            self.segments.push(until(start, end));
            start = next;
            let above: Vec<TopRow> = rows[end..start].iter().map(top).collect();
            let line = rows[again].number;
            if let Ok(other) = header::find(&above, self.columns, Some(line))
                && let Some((one, other)) = self.head.differs(&other)
            {
                let cause = format!("{other} here is {one} in line {}; cut the file before this line", self.head.line);
                faults.push((rows[start].number, (line, cause)));
            }
        }
        if start < rows.len() {
            let end = before(start, rows.len());
            self.segments.push(until(start, end));
            self.footer = rows.get(end).map(|first| (rows.len() - end, first.text.trim()));
        }
        faults
    }

    /// The first line in which the cells of a column are another unit of the same quantity than before, and both units.
    pub fn mixed_units(&self) -> Option<(u64, [&'static str; 2])> {
        let mut first: Vec<Option<Unit>> = vec![None; self.columns];
        let cells =
            |(line, cells): Row<'a>| cells.into_iter().zip(0..self.columns).map(move |(cell, k)| (line, k, cell));
        for (line, index, cell) in self.rows().flatten().flat_map(cells) {
            let is_short = cell.starts_with(|c: char| c.is_alphabetic()) && cell.chars().count() < 4;
            let Some(unit) = is_short.then(|| units::read(cell, false)).flatten() else { continue };
            let before = *first[index].get_or_insert(unit);
            if before != unit && before.quantity == unit.quantity {
                return Some((line, [before.name, unit.name]));
            }
        }
        None
    }

    /// Titles of all columns, empty where there is no header.
    pub fn titles(&self) -> Vec<Title> {
        let mut titles = self.head.titles.clone();
        titles.resize(self.columns, Title::default());
        titles
    }

    /// First line and text of the runs of rows: below repeated headers, or else behind empty lines and where their numbers begin again.
    pub fn runs(&self) -> Vec<(u64, &'a str)> {
        match self.segments.as_slice() {
            [(first, text)] => runs::split(text, *first, self.separator),
            several => several.to_vec(),
        }
    }

    /// Line and cells of every row, or line and cause where it cannot be used.
    pub fn rows(&self) -> impl Iterator<Item = Result<Row<'a>, Fault>> + Clone {
        let all = self.segments.iter().flat_map(|(first, text)| lines(text, *first));
        let cut_off = self.cut_off;
        let is_whole = move |line: &Line<'_>| cut_off.is_none_or(|cut_off| !std::ptr::eq(line.text, cut_off));
        all.filter(move |line| !is_comment(line.text) && is_whole(line)).map(|line| {
            let cells = line.cells(self.separator)?;
            let more = cells.iter().skip(self.columns).find(|cell| !cell.is_empty());
            if more.is_some_and(|cell| !is_event(cell)) {
                return Err((line.number, more_cells(line.text, cells.len(), self.columns, self.separator)));
            }
            if self.separator == Separator::Blanks && cells.len() < self.columns {
                return Err((line.number, fewer_cells(cells.len(), self.columns)));
            }
            Ok((line.number, cells))
        })
    }
}

/// The beginning of `rows` and some all over them.
fn sample<'a>(rows: &[Line<'a>]) -> Vec<Line<'a>> {
    let every = (rows.len() / FIRST).max(1);
    rows.iter().take(FIRST).chain(rows.iter().step_by(every)).copied().collect()
}

/// Whether `cell` is several numbers that another separator separates: then `separator` is not the file's. Blanks may group the digits of
/// one number, but commas separate two.
fn hides_numbers(cell: &str, separator: Separator) -> bool {
    if separator != Separator::Comma && numbers::with_either_sign(cell).is_some() {
        return false;
    }
    Separator::ALL.iter().filter(|other| **other != separator && **other != Separator::Comma).any(|other| {
        let parts = other.split(cell);
        parts.len() > 1 && parts.iter().all(|part| numbers::is_number(part))
    })
}

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
    // `Rate: 0,5 Hz` is one cell.
    let is_decimal = |(at, _): (usize, &str)| {
        let is_digit = |c: char| c.is_ascii_digit();
        text[..at].ends_with(is_digit) && text[at + 1..].starts_with(is_digit)
    };
    let may_separate = |other: &&Separator| **other != Separator::Comma || !text.match_indices(',').any(is_decimal);
    let mut others = Separator::ALL.iter().filter(may_separate).map(|other| other.split(text));
    let other = others.find(|cells| cells.len() == columns && columns > 1);
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

/// Whether each row has its number in quotes before its cells, as R writes tables.
fn is_of_r(head: &Head, row: &Line<'_>, columns: usize, separator: Separator) -> bool {
    let number = row.text.strip_prefix('"').and_then(|rest| rest.split('"').next());
    columns == head.titles.len() + 1
        && number.is_some_and(numbers::all_digits)
        && row.text.matches('"').count() == 2
        && separator.split(row.text).len() == columns
}

/// Why there are no rows of numbers.
fn no_rows(lines: &[Line<'_>]) -> String {
    let first = lines.first().map_or("", |line| line.text.trim());
    let begin: String = first.chars().take(60).collect();
    // Below a header.
    let cells = lines.iter().take(FIRST).skip(1).flat_map(|line| Separator::ALL.map(|other| other.split(line.text)));
    if let Some(cell) = cells.flatten().find(|cell| units::is_behind_number(cell)) {
        return format!(
            "no rows of numbers: {cell:?} is a number with its unit; write the unit in the header, as in \"Voltage (kV)\", and numbers alone \
             below it, if all of a column have the same"
        );
    }
    format!(
        "no rows of numbers; there must be a header, such as time_s,voltage_v,displacement_m of a recording, and two rows of numbers at \
         least, separated by commas, semicolons, tabs, vertical bars or blanks; this begins with {begin:?}"
    )
}
