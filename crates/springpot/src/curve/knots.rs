//! A monotone curve of cubic pieces.

use heapless::Vec;

use crate::error::CurveError;
use crate::scalar::Scalar;

/// Knots that a curve can have: the ends of 16 pieces.
pub const MAX_KNOTS: usize = 17;

/// Smallest slope of a curve: the stiffness of one step may not fall to less than this share of that at rest.
const MIN_SLOPE: f64 = 1e-3;

/// A point of a [`Curve`] or of a [`Spring`](crate::Spring): between two of them it is the cubic with these values and slopes at its ends.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct Knot<T> {
    /// Displacement x, m.
    pub displacement: T,
    /// T(x), m; of a spring E(x), N.
    pub value: T,
    /// T'(x); of a spring E'(x), N/m.
    pub slope: T,
}

impl<T: Scalar> Knot<T> {
    /// The one knot of a straight curve: T(x) = x.
    pub(crate) fn straight() -> Self {
        Self { displacement: T::ZERO, value: T::ZERO, slope: T::from_f64(1.0) }
    }

    pub(crate) fn wide(&self) -> Knot<f64> {
        Knot { displacement: self.displacement.to_f64(), value: self.value.to_f64(), slope: self.slope.to_f64() }
    }
}

/// The elastic curve T of a film: force follows T(x) instead of x.
///
/// Films stiffen and soften with stretch, Eq. 11 does not. With the curve the film's force is the model's for the displacement
/// s = T(x) (quasi-linear viscoelasticity, Fung 1972), and the inertia acts on x:
///
/// ```text
/// F = ∫ K(t − τ) dT(x(τ)) + m ẍ,      T(0) = 0, T'(0) = 1
/// ```
///
/// so that the coefficients of the model keep their meaning at small strokes, and T(x) = x is Eq. 11. T is a table of at most 16
/// cubic pieces over the stroke that was measured. Beyond its ends it goes on with the slope that it has there.
///
/// A curve comes from a material law ([`Rubber`](crate::Rubber)), from points ([`through`](Self::through)) or from knots
/// ([`new`](Self::new)). [`Law::behind`](crate::Law::behind) puts it in front of a law.
///
/// ```
/// use springpot::{Curve, CurveError};
///
/// // A film that is twice as stiff at 2 mm as at rest.
/// let curve = Curve::through(&[(0.0, 0.0), (1e-3, 1.2e-3), (2e-3, 2.8e-3)])?;
/// assert!((curve.slope(0.0) - 1.0).abs() < 1e-12);
/// assert!(curve.slope(2e-3) > 1.6);
/// assert!((curve.inverse(curve.value(1.3e-3)) - 1.3e-3).abs() < 1e-15);
///
/// // A curve that falls is refused.
/// assert!(matches!(Curve::through(&[(0.0, 0.0), (1e-3, 1e-3), (2e-3, 0.9e-3)]), Err(CurveError::NotMonotone { .. })));
/// # Ok::<(), CurveError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    knots: Vec<Knot<f64>, MAX_KNOTS>,
}

impl Curve {
    /// The curve of `knots`, displacements increasing, with T(0) = 0 and T'(0) = 1 to 1e-5: the rounding of knots in f32.
    ///
    /// # Errors
    ///
    /// [`CurveError`] for fewer than two knots or more than [`MAX_KNOTS`], values that are not finite, displacements that do not
    /// increase or do not hold 0, another value or slope at 0, and a slope below 1e-3.
    #[inline(never)]
    pub fn new(knots: &[Knot<f64>]) -> Result<Self, CurveError> {
        let curve = Self::unscaled(knots)?;
        let (value, slope) = curve.value_and_slope(0.0);
        let (first, last) = curve.range();
        if value.abs() > 1e-5 * (last - first) || (slope - 1.0).abs() > 1e-5 {
            return Err(CurveError::AtRest { value_m: value, slope });
        }
        curve.check_monotone()?;
        Ok(curve)
    }

    /// The curve with these knots up to a constant and a factor, which are chosen for T(0) = 0 and T'(0) = 1.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new), apart from value and slope at 0.
    pub fn scaled(knots: &[Knot<f64>]) -> Result<Self, CurveError> {
        let mut curve = Self::unscaled(knots)?;
        let (value, slope) = curve.value_and_slope(0.0);
        if !(slope.is_finite() && slope > 0.0) {
            return Err(CurveError::NotMonotone { displacement_m: 0.0, slope });
        }
        for knot in &mut curve.knots {
            knot.value = (knot.value - value) / slope;
            knot.slope /= slope;
        }
        curve.check_monotone()?;
        Ok(curve)
    }

    /// The monotone curve through `points` (displacement, value; m), scaled to T(0) = 0 and T'(0) = 1: slopes after Fritsch and
    /// Butland 1984, which keep rising points rising.
    ///
    /// # Errors
    ///
    /// As [`scaled`](Self::scaled).
    pub fn through(points: &[(f64, f64)]) -> Result<Self, CurveError> {
        Self::scaled(&Self::knots_through(points)?)
    }

