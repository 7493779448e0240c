//! The curves that a fit changes: the elastic curve, or strain measure, and the spring beside the memory.

use springpot::{Curve, CurveError, Knot, Measure, Rubber, Spring};

use super::rising::Rising;
use crate::files::parameters::{ElasticCurve, Shape};

/// The exponent of Hencky's strain, the logarithm of the stretch.
pub(super) const HENCKY: f64 = 0.0;

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
    /// A strain measure of the family [`Measure`].
    Measure {
        /// m.
        exponent: f64,
        /// ln of the film's length ℓ at x = 0 (m).
        ln_length: f64,
        /// How many of both a fit changes: neither, m, or both. At small strokes only (1 − m)/ℓ shows.
        fitted: usize,
        /// The stroke that it is written for, m.
        range_m: (f64, f64),
    },
}

impl Bend {
    /// A straight curve of `pieces` even pieces over `range_m` (m), whose slopes a fit then changes.
    pub fn free(pieces: usize, range_m: (f64, f64)) -> Self {
        let knots_m = even_knots(pieces, range_m);
        let ln_slopes = vec![0.0; knots_m.len()];
        Self::Free { knots_m, ln_slopes }
    }

    /// Hencky's strain of a film of this length (m) over the same stroke, if this is a strain measure.
    pub fn to_hencky(&self, length_m: f64) -> Self {
        match *self {
            Self::Measure { range_m, .. } => {
                Self::Measure { exponent: HENCKY, ln_length: length_m.ln(), fitted: 0, range_m }
            }
            _ => self.clone(),
        }
    }

    /// The curve of a parameter file, to be changed where a fit can; Hencky's strain is kept in a film of constant volume.
    pub fn from_curve(curve: &ElasticCurve, has_constant_volume: bool) -> Self {
        let pieces = curve.pieces();
        match curve.shape() {
            Shape::Rubber(Rubber { share, limit, rest_stretch, free_length_m }) => Self::Rubber {
                share,
                ln_limit: limit.is_finite().then(|| limit.ln()),
                ln_length: free_length_m.ln(),
                rest_stretch,
                range_m: pieces.range(),
            },
            Shape::Measure(Measure { exponent, length_m }) => {
                let fitted = usize::from(exponent != HENCKY || !has_constant_volume);
                Self::Measure { exponent, ln_length: length_m.ln(), fitted, range_m: pieces.range() }
            }
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
    pub fn curve(&self) -> Result<Option<Curve>, CurveError> {
        Ok(self.elastic()?.map(|elastic| elastic.pieces().clone()))
    }

    /// The curve as a parameter file has it.
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
                let knots = sloped(knots_m, ln_slopes.iter().map(|slope| slope.exp()));
                Curve::scaled(&knots).map(|curve| Some(ElasticCurve::free(curve)))
            }
            &Self::Measure { exponent, ln_length, range_m: (low_m, high_m), .. } => {
                let measure = Measure { exponent, length_m: ln_length.exp() };
                ElasticCurve::measure(measure, low_m.min(0.0), high_m.max(0.0)).map(Some)
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
            Self::Measure { .. } => "measure".into(),
        }
    }
}

/// The spring beside the memory of a candidate, or in series with it.
#[derive(Clone, Debug, PartialEq)]
pub enum Elastic {
    /// A spring in series.
    Rising(Rising),
    /// A spring that a fit keeps.
    Held(Box<Spring>),
    /// Pieces whose slope changes linearly from knot to knot; with a single knot the spring is linear.
    Free {
        /// Displacements of the knots, increasing, 0 among them, m.
        knots_m: Vec<f64>,
        /// Slope at every knot, in shares of a stiffness.
        shares: Vec<f64>,
        /// That stiffness, N/m.
        stiffness_n_per_m: f64,
    },
}

impl Elastic {
    /// A linear spring of this `share` of `stiffness_n_per_m`.
    pub fn linear(share: f64, stiffness_n_per_m: f64) -> Self {
        Self::Free { knots_m: vec![0.0], shares: vec![share], stiffness_n_per_m }
    }

    /// Whether it is linear, and a fit changes it.
    pub fn is_linear(&self) -> bool {
        self.slopes() == 1
    }

    /// A linear spring in `pieces` pieces over `range_m` (m), none for one that stays linear.
    pub fn cut(&self, pieces: usize, range_m: (f64, f64)) -> Self {
        match self {
            Self::Free { shares, stiffness_n_per_m, .. } if pieces > 0 && self.is_linear() => {
                let knots_m = even_knots(pieces, range_m);
                Self::Free { shares: vec![shares[0]; knots_m.len()], knots_m, stiffness_n_per_m: *stiffness_n_per_m }
            }
            _ => self.clone(),
        }
    }

