//! The reference that the memories are held against, by FFT, against the sums that define it.

use crate::support::defining_sum::{displacement_by_the_sum, modulus_series};
use crate::support::full_memory::FullMemory;
use crate::support::models::{hard_models, paper_force, presets, random_models};
use crate::support::relative_rms;

#[test]
fn fft_agrees_with_the_defining_sum() {
    let rate_hz = 20.0;
    let force = paper_force(1.0 / 7.0, 155.0, rate_hz);
    let full = FullMemory::new(force.len(), 1.0 / rate_hz);
    for (name, model) in presets().into_iter().chain(random_models(11, 10)).chain(hard_models()) {
        let exact = displacement_by_the_sum(&modulus_series(&model, 1.0 / rate_hz, force.len()), &force);
        let error = relative_rms(&full.displacement(&model, &force), &exact);
        // The reciprocal series of weak branches lose digits themselves, hence not 1e-12.
        assert!(error < 2e-11, "{name}: {error:.1e}");
        let error = relative_rms(&full.force(&model, &exact), &force);
        assert!(error < 1e-9, "{name}, back to force: {error:.1e}");
    }
}
