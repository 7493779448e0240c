//! Elastic curves as a fit changes them.

use springpot::{Curve, CurveError, Knot, Rubber};

use crate::files::parameters::{ElasticCurve, Shape};

/// The elastic curve of a candidate.
#[derive(Clone, Debug, PartialEq)]
pub enum Bend {
    /// None: T(x) = x.
    Straight,
    /// A curve that a fit keeps.
    Held(Box<ElasticCurve>),
    /// A strip of rubber.
    Rubber {
        /// β.
        share: f64,
        /// ln of Gent's limit J; none for Mooney–Rivlin.
        ln_limit: Option<f64>,
        /// ln of the free length (m).
        ln_length: f64,
        /// Stretch at x = 0, which a fit keeps.
        rest_stretch: f64,
        /// The measured stroke, m.
        range_m: (f64, f64),
    },
    /// Pieces whose slope changes linearly from knot to knot.
    Free {
        /// Displacements of the knots, increasing, 0 among them, m.
        knots_m: Vec<f64>,
        /// ln of the slope at every knot; 0 at the displacement 0.
        ln_slopes: Vec<f64>,
    },
}

impl Bend {
    /// A straight curve of `pieces` even pieces over `range_m` (m), whose slopes a fit then changes.
    pub fn free(pieces: usize, (low_m, high_m): (f64, f64)) -> Self {
        // Evenly between 0 and the farther end; a short end on the other side of 0 is a piece of its own.
        let (near, far) = if high_m.abs() >= low_m.abs() { (low_m, high_m) } else { (high_m, low_m) };
        let mut knots_m: Vec<f64> = (0..=pieces).map(|k| far * k as f64 / pieces as f64).collect();
        if near.abs() > 0.1 * far.abs() {
            knots_m.push(near);
        }
        knots_m.sort_by(f64::total_cmp);
        let ln_slopes = vec![0.0; knots_m.len()];
        Self::Free { knots_m, ln_slopes }
    }

    /// The curve of a parameter file, to be changed where a fit can.
    pub fn from_curve(curve: &ElasticCurve) -> Self {
        let pieces = curve.pieces();
        match curve.shape() {
            Shape::Rubber(Rubber { share, limit, rest_stretch, free_length_m }) => Self::Rubber {
                share,
                ln_limit: limit.is_finite().then(|| limit.ln()),
                ln_length: free_length_m.ln(),
                rest_stretch,
                range_m: pieces.range(),
            },
            Shape::Free => {
                let knots = pieces.knots();
                let bend = Self::Free {
                    knots_m: knots.iter().map(|knot| knot.displacement).collect(),
                    ln_slopes: knots.iter().map(|knot| knot.slope.ln()).collect(),
                };
                // Pieces of another kind are kept as they are.
                let (low_m, high_m) = pieces.range();
                let same = bend.curve().ok().flatten().is_some_and(|again| {
                    knots.iter().any(|knot| knot.displacement == 0.0)
                        && knots.iter().all(|k| (again.value(k.displacement) - k.value).abs() < 1e-6 * (high_m - low_m))
                });
                if same { bend } else { Self::Held(Box::new(curve.clone())) }
            }
        }
    }

    /// The number of slopes that may be changed, with the index of each.
    pub fn free_slopes(&self) -> Vec<usize> {
        match self {
            Self::Free { knots_m, .. } => (0..knots_m.len()).filter(|&k| knots_m[k] != 0.0).collect(),
            _ => Vec::new(),
        }
    }

    /// The curve; none for a straight one.
    ///
    /// # Errors
    ///
    /// [`CurveError`] for values that no film has.
    pub fn curve(&self) -> Result<Option<Curve>, CurveError> {
        Ok(self.elastic()?.map(|elastic| elastic.pieces().clone()))
    }

    /// The curve as a parameter file has it.
    ///
    /// # Errors
    ///
    /// As [`curve`](Self::curve).
    pub fn elastic(&self) -> Result<Option<ElasticCurve>, CurveError> {
        match self {
            Self::Straight => Ok(None),
            Self::Held(curve) => Ok(Some(curve.as_ref().clone())),
            &Self::Rubber { share, ln_limit, ln_length, rest_stretch, range_m: (low_m, high_m) } => {
                let rubber = Rubber {
                    share,
                    limit: ln_limit.map_or(f64::INFINITY, f64::exp),
                    rest_stretch,
                    free_length_m: ln_length.exp(),
                };
                ElasticCurve::rubber(rubber, low_m.min(0.0), high_m.max(0.0)).map(Some)
            }
            Self::Free { knots_m, ln_slopes } => {
                let mut knots: Vec<Knot<f64>> = Vec::with_capacity(knots_m.len());
                for (&displacement, ln_slope) in knots_m.iter().zip(ln_slopes) {
                    let slope = ln_slope.exp();
                    let value = knots.last().map_or(0.0, |before| {
                        before.value + 0.5 * (before.slope + slope) * (displacement - before.displacement)
                    });
                    knots.push(Knot { displacement, value, slope });
                }
                Curve::scaled(&knots).map(|curve| Some(ElasticCurve::free(curve)))
            }
        }
    }

    /// Its name in tables.
    pub fn name(&self) -> String {
        match self {
            Self::Straight => "linear".into(),
            Self::Held(curve) => curve.name().into(),
            Self::Rubber { ln_limit: None, .. } => "mooney-rivlin".into(),
            Self::Rubber { .. } => "gent".into(),
            Self::Free { .. } => format!("free {}", self.free_slopes().len()),
        }
    }
}
