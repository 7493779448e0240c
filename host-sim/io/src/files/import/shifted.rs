//! Rows whose cells are not below their names.

use super::lines::Line;
use super::numbers::{self, Decimal};
use super::separator::Separator;

pub const SHIFTED: &str =
    "some numbers have a decimal comma and some a decimal point; export them with a decimal point";

/// The error about a row of `cells` below a header of `titles`.
pub fn more_cells(cells: usize, titles: usize, separator: Separator) -> String {
    let cause = match separator {
        Separator::Comma => {
            "; decimal commas in a file separated by commas shift every value: export with a decimal point, or separated by \
             semicolons"
        }
        Separator::Blanks => "; names with blanks in them need quotes, or name the columns by number with `columns`",
        _ => "; every column needs a name, or name the columns by number with `columns`",
    };
    format!("{cells} cells below a header of {titles}{cause}")
}

/// Refuses rows without names of which the first counts the columns: it may be their names.
pub fn refuse_counted(rows: &[Line<'_>], separator: Separator) -> Result<(), (u64, String)> {
    let counts = |row: &Line<'_>| {
        let cells: Vec<&str> = separator.split(row.text).into_iter().skip_while(|cell| cell.is_empty()).collect();
        let first: Option<usize> = cells.first().and_then(|cell| cell.parse().ok());
        let is_next = |(k, cell): (usize, &&str)| first.is_some_and(|first| cell.parse() == Ok(first + k));
        cells.len() > 1 && first.is_some_and(|first| first < 2) && cells.iter().enumerate().all(is_next)
    };
    match rows {
        [first, second, ..] if counts(first) && !counts(second) => Err((
            first.number,
            format!(
                "{:?} may be the numbers of the columns or the first sample; if they are names, state `header_line` {}, otherwise write \
                 names above them",
                first.text.trim(),
                first.number
            ),
        )),
        _ => Ok(()),
    }
}

/// The error about a row of `cells` between blanks where there are more `columns`.
pub fn fewer_cells(cells: usize, columns: usize) -> String {
    format!(
        "{cells} cells below {columns} columns; between blanks an empty cell shifts those behind it: write NaN into it, or export the file \
         separated by commas or tabs"
    )
}

/// The line and the cause where commas separate the thousands of a number as they separate the cells of `rows`: such rows, and no others,
/// have that many more numbers than the shortest.
pub fn by_thousands<'a>(mut rows: impl Iterator<Item = (u64, Vec<&'a str>)> + Clone) -> Option<(u64, String)> {
    let is_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let begins = |cell: &str| {
        let digits = cell.trim_start_matches(['+', '-']);
        (1..=3).contains(&digits.len()) && is_digits(digits) && !digits.starts_with('0')
    };
    let follows = |cell: &str| {
        let (whole, broken) = cell.split_once('.').unwrap_or((cell, ""));
        whole.len() == 3 && is_digits(whole) && is_digits(broken)
    };
    let filled = |cells: &[&str]| cells.iter().rposition(|cell| !cell.is_empty()).map_or(0, |last| last + 1);
    let fewest = rows.clone().map(|(_, cells)| filled(&cells)).min()?;
    let (longer, _) = rows.clone().find(|(_, cells)| filled(cells) > fewest)?;
    let is_number = |cell: &&&str| numbers::number(cell, Decimal::Point).is_some();
    let is_shifted = |(_, cells): (u64, Vec<&str>)| {
        let filled = filled(&cells);
        let more = filled - fewest;
        let groups = cells.windows(2).filter(|pair| begins(pair[0]) && follows(pair[1])).count();
        let numbers_at_end = || cells[..filled].iter().rev().take_while(is_number).count();
        if more > 0 { groups >= more && numbers_at_end() >= more } else { groups == 0 }
    };
    rows.all(is_shifted).then(|| {
        let cause = "commas separate the cells and the thousands of numbers, as in 1,036.5, which shifts the values behind them; export \
                     without thousands, with quotes, or separated by semicolons";
        (longer, cause.into())
    })
}
