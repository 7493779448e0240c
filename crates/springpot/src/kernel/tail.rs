//! The tail of a compressed memory: rates and weights of its exponential modes.

use heapless::Vec;

use crate::error::LawError;
use crate::kernel::Discretisation;
use crate::kernel::laplace::Kernel;
use crate::kernel::quadrature::{JacobiMatrix, MAX_NODES};
use crate::kernel::spectrum::{Line, Spectrum};
use crate::model::Maxwell;

/// A mode of the tail: a Maxwell element as the head's end sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DecayMode {
    /// Rate a times step: the relaxation rate, or with [`Discretisation::Bdf2`] what belongs to it.
    scaled_rate: f64,
    /// Force on the first step after the head, N/m.
    pub(crate) weight: f64,
}

impl DecayMode {
    /// 1 − ρ with ρ = 1/(1 + ah).
    pub(crate) fn loss(&self) -> f64 {
        self.scaled_rate / (1.0 + self.scaled_rate)
    }

    /// Force that is left `steps` later, N/m.
    fn after(&self, steps: f64) -> f64 {
        self.weight * libm::exp(-steps * libm::log1p(self.scaled_rate))
    }
}

/// A variable in which the modes of a power law are nearly evenly spaced, from −1 (slow) to 1 (fast).
///
/// First `p = ln((r + a)/(r + b))`, logarithmic between the horizon's rate a and the head's rate b and flat outside, where
/// no resolution is needed. Then the sine map of D. Kosloff and H. Tal-Ezer (J. Comput. Phys. 104 (1993) 457), which
/// evens out the crowding of Gauss nodes at the ends.
///
/// The three constants were chosen by a search for the smallest tail error of single springpots of order 0.05…0.98 and
/// of branches with narrow lines, at 5 kHz and 24 h; the minimum is flat.
struct Warp {
    a: f64,
    b: f64,
    span: f64,
}

impl Warp {
    const STRENGTH: f64 = 1.3;
    /// Rate below which modes are not resolved, in 1/horizon.
    const MIN_RATE: f64 = 2.0;
    /// Rate above which modes are not resolved, in 1/head.
    const MAX_RATE: f64 = 6.0;

    fn new(horizon_s: f64, head_s: f64) -> Self {
        let (a, b) = (Self::MIN_RATE / horizon_s, Self::MAX_RATE / head_s);
        Self { a, b, span: libm::log(a / b) }
    }

    fn place(&self, rate: f64) -> f64 {
        let p = libm::log((rate + self.a) / (rate + self.b));
        libm::sin(Self::STRENGTH * (1.0 - 2.0 * p / self.span)) / libm::sin(Self::STRENGTH)
    }

    fn rate(&self, place: f64) -> f64 {
        let sine = (place * libm::sin(Self::STRENGTH)).clamp(-1.0, 1.0);
        let p = 0.5 * self.span * (1.0 - libm::asin(sine) / Self::STRENGTH);
        let ratio = libm::exp(p);
        ((ratio * self.b - self.a) / (1.0 - ratio)).max(0.0)
    }
}

/// At most `count` modes that follow `model` beyond `head` increments of `step_s`, fastest first.
///
/// Springs and discrete relaxation times become modes exactly. The rest of the relaxation spectrum is summed densely and
/// replaced by its Gauss quadrature rule in the [`Warp`]ed rate: positive weights without a fit. The measure is relative to
/// the model's modulus at each rate, so that every time scale has the same relative accuracy.
pub(crate) fn modes(
    model: &Maxwell,
    step_s: f64,
    horizon_s: f64,
    head: usize,
    count: usize,
    method: Discretisation,
) -> Result<Vec<DecayMode, MAX_NODES>, LawError> {
    #[allow(clippy::cast_precision_loss)] // a head is short
    let head = head as f64;
    // A Maxwell element of the spectrum at the first step after the head.
    let mode = |Line { rate, weight }: Line| {
        let scaled_rate = rate * step_s;
        let weight = weight * libm::exp(-(head + 2.0) * libm::log1p(scaled_rate));
        DecayMode { scaled_rate, weight }
    };
    // Less than 1e-17 of faster modes is left after the head.
    let fastest = libm::expm1(40.0 / (head + 2.0)) / step_s;
    let spectrum = Spectrum::new(model, 1e-4 / horizon_s, fastest, method.bend(step_s));

    let equilibrium = Some(spectrum.equilibrium()).filter(|&spring| spring > 0.0);
    let lines = spectrum.lines();
    let exact = lines.len() + equilibrium.iter().count();
    if exact > count {
        return Err(LawError::TooFewModes { modes: count, needed: exact });
    }
    let mut modes: Vec<DecayMode, MAX_NODES> = Vec::new();
    modes.extend(equilibrium.map(|weight| DecayMode { scaled_rate: 0.0, weight }));
    modes.extend(lines.into_iter().map(mode));

    let warp = Warp::new(horizon_s, head * step_s);
    let scale = |rate: f64| model.modulus_real(rate + 1.0 / horizon_s);
    let mut measure = JacobiMatrix::new(count - exact);
    spectrum.density(|line| measure.add(warp.place(line.rate), mode(line).weight / scale(line.rate)));
    modes.extend(measure.rule().into_iter().map(|(place, share)| {
        let rate = warp.rate(place);
        DecayMode { scaled_rate: rate * step_s, weight: share * scale(rate) }
    }));

    modes.sort_unstable_by(|x, y| y.scaled_rate.total_cmp(&x.scaled_rate));
    Ok(modes)
}

/// Largest error of `modes` from the end of the head to the horizon, at three places an octave, relative to the model's
/// modulus K(1/t) at that time t. The exact values come from another integral than the modes.
pub(crate) fn error(model: &Maxwell, kernel: &Kernel<'_>, modes: &[DecayMode], horizon_s: f64, head: usize) -> f64 {
    let (mut worst, mut j) = (0.0, head);
    #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    loop {
        j = (j + 1).max((j as f64 * 1.26) as usize);
        let time = (j + 1) as f64 * kernel.step_s();
        if time > horizon_s {
            return worst;
        }
        let after_head = (j - head - 1) as f64;
        let tail: f64 = modes.iter().map(|mode| mode.after(after_head)).sum();
        let error = (tail - kernel.at(j)).abs() / model.modulus_real(1.0 / time);
        if error.is_nan() {
            return error;
        }
        worst = error.max(worst);
    }
}

/// Sum of the differences of `exact` from `modes` (g_0 …) between `head` and its end, N/m.
///
/// The fast partners of modes that a second-order method adds have decayed there. Added to the head's last weight, this is right for
/// increments that change little within those few steps.
pub(crate) fn missed(exact: &[f64], modes: &[DecayMode], head: usize) -> f64 {
    let (mut sum, mut after_head) = (0.0, 0.0);
    for g in exact.iter().skip(head + 1) {
        sum += g - modes.iter().map(|mode| mode.after(after_head)).sum::<f64>();
        after_head += 1.0;
    }
    sum
}
