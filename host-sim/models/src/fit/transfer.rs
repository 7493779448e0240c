//! The model in the frequency domain with its derivatives, and the solution of its coupled motion.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use num_complex::Complex;
use rayon::prelude::*;
use springpot::{Chain, Compressed, Law, LawOptions, Load, Maxwell, Spring, Springpot};

use super::candidate::Curves;
use crate::replay::coupling::PullIn;
use crate::replay::full_memory::FullMemory;
use crate::replay::nonlinear::{BentFilm, bent_displacement, stepped};

/// Memory of the recursion that approximates coupled motion.
pub(super) type Recursion = Compressed<f64, HEAD, FAST, 0>;
/// Memory of a law that steps alone: with more exact increments than a controller's, since some branches fade within several steps of coarse rows.
pub(super) type Stepped = Compressed<f64, 24, 12, 24>;
/// Newest increments of the recursion, and its modes.
pub(super) const HEAD: usize = 8;
pub(super) const FAST: usize = 16;

/// Values at the points of a circle.
pub(super) type Spectrum = Vec<Complex<f64>>;

/// Largest error of coupled motion in a fit, relative to the displacement: far below the residuals of any recording.
const TOLERANCE: f64 = 1e-8;

/// Tolerance of a law whose error is corrected with full memory, and of one that is not.
const CORRECTED: f64 = f64::MAX;
const STEPPED: f64 = 1e-4;

/// Corrections of coupled motion before it is given up.
const MAX_CORRECTIONS: usize = 12;

/// The dynamic stiffness of a model on a circle, with its derivatives.
pub(super) struct Transfer {
    /// 1/(m s² + K), m/N.
    pub(super) compliance: Spectrum,
    /// m s² + K, N/m.
    pub(super) stiffness: Spectrum,
    /// ∂K/∂ ln c of every element at the nodes, N/m, and once it is asked for on the circle.
    sensitivities: Vec<(Spectrum, OnceLock<Spectrum>)>,
    /// m s² and K, N/m: kept for films with curves.
    pub(super) inertia: Spectrum,
    pub(super) kernel: Spectrum,
    /// Steps a film with a spring in series.
    pub(super) in_series: Option<Law<f64, Stepped>>,
    /// Approximates coupled motion, and motion behind the curve; none where neither is.
    pub(super) law: Option<Law<f64, Recursion>>,
}

impl Transfer {
    /// The transfer of `model` on `circle` with these `nodes`, whose steps are `step_s`; none where it overflows or the law is
    /// refused.
    pub(super) fn new(
        model: &Maxwell,
        (circle, nodes): (&FullMemory, &Nodes),
        step_s: f64,
        coupled: bool,
        curves: Option<&Curves>,
        series: Option<&Spring>,
    ) -> Option<Self> {
        let is_bent = curves.is_some() || series.is_some();
        let law = if coupled || is_bent { Some(recursion_of(model, circle, step_s, CORRECTED)?) } else { None };
        let in_series = match series {
            Some(spring) => Some(recursion_of(model, circle, step_s, STEPPED)?.in_series(spring).ok()?),
            None => None,
        };
        let law = match (law, curves) {
            (Some(law), Some(Curves { curve, spring: None })) => Some(law.behind(curve).ok()?),
            (Some(law), Some(Curves { curve, spring: Some(spring) })) => Some(law.beside(spring, curve).ok()?),
            (law, _) => law,
        };
        let (stiffness, sensitivities) = at_nodes(model, nodes);
        let stiffness = nodes.spread(stiffness);
        let compliance: Spectrum = stiffness.iter().map(Complex::inv).collect();
        let finite = compliance.iter().all(|h| h.re.is_finite() && h.im.is_finite());
        let (mut inertia, mut kernel) = (Spectrum::new(), Spectrum::new());
        if is_bent {
            inertia = circle.ln_s().iter().map(|z| (2.0 * z).exp() * model.mass_kg()).collect();
            kernel = stiffness.iter().zip(&inertia).map(|(stiffness, inertia)| stiffness - inertia).collect();
        }
        let sensitivities = sensitivities.into_iter().map(|at_nodes| (at_nodes, OnceLock::new())).collect();
        finite.then_some(Self { compliance, stiffness, inertia, kernel, in_series, sensitivities, law })
    }

    /// ∂K/∂ ln c of `element` on the circle, N/m.
    pub(super) fn sensitivity(&self, element: usize, nodes: &Nodes) -> &Spectrum {
        let (at_nodes, on_circle) = &self.sensitivities[element];
        on_circle.get_or_init(|| nodes.spread(at_nodes.clone()))
    }

