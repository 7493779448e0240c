//! The elastic curves of rubber: Mooney–Rivlin, and with Gent's limit.

use crate::curve::spread::spread;
use crate::curve::{Curve, Knot, MAX_KNOTS};
use crate::error::CurveError;

/// A strip of rubber that is stretched along one direction: nominal stress over stretch λ, up to a factor.
///
/// ```text
/// P(λ) = β (λ − λ⁻²) G + (1 − β) (1 − λ⁻³),      G = 1 / (1 − (λ² + 2/λ − 3)/J)
/// ```
///
/// Mooney 1940 and Rivlin 1948 with J = ∞; Gent 1996 limits the first term, because molecular chains become taut. β is
/// `share`, J is `limit`. A film at displacement x has the stretch λ = λ₀ + x/L.
///
/// ```
/// use springpot::{CurveError, Rubber};
///
/// // A film of 40 mm, held at twice its free length by its frame, over a stroke of 10 mm.
/// let rubber = Rubber { share: 0.5, limit: 137.0, rest_stretch: 2.0, free_length_m: 0.02 };
/// let curve = rubber.curve(0.0, 10e-3)?;
/// let softer = curve.slope(10e-3);
/// assert!(softer < 1.0);
///
/// // Where the chains would be taut there is no curve.
/// let taut = Rubber { limit: 3.0, ..rubber }.curve(0.0, 10e-3);
/// assert!(matches!(taut, Err(CurveError::Taut { .. })));
/// # Ok::<(), CurveError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Rubber {
    /// β, the share of the first term in the stiffness at λ = 1.
    pub share: f64,
    /// Gent's limit J of I₁ − 3; infinite for none (Mooney–Rivlin).
    pub limit: f64,
    /// Stretch λ₀ at x = 0.
    pub rest_stretch: f64,
    /// Length L of the film without any load, m.
    pub free_length_m: f64,
}

impl Rubber {
    /// The curve over displacements from `low_m` to `high_m` (m): 16 cubic pieces with its values and slopes at their ends, closer
    /// where it bends more.
    ///
    /// # Errors
    ///
    /// [`CurveError`] for constants that are not finite and positive, a range that does not hold 0, a stretch where chains are
    /// taut or the film has no length, and a curve that does not rise.
    pub fn curve(&self, low_m: f64, high_m: f64) -> Result<Curve, CurveError> {
        let positive = |value: f64| value.is_finite() && value > 0.0;
        if !(self.share.is_finite() && self.limit > 0.0 && positive(self.rest_stretch) && positive(self.free_length_m))
        {
            return Err(CurveError::Rubber);
        }
        if !(low_m.is_finite() && high_m.is_finite() && low_m <= 0.0 && 0.0 <= high_m && low_m < high_m) {
            return Err(CurveError::Range { low_m, high_m });
        }
        for displacement_m in [low_m, high_m] {
            let stretch = self.stretch(displacement_m);
            // At the limit itself the stress is infinite.
            if !(stretch > 0.01 && self.left(stretch) > 0.01) {
                return Err(CurveError::Taut { displacement_m, stretch });
            }
        }
        let knot = |displacement: f64| {
            let (stress, slope) = self.stress(self.stretch(displacement));
            Knot { displacement, value: stress * self.free_length_m, slope }
        };
        Curve::scaled(&spread(low_m, high_m, MAX_KNOTS - 1, |x| knot(x).slope, knot))
    }

    fn stretch(&self, displacement_m: f64) -> f64 {
        self.rest_stretch + displacement_m / self.free_length_m
    }

    /// 1 − (I₁ − 3)/J.
    fn left(&self, stretch: f64) -> f64 {
        1.0 - (stretch * stretch + 2.0 / stretch - 3.0) / self.limit
    }

    /// P and dP/dλ.
    fn stress(&self, stretch: f64) -> (f64, f64) {
        let inverse = 1.0 / stretch;
        let (square, cube) = (inverse * inverse, inverse * inverse * inverse);
        let gent = 1.0 / self.left(stretch);
        let first = stretch - square;
        let gent_slope = gent * gent * 2.0 * (stretch - square) / self.limit;
        (
            self.share * first * gent + (1.0 - self.share) * (1.0 - cube),
            self.share * ((1.0 + 2.0 * cube) * gent + first * gent_slope) + (1.0 - self.share) * 3.0 * square * square,
        )
    }
}
