//! Reduced models, against the response of the whole model.

use crate::models::{paper_force, presets, random_models};
use host_models::agreement::relative_rms;
use host_models::reduce::{self, Criterion};
use host_models::replay::full_memory::FullMemory;
use springpot::{Maxwell, Springpot, Topology};

/// Reduced models answer as before, to 1e-9: the published ones, random ones, and ones with springs and dashpots to merge.
#[test]
fn reduced_models_answer_as_before() {
    let sp = Springpot::new;
    let mergeable = [
        vec![[sp(1e4, 1.0), sp(2e4, 1.0)], [sp(3e4, 0.0), sp(1e5, 0.0)], [sp(1e4, 0.0), sp(2e4, 1.0)]],
        vec![[sp(1e4, 0.3), sp(1e18, 0.0)], [sp(1e-9, 0.2), sp(1e3, 1.0)], [sp(1e4, 0.3), sp(2e4, 0.3)]],
        vec![[sp(1e4, 0.2), sp(3e4, 0.2)]],
    ];
    let mut models: Vec<(String, Maxwell)> = presets().into_iter().chain(random_models(8, 40)).collect();
    for (k, branches) in mergeable.iter().enumerate() {
        for topology in [Topology::Eq11, Topology::Parallel] {
            let model = Maxwell::new(sp(5e4, 0.2), branches, topology, 0.316).expect("valid");
            models.push((format!("mergeable {k} {topology:?}"), model));
        }
    }
    let force = paper_force(1.0 / 7.0, 60.0, 100.0);
    let full = FullMemory::new(force.len(), 0.01);
    let mut fewer = 0;
    for (name, model) in models {
        let reduction = reduce::reduced(&model, Criterion::default()).expect("valid");
        assert!(reduction.change <= 1e-9, "{name}: the modulus changes by {:.1e}", reduction.change);
        let error = relative_rms(&full.displacement(&reduction.model, &force), &full.displacement(&model, &force));
        assert!(error <= 1e-9, "{name}: the response changes by {error:.1e}");
        let (before, after) = (model.branches().len(), reduction.model.branches().len());
        assert!(after <= before);
        fewer += usize::from(after < before);
        if name == "mergeable 2 Parallel" {
            assert_eq!((after, reduction.model.main().alpha), (0, 0.2), "joins the main springpot");
        }
    }
    assert!(fewer >= 8, "{fewer} models became smaller");
}
