//! Start values of searches: random ones, with one more branch, with a little of a nonlinearity.

use rand::RngExt;
use rand_pcg::Pcg64;
use springpot::{Actuator, Springpot, Topology};

use super::bend::{Bend, Elastic};
use super::candidate::Candidate;
use super::observation::Observation;
use super::resolution::Resolution;
use super::rising::Rising;
use super::settings::CurveChoice;
use crate::files::recording::Input;
use crate::statistics::{change, median, peak, peaks, range};

/// Orders of magnitude of the film's parameters, estimated from recordings before the fit.
#[derive(Clone, Copy, Debug)]
pub struct Scales {
    /// Peak-to-peak force over peak-to-peak displacement, N/m.
    pub stiffness: f64,
    /// Shortest and longest time that the recordings resolve, s.
    pub times_s: (f64, f64),
    /// Shortest step of the model, s.
    pub step_s: f64,
    /// Coupling at which the force changes by 15 % over the stroke, 1/m.
    pub coupling: f64,
    /// Shortest cycle of the input, s.
    pub cycle_s: f64,
    /// How exactly a delay of the sensor is known.
    pub resolution: Resolution,
}

impl Scales {
    /// The scales of `observations`; `force_per_square_volt` (N/V²) converts voltage to force.
    pub fn new(observations: &[Observation], force_per_square_volt: f64) -> Self {
        let stiffness: Vec<f64> = observations.iter().map(|o| stiffness(o, force_per_square_volt)).collect();
        let (mut longest, mut step_s, mut stroke, mut cycle_s) = (0f64, f64::INFINITY, 0f64, f64::INFINITY);
        for observation in observations {
            if !matches!(observation.input, Input::Displacement(_)) {
                let (low, high) = range(&observation.measured.value);
                stroke = stroke.max(high - low);
            }
            let duration_s = observation.input.samples().time_s.last().copied().unwrap_or(0.0);
            longest = longest.max(duration_s);
            cycle_s = cycle_s.min(duration_s / peaks(&observation.input.samples().value).len().max(1) as f64);
            step_s = step_s.min(1.0 / observation.rate_hz);
        }
        Self {
            stiffness: median(&stiffness).max(1e-3),
            times_s: ((10.0 * step_s).min(0.1 * longest), 2.0 * longest),
            step_s,
            coupling: if stroke > 0.0 { (0.15 / stroke).min(1e3) } else { 0.0 },
            cycle_s,
            resolution: Resolution::new(observations),
        }
    }

    /// The time of a radian of the shortest cycle, s.
    fn radian_s(self) -> f64 {
        self.cycle_s / std::f64::consts::TAU
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
        elements.extend([elastic, viscous].map(|alpha| Springpot::new(stiffness * time.powf(alpha), alpha)));
    }
    Candidate::linear(actuator, elements, topology)
}

/// The candidate with one more branch of little effect, at three relaxation times.
pub(super) fn grown(candidate: &Candidate, topology: Topology, scales: Scales) -> Vec<Candidate> {
    let (short, long) = scales.times_s;
    [0.2, 0.5, 0.8]
        .into_iter()
        .map(|share| {
            let time: f64 = short * f64::powf(long / short, share);
            let stiffness = match topology {
                Topology::Parallel => 0.1 * scales.stiffness,
                // In series with all others: a stiff branch has little effect.
                Topology::Eq11 => 10.0 * scales.stiffness,
            };
            let mut grown = candidate.clone();
            grown.topology = topology;
            grown.elements.extend([0.1, 0.9].map(|alpha| Springpot::new(stiffness * time.powf(alpha), alpha)));
            grown
        })
        .collect()
}

/// One kind of nonlinearity, or none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    Linear,
    Saturation,
    MooneyRivlin,
    Gent,
    Free {
        pieces: usize,
        saturates: bool,
    },
    /// A spring of so many pieces, none for a linear one, beside the memory.
    Beside {
        pieces: usize,
    },
    /// A linear spring beside the memory of a film of constant volume in Hencky's strain.
    Hencky,
    /// A spring in series with the memory.
    Series {
        saturates: bool,
    },
}

