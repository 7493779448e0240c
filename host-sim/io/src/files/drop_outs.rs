//! Drop-outs that a file has as a number: 0, or a code such as -999.

use super::import::Quantity;
use super::recording::{Input, Recording};
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
/// Largest share of rows that are a code of the drive, what its size is over all others where it is fewer, and the answer of a film, as a share of the
/// stroke, that shows a voltage.
const RARE: f64 = 0.05;
const BEYOND: f64 = 2.0;
const ANSWER: f64 = 0.1;
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
}

impl std::fmt::Display for DropOuts {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let number = rounded(self.number);
        let (count, are) = (self.rows.len(), if self.rows.len() == 1 { "reading is" } else { "readings are" });
        write!(
            f,
            "{count} {are} exactly {number} and far from those around, without a jump of the drive: drop-outs of the sensor? Empty them with \
             import `blank` displacement={number}"
        )
    }
}

impl Recording {
    /// The drop-outs of the displacement that the file has as a number, if there are any.
    pub fn drop_outs(&self) -> Option<DropOuts> {
        let reading = self.columns().into_iter().find(|(name, _)| *name == "displacement_m")?.1;
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
            let mut codes = runs.repeated(CODES).into_iter().map(|value| (value, of(value, FAR_CODE)));
            codes.find(|(_, found)| found.len() >= CODES)?
        } else {
            (0.0, zeros)
        };
        let rows = found.into_iter().flat_map(|(from, to)| from..to).map(|k| present[k]).collect();
        let factor = self.origin(Quantity::Displacement).map_or(1.0, |column| column.factor);
        // Not −0.
        Some(DropOuts { number: value / factor + 0.0, value_m: value, rows })
    }
}

impl Recording {
    /// Voltages in single rows that are one number far from those beside them, which the film does not answer: codes of values that are missing.
    pub(super) fn coded_drive(&self) -> Option<String> {
        let Input::Voltage(voltage) = self.drive().ok()? else { return None };
        let volts = &voltage.value;
        if volts.len() < ROWS {
            return None;
        }
        let changes = volts.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        let [usual] = quantiles(changes.collect(), [0.5])?;
        let [low, high] = quantiles(volts.clone(), [0.05, 0.95])?;
        let far = (FAR_CODE * (high - low).max(low.abs()).max(high.abs())).max(OF_CHANGES * usual);
        let is_apart = |&row: &usize| {
            let [before, after] = [row - 1, row + 1].map(|beside| volts[row] - volts[beside]);
            before * after > 0.0 && before.abs().min(after.abs()) > far
        };
        let mut apart: Vec<usize> = (1..volts.len() - 1).filter(is_apart).collect();
        if apart.len() as f64 > RARE * volts.len() as f64 {
            return None;
        }
        if let Some((_, reading)) = self.columns().into_iter().find(|(name, _)| *name == "displacement_m") {
            let present = reading.iter().copied().filter(|value| !value.is_nan()).collect();
            let [low, high] = quantiles(present, [0.05, 0.95])?;
            // At that row or at the next, off the line from the one before to the one after these.
            let answers = |&row: &usize| {
                let before = reading[row - 1];
                let step = (reading.get(row + 2).unwrap_or(&reading[row + 1]) - before) / 3.0;
                let off = [before + step - reading[row], before + 2.0 * step - reading[row + 1]];
                off.iter().any(|off| off.abs() > ANSWER * (high - low))
            };
            apart.retain(|row| !answers(row));
        }
        let others = (0..volts.len()).filter(|row| apart.binary_search(row).is_err());
        let largest = others.fold(0.0_f64, |largest, row| largest.max(volts[row].abs()));
        apart.sort_by(|&a, &b| volts[a].total_cmp(&volts[b]));
        let same = apart.chunk_by(|&a, &b| volts[a] == volts[b]);
        let is_code = |rows: &&[usize]| rows.len() >= CODES || volts[rows[0]].abs() > BEYOND * largest;
        let rows = same.filter(is_code).max_by_key(|rows| rows.len())?;
        let number = rounded(volts[rows[0]] / self.origin(Quantity::Voltage).map_or(1.0, |column| column.factor));
        let are = if rows.len() == 1 { "voltage is" } else { "voltages are" };
        Some(format!(
            "{} {are} exactly {number} and far from those around, and the film does not answer: codes of missing values, or arcs? Empty them with import \
             `blank` voltage={number} `fill` linear",
            rows.len()
        ))
    }
}

/// Values below which such shares of `values` are; none without values.
fn quantiles<const N: usize>(mut values: Vec<f64>, shares: [f64; N]) -> Option<[f64; N]> {
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    Some(shares.map(|share| values[(last as f64 * share) as usize]))
}

/// The load of a drive as a share of the largest.
fn load(drive: &[f64]) -> Vec<f64> {
    let largest = drive.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
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
        let mut starts: Vec<usize> = (0..values.len()).filter(|&k| k == 0 || values[k] != values[k - 1]).collect();
        starts.push(values.len());
        let mut ends: Vec<(usize, usize)> = starts.windows(2).map(|pair| (pair[0], pair[1])).collect();
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

    /// The stroke, the usual change from row to row, and the finest one; none where nothing moves.
    fn sizes(&self) -> Option<(f64, f64, f64)> {
        let [low, high] = quantiles(self.values.iter().copied().filter(|value| *value != 0.0).collect(), [0.05, 0.95])?;
        let changes = || self.values.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        let [usual] = quantiles(changes().collect(), [0.5])?;
        let finest = changes().filter(|change| *change > 0.0).min_by(f64::total_cmp)?;
        (high > low).then_some((high - low, usual, finest))
    }
}
