//! Rows whose cells are not below their names.

use super::chosen::Chosen;
use super::clock;
use super::lines::{Fault, Line, Row};
use super::names::{self, Title};
use super::numbers::{self, Decimal, all_digits};
use super::separator::Separator;

pub const SHIFTED: &str =
    "some numbers have a decimal comma and some a decimal point; export them with a decimal point";

/// The error about a `row` of `cells` below a header of `titles`.
pub fn more_cells(row: &str, cells: usize, titles: usize, separator: Separator) -> String {
    let cause = match separator {
        Separator::Comma if row.contains('.') => {
            "; every column needs a name, and commas within a text or a number need quotes around it"
        }
        Separator::Comma => {
            "; decimal commas in a file separated by commas shift every value: export with a decimal point, or separated by \
             semicolons"
        }
        Separator::Blanks => "; names with blanks in them need quotes, or name the columns by number with `columns`",
        _ => "; every column needs a name, or name the columns by number with `columns`",
    };
    format!("{cells} cells below a header of {titles}{cause}")
}

/// Refuses rows of `columns` cells below a header of fewer `titles`.
pub fn refuse_shifted(titles: usize, row: &Line<'_>, columns: usize, separator: Separator) -> Result<(), Fault> {
    let has_more = || separator.split(row.text)[titles..].iter().any(|cell| !cell.is_empty());
    if titles > 0 && columns > titles && has_more() {
        return Err((row.number, more_cells(row.text, columns, titles, separator)));
    }
    Ok(())
}

/// Refuses rows without names of which the first counts the columns: it may be their names.
pub fn refuse_counted(rows: &[Line<'_>], separator: Separator) -> Result<(), Fault> {
    let counts = |row: &Line<'_>| {
        let cells: Vec<&str> = separator.split(row.text).into_iter().skip_while(|cell| cell.is_empty()).collect();
        let first: Option<usize> = cells.first().and_then(|cell| cell.parse().ok());
        let is_next = |(k, cell): (usize, &&str)| first.is_some_and(|first| cell.parse() == Ok(first + k));
        cells.len() > 1 && first.is_some_and(|first| first < 2) && cells.iter().enumerate().all(is_next)
    };
    match rows {
        [first, second, ..] if counts(first) && !counts(second) => {
            let (text, number) = (first.text.trim(), first.number);
            let cause = format!(
                "{text:?} may be the numbers of the columns or the first sample; if they are names, state `header_line` {number}, otherwise \
                 write names above them"
            );
            Err((number, cause))
        }
        _ => Ok(()),
    }
}

/// Refuses a table whose first row has this number where several of `lines` above it, behind that of the names if it is known, are rows of
/// numbers between another separator.
pub fn refuse_other_separator(lines: &[Line<'_>], names: u64, first: u64, separator: Separator) -> Result<(), Fault> {
    const MIN_ROWS: usize = 3;
    let above = || lines.iter().filter(|line| (names + 1..first).contains(&line.number));
    let is_number = |cell: &&str| numbers::is_plain(cell);
    for other in Separator::ALL.into_iter().filter(|other| *other != separator) {
        let is_row = |line: &&Line<'_>| {
            let cells = other.split(line.text);
            cells.len() > 1 && cells.iter().all(is_number)
        };
        if let Some(row) = above().find(is_row).filter(|_| above().filter(is_row).count() >= MIN_ROWS) {
            let (name, other, line) = (separator.name(), other.name(), row.number);
            let cause = format!(
                "{name} separate the cells from here on, and {other} those of the rows of numbers from line {line} on; write all rows with one \
                 separator, or remove the lines that are no rows"
            );
            return Err((first, cause));
        }
    }
    Ok(())
}

/// The error about a row of `cells` between blanks where there are more `columns`.
pub fn fewer_cells(cells: usize, columns: usize) -> String {
    format!(
        "{cells} cells below {columns} columns; between blanks an empty cell shifts those behind it: write NaN into it, or export the file \
         separated by commas or tabs"
    )
}

/// The line and the cause where a comma may be a decimal sign as well as a separator: a cell that is read begins with a zero.
pub fn by_fraction<'a>(mut rows: impl Iterator<Item = Row<'a>>, is_read: impl Fn(usize) -> bool) -> Option<Fault> {
    let is_fraction = |cell: &str| cell.len() > 1 && cell.starts_with('0') && all_digits(cell);
    rows.find_map(|(line, cells)| {
        let cell = cells.iter().enumerate().find(|(index, cell)| is_read(*index) && is_fraction(cell))?.1;
        let cause = format!(
            "{cell:?} may be the digits behind a decimal comma, which shifts the values; export with a decimal point, or separated by \
             semicolons; if it is a number of its own, name the columns by number with `columns`"
        );
        Some((line, cause))
    })
}

