//! Rows with fewer cells than the others: those behind a missing cell are in the columns of others.

use std::collections::BTreeMap;

use super::lines::{Fault, Row};
use super::numbers::{self, Decimal};

/// Refuses rows of fewer cells than most have, and most rows where what they have at their end is of a later column. Rows that end before
/// the column `last` that is used are another fault. Where `columns` behind the end of a row have no numbers, it lacks a remark.
pub fn refuse<'a>(
    rows: impl Iterator<Item = Row<'a>> + Clone,
    columns: usize,
    last: usize,
    decimal: Decimal,
) -> Result<(), Fault> {
    let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
    rows.clone().for_each(|(_, cells)| *counts.entry(cells.len().min(columns)).or_default() += 1);
    // The fewest of those that are as frequent.
    let Some((&usual, _)) = counts.iter().rev().max_by_key(|(_, count)| **count) else { return Ok(()) };
    if counts.len() < 2 {
        return Ok(());
    }
    let number = |cell: &&str| numbers::number(cell, decimal);
    let mut has_numbers = vec![false; columns];
    for (_, cells) in rows.clone() {
        has_numbers.iter_mut().zip(&cells).for_each(|(has, cell)| *has |= number(cell).is_some());
    }
    let lacks_remark =
        |cells: &[&str]| !has_numbers[cells.len()..usual].contains(&true) && cells.last().and_then(number).is_some();
    let is_short = |(_, cells): &Row<'_>| cells.len() > last && cells.len() < usual && !lacks_remark(cells);
    if let Some((line, cells)) = rows.clone().find(is_short) {
        let cause = format!(
            "{} cells, and most rows have {usual}: a cell or a separator is missing, and the values behind it may be of other columns; leave a \
             missing cell empty between its separators, or remove the row",
            cells.len()
        );
        return Err((line, cause));
    }
    // Where most rows are short, their ends are compared with the rows that are not.
    let range = |at: &dyn Fn(&[&'a str]) -> Option<&'a str>| {
        let values = rows.clone().filter_map(|(_, cells)| at(&cells).as_ref().and_then(number));
        values.fold(None, |range: Option<[f64; 2]>, value| {
            let [least, most] = range.unwrap_or([value; 2]);
            Some([least.min(value), most.max(value)])
        })
    };
    let of_short = range(&|cells| cells.last().filter(|_| cells.len() == usual).copied());
    let of_long = |column: usize| range(&move |cells| cells.get(column).filter(|_| cells.len() > usual).copied());
    let is_within = |[a, b]: [f64; 2], [from, to]: [f64; 2]| from <= a && b <= to;
    if let (Some(short), Some(same), Some(end)) = (of_short, of_long(usual - 1), of_long(columns - 1))
        && is_within(short, end)
        && (!is_within(short, same) || end[1] - end[0] < same[1] - same[0])
        && let Some((line, _)) = rows.clone().find(|(_, cells)| cells.len() == usual)
    {
        let cause = format!(
            "{usual} of {columns} cells, the last of which is as those in column {columns} are: the values may be of other columns; leave \
             missing cells empty between their separators"
        );
        return Err((line, cause));
    }
    Ok(())
}
