//! Orders near those of springs and dashpots.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::{Actuator, Springpot, Topology};

use crate::fitting::{structure, synthetic};
use crate::recorded::fitted;
use crate::sweep::sample;
use host_models::fit::candidate::Candidate;

/// A film of springs and dashpots, whose slowest relaxation the recordings of 155 s do not show to its end.
fn film(random: &mut Pcg64) -> Candidate {
    let mut branch = |c: [f64; 2], time_s: f64| {
        let c = random.random_range(c[0]..c[1]);
        [Springpot::new(c, 0.0), Springpot::new(c * time_s, 1.0)]
    };
    let branches = [branch([1e4, 2e4], 0.9), branch([8e3, 15e3], 11.0), branch([6e3, 12e3], 500.0)];
    let elements = [&[Springpot::new(4e4, 0.0)], branches.as_flattened()].concat();
    Candidate::linear(Actuator { stretch_coupling: 20.0, ..Actuator::KARNER_2022 }, elements, Topology::Parallel)
}

/// Orders of branches are 0 or 1, unless the recordings show another one; its interval reaches the stated value.
#[test]
fn orders_that_recordings_do_not_show_are_plain() {
    let (mut plain, mut all) = (0, 0);
    for seed in sample((0..6).collect(), 2) {
        let fit = fitted(&synthetic(&film(&mut Pcg64::seed_from_u64(seed)), 5e-6), &structure(Topology::Parallel, 3));
        let estimates = fit.uncertainty.expect("intervals").estimates;
        for order in estimates.iter().filter(|e| e.name.starts_with("branches") && e.name.ends_with("alpha")) {
            let distance = order.value.min(1.0 - order.value);
            let [low, high] = [order.low.unwrap_or(0.0), order.high.unwrap_or(1.0)];
            (plain, all) = (plain + usize::from(distance == 0.0), all + 1);
            assert!(low <= order.value && order.value <= high, "{seed}: {order:?}");
            let is_shown = low > 0.0 && high < 1.0;
            assert!(distance == 0.0 || distance > 0.15 || is_shown, "{seed}: {order:?}");
        }
        println!("{seed}: {:?}", fit.candidate.elements);
    }
    println!("{plain} of {all} orders are those of springs and dashpots");
    assert!(10 * plain >= 8 * all, "{plain} of {all}");
}
