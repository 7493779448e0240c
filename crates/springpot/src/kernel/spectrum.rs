//! The relaxation spectrum of a model: its modulus as a positive sum of Maxwell elements.
//!
//! A network of springpots has a completely monotone relaxation modulus,
//! `G(t) = g∞ + Σ lines k e^{−rt} + ∫ χ(r) e^{−rt} dr/r` with `χ(r) = Im K(r e^{iπ}) / π ≥ 0`, the jump of K across its
//! cut. Orders 0 and 1 give springs and discrete relaxation times (lines), all others a density. The same density serves
//! the Grünwald–Letnikov law, where s = (1 − ζ)/h turns every `e^{−rt}` into `(1 + rh)^{−(j+1)}`.
//!
//! With [`Discretisation::Bdf2`](crate::Discretisation) the cut s = −r lies where −δ(ζ) = rh, on 1 < ζ < 3: a mode `(1 + ah)^{−(j+1)}` belongs to the rate
//! r = a (1 − ah/2), and the density in ln a is χ(r). It is positive, and the sum over a is exact for a single springpot
//! and for chains whose orders differ by less than ½. Beyond that, and for lines, what is missing decays at least as 2^−j.
//!
//! Chains of a nearly elastic and a nearly viscous springpot have a density with a peak that may be 1e-9 of a decade
//! wide. Its place is known (where the chain's compliance turns imaginary on the cut), so the density is summed
//! outwards from there on panels that double in width, and evaluated from differences to the peak.

use core::f64::consts::PI;

use heapless::Vec;

use crate::complex::{cos_pi, sin_pi};
use crate::error::MAX_BRANCHES;
use crate::model::Springpot;
use crate::model::{Chain, Maxwell};

/// Orders this close to 0 or 1 are springs and dashpots: over nine decades of rates the difference is 2e-8, within what
/// the compressed memory promises.
const SNAP: f64 = 1e-9;

/// Half the distance in ζ below which a mode and its fast partner count as met.
const MEETING: f64 = 0.05;

/// A Maxwell element of the spectrum.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    /// Rate a of its mode, ρ = 1/(1 + ah), in 1/s: the relaxation rate, or with a bend what belongs to it.
    pub(crate) rate: f64,
    /// Stiffness in N/m.
    pub(crate) weight: f64,
}

/// The spectrum of a model between the rates that matter.
pub(crate) struct Spectrum<'a> {
    model: &'a Maxwell,
    slowest: f64,
    fastest: f64,
    /// [`Discretisation::bend`](crate::Discretisation::bend), s.
    bend: f64,
}

impl<'a> Spectrum<'a> {
    /// The spectrum of `model` from rate `slowest` to rate `fastest` (1/s). What is slower is kept, lumped at its mean
    /// rate; what is faster is left out.
    /// `bend` (s) is that of the method.
    pub(crate) fn new(model: &'a Maxwell, slowest: f64, fastest: f64, bend: f64) -> Self {
        Self { model, slowest: libm::log(slowest), fastest: libm::log(fastest), bend }
    }

    /// Stiffness in N/m that never relaxes.
    pub(crate) fn equilibrium(&self) -> f64 {
        self.model
            .chains()
            .filter(|chain| chain.elements.iter().all(|e| order(e) == Order::Spring))
            .map(|chain| chain.scale / chain.elements.iter().map(|e| 1.0 / e.c).sum::<f64>())
            .sum()
    }

    /// The discrete relaxation times: chains of springs and dashpots alone.
    pub(crate) fn lines(&self) -> Vec<Line, MAX_BRANCHES> {
        self.model
            .chains()
            .filter(|chain| chain.elements.iter().all(|e| order(e) != Order::Between))
            .filter_map(|chain| {
                let compliance =
                    |of: Order| -> f64 { chain.elements.iter().filter(|e| order(e) == of).map(|e| 1.0 / e.c).sum() };
                let (spring, dashpot) = (compliance(Order::Spring), compliance(Order::Dashpot));
                (spring > 0.0 && dashpot > 0.0).then(|| Line { rate: dashpot / spring, weight: chain.scale / spring })
            })
            .filter_map(|line| self.bent(line))
            .collect()
    }

    /// The slower of the two modes of a relaxation time; its fast partner decays at least as 2^−j. None where the two
    /// meet, and their weights grow beyond all bounds with opposite signs, or oscillate: together they decay as 2^−j there.
    fn bent(&self, line: Line) -> Option<Line> {
        if self.bend == 0.0 {
            return Some(line);
        }
        let split = libm::sqrt(1.0 - 2.0 * line.rate * self.bend);
        (split > MEETING).then(|| Line {
            rate: 2.0 * line.rate / (1.0 + split),
            weight: line.weight * (1.0 + split) / (2.0 * split),
        })
    }

