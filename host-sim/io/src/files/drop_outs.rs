//! Drop-outs that a file has as a number: 0, or a code such as -999.

use super::import::Quantity;
use super::recording::{Input, Recording};
use crate::grid;
use crate::terminal::rounded;

/// Distance of a drop-out from the readings before and after it, as a share of the stroke; further by this many steps of the drive, of which
/// all beside a drop-out are small, and by so many usual changes from row to row, and by so many of the finest.
const FAR: f64 = 0.05;
const FAR_CODE: f64 = 0.3;
const OF_STEPS: f64 = 3.0;
const OF_CHANGES: f64 = 10.0;
const OF_FINEST: f64 = 3.0;
/// Largest step of the load, as a share of the largest, that no film jumps for, within this time before the reading jumps, s.
const STEP: f64 = 0.1;
const BEFORE_S: f64 = 0.5;
/// Largest share of rows that are codes of the drive, what the size of a code is over all others where there are few, and the answer of a film that shows
/// a voltage, as a share of the stroke; beyond all others it is the stroke.
const RARE: f64 = 0.1;
const BEYOND: f64 = 2.0;
const ANSWER: f64 = 0.1;
/// Distance of a lone reading of the drive from those around it, as a share of the range.
const FAR_LONE: f64 = 0.1;
/// The answer of a film to half of the range, as a share of the stroke, by which it shows it.
const FAR_HALF: f64 = 0.5;
const ANSWER_HALF: f64 = 0.2;
/// Most pieces of time that are named, in which readings are emptied.
const MAX_PIECES: usize = 8;
/// Fewest drop-outs that are a code, and fewest rows of a recording that is judged.
const CODES: usize = 3;
const ROWS: usize = 20;

/// Rows of a displacement that are the same number far from those around them.
#[derive(Clone, Debug, PartialEq)]
pub struct DropOuts {
    /// The number as the file has it.
    pub number: f64,
    /// The same, m.
    pub value_m: f64,
    /// The rows.
    pub rows: Vec<usize>,
    /// How to empty them.
    advice: String,
}

impl std::fmt::Display for DropOuts {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let number = self.number;
        let (count, are) = (self.rows.len(), if self.rows.len() == 1 { "reading is" } else { "readings are" });
        write!(
            f,
            "{count} {are} exactly {number} and far from those around, without a jump of the drive: drop-outs of the sensor? {}",
            self.advice
        )
    }
}

