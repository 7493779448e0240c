//! A block of learning: the cycles over which harmonics are measured.

use core::f64::consts::TAU;

use crate::numbers::Numbers;
use crate::scalar::Real;

/// A block: some time to settle, then whole cycles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Block<T> {
    /// Ticks since its begin, and since the last block ended.
    pub(super) ticks: T,
    pub(super) ticks_since_end: T,
    /// Angle of the cycles since the film settled, and where the next one ends, rad.
    pub(super) angle: T,
    pub(super) next_end: T,
    pub(super) samples: T,
    /// Σ e², m².
    pub(super) sum_of_squares: T,
    /// Once it has ended: what makes E of the sums, and the variance of each part of E by noise, m².
    pub(crate) scale: T,
    pub(crate) variance: T,
    pub(super) has_ended: bool,
    /// Whether the block before showed more than noise: then this one is short.
    pub(super) is_short: bool,
}

impl<T: Real> Block<T> {
    /// The first one.
    pub(super) fn first() -> Self {
        let zero = T::ZERO;
        Self {
            ticks: zero,
            ticks_since_end: zero,
            angle: zero,
            next_end: T::from_f64(TAU),
            samples: zero,
            sum_of_squares: zero,
            scale: zero,
            variance: zero,
            has_ended: false,
            is_short: true,
        }
    }

    /// Ends it. What the harmonics do not explain of e is noise: `explained` is what they do, in the square of the sums. Returns the mean
    /// squares (m²) of what they explain and of the noise.
    pub(super) fn complete(&mut self, explained: T) -> [T; 2] {
        self.scale = T::from_f64(2.0) / self.samples;
        let residual = self.sum_of_squares - self.scale * explained;
        self.variance = if residual > T::ZERO { self.scale * residual / self.samples } else { T::ZERO };
        self.has_ended = true;
        self.is_short = false;
        self.ticks_since_end = T::ZERO;
        let explained = self.scale * explained / self.samples;
        [explained, self.sum_of_squares / self.samples - explained]
    }
}

/// Mean square of the error over the least one up to which learning takes over from the observer, above which it gives back (as above the
/// one without a correction), and above which a correction is no longer trusted.
const GROWTH: [f64; 3] = [1.2, 1.5, 2.0];
/// Variances of a part of E that noise alone may show: twice the parts of all harmonics.
const NOISE_PARTS: f64 = 26.0;
/// Growth of the error, its noise included, at which a block ends early, once it has so many samples.
const EXCESS: f64 = 6.0;
const EXCESS_SAMPLES: f64 = 16.0;
/// Share of the sensor's correction that is taken over with a block; twice as much is given back.
const TAKEN: f64 = 1.0 / 16.0;
/// Factors of the caution after a block whose error has grown, and after another one.
const CAUTION: [f64; 2] = [0.5, 1.2];
/// Mean square of the error over the one without a correction from which a correction does harm.
const HARM: f64 = 1.5;
/// Factor of the largest caution after harm, and the one from which nothing is added any more.
const TRUST: [f64; 2] = [0.5, 0.1];
/// Share of the error of the block before from which a film without a correction no longer settles, and of the largest one since harm above which
/// the film is what has changed.
const SETTLED: [f64; 2] = [0.9, 0.7];
/// No block yet: larger than the square of any stroke.
const NONE: f64 = 1e30;

/// Rating of the correction that was added in a block, once it has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// The least error so far.
    Best,
    /// About as good.
    Good,
    /// Worse: back to the best.
    Worse,
    /// Worse than without a correction: back to none.
    Harmful,
    /// Nothing is added, and the error still falls by itself.
    Settling,
}

/// Progress of learning over the blocks of a period, so that what is added does not make a film worse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Progress<T> {
    /// The least mean square of what the harmonics explained of a block, m².
    least: T,
    /// The mean square of the noise in the last block, m².
    pub(super) noise: T,
    /// Factor on the step size.
    pub(crate) caution: T,
    /// Share of the sensor's correction of cycles that learning has taken over.
    pub(super) taken_over: T,
    /// Whether nothing is added, the mean square of the error when nothing was, and that of the last block with harm, m².
    pub(super) is_bare: bool,
    without: T,
    harm: T,
    /// The largest caution.
    trust: T,
    /// The mean square of the error at which a block ends early, m².
    excess: T,
    pub(crate) verdict: Verdict,
}