impl Kind {
    /// The linear film and the kinds that `choice` names for these observations.
    pub(super) fn for_choice(choice: CurveChoice, observations: &[Observation]) -> Vec<Self> {
        let volts = observations.iter().any(|o| matches!(o.input, Input::Voltage(_)));
        let two = vec![Self::Beside { pieces: 0 }, Self::Beside { pieces: 2 }, Self::Hencky];
        let moves = |o: &Observation| !matches!(o.input, Input::Displacement(_));
        let series =
            |saturates| if observations.iter().all(moves) { vec![Self::Series { saturates }] } else { Vec::new() };
        let free = |saturates| [2, 4].map(|pieces| Self::Free { pieces, saturates }).to_vec();
        let nonlinear = match choice {
            CurveChoice::None => Vec::new(),
            CurveChoice::Saturation => vec![Self::Saturation],
            CurveChoice::MooneyRivlin => vec![Self::MooneyRivlin],
            CurveChoice::Gent => vec![Self::Gent],
            CurveChoice::Free => free(false),
            CurveChoice::Both => free(true),
            CurveChoice::Two => two,
            CurveChoice::Series if volts => [series(false), series(true)].concat(),
            CurveChoice::Series => series(false),
            CurveChoice::Auto if volts => {
                [series(false), vec![Self::Saturation], series(true), free(false), free(true), two].concat()
            }
            CurveChoice::Auto => [series(false), vec![Self::MooneyRivlin, Self::Gent], free(false), two].concat(),
        };
        [vec![Self::Linear], nonlinear].concat()
    }

    /// Its name while it is fitted.
    pub(super) fn name(self) -> String {
        match self {
            Self::Linear => "linear".into(),
            Self::Saturation => "saturation".into(),
            Self::MooneyRivlin => "mooney-rivlin".into(),
            Self::Gent => "gent".into(),
            Self::Free { pieces, saturates: false } => format!("free curve of {pieces} pieces"),
            Self::Free { pieces, saturates: true } => format!("free curve of {pieces} pieces and saturation"),
            Self::Beside { pieces: 0 } => "two curves".into(),
            Self::Beside { pieces } => format!("two curves with a spring of {pieces} pieces"),
            Self::Hencky => "two curves with Hencky's strain".into(),
            Self::Series { saturates: false } => "spring in series".into(),
            Self::Series { saturates: true } => "spring in series and saturation".into(),
        }
    }

    /// Whether `candidate` is a film of this kind without some of its nonlinearity.
    pub(super) fn extends(self, candidate: &Candidate) -> bool {
        let may_saturate = matches!(self, Self::Free { saturates: true, .. } | Self::Series { saturates: true })
            || self.beside().is_some();
        let is_linear = || candidate.spring.as_ref().is_some_and(Elastic::is_linear);
        self.beside().is_some() && self != Self::Beside { pieces: 0 } && is_linear()
            || self.adds_saturation_to(candidate)
            || candidate.is_straight() && (may_saturate || candidate.actuator.saturation_v.is_none())
    }

    /// Whether this kind has all that the `other` has, and more, which must explain something.
    pub(super) fn adds_to(self, other: Self) -> bool {
        match (self, other) {
            (Self::Free { pieces, saturates }, Self::Free { pieces: fewer, saturates: without }) => {
                self != other && fewer <= pieces && without <= saturates
            }
            (Self::Saturation, Self::Linear)
            | (Self::Free { saturates: true, .. }, Self::Saturation)
            | (Self::Series { saturates: true }, Self::Series { saturates: false }) => true,
            _ => false,
        }
    }

    /// The pieces of its spring beside the memory, if it has one.
    pub(super) fn beside(self) -> Option<usize> {
        match self {
            Self::Beside { pieces } => Some(pieces),
            Self::Hencky => Some(0),
            _ => None,
        }
    }

