//! How far a compressed law can be from full memory.

use core::f64::consts::PI;

use num_complex::Complex;

use crate::complex;
use crate::kernel::Discretisation;
use crate::kernel::laplace::{self, Kernel};
use crate::kernel::power_series::TERMS;
use crate::law::{Compressed, Law};
use crate::model::Maxwell;
use crate::scalar::Scalar;

/// Bounds of the error that the compression of a law's memory causes, against full memory in the same discretisation.
///
/// With Δx the increments of the law's own displacement (m per step) and x that displacement from rest, over any run from rest that is at most
/// [`horizon_s`](Self::horizon_s) long:
///
/// ```text
/// |F − F_full| ≤ force_per_increment · max|Δx|             |F − F_full| ≤ force_per_stroke · max|x|
/// |x − x_full| ≤ displacement_per_increment · max|Δx|      |x − x_full| ≤ displacement_per_stroke · max|x|
/// ```
///
/// The first line is [`force`](Law::force), where F_full is the force with full memory along the same path. The second is
/// [`displacement`](Law::displacement), where x_full is the displacement with full memory under the same force.
///
/// # How they are computed
///
/// The law has other coefficients than full memory, by δ_j on the increment of j steps ago. The error of the force is Σ δ_j Δx_{k−j}; that of the
/// displacement is Σ q_j Δx_{k−j}, with q the displacement that full memory answers to the force δ. So Σ|δ_j| and Σ|q_j| bound
/// them by the increments, and by partial summation the total variations of δ and q bound them by the stroke. There are runs that reach these sums.
///
/// δ and q are exact for the first 64 steps. Beyond, they are inverse Laplace integrals at 6 places an octave: their sums are enlarged by
/// an eighth and their variations by two fifths, more than the largest error found. An oscillation of film and mass that is fast beside the
/// distance of these places is taken out of q and counted with its envelope.
///
/// The rounding of the coefficients to the number type is included; the rounding of a step's arithmetic is not. The bounds themselves are
/// rounded up.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct CompressionBound {
    /// Longest run from rest for which the bounds hold, s: the horizon of the memory.
    pub horizon_s: f32,
    /// Error of the force over the largest increment of displacement, N/m.
    pub force_per_increment: f32,
    /// Error of the force over the largest displacement, N/m.
    pub force_per_stroke: f32,
    /// Error of the displacement over its largest increment.
    pub displacement_per_increment: f32,
    /// Error of the displacement over the largest displacement.
    pub displacement_per_stroke: f32,
}

impl CompressionBound {
    /// Bounds of force and displacement by increments and by stroke, rounded up.
    fn rounded(
        [force_per_increment, force_per_stroke, displacement_per_increment, displacement_per_stroke]: [f64; 4],
        horizon_s: f64,
    ) -> Self {
        Self {
            horizon_s: -above(-horizon_s),
            force_per_increment: above(force_per_increment),
            force_per_stroke: above(force_per_stroke),
            displacement_per_increment: above(displacement_per_increment),
            displacement_per_stroke: above(displacement_per_stroke),
        }
    }
}