    /// Visits the density as a dense sum of lines, accurate to about 1e-10 of the modulus.
    pub(crate) fn density(&self, mut visit: impl FnMut(Line)) {
        let mut slow = Line { rate: 0.0, weight: 0.0 };
        for chain in self.model.chains() {
            if chain.elements.iter().all(|e| order(e) != Order::Between) {
                continue;
            }
            let peak = Peak::from_chain(&chain, 0.5 * (self.slowest + self.fastest));
            self.sum_chain(&peak, &mut slow, &mut visit);
        }
        if slow.weight > 0.0 {
            visit(Line { rate: slow.rate / slow.weight, weight: slow.weight });
        }
    }

    /// Sums one chain on panels outwards from its peak. `slow` gathers weight and rate × weight of what is too slow.
    fn sum_chain(&self, peak: &Peak<'_>, slow: &mut Line, visit: &mut impl FnMut(Line)) {
        // Widest panel in ln r on which eight Gauss–Legendre nodes still give 1e-10.
        const WIDEST: f64 = 1.6;
        const SLOW_PANELS: u32 = 70;
        let bend = Bend::at(peak, self.bend);
        let first = bend.width(peak.width).clamp(1e-12, WIDEST);
        let fastest = bend.fastest(peak, self.fastest);

        let mut panel = |from: f64, to: f64, slow: &mut Line| -> f64 {
            let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
            let mut sum = 0.0;
            for (node, weight) in GAUSS_LEGENDRE {
                for offset in [middle - half * node, middle + half * node] {
                    let ln_rate = bend.ln_rate + offset;
                    let density = peak.density(bend.relaxation(offset));
                    let line = Line { rate: libm::exp(ln_rate), weight: density * half * weight };
                    sum += line.weight;
                    if ln_rate < self.slowest {
                        slow.weight += line.weight;
                        slow.rate += line.rate * line.weight;
                    } else if line.weight > 0.0 {
                        visit(line);
                    }
                }
            }
            sum
        };

        let (mut offset, mut width) = (0.0, first);
        while bend.ln_rate + offset < fastest {
            let end = bend.clip(offset + width, fastest);
            panel(offset, end, slow);
            offset += width;
            width = (2.0 * width).min(WIDEST);
        }
        (offset, width) = (0.0, first);
        while bend.ln_rate + offset > self.slowest {
            panel(offset - width, offset, slow);
            offset -= width;
            width = (2.0 * width).min(WIDEST);
        }
        // What is slower still: the density falls as r^α, for small α over very many decades.
        for _ in 0..SLOW_PANELS {
            let more = panel(offset - width, offset, slow);
            offset -= width;
            width *= 1.5;
            if more <= 1e-16 * slow.weight {
                break;
            }
        }
    }
}

/// The rates of modes around a peak of the density, and the relaxation rates that they belong to: r = a (1 − ah/2).
struct Bend {
    /// h of the method, 0 where a mode relaxes at its own rate.
    step_s: f64,
    /// ln a of the peak. A peak that is too fast for any a is replaced by the a of the largest r, 1/h.
    ln_rate: f64,
    /// ah/2 over 1 − ah/2 there.
    ratio: f64,
    /// ln of its r, from the peak's.
    shift: f64,
    /// √(1 − 2rh) of the peak; 0 or negative where it is too fast.
    split: f64,
}

impl Bend {
    fn at(peak: &Peak<'_>, step_s: f64) -> Self {
        if step_s == 0.0 {
            return Self { step_s, ln_rate: peak.ln_rate, ratio: 0.0, shift: 0.0, split: 1.0 };
        }
        let rate = libm::exp(peak.ln_rate) * step_s;
        if rate >= 0.5 {
            let split = -libm::sqrt(2.0 * rate - 1.0);
            let ln_step = libm::log(step_s);
            return Self {
                step_s,
                ln_rate: -ln_step,
                ratio: 1.0,
                shift: libm::log(0.5) - ln_step - peak.ln_rate,
                split,
            };
        }
        let split = libm::sqrt(1.0 - 2.0 * rate);
        // ah = 1 − split and 1 − ah/2 = (1 + split)/2
        let ln_rate = peak.ln_rate - libm::log(0.5 + 0.5 * split);
        Self { step_s, ln_rate, ratio: 2.0 * rate / ((1.0 + split) * (1.0 + split)), shift: 0.0, split }
    }

    /// ln r from the peak, at `offset` in ln a.
    fn relaxation(&self, offset: f64) -> f64 {
        if self.step_s == 0.0 {
            return offset;
        }
        self.shift + offset + libm::log1p(-self.ratio * libm::expm1(offset))
    }

    /// A width in ln r as a width in ln a: r is flat in a where a mode and its fast partner meet.
    fn width(&self, width: f64) -> f64 {
        if self.step_s == 0.0 || width >= 1.0 { width } else { width / self.split.abs().max(libm::sqrt(width)) }
    }

    /// ln of the largest a that is summed: 2/h, where r is 0 again, but 1/h where a narrow peak would appear again between
    /// them. That mirror image is not what such a peak leaves there. Of the limits tried, 0.1 gave the smallest tail error of
    /// 200 random models.
    fn fastest(&self, peak: &Peak<'_>, fastest: f64) -> f64 {
        const NARROW: f64 = 0.1;
        if self.step_s == 0.0 {
            return fastest;
        }
        let turn = if peak.width < NARROW { 1.0 } else { 2.0 };
        fastest.min(libm::log(turn / self.step_s))
    }

