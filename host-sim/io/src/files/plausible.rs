//! Values that a film and its instruments do not show, and the unit that was likely meant.

use super::import::{By, Quantity};
use super::recording::Recording;
use crate::grid::{peak, range, usual_step};
use crate::terminal::rounded;

/// Voltages (V) below and above which a column is not the voltage on a film.
const VOLTAGE_V: std::ops::RangeInclusive<f64> = 50.0..=50e3;
/// Voltages of the mains (RMS), within a tenth, V.
const MAINS_V: [f64; 4] = [110.0, 120.0, 230.0, 400.0];
/// Largest and smallest stroke of a film, m.
const STROKE_M: std::ops::RangeInclusive<f64> = 3e-6..=0.03;
/// Stroke below which values may be of a larger unit than that of their column, m.
const FINE_STROKE_M: f64 = 20e-6;
/// Largest displacement of any sensor, m.
const REACH_M: f64 = 0.1;
/// Largest force on a film, N.
const FORCE_N: f64 = 500.0;
/// Intervals of the rows of a driven film, s.
const INTERVAL_S: std::ops::RangeInclusive<f64> = 20e-6..=2.0;
/// Mean time of a cycle from which whole and half seconds may be milliseconds, s.
const SLOW_CYCLE_S: f64 = 900.0;
/// Cycles a second from which times are doubted, and from which they are where the rows are at a round rate in another unit alone.
const FAST_CYCLES_HZ: [f64; 2] = [100.0, 3.0];
/// The same for rows that show no cycles, Hz.
const DOUBTFUL_RATE_HZ: f64 = 250.0;
/// Deviation of a round rate.
const ROUND: f64 = 2e-3;
/// Shortest recording in milliseconds, s.
const MIN_DURATION_S: f64 = 2.0;
/// Rows of the shortest recording that is judged so.
const MIN_ROWS: usize = 50;

/// Rows in a cycle from which whole seconds may be numbers of rows: slower cycles are recorded at a lower rate than 1 Hz.
const USUAL_ROWS: usize = 30;

/// Units, and the next smaller one of each.
const SMALLER: [(&str, &str); 9] = [
    ("kV", "V"),
    ("m", "mm"),
    ("mm", "µm"),
    ("µm", "nm"),
    ("kN", "N"),
    ("N", "mN"),
    ("min", "s"),
    ("s", "ms"),
    ("ms", "µs"),
];

/// Most columns that a remark lists.
const MAX_SHOWN: usize = 8;

impl Recording {
    /// Lists implausible values, one line each, with the unit that was likely meant.
    pub fn implausible(&self) -> Vec<String> {
        let values = |quantity: Quantity| {
            let mut values = self.values(quantity).unwrap_or_default();
            values.retain(|value| !value.is_nan());
            values.sort_by(f64::total_cmp);
            values
        };
        // Codes have a line of their own.
        let mut found: Vec<String> = self.coded_drive().into_iter().collect();
        let is_coded = !found.is_empty();
        let voltage = if is_coded { 0.0 } else { largest(&values(Quantity::Voltage)) };
        if let Some(excessive) = self.excessive_voltage().filter(|_| !is_coded) {
            found.push(excessive);
        } else if voltage != 0.0 && voltage.abs() < *VOLTAGE_V.start() {
            let column = self.origin(Quantity::Voltage).map_or(0, |column| column.column);
            found.push(format!(
                "the largest voltage is {} V: a monitor's output, or kilovolts? Multiply it, as in `columns` voltage={column}*1000",
                rounded(voltage)
            ));
        }
        if let Some(mains_v) = self.values(Quantity::Voltage).and_then(mains) {
            found.push(format!(
                "the voltage is that of the mains, {} V, throughout: the supply of an instrument? Name the column of the film's voltage",
                rounded(mains_v)
            ));
        }
        let displacement = values(Quantity::Displacement);
        // Without the outermost hundredths, which drop-outs may be.
        let at = |share: f64| displacement.get(((displacement.len().max(1) - 1) as f64 * share).round() as usize);
        if let (Some(low), Some(high)) = (at(0.01), at(0.99)) {
            let stroke = high - low;
            let has_rows = displacement.len() >= MIN_ROWS;
            // Drop-outs may be some hundredths, or the film moves for some hundredths of the time only.
            let most = at(0.9).zip(at(0.1)).map_or(stroke, |(high, low)| high - low);
            if most > *STROKE_M.end() && has_rows {
                found.push(format!("the stroke is {} m{}", rounded(stroke), self.smaller(Quantity::Displacement)));
            } else if let Some(coarser) =
                self.coarser().filter(|_| (1e-12..FINE_STROKE_M).contains(&stroke) && has_rows)
            {
                let text = format!("the stroke is {} µm", rounded(1e6 * stroke));
                found.push(format!("{text}{}", self.other(Quantity::Displacement, coarser)));
            } else if (stroke > 1e-9 || stroke > 0.5 * largest(&displacement).abs())
                && stroke < *STROKE_M.start()
                && has_rows
            {
                found.push(format!("the stroke is {} m: check the unit of the displacement", rounded(stroke)));
            } else if largest(&displacement).abs() > REACH_M || (stroke > *STROKE_M.end() && has_rows) {
                let value = rounded(largest(&displacement));
                found.push(format!(
                    "a displacement of {value} m: a drop-out of the sensor (import `blank`), or another unit?"
                ));
            }
        }
        let force = largest(&values(Quantity::Force));
        if force.abs() > FORCE_N && !is_coded {
            found.push(format!("the largest force is {} N{}", rounded(force), self.smaller(Quantity::Force)));
        }
        found.extend(self.implausible_times());
        found
    }

