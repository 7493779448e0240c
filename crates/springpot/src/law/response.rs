//! Responses in frequency and time, of a law and of the continuous model.

use core::f64::consts::TAU;

use num_complex::Complex;

use crate::complex;
use crate::kernel::Discretisation;
use crate::kernel::laplace;
use crate::law::{Law, Memory};
use crate::model::Maxwell;
use crate::scalar::Scalar;

impl Maxwell {
    /// Displacement over force at `frequency_hz` in steady state, Eq. 11 with s = 2πif, in m/N. It does not exist at 0 Hz,
    /// where a springpot has no steady state: NaN.
    #[must_use]
    pub fn frequency_response(&self, frequency_hz: f64) -> Complex<f64> {
        self.compliance(Complex::new(0.0, TAU * frequency_hz))
    }

    /// Force left at `time_s` > 0 after a unit step of displacement, in N/m, without the mass.
    ///
    /// Accurate to about 1e-12 of K(1/t); NaN for times that are not positive.
    #[must_use]
    pub fn relaxation_modulus(&self, time_s: f64) -> f64 {
        if time_s > 0.0 { laplace::invert(time_s, |s| self.modulus(s) / s) } else { f64::NAN }
    }

    /// Displacement at `time_s` > 0 after a unit step of force, in m/N, without the mass.
    ///
    /// Accurate to about 1e-12 of the compliance; NaN for times that are not positive.
    #[must_use]
    pub fn creep_compliance(&self, time_s: f64) -> f64 {
        if time_s > 0.0 {
            laplace::invert(time_s, |s| Complex::new(1.0, 0.0) / (self.modulus(s) * s))
        } else {
            f64::NAN
        }
    }
}

/// A film for small changes about a place: how many times stiffer its memory is there than by itself, the spring beside it (N/m), and the compliance of
/// the one in series (m/N).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Tangent {
    pub(crate) memory: f64,
    pub(crate) spring: f64,
    pub(crate) in_series: f64,
}

impl Tangent {
    /// That of a film without curves.
    pub(crate) const REST: Self = Self { memory: 1.0, spring: 0.0, in_series: 0.0 };
}

impl<T: Scalar, M: Memory<T>> Law<T, M> {
    /// Displacement over force at `frequency_hz` in steady state, in m/N, as this law with its rounded constants steps
    /// it; below a tenth of the rate close to [`Maxwell::frequency_response`]. NaN at 0 Hz. With an elastic curve: for small
    /// oscillations about x = 0.
    #[must_use]
    pub fn frequency_response(&self, frequency_hz: f64) -> Complex<f64> {
        self.frequency_response_about(frequency_hz, 0.0)
    }

    /// The same for small oscillations about the displacement `working_point_m` (m), where elastic curves have other slopes. Beside a spring
    /// for a film that has been there for so long that its memory has no force left.
    #[must_use]
    pub fn frequency_response_about(&self, frequency_hz: f64, working_point_m: f64) -> Complex<f64> {
        let tangent = self.tangent_at(working_point_m);
        let turn = Complex::new(0.0, -TAU * frequency_hz * self.step_s());
        Complex::new(1.0, 0.0) / self.stiffness_of(complex::exp(turn), -complex::expm1(turn), tangent)
    }

    /// Force over displacement at `frequency_hz` in steady state, in N/m, of the film that this law discretises, where it has
    /// this `tangent`: with δ(ζ)/h = 2πif, as the recursion has it for slow changes. Needs the four basic operations alone.
    #[must_use]
    #[inline(never)] // not within a loop over frequencies on a small chip
    pub(crate) fn dynamic_stiffness(&self, frequency_hz: f64, tangent: Tangent) -> Complex<f64> {
        let s = Complex::new(0.0, TAU * frequency_hz * self.step_s());
        let difference = match self.method() {
            Discretisation::Gl => s,
            // δ = d + d²/2 with d = 1 − ζ, by Newton's method: 1e-15 for |s| < 1/2.
            Discretisation::Bdf2 => (0..4).fold(s, |d, _| (s + d * d * 0.5) / (d + 1.0)),
        };
        self.stiffness_of(Complex::new(1.0, 0.0) - difference, difference, tangent)
    }

    /// Force over displacement in steady state, in N/m, as this law steps it where it has this `tangent`, at the frequency of which half an angle of a tick
    /// has the tangent `tan`. Needs the four basic operations alone.
    #[must_use]
    pub(crate) fn stepped_stiffness(&self, tan: f64, tangent: Tangent) -> Complex<f64> {
        let turn = Complex::new(1.0, tan);
        self.stiffness_of(turn.conj() / turn, Complex::new(0.0, 2.0 * tan) / turn, tangent)
    }

    /// Force over displacement of slow changes about x = 0, at 1 Hz without the inertia's share, N/m.
    #[must_use]
    pub(crate) fn stiffness_at_rest(&self) -> f64 {
        let stiffness = self.dynamic_stiffness(1.0, self.tangent_at_rest());
        stiffness.re.abs().max(stiffness.im.abs())
    }

    /// Force over displacement for a delay of ζ in a step and 1 − ζ, N/m, where the film has this `tangent`.
    #[inline(never)]
    fn stiffness_of(&self, delay: Complex<f64>, difference: Complex<f64>, tangent: Tangent) -> Complex<f64> {
        let Tangent { memory: slope, spring, in_series } = tangent;
        // F = [ζ B(ζ) + S (1 − ζ)] Δx and Δx = (1 − ζ) x.
        let response = self.memory().response(delay, difference);
        if in_series > 0.0 {
            let inertia = self.stiffness_of(delay, difference, Tangent { memory: 0.0, ..Tangent::REST });
            let memory = (delay * response + difference * self.instant()) * difference;
            return memory / (memory * in_series + 1.0) + inertia;
        }
        let force = match self.separate_inertia() {
            // Behind a curve the memory has no inertia.
            Some((newest, [first, second, third])) => {
                let past = delay * (delay * (delay * third + second) + first);
                (delay * response + difference * self.instant()) * slope + past + newest
            }
            None if self.curved.is_none() => delay * response + difference * self.stiffness().to_f64(),
            None => {
                let inertia = self.stiffness().to_f64() - self.instant();
                (delay * response) * slope + difference * (self.instant() * slope + inertia)
            }
        };
        force * difference + spring
    }
}