    /// The displacement under `loads`, with full memory where there is coupling.
    ///
    /// The recursion solves `K x = F + S x` for the displacement x, up to the error of its tail. What it leaves of the force,
    /// `F + S x − K x` with full memory, is solved by the recursion again: every correction multiplies the error by the tail's.
    pub(super) fn coupled(
        &self,
        circle: &FullMemory,
        law: &Law<f64, Recursion>,
        loads: &[Load<f64>],
    ) -> Result<Vec<f64>, PullIn> {
        if pulls_in(loads, law.stiffness()) {
            return Err(PullIn);
        }
        let mut displacement = stepped(law, loads);
        let mut before = 1.0;
        for _ in 0..MAX_CORRECTIONS {
            let spectrum =
                circle.spectrum(&displacement).into_iter().zip(&self.stiffness).map(|(x, k)| x * k).collect();
            let resisted = circle.series(spectrum, displacement.len());
            let left: Vec<Load<f64>> = loads
                .iter()
                .zip(&displacement)
                .zip(resisted)
                .map(|((load, x), force)| Load {
                    force_n: load.force_n + load.slope_n_per_m * x - force,
                    slope_n_per_m: load.slope_n_per_m,
                })
                .collect();
            let (mut change, mut size) = (0.0, 0.0);
            for (x, correction) in displacement.iter_mut().zip(stepped(law, &left)) {
                *x += correction;
                change += correction * correction;
                size += *x * *x;
            }
            let share = (change / size).sqrt();
            if size == 0.0 || share * (share / before) <= TOLERANCE {
                return Ok(displacement);
            }
            if share.is_nan() || share >= before {
                return Err(PullIn);
            }
            before = share;
        }
        Err(PullIn)
    }

    /// The displacement under `loads` of a film with `curves`, with full memory.
    pub(super) fn bent(
        &self,
        circle: &FullMemory,
        law: &Law<f64, Recursion>,
        curves: &Curves,
        loads: &[Load<f64>],
    ) -> Result<Vec<f64>, PullIn> {
        if pulls_in(loads, law.min_stiffness()) {
            return Err(PullIn);
        }
        bent_displacement(circle, &self.film(curves), law, loads, TOLERANCE)
    }

    pub(super) fn film<'a>(&'a self, curves: &'a Curves) -> BentFilm<'a> {
        let Curves { curve, spring } = curves;
        BentFilm { kernel: &self.kernel, inertia: &self.inertia, curve, spring: spring.as_ref() }
    }
}

/// m s² + K, and ∂K/∂ ln c of every element, at the nodes.
///
/// K is the sum over [`Maxwell::chains`]. With J_i = 1/(c_i s^α_i), a chain of factor n has K = n / Σ J, and its
/// derivative is ∂K/∂ ln c_i = n J_i / (Σ J)².
fn at_nodes(model: &Maxwell, nodes: &Nodes) -> (Spectrum, Vec<Spectrum>) {
    let mut stiffness: Spectrum = nodes.ln_s.iter().map(|z| (2.0 * z).exp() * model.mass_kg()).collect();
    let sign = |chain: &Chain<'_>| if chain.elements.len() == 1 { 1.0 } else { -1.0 };
    let signed: Vec<(&Springpot, f64)> =
        model.chains().flat_map(|chain| chain.elements.iter().map(move |element| (element, sign(&chain)))).collect();
    let mut powers = signed.par_iter().map(|&(e, sign)| nodes.power(e, sign)).collect::<Vec<Spectrum>>().into_iter();
    let mut sensitivities = Vec::new();
    for chain in model.chains() {
        let mut powers: Vec<Spectrum> = powers.by_ref().take(chain.elements.len()).collect();
        if let [modulus] = &mut powers[..] {
            for (sum, k) in stiffness.iter_mut().zip(modulus) {
                *k *= chain.scale;
                *sum += *k;
            }
        } else {
            for (j, sum) in stiffness.iter_mut().enumerate() {
                let inverse = powers.iter().map(|compliance| compliance[j]).sum::<Complex<f64>>().inv();
                *sum += inverse * chain.scale;
                let factor = inverse * inverse * chain.scale;
                powers.iter_mut().for_each(|compliance| compliance[j] *= factor);
            }
        }
        sensitivities.extend(powers);
    }
    (stiffness, sensitivities)
}

/// The law that approximates coupled motion along `circle`, whose memory may miss this `tolerance`.
fn recursion_of<const HEAD: usize, const FAST: usize, const SLOW: usize>(
    model: &Maxwell,
    circle: &FullMemory,
    step_s: f64,
    tolerance: f64,
) -> Option<Law<f64, Compressed<f64, HEAD, FAST, SLOW>>> {
    let horizon_s = (circle.samples() as f64 * step_s).max(100.0 * step_s);
    let options = LawOptions::at_step(step_s).with_horizon(horizon_s).with_tolerance(tolerance);
    let options = options.with_method(circle.method());
    Law::compressed(model, options).ok()
}

