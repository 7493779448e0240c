//! The bandwidths with which the loop of an observer is damped at the resonance of its model.

use core::cmp::Ordering;
use core::f64::consts::TAU;

use num_complex::Complex;

use crate::control::observer_options::ObserverOptions;
use crate::law::{Law, Memory, Tangent};
use crate::scalar::Real;

/// Smallest resonance of the model in bandwidths. On the films of Hossain and Wang, with a resonance near 3 Hz, the loop begins to
/// ring at 0.9 to 1 Hz and is unstable from 1.2 Hz.
const RESONANCE_MARGIN: f64 = 3.0;
/// Smallest distance of the loop C G from −1 near the model's resonance, and where it is real. On random laws with little damping the observer rings
/// from −1 on.
const LOOP_DISTANCE: f64 = 0.2;
const MIN_REAL_LOOP: f64 = -0.7;
/// Largest loop at the resonance that is small everywhere near it.
const SMALL_LOOP: f64 = 0.25;
/// Halvings of an octave in which the resonance is.
const HALVINGS: usize = 14;
/// Shares of the resonance by which frequencies near it differ from it: the powers of this.
const DETUNING: f64 = 0.7;
const DETUNINGS: usize = 24;
/// Share of a bandwidth that is tried next, and how many are tried: down to 1 % of the first.
const LOWER: f64 = 0.8;
const BANDWIDTHS: usize = 21;

impl ObserverOptions {
    /// The same with the largest bandwidth, a fifth lower at a time, that the sensor allows and with which an observer of `law` does not ring at the
    /// resonance of the law, in single precision as a controller stores it. Unchanged where [`Observer::new`](crate::Observer::new) refuses every one.
    #[must_use]
    pub fn below_resonance<T: Real, M: Memory<T>>(self, law: &Law<T, M>) -> Self {
        let lower = |options: &Self| {
            #[allow(clippy::cast_possible_truncation)] // of a positive number
            let bandwidth_hz = f64::from((LOWER * options.bandwidth_hz) as f32);
            Some(Self { bandwidth_hz, ..*options })
        };
        let mut tried = core::iter::successors(Some(self), lower).take(BANDWIDTHS);
        tried.find(|options| options.check().is_ok() && options.is_below_resonance(law)).unwrap_or(self)
    }

    pub(super) fn is_below_resonance<T: Real, M: Memory<T>>(&self, law: &Law<T, M>) -> bool {
        let (at_rest, softest) = (law.tangent_at_rest(), law.softest());
        let stiffness = law.dynamic_stiffness(self.bandwidth_hz, at_rest);
        // At the resonance the inertia outweighs the stiffness, first where the film is softest.
        let above = law.dynamic_stiffness(RESONANCE_MARGIN * self.bandwidth_hz, softest);
        let is_stiff = stiffness.re > 0.0 && stiffness.im.is_finite() && above.re > 0.0;
        is_stiff
            && softest_stiffness(law, self.bandwidth_hz) > 0.0
            && is_damped(law, at_rest, self)
            && (!law.is_curved() || is_damped(law, softest, self))
    }
}

/// Force over displacement at `bandwidth_hz` where the film is softest, N/m.
pub(super) fn softest_stiffness<T: Real, M: Memory<T>>(law: &Law<T, M>, bandwidth_hz: f64) -> f64 {
    let softest = law.softest();
    if softest.spring == 0.0 && softest.in_series == 0.0 {
        softest.memory * law.dynamic_stiffness(bandwidth_hz, law.tangent_at_rest()).re
    } else {
        law.dynamic_stiffness(bandwidth_hz, softest).re
    }
}

/// Whether the loop C G of an observer with these options along `law`, where that has this `tangent`, keeps away from −1 at the law's resonance: it goes
/// through a circle there, whose size is C over what damps the film. Also without a resonance up to a quarter of the rate.
#[inline(never)]
fn is_damped<T: Real, M: Memory<T>>(law: &Law<T, M>, tangent: Tangent, options: &ObserverOptions) -> bool {
    let ObserverOptions { bandwidth_hz, delay_s, sample_interval_s, .. } = *options;
    // Frequencies as the tangent of half the angle of a tick.
    let tan_of = |hz: f64| 0.5 * TAU * hz * law.step_s();
    let (mut low, mut high) = (0.0, tan_of(RESONANCE_MARGIN * bandwidth_hz));
    while law.stepped_stiffness(high, tangent).re > 0.0 {
        if high > 1.0 {
            return true;
        }
        (low, high) = (high, 2.0 * high);
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        *(if law.stepped_stiffness(middle, tangent).re > 0.0 { &mut low } else { &mut high }) = middle;
    }
    let stiffness = law.dynamic_stiffness(bandwidth_hz, tangent);
    #[allow(clippy::cast_possible_truncation)] // as many as an observer remembers
    let late = ((delay_s + 0.5 * sample_interval_s) / law.step_s()) as i32;
    let loop_at = |tan: f64| -> Complex<f64> {
        let bandwidths = tan / tan_of(bandwidth_hz);
        let correction = Complex::new(
            stiffness.im.max(0.0) - 0.5 * stiffness.re / (bandwidths * bandwidths),
            -stiffness.re / bandwidths,
        );
        let tick = Complex::new(1.0, -tan) / Complex::new(1.0, tan);
        let film = law.stepped_stiffness(tan, tangent) * Complex::new(1.0, 0.25 * bandwidths);
        tick.powi(late) * correction / film
    };
    if loop_at(low).norm_sqr() < SMALL_LOOP * SMALL_LOOP {
        return true;
    }
    let (mut detuning, mut before) = (-DETUNING, Complex::default());
    for k in 0..2 * DETUNINGS {
        let now = loop_at(low * (1.0 + detuning));
        let real = before.re - before.im * (now.re - before.re) / (now.im - before.im);
        if (now + 1.0).norm_sqr() < LOOP_DISTANCE * LOOP_DISTANCE || before.im * now.im < 0.0 && real < MIN_REAL_LOOP {
            return false;
        }
        before = now;
        detuning = match k.cmp(&DETUNINGS) {
            Ordering::Less => detuning * DETUNING,
            Ordering::Equal => -detuning,
            Ordering::Greater => detuning / DETUNING,
        };
    }
    true
}
