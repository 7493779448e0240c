//! The elastic spring beside a film's memory.

use heapless::Vec;

use crate::curve::knots::wide;
use crate::curve::spread::spread;
use crate::curve::{Curve, Knot, MAX_KNOTS};
use crate::error::CurveError;
use crate::scalar::Scalar;

/// Knots that a spring can have: the ends of 8 pieces.
pub const MAX_SPRING_KNOTS: usize = 9;

/// The elastic force E(x) of a film beside its memory: at most 8 cubic pieces, with E(0) = 0.
///
/// It may be soft, and it may fall: a law is refused only where spring and memory together have no stiffness within a step
/// ([`Law::beside`](crate::Law::beside)). Beyond its ends it goes on with the slope that it has there.
///
/// ```
/// use springpot::{CurveError, Rubber, Spring};
///
/// let linear = Spring::linear(9e3)?;
/// assert_eq!((linear.force(2e-3), linear.slope(2e-3)), (18.0, 9e3));
///
/// // 9 kN/m at rest, and rubber from there.
/// let rubber = Rubber { share: 0.5, limit: 137.0, rest_stretch: 2.0, free_length_m: 0.02 };
/// let spring = Spring::of_curve(&rubber.curve(0.0, 10e-3)?, 9e3)?;
/// assert!(spring.slope(10e-3) < 9e3);
/// # Ok::<(), CurveError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Spring(Curve);

impl Spring {
    /// The spring of `knots` (displacement in m, value in N, slope in N/m), displacements increasing, with a force of 0 at 0 to 1e-5 of its
    /// largest: the rounding of knots in f32.
    ///
    /// # Errors
    ///
    /// [`CurveError`] for fewer than two knots or more than [`MAX_SPRING_KNOTS`], values that are not finite, displacements that do not
    /// increase or do not hold 0, and another force at 0.
    #[inline(never)]
    pub fn new(knots: &[Knot<f64>]) -> Result<Self, CurveError> {
        if knots.len() > MAX_SPRING_KNOTS {
            return Err(CurveError::Knots(knots.len()));
        }
        let spring = Self(Curve::unscaled(knots)?);
        let force_n = spring.force(0.0);
        let largest = knots.iter().fold(0.0f64, |largest, knot| largest.max(knot.value.abs()));
        if force_n.abs() > 1e-5 * largest {
            return Err(CurveError::ForceAtRest { force_n });
        }
        Ok(spring)
    }

    /// The spring through `points` (displacement in m, force in N), one of them (0, 0) or between two that are near it: slopes after Fritsch
    /// and Butland 1984.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn through(points: &[(f64, f64)]) -> Result<Self, CurveError> {
        Self::new(&Curve::knots_through(points)?)
    }

    /// A spring of the same stiffness (N/m) everywhere, to 1 m on both sides.
    ///
    /// # Errors
    ///
    /// [`CurveError::Knot`] for a stiffness that is not finite.
    pub fn linear(stiffness_n_per_m: f64) -> Result<Self, CurveError> {
        let slope = stiffness_n_per_m;
        Self::new(&[-1.0, 1.0].map(|displacement| Knot { displacement, value: slope * displacement, slope }))
    }

    /// The spring that is `stiffness_n_per_m` times `curve`: its stiffness at 0. A curve of more knots is taken at 9 of its places, closer where
    /// it bends more.
    ///
    /// # Errors
    ///
    /// [`CurveError::Knot`] for a stiffness that is not finite.
    pub fn of_curve(curve: &Curve, stiffness_n_per_m: f64) -> Result<Self, CurveError> {
        let scaled = |displacement: f64| {
            let (value, slope) = curve.value_and_slope(displacement);
            Knot { displacement, value: stiffness_n_per_m * value, slope: stiffness_n_per_m * slope }
        };
        if curve.knots().len() > MAX_SPRING_KNOTS {
            let (low_m, high_m) = curve.range();
            let mut knots = spread(low_m, high_m, MAX_SPRING_KNOTS - 1, |x| scaled(x).slope, scaled);
            // Without a knot at 0 the force there is that of its piece.
            let at_rest = Curve::unscaled(&knots)?.value(0.0);
            knots.iter_mut().for_each(|knot| knot.value -= at_rest);
            return Self::new(&knots);
        }
        let knots: Vec<Knot<f64>, MAX_KNOTS> = curve.knots().iter().map(|knot| scaled(knot.displacement)).collect();
        Self::new(&knots)
    }

    /// The spring, `factor` times as stiff everywhere.
    ///
    /// # Errors
    ///
    /// [`CurveError::Knot`] for a factor with which it is not finite.
    pub fn scaled(&self, factor: f64) -> Result<Self, CurveError> {
        let scaled = |knot: &Knot<f64>| Knot { value: factor * knot.value, slope: factor * knot.slope, ..*knot };
        let knots: Vec<Knot<f64>, MAX_SPRING_KNOTS> = self.knots().iter().map(scaled).collect();
        Self::new(&knots)
    }

    /// The spring of knots in another number type.
    #[inline(never)]
    pub(crate) fn from_rounded<T: Scalar>(knots: &[Knot<T>]) -> Result<Self, CurveError> {
        Self::new(&wide(knots)?)
    }

    /// Its knots, displacements increasing.
    #[must_use]
    pub fn knots(&self) -> &[Knot<f64>] {
        self.0.knots()
    }

    /// The smallest and the largest displacement of its knots, m. Beyond them E goes on with a constant slope.
    #[must_use]
    pub fn range(&self) -> (f64, f64) {
        self.0.range()
    }

    /// E(x) in N at `displacement_m` (m).
    #[must_use]
    pub fn force(&self, displacement_m: f64) -> f64 {
        self.0.value(displacement_m)
    }

    /// E'(x) in N/m at `displacement_m` (m).
    #[must_use]
    pub fn slope(&self, displacement_m: f64) -> f64 {
        self.0.slope(displacement_m)
    }

    /// E(x) in N, E'(x) in N/m, and E''(x) in N/m² for many displacements (m), as [`Curve::evaluator`].
    pub fn evaluator(&self) -> impl Fn(f64) -> [f64; 3] + use<> {
        self.0.evaluator()
    }

    /// The displacement (m) of the smallest slope, and that slope (N/m).
    #[must_use]
    pub fn min_slope(&self) -> (f64, f64) {
        self.0.min_slope()
    }

    /// The displacement (m) of the largest slope, and that slope (N/m).
    #[must_use]
    pub fn max_slope(&self) -> (f64, f64) {
        self.0.max_slope()
    }

    /// The displacement (m) at which a spring that rises everywhere has the force `force_n` (N).
    #[must_use]
    pub fn displacement(&self, force_n: f64) -> f64 {
        self.0.inverse(force_n)
    }
}