/// Whether a step of a law of this `stiffness` (N/m) may have no equilibrium under `loads`.
pub(super) fn pulls_in(loads: &[Load<f64>], stiffness: f64) -> bool {
    stiffness <= 0.0 || loads.iter().any(|load| load.slope_n_per_m >= 0.99 * stiffness)
}

/// Points from ζ = radius on that are evaluated themselves: there the circle's radius shows.
const DENSE: usize = 256;

/// Nodes per unit of the logarithm. The error of cubic interpolation, 3/128 of the fourth power of a node's distance times the
/// fourth derivative, stays below 2e-9 of the dynamic stiffness.
const PER_UNIT: f64 = 256.0;

/// Where on a circle a model is evaluated: at all points of a small circle, at some of a large one.
///
/// The dynamic stiffness is a smooth function of the logarithm of the frequency. On a circle of hundreds of thousands of points
/// most of them can be interpolated between nodes that are even in that logarithm.
#[derive(Default)]
pub(super) struct Nodes {
    ln_s: Vec<Complex<f64>>,
    /// For every point behind the dense ones: the node before it, and the share of the distance to the next.
    places: Vec<(u32, f64)>,
    /// Powers of s at the nodes, the last used at the end: a search along one variable changes one of them, and most dashpots stay dashpots.
    powers: Mutex<Vec<Power>>,
}

/// s to a power at the nodes: size, cosine and sine of the angle.
struct Power {
    exponent: f64,
    at_nodes: Arc<[[f64; 3]]>,
}

/// Powers that are kept: those of a model of five branches, and as many that were tried.
const MAX_POWERS: usize = 22;

impl Nodes {
    pub(super) fn new(circle: &FullMemory) -> Self {
        let points = circle.ln_s().len();
        let reach = (points.max(DENSE) as f64 / DENSE as f64).ln() * PER_UNIT;
        if 2.0 * reach + DENSE as f64 > points as f64 {
            return Self { ln_s: circle.ln_s().to_vec(), ..Self::default() };
        }
        // One node before the first interpolated point, and two behind the last.
        let node = |k: usize| circle.ln_s_between(DENSE as f64 * ((k as f64 - 1.0) / PER_UNIT).exp());
        let ln_s = circle.ln_s()[..DENSE].iter().copied().chain((0..reach as usize + 4).map(node)).collect();
        let place = |point: usize| {
            let distance = (point as f64 / DENSE as f64).ln() * PER_UNIT;
            (distance as u32, distance.fract())
        };
        Self { ln_s, places: (DENSE..points).map(place).collect(), ..Self::default() }
    }

    /// (c s^α)^`sign` of `element`.
    fn power(&self, element: &Springpot, sign: f64) -> Spectrum {
        let factor = if sign < 0.0 { element.c.recip() } else { element.c };
        let times = |&[size, cos, sin]: &[f64; 3]| Complex::new(factor * size * cos, factor * size * sin);
        self.polar(sign * element.alpha).iter().map(times).collect()
    }

    /// s^`exponent`.
    fn polar(&self, exponent: f64) -> Arc<[[f64; 3]]> {
        let kept = || self.powers.lock().unwrap_or_else(PoisonError::into_inner);
        let mut powers = kept();
        if let Some(place) = powers.iter().position(|power| power.exponent == exponent) {
            powers[place..].rotate_left(1);
            return powers[powers.len() - 1].at_nodes.clone();
        }
        drop(powers);
        let polar = |z: &Complex<f64>| {
            let (sin, cos) = (exponent * z.im).sin_cos();
            [(exponent * z.re).exp(), cos, sin]
        };
        let at_nodes: Arc<[[f64; 3]]> = self.ln_s.iter().map(polar).collect();
        let mut powers = kept();
        if powers.len() == MAX_POWERS {
            powers.remove(0);
        }
        powers.push(Power { exponent, at_nodes: at_nodes.clone() });
        at_nodes
    }

    /// The values at all points from those at the nodes.
    pub(super) fn spread(&self, values: Vec<Complex<f64>>) -> Vec<Complex<f64>> {
        if self.places.is_empty() {
            return values;
        }
        let (dense, nodes) = values.split_at(DENSE);
        let mut all = Vec::with_capacity(DENSE + self.places.len());
        all.extend_from_slice(dense);
        all.extend(self.places.iter().map(|&(node, u)| {
            // Lagrange's cubic through the nodes at −1, 0, 1 and 2.
            let (below, above) = (u + 1.0, u - 1.0);
            let further = u - 2.0;
            let four = &nodes[node as usize..][..4];
            four[0] * (-u * above * further / 6.0)
                + four[1] * (below * above * further / 2.0)
                + four[2] * (-below * u * further / 2.0)
                + four[3] * (below * u * above / 6.0)
        }));
        all
    }
}
