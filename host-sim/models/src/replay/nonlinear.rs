//! Films behind an elastic curve with full memory: F = K T(x) + m s² x.
//!
//! Along a displacement that is given this is a product in the frequency domain. Under a given force it is implicit: the recursion of
//! a controller is close, and the force that is missing along its answer, computed with full memory, is added to what drives it until
//! nothing is missing.

use num_complex::Complex;
use springpot::{Compressed, Curve, Law, Load, Spring};

use super::coupling::{PullIn, coupled_displacement};
use super::full_memory::FullMemory;
use crate::error::{Error, Result};
use crate::files::parameters::Film;

/// Passes after which a solution is given up. Each gains three digits or more.
const MAX_PASSES: usize = 60;
/// Change of the displacement in a pass at which it has converged (RMS, relative).
const TOLERANCE: f64 = 1e-11;

impl FullMemory {
    /// Force (N) of `film` along `displacement` (m), one value per step from rest.
    pub fn force_along(&self, film: Film<'_>, displacement: &[f64]) -> Vec<f64> {
        let Some(curve) = film.curve else { return self.force(film.model, displacement) };
        let (kernel, inertia) = (self.kernel(film), self.inertia(film));
        BentFilm { kernel: &kernel, inertia: &inertia, curve, spring: film.spring }.force(self, displacement)
    }

    /// Displacement (m) of `film` under `loads` (N, N/m), one per step from rest.
    ///
    /// # Errors
    ///
    /// [`Error::Computation`] for pull-in, and [`Error`] where the law is refused.
    pub fn displacement_under(&self, film: Film<'_>, loads: &[Load<f64>], step_s: f64) -> Result<Vec<f64>> {
        let Some(curve) = film.curve else {
            let start = vec![0.0; loads.len()];
            return coupled_displacement(self, &self.dynamic_stiffness(film.model), loads, start, self.rounding())
                .map_err(|PullIn| pulled_in());
        };
        let (kernel, inertia) = (self.kernel(film), self.inertia(film));
        let law = film.compressed_law::<f64>(1.0 / step_s)?;
        let bent = BentFilm { kernel: &kernel, inertia: &inertia, curve, spring: film.spring };
        let found = bent_displacement(self, &bent, &law, loads, TOLERANCE);
        found.map_err(|PullIn| pulled_in())
    }

    fn kernel(&self, film: Film<'_>) -> Vec<Complex<f64>> {
        self.ln_s().iter().map(|&ln_s| film.model.modulus_of_ln(ln_s)).collect()
    }

    fn inertia(&self, film: Film<'_>) -> Vec<Complex<f64>> {
        let mass_kg = film.model.mass_kg();
        self.ln_s().iter().map(|&ln_s| (2.0 * ln_s).exp() * mass_kg).collect()
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
            let series = |of: &[f64], through: &[Complex<f64>]| {
                let spectrum = circle.spectrum(of);
                circle.series(spectrum.iter().zip(through).map(|(value, k)| value * k).collect(), of.len())
            };
            let (memory, inertia) = (series(&stretched, self.kernel), series(displacement, self.inertia));
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
        let (mut change, mut size) = (0.0, 0.0);
        for (before, after) in displacement.iter().zip(&next) {
            change += (before - after) * (before - after);
            size += after * after;
        }
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
fn stepped<const HEAD: usize, const FAST: usize, const SLOW: usize>(
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
