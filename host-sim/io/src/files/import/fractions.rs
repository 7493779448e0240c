//! Columns of milliseconds beside times of day.

use super::chosen::By;
use super::clock;
use super::lines::Fault;
use super::names::Title;
use super::numbers::Cell;
use super::preamble::time_unit;
use super::reading::Reading;

/// Column of a part of the seconds that are in a column of times of day.
#[derive(Clone, Copy, Debug)]
pub struct Fraction {
    /// Its index, from 0.
    pub index: usize,
    /// Its unit, s.
    pub unit_s: f64,
}

/// The columns right of the times of day that have parts of their seconds. Times with seconds of their own parts have none.
/// Fails where they have more than that.
pub fn beside(reading: Reading<'_>) -> Result<Vec<Fraction>, Fault> {
    let Reading { source, titles, .. } = reading;
    let Some(time) = reading.time().filter(|time| titles[time.index].clock) else { return Ok(Vec::new()) };
    let unit = |title: &Title| {
        let text = if title.name.is_empty() { title.unit.as_deref().unwrap_or_default() } else { &title.name };
        time_unit(text).map(|unit| unit.factor).filter(|unit_s| *unit_s < 1.0)
    };
    let behind = titles.iter().enumerate().skip(time.index + 1);
    let found: Vec<Fraction> =
        behind.map_while(|(index, title)| unit(title).map(|unit_s| Fraction { index, unit_s })).collect();
    let indices: Vec<usize> = [time.index].into_iter().chain(found.iter().map(|fraction| fraction.index)).collect();
    if found.is_empty() {
        return Ok(found);
    }
    let (mut is_whole, mut other) = (true, None);
    source.each(&indices, |line, values| {
        is_whole &= match values[0] {
            Cell::Text(text) => clock::stamp(text).is_none_or(|stamp| stamp.is_whole()),
            _ => true,
        };
        for (value, fraction) in values[1..].iter().zip(&found) {
            let is_part =
                matches!(value, Cell::Number(n) if n.fract() == 0.0 && (0.0..1.0).contains(&(n * fraction.unit_s)));
            if !is_part && other.is_none() {
                other = Some((line, fraction.index));
            }
        }
        Ok(())
    })?;
    match other {
        _ if !is_whole => Ok(Vec::new()),
        None => Ok(found),
        Some(_) if time.by == By::Choice => Ok(Vec::new()),
        Some((line, index)) => {
            let (name, time, number) = (&titles[index].name, time.index + 1, index + 1);
            let cause = format!(
                "{name:?} is right of times of whole seconds, but is not a part of a second here; choose with `columns` time={time} without \
                 it, or `columns` time={number}"
            );
            Err((line, cause))
        }
    }
}
