//! The full-memory answer by FFT against the defining sum, and the coupled one against the recursion.

use host_sim::agreement::relative_rms;
use host_sim::files::parameters::Parameters;
use host_sim::files::recording::Input;
use host_sim::grid::{Grid, Samples};
use host_sim::replay::full_memory::FullMemory;
use host_sim::replay::memory::{MemoryChoice, Precision, RunOptions};
use host_sim::replay::simulate;
use indicatif::ProgressBar;
use springpot::Maxwell;
use tests::{hard_models, paper_force, presets, random_models};

/// K(ζ) by power series, in the plainest way: every springpot is a binomial series, chains are divided out term by term.
fn modulus_series(model: &Maxwell, step: f64, terms: usize) -> Vec<f64> {
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
    let compliance_of = |pairs: &[[springpot::Springpot; 2]]| {
        let mut compliance = vec![0.0; terms];
        for element in pairs.as_flattened() {
            add(&mut compliance, scaled(step.powf(element.alpha) / element.c, -element.alpha));
        }
        compliance
    };
    if !model.branches().is_empty() {
        match model.topology() {
            springpot::Topology::Eq11 => {
                let harmonic = reciprocal(&compliance_of(model.branches()));
                let n = model.branches().len() as f64;
                add(&mut modulus, harmonic.iter().map(|k| n * k).collect());
            }
            springpot::Topology::Parallel => {
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

/// x from F = Σ κ_j x_{k−j}, and F from x: N² operations each.
fn by_the_sum(modulus: &[f64], force: &[f64]) -> Vec<f64> {
    let mut x: Vec<f64> = Vec::new();
    for (k, f) in force.iter().enumerate() {
        let past: f64 = (1..=k).map(|j| modulus[j] * x[k - j]).sum();
        x.push((f - past) / modulus[0]);
    }
    x
}

#[test]
fn fft_agrees_with_the_defining_sum() {
    let rate_hz = 20.0;
    let force = paper_force(1.0 / 7.0, 155.0, rate_hz);
    let full = FullMemory::new(force.len(), 1.0 / rate_hz);
    let fast = FullMemory::with_oversampling(force.len(), 1.0 / rate_hz, 2);
    for (name, model) in presets().into_iter().chain(random_models(11, 30)).chain(hard_models()) {
        let modulus = modulus_series(&model, 1.0 / rate_hz, force.len());
        let exact = by_the_sum(&modulus, &force);
        let error = relative_rms(&full.displacement(&model, &force), &exact);
        // The reciprocal series of weak branches lose digits themselves, hence not 1e-12.
        assert!(error < 2e-11, "{name}: {error:.1e}");
        let error = relative_rms(&fast.displacement(&model, &force), &exact);
        assert!(error < 1e-9, "{name}, two points a sample: {error:.1e}");
        let back = full.force(&model, &exact);
        let error = relative_rms(&back, &force);
        assert!(error < 1e-9, "{name}, back to force: {error:.1e}");
    }
}

#[test]
fn coupled_full_memory_agrees_with_the_recursion() {
    let mut parameters = Parameters::preset("table3-n2").expect("a preset");
    parameters.actuator.stretch_coupling = 60.0;
    let grid = Grid { rate_hz: 1000.0, samples: 30_001 };
    let voltage = (0..grid.samples).map(|k| 3000.0 * (1.0 - (0.9 * grid.time_s(k)).cos())).collect();
    let input = Input::Voltage(Samples { time_s: (0..grid.samples).map(|k| grid.time_s(k)).collect(), value: voltage });
    let respond = |memory| {
        let options = RunOptions { memory, precision: Precision::F64, ..RunOptions::default() };
        simulate::response(&parameters, &input, grid, &options, &ProgressBar::hidden()).expect("valid")
    };
    let (full, compressed) = (respond(MemoryChoice::Full), respond(MemoryChoice::Compressed));
    let error = relative_rms(&compressed.displacement_m, &full.displacement_m);
    assert!(error < 1e-7, "{error:.1e}");
    assert!(relative_rms(&compressed.force_n, &full.force_n) < 1e-7);
    // The coupling must have mattered.
    let peak = full.displacement_m.iter().copied().fold(0.0, f64::max);
    assert!(peak * parameters.actuator.stretch_coupling > 0.05);
}