impl<T: Scalar, const HEAD: usize, const FAST: usize, const SLOW: usize> Law<T, Compressed<T, HEAD, FAST, SLOW>> {
    /// How far this law of `model` can be from full memory in the same discretisation, over a run from rest of at most `horizon_s` (s).
    ///
    /// Behind an elastic curve the memory acts on T(x), whose increments are those of x times its largest slope at most: the bounds of the
    /// force are that many times larger, and those of the displacement grow by the largest over the smallest slope. They are for a film
    /// without mass, and infinite for one with mass, whose oscillation changes with the slope. That a step solves along the tangent of the
    /// curve is not in them, nor is what a weight does to a film that starts from rest: x counts from there.
    ///
    /// Beside a spring the memory's force has the weight T': the bounds of the force are larger by the square of the largest slope, and those of
    /// the displacement are infinite.
    ///
    /// Infinite as well for a horizon that is not finite, and for the displacement if it could not be decided whether the film oscillates:
    /// 3 of 40 000 random ones, all of springs, dashpots and a mass alone.
    ///
    /// Takes longer than building the law.
    ///
    /// ```
    /// use springpot::{Law, LawOptions, Preset};
    ///
    /// # fn main() -> Result<(), Box<dyn core::error::Error>> {
    /// let model = Preset::TABLE3_N2.model()?;
    /// let law: Law<f64> = Law::compressed(&model, LawOptions::at_step(1e-3))?;
    /// // Over a day, by less than a millionth of the stroke.
    /// let bound = law.compression_bound(&model, LawOptions::DEFAULT_HORIZON_S);
    /// assert!(bound.displacement_per_stroke < 1e-6);
    /// # Ok(())
    /// # }
    /// ```
    #[must_use]
    pub fn compression_bound(&self, model: &Maxwell, horizon_s: f64) -> CompressionBound {
        let bound = if horizon_s.is_finite() { self.straight_bound(model, horizon_s) } else { [f64::INFINITY; 4] };
        let bound = CompressionBound::rounded(bound, horizon_s);
        if self.is_in_series() {
            // Under a given force the memory is stretched as it is alone, and the spring in series does not change.
            let moved = if self.mass_per_step2 > 0.0 { f32::INFINITY } else { 1.0 };
            let [displacement_per_increment, displacement_per_stroke] =
                [bound.displacement_per_increment, bound.displacement_per_stroke].map(|bound| moved * bound);
            let unknown = f32::INFINITY;
            return CompressionBound {
                force_per_increment: unknown,
                force_per_stroke: unknown,
                displacement_per_increment,
                displacement_per_stroke,
                ..bound
            };
        }
        let Some(curve) = self.rounded_curve() else { return bound };
        let (steepest, flattest) = (curve.max_slope().1, curve.min_slope().1);
        if self.rounded_spring().is_some() {
            // The memory's force has the weight T' as well.
            let weight = steepest * steepest;
            let rounding = 4.0 * precision::<T>() * (self.instant * weight + self.mass_per_step2);
            let [per_increment, per_stroke] = [bound.force_per_increment, bound.force_per_stroke].map(f64::from);
            let force = [per_increment * weight + rounding, per_stroke * weight + 2.0 * rounding];
            return CompressionBound::rounded([force[0], force[1], f64::INFINITY, f64::INFINITY], horizon_s);
        }
        let times = steepest / flattest;
        let mut bounds = [
            f64::from(bound.force_per_increment) * steepest,
            f64::from(bound.force_per_stroke) * steepest,
            f64::from(bound.displacement_per_increment) * times,
            f64::from(bound.displacement_per_stroke) * times,
        ];
        if self.mass_per_step2 > 0.0 {
            // Here inertia and g_0 are rounded apart, which costs at most so much of each.
            let rounding = 4.0 * precision::<T>() * (self.instant * steepest + self.mass_per_step2);
            bounds = [bounds[0] + rounding, bounds[1] + 2.0 * rounding, f64::INFINITY, f64::INFINITY];
        }
        CompressionBound::rounded(bounds, horizon_s)
    }

    /// The bounds without a curve, over `horizon_s`.
    fn straight_bound(&self, model: &Maxwell, horizon_s: f64) -> [f64; 4] {
        let kernel = Kernel::new(model, self.step_s, self.method);
        let steps = libm::floor(horizon_s / self.step_s);
        let deviation = Deviation::new(self, &kernel);
        let (mut force, mut displacement) = deviation.first_steps(steps);

        let (mut late_force, mut late_displacement) = (Sums::after(&force), Sums::after(&displacement));
        // The oscillation is in q as long as the places are close to each other beside its period.
        let mut oscillation = deviation.oscillation.as_ref();
        let mut first = TERMS_F64;
        let mut place = first - 1.0;
        while first <= steps {
            let next = libm::floor(first * OCTAVE_STEP).max(first + 1.0).min(steps + 1.0);
            if let Some(pair) = oscillation
                && pair.turns_in(next - first)
            {
                late_displacement.last -= pair.at(place);
                let (sum, variation) = pair.envelope(place, steps);
                displacement.sum += sum;
                displacement.variation += variation;
                oscillation = None;
            }
            place = 0.5 * (first + next - 1.0);
            let [delta, q] = deviation.at(place);
            late_force.add(delta, next - first);
            late_displacement.add(q + oscillation.map_or(0.0, |pair| pair.at(place)), next - first);
            first = next;
        }
        force.append(&late_force);
        displacement.append(&late_displacement);
        if deviation.zero_missed {
            displacement = Sums { sum: f64::INFINITY, variation: f64::INFINITY, last: 0.0 };
        }
        [force.sum, force.variation, displacement.sum, displacement.variation]
    }
}

