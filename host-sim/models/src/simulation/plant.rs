//! Plants that a loop is closed around: a simulated nonlinear film, or the model of a parameter file with full memory.

use host_fft::Planner;
use springpot::{Actuator, Curve, Maxwell, Spring, Springpot};

use crate::error::{Error, Result};
use crate::files::parameters::Parameters;
use crate::replay::full_memory::FullMemory;
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
    /// Factor on every c and on the spring beside them: on the stiffness at all times.
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

/// Substeps whose increments are summed one by one.
const BLOCK: usize = 64;
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
/// and with an elastic curve T the sum is over the increments of T(x); beside a spring E(x) is added and the sum has the weight T'(x). g comes from Fourier transforms of K(ζ)/(1 − ζ), and the sum over the past is taken in blocks that double: a block of L
/// increments that is complete adds its part to the next L sums, by a Fourier transform.
pub struct FullMemoryPlant {
    actuator: Actuator,
    curve: Option<Curve>,
    spring: Option<Spring>,
    /// m/h², N/m.
    inertia: f64,
    /// The last increment of x, m.
    last: f64,
    /// g, N/m.
    relaxation: Vec<f64>,
    /// Increments of T(x), m.
    increments: Vec<f64>,
    /// Force that complete blocks leave in the substeps to come, N.
    past_n: Vec<f64>,
    displacement_m: f64,
    planner: Planner,
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
            relaxation,
            increments: Vec::with_capacity(substeps),
            past_n: vec![0.0; substeps],
            displacement_m: 0.0,
            planner: Planner::new(),
        })
    }

    /// The increment of x, and that of T(x), that resist the force `left` (N), which grows with `slope` (N/m), beside what the memory's `past`
    /// (N) resists.
    fn increment(&self, left: f64, slope: f64, past: f64) -> (f64, f64) {
        let constant = self.inertia - slope;
        let Some(curve) = &self.curve else {
            let stiffness = self.relaxation[0] + constant;
            let increment = if stiffness > 0.0 { (left - past) / stiffness } else { f64::NAN };
            return (increment, increment);
        };
        // Newton's method: the curve hardly bends within a substep.
        let at_rest = curve.value(self.displacement_m);
        let stretched = |increment: f64| curve.value(self.displacement_m + increment) - at_rest;
        let mut increment = self.last;
        for _ in 0..MAX_NEWTON_STEPS {
            let x = self.displacement_m + increment;
            let memory = past + self.relaxation[0] * stretched(increment);
            let weight = curve.slope(x);
            let (shown, stiffness) = match &self.spring {
                None => (memory, self.relaxation[0] * weight),
                Some(spring) => {
                    let bent = curve.curvature(x) * memory;
                    (spring.force(x) + weight * memory, spring.slope(x) + self.relaxation[0] * weight * weight + bent)
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

    /// Adds what the last `length` increments leave in as many substeps to come.
    fn pass_on(&mut self, length: usize) {
        let now = self.increments.len();
        let ahead = length.min(self.past_n.len() - now);
        if ahead == 0 {
            return;
        }
        let points = 2 * length;
        let (forward, backward) = (self.planner.forward(points), self.planner.backward(points));
        let spectrum_of = |values: &[f64]| {
            let mut time = forward.make_input_vec();
            time[..values.len()].copy_from_slice(values);
            let mut spectrum = forward.make_output_vec();
            forward.process(&mut time, &mut spectrum).expect("lengths are the plan's own");
            spectrum
        };
        let mut product = spectrum_of(&self.increments[now - length..]);
        let kernel = spectrum_of(&self.relaxation[..points.min(self.relaxation.len())]);
        product.iter_mut().zip(kernel).for_each(|(value, kernel)| *value *= kernel);
        // The first and last point of an even transform are real, up to rounding.
        product[0].im = 0.0;
        product[length].im = 0.0;
        let mut time = backward.make_output_vec();
        backward.process(&mut product, &mut time).expect("lengths are the plan's own");
        // What wraps around lands in the first half, which belongs to the block itself.
        for (sum, value) in self.past_n[now..now + ahead].iter_mut().zip(&time[length..]) {
            *sum += value / points as f64;
        }
    }
}

impl Plant for FullMemoryPlant {
    fn displacement_m(&self) -> f64 {
        self.displacement_m
    }

    fn advance(&mut self, voltage_v: f64) {
        let k = self.increments.len();
        if k >= self.past_n.len() {
            return;
        }
        let block = &self.increments[k - k % BLOCK..];
        let near: f64 = block.iter().rev().zip(&self.relaxation[1..]).map(|(dx, g)| dx * g).sum();
        let load = self.actuator.load(voltage_v);
        let left = load.force_n + load.slope_n_per_m * self.displacement_m + self.inertia * self.last;
        let (increment, stretched) = self.increment(left, load.slope_n_per_m, near + self.past_n[k]);
        self.increments.push(stretched);
        self.last = increment;
        self.displacement_m += increment;
        let complete = self.increments.len();
        if complete.is_multiple_of(BLOCK) {
            self.pass_on(1 << complete.trailing_zeros());
        }
    }

    fn holds(&self) -> bool {
        let coupled = self.actuator.stretch_coupling * self.displacement_m;
        self.displacement_m.is_finite() && coupled < MAX_COUPLED_GROWTH
    }
}
