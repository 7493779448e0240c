//! The full-memory answer by FFT against the defining sum, and the coupled one against the recursion.

use crate::defining_sum::{displacement_by_the_sum, modulus_series};
use crate::models::{hard_models, paper_force, presets, random_models};
use host_io::files::parameters::Parameters;
use host_io::files::recording::Input;
use host_io::grid::{Grid, Samples};
use host_models::agreement::relative_rms;
use host_models::replay::full_memory::FullMemory;
use host_models::replay::memory::{MemoryChoice, Precision, RunOptions};
use host_models::replay::simulate;
use indicatif::ProgressBar;
use springpot::Discretisation;

#[test]
fn fft_agrees_with_the_defining_sum() {
    let rate_hz = 20.0;
    let force = paper_force(1.0 / 7.0, 155.0, rate_hz);
    let full = FullMemory::new(force.len(), 1.0 / rate_hz);
    let fast = FullMemory::with_oversampling(force.len(), 1.0 / rate_hz, 2, Discretisation::Gl);
    for (name, model) in presets().into_iter().chain(random_models(11, 30)).chain(hard_models()) {
        let modulus = modulus_series(&model, 1.0 / rate_hz, force.len());
        let exact = displacement_by_the_sum(&modulus, &force);
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
