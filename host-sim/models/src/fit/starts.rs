//! Start values of searches.

use rand::RngExt;
use rand_pcg::Pcg64;
use springpot::{Actuator, Springpot, Topology};

use super::candidate::{Bend, Candidate};
use super::observation::Observation;
use super::statistics::{change, median, range};
use crate::files::recording::Input;

/// Orders of magnitude of the film's parameters, estimated from recordings before the fit.
#[derive(Clone, Copy, Debug)]
pub struct Scales {
    /// Peak-to-peak force over peak-to-peak displacement, N/m.
    pub stiffness: f64,
    /// Shortest and longest time that the recordings resolve, s.
    pub times_s: (f64, f64),
    /// Coupling at which the force changes by 15 % over the stroke, 1/m.
    pub coupling: f64,
}

impl Scales {
    /// The scales of `observations`; `force_per_square_volt` (N/V²) converts voltage to force.
    pub fn new(observations: &[Observation], force_per_square_volt: f64) -> Self {
        let stiffness: Vec<f64> = observations.iter().map(|o| stiffness(o, force_per_square_volt)).collect();
        let (mut longest, mut shortest, mut stroke) = (0f64, f64::INFINITY, 0f64);
        for observation in observations {
            if !matches!(observation.input, Input::Displacement(_)) {
                let (low, high) = range(&observation.measured.value);
                stroke = stroke.max(high - low);
            }
            longest = longest.max(observation.input.samples().time_s.last().copied().unwrap_or(0.0));
            shortest = shortest.min(10.0 / observation.rate_hz);
        }
        Self {
            stiffness: median(&stiffness).max(1e-3),
            times_s: (shortest.min(0.1 * longest), 2.0 * longest),
            coupling: if stroke > 0.0 { (0.15 / stroke).min(1e3) } else { 0.0 },
        }
    }
}

/// Peak-to-peak force over peak-to-peak displacement of one observation, N/m; for a held load its size.
fn stiffness(observation: &Observation, force_per_square_volt: f64) -> f64 {
    let (low, high) = range(&observation.measured.value);
    let measured = high - low;
    let values = &observation.input.samples().value;
    match observation.input {
        Input::Voltage(_) => {
            let squared: Vec<f64> = values.iter().map(|v| v * v).collect();
            force_per_square_volt * change(&squared) / measured
        }
        Input::Force(_) => change(values) / measured,
        // The force is 0 at rest, before the first sample: under a held strain its size counts, not what relaxes.
        Input::Displacement(_) => {
            let (least, most) = range(values);
            let strain = change(values);
            if strain > most - least { low.abs().max(high.abs()) / strain } else { measured / strain }
        }
    }
}

/// The `index`-th start of a search for `branches` branches; the same seed gives the same starts.
///
/// The main springpot has about the film's stiffness. Every branch pairs a nearly elastic with a nearly viscous springpot
/// whose relaxation time is within those that the recordings resolve.
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
    Candidate { actuator, elements, topology, offset_m: 0.0, bend: Bend::Straight }
}