    /// Whether this kind is the spring in series of `candidate` and a saturation.
    pub(super) fn adds_saturation_to(self, candidate: &Candidate) -> bool {
        self == Self::Series { saturates: true } && candidate.is_in_series()
    }

    /// Largest cost of a simpler film, over the least so far, from which this kind is tried.
    pub(super) fn reaches(self) -> f64 {
        match self {
            // Two curves take some five times of the error of a linear film, one more in the spring hardly any.
            Self::Beside { pieces: 0 } => 30.0,
            Self::Beside { .. } | Self::Hencky => 8.0,
            _ => f64::INFINITY,
        }
    }

    /// `candidate` with a little of this nonlinearity: starts of a search that `reaches` so far.
    pub(super) fn starts(self, candidate: &Candidate, reach: Reach) -> Vec<Candidate> {
        let Reach { range_m, largest_v, .. } = reach;
        let mut start = candidate.clone();
        // A twentieth of the force at the largest voltage.
        let saturation_v = Some(20f64.sqrt() * largest_v.max(1.0));
        match self {
            Self::Linear => vec![start],
            Self::Saturation => {
                start.actuator.saturation_v = saturation_v;
                vec![start]
            }
            Self::Free { pieces, saturates } => {
                start.bend = Bend::free(pieces, range_m);
                start.actuator.saturation_v = start.actuator.saturation_v.or(saturation_v).filter(|_| saturates);
                vec![start]
            }
            Self::Beside { .. } | Self::Hencky => {
                let pieces = self.beside().unwrap_or(0);
                let (bend, spring) = match &start.spring {
                    Some(linear) => (start.bend.clone(), linear.cut(pieces, range_m)),
                    None => {
                        (measure(&start, range_m, 1.0), Elastic::linear(0.0, start.elements[0].c).cut(pieces, range_m))
                    }
                };
                vec![Candidate { bend, spring: Some(spring), ..start }]
            }
            Self::Series { saturates } => {
                start.actuator.saturation_v = start.actuator.saturation_v.or(saturation_v).filter(|_| saturates);
                if start.is_in_series() {
                    return vec![start];
                }
                let largest_n = start.actuator.electrostatic_force(largest_v).max(reach.largest_n);
                let stiffness = largest_n / range_m.1.abs().max(range_m.0.abs());
                // Half and a tenth of the stroke.
                [2.0, 10.0]
                    .map(|times| {
                        let mut series = start.clone();
                        series.elements.iter_mut().for_each(|element| element.c *= times / (times - 1.0));
                        series.spring = Some(Elastic::Rising(Rising::new(times * stiffness, 0.3, largest_n)));
                        series
                    })
                    .to_vec()
            }
            Self::MooneyRivlin | Self::Gent => {
                let stroke = range_m.1.abs().max(range_m.0.abs());
                // Stretched to 1.3, 2 and 5 times its length.
                [3.3f64, 1.0, 0.25]
                    .into_iter()
                    .map(|length| {
                        let farthest = 1.0 + 1.0 / length;
                        let invariant = farthest * farthest + 2.0 / farthest - 3.0;
                        let ln_limit = (self == Self::Gent).then(|| (5.0 * invariant).ln());
                        let ln_length = (length * stroke).ln();
                        let bend = Bend::Rubber { share: 0.5, ln_limit, ln_length, rest_stretch: 1.0, range_m };
                        Candidate { bend, ..start.clone() }
                    })
                    .collect()
            }
        }
    }
}

/// A strain measure for a memory over a stroke `range_m` (m) and beyond it, with this exponent. Its length is the film's; where the stroke is
/// short against it, only the exponent is fitted.
fn measure(film: &Candidate, (low_m, high_m): (f64, f64), exponent: f64) -> Bend {
    /// Stroke over the length from which two numbers of a measure show.
    const LARGE: f64 = 0.15;
    let length_m = film.actuator.length_m;
    let stroke_m = high_m.max(-low_m);
    let reach_m = (low_m - 0.05 * stroke_m, REACH * high_m);
    Bend::Measure {
        exponent,
        ln_length: length_m.ln(),
        fitted: if stroke_m > LARGE * length_m { 2 } else { 1 },
        range_m: reach_m,
    }
}

