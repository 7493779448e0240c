//! Models to try, and the paper's drive. Shared with the workspace's own tests.

use rand::{Rng, RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::{Actuator, Maxwell, Preset, Springpot, Topology};

/// Both ways to connect branches.
pub const TOPOLOGIES: [Topology; 2] = [Topology::Eq11, Topology::Parallel];

/// The published models in both topologies, with a name for each.
pub fn presets() -> Vec<(String, Maxwell)> {
    Preset::ALL
        .into_iter()
        .flat_map(|preset| {
            TOPOLOGIES.map(|topology| {
                let model = preset.model().expect("presets are valid").with_topology(topology);
                (format!("{} {topology:?}", preset.name()), model)
            })
        })
        .collect()
}

/// A random model: 0…5 branches, every c from 1e2 to 1e6 on a logarithmic scale, every α from 0 to 1, the paper's mass.
fn random_model(random: &mut impl Rng) -> Maxwell {
    let mut element = || Springpot::new(10f64.powf(random.random_range(2.0..6.0)), random.random_range(0.0..1.0));
    let main = element();
    let all: [[Springpot; 2]; 5] = std::array::from_fn(|_| [element(), element()]);
    let branches = random.random_range(0..=5);
    let topology = TOPOLOGIES[random.random_range(0..2)];
    Maxwell::new(main, &all[..branches], topology, Actuator::KARNER_2022.mass_kg).expect("within the ranges of a model")
}

/// `count` random models from `seed`.
pub fn random_models(seed: u64, count: usize) -> Vec<(String, Maxwell)> {
    let mut random = Pcg64::seed_from_u64(seed);
    (0..count)
        .map(|k| {
            let model = random_model(&mut random);
            (format!("random {k}, n = {} {:?}", model.branches().len(), model.topology()), model)
        })
        .collect()
}

/// Models that are hard to compress: nearly elastic beside nearly viscous springpots, whose spectra are narrow lines,
/// and orders at and next to 0 and 1.
pub fn hard_models() -> Vec<(String, Maxwell)> {
    let sp = Springpot::new;
    let mass = Actuator::KARNER_2022.mass_kg;
    let line = |order: f64| {
        let branches = [
            [sp(1e6, order), sp(1e5, 1.0 - order)],
            [sp(1e6, 10.0 * order), sp(3e4, 1.0 - 3.0 * order)],
            [sp(1e5, order), sp(1e6, 1.0)],
        ];
        Maxwell::new(sp(100.0, 0.5), &branches, Topology::Parallel, mass)
    };
    let all = [
        ("lines of width 3e-2", line(1e-2)),
        ("lines of width 3e-4", line(1e-4)),
        ("lines of width 3e-8", line(1e-8)),
        ("lines of width 3e-10", line(1e-10)),
        (
            "harmonic mean with a line",
            Maxwell::new(
                sp(1e3, 0.3),
                &[[sp(1e5, 1e-3), sp(2e5, 0.999)], [sp(3e5, 0.002), sp(4e5, 1.0)]],
                Topology::Eq11,
                mass,
            ),
        ),
        ("spring", Maxwell::new(sp(6e4, 0.0), &[], Topology::Eq11, mass)),
        ("almost a spring", Maxwell::new(sp(6e4, 1e-6), &[], Topology::Eq11, mass)),
        ("dashpot", Maxwell::new(sp(6e4, 1.0), &[], Topology::Eq11, mass)),
        ("almost a dashpot", Maxwell::new(sp(6e4, 1.0 - 1e-6), &[], Topology::Eq11, mass)),
        (
            "springs and dashpots",
            Maxwell::new(
                sp(6e4, 0.0),
                &[[sp(1e4, 0.0), sp(1e4, 1.0)], [sp(1e5, 0.0), sp(1e6, 1.0)]],
                Topology::Parallel,
                mass,
            ),
        ),
        ("soft and heavy", Maxwell::new(sp(100.0, 0.02), &[], Topology::Eq11, mass)),
    ];
    all.map(|(name, model)| (name.to_owned(), model.expect("valid"))).into()
}

/// The paper's drive: Eq. 1's force of `V = 3 kV (1 − cos 2πft)`, sampled for `seconds` at `rate_hz`, without weight.
pub fn paper_force(frequency_hz: f64, seconds: f64, rate_hz: f64) -> Vec<f64> {
    let samples = (seconds * rate_hz).round() as usize + 1;
    (0..samples)
        .map(|k| {
            let phase = std::f64::consts::TAU * frequency_hz * k as f64 / rate_hz;
            let voltage = 3000.0 * (1.0 - phase.cos());
            Actuator::KARNER_2022.force_per_square_volt() * voltage * voltage
        })
        .collect()
}
