//! Knots of a smooth function, closer where it bends more.

use heapless::Vec;

use crate::curve::{Knot, MAX_KNOTS};

/// Points from which the knots are chosen.
const GRID: usize = 512;

/// Knots for `pieces` cubic pieces, at most 16, from `low_m` to `high_m` (m), with the values and slopes of `knot` at their ends, `slope`
/// alone for their places.
#[allow(clippy::cast_precision_loss)] // a few hundred points
pub(super) fn spread(
    low_m: f64,
    high_m: f64,
    pieces: usize,
    slope: impl Fn(f64) -> f64,
    knot: impl Fn(f64) -> Knot<f64>,
) -> Vec<Knot<f64>, MAX_KNOTS> {
    let width = (high_m - low_m) / GRID as f64;
    // The error of a piece grows with the fourth power of its width times the fourth derivative: knots at equal steps of the
    // integral of the fourth root of that derivative, which is the third derivative of the slope.
    let bend = |k: usize| {
        let centre = (low_m + (k as f64 + 0.5) * width).clamp(low_m + 1.5 * width, high_m - 1.5 * width);
        let slope = |steps: f64| slope(centre + steps * width);
        let third = (slope(1.5) - slope(-1.5)) - 3.0 * (slope(0.5) - slope(-0.5));
        libm::sqrt(libm::sqrt(third.abs()))
    };
    let mut bends = [0.0; GRID];
    let mut sum = 0.0;
    for (k, slot) in bends.iter_mut().enumerate() {
        *slot = bend(k);
        sum += *slot;
    }
    // A tenth evenly, so that no piece becomes endless.
    let even = 0.1 * sum / GRID as f64 + f64::MIN_POSITIVE;
    let share = (sum + even * GRID as f64) / pieces as f64;
    let mut knots = Vec::<Knot<f64>, MAX_KNOTS>::new();
    // There is room for all.
    let _ = knots.push(knot(low_m));
    let mut passed = 0.0;
    for (k, bend) in bends.iter().enumerate() {
        let density = bend + even;
        let wanted = share * knots.len() as f64;
        if knots.len() < pieces && passed + density >= wanted {
            let _ = knots.push(knot(low_m + (k as f64 + (wanted - passed) / density) * width));
        }
        passed += density;
    }
    let _ = knots.push(knot(high_m));
    knots
}