/// The smallest number of single precision that is no less than `value`.
fn above(value: f64) -> f32 {
    #[allow(clippy::cast_possible_truncation)] // rounded up below
    let nearest = value as f32;
    if f64::from(nearest) < value { nearest.next_up() } else { nearest }
}

/// From 1 to the next number of a type.
fn precision<T: Scalar>() -> f64 {
    let mut unit = 1.0;
    while T::from_f64(1.0 + 0.5 * unit).to_f64() > 1.0 && unit > f64::EPSILON {
        unit *= 0.5;
    }
    unit
}

#[allow(clippy::cast_precision_loss)] // 64
const TERMS_F64: f64 = TERMS as f64;
/// From one place to the next: 2^(1/6).
const OCTAVE_STEP: f64 = 1.122_462_048_309_373;
/// Factor on sums over places.
const SUM_MARGIN: f64 = 1.125;
/// Factor on variations over places.
const VARIATION_MARGIN: f64 = 1.4;

/// Sum of magnitudes and total variation of a series.
#[derive(Clone, Copy)]
struct Sums {
    sum: f64,
    variation: f64,
    last: f64,
}

impl Sums {
    const ZERO: Self = Self { sum: 0.0, variation: 0.0, last: 0.0 };

    fn after(before: &Self) -> Self {
        Self { last: before.last, ..Self::ZERO }
    }

    /// Goes on with `count` values like `value`.
    fn add(&mut self, value: f64, count: f64) {
        self.sum += value.abs() * count;
        self.variation += (value - self.last).abs();
        self.last = value;
    }

    /// Goes on with sums over places.
    fn append(&mut self, late: &Self) {
        self.sum += SUM_MARGIN * late.sum;
        self.variation += VARIATION_MARGIN * late.variation;
    }
}

/// How the coefficients of a law differ from those of full memory.
struct Deviation<'a, T, const HEAD: usize, const FAST: usize, const SLOW: usize> {
    law: &'a Law<T, Compressed<T, HEAD, FAST, SLOW>>,
    kernel: &'a Kernel<'a>,
    /// The law's coefficients on the last HEAD + 1 increments, newest first, without the exact inertia, N/m.
    head: [f64; TERMS],
    /// The exact inertia on the last four, N/m.
    inertia: [f64; 4],
    oscillation: Option<Oscillation>,
    /// Whether the film may oscillate in a way that was not found.
    zero_missed: bool,
}

impl<'a, T: Scalar, const HEAD: usize, const FAST: usize, const SLOW: usize> Deviation<'a, T, HEAD, FAST, SLOW> {
    fn new(law: &'a Law<T, Compressed<T, HEAD, FAST, SLOW>>, kernel: &'a Kernel<'a>) -> Self {
        let (newest, [first, second, third]) = law.method.inertia();
        let inertia = [newest, first, second, third].map(|share| share * law.mass_per_step2);
        // The stiffness acts on the change of the increment.
        let mut head = [0.0; TERMS];
        let stiffness = law.stiffness.to_f64();
        head[0] = stiffness;
        let weights = law.memory.inert_head(law.mass_per_step2, law.method);
        for (slot, weight) in head[1..].iter_mut().zip(weights) {
            *slot = weight.to_f64();
        }
        head[1] -= stiffness;
        for (slot, inertia) in head.iter_mut().zip(inertia) {
            *slot -= inertia;
        }
        let mut deviation = Self { law, kernel, head, inertia, oscillation: None, zero_missed: false };
        let model = kernel.model();
        if model.mass_kg() > 0.0 {
            match zero_of(|ln_s| model.modulus_and_slope(ln_s), model.mass_kg()) {
                Some(ln_s) => deviation.oscillation = Oscillation::find(&deviation, ln_s),
                None => deviation.zero_missed = true,
            }
        }
        deviation
    }

