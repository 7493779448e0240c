//! Runs of rows that follow one another in a text without a header between them.

use super::lines::{is_comment, lines};
use super::separator::Separator;

/// Fewest rows of a run whose rows are numbered.
const MIN_NUMBERED: usize = 3;
/// Length from which runs may be the range of a counter, if it is a power of two.
const COUNTER: usize = 256;

/// First line and text of each run in `text`, which begins in line `first`: of rows behind an empty line, or whose numbers begin again.
pub fn split(text: &str, first: u64, separator: Separator) -> Vec<(u64, &str)> {
    let mut rows = Vec::new();
    let (mut gaps, mut before) = (Vec::new(), first);
    for line in lines(text, first) {
        if !is_comment(line.text) {
            if line.number > before + 1 {
                gaps.push(rows.len());
            }
            rows.push(line);
        }
        before = line.number;
    }
    // Empty lines between all rows are line ends that were written twice.
    if 2 * gaps.len() > rows.len() {
        gaps.clear();
    }
    let mut starts = restarts(rows.iter().map(|row| separator.split(row.text)));
    starts.extend(gaps);
    starts.push(0);
    starts.sort_unstable();
    starts.dedup();
    let ends = starts.iter().skip(1).map(|start| rows[*start].rest.len()).chain([0]);
    let run = |(start, end): (&usize, usize)| {
        let rest = rows[*start].rest;
        (rows[*start].number, &rest[..rest.len() - end])
    };
    if rows.is_empty() { vec![(first, text)] } else { starts.iter().zip(ends).map(run).collect() }
}

/// The rows at which a column of their numbers begins again.
fn restarts<'a>(mut rows: impl Iterator<Item = Vec<&'a str>>) -> Vec<usize> {
    /// Column of whole numbers: its first, the last, and where it begins again.
    struct Numbers(usize, u64, u64, Vec<usize>);
    let number = |cell: &&str| cell.parse::<u64>().ok();
    let first = rows.next().unwrap_or_default();
    let numbers = |(index, cell): (usize, &&str)| number(cell).map(|n| Numbers(index, n, n, Vec::new()));
    let mut columns: Vec<Numbers> = first.iter().enumerate().filter_map(numbers).collect();
    let mut count = 1;
    for (row, cells) in rows.enumerate().map(|(row, cells)| (row + 1, cells)) {
        columns.retain_mut(|Numbers(index, first, last, starts)| {
            let Some(now) = cells.get(*index).and_then(number) else { return false };
            let begins_again = now == *first && row - starts.last().unwrap_or(&0) >= MIN_NUMBERED;
            let follows = Some(now) == last.checked_add(1);
            if begins_again {
                starts.push(row);
            }
            *last = now;
            begins_again || follows
        });
        count = row + 1;
    }
    let is_counter = |starts: &[usize]| starts[0] >= COUNTER && starts[0].is_power_of_two();
    let is_run =
        |Numbers(.., starts): &Numbers| starts.last().is_some_and(|last| count - last >= 2) && !is_counter(starts);
    columns.into_iter().find(is_run).map_or_else(Vec::new, |Numbers(.., starts)| starts)
}
