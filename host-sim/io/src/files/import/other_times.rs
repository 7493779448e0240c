//! Columns of times beside the one that is used: of channels that were logged at times of their own.

use super::names;
use super::numbers::Cell;
use super::reading::Reading;

/// A column of times that is not used.
struct Other {
    index: usize,
    /// Its first time and that of the column that is used, and the last times of both.
    ends: Option<[[f64; 2]; 2]>,
    /// Rows of which it has no time.
    missing: usize,
}

/// Remarks on columns with other times than the one that is used: neither the same ones, nor a constant later, nor in another unit.
pub fn remarks(reading: Reading<'_>) -> Vec<String> {
    let Reading { source, titles, .. } = reading;
    let Some(time) = reading.time() else { return Vec::new() };
    let is_time = |index: &usize| titles[*index].increases && names::may_be_time(&titles[*index]);
    let others = reading.others().into_iter().filter(is_time);
    let mut others: Vec<Other> = others.map(|index| Other { index, ends: None, missing: 0 }).collect();
    if others.is_empty() || titles[time.index].clock {
        return Vec::new();
    }
    let indices: Vec<usize> = std::iter::once(time.index).chain(others.iter().map(|other| other.index)).collect();
    // The rows were read before.
    let _ = source.each(&indices, |_, values| {
        for (other, value) in others.iter_mut().zip(&values[1..]) {
            match (values[0], value) {
                (Cell::Number(used), Cell::Number(value)) => {
                    let now = [*value, used];
                    let first = other.ends.map_or(now, |[first, _]| first);
                    other.ends = Some([first, now]);
                }
                (Cell::Number(_), _) => other.missing += 1,
                _ => {}
            }
        }
        Ok(())
    });
    let is_another = |other: &&Other| {
        let Some([[first, used_first], [last, used_last]]) = other.ends else { return false };
        let (span, used_span) = (last - first, used_last - used_first);
        let is_same = |a: f64, b: f64| (a - b).abs() <= 1e-6 * a.abs().max(b.abs());
        // Another unit has another span by a power of ten or 60, and the same zero.
        let scaled = !is_same(span, used_span) && is_same(first * used_span, used_first * span);
        // A clock of another beginning is far away.
        let shifted = is_same(span, used_span) && (is_same(first, used_first) || (first - used_first).abs() > span);
        other.missing > 0 || !(scaled || shifted)
    };
    let remark = |other: &Other| {
        let (number, name, time) = (other.index + 1, &titles[other.index].name, time.index + 1);
        format!(
            "the times in column {number} {name:?} are not those in column {time} and are not used: what was logged at them would be at wrong \
             times; import it from a file of its own"
        )
    };
    others.iter().filter(is_another).map(remark).collect()
}
