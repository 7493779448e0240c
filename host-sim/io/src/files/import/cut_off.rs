//! The last row of a text that ends in the middle of it: a log that was stopped, or a copy that was not finished.

use super::lines::{MAX_LINE, is_comment};
use super::numbers::{self, Cell, Decimal};
use super::separator::Separator;

/// Rows with which the last is compared, and how many there are at least.
const ROWS: usize = 40;
const MIN_ROWS: usize = 6;
/// The nearest of them, which have about as many digits as the last.
const NEAREST: usize = 8;
/// A number is another one where it is further from that before it than this many of the largest steps between those.
const FAR: f64 = 3.0;

/// The rows of `text`, the last one first.
fn rows(text: &str) -> impl Iterator<Item = &str> {
    text.rsplit(['\n', '\r']).filter(|line| !line.trim().is_empty() && !is_comment(line))
}

/// The last row of `text` if its end is missing: cells, or digits of its last number that all rows before it have.
pub(super) fn row(text: &str, separator: Separator, decimal: Decimal) -> Option<&str> {
    let mut rows = rows(text);
    let last = rows.next()?;
    let before: Vec<Vec<&str>> =
        rows.take(ROWS).take_while(|line| line.len() <= MAX_LINE).map(|line| separator.split(line)).collect();
    let cells = separator.split(last);
    let fewest = before.iter().map(Vec::len).min()?;
    if before.len() < MIN_ROWS || cells.len() > fewest || last.len() > MAX_LINE {
        return None;
    }
    let has_end = text.ends_with(['\n', '\r']);
    if cells.len() < fewest {
        return (!has_end).then_some(last);
    }
    let end = cells.len() - 1;
    let column: Vec<&str> = before.iter().map(|cells| cells[end]).collect();
    is_cut(cells[end], &column, decimal, has_end).then_some(last)
}

/// Whether the end of the number `cell` is missing, below those of `column`, the last of which is first. `has_end`: a line end follows it.
fn is_cut(cell: &str, column: &[&str], decimal: Decimal, has_end: bool) -> bool {
    let values: Option<Vec<f64>> = column.iter().map(|cell| numbers::number(cell, decimal)).collect();
    let Some(values) = values else { return false };
    let Cell::Number(value) = numbers::cell(cell, decimal) else {
        // A sign, an exponent without digits, or no digit at all, where all others are numbers.
        return !has_end && cell.chars().all(|c| c.is_ascii_digit() || "+-.,eEdD\u{2212}\u{2013}".contains(c));
    };
    let digits = |cell: &str| Digits::new(cell, decimal);
    let (own, first) = (digits(cell), digits(column[0]));
    // Fixed digits: numbers that are written as short as they can be do not end in 0.
    let are_fixed = first.broken > 1
        && column.iter().all(|cell| digits(cell).shape() == first.shape())
        && column.iter().any(|cell| digits(cell).ends_in_zero);
    if are_fixed {
        return own.broken < first.broken || own.exponent < first.exponent;
    }
    let is_shorter = column.iter().take(NEAREST).all(|cell| own.all < digits(cell).all);
    let step = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
    !has_end && is_shorter && (value - values[0]).abs() > FAR * step
}

/// How many digits a number has.
#[derive(Clone, Copy)]
struct Digits {
    all: usize,
    /// Behind the decimal sign, and in the exponent.
    broken: usize,
    exponent: usize,
    /// Whether the last digit behind the decimal sign is 0.
    ends_in_zero: bool,
}

impl Digits {
    fn new(cell: &str, decimal: Decimal) -> Self {
        let mantissa = cell.split(['e', 'E', 'd', 'D']).next().unwrap_or_default();
        let broken = mantissa.split_once(decimal.sign()).map_or("", |(_, broken)| broken);
        let count = |text: &str| text.chars().filter(char::is_ascii_digit).count();
        let exponent = count(&cell[mantissa.len()..]);
        Self { all: count(cell), broken: count(broken), exponent, ends_in_zero: broken.ends_with('0') }
    }

    fn shape(self) -> (usize, usize) {
        (self.broken, self.exponent)
    }
}
