//! Plants that a loop is closed around: a simulated nonlinear film, or the model of a parameter file with full memory.

use springpot::{Actuator, Curve, Maxwell, Spring, Springpot};

use crate::error::{Error, Result};
use crate::files::parameters::Parameters;
use crate::replay::full_memory::FullMemory;
use crate::replay::in_series::{InSeries, Increments};
use crate::replay::running_memory::RunningMemory;
use crate::simulation::film::{Film, FilmState};

/// A film in motion.
pub trait Plant {
    /// Displacement from where it rested, m.
    fn displacement_m(&self) -> f64;
    /// Advances by a substep under a constant `voltage_v`.
    fn advance(&mut self, voltage_v: f64);
    /// Whether it is intact: neither torn nor pulled in.
    fn holds(&self) -> bool;
}

/// A nonlinear film in motion.
pub struct NonlinearPlant<'a> {
    film: &'a Film,
    state: FilmState,
    substep_s: f64,
}

impl<'a> NonlinearPlant<'a> {
    /// `film` at rest, advanced in substeps of `substep_s`.
    pub fn at_rest(film: &'a Film, substep_s: f64) -> Self {
        Self { film, state: film.rest(), substep_s }
    }
}

impl Plant for NonlinearPlant<'_> {
    fn displacement_m(&self) -> f64 {
        self.film.displacement_m(&self.state)
    }

    fn advance(&mut self, voltage_v: f64) {
        self.state = self.film.advanced(&self.state, voltage_v, self.substep_s, 1);
    }

    fn holds(&self) -> bool {
        self.film.holds(&self.state)
    }
}

/// How a plant differs from the parameters that describe it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mismatch {
    /// Factor on every c and on the film's spring: on the stiffness at all times.
    pub stiffness: f64,
    /// Factor on every order α. c keeps its value, so that at 1 rad/s (0.16 Hz) an element is as stiff as before: it creeps
    /// more, or less, around that.
    pub alpha: f64,
}

impl Mismatch {
    /// None.
    pub const NONE: Self = Self { stiffness: 1.0, alpha: 1.0 };

    /// `model` with this mismatch.
    ///
    /// # Errors
    ///
    /// [`Error`] for an order above 1.
    pub fn apply(self, model: &Maxwell) -> Result<Maxwell> {
        let element = |e: &Springpot| Springpot::new(self.stiffness * e.c, self.alpha * e.alpha);
        let branches: Vec<[Springpot; 2]> = model.branches().iter().map(|pair| pair.each_ref().map(element)).collect();
        Maxwell::new(element(&model.main()), &branches, model.topology(), model.mass_kg())
            .map_err(|error| self.refused(&error))
    }

    fn refused(self, error: &dyn std::error::Error) -> Error {
        Error::field("plant_mismatch", format!("stiffness={} alpha={}: {error}", self.stiffness, self.alpha))
    }
}

/// Steps of Newton's method in a substep: each squares the error.
const MAX_NEWTON_STEPS: usize = 4;
/// Force that has grown by this factor through coupling is a pull-in.
const MAX_COUPLED_GROWTH: f64 = 10.0;
/// Most substeps: each takes some 600 bytes.
const MAX_SUBSTEPS: usize = 1 << 23;

/// The model of a parameter file in motion, with full memory: not the law that a controller steps.
///
/// With g_j the force left j substeps after a unit step of the displacement x, F the force and Δx_k = x_k − x_{k−1}
///
/// ```text
/// F_k = (m/h²) (Δx_k − Δx_{k−1}) + Σ_{j=0..k} g_j Δx_{k−j}
/// ```
///
/// and with an elastic curve T the sum is over the increments of T(x); beside a spring E(x) is added and the sum has the weight T'(x). With a
/// spring S in series the sum is over the increments of y = x − e, and is S(e). g comes from Fourier transforms of K(ζ)/(1 − ζ).
pub struct FullMemoryPlant {
    actuator: Actuator,
    curve: Option<Curve>,
    spring: Option<Spring>,
    /// m/h², N/m.
    inertia: f64,
    /// The last increment of x, m.
    last: f64,
    memory: RunningMemory,
    displacement_m: f64,
    /// Stretch of a spring in series, m.
    elongation_m: f64,
}