impl Recording {
    /// The drop-outs of the displacement that the file has as a number, if there are any.
    pub fn drop_outs(&self) -> Option<DropOuts> {
        let reading = self.values(Quantity::Displacement)?;
        let drive = self.drive().ok()?;
        let load = load(&drive.samples().value);
        let present: Vec<usize> = (0..reading.len()).filter(|&k| !reading[k].is_nan()).collect();
        if present.len() < ROWS {
            return None;
        }
        let runs = Runs::new(present.iter().map(|&k| reading[k]).collect());
        let (stroke, usual, finest) = runs.sizes()?;
        let time_s = self.time_s();
        // The largest step of the load at `row` and within some time before.
        let step = |row: usize| {
            let from = time_s[..row].partition_point(|t| *t < time_s[row] - BEFORE_S);
            load[from..=row].windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max)
        };
        let is_jump = |at: usize, far: f64| {
            let change = (runs.values[at] - runs.values[at - 1]).abs();
            change > (far * stroke).max(OF_CHANGES * usual).max(OF_FINEST * finest) && {
                let step = step(present[at]);
                step < STEP && change > (far + OF_STEPS * step) * stroke
            }
        };
        let of = |value: f64, far: f64| -> Vec<(usize, usize)> {
            let is_apart = |&(from, to): &(usize, usize)| {
                // In the first moments, a film may not have answered yet.
                let is_late = || time_s[present[to.min(present.len() - 1)]] - time_s[present[0]] > BEFORE_S;
                let begin = if from == 0 { is_late() } else { is_jump(from, far) };
                let end = to == runs.values.len() || is_jump(to, far);
                let sides = [(from > 0).then(|| runs.values[from - 1]), runs.values.get(to).copied()];
                let signs: Vec<bool> = sides.iter().flatten().map(|side| *side > value).collect();
                begin && end && to - from < runs.values.len() && signs.windows(2).all(|pair| pair[0] == pair[1])
            };
            runs.with_value(value).iter().copied().filter(is_apart).collect()
        };
        let zeros = of(0.0, FAR);
        let (value, found) = if zeros.is_empty() {
            let candidates = runs.repeated(CODES).into_iter().map(|value| (value, CODES));
            let beyond = runs.beyond().map(|value| (value, 1));
            let mut codes = candidates.chain(beyond).map(|(value, count)| (value, count, of(value, FAR_CODE)));
            let (value, _, found) = codes.find(|(_, count, found)| found.len() >= *count)?;
            (value, found)
        } else {
            (0.0, zeros)
        };
        let rows: Vec<usize> = found.into_iter().flat_map(|(from, to)| from..to).map(|k| present[k]).collect();
        let advice = format!("Empty them with {}", self.blank(Quantity::Displacement, &reading, value, &rows));
        Some(DropOuts { number: self.as_written(Quantity::Displacement, value), value_m: value, rows, advice })
    }

    /// A value of `quantity` as its file has it: the shortest number that is read as this value.
    fn as_written(&self, quantity: Quantity, value: f64) -> f64 {
        let factor = self.origin(quantity).map_or(1.0, |column| column.factor);
        let shortened = (0..17).map(|digits| format!("{:.digits$e}", value / factor).parse().unwrap_or(f64::NAN));
        // Not −0.
        shortened.into_iter().find(|number: &f64| number * factor == value).unwrap_or(value / factor) + 0.0
    }

    /// The option that empties the `rows` of a `quantity` in which it is `value`: by that number, or by the times where other rows of all `values` have it as well.
    fn blank(&self, quantity: Quantity, values: &[f64], value: f64, rows: &[usize]) -> String {
        if values.iter().filter(|other| **other == value).count() == rows.len() {
            return format!("import `blank` {quantity}={}", self.as_written(quantity, value));
        }
        self.blank_times(quantity, rows)
    }

    /// The same by their times.
    fn blank_times(&self, quantity: Quantity, rows: &[usize]) -> String {
        let time_s = self.time_s();
        let pieces = rows.chunk_by(|a, b| a + 1 == *b).map(|piece| {
            let [from, to] = [piece[0], piece[piece.len() - 1]];
            let t = |row: usize| time_s[row.min(time_s.len() - 1)] - time_s[0];
            let quarter_s = |row: usize| 0.25 * (t(row + 1) - t(row.saturating_sub(1))) / 2.0;
            // Digits that keep the ends between the rows, hours from the first one as well.
            let digits = (1.5 - quarter_s(from).min(quarter_s(to)).max(1e-9).log10()).max(0.0) as usize;
            let [begin, end] = [t(from) - quarter_s(from), t(to) + quarter_s(to)];
            format!("`blank` {quantity}:{begin:.digits$}..{end:.digits$}")
        });
        let pieces: Vec<String> = pieces.collect();
        let more = if pieces.len() > MAX_PIECES { " and so on" } else { "" };
        format!("import {}{more}", pieces[..pieces.len().min(MAX_PIECES)].join(" "))
    }
}

