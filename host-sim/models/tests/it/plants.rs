//! Plants that are not built in: a film that stiffens and thins, and films that warm up while they are driven.

use host_io::files::parameters::Parameters;
use host_models::simulation::film::{Film, FilmState};
use host_models::simulation::plant::{Mismatch, Plant};
use springpot::{Actuator, EPSILON_0, Law, LawState};

/// Stiffness (N/m) and retardation time (s) of elements that creep little, a sixth of what the spring gives, and of some that creep
/// nearly as much as the spring gives.
pub(crate) const LITTLE_CREEP: [(f64, f64); 3] = [(200e3, 0.3), (150e3, 4.0), (150e3, 40.0)];
pub(crate) const MUCH_CREEP: [(f64, f64); 3] = [(60e3, 0.3), (50e3, 4.0), (40e3, 40.0)];

/// How a film differs from the one that was recorded: now, or after some time of warming up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Change {
    /// Factor on its stiffness.
    pub stiffness: f64,
    /// Factor on its relaxation times.
    pub times: f64,
    /// Factor on the orders of its springpots.
    pub alpha: f64,
}

impl Change {
    pub(crate) const NONE: Self = Self { stiffness: 1.0, times: 1.0, alpha: 1.0 };
}

/// A change that comes evenly, substep by substep.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ramp {
    pub(crate) to: Change,
    /// Substeps until it is there.
    pub(crate) substeps: usize,
}

impl Ramp {
    /// The share of the change after so many `substeps`.
    fn share(&self, substeps: usize) -> f64 {
        (substeps as f64 / self.substeps as f64).min(1.0)
    }

    fn at(&self, substeps: usize) -> Change {
        let share = self.share(substeps);
        let factor = |to: f64| 1.0 + share * (to - 1.0);
        Change { stiffness: factor(self.to.stiffness), times: factor(self.to.times), alpha: factor(self.to.alpha) }
    }
}

/// Constants of a film whose spring stiffens with the third power, in series with Kelvin–Voigt elements, and that thins: none of this
/// project's equations.
#[derive(Clone, Debug)]
pub(crate) struct Stiffening {
    /// k₀ (N/m) and k₃ (N/m³) of the spring, f = k₀ e + k₃ e³.
    pub spring: (f64, f64),
    /// Stiffness (N/m) and retardation time (s).
    pub elements: [(f64, f64); 3],
    /// Mass, kg, and damping, N·s/m.
    pub inertia: (f64, f64),
    /// Growth of the force with the displacement, 1/m.
    pub coupling: f64,
    /// Voltage at which the force is half of Eq. 1, V.
    pub saturation_v: f64,
    /// A constant force, N.
    pub weight_n: f64,
}

impl Stiffening {
    pub(crate) fn with(elements: [(f64, f64); 3]) -> Self {
        Self {
            spring: (9e3, 6e8),
            elements,
            inertia: (0.1, 2.0),
            coupling: 40.0,
            saturation_v: f64::INFINITY,
            weight_n: 0.0,
        }
    }
}

/// Such a film in motion.
pub(crate) struct StiffeningFilm {
    film: Stiffening,
    step_s: f64,
    change: Change,
    ramp: Option<Ramp>,
    steps: usize,
    /// x, its speed, and the extensions of the elements.
    state: [f64; 5],
}

impl StiffeningFilm {
    pub(crate) fn new(film: Stiffening, step_s: f64) -> Self {
        Self { film, step_s, change: Change::NONE, ramp: None, steps: 0, state: [0.0; 5] }
    }

    /// Stiffer, slower from the beginning.
    pub(crate) fn changed(self, change: Change) -> Self {
        Self { change, ..self }
    }

    pub(crate) fn warming(self, ramp: Ramp) -> Self {
        Self { ramp: Some(ramp), ..self }
    }

    fn slope(&self, volts: f64, [x, speed, e0, e1, e2]: [f64; 5]) -> [f64; 5] {
        let Change { stiffness, times, .. } = self.change;
        let Stiffening { spring: (k0, k3), elements: [a, b, c], inertia: (mass, damping), .. } = self.film;
        let spring = x - e0 - e1 - e2;
        let force = stiffness * (k0 * spring + k3 * spring * spring * spring);
        let area_m2 = 0.02 * 0.03;
        let square = volts * volts / (1.0 + (volts / self.film.saturation_v).powi(2));
        let pull = EPSILON_0 * 4.7 * area_m2 / 1e-8 * square * (1.0 + self.film.coupling * x);
        let flow = |(k, time_s): (f64, f64), e: f64| (force / (stiffness * k) - e) / (times * time_s);
        [speed, (pull + self.film.weight_n - force - damping * speed) / mass, flow(a, e0), flow(b, e1), flow(c, e2)]
    }

