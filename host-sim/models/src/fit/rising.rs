//! The spring in series that a fit changes: two numbers of a force that rises.

use springpot::{CurveError, Knot, Spring};

/// A spring that stiffens, S' = k (1 + b (e/ℓ)²), or for b < 0 softens, S' = k / (1 − b (e/ℓ)²).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rising {
    /// ln k, of N/m.
    pub ln_stiffness: f64,
    /// b.
    pub bend: f64,
    /// ℓ, m: a fit keeps it.
    pub length_m: f64,
    /// The force that it is written for, N.
    pub largest_n: f64,
}

/// Forces up to which a spring is written, over the recorded one.
const REACH: f64 = 1.5;
/// Share of that range that is written on the other side of 0.
const BEHIND: f64 = 0.15;
/// Angle up to which a spring that softens is written.
const MAX_ANGLE: f64 = 1.4;
/// Pieces of one that softens: one that stiffens is a cubic.
const PIECES: u32 = 7;

impl Rising {
    /// A spring of this stiffness (N/m) and bend for forces up to `largest_n` (N), at which a linear one is stretched by ℓ.
    pub fn new(stiffness_n_per_m: f64, bend: f64, largest_n: f64) -> Self {
        let length_m = largest_n / stiffness_n_per_m;
        Self { ln_stiffness: stiffness_n_per_m.ln(), bend, length_m, largest_n: REACH * largest_n }
    }

    /// `spring` as such a one; none where it is no such spring.
    pub fn from_spring(spring: &Spring) -> Option<Self> {
        let (_, high_m) = spring.range();
        let (stiffness, slope) = (spring.slope(0.0), spring.slope(high_m));
        let bend = if slope >= stiffness { slope / stiffness - 1.0 } else { 1.0 - stiffness / slope };
        let largest_n = spring.force(high_m);
        let rising = Self { ln_stiffness: stiffness.ln(), bend, length_m: high_m, largest_n };
        let is_near = |knot: &Knot<f64>| (rising.force(knot.displacement) - knot.value).abs() < 1e-6 * largest_n;
        spring.knots().iter().all(is_near).then_some(rising)
    }

    fn force(&self, elongation_m: f64) -> f64 {
        let (stiffness, share) = (self.ln_stiffness.exp(), elongation_m / self.length_m);
        if self.bend >= 0.0 {
            return stiffness * elongation_m * (1.0 + self.bend * share * share / 3.0);
        }
        let root = (-self.bend).sqrt();
        stiffness * self.length_m * (root * share).atan() / root
    }

    fn slope(&self, elongation_m: f64) -> f64 {
        let square = self.bend * (elongation_m / self.length_m).powi(2);
        self.ln_stiffness.exp() * if square >= 0.0 { 1.0 + square } else { 1.0 / (1.0 - square) }
    }

    /// The elongation (m) up to which it is written.
    fn reach_m(&self) -> f64 {
        let linear_m = self.largest_n / self.ln_stiffness.exp();
        if self.bend < 0.0 {
            let root = (-self.bend).sqrt();
            return self.length_m / root * (root * linear_m / self.length_m).min(MAX_ANGLE).tan();
        }
        // Newton's method from beyond the solution of a force that stiffens.
        (0..60).fold(linear_m, |e, _| e - (self.force(e) - self.largest_n) / self.slope(e))
    }

    /// The spring.
    pub fn spring(&self) -> Result<Spring, CurveError> {
        let reach_m = self.reach_m();
        let pieces = if self.bend < 0.0 { PIECES } else { 1 };
        let behind = [-BEHIND * reach_m];
        let ahead = (0..=pieces).map(|k| reach_m * f64::from(k) / f64::from(pieces));
        let knot = |e: f64| Knot { displacement: e, value: self.force(e), slope: self.slope(e) };
        Spring::new(&behind.into_iter().chain(ahead).map(knot).collect::<Vec<_>>())
    }
}
