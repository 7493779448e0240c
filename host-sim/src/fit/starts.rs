//! Where searches begin.

use rand::RngExt;
use rand_pcg::Pcg64;
use springpot::{Actuator, Springpot, Topology};

use super::candidate::Candidate;

/// What a recording tells about its film before anything is fitted.
#[derive(Clone, Copy, Debug)]
pub struct Scales {
    /// Peak-to-peak force over peak-to-peak displacement, N/m.
    pub stiffness: f64,
    /// Shortest and longest time that the recordings resolve, s.
    pub times_s: (f64, f64),
    /// A coupling that matters, 1/m.
    pub coupling: f64,
}

/// The `index`-th start of a search for `branches` branches; the same seed gives the same starts.
///
/// The main springpot takes about the film's stiffness. Every branch pairs a nearly elastic with a nearly viscous
/// springpot whose crossing lies among the times that the recordings resolve.
pub fn start(
    actuator: Actuator,
    topology: Topology,
    branches: usize,
    scales: Scales,
    seed: u64,
    index: usize,
) -> Candidate {
    let mut random = Pcg64::new(u128::from(seed), (index as u128) << 8 | branches as u128);
    let (short, long) = scales.times_s;
    let mut elements = vec![Springpot::new(
        scales.stiffness * 10f64.powf(random.random_range(-0.3..0.2)),
        random.random_range(0.02..0.4),
    )];
    for branch in 0..branches {
        let spread = (branch as f64 + random.random_range(0.0..1.0)) / branches as f64;
        let time = short * (long / short).powf(spread);
        let stiffness = scales.stiffness * 10f64.powf(random.random_range(-1.5..0.3));
        let (elastic, viscous) = (random.random_range(0.0..0.35), random.random_range(0.65..1.0));
        // c_1 s^a = c_2 s^b at s = 1/time.
        elements.push(Springpot::new(stiffness * time.powf(elastic), elastic));
        elements.push(Springpot::new(stiffness * time.powf(viscous), viscous));
    }
    Candidate { actuator, elements, topology, offset_m: 0.0 }
}