    /// A step under `volts`, by the classical Runge–Kutta method; the displacement, m.
    pub(crate) fn step(&mut self, volts: f64) -> f64 {
        let ahead = |slope: [f64; 5], by: f64| std::array::from_fn(|i| self.state[i] + by * slope[i]);
        let h = self.step_s;
        let a = self.slope(volts, self.state);
        let b = self.slope(volts, ahead(a, 0.5 * h));
        let c = self.slope(volts, ahead(b, 0.5 * h));
        let d = self.slope(volts, ahead(c, h));
        let next = std::array::from_fn(|i| self.state[i] + h / 6.0 * (a[i] + 2.0 * (b[i] + c[i]) + d[i]));
        self.state = next;
        self.steps += 1;
        if let Some(ramp) = self.ramp {
            self.change = ramp.at(self.steps);
        }
        next[0]
    }
}

impl Plant for StiffeningFilm {
    fn displacement_m(&self) -> f64 {
        self.state[0]
    }

    fn advance(&mut self, voltage_v: f64) {
        self.step(voltage_v);
    }

    fn holds(&self) -> bool {
        self.state[0].abs() < 0.03
    }
}

/// A nonlinear strip that warms up: its springs become softer, its dashpots faster. What has flowed stays, so the stress is scaled and nothing
/// jumps. What stretches it softens with it, as a second film that pulls against it: under a weight it would sag by 15 mm.
pub(crate) struct WarmingStrip {
    film: Film,
    ramp: Ramp,
    substep_s: f64,
    substeps: usize,
    state: FilmState,
}

impl WarmingStrip {
    pub(crate) fn at_rest(film: Film, ramp: Ramp, substep_s: f64) -> Self {
        Self { film, ramp, substep_s, substeps: 0, state: film.rest() }
    }
}

impl Plant for WarmingStrip {
    fn displacement_m(&self) -> f64 {
        self.film.displacement_m(&self.state)
    }

    fn advance(&mut self, voltage_v: f64) {
        let Change { stiffness, times, .. } = self.ramp.at(self.substeps);
        let film = self.film.warmed(stiffness, times);
        self.state = film.advanced(&self.state, voltage_v, self.substep_s, 1);
        self.substeps += 1;
    }

    fn holds(&self) -> bool {
        self.film.holds(&self.state)
    }
}

/// A springpot film whose force is that of two films side by side, a cold and a warm one, of which the warm one gets a growing share. Both have
/// lived through the whole path, so nothing jumps.
///
/// Each has the compressed memory of its own model in f64 at the substep, half a millisecond: full memory would take 100 GB for a day.
pub(crate) struct BlendedFilm {
    actuator: Actuator,
    /// The cold film, and the warm one.
    films: Vec<(Law<f64>, LawState<f64>)>,
    ramp: Option<Ramp>,
    substeps: usize,
    displacement_m: f64,
    increment_m: f64,
    /// A constant force, N.
    pub(crate) weight_n: f64,
}

impl BlendedFilm {
    pub(crate) fn at_rest(parameters: &Parameters, ramp: Option<Ramp>, substep_s: f64) -> Self {
        let film = |change: Change| {
            let mismatch = Mismatch { stiffness: change.stiffness, alpha: change.alpha };
            let model = mismatch.apply(&parameters.model).expect("valid");
            let parameters = Parameters { model, ..parameters.clone() };
            let law = parameters.film().compressed_law::<f64>(1.0 / substep_s).expect("a law");
            let rest = law.state();
            (law, rest)
        };
        let mut films = vec![film(Change::NONE)];
        films.extend(ramp.map(|ramp| film(ramp.to)));
        Self {
            actuator: parameters.actuator,
            films,
            ramp,
            substeps: 0,
            displacement_m: 0.0,
            increment_m: 0.0,
            weight_n: 0.0,
        }
    }

    fn force_to(&self, x: f64, warm: f64) -> f64 {
        match self.films.as_slice() {
            [(law, state)] => law.force_to(state, x),
            films => {
                films.iter().zip([1.0 - warm, warm]).map(|((law, state), share)| share * law.force_to(state, x)).sum()
            }
        }
    }
}

impl Plant for BlendedFilm {
    fn displacement_m(&self) -> f64 {
        self.displacement_m
    }

    fn advance(&mut self, voltage_v: f64) {
        let warm = self.ramp.map_or(0.0, |ramp| ramp.share(self.substeps));
        self.substeps += 1;
        let load = self.actuator.load(voltage_v);
        let force_n = load.force_n + self.weight_n;
        let missing = |x: f64| force_n + load.slope_n_per_m * x - self.force_to(x, warm);
        // The curve hardly bends within a substep: a chord over a micrometre, and a second step for what it leaves.
        let near = self.displacement_m + self.increment_m;
        let at_near = missing(near);
        let slope = (missing(near + 1e-6) - at_near) / 1e-6;
        let once = near - at_near / slope;
        let x = once - missing(once) / slope;
        for (law, state) in &mut self.films {
            law.force(state, x);
        }
        self.increment_m = x - self.displacement_m;
        self.displacement_m = x;
    }

    fn holds(&self) -> bool {
        self.displacement_m.is_finite() && self.displacement_m.abs() < self.actuator.length_m
    }
}