    /// The spring of a parameter file, to be changed where a fit can.
    pub fn from_spring(spring: &Spring) -> Self {
        let knots = spring.knots();
        let largest = knots.iter().map(|knot| knot.slope.abs()).fold(f64::MIN_POSITIVE, f64::max);
        let is_linear =
            knots.iter().all(|knot| (knot.value - knots[0].slope * knot.displacement).abs() < 1e-9 * largest);
        let at: Vec<&Knot<f64>> = if is_linear { vec![&knots[0]] } else { knots.iter().collect() };
        let free = Self::Free {
            knots_m: at.iter().map(|knot| if is_linear { 0.0 } else { knot.displacement }).collect(),
            shares: at.iter().map(|knot| knot.slope / largest).collect(),
            stiffness_n_per_m: largest,
        };
        let (low_m, high_m) = spring.range();
        let same = free.spring().is_ok_and(|again| {
            knots.iter().all(|k| (again.force(k.displacement) - k.value).abs() < 1e-6 * largest * (high_m - low_m))
        });
        if same { free } else { Self::Held(Box::new(spring.clone())) }
    }

    /// The spring of a parameter file in series with the memory, likewise.
    pub fn from_series(spring: &Spring) -> Self {
        Rising::from_spring(spring).map_or_else(|| Self::Held(Box::new(spring.clone())), Self::Rising)
    }

    /// The same with `factor` times the force.
    ///
    /// # Errors
    ///
    /// [`CurveError`] for a factor that leaves no spring.
    pub fn scaled(&self, factor: f64) -> Result<Self, CurveError> {
        Ok(match self {
            Self::Rising(rising) => Self::Rising(Rising {
                ln_stiffness: rising.ln_stiffness + factor.ln(),
                largest_n: factor * rising.largest_n,
                ..*rising
            }),
            Self::Held(spring) => Self::Held(Box::new(spring.scaled(factor)?)),
            Self::Free { knots_m, shares, stiffness_n_per_m } => Self::Free {
                knots_m: knots_m.clone(),
                shares: shares.clone(),
                stiffness_n_per_m: factor * stiffness_n_per_m,
            },
        })
    }

    /// The number of slopes that a fit changes.
    pub fn slopes(&self) -> usize {
        match self {
            Self::Held(_) | Self::Rising(_) => 0,
            Self::Free { shares, .. } => shares.len(),
        }
    }

    /// The spring.
    pub fn spring(&self) -> Result<Spring, CurveError> {
        match self {
            Self::Held(spring) => Ok(spring.as_ref().clone()),
            Self::Rising(rising) => rising.spring(),
            Self::Free { shares, stiffness_n_per_m, .. } if shares.len() == 1 => {
                Spring::linear(shares[0] * stiffness_n_per_m)
            }
            Self::Free { knots_m, shares, stiffness_n_per_m } => {
                let mut knots = sloped(knots_m, shares.iter().map(|share| share * stiffness_n_per_m));
                let at_rest = knots.iter().find(|knot| knot.displacement == 0.0).map_or(0.0, |knot| knot.value);
                knots.iter_mut().for_each(|knot| knot.value -= at_rest);
                Spring::new(&knots)
            }
        }
    }

    /// The change of the spring with the share of knot `index`.
    pub fn change(&self, index: usize) -> Result<Spring, CurveError> {
        match self {
            Self::Held(_) | Self::Rising(_) => Spring::linear(0.0),
            Self::Free { knots_m, shares, stiffness_n_per_m } => {
                let mut only = vec![0.0; shares.len()];
                only[index] = 1.0;
                Self::Free { knots_m: knots_m.clone(), shares: only, stiffness_n_per_m: *stiffness_n_per_m }.spring()
            }
        }
    }

    /// Its pieces; none of a linear one.
    pub fn pieces(&self) -> usize {
        match self {
            Self::Held(spring) => spring.knots().len() - 1,
            Self::Rising(_) => 0,
            Self::Free { knots_m, .. } => knots_m.len() - 1,
        }
    }
}

/// Displacements (m) of knots of `pieces` even pieces between 0 and the farther end of a range; a short end on the other side of 0 is a piece
/// of its own.
fn even_knots(pieces: usize, (low_m, high_m): (f64, f64)) -> Vec<f64> {
    let (near, far) = if high_m.abs() >= low_m.abs() { (low_m, high_m) } else { (high_m, low_m) };
    let mut knots_m: Vec<f64> = (0..=pieces).map(|k| far * k as f64 / pieces as f64).collect();
    if near.abs() > 0.1 * far.abs() {
        knots_m.push(near);
    }
    knots_m.sort_by(f64::total_cmp);
    knots_m
}

/// Knots at these displacements (m) with these slopes, which change linearly between them.
fn sloped(displacements_m: &[f64], slopes: impl Iterator<Item = f64>) -> Vec<Knot<f64>> {
    let mut knots: Vec<Knot<f64>> = Vec::with_capacity(displacements_m.len());
    for (&displacement, slope) in displacements_m.iter().zip(slopes) {
        let value = knots
            .last()
            .map_or(0.0, |before| before.value + 0.5 * (before.slope + slope) * (displacement - before.displacement));
        knots.push(Knot { displacement, value, slope });
    }
    knots
}