    /// Sums over δ and q of the first steps, at most 64.
    #[inline(never)]
    fn first_steps(&self, steps: f64) -> (Sums, Sums) {
        let mut delta = self.head;
        for (loss, weight) in self.law.memory.modes() {
            let (mut left, kept) = (weight.to_f64(), 1.0 - loss.to_f64());
            for slot in delta.iter_mut().skip(HEAD + 1) {
                *slot += left;
                left *= kept;
            }
        }
        let exact = self.kernel.head();
        for (delta, g) in delta.iter_mut().zip(exact) {
            *delta -= g;
        }
        // q is the running sum of δ over the coefficients of full memory.
        let mut ratio = [0.0; TERMS];
        let (mut force, mut displacement, mut q, mut step) = (Sums::ZERO, Sums::ZERO, 0.0, 0.0);
        for k in 0..TERMS {
            if step > steps {
                break;
            }
            let before = || ratio[..k].iter().rev();
            let known: f64 = exact[1..=k].iter().zip(before()).map(|(a, b)| a * b).sum();
            let inert: f64 = self.inertia[1..].iter().zip(before()).map(|(a, b)| a * b).sum();
            ratio[k] = (delta[k] - known - inert) / (exact[0] + self.inertia[0]);
            q += ratio[k];
            force.add(delta[k], 1.0);
            displacement.add(q, 1.0);
            step += 1.0;
        }
        (force, displacement)
    }

    /// δ and q without its oscillation, `step` ≥ 64 steps later.
    fn at(&self, step: f64) -> [f64; 2] {
        laplace::invert_all(step, |sigma| {
            let difference = -complex::expm1(-sigma);
            let ln_s = self.kernel.ln_s(difference);
            let modulus = self.kernel.model().modulus_of_ln(ln_s);
            let delta = self.transform(difference, modulus);
            let stiffness = modulus + complex::exp(ln_s * 2.0) * self.kernel.model().mass_kg();
            let oscillation = self.oscillation.as_ref().map_or(Complex::ZERO, |pair| pair.transform(sigma));
            [delta, delta / stiffness - oscillation]
        })
    }

    /// The series of δ in the delay ζ where 1 − ζ is `difference` and K(s) is `modulus`.
    fn transform(&self, difference: Complex<f64>, modulus: Complex<f64>) -> Complex<f64> {
        let delay = Complex::new(1.0, 0.0) - difference;
        let modes = self
            .law
            .memory
            .modes()
            // One division instead of two: half of what a place costs.
            .map(|(loss, weight)| {
                let pole = difference + delay * loss.to_f64();
                pole.conj() * (weight.to_f64() / pole.norm_sqr())
            });
        let tail: Complex<f64> = modes.fold(Complex::ZERO, |sum, mode| sum + mode);
        let law = self.head[..=HEAD].iter().rev().fold(tail, |later, coefficient| later * delay + *coefficient);
        law - modulus / difference
    }
}

/// The part of q that oscillates: r ζ₀^−j and its conjugate, from the pair of zeros of m s² + K(s).
///
/// There is at most one pair away from the negative real axis: Im K > 0 above it, and so the argument of m s² + K(s) turns
/// once around the upper half plane.
struct Oscillation {
    /// −ln ζ₀.
    exponent: Complex<f64>,
    residue: Complex<f64>,
    /// 1 − ζ₀.
    difference: Complex<f64>,
}

impl Oscillation {
    /// Zeros as near to the negative real axis as this (rad) decay before they swing. They are left to the integral.
    const APERIODIC: f64 = 0.3;
    /// ln of the rest of an oscillation after 64 steps that is not taken out.
    const GONE: f64 = -34.0;

