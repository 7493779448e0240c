//! Changes to rows that a person asks for: times that a slow timer repeats, and a drive that was logged more slowly than the sensor.

use super::{Quantity, Series};
use crate::grid::runs;

crate::choice! {
    /// Meaning of rows of one time.
    pub enum RepeatedTimes {
        /// A slow timer: the rows are spread evenly up to the next time.
        Spread = "spread",
        /// Readings of one moment: their mean is one row.
        Mean = "mean",
    }
}

crate::choice! {
    /// Value of an empty cell of what drives the film.
    pub enum Fill {
        /// It keeps its last value.
        Hold = "hold",
        /// It goes on a straight line to the next value.
        Linear = "linear",
    }
}

impl Series {
    /// Gives rows of one time times of their own, or makes one row of them.
    pub(super) fn without_repeated_times(&mut self, meaning: RepeatedTimes) {
        let runs = runs(&self.clock_s);
        match meaning {
            RepeatedTimes::Mean => {
                let mean = |values: &mut dyn Iterator<Item = f64>| {
                    let (count, sum) = values.fold((0, 0.0), |(count, sum), value| (count + 1, sum + value));
                    (count > 0).then(|| sum / f64::from(count))
                };
                for (_, column) in &mut self.columns {
                    let of_run =
                        |&(from, to): &(usize, usize)| mean(&mut column.cells()[from..to].iter().copied().flatten());
                    *column = column.with_cells(runs.iter().map(of_run).collect());
                }
                self.clock_s = runs.iter().map(|(from, _)| self.clock_s[*from]).collect();
            }
            RepeatedTimes::Spread => self.clock_s = spread(&self.clock_s, &runs),
        }
    }

    /// Fills the cells of what drives the film, after its first and up to its last value. Returns how many.
    pub(super) fn fill(&mut self, fill: Fill) -> usize {
        let mut filled = 0;
        // With a voltage, the force is measured.
        let driven_by_force = self.columns.iter().all(|(quantity, _)| quantity.measure() != Quantity::Voltage);
        let drives = |quantity: Quantity| {
            quantity.measure() == Quantity::Voltage || (quantity == Quantity::Force && driven_by_force)
        };
        for (_, column) in self.columns.iter_mut().filter(|(quantity, _)| drives(*quantity)) {
            let present = column.present(&self.clock_s);
            let (Some(from), Some(to)) = (present.time_s.first(), present.time_s.last()) else { continue };
            let mut next = 0;
            let mut cells = column.cells().to_vec();
            for (t, cell) in self.clock_s.iter().zip(&mut cells) {
                while next < present.time_s.len() && present.time_s[next] <= *t {
                    next += 1;
                }
                if cell.is_some() || t < from || (fill == Fill::Linear && t > to) {
                    continue;
                }
                let (t0, v0) = (present.time_s[next - 1], present.value[next - 1]);
                *cell = Some(match (fill, present.time_s.get(next)) {
                    (Fill::Linear, Some(t1)) => v0 + (present.value[next] - v0) * (t - t0) / (t1 - t0),
                    _ => v0,
                });
                filled += 1;
            }
            *column = column.with_cells(cells);
        }
        filled
    }
}

/// Times of rows in `runs` of one time each. Rows of one interval that a slower timer stamps are on one line within one of its ticks; other
/// rows are spread between their time and the next.
fn spread(clock_s: &[f64], runs: &[(usize, usize)]) -> Vec<f64> {
    let rows = clock_s.len();
    let [.., (last_from, _)] = runs else { return clock_s.to_vec() };
    let first = runs.first().map_or(0, |(_, to)| *to);
    let tick = runs.windows(2).map(|pair| clock_s[pair[1].0] - clock_s[pair[0].0]).fold(0.0, f64::max);
    if *last_from > first {
        // From the second time to the last: the first may have begun before the first row.
        let interval = (clock_s[*last_from] - clock_s[first]) / (last_from - first) as f64;
        let line = |row: usize| clock_s[first] + interval * (row as f64 - first as f64);
        if (0..rows).all(|row| (line(row) - clock_s[row]).abs() <= 1.5 * tick) {
            return (0..rows).map(line).collect();
        }
    }
    let mut times = Vec::with_capacity(rows);
    for (index, &(from, to)) in runs.iter().enumerate() {
        let until = runs.get(index + 1).map_or(clock_s[from] + tick, |next| clock_s[next.0]);
        times.extend(
            (from..to).map(|row| clock_s[from] + (until - clock_s[from]) * (row - from) as f64 / (to - from) as f64),
        );
    }
    times
}
