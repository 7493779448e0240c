//! The first values of the discrete relaxation modulus, by power series.
//!
//! In the Grünwald–Letnikov discretisation (Eq. 2 of Karner et al. 2022) s becomes (1 − ζ)/h, with ζ the delay of one step h, so that every springpot
//! is a binomial series in ζ. With [`Discretisation::Bdf2`] it is a power of a quadratic, whose series has a recurrence of two terms. Sums, products and
//! reciprocals of such series give K(ζ), and its running sum
//! g(ζ) = K(ζ)/(1 − ζ) is the relaxation modulus: the force that is left j steps after a unit step of displacement.

use crate::kernel::Discretisation;
use crate::model::Maxwell;
use crate::model::Springpot;

/// Terms that are computed.
pub(crate) const TERMS: usize = 64;

type Series = [f64; TERMS];

/// g_0 … g_63 in N/m at step `h` (s).
pub(crate) fn relaxation_modulus(model: &Maxwell, h: f64, method: Discretisation) -> Series {
    let mut total = [0.0; TERMS];
    for chain in model.chains() {
        let mut compliance = [0.0; TERMS];
        for &element in chain.elements {
            match method {
                Discretisation::Gl => add_compliance(&mut compliance, element, h),
                Discretisation::Bdf2 => add_compliance_of_second_order(&mut compliance, element, h),
            }
        }
        let modulus = reciprocal(&compliance);
        for (sum, k) in total.iter_mut().zip(modulus) {
            *sum += chain.scale * k;
        }
    }
    let mut running = 0.0;
    for g in &mut total {
        running += *g;
        *g = running;
    }
    total
}

/// Adds the series of `1/(c ((1 − ζ)/h)^α)`: `h^α/c` times the binomial series of order −α.
fn add_compliance(sum: &mut Series, element: Springpot, h: f64) {
    let mut term = libm::exp(element.alpha * libm::log(h)) / element.c;
    let mut j = 0.0;
    for value in sum {
        *value += term;
        j += 1.0;
        term *= (j - 1.0 + element.alpha) / j;
    }
}

/// Adds the series of `1/(c (δ/h)^α)` with δ = (3 − 4ζ + ζ²)/2.
///
/// p = δ^−α obeys `δ p' = −α δ' p`, which compared term by term is the recurrence
/// `3 j p_j = 4 (j − 1 + α) p_{j−1} − (j − 2 + 2α) p_{j−2}`.
fn add_compliance_of_second_order(sum: &mut Series, element: Springpot, h: f64) {
    let alpha = element.alpha;
    let (mut term, mut before) = (libm::exp(alpha * libm::log(h / 1.5)) / element.c, 0.0);
    let mut j = 0.0;
    for value in sum {
        *value += term;
        j += 1.0;
        let next = (4.0 * (j - 1.0 + alpha) * term - (j - 2.0 + 2.0 * alpha) * before) / (3.0 * j);
        (before, term) = (term, next);
    }
}

fn reciprocal(series: &Series) -> Series {
    let mut out = [0.0; TERMS];
    out[0] = 1.0 / series[0];
    for k in 1..TERMS {
        let convolution: f64 = series[1..=k].iter().zip(out[..k].iter().rev()).map(|(a, b)| a * b).sum();
        out[k] = -convolution / series[0];
    }
    out
}
