//! Rates of rows that contradict what the file says of them, or that no film is recorded at.

use super::RepeatedTimes;
use super::names::Title;
use super::reading::Reading;
use super::words::is_of;
use crate::grid::usual_step;
use crate::terminal::rounded;

/// Words for numbers of rows.
const NUMBERS: &str = "sample samples index idx no nr n # number nummer row rows point points scan scans record reading counter count seq sequence packet frame id \
     zeile punkt 序号 番号";
/// Beginnings of words for the part of a second that a column has beside its times.
const PARTS: &str = "fraction subsec nsec nanosec usec microsec msec millis ms";
/// Rates between which rows are, in Hz.
const USUAL_HZ: std::ops::RangeInclusive<f64> = 1e-3..=1e6;
/// Fewest rows that have a rate: a drive that is held has a row at each end.
const MIN_ROWS: usize = 10;

/// The words of a title outside of its brackets, in small letters.
fn words(title: &Title) -> Vec<String> {
    let name = title.name.split(['(', '[', '{']).next().unwrap_or_default().to_lowercase();
    name.split(|c: char| !(c.is_alphanumeric() || c == '#')).map(str::to_owned).collect()
}

/// Why the times of rows that repeat them cannot be changed as `meaning` has it: they are all one, or the column right of them may have the
/// rest.
pub fn refuse_repeated(reading: Reading<'_>, clock_s: &[f64], meaning: RepeatedTimes) -> Result<(), String> {
    let index = reading.time().map_or(0, |time| time.index + 1);
    let is_part = |word: &String| PARTS.split(' ').any(|part| word.starts_with(part));
    if let Some(title) = reading.titles.get(index).filter(|title| words(title).iter().any(is_part)) {
        return Err(format!(
            "rows of one time may have the rest of it in column {} {:?}; add both to one column of times, or remove it",
            index + 1,
            title.name
        ));
    }
    if meaning == RepeatedTimes::Spread && clock_s.len() > 1 && clock_s.first() == clock_s.last() {
        return Err("all rows have one time: it gives them no rate; state it with `rate_hz`".into());
    }
    Ok(())
}

/// Remarks on the times of the rows, s: on their rate, on that which the lines above them state, and on rows that are numbered and not all there.
pub fn remarks(reading: Reading<'_>, clock_s: &[f64]) -> Vec<String> {
    let mut notes: Vec<String> = row_apart(clock_s).into_iter().collect();
    let Some(step_s) = usual_step(clock_s) else { return notes };
    let rate = rounded(1.0 / step_s);
    if clock_s.len() >= MIN_ROWS && !USUAL_HZ.contains(&(1.0 / step_s)) {
        notes.push(format!("the rows are at {rate} Hz, which is unusual: are the times in another unit?"));
    }
    let stated = reading.source.head().and_then(|head| head.interval.as_ref()?.as_ref().ok());
    if reading.time().is_none() {
        notes.extend(numbered(reading, step_s));
    } else if let Some(stated_s) = stated.filter(|stated_s| (step_s / *stated_s - 1.0).abs() > 0.02) {
        let stated = rounded(1.0 / stated_s);
        notes.push(format!(
            "the times have rows at {rate} Hz, the lines above them state {stated} Hz: one may be in another unit"
        ));
    }
    notes
}

/// Where a column numbers the rows, which are `step_s` apart (s), and not by one.
fn numbered(reading: Reading<'_>, step_s: f64) -> Option<String> {
    let Reading { source, titles, .. } = reading;
    let is_number = |word: &String| is_of(NUMBERS, word);
    let index = reading.others().into_iter().find(|index| words(&titles[*index]).iter().any(is_number))?;
    let (mut last, mut jump, mut is_count) = (None, None, true);
    // The rows were read before.
    let _ = source.each(&[index], |line, values| {
        let number = values[0].number();
        is_count &= number.is_some_and(|number| number.fract() == 0.0 && last.is_none_or(|last| number > last));
        if let (Some(number), Some(last)) = (number, last)
            && number - last != 1.0
            && jump.is_none()
        {
            jump = Some((line, last, number));
        }
        last = number;
        Ok(())
    });
    let (line, from, to) = jump.filter(|_| is_count)?;
    Some(format!(
        "{:?} goes from {from} to {to} in line {line}: rows are not there, but the times follow from a rate as if they were; use the numbers as \
         times, as in `columns` time={}*{}, without the rate",
        titles[index].name,
        index + 1,
        rounded(step_s)
    ))
}

/// A first or last row whose time is far from those of the others, which are even: gains or statistics may be in it.
fn row_apart(clock_s: &[f64]) -> Option<String> {
    let apart = |outer: f64, inner: &[f64], which: &str, holds: &str| {
        let [first, .., last] = inner else { return None };
        let interval = (last - first) / (inner.len() - 1) as f64;
        let is_even =
            inner.len() > 3 && inner.windows(2).all(|pair| ((pair[1] - pair[0]) / interval - 1.0).abs() < 0.01);
        let distance = (first - outer).abs().min((outer - last).abs());
        (is_even && !(0.5..=2.0).contains(&(distance / interval))).then(|| {
            format!(
                "the {which} row is {} s from the next, the others are {} s apart: if it has {holds}, remove it",
                rounded(distance),
                rounded(interval)
            )
        })
    };
    let ((first, behind), (last, before)) = clock_s.split_first().zip(clock_s.split_last())?;
    apart(*first, behind, "first", "gains or scales").or_else(|| apart(*last, before, "last", "statistics"))
}