    /// Knots at `points`, with the slopes of Fritsch and Butland.
    pub(super) fn knots_through(points: &[(f64, f64)]) -> Result<Vec<Knot<f64>, MAX_KNOTS>, CurveError> {
        let mut knots = Vec::<Knot<f64>, MAX_KNOTS>::new();
        for (k, &(displacement, value)) in points.iter().enumerate() {
            let secant = |a: usize, b: usize| (points[b].1 - points[a].1) / (points[b].0 - points[a].0);
            let width = |a: usize, b: usize| points[b].0 - points[a].0;
            let last = points.len() - 1;
            let slope = match k {
                _ if last == 0 => 1.0,
                _ if last == 1 => secant(0, 1),
                0 => end_slope([secant(0, 1), secant(1, 2)], [width(0, 1), width(1, 2)]),
                k if k == last => end_slope(
                    [secant(last - 1, last), secant(last - 2, last - 1)],
                    [width(last - 1, last), width(last - 2, last - 1)],
                ),
                k => inner_slope([secant(k - 1, k), secant(k, k + 1)], [width(k - 1, k), width(k, k + 1)]),
            };
            knots.push(Knot { displacement, value, slope }).map_err(|_| CurveError::Knots(points.len()))?;
        }
        Ok(knots)
    }

    /// The curve of knots in another number type. Not inlined, as is that of a spring: a caller's stack would hold both.
    #[inline(never)]
    pub(crate) fn from_rounded<T: Scalar>(knots: &[Knot<T>]) -> Result<Self, CurveError> {
        Self::new(&wide(knots)?)
    }

    pub(super) fn unscaled(knots: &[Knot<f64>]) -> Result<Self, CurveError> {
        let knots = Vec::from_slice(knots).map_err(|_| CurveError::Knots(knots.len()))?;
        if knots.len() < 2 {
            return Err(CurveError::Knots(knots.len()));
        }
        for (k, knot) in knots.iter().enumerate() {
            let finite = knot.displacement.is_finite() && knot.value.is_finite() && knot.slope.is_finite();
            if !(finite && (k == 0 || knots[k - 1].displacement < knot.displacement)) {
                return Err(CurveError::Knot { index: k });
            }
        }
        let curve = Self { knots };
        let (low_m, high_m) = curve.range();
        if !(low_m <= 0.0 && 0.0 <= high_m) {
            return Err(CurveError::Range { low_m, high_m });
        }
        Ok(curve)
    }

    fn check_monotone(&self) -> Result<(), CurveError> {
        let (displacement_m, slope) = self.min_slope();
        if slope >= MIN_SLOPE { Ok(()) } else { Err(CurveError::NotMonotone { displacement_m, slope }) }
    }

    /// Its knots, displacements increasing.
    #[must_use]
    pub fn knots(&self) -> &[Knot<f64>] {
        &self.knots
    }

    /// The smallest and the largest displacement of its knots, m. Beyond them T goes on with a constant slope.
    #[must_use]
    pub fn range(&self) -> (f64, f64) {
        match (self.knots.first(), self.knots.last()) {
            (Some(first), Some(last)) => (first.displacement, last.displacement),
            _ => (0.0, 0.0),
        }
    }

    /// T(x) in m at `displacement_m` (m).
    #[must_use]
    pub fn value(&self, displacement_m: f64) -> f64 {
        self.value_and_slope(displacement_m).0
    }

    /// T'(x) at `displacement_m` (m): the film's stiffness there over that at rest.
    #[must_use]
    pub fn slope(&self, displacement_m: f64) -> f64 {
        self.value_and_slope(displacement_m).1
    }

    /// T''(x) in 1/m at `displacement_m` (m), 0 beyond the ends.
    #[must_use]
    pub fn curvature(&self, displacement_m: f64) -> f64 {
        let (low, high) = self.range();
        if displacement_m < low || displacement_m > high {
            return 0.0;
        }
        let (cubic, u) = self.piece_at(displacement_m);
        2.0 * cubic.second + 6.0 * cubic.third * u
    }

    /// T(x) in m, T'(x), and T''(x) in 1/m for many displacements (m): the same values, with the pieces computed once.
    pub fn evaluator(&self) -> impl Fn(f64) -> [f64; 3] + use<> {
        let pieces = self.knots.windows(2).map(|pair| (pair[0].displacement, Cubic::between(&pair[0], &pair[1])));
        let pieces: Vec<(f64, Cubic), { MAX_KNOTS - 1 }> = pieces.collect();
        let (low, high) = self.range();
        move |displacement| {
            let within = between(displacement, low, high);
            let index = pieces.iter().rposition(|(from, _)| *from <= within).unwrap_or(0);
            let (from, cubic) = pieces[index];
            let u = within - from;
            let slope = cubic.slope_at(u);
            let is_beyond = displacement < low || displacement > high;
            let curvature = if is_beyond { 0.0 } else { 2.0 * cubic.second + 6.0 * cubic.third * u };
            [cubic.value + cubic.beyond(u) + slope * (displacement - within), slope, curvature]
        }
    }