/// Strokes up to which a measure is written, over the recorded one: unlike pieces it holds beyond it.
const REACH: f64 = 2.5;

/// Share of the stiffness in the shortest cycle that has little effect.
const SMALL: f64 = 0.01;

/// Two-curve films like `film` whose memory relaxes at times within those that the recordings resolve, and up to some times longer, beside a spring
/// of `pieces`. In the shortest cycle a drag has 1 % of the stiffness, and so has the inertia, if a fit may change the `scale` of the force.
pub(super) fn relaxing(
    film: &Candidate,
    pieces: usize,
    range_m: (f64, f64),
    scales: Scales,
    scale: bool,
) -> [Candidate; 2] {
    let (mut stiffness, radian_s) = (scales.stiffness, scales.radian_s());
    let mut relaxing = Candidate { topology: Topology::Parallel, bend: measure(film, range_m, 0.0), ..film.clone() };
    if scale {
        let share = (film.actuator.mass_kg / (SMALL * stiffness * radian_s * radian_s)).min(1.0);
        relaxing.actuator.relative_permittivity *= share;
        stiffness *= share;
    }
    relaxing.spring = Some(Elastic::linear(0.5, stiffness).cut(pieces, range_m));
    let scales = Scales { stiffness, ..scales };
    [1.0, 5.0].map(|longer| Candidate { elements: elements(film.branches(), scales, 0.3, longer), ..relaxing.clone() })
}

/// A drag of little effect, and `branches` of this `share` of the stiffness that relax at times within those that the recordings resolve, and up to so many
/// times `longer`.
pub(crate) fn elements(branches: usize, scales: Scales, share: f64, longer: f64) -> Vec<Springpot> {
    let Scales { stiffness, times_s: (short, long), .. } = scales;
    let mut elements = vec![Springpot::new(SMALL * stiffness * scales.radian_s(), 1.0)];
    for branch in 0..branches {
        let time_s = short * (longer * long / short).powf((branch as f64 + 0.5) / branches as f64);
        elements.extend([Springpot::new(share * stiffness, 0.0), Springpot::new(share * stiffness * time_s, 1.0)]);
    }
    elements
}

/// Films like `series`, which has a spring in series, whose memory creeps at such times: as much of the stroke is creep.
pub(super) fn creeping(series: &Candidate, scales: Scales) -> [Candidate; 2] {
    [1.0, 5.0].map(|longer| {
        let elements = elements(series.branches(), scales, 1.5, longer);
        Candidate { elements, topology: Topology::Parallel, ..series.clone() }
    })
}

/// How far recordings reach.
#[derive(Clone, Copy)]
pub(super) struct Reach {
    /// The stroke with a margin, m.
    pub(super) range_m: (f64, f64),
    /// The largest voltage, V, and the largest force that was given, N.
    pub(super) largest_v: f64,
    pub(super) largest_n: f64,
}

pub(super) fn reach(observations: &[Observation], offset_m: f64) -> Reach {
    let (mut low, mut high, mut largest_v, mut largest_n) = (0f64, 0f64, 0f64, 0f64);
    for observation in observations {
        let values = &observation.input.samples().value;
        let (least, most) = match observation.input {
            Input::Displacement(_) => range(values),
            _ => {
                let (least, most) = range(&observation.measured.value);
                (least - offset_m, most - offset_m)
            }
        };
        (low, high) = (low.min(least), high.max(most));
        let largest = peak(values);
        match observation.input {
            Input::Voltage(_) => largest_v = largest_v.max(largest),
            Input::Force(_) => largest_n = largest_n.max(largest),
            Input::Displacement(_) => {}
        }
    }
    let margin = 0.05 * (high - low);
    // Noise about 0 is no stroke.
    let low = if low < -0.05 * (high - low) { low - margin } else { low };
    Reach { range_m: (low, high + margin), largest_v, largest_n }
}
