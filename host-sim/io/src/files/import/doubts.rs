//! Files that may be read in two ways although their columns are known: each is refused with what to do.

use super::chosen::{By, Chosen};
use super::names::Title;
use super::separator::Separator;
use super::source::{Source, Value};
use super::{Quantity, beginnings, channels, clock, dates, shifted, short, sources};

/// Refuses numbers and units that may be read in two ways, and rows of several channels, before the `chosen` columns are read. Rows of one
/// time `may_repeat` it.
///
/// # Errors
///
/// The line, the cause and what to do.
pub fn refuse_cells(
    source: &Source<'_>,
    chosen: &[Chosen],
    titles: &[Title],
    may_repeat: bool,
) -> Result<(), (u64, String)> {
    refuse_ambiguous(source, chosen, titles)?;
    let time = time_of(chosen).filter(|_| may_repeat);
    channels::refuse(source, titles, time.map(|time| time.index), &others(chosen, titles))
}

/// Refuses rows that can be read, in which a cell may belong to another column, another film or another time than the `chosen` columns have
/// it. All rows together show it, so it is no fault of one of them.
///
/// # Errors
///
/// The first line that it concerns, the cause and what to do.
pub fn refuse_rows(
    source: &Source<'_>,
    chosen: &[Chosen],
    titles: &[Title],
    clock_s: &[f64],
) -> Result<(), (u64, String)> {
    let others = others(chosen, titles);
    if let Source::Text(_, table) = source {
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
    beginnings::refuse(source.head().map_or(&[][..], |head| &head.beginnings), chosen, titles.len(), clock_s)?;
    sources::refuse(source, chosen, titles, &others)?;
    let Some(time) = time_of(chosen) else { return Ok(()) };
    refuse_hours(source, time, titles)?;
    dates::refuse(source, time, titles, &others)
}

/// Refuses rows whose cells are shifted by commas that do not separate cells, in all rows up to the line `until` alike: it may be what is at
/// fault there.
///
/// # Errors
///
/// The first line that it concerns, the cause and what to do.
pub fn refuse_commas(
    source: &Source<'_>,
    chosen: &[Chosen],
    titles: &[Title],
    until: u64,
) -> Result<(), (u64, String)> {
    let Source::Text(_, table) = source else { return Ok(()) };
    let rows = || table.rows().map_while(Result::ok).take_while(move |(line, _)| *line <= until);
    let spare = || shifted::into_spare(rows(), titles, |index| is_used(chosen, index)).filter(|_| is_named(chosen));
    let by_comma = || shifted::by_thousands(rows()).or_else(spare);
    (table.separator == Separator::Comma).then(by_comma).flatten().map_or(Ok(()), Err)
}

/// Whether the column at `index` is read.
fn is_used(chosen: &[Chosen], index: usize) -> bool {
    chosen.iter().any(|column| column.index == index)
}

/// Whether a column is chosen by its name.
fn is_named(chosen: &[Chosen]) -> bool {
    chosen.iter().any(|column| column.by != By::Choice)
}

fn time_of(chosen: &[Chosen]) -> Option<&Chosen> {
    chosen.first().filter(|column| column.quantity == Quantity::Time)
}

/// The columns that are not `chosen`.
fn others(chosen: &[Chosen], titles: &[Title]) -> Vec<usize> {
    (0..titles.len()).filter(|index| chosen.iter().all(|column| column.index != *index)).collect()
}

/// Refuses times of two parts that are hours and minutes by the title of their column, and minutes and seconds by a fraction.
fn refuse_hours(source: &Source<'_>, time: &Chosen, titles: &[Title]) -> Result<(), (u64, String)> {
    let title = &titles[time.index];
    let unit = format!("{} {}", title.name, title.unit.as_deref().unwrap_or_default()).to_lowercase();
    if !["h:m", "hour:min", "hours:min", "std:min"].iter().any(|hours| unit.contains(hours)) {
        return Ok(());
    }
    source.each(&[time.index], |_, values| match values[0] {
        Value::Text(text) if clock::is_clock(text) && text.matches(':').count() == 1 => Err(format!(
            "{text:?} is hours and minutes by the name {:?}, and may be minutes and seconds by its fraction; write hours, minutes and seconds",
            title.name
        )),
        _ => Ok(()),
    })
}

/// Refuses a `chosen` column whose numbers can be read in two ways, and rows whose cells are shifted or whose units change.
fn refuse_ambiguous(source: &Source<'_>, chosen: &[Chosen], titles: &[Title]) -> Result<(), (u64, String)> {
    let Source::Text(_, table) = source else { return Ok(()) };
    if let Some((line, [before, unit])) = table.mixed_units() {
        return Err((
            line,
            format!("a column has the unit {unit} here and {before} before; write all rows in one unit"),
        ));
    }
    let rows = || table.rows().map_while(Result::ok);
    if table.separator == Separator::Comma
        && is_named(chosen)
        && let Some(fault) = shifted::by_fraction(rows(), |index| is_used(chosen, index))
    {
        return Err(fault);
    }
    let is_ambiguous = |place: &usize| table.ambiguous.get(chosen[*place].index) == Some(&true);
    match (0..chosen.len()).find(is_ambiguous) {
        None => Ok(()),
        Some(place) => Err((
            source.starts().first().copied().unwrap_or(0),
            format!(
                "{:?} can be read in two ways: in numbers such as 1.234 or 1,234 the sign is decimal (1.234), or it separates thousands \
                 (1234); state the decimal sign with `decimal` point or `decimal` comma",
                chosen[place].name(titles)
            ),
        )),
    }
}
