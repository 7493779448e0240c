//! Files that may be read in two ways although their columns are known: each is refused with what to do.

use super::chosen::{By, Chosen};
use super::lines::Fault;
use super::numbers::Cell;
use super::reading::Reading;
use super::separator::Separator;
use super::{beginnings, channels, clock, dates, shifted, short, sources};

/// Refuses numbers and units that may be read in two ways, rows whose cells are shifted or whose units change, and rows of several channels,
/// before the columns are read. Rows of one time `may_repeat` it.
pub fn refuse_cells(reading: Reading<'_>, may_repeat: bool) -> Result<(), Fault> {
    let Reading { source, chosen, titles } = reading;
    let Some(table) = source.text() else { return Ok(()) };
    if let Some((line, [before, unit])) = table.mixed_units() {
        let cause = format!("a column has the unit {unit} here and {before} before; write all rows in one unit");
        return Err((line, cause));
    }
    let rows = || table.rows().map_while(Result::ok);
    if table.separator == Separator::Comma
        && is_named(chosen)
        && let Some(fault) = shifted::by_fraction(rows(), |column| reading.has(column))
    {
        return Err(fault);
    }
    let is_ambiguous = |place: &usize| table.ambiguous.get(chosen[*place].index) == Some(&true);
    if let Some(place) = (0..chosen.len()).find(is_ambiguous) {
        let cause = format!(
            "{:?} can be read in two ways: in numbers such as 1.234 or 1,234 the sign is decimal (1.234), or it separates thousands \
             (1234); state the decimal sign with `decimal` point or `decimal` comma",
            chosen[place].name(titles)
        );
        return Err((source.starts().first().copied().unwrap_or(0), cause));
    }
    channels::refuse(reading, may_repeat)
}

/// Refuses rows that can be read, in which a cell may belong to another column, another film or another time than it is read as. All rows
/// together show it, so it is no fault of one of them.
pub fn refuse_rows(reading: Reading<'_>, clock_s: &[f64]) -> Result<(), Fault> {
    let Reading { source, chosen, titles } = reading;
    if let Some(table) = source.text() {
        let rows = || table.rows().flatten();
        let by_comma =
            || shifted::by_milliseconds(rows(), titles, chosen).filter(|_| table.separator == Separator::Comma);
        if let Some(fault) = shifted::by_counts(rows(), titles).or_else(by_comma).filter(|_| is_named(chosen)) {
            return Err(fault);
        }
        if !table.sheet && table.separator != Separator::Blanks {
            let last = chosen.iter().map(|column| column.index).max().unwrap_or(0);
            short::refuse(rows(), titles.len(), last, table.decimal)?;
        }
    }
    let beginnings = source.head().map_or(&[][..], |head| &head.beginnings);
    beginnings::refuse(beginnings, chosen, titles.len(), clock_s)?;
    sources::refuse(reading)?;
    let Some(time) = reading.time() else { return Ok(()) };
    refuse_hours(reading, time)?;
    dates::refuse(reading, time)
}

/// Refuses rows whose cells are shifted by commas that do not separate cells, in all rows up to the line `until` alike: it may be what is at
/// fault there.
pub fn refuse_commas(reading: Reading<'_>, until: u64) -> Result<(), Fault> {
    let Some(table) = reading.source.text() else { return Ok(()) };
    let rows = || table.rows().map_while(Result::ok).take_while(move |(line, _)| *line <= until);
    let spare = || {
        shifted::into_spare(rows(), reading.titles, |column| reading.has(column)).filter(|_| is_named(reading.chosen))
    };
    let by_comma = || shifted::by_thousands(rows()).or_else(spare);
    (table.separator == Separator::Comma).then(by_comma).flatten().map_or(Ok(()), Err)
}

/// Whether a column is chosen by its name.
fn is_named(chosen: &[Chosen]) -> bool {
    chosen.iter().any(|column| column.by != By::Choice)
}

/// Refuses times of two parts that are hours and minutes by the title of their column, and minutes and seconds by a fraction.
fn refuse_hours(Reading { source, titles, .. }: Reading<'_>, time: &Chosen) -> Result<(), Fault> {
    let title = &titles[time.index];
    let unit = format!("{} {}", title.name, title.unit.as_deref().unwrap_or_default()).to_lowercase();
    if !["h:m", "hour:min", "hours:min", "std:min"].iter().any(|hours| unit.contains(hours)) {
        return Ok(());
    }
    source.each(&[time.index], |_, values| match values[0] {
        Cell::Text(text) if clock::is_clock(text) && text.matches(':').count() == 1 => Err(format!(
            "{text:?} is hours and minutes by the name {:?}, and may be minutes and seconds by its fraction; write hours, minutes and seconds",
            title.name
        )),
        _ => Ok(()),
    })
}
