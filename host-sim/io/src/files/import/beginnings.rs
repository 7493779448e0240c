//! Beginnings of channels: rows of channels that begin at different times are not at one time.

use super::Quantity;
use super::chosen::Chosen;
use super::clock;
use super::lines::Fault;
use super::numbers::{self, Decimal};
use super::preamble::{common_unit, is_one_of, name_and_rest};

/// Names of the time at which a channel begins.
const NAMES: &str = "x0, x offset, xoffset, hoffset, h offset, horizontal offset, time offset, start offset, t0, time, start time, startzeit, \
    trigger time, wf start time, wf start offset";
/// Difference that does not count, as between channels that are sampled in turn, in intervals of the rows.
const MAX_DIFFERENCE: f64 = 0.1;

/// Times at which channels begin.
#[derive(Clone, Debug, PartialEq)]
pub struct Beginnings {
    line: u64,
    name: String,
    /// The time of each cell, s.
    cells_s: Vec<Option<f64>>,
}

/// The beginnings that `rows`, their lines and cells, state.
pub fn stated(rows: &[(u64, &[String])], decimal: Option<Decimal>) -> Vec<Beginnings> {
    let unit_s = rows.iter().find_map(|(_, cells)| common_unit(cells)).map_or(1.0, |unit| unit.factor);
    let decimal = decimal.unwrap_or(Decimal::Point);
    let of_row = |(line, cells): &(u64, &[String])| {
        let name = name_and_rest(cells.first()?).0;
        let number = |cell: &String| numbers::number(cell.trim(), decimal).map(|number| number * unit_s);
        // Numbers beside this name may be anything.
        let number = |cell: &String| number(cell).filter(|_| name != "time");
        let time = |cell: &String| clock::stamp(cell).map(|stamp| stamp.of_day_s).or_else(|| number(cell));
        let cells_s = std::iter::once(None).chain(cells[1..].iter().map(time)).collect();
        is_one_of(NAMES, &name).then_some(Beginnings { line: *line, name: cells[0].trim().into(), cells_s })
    };
    rows.iter().filter_map(of_row).collect()
}

/// Refuses `chosen` columns that by these `beginnings` begin at different times, with rows at `clock_s`.
pub fn refuse(beginnings: &[Beginnings], chosen: &[Chosen], columns: usize, clock_s: &[f64]) -> Result<(), Fault> {
    let [first, .., last] = clock_s else { return Ok(()) };
    let interval_s = (last - first) / (clock_s.len() - 1) as f64;
    for Beginnings { line, name, cells_s } in beginnings {
        let is_read = |index: usize| {
            cells_s.len() != columns || chosen.iter().any(|c| c.index == index && c.quantity != Quantity::Time)
        };
        let mut read = cells_s.iter().enumerate().filter(|(index, _)| is_read(*index)).filter_map(|(_, time)| *time);
        let Some(one) = read.next() else { continue };
        if let Some(other) = read.find(|other| (other - one).abs() > MAX_DIFFERENCE * interval_s) {
            let cause = format!(
                "{name:?} has {one} s for one channel and {other} s for another: the rows have values of different times; export all \
                 channels with one time base, or shift one of them by {} s in a copy and remove this line",
                crate::terminal::rounded((other - one).abs())
            );
            return Err((*line, cause));
        }
    }
    Ok(())
}