impl Recording {
    /// Voltages, or forces that drive the film, that are one number far from those around, which the film does not answer: codes of missing values.
    pub(super) fn coded_drive(&self) -> Option<String> {
        let (drive, quantity) = match self.drive().ok()? {
            Input::Voltage(drive) => (drive, Quantity::Voltage),
            Input::Force(drive) => (drive, Quantity::Force),
            Input::Displacement(_) => return None,
        };
        let rows = drive.value.len();
        if rows < ROWS {
            return None;
        }
        let changes = drive.value.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        let [usual] = quantiles(changes.collect(), [0.5])?;
        let [low, high] = quantiles(drive.value.clone(), [0.05, 0.95])?;
        let far = |share: f64| (share * (high - low).max(low.abs()).max(high.abs())).max(OF_CHANGES * usual);
        let runs = grid::runs(&drive.value);
        let value = |run: &(usize, usize)| drive.value[run.0];
        // In several rows, for longer than a film takes to answer, it may be a voltage.
        let is_apart = |run: &(usize, usize), far: f64| {
            let beside = [run.0.checked_sub(1), Some(run.1).filter(|row| *row < rows)];
            let [Some(before), Some(after)] = beside else { return false };
            let [a, b] = [before, after].map(|row| value(run) - drive.value[row]);
            let is_short = after - before == 2 || drive.time_s[after] - drive.time_s[before] <= BEFORE_S;
            a * b > 0.0 && a.abs().min(b.abs()) > far && is_short
        };
        let is_code = |run: &&(usize, usize)| is_apart(run, far(FAR_CODE));
        let mut apart: Vec<(usize, usize)> = runs.iter().filter(is_code).copied().collect();
        apart.sort_by(|a, b| value(a).total_cmp(&value(b)));
        let count = |runs: &[(usize, usize)]| runs.iter().map(|(from, to)| to - from).sum::<usize>();
        if count(&apart) as f64 > RARE * rows as f64 {
            return None;
        }
        let largest = runs.iter().filter(|run| !is_code(run)).map(|run| value(run).abs()).fold(0.0, f64::max);
        let reading = self.values(Quantity::Displacement)?;
        let [low, high] = quantiles(reading.iter().copied().filter(|value| !value.is_nan()).collect(), [0.05, 0.95])?;
        let is_answered = |run: &(usize, usize), far: f64| answers(&reading, *run, far);
        let are_code = |same: &&[(usize, usize)]| {
            let is_beyond = value(&same[0]).abs() > BEYOND * largest;
            let far = if is_beyond { high - low } else { ANSWER * (high - low) };
            let unanswered = same.iter().filter(|run| !is_answered(run, far)).count();
            unanswered >= CODES || is_beyond && unanswered == same.len()
        };
        let codes = apart.chunk_by(|a, b| value(a) == value(b)).filter(are_code).max_by_key(|same| same.len());
        let Some(same) = codes else {
            let is_lone = |run: &&(usize, usize)| {
                let answer = if is_apart(run, far(FAR_HALF)) { ANSWER_HALF } else { ANSWER };
                is_apart(run, far(FAR_LONE)) && !is_answered(run, answer * (high - low))
            };
            let lone: Vec<usize> = runs.iter().filter(is_lone).flat_map(|run| run.0..run.1).collect();
            let &first = lone.first().filter(|_| lone.len() as f64 <= RARE * rows as f64)?;
            let [before, at, after] =
                [first - 1, first, first + 1].map(|row| self.as_written(quantity, drive.value[row]));
            let more = if lone.len() == 1 { String::new() } else { format!(" ({} rows in all)", lone.len()) };
            return Some(format!(
                "the drive is {at} at {} s between {before} and {after}, and the film does not answer{more}: a reading that was lost, or an arc? Empty it with {} \
                 `fill` linear",
                rounded(drive.time_s[first]),
                self.blank_times(quantity, &lone)
            ));
        };
        let (value, count) = (value(&same[0]), count(same));
        let are = if count == 1 { "value of the drive is" } else { "values of the drive are" };
        let mut coded: Vec<usize> = same.iter().flat_map(|run| run.0..run.1).collect();
        coded.sort_unstable();
        Some(format!(
            "{count} {are} exactly {}, far from those around, and the film does not answer: codes of missing values, or arcs? Empty them with {} `fill` \
             linear",
            self.as_written(quantity, value),
            self.blank(quantity, &drive.value, value, &coded)
        ))
    }
}

