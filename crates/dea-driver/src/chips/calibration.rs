//! From an instrument's volts to a quantity and back.

use heapless::Vec;
use serde::{Deserialize, Serialize};

/// From an instrument's volts u to a quantity y and back.
///
/// Amplifier: u is the command (V), y the high voltage (V). Voltage monitor: u is its output (V), y the high voltage (V).
/// Displacement sensor: u is its output (V), y the stroke (m).
///
/// ```
/// use dea_driver::chips::Calibration;
///
/// // An amplifier of 1000 V per volt that loses 1 V per volt² and has an offset of −20 V.
/// let amplifier = Calibration::Parabola { offset: -20.0, gain: 1000.0, quadratic: -1.0 };
/// amplifier.check(10.0)?;
/// let command_v = amplifier.invert(3000.0);
/// assert!((amplifier.apply(command_v) - 3000.0).abs() < 1e-2);
///
/// // A converter that hardly starts below 0.7 V, as it was measured.
/// let converter = Calibration::points(&[[0.0, 0.0], [0.6, 15.0], [0.8, 160.0], [2.0, 2100.0], [5.0, 6000.0]])?;
/// assert_eq!(converter.invert(160.0), 0.8);
/// # Ok::<(), dea_driver::chips::CalibrationError>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Calibration {
    /// y = offset + gain u + quadratic u².
    Parabola {
        /// y at u = 0.
        offset: f32,
        /// Change of y per volt at u = 0.
        gain: f32,
        /// Curvature, per volt².
        quadratic: f32,
    },
    /// Straight lines between measured points \[u, y\]. Beyond the last point y stays: nothing is extrapolated.
    Points(Vec<[f32; 2], MAX_POINTS>),
}

/// Most points of a [`Calibration`].
pub const MAX_POINTS: usize = 8;

/// Why a calibration is refused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum CalibrationError {
    /// A parabola with a coefficient that is not finite, or that does not rise from 0 V to full scale.
    #[error(
        "the parabola from {offset} does not rise by a finite amount per volt over its full scale ({gain} at 0 V, {end_gain} at \
         {full_scale_v} V); correct gain and quadratic"
    )]
    Falls {
        /// The quantity at 0 V.
        offset: f32,
        /// Its change per volt at 0 V.
        gain: f32,
        /// Its change per volt at full scale.
        end_gain: f32,
        /// Full scale, V.
        full_scale_v: f32,
    },
    /// Fewer than two points, or more than [`MAX_POINTS`].
    #[error("it needs 2 to {MAX_POINTS} points")]
    Number,
    /// The first point is not at 0 V.
    #[error("the first point is at {first_v} V; it must be at 0 V")]
    Start {
        /// The volts of the first point.
        first_v: f32,
    },
    /// From a point to the next, u or y does not rise, or is not finite.
    #[error(
        "point {number} ({} V, {}) is followed by point {} ({} V, {}); volts and quantity must rise",
        from[0], from[1], number + 1, to[0], to[1]
    )]
    Point {
        /// Number of the first of the two, from 1.
        number: usize,
        /// The first of the two, \[u, y\].
        from: [f32; 2],
        /// The next.
        to: [f32; 2],
    },
}

impl Calibration {
    /// A straight line through zero.
    #[must_use]
    pub const fn linear(gain: f32) -> Self {
        Self::Parabola { offset: 0.0, gain, quadratic: 0.0 }
    }

    /// Straight lines between `points` \[u, y\], the first at u = 0, u and y rising.
    ///
    /// # Errors
    ///
    /// [`CalibrationError`] for other points.
    pub fn points(points: &[[f32; 2]]) -> Result<Self, CalibrationError> {
        let calibration = Self::Points(Vec::from_slice(points).map_err(|_| CalibrationError::Number)?);
        calibration.check(0.0)?;
        Ok(calibration)
    }