impl FullMemoryPlant {
    /// The film of `parameters` with `mismatch` at rest, for so many `substeps` of `substep_s`.
    ///
    /// # Errors
    ///
    /// [`Error`] for a mismatch that is refused, or too many substeps.
    pub fn at_rest(parameters: &Parameters, mismatch: Mismatch, substep_s: f64, substeps: usize) -> Result<Self> {
        parameters.actuator.check()?;
        if substeps > MAX_SUBSTEPS {
            let cause = format!(
                "a plant with full memory for {substeps} substeps; {MAX_SUBSTEPS} are possible, shorten the reference"
            );
            return Err(Error::field("plant", cause));
        }
        let model = mismatch.apply(&parameters.model)?;
        let spring = parameters.spring.as_ref().map(|spring| spring.scaled(mismatch.stiffness)).transpose();
        let massless = Maxwell::new(model.main(), model.branches(), model.topology(), 0.0)?;
        let relaxation = FullMemory::new(substeps, substep_s).force(&massless, &vec![1.0; substeps]);
        Ok(Self {
            actuator: parameters.actuator,
            curve: parameters.curve.as_ref().map(|curve| curve.pieces().clone()),
            spring: spring.map_err(|error| mismatch.refused(&error))?,
            last: 0.0,
            inertia: model.mass_kg() / (substep_s * substep_s),
            memory: RunningMemory::new(relaxation),
            displacement_m: 0.0,
            elongation_m: 0.0,
        })
    }

    /// The increment of x, and that of the memory, that resist the force `left` (N), which grows with `slope` (N/m), beside what the memory's `past`
    /// (N) resists.
    fn increment(&self, left: f64, slope: f64, past: f64) -> (f64, f64) {
        let constant = self.inertia - slope;
        let instant = self.memory.instant();
        let curve = match (&self.curve, &self.spring) {
            (Some(curve), _) => curve,
            (None, Some(spring)) => {
                let film = InSeries { spring, elongation_m: self.elongation_m, instant, past_n: past };
                let Increments { memory_m, spring_m } = film.under(left, constant);
                return (memory_m + spring_m, memory_m);
            }
            (None, None) => {
                let stiffness = instant + constant;
                let increment = if stiffness > 0.0 { (left - past) / stiffness } else { f64::NAN };
                return (increment, increment);
            }
        };
        // Newton's method: the curve hardly bends within a substep.
        let at_rest = curve.value(self.displacement_m);
        let stretched = |increment: f64| curve.value(self.displacement_m + increment) - at_rest;
        let mut increment = self.last;
        for _ in 0..MAX_NEWTON_STEPS {
            let x = self.displacement_m + increment;
            let memory = past + instant * stretched(increment);
            let weight = curve.slope(x);
            let (shown, stiffness) = match &self.spring {
                None => (memory, instant * weight),
                Some(spring) => {
                    let bent = curve.curvature(x) * memory;
                    (spring.force(x) + weight * memory, spring.slope(x) + instant * weight * weight + bent)
                }
            };
            let stiffness = stiffness + constant;
            if stiffness.is_nan() || stiffness <= 0.0 {
                return (f64::NAN, f64::NAN);
            }
            increment += (left - shown - constant * increment) / stiffness;
        }
        (increment, stretched(increment))
    }
}

impl Plant for FullMemoryPlant {
    fn displacement_m(&self) -> f64 {
        self.displacement_m
    }

    fn advance(&mut self, voltage_v: f64) {
        let Some(past) = self.memory.past_n() else { return };
        let load = self.actuator.load(voltage_v);
        let left = load.force_n + load.slope_n_per_m * self.displacement_m + self.inertia * self.last;
        let (increment, stretched) = self.increment(left, load.slope_n_per_m, past);
        self.memory.push(stretched);
        self.last = increment;
        self.displacement_m += increment;
        self.elongation_m += increment - stretched;
    }

    fn holds(&self) -> bool {
        let coupled = self.actuator.stretch_coupling * self.displacement_m;
        self.displacement_m.is_finite() && coupled < MAX_COUPLED_GROWTH
    }
}