/// Whether a reading goes `far` from its line over the rows of a run, or from its way before it; also where that cannot be seen.
fn answers(reading: &[f64], (from, to): (usize, usize), far: f64) -> bool {
    let (end, rows) = ((to + 1).min(reading.len() - 1), to + 1 - from);
    let before = reading[from - 1];
    let off_line = |row: usize| {
        before + (reading[end] - before) * (row + 1 - from) as f64 / (end + 1 - from) as f64 - reading[row]
    };
    let Some(earlier) = (from - 1).checked_sub(rows) else { return true };
    let off_way = reading[to] - 2.0 * before + reading[earlier];
    off_way.abs() > far || (from..end).any(|row| off_line(row).abs() > far)
}

/// Values below which such shares of `values` are; none without values.
fn quantiles<const N: usize>(mut values: Vec<f64>, shares: [f64; N]) -> Option<[f64; N]> {
    let last = values.len().checked_sub(1)?;
    Some(shares.map(|share| *values.select_nth_unstable_by((last as f64 * share) as usize, f64::total_cmp).1))
}

/// The load of a drive as a share of the largest.
fn load(drive: &[f64]) -> Vec<f64> {
    let largest = grid::peak(drive);
    drive.iter().map(|value| (value / largest.max(f64::MIN_POSITIVE)).powi(2)).collect()
}

/// Readings in runs of one value.
struct Runs {
    values: Vec<f64>,
    /// Beginning and end of each, those of one value side by side in their order.
    ends: Vec<(usize, usize)>,
}

impl Runs {
    fn new(values: Vec<f64>) -> Self {
        let mut ends = grid::runs(&values);
        // Not −0, which is 0.
        ends.sort_by(|a, b| (values[a.0] + 0.0).total_cmp(&(values[b.0] + 0.0)));
        Self { values, ends }
    }

    /// The runs of `value`.
    fn with_value(&self, value: f64) -> &[(usize, usize)] {
        let from = self.ends.partition_point(|(from, _)| self.values[*from] < value);
        let count = self.ends[from..].partition_point(|(from, _)| self.values[*from] <= value);
        &self.ends[from..from + count]
    }

    /// Values of at least `count` runs, those of most first.
    fn repeated(&self, count: usize) -> Vec<f64> {
        let same = self.ends.chunk_by(|a, b| self.values[a.0] == self.values[b.0]);
        let mut found: Vec<(usize, f64)> =
            same.filter(|same| same.len() >= count).map(|same| (same.len(), self.values[same[0].0])).collect();
        found.sort_by_key(|(count, _)| std::cmp::Reverse(*count));
        found.into_iter().map(|(_, value)| value).collect()
    }

    /// The smallest and the largest value where it is beyond twice all others.
    fn beyond(&self) -> impl Iterator<Item = f64> {
        let at = |k: usize| self.ends.get(k).map(|(from, _)| self.values[*from]);
        let pair = |value: f64, next: f64| (value.abs() > BEYOND * next.abs()).then_some(value);
        let last = self.ends.len();
        let of = |outer: Option<f64>, next: &dyn Fn(usize) -> Option<f64>| {
            let count = self.with_value(outer?).len();
            pair(outer?, next(count)?)
        };
        let smallest = of(at(0), &|count| at(count));
        let largest = of(at(last.wrapping_sub(1)), &|count| at(last.checked_sub(count + 1)?));
        [smallest, largest].into_iter().flatten()
    }

    /// The stroke, the usual change from row to row, and the finest one; none where nothing moves.
    fn sizes(&self) -> Option<(f64, f64, f64)> {
        let [low, high] = quantiles(self.values.iter().copied().filter(|value| *value != 0.0).collect(), [0.05, 0.95])?;
        let changes = || self.values.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        let [usual] = quantiles(changes().collect(), [0.5])?;
        let finest = changes().filter(|change| *change > 0.0).min_by(f64::total_cmp)?;
        (high > low).then_some((high - low, usual, finest))
    }
}