impl<T: Real> Progress<T> {
    /// Visits the constants that judge a block.
    pub(super) fn numbers(take: &mut impl Numbers<T>) {
        take.array("growth", GROWTH.map(T::from_f64), "");
        take.number("noise_parts", T::from_f64(NOISE_PARTS), "");
        take.number("excess", T::from_f64(EXCESS), "");
        take.number("excess_samples", T::from_f64(EXCESS_SAMPLES), "");
        take.number("taken", T::from_f64(TAKEN), "");
        take.array("caution", CAUTION.map(T::from_f64), "");
        take.number("harm", T::from_f64(HARM), "");
        take.array("trust", TRUST.map(T::from_f64), "");
        take.array("settled", SETTLED.map(T::from_f64), "");
        take.number("no_error", T::from_f64(NONE), "m^2");
    }

    pub(super) fn none() -> Self {
        let (none, one) = (T::from_f64(NONE), T::from_f64(1.0));
        Self {
            least: none,
            noise: T::ZERO,
            caution: one,
            taken_over: T::ZERO,
            is_bare: true,
            without: T::ZERO,
            harm: T::ZERO,
            trust: one,
            excess: none,
            verdict: Verdict::Best,
        }
    }

    /// For another period, with the same correction.
    pub(super) fn renewed(&self) -> Self {
        let without = if self.is_bare { T::ZERO } else { T::from_f64(NONE) };
        Self { is_bare: self.is_bare, without, ..Self::none() }
    }

    /// For another run that begins with what was learned in this one.
    pub(super) fn carried_over(&self) -> Self {
        Self { taken_over: self.taken_over, caution: self.caution, trust: self.trust, ..self.renewed() }
    }

    /// Whether a block is so much worse than the best one, or than without a correction, that it need not end.
    pub(super) fn is_excessive(&self, block: &Block<T>) -> bool {
        block.samples > T::from_f64(EXCESS_SAMPLES) && block.sum_of_squares > self.excess * block.samples
    }

    /// Takes a block that has ended: the mean squares (m²) of what the harmonics explain of the error, and of its noise, which gives each
    /// part of a harmonic the `variance` (m²).
    pub(super) fn judge(&mut self, mean_squares: [T; 2], variance: T) {
        self.rate(mean_squares, variance);
        let best = self.least + self.noise;
        let best = if best < self.without { best } else { self.without };
        self.excess = T::from_f64(EXCESS) * best;
    }

    fn rate(&mut self, [mean_square, noise]: [T; 2], variance: T) {
        self.noise = noise;
        let (zero, one) = (T::ZERO, T::from_f64(1.0));
        let total = mean_square + noise;
        if self.is_bare {
            let settles = total < T::from_f64(SETTLED[0]) * self.without;
            (self.without, self.least) = (total, mean_square);
            self.verdict = if settles { Verdict::Settling } else { Verdict::Best };
            if settles {
                self.harm = if self.harm > zero && total > self.harm { total } else { self.harm };
            } else if self.harm > zero {
                let is_film = total > T::from_f64(SETTLED[1]) * self.harm;
                self.trust = if is_film { one } else { T::from_f64(TRUST[0]) * self.trust };
                self.trust = if self.trust < T::from_f64(TRUST[1]) { zero } else { self.trust };
                (self.caution, self.harm) = (self.trust, zero);
            }
            return;
        }
        let [alike, grown, worse] =
            GROWTH.map(|growth| T::from_f64(growth) * (self.least + T::from_f64(NOISE_PARTS) * variance));
        let harmful = T::from_f64(HARM) * (self.without + T::from_f64(NOISE_PARTS) * variance);
        // Of an error that is not known without a correction, one that has grown is enough.
        if total > harmful || mean_square > worse && self.without >= T::from_f64(NONE) {
            (self.taken_over, self.harm, self.without, self.is_bare) = (zero, total, T::from_f64(NONE), true);
            self.verdict = Verdict::Harmful;
            return;
        }
        let step = T::from_f64(TAKEN);
        let taken = if mean_square > grown || total > self.without {
            self.taken_over - (step + step)
        } else if mean_square > alike {
            self.taken_over
        } else {
            self.taken_over + step
        };
        let taken = if taken > one { one } else { taken };
        self.taken_over = if taken > zero { taken } else { zero };
        if mean_square > worse {
            // What the film does with the best correction now is measured next.
            self.least = T::from_f64(NONE);
            self.verdict = Verdict::Worse;
            self.caution = T::from_f64(CAUTION[0]) * self.caution;
            return;
        }
        let caution = T::from_f64(CAUTION[1]) * self.caution;
        self.caution = if caution > self.trust { self.trust } else { caution };
        self.verdict = if mean_square > alike { Verdict::Good } else { Verdict::Best };
        self.least = if mean_square > self.least { self.least } else { mean_square };
    }
}
