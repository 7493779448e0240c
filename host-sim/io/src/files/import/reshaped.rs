//! Texts in another shape than rows of cells: cells over several lines, and rows for columns.

use std::borrow::Cow;

use super::Hints;
use super::lines::{Line, MAX_LINE, is_comment, lines};
use super::separator::Separator;
use super::shape::Kind;

/// `text` with each cell in quotes on one line, as spreadsheets wrap long names. The lines below keep their numbers.
pub fn unwrapped(text: &str) -> Cow<'_, str> {
    const MAX_CELL: usize = 200;
    if !text.bytes().take(MAX_LINE).any(|byte| byte == b'"') {
        return text.into();
    }
    let is_end = |c: char| matches!(c, ',' | ';' | '\t' | '\n' | '\r');
    let (mut joined, mut rest, mut breaks) = (String::new(), text, 0);
    // Line ends that were left out follow the line.
    let push = |joined: &mut String, part: &str, breaks: &mut usize| {
        let (before, after) = part.split_at(part.find(['\n', '\r']).unwrap_or(part.len()));
        joined.push_str(before);
        if !after.is_empty() {
            joined.extend(std::iter::repeat_n('\n', std::mem::take(breaks)));
        }
        joined.push_str(after);
    };
    while let Some(at) = rest.find('"').filter(|_| text.len() - rest.len() < MAX_LINE) {
        push(&mut joined, &rest[..=at], &mut breaks);
        let cell = rest[at + 1..].split('"').next().unwrap_or_default();
        let after = rest.get(at + cell.len() + 2..).map(|after| after.trim_start_matches(' '));
        let begins = joined.trim_end_matches('"').trim_end_matches(' ').chars().last().is_none_or(is_end);
        rest = &rest[at + 1..];
        if begins && cell.len() < MAX_CELL && after.is_some_and(|after| after.chars().next().is_none_or(is_end)) {
            breaks += cell.replace("\r\n", "\n").matches(['\n', '\r']).count();
            joined.extend(cell.chars().map(|c| if matches!(c, '\n' | '\r') { ' ' } else { c }));
            joined.push('"');
            rest = &rest[cell.len() + 1..];
        }
    }
    push(&mut joined, rest, &mut breaks);
    joined.into()
}

/// The same table as `text` with rows for columns, if its last lines are a name and numbers each, and one of the names `is_time`.
pub fn transposed(text: &str, is_time: impl Fn(&str) -> bool) -> Option<String> {
    let lines: Vec<Line<'_>> = lines(text, 1).filter(|line| !is_comment(line.text)).collect();
    let hints = Hints::default();
    let dialect = hints.dialect();
    for separator in Separator::ALL {
        let length = lines.last().map_or(0, |line| separator.split(line.text).len());
        if length < 4 {
            continue;
        }
        let is_series = |row: &Vec<&str>| {
            row.len() == length
                && dialect.kind(row[0]) == Kind::Text
                && row[1..].iter().all(|cell| dialect.kind(cell) != Kind::Text)
        };
        let mut series: Vec<Vec<&str>> =
            lines.iter().rev().map(|line| separator.split(line.text)).take_while(is_series).collect();
        series.reverse();
        let above = &lines[..lines.len() - series.len()];
        if series.len() < 2
            || above.iter().any(|line| separator.split(line.text).len() >= 3)
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
