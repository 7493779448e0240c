//! Lines of a text.

use super::numbers::{self, Cell, Decimal};
use super::separator::Separator;

/// A line (0 for the whole file), why it cannot be used, and what to do.
pub type Fault = (u64, String);

/// The line of a row, and its cells.
pub type Row<'a> = (u64, Vec<&'a str>);

/// Longest line, in bytes.
pub const MAX_LINE: usize = 1 << 16;

/// A line of the text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Line<'a> {
    /// Its number, from one.
    pub number: u64,
    /// The line without its end.
    pub text: &'a str,
    /// Text from its beginning on.
    pub rest: &'a str,
}

impl<'a> Line<'a> {
    /// Whether it has nothing but separators.
    fn is_empty(&self) -> bool {
        self.text.trim_matches(|c: char| c.is_whitespace() || [',', ';', '|'].contains(&c)).is_empty()
    }

    /// Its cells, between `separator`.
    pub fn cells(&self, separator: Separator) -> Result<Vec<&'a str>, Fault> {
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

/// The lines of `text` that are not blank, and not rows of empty cells alone; the first of all is number `number`. Line ends of all systems end them.
pub fn lines(text: &str, number: u64) -> impl Iterator<Item = Line<'_>> + Clone {
    all_lines(text, number).filter(|line| !line.is_empty())
}

fn all_lines(text: &str, mut number: u64) -> impl Iterator<Item = Line<'_>> + Clone {
    let mut rest = text;
    let next = move || {
        if rest.is_empty() {
            return None;
        }
        let (number_here, begin) = (number, rest);
        let end = memchr::memchr2(b'\n', b'\r', rest.as_bytes()).unwrap_or(rest.len());
        let (line, after) = rest.split_at(end);
        rest = after.strip_prefix("\r\n").or_else(|| after.strip_prefix(['\n', '\r'])).unwrap_or(after);
        number += 1;
        Some(Line { number: number_here, text: line, rest: begin })
    };
    std::iter::from_fn(next)
}

/// Rows of empty cells in the `segments` of a text, each with the number of its first line, that other rows follow: the line of the first, and
/// their number.
pub fn empty_rows(segments: &[(u64, &str)]) -> Option<(u64, usize)> {
    let of_segment = |&(number, text): &(u64, &str)| {
        let is_row = |line: &Line<'_>| line.is_empty() && !line.text.trim_matches(' ').is_empty();
        let last = lines(text, number).last().map_or(0, |line| line.number);
        let mut empty = all_lines(text, number).take_while(|line| line.number < last).filter(is_row);
        Some((empty.next()?.number, 1 + empty.count()))
    };
    segments.iter().filter_map(of_segment).reduce(|(first, one), (_, other)| (first, one + other))
}

/// Whether a line is a comment of its file.
pub fn is_comment(line: &str) -> bool {
    matches!(line.trim_start().as_bytes().first(), Some(b'#' | b'%'))
}

/// The comments of `text`, which begins in line `number`, that other lines follow.
pub fn comments_between(text: &str, number: u64) -> Vec<Line<'_>> {
    let mut comments: Vec<Line<'_>> = Vec::new();
    let mut followed = 0;
    for line in lines(text, number) {
        if is_comment(line.text) {
            comments.push(line);
        } else {
            followed = comments.len();
        }
    }
    comments.truncate(followed);
    comments
}

/// Whether a cell behind the values of its row is a remark, as of an event, and not a word such as `#N/A`.
pub fn is_event(cell: &str) -> bool {
    is_comment(cell) && matches!(numbers::cell(cell, Decimal::Point), Cell::Text(_))
}
