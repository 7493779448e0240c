//! The Grünwald–Letnikov answer as Eq. 2 defines it: sums over all that was. Shared with the workspace's own tests.

use springpot::{Maxwell, Springpot, Topology};

/// K(ζ) with inertia by power series, in the plainest way: every springpot is a binomial series, chains are divided out
/// term by term. N/m.
pub fn modulus_series(model: &Maxwell, step: f64, terms: usize) -> Vec<f64> {
    let binomial = |order: f64| -> Vec<f64> {
        let mut weight = 1.0;
        (1..=terms)
            .map(|j| {
                let this = weight;
                weight *= (j as f64 - 1.0 - order) / j as f64;
                this
            })
            .collect()
    };
    let scaled = |factor: f64, order: f64| -> Vec<f64> { binomial(order).iter().map(|w| factor * w).collect() };
    let add = |sum: &mut [f64], terms: Vec<f64>| sum.iter_mut().zip(terms).for_each(|(s, t)| *s += t);
    let reciprocal = |series: &[f64]| -> Vec<f64> {
        let mut out = vec![1.0 / series[0]];
        for k in 1..terms {
            let convolution: f64 = (1..=k).map(|i| series[i] * out[k - i]).sum();
            out.push(-convolution / series[0]);
        }
        out
    };

    let mut modulus = scaled(model.main().c * step.powf(-model.main().alpha), model.main().alpha);
    let compliance_of = |pairs: &[[Springpot; 2]]| {
        let mut compliance = vec![0.0; terms];
        for element in pairs.as_flattened() {
            add(&mut compliance, scaled(step.powf(element.alpha) / element.c, -element.alpha));
        }
        compliance
    };
    if !model.branches().is_empty() {
        match model.topology() {
            Topology::Eq11 => {
                let harmonic = reciprocal(&compliance_of(model.branches()));
                let n = model.branches().len() as f64;
                add(&mut modulus, harmonic.iter().map(|k| n * k).collect());
            }
            Topology::Parallel => {
                for pair in model.branches() {
                    add(&mut modulus, reciprocal(&compliance_of(std::slice::from_ref(pair))));
                }
            }
        }
    }
    // Inertia: m ((1 − ζ)/h)².
    for (j, factor) in [1.0, -2.0, 1.0].into_iter().enumerate() {
        modulus[j] += model.mass_kg() * factor / (step * step);
    }
    modulus
}

/// x (m) from F = Σ κ_j x_{k−j} (N): N² operations.
pub fn displacement_by_the_sum(modulus: &[f64], force: &[f64]) -> Vec<f64> {
    let mut x: Vec<f64> = Vec::new();
    for (k, f) in force.iter().enumerate() {
        let past: f64 = (1..=k).map(|j| modulus[j] * x[k - j]).sum();
        x.push((f - past) / modulus[0]);
    }
    x
}