    /// The oscillation that belongs to the zero at `ln_s`; none where it has died out after 64 steps or does not swing.
    fn find<T: Scalar, const HEAD: usize, const FAST: usize, const SLOW: usize>(
        deviation: &Deviation<'_, T, HEAD, FAST, SLOW>,
        ln_s: Complex<f64>,
    ) -> Option<Self> {
        if ln_s.im > PI - Self::APERIODIC {
            return None;
        }
        let (model, step_s) = (deviation.kernel.model(), deviation.law.step_s);
        let (modulus, slope) = model.modulus_and_slope(ln_s);
        let scaled = complex::exp(ln_s + libm::log(step_s));
        let one = Complex::new(1.0, 0.0);
        let (difference, steepness) = match deviation.kernel.method() {
            Discretisation::Gl => (scaled, one),
            // δ = d + d²/2 with d = 1 − ζ
            Discretisation::Bdf2 => {
                let root = complex::exp(complex::ln_1p(scaled * 2.0) * 0.5);
                (scaled * 2.0 / (root + 1.0), root)
            }
        };
        let exponent = -complex::ln_1p(-difference);
        if TERMS_F64 * exponent.re < Self::GONE {
            return None;
        }
        // d/dσ of m s² + K(s), with ds/dσ = ζ δ'/h. At the zero m s² = −K.
        let derivative = (slope - modulus * 2.0) / scaled * steepness * (one - difference);
        let residue = deviation.transform(difference, modulus) / derivative;
        Some(Self { exponent, residue, difference })
    }

    fn transform(&self, sigma: Complex<f64>) -> Complex<f64> {
        self.residue / (sigma - self.exponent) + self.residue.conj() / (sigma - self.exponent.conj())
    }

    fn at(&self, step: f64) -> f64 {
        2.0 * (self.residue * complex::exp(self.exponent * step)).re
    }

    /// Whether it turns by more than a radian between places so many steps apart.
    fn turns_in(&self, steps: f64) -> bool {
        self.exponent.im.abs() * steps > 1.0
    }

    /// Largest sum of magnitudes and total variation from step `from` to `steps`.
    fn envelope(&self, from: f64, steps: f64) -> (f64, f64) {
        let lost = -libm::expm1(self.exponent.re);
        let lasts = if lost > 0.0 { (1.0 / lost).min(steps) } else { steps };
        let size = |z: Complex<f64>| libm::hypot(z.re, z.im);
        let first = 2.0 * size(self.residue) * libm::exp(from * self.exponent.re);
        (first * lasts, first * lasts * size(self.difference))
    }
}

/// ln s of the zero of m s² + K(s) in the upper half plane, from K and dK/d ln s. None if it was not found.
///
/// s = √(−K/m) is repeated, which contracts by half the order of K and so ends at once for springpots. Branches of springs and dashpots
/// may turn K faster; there Newton's steps follow.
fn zero_of(modulus: impl Fn(Complex<f64>) -> (Complex<f64>, Complex<f64>), mass: f64) -> Option<Complex<f64>> {
    const REPEATED: usize = 20;
    const ITERATIONS: usize = 100;
    let ln_mass = libm::log(mass);
    let mut ln_s = Complex::new(0.0, 0.5 * PI);
    for iteration in 0..ITERATIONS {
        let (k, slope) = modulus(ln_s);
        let change = (complex::ln(k) - ln_mass + Complex::new(0.0, PI)) * 0.5 - ln_s;
        let newton = change / (Complex::new(1.0, 0.0) - slope / k * 0.5);
        let inside = (0.5 * PI..=PI).contains(&(ln_s + newton).im) && newton.norm_sqr() < 1.0;
        ln_s += match (iteration < REPEATED, inside) {
            (true, _) => change,
            (false, true) => newton,
            (false, false) => change * 0.5,
        };
        if change.norm_sqr() < 1e-24 {
            return Some(ln_s);
        }
    }
    None
}