    /// The remark on a voltage that no film has.
    pub fn excessive_voltage(&self) -> Option<String> {
        let voltage = largest(&self.values(Quantity::Voltage)?);
        let unit = || self.smaller(Quantity::Voltage);
        (voltage.abs() > *VOLTAGE_V.end()).then(|| format!("the largest voltage is {} V{}", rounded(voltage), unit()))
    }

    /// The remark on a recording without a response while columns were ignored, or with a displacement that never changes.
    pub fn doubtful_response(&self) -> Option<String> {
        let volts = self.values(Quantity::Voltage);
        let is_driven_by_voltage = volts.is_some();
        if volts.is_some_and(|volts| volts.iter().all(|volts| *volts == 0.0)) {
            return Some("the voltage is 0 in all rows: an empty column, or formulas without their results?".into());
        }
        let Some(displacement) = self.values(Quantity::Displacement) else {
            if let Some(column) = self.origin(Quantity::Displacement) {
                let (number, name) = (column.column, &column.name);
                return Some(format!(
                    "column {number} {name:?} has no reading: no displacement was read; a spreadsheet needs the results of its formulas, so \
                     save it in the program that computes them"
                ));
            }
            let ignored = &self.understood.ignored;
            let has_response = is_driven_by_voltage && self.force().is_some();
            return (!has_response && !ignored.is_empty()).then(|| {
                let names: Vec<String> = ignored.iter().take(MAX_SHOWN).map(|name| format!("{name:?}")).collect();
                let names = names.join(", ");
                format!("no displacement was read; if it is one of {names}: `columns` displacement=NUMBER:UNIT")
            });
        };
        // Relaxation is a displacement that is held.
        let mut present = displacement.iter().filter(|value| !value.is_nan());
        let first = present.next().filter(|_| is_driven_by_voltage)?;
        let mut others = present.peekable();
        (others.peek().is_some() && others.all(|value| value == first)).then(|| {
            format!(
                "the displacement is {} m in all rows: a size, such as a gap or a radius? Name the column of the displacement, as in \
                 `columns` displacement=NUMBER:UNIT",
                rounded(*first)
            )
        })
    }

    /// Rows too far apart, or too close, for a film that is driven.
    fn implausible_times(&self) -> Option<String> {
        let time_s = self.time_s();
        let drive = self.drive().ok()?;
        let step = usual_step(time_s)?;
        if time_s.len() < MIN_ROWS || is_constant(&drive.samples().value) {
            return None;
        }
        let text = format!("the rows are {} s apart, {} s in all", rounded(step), rounded(self.duration_s()));
        let duration_s = self.duration_s();
        let crossings = crossings(&drive.samples().value);
        // Cycles of a quarter of an hour and more, at whole seconds.
        let is_slow = || crossings > 2 && 2.0 * duration_s > SLOW_CYCLE_S * crossings as f64;
        let is_stated = self.origin(Quantity::Time).is_some_and(|column| column.by == By::Choice);
        let is_whole = !is_stated && step >= 0.5 && time_s.iter().all(|t| (2.0 * t).fract() == 0.0);
        if step > *INTERVAL_S.end() || is_whole && is_slow() {
            return Some(format!("{text}{}", self.smaller(Quantity::Time)));
        }
        let column = self.origin(Quantity::Time)?;
        if column.unit == "s" && !is_stated {
            let cycles_hz = crossings as f64 / (2.0 * duration_s);
            let rate_hz = (time_s.len() - 1) as f64 / duration_s;
            let [fast_hz, doubtful_hz] = FAST_CYCLES_HZ;
            let is_doubtful = cycles_hz > doubtful_hz || crossings <= 2 && rate_hz > DOUBTFUL_RATE_HZ;
            let units = [(60.0, "min"), (3600.0, "h")];
            let mut rounder = units.iter().filter(|(unit_s, _)| is_round(rate_hz / unit_s) && !is_round(rate_hz));
            let mut slower = units.iter().filter(|(unit_s, _)| cycles_hz / unit_s < doubtful_hz);
            let larger = rounder.next().filter(|_| is_doubtful).or(slower.next().filter(|_| cycles_hz > fast_hz));
            return larger.map(|(_, unit)| format!("{text}{}", self.other(Quantity::Time, unit)));
        }
        if column.unit == "ms" && !is_stated && (step < *INTERVAL_S.start() || self.duration_s() < MIN_DURATION_S) {
            Some(format!("{text}: seconds in a column of ms? State the unit, as in `columns` time={}:s", column.column))
        } else {
            None
        }
    }

