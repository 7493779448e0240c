//! Nonlinear films with full memory: F = K T(x) + m s² x behind an elastic curve.
//!
//! Along a displacement that is given this is a product in the frequency domain. Under a given force it is implicit: the recursion of
//! a controller is close, and the force that is missing along its answer, computed with full memory, is added to what drives it until
//! nothing is missing.
//!
//! With a spring in series neither is a product, and both are solved step by step.

use num_complex::Complex;
use springpot::{Compressed, Curve, Law, Load, Spring};

use super::coupling::{PullIn, coupled_displacement, squares};
use super::full_memory::FullMemory;
use super::in_series::{InSeries, Increments};
use super::running_memory::RunningMemory;
use crate::error::{Error, Result};
use crate::files::parameters::Film;

/// Passes after which a solution is given up. Each gains three digits or more.
const MAX_PASSES: usize = 60;
/// Change of the displacement in a pass at which it has converged (RMS, relative).
const TOLERANCE: f64 = 1e-11;

impl FullMemory {
    /// Force (N) of `film` along `displacement` (m), one value per step from rest.
    pub fn force_along(&self, film: Film<'_>, displacement: &[f64]) -> Vec<f64> {
        let curve = match (film.curve, film.spring) {
            (Some(curve), _) => curve,
            (None, Some(spring)) => {
                let along = |k: usize, before: &Before<'_>| before.film.along(displacement[k] - before.displacement_m);
                return self.run_in_series(film, spring, displacement.len(), along).force_n;
            }
            (None, None) => return self.force(film.model, displacement),
        };
        let (kernel, inertia) = (self.kernel(film), self.inertia(film));
        BentFilm { kernel: &kernel, inertia: &inertia, curve, spring: film.spring }.force(self, displacement)
    }

    /// Displacement (m) of `film` under `loads` (N, N/m), one per step from rest.
    ///
    /// # Errors
    ///
    /// [`Error::Computation`] for pull-in, and [`Error`] where the law is refused.
    pub fn displacement_under(&self, film: Film<'_>, loads: &[Load<f64>], step_s: f64) -> Result<Vec<f64>> {
        let curve = match (film.curve, film.spring) {
            (Some(curve), _) => curve,
            (None, Some(spring)) => {
                let under = |k: usize, before: &Before<'_>| before.under(&loads[k]);
                let displacement = self.run_in_series(film, spring, loads.len(), under).displacement_m;
                let holds = displacement.iter().all(|x| x.is_finite());
                return holds.then_some(displacement).ok_or_else(pulled_in);
            }
            (None, None) => {
                let start = vec![0.0; loads.len()];
                let stiffness = self.dynamic_stiffness(film.model);
                return coupled_displacement(self, &stiffness, loads, start, self.rounding())
                    .map_err(|PullIn| pulled_in());
            }
        };
        let (kernel, inertia) = (self.kernel(film), self.inertia(film));
        let law = film.compressed_law::<f64>(1.0 / step_s)?;
        let bent = BentFilm { kernel: &kernel, inertia: &inertia, curve, spring: film.spring };
        let found = bent_displacement(self, &bent, &law, loads, TOLERANCE);
        found.map_err(|PullIn| pulled_in())
    }

    /// Steps `film`, whose memory is in series with `spring`, from rest: so often, and each time as `step` has it from its number and from what is
    /// before it.
    fn run_in_series(
        &self,
        film: Film<'_>,
        spring: &Spring,
        steps: usize,
        step: impl Fn(usize, &Before<'_>) -> Increments,
    ) -> Run {
        let ones = vec![1.0; steps];
        let mut memory = RunningMemory::new(self.through(&self.kernel(film), &ones));
        // Of a unit step: no method has the inertia of more than the last four increments.
        let mut inertia = self.through(&self.inertia(film), &ones);
        inertia.resize(4, 0.0);
        let (mut displacement_m, mut elongation_m, mut last) = (0.0, 0.0, [0.0; 3]);
        let mut run = Run::default();
        while let Some(past_n) = memory.past_n() {
            let film = InSeries { spring, elongation_m, instant: memory.instant(), past_n };
            let past_inertia_n = last.iter().zip(&inertia[1..]).map(|(dx, share)| dx * share).sum();
            let before = Before { film, displacement_m, inertia: inertia[0], past_inertia_n };
            let Increments { memory_m, spring_m } = step(run.force_n.len(), &before);
            let increment = memory_m + spring_m;
            memory.push(memory_m);
            last = [increment, last[0], last[1]];
            displacement_m += increment;
            elongation_m += spring_m;
            run.displacement_m.push(displacement_m);
            run.force_n.push(spring.force(elongation_m) + inertia[0] * increment + past_inertia_n);
        }
        run
    }

    /// The product of `response` on the circle with `series`.
    fn through(&self, response: &[Complex<f64>], series: &[f64]) -> Vec<f64> {
        let spectrum = self.spectrum(series);
        self.series(spectrum.iter().zip(response).map(|(value, k)| value * k).collect(), series.len())
    }

    fn kernel(&self, film: Film<'_>) -> Vec<Complex<f64>> {
        self.ln_s().iter().map(|&ln_s| film.model.modulus_of_ln(ln_s)).collect()
    }

    fn inertia(&self, film: Film<'_>) -> Vec<Complex<f64>> {
        let mass_kg = film.model.mass_kg();
        self.ln_s().iter().map(|&ln_s| (2.0 * ln_s).exp() * mass_kg).collect()
    }
}

/// Displacement and force after every step.
#[derive(Default)]
struct Run {
    displacement_m: Vec<f64>,
    force_n: Vec<f64>,
}

/// A film with a spring in series before a step.
struct Before<'a> {
    film: InSeries<'a>,
    displacement_m: f64,
    /// Force of the inertia per increment (N/m), and that which earlier increments leave (N).
    inertia: f64,
    past_inertia_n: f64,
}