    /// Checks that y rises with u from 0 V to `full_scale_v`, so that it can be inverted there.
    ///
    /// # Errors
    ///
    /// [`CalibrationError`] where it does not.
    pub fn check(&self, full_scale_v: f32) -> Result<(), CalibrationError> {
        match self {
            &Self::Parabola { offset, gain, quadratic } => {
                let finite = offset.is_finite() && gain.is_finite() && quadratic.is_finite();
                let end_gain = gain + 2.0 * quadratic * full_scale_v;
                if finite && gain > 0.0 && end_gain > 0.0 {
                    Ok(())
                } else {
                    Err(CalibrationError::Falls { offset, gain, end_gain, full_scale_v })
                }
            }
            Self::Points(points) => {
                let &[[first_v, _], _, ..] = points.as_slice() else { return Err(CalibrationError::Number) };
                if first_v != 0.0 {
                    return Err(CalibrationError::Start { first_v });
                }
                for (index, pair) in points.windows(2).enumerate() {
                    if let &[from, to] = pair
                        && !rises(from, to)
                    {
                        return Err(CalibrationError::Point { number: index + 1, from, to });
                    }
                }
                Ok(())
            }
        }
    }

    /// Largest change of the quantity per volt, from 0 V to `full_scale_v`.
    #[inline(never)] // three instruments
    pub(crate) fn steepest(&self, full_scale_v: f32) -> f32 {
        match self {
            &Self::Parabola { gain, quadratic, .. } => gain.max(gain + 2.0 * quadratic * full_scale_v),
            Self::Points(points) => {
                let slopes = points.windows(2).map(|pair| match *pair {
                    [[u0, y0], [u1, y1]] => (y1 - y0) / (u1 - u0),
                    _ => 0.0,
                });
                slopes.fold(0.0, f32::max)
            }
        }
    }

    /// The quantity at `volts`.
    #[must_use]
    pub fn apply(&self, volts: f32) -> f32 {
        match self {
            &Self::Parabola { offset, gain, quadratic } => offset + volts * (gain + volts * quadratic),
            Self::Points(points) => interpolate(points, volts, |point| point),
        }
    }

    /// This calibration with quantities that are smaller by `offset`.
    pub(crate) fn less(&self, offset: f32) -> Self {
        match self {
            &Self::Parabola { offset: before, gain, quadratic } => {
                Self::Parabola { offset: before - offset, gain, quadratic }
            }
            Self::Points(points) => Self::Points(points.iter().map(|&[u, y]| [u, y - offset]).collect()),
        }
    }

    /// The volts at which the quantity is `value`, for a calibration that passes its [`check`](Self::check). A parabola is solved
    /// in closed form, so that rounding alone separates it from `value`; points give 0 V below the first, and the last above it.
    #[must_use]
    pub fn invert(&self, value: f32) -> f32 {
        match self {
            &Self::Parabola { offset, gain, quadratic } => {
                // The form of the root that does not cancel for small curvatures.
                let rise = 2.0 * (value - offset);
                let discriminant = gain * gain + 2.0 * quadratic * rise;
                rise / (gain + if discriminant > 0.0 { square_root(discriminant) } else { 0.0 })
            }
            Self::Points(points) => interpolate(points, value, |[u, y]| [y, u]),
        }
    }
}

/// The square root of a value above 0, within 3e-7 of it: two of Heron's steps from the root of its exponent. This runs in every
/// tick; one that is rounded correctly takes five times as many instructions where it is not one.
fn square_root(value: f32) -> f32 {
    // Halving the bits halves the exponent: within 3.5 %.
    let root = f32::from_bits(0x1fbd_1df5 + (value.to_bits() >> 1));
    let root = 0.5 * (root + value / root);
    0.5 * (root + value / root)
}

fn rises([u0, y0]: [f32; 2], [u1, y1]: [f32; 2]) -> bool {
    u0 < u1 && y0 < y1 && u1.is_finite() && y0.is_finite() && y1.is_finite()
}

/// Where the lines between `points` are at `value`, with the columns in the order of `turned`; at the ends beyond them. Kept apart
/// from the parabola: most instruments need no points.
#[inline(never)]
fn interpolate(points: &[[f32; 2]], value: f32, turned: fn([f32; 2]) -> [f32; 2]) -> f32 {
    let mut line = [[0.0, 0.0], [1.0, 0.0]];
    for (index, pair) in points.windows(2).enumerate() {
        if let &[start, end] = pair
            && (index == 0 || turned(start)[0] <= value)
        {
            line = [turned(start), turned(end)];
        }
    }
    let [[x0, y0], [x1, y1]] = line;
    let share = (value - x0) / (x1 - x0);
    // NaN stays.
    let share = if share < 0.0 { 0.0 } else { share };
    let share = if share > 1.0 { 1.0 } else { share };
    y0 + share * (y1 - y0)
}