    /// The remark on times that may be the numbers of the rows: whole, one or two apart in a column of seconds, while the drive has as many rows
    /// in a cycle as at a usual rate.
    pub fn numbered_rows(&self) -> Option<String> {
        let column = self.origin(Quantity::Time).filter(|column| column.unit == "s" && column.by != By::Choice)?;
        let (time_s, step) = (self.time_s(), usual_step(self.time_s())?);
        let are_numbers = (step == 1.0 || step == 2.0) && time_s.windows(2).all(|pair| pair[1] - pair[0] == step);
        let drive = self.drive().ok().filter(|_| are_numbers && time_s.len() >= MIN_ROWS)?;
        let values = &drive.samples().value;
        let crossings = crossings(values);
        let is_usual = crossings > 2 && 2 * time_s.len() > USUAL_ROWS * crossings;
        (is_usual && !is_constant(values) && self.implausible_times().is_none()).then(|| {
            let cycle_s = rounded((2.0 * self.duration_s() / crossings as f64).round());
            format!(
                "the times are whole numbers {step} apart, with {cycle_s} s in a cycle: numbers of the rows? Then import with `rate_hz`; if they are \
                 seconds, `columns` time={}:s",
                column.column
            )
        })
    }

    /// The next smaller unit of a column, as a question.
    fn smaller(&self, quantity: Quantity) -> String {
        let Some(column) = self.origin(quantity) else { return ": another unit?".into() };
        match SMALLER.iter().find(|(unit, _)| *unit == column.unit) {
            Some((_, smaller)) => self.other(quantity, smaller),
            None => ": another unit?".into(),
        }
    }

    /// Another `unit` of a column, as a question.
    fn other(&self, quantity: Quantity, unit: &str) -> String {
        let Some(column) = self.origin(quantity) else { return ": another unit?".into() };
        let (stated, number) = (&column.unit, column.column);
        format!(": {unit} in a column of {stated}? State the unit, as in `columns` {quantity}={number}:{unit}")
    }

    /// The next larger unit of the displacement, if its unit is by the name of its column, not by a person.
    fn coarser(&self) -> Option<&'static str> {
        let column = self.origin(Quantity::Displacement).filter(|column| column.by != By::Choice)?;
        SMALLER.iter().find(|(_, smaller)| *smaller == column.unit).map(|(unit, _)| *unit)
    }
}

/// The value of the largest size, with its sign; 0 without any.
fn largest(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, |largest, value| if value.abs() > f64::abs(largest) { value } else { largest })
}

/// How often `values` cross the middle of their range, by a quarter of it to either side.
fn crossings(values: &[f64]) -> usize {
    let (low, high) = range(values);
    let at = |share: f64| low + share * (high - low);
    let sides = values.iter().filter(|value| **value > at(0.75) || **value < at(0.25)).map(|value| *value > at(0.5));
    let sides: Vec<bool> = sides.collect();
    sides.windows(2).filter(|pair| pair[0] != pair[1]).count()
}

/// Whether a rate in Hz is a usual one: 1, 1.25, 2, 2.5, 4, 5 or 8 times a power of ten.
fn is_round(rate_hz: f64) -> bool {
    let leading = rate_hz / 10f64.powf(rate_hz.log10().floor());
    [1.0, 1.25, 2.0, 2.5, 4.0, 5.0, 8.0, 10.0].iter().any(|usual| (leading / usual - 1.0).abs() < ROUND)
}

/// The RMS of `volts` if they are of the mains: one value that stays, or an alternating voltage.
fn mains(mut volts: Vec<f64>) -> Option<f64> {
    volts.retain(|value| !value.is_nan());
    if volts.len() < MIN_ROWS {
        return None;
    }
    let count = volts.len() as f64;
    let mean = volts.iter().sum::<f64>() / count;
    let rms = (volts.iter().map(|value| value * value).sum::<f64>() / count).sqrt();
    let (low, high) = range(&volts);
    let stays = high - low < 0.15 * mean;
    let alternates =
        mean.abs() < 0.1 * rms && (1.3..1.55).contains(&(high / rms)) && (1.3..1.55).contains(&(-low / rms));
    let is_mains = MAINS_V.iter().any(|usual| (rms / usual - 1.0).abs() < 0.1);
    (is_mains && (stays || alternates)).then_some(rms)
}

/// Whether `values` stay within 1 % of their largest for most of the time: a load that is held.
fn is_constant(values: &[f64]) -> bool {
    let largest = peak(values);
    let held = values.iter().filter(|value| value.abs() >= 0.99 * largest).count();
    largest == 0.0 || 10 * held > 9 * values.len()
}