/// The first line and the cause where commas may be the decimal signs or the thousands of all `rows` as well as their separators: they are
/// shifted by as many cells as there is room for behind the last column that has a name and is read.
pub fn into_spare<'a>(
    mut rows: impl Iterator<Item = Row<'a>> + Clone,
    titles: &[Title],
    is_read: impl Fn(usize) -> bool,
) -> Option<Fault> {
    let named = titles.iter().rposition(|title| !title.name.is_empty())? + 1;
    let (line, cells) = rows.clone().next()?;
    // Without a cell more than there are names, and values in the last, nothing can be shifted.
    let has_number = |cells: &[&str]| cells.iter().any(|cell| numbers::is_plain(cell));
    let has_room = |cells: &[&str]| {
        cells.len() > named && (!is_read(named - 1) || has_number(&cells[named..])) && has_number(&cells[named - 1..])
    };
    let is_whole = |cell: &&str| !cell.contains('.');
    let pairs = |cells: &[&str]| cells.windows(2).any(|pair| is_group(pair[0], pair[1]));
    let is_spare = |(_, cells): Row<'_>| has_room(&cells);
    let are_whole = || rows.clone().all(|(_, cells)| cells.iter().all(is_whole));
    let are_grouped = || rows.clone().all(|(_, cells)| pairs(&cells));
    let may_shift = has_room(&cells) && (are_whole() || are_grouped());
    (may_shift && rows.all(is_spare)).then(|| {
        let cause = "the rows have a cell more than there are names: some commas may be decimal signs or separate thousands, which shifts the \
                     values; export with a decimal point and without thousands, or separated by semicolons; if the commas only separate cells, \
                     name the columns by number with `columns`";
        (line, cause.into())
    })
}

/// The line and the cause where commas separate the thousands of a number as they separate the cells of `rows`: such rows, and no others,
/// have that many more numbers than the shortest.
pub fn by_thousands<'a>(mut rows: impl Iterator<Item = Row<'a>> + Clone) -> Option<Fault> {
    let filled = |cells: &[&str]| cells.iter().rposition(|cell| !cell.is_empty()).map_or(0, |last| last + 1);
    let fewest = rows.clone().map(|(_, cells)| filled(&cells)).min()?;
    let (longer, _) = rows.clone().find(|(_, cells)| filled(cells) > fewest)?;
    let is_number = |cell: &&&str| numbers::number(cell, Decimal::Point).is_some();
    let is_shifted = |(_, cells): Row<'_>| {
        let filled = filled(&cells);
        let more = filled - fewest;
        let groups = cells.windows(2).filter(|pair| is_group(pair[0], pair[1])).count();
        let numbers_at_end = || cells[..filled].iter().rev().take_while(is_number).count();
        if more > 0 { groups >= more && numbers_at_end() >= more } else { groups == 0 }
    };
    rows.all(is_shifted).then(|| {
        let cause = "commas separate the cells and the thousands of numbers, as in 1,036.5, which shifts the values behind them; export \
                     without thousands, with quotes, or separated by semicolons";
        (longer, cause.into())
    })
}

/// Whether two cells may be one number whose thousands a comma separates: 1 and 036.5.
fn is_group(first: &str, second: &str) -> bool {
    let digits = first.trim_start_matches(['+', '-']);
    let (whole, broken) = second.split_once('.').unwrap_or((second, ""));
    (1..=3).contains(&digits.len())
        && all_digits(digits)
        && !digits.starts_with('0')
        && whole.len() == 3
        && all_digits(whole)
        && all_digits(broken)
}

/// The line and the cause where the first column counts the rows, the second may be the times, and the last has no name: the names may
/// begin at the second.
pub fn by_counts<'a>(rows: impl Iterator<Item = Row<'a>> + Clone, titles: &[Title]) -> Option<Fault> {
    let [first, second, .., last] = titles else { return None };
    let (line, cells) = rows.clone().next()?;
    let start: u64 = cells[0].parse().ok().filter(|start| *start < 2)?;
    let is_whole = |(k, (_, cells)): (u64, Row<'_>)| {
        cells[0].parse() == Ok(start + k) && cells.len() == titles.len() && cells.last().is_some_and(|c| !c.is_empty())
    };
    let may_shift = !first.name.is_empty() && last.name.is_empty() && second.increases;
    (may_shift && (0..).zip(rows).all(is_whole)).then(|| {
        let cause = format!(
            "column 1 {:?} counts the rows and the last column has no name: it may be the times, or the names may be one column too far left; \
             name all columns in the header, or choose them by number with `columns`",
            first.name
        );
        (line, cause)
    })
}

/// The line and the cause where the cells right of times of whole seconds may be their milliseconds, behind a decimal comma, and the last
/// column, which is not used and has no unit, has room for the cell that is too many.
pub fn by_milliseconds<'a>(
    mut rows: impl Iterator<Item = Row<'a>> + Clone,
    titles: &[Title],
    chosen: &[Chosen],
) -> Option<Fault> {
    const DIGITS: usize = 3;
    let time = chosen.first().filter(|column| titles[column.index].clock)?.index;
    let end = titles.len().checked_sub(1).filter(|end| *end > time + 1)?;
    let may_be_remark = !names::may_be_read(&titles[end]) && chosen.iter().all(|column| column.index != end);
    let is_part = names::may_be_time(titles.get(time + 1)?);
    let may_shift = |(_, cells): Row<'_>| {
        let is_whole = cells.get(time).and_then(|cell| clock::stamp(cell)).is_some_and(|stamp| stamp.is_whole());
        let has_digits = |cell: &&str| cell.len() == DIGITS && all_digits(cell);
        is_whole && cells.get(time + 1).is_some_and(has_digits) && cells.get(end).is_some_and(|c| numbers::is_plain(c))
    };
    let (line, cells) = rows.clone().next()?;
    (may_be_remark && !is_part && rows.all(may_shift)).then(|| {
        let cause = format!(
            "{:?} right of {:?} may be a reading, or the milliseconds behind a decimal comma, which shifts the values; write the times with a \
             point, or choose the columns by number with `columns`",
            cells[time + 1], cells[time]
        );
        (line, cause)
    })
}
