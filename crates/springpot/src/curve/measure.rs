//! The strain measures of a film's memory.

use crate::curve::spread::spread;
use crate::curve::{Curve, Knot};
use crate::error::CurveError;

/// A strain measure of the memory: the strain of its elements over the displacement x. `length_m` is ℓ, `exponent` is m.
///
/// ```text
/// T(x) = (ℓ/m) ((1 + x/ℓ)^m − 1),      with m = 0: ℓ ln(1 + x/ℓ), Hencky's strain
/// ```
///
/// m = 1 is x itself. Branches of the usual models of rubber at finite strain are nearly linear in Hencky's strain. At small strokes only
/// T''(0) = −(1 − m)/ℓ is identifiable.
///
/// ```
/// use springpot::{CurveError, Measure};
///
/// // A film of 60 mm over strokes of up to 10 mm.
/// let hencky = Measure { exponent: 0.0, length_m: 0.06 }.curve(0.0, 10e-3)?;
/// assert!((hencky.value(10e-3) - 0.06 * (7.0_f64 / 6.0).ln()).abs() < 1e-10);
///
/// // A film has no negative length.
/// let refused = Measure { exponent: 0.0, length_m: 0.01 }.curve(-0.02, 0.0);
/// assert!(matches!(refused, Err(CurveError::Taut { .. })));
/// # Ok::<(), CurveError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Measure {
    /// The exponent m: 0 is Hencky's strain, 1 the displacement itself.
    pub exponent: f64,
    /// Length ℓ of the film at x = 0, m.
    pub length_m: f64,
}

/// Pieces of the curve: 2e-6 of a stroke of 40 % of the length, 1e-5 of the slope. A blob holds that many beside a spring.
const PIECES: usize = 8;

impl Measure {
    /// The curve over displacements from `low_m` to `high_m` (m): 8 cubic pieces with its values and slopes at their ends.
    ///
    /// # Errors
    ///
    /// [`CurveError`] for constants that are not finite, a length that is not positive, a range that does not hold 0, and displacements at
    /// which the film has no length.
    pub fn curve(&self, low_m: f64, high_m: f64) -> Result<Curve, CurveError> {
        let &Self { exponent, length_m } = self;
        if !(exponent.is_finite() && length_m.is_finite() && length_m > 0.0) {
            return Err(CurveError::Measure);
        }
        if !(low_m.is_finite() && high_m.is_finite() && low_m <= 0.0 && 0.0 <= high_m && low_m < high_m) {
            return Err(CurveError::Range { low_m, high_m });
        }
        let stretch = 1.0 + low_m / length_m;
        if stretch < 0.01 {
            return Err(CurveError::Taut { displacement_m: low_m, stretch });
        }
        let ln_stretch = |displacement: f64| libm::log1p(displacement / length_m);
        let slope = |ln_stretch: f64| libm::exp((exponent - 1.0) * ln_stretch);
        let knot = |displacement: f64| {
            let ln_stretch = ln_stretch(displacement);
            // expm1(m y)/m, which is y where m is 0.
            let scaled = exponent * ln_stretch;
            let growth = if scaled.abs() < 1e-9 { ln_stretch } else { libm::expm1(scaled) / exponent };
            Knot { displacement, value: length_m * growth, slope: slope(ln_stretch) }
        };
        Curve::scaled(&spread(low_m, high_m, PIECES, |x| slope(ln_stretch(x)), knot))
    }
}