    /// The displacement in m where T has the value `value_m` (m).
    #[must_use]
    pub fn inverse(&self, value_m: f64) -> f64 {
        let (low_m, high_m) = self.range();
        let (least, largest) = (self.value(low_m), self.value(high_m));
        if value_m <= least {
            return low_m + (value_m - least) / self.slope(low_m);
        }
        if value_m >= largest {
            return high_m + (value_m - largest) / self.slope(high_m);
        }
        // Newton's method, with bisection where it would leave the bracket.
        let (mut low, mut high) = (low_m, high_m);
        let mut x = between(value_m, low, high);
        for _ in 0..100 {
            let (value, slope) = self.value_and_slope(x);
            if value > value_m {
                high = x;
            } else {
                low = x;
            }
            let newton = x - (value - value_m) / slope;
            let next = if newton >= low && newton <= high { newton } else { 0.5 * (low + high) };
            if (next - x).abs() <= f64::EPSILON * x.abs() {
                break;
            }
            x = next;
        }
        x
    }

    /// The displacement (m) of the smallest slope, and that slope.
    #[must_use]
    pub fn min_slope(&self) -> (f64, f64) {
        self.slopes().fold((0.0, f64::INFINITY), |least, at| if at.1 < least.1 { at } else { least })
    }

    /// The displacement (m) of the largest slope, and that slope.
    #[must_use]
    pub fn max_slope(&self) -> (f64, f64) {
        self.slopes().fold((0.0, 0.0), |largest, at| if at.1 > largest.1 { at } else { largest })
    }

    /// The slopes at all knots and at the turning points of the slope within the pieces, with their displacements.
    fn slopes(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let inner = self.knots.windows(2).filter_map(|pair| {
            let cubic = Cubic::between(&pair[0], &pair[1]);
            let turn = -cubic.second / (3.0 * cubic.third);
            (turn > 0.0 && turn < cubic.width).then(|| (pair[0].displacement + turn, cubic.slope_at(turn)))
        });
        self.knots.iter().map(|knot| (knot.displacement, knot.slope)).chain(inner)
    }

    pub(super) fn value_and_slope(&self, displacement: f64) -> (f64, f64) {
        let (low, high) = self.range();
        let within = between(displacement, low, high);
        let (cubic, u) = self.piece_at(within);
        let slope = cubic.slope_at(u);
        (cubic.value + cubic.beyond(u) + slope * (displacement - within), slope)
    }

    /// The cubic of the piece that holds `within`, and how far that is beyond its left end, m.
    fn piece_at(&self, within: f64) -> (Cubic, f64) {
        let index = self.knots.iter().rposition(|knot| knot.displacement <= within).unwrap_or(0);
        let index = index.min(self.knots.len().saturating_sub(2));
        let before = &self.knots[index];
        (Cubic::between(before, &self.knots[index + 1]), within - before.displacement)
    }
}

/// Knots in f64.
pub(super) fn wide<T: Scalar>(knots: &[Knot<T>]) -> Result<Vec<Knot<f64>, MAX_KNOTS>, CurveError> {
    if knots.len() > MAX_KNOTS {
        return Err(CurveError::Knots(knots.len()));
    }
    Ok(knots.iter().map(Knot::wide).collect())
}

/// `value` or the nearest end of a range. `f64::clamp` has a panic that prints its bounds: 10 KB of a controller's flash.
fn between(value: f64, low: f64, high: f64) -> f64 {
    if value < low {
        low
    } else if value > high {
        high
    } else {
        value
    }
}

/// A cubic from its value at the left end on: slope u + second u² + third u³.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cubic {
    value: f64,
    pub(super) slope: f64,
    pub(super) second: f64,
    pub(super) third: f64,
    width: f64,
}

impl Cubic {
    pub(super) fn between(before: &Knot<f64>, after: &Knot<f64>) -> Self {
        let width = after.displacement - before.displacement;
        let secant = (after.value - before.value) / width;
        Self {
            value: before.value,
            slope: before.slope,
            second: (3.0 * secant - 2.0 * before.slope - after.slope) / width,
            third: (before.slope + after.slope - 2.0 * secant) / (width * width),
            width,
        }
    }

    fn beyond(&self, u: f64) -> f64 {
        u * (self.slope + u * (self.second + u * self.third))
    }

    fn slope_at(&self, u: f64) -> f64 {
        self.slope + u * (2.0 * self.second + 3.0 * self.third * u)
    }
}

/// The slope at an inner point from the secants and widths on both sides: their weighted harmonic mean.
fn inner_slope([before, after]: [f64; 2], [left, right]: [f64; 2]) -> f64 {
    if before * after <= 0.0 {
        return 0.0;
    }
    let (a, b) = (2.0 * right + left, right + 2.0 * left);
    (a + b) / (a / before + b / after)
}

/// The slope at an end from the two nearest secants and widths: of the parabola through three points, kept monotone.
fn end_slope([near, far]: [f64; 2], [first, second]: [f64; 2]) -> f64 {
    let slope = ((2.0 * first + second) * near - first * far) / (first + second);
    if slope * near <= 0.0 {
        0.0
    } else if near * far <= 0.0 && slope.abs() > 3.0 * near.abs() {
        3.0 * near
    } else {
        slope
    }
}