impl Before<'_> {
    fn under(&self, load: &Load<f64>) -> Increments {
        let left = load.force_n + load.slope_n_per_m * self.displacement_m - self.past_inertia_n;
        self.film.under(left, self.inertia - load.slope_n_per_m)
    }
}

/// A film behind a curve on a circle.
pub struct BentFilm<'a> {
    /// K(s) on the circle, N/m.
    pub kernel: &'a [Complex<f64>],
    /// m s² on the circle, N/m.
    pub inertia: &'a [Complex<f64>],
    /// T.
    pub curve: &'a Curve,
    /// E beside the memory, if there is one: the memory's force then has the weight T'.
    pub spring: Option<&'a Spring>,
}

impl BentFilm<'_> {
    /// Force (N) along `displacement` (m).
    pub fn force(&self, circle: &FullMemory, displacement: &[f64]) -> Vec<f64> {
        let at = self.curve.evaluator();
        let stretched: Vec<f64> = displacement.iter().map(|&x| at(x)[0]).collect();
        if let Some(spring) = self.spring {
            let elastic = spring.evaluator();
            let memory = circle.through(self.kernel, &stretched);
            let inertia = circle.through(self.inertia, displacement);
            let forces = displacement.iter().zip(memory).zip(inertia);
            return forces.map(|((&x, m), i)| elastic(x)[0] + at(x)[1] * m + i).collect();
        }
        let (s, x) = (circle.spectrum(&stretched), circle.spectrum(displacement));
        let force = s.iter().zip(self.kernel).zip(x.iter().zip(self.inertia));
        circle.series(force.map(|((s, k), (x, m))| s * k + x * m).collect(), displacement.len())
    }
}

/// The displacement (m) under `loads`, one per step: that of `law`, which is behind the same curve, corrected by passes through the
/// full-memory force of `film`. It has converged when the next pass would change it by at most `tolerance` (RMS, relative).
///
/// # Errors
///
/// [`PullIn`] where the passes do not converge.
pub fn bent_displacement<const HEAD: usize, const FAST: usize, const SLOW: usize>(
    circle: &FullMemory,
    film: &BentFilm<'_>,
    law: &Law<f64, Compressed<f64, HEAD, FAST, SLOW>>,
    loads: &[Load<f64>],
    tolerance: f64,
) -> std::result::Result<Vec<f64>, PullIn> {
    let mut driven = loads.to_vec();
    let mut displacement = stepped(law, &driven);
    let mut before = 1.0;
    for _ in 0..MAX_PASSES {
        let shown = film.force(circle, &displacement);
        for (((driven, load), x), shown) in driven.iter_mut().zip(loads).zip(&displacement).zip(&shown) {
            driven.force_n += load.force_n + load.slope_n_per_m * x - shown;
        }
        let next = stepped(law, &driven);
        let [change, size] = squares(&displacement, &next);
        displacement = next;
        if !size.is_finite() {
            return Err(PullIn);
        }
        // Each pass gains about as much as the one before.
        let share = (change / size).sqrt();
        if size == 0.0 || share * (share / before).min(1.0) <= tolerance {
            return Ok(displacement);
        }
        before = share;
    }
    Err(PullIn)
}

/// Displacements (m) of `law` under `loads`, from rest.
pub fn stepped<const HEAD: usize, const FAST: usize, const SLOW: usize>(
    law: &Law<f64, Compressed<f64, HEAD, FAST, SLOW>>,
    loads: &[Load<f64>],
) -> Vec<f64> {
    let mut state = law.state();
    loads.iter().map(|&load| law.displacement_under(&mut state, load)).collect()
}

fn pulled_in() -> Error {
    Error::Computation(
        "pull-in: the force grows faster with displacement than the film resists; lower stretch_coupling or the voltage"
            .into(),
    )
}
