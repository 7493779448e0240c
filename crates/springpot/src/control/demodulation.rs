//! Lock-in demodulation of a tone of four ticks a period.

use crate::scalar::Real;

/// Differences before the demodulation.
const STAGES: usize = 3;
/// Their gain at the tone.
pub(crate) const GAIN: f64 = 8.0;

/// The phasor of a signal at a quarter of the tick's rate.
///
/// Sine and cosine of that tone are 0, 1, 0, −1 at the ticks, so each signal needs differences alone:
///
/// ```text
/// y_k = (1 − ζ²)³ x_k,    s_k = y_k − s_{k−2},    ζ the delay of one tick
/// ```
///
/// y has no constant, linear and quadratic part of x, and eight times its tone; s sums y against cosine and sine that are 1 and 0 at the
/// newest tick. After n ticks from s = 0 the phasor of a tone A cos(πk/2 + φ) is 4 n A e^{iφ}, φ that of the newest tick. Over whole periods
/// what is left of the drive falls with the fourth power of its frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Demodulator<T> {
    /// The last two values before each difference.
    stages: [[T; 2]; STAGES],
    sums: [T; 2],
}

impl<T: Real> Demodulator<T> {
    pub(crate) const AT_REST: Self = Self { stages: [[T::ZERO; 2]; STAGES], sums: [T::ZERO; 2] };

    /// Takes the next value. Returns it without the tone: the mean of this and the one two ticks before.
    #[inline]
    pub(crate) fn advance(&mut self, value: T) -> T {
        let without = T::from_f64(0.5) * (value + self.stages[0][0]);
        let mut difference = value;
        for stage in &mut self.stages {
            let [earlier, last] = *stage;
            *stage = [last, difference];
            difference = difference - earlier;
        }
        self.sums = [self.sums[1], difference - self.sums[0]];
        without
    }

    /// The last value.
    #[inline]
    pub(crate) fn last(&self) -> T {
        self.stages[0][1]
    }

    /// Real and imaginary part of the sum since the last call, from which the next begins.
    #[inline]
    pub(crate) fn take(&mut self) -> [T; 2] {
        let [imaginary, real] = self.sums;
        self.sums = [T::ZERO; 2];
        [real, imaginary]
    }
}

/// The square of a phasor.
#[inline]
pub(crate) fn square<T: Real>([re, im]: [T; 2]) -> T {
    re * re + im * im
}

/// The parts of the current across the voltage and along it, times the voltage.
#[inline]
pub(crate) fn products<T: Real>(voltage: [T; 2], current: [T; 2]) -> [T; 2] {
    let ([v_re, v_im], [j_re, j_im]) = (voltage, current);
    [v_re * j_im - v_im * j_re, v_re * j_re + v_im * j_im]
}