    /// The end of a panel: not beyond the last rate, where there is one.
    fn clip(&self, end: f64, fastest: f64) -> f64 {
        if self.step_s == 0.0 { end } else { end.min(fastest - self.ln_rate) }
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Order {
    Spring,
    Between,
    Dashpot,
}

fn order(element: &Springpot) -> Order {
    if element.alpha < SNAP {
        Order::Spring
    } else if element.alpha > 1.0 - SNAP {
        Order::Dashpot
    } else {
        Order::Between
    }
}

/// A chain's compliance on the cut, `Σ r^−α e^{−iπα} / c`, written from the place where its density peaks.
struct Peak<'a> {
    chain: Chain<'a>,
    /// ln r of the peak, or of the middle of a range without a peak.
    ln_rate: f64,
    /// Its half-width in ln r.
    width: f64,
    /// Real part there: zero at a peak.
    real: f64,
    /// ln of the largest term there, taken out of all others.
    ln_size: f64,
}

impl<'a> Peak<'a> {
    fn from_chain(chain: &Chain<'a>, middle: f64) -> Self {
        let mut peak = Self { chain: *chain, ln_rate: middle, width: f64::INFINITY, real: 0.0, ln_size: 0.0 };
        let found = peak.root();
        peak.ln_rate = found.unwrap_or(middle);
        peak.ln_size = peak.size_at(peak.ln_rate);
        let (mut real, mut imaginary, mut slope) = (0.0, 0.0, 0.0);
        for (size, element) in peak.terms() {
            let in_phase = size * cos_pi(element.alpha);
            real += in_phase;
            imaginary += size * sin_pi(element.alpha);
            slope += element.alpha * in_phase;
        }
        if found.is_some() {
            peak.width = imaginary / slope.abs();
        } else {
            peak.real = real;
        }
        peak
    }

    /// Terms of the compliance at the peak, relative to the largest.
    fn terms(&self) -> impl Iterator<Item = (f64, &Springpot)> {
        self.chain.elements.iter().map(|element| (libm::exp(self.ln_term(element)), element))
    }

    fn ln_term(&self, element: &Springpot) -> f64 {
        -element.alpha * self.ln_rate - libm::log(element.c) - self.ln_size
    }

    fn size_at(&self, ln_rate: f64) -> f64 {
        self.chain.elements.iter().map(|e| -e.alpha * ln_rate - libm::log(e.c)).fold(f64::NEG_INFINITY, f64::max)
    }

    /// ln r at which the real part of the compliance changes sign. There is one at most: ordered by α its terms are
    /// first positive (α < ½), then negative.
    fn root(&self) -> Option<f64> {
        let real = |ln_rate: f64| -> f64 {
            let size = self.size_at(ln_rate);
            self.chain
                .elements
                .iter()
                .map(|e| libm::exp(-e.alpha * ln_rate - libm::log(e.c) - size) * cos_pi(e.alpha))
                .sum()
        };
        let (mut low, mut high) = (-1e4, 1e4);
        if !(real(low) < 0.0 && real(high) > 0.0) {
            return None;
        }
        for _ in 0..70 {
            let middle = 0.5 * (low + high);
            if real(middle) < 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        Some(0.5 * (low + high))
    }

    /// χ at `offset` in ln r from the peak, N/m.
    fn density(&self, offset: f64) -> f64 {
        let (mut real, mut imaginary) = (0.0, 0.0);
        let mut shift = 0.0;
        if offset.abs() < 0.5 {
            // From differences, so that a narrow peak keeps its digits.
            real = self.real;
            for (size, element) in self.terms() {
                let grown = libm::expm1(-element.alpha * offset);
                real += size * cos_pi(element.alpha) * grown;
                imaginary += size * sin_pi(element.alpha) * (1.0 + grown);
            }
        } else {
            shift = self.size_at(self.ln_rate + offset) - self.ln_size;
            for element in self.chain.elements {
                let size = libm::exp(self.ln_term(element) - element.alpha * offset - shift);
                real += size * cos_pi(element.alpha);
                imaginary += size * sin_pi(element.alpha);
            }
        }
        self.chain.scale / PI * imaginary / (real * real + imaginary * imaginary) * libm::exp(-self.ln_size - shift)
    }
}

/// Positive nodes and weights of the eight-point Gauss–Legendre rule on −1…1.
#[allow(clippy::unreadable_literal, clippy::excessive_precision)] // as tabulated
const GAUSS_LEGENDRE: [(f64, f64); 4] = [
    (0.1834346424956498, 0.3626837833783620),
    (0.5255324099163290, 0.3137066458778873),
    (0.7966664774136267, 0.2223810344533745),
    (0.9602898564975363, 0.1012285362903763),
];
