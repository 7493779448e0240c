//! Films whose force bends with the displacement: their answer as a nonlinear sum over all that was, and what is stepped against it.

use std::f64::consts::TAU;

use springpot::{
    Actuator, Applied, CommandLimits, Curve, Feedforward, Knot, Law, Load, Maxwell, Measure, Real, Spring, Springpot,
    Topology,
};

use super::defining_sum::modulus_series;
use super::relative_rms;

pub const STEP_S: f64 = 1e-3;

/// A springpot, and a spring in series with another springpot.
pub fn film(mass_kg: f64) -> Maxwell {
    let sp = Springpot::new;
    Maxwell::new(sp(9e3, 0.2), &[[sp(1.1e4, 0.0), sp(9e3, 0.9)]], Topology::Parallel, mass_kg).expect("valid")
}

/// The coefficients of x + a x² + b x³: stiffer by 2.4 at 3 mm.
const BEND: [f64; 2] = [150.0, 1.9e4];

pub fn bent(x: f64) -> f64 {
    x + BEND[0] * x * x + BEND[1] * x * x * x
}

pub fn bent_slope(x: f64) -> f64 {
    1.0 + 2.0 * BEND[0] * x + 3.0 * BEND[1] * x * x
}

/// Knots of a cubic with this value and slope, which is one piece or several.
fn knots(low: f64, high: f64, pieces: usize, at: impl Fn(f64) -> [f64; 2]) -> Vec<Knot<f64>> {
    (0..=pieces)
        .map(|k| low + (high - low) * k as f64 / pieces as f64)
        .map(|x| Knot { displacement: x, value: at(x)[0], slope: at(x)[1] })
        .collect()
}

pub fn cubic(low: f64, high: f64, pieces: usize) -> Curve {
    Curve::new(&knots(low, high, pieces, |x| [bent(x), bent_slope(x)])).expect("rises")
}

/// 6 kN/m at rest, softer, then stiffer.
pub fn elastic(x: f64) -> [f64; 2] {
    [6e3 * x * (1.0 - 150.0 * x + 3e4 * x * x), 6e3 * (1.0 - 300.0 * x + 9e4 * x * x)]
}

pub fn spring(pieces: usize) -> Spring {
    Spring::new(&knots(-1e-3, 6e-3, pieces, elastic)).expect("valid")
}

/// Length of a short film, in whose strain the curvature of the measure matters.
const LENGTH_M: f64 = 0.02;

/// Hencky's strain of that film.
pub fn hencky() -> Curve {
    Measure { exponent: 0.0, length_m: LENGTH_M }.curve(-1e-3, 6e-3).expect("rises")
}

pub fn strain(x: f64) -> [f64; 2] {
    [LENGTH_M * (x / LENGTH_M).ln_1p(), 1.0 / (1.0 + x / LENGTH_M)]
}

/// A force (N) that swings from 0 to 44 N after a soft start.
pub fn load(k: usize) -> f64 {
    let t = k as f64 * STEP_S;
    22.0 * (1.0 - (TAU * 0.8 * t).cos()) * (1.0 - (-t / 0.3).exp())
}

/// A force (N) over the elongation of a spring in series, and its slope: three times as stiff at 1 mm.
pub fn stiffening(e: f64) -> [f64; 2] {
    [1.5e4 * e * (1.0 + 7e5 * e * e), 1.5e4 * (1.0 + 2.1e6 * e * e)]
}

pub fn in_series(pieces: usize) -> Spring {
    Spring::new(&knots(-0.5e-3, 2e-3, pieces, stiffening)).expect("valid")
}

/// A film with the memory of `model` on its `strain` (m), that resists with a force (N) of displacement and memory. The strain is that at a displacement, for a
/// memory that resists with a force (N) and a stiffness (N/m).
pub struct Bent<'a> {
    pub model: &'a Maxwell,
    pub strain: &'a dyn Fn(f64, [f64; 2]) -> f64,
    pub resists: &'a dyn Fn(f64, f64) -> f64,
}

/// The strain of a memory in series with the stiffening spring, by bisection.
pub fn left_in_series(x: f64, [past, instant]: [f64; 2]) -> f64 {
    let (mut low, mut high) = (x - 8e-3, x + 8e-3);
    while high - low > 1e-16 {
        let middle = 0.5 * (low + high);
        if middle == low || middle == high {
            break;
        }
        if past + instant * middle > stiffening(x - middle)[0] { high = middle } else { low = middle }
    }
    0.5 * (low + high)
}

impl Bent<'_> {
    /// Displacements (m) under `force` (N) of step and displacement: the sum over all steps, solved by bisection.
    pub fn by_the_sum(&self, force: impl Fn(usize, f64) -> f64, samples: usize) -> Vec<f64> {
        let model = self.model;
        let massless = Maxwell::new(model.main(), model.branches(), model.topology(), 0.0).expect("valid");
        let modulus = modulus_series(&massless, STEP_S, samples);
        let inertia = model.mass_kg() / (STEP_S * STEP_S);
        let (mut x, mut s) = (Vec::<f64>::new(), Vec::<f64>::new());
        for k in 0..samples {
            let past: f64 = (1..=k).map(|j| modulus[j] * s[k - j]).sum();
            let before = |j: usize| if k >= j { x[k - j] } else { 0.0 };
            let left = |x: f64| {
                let memory = modulus[0] * (self.strain)(x, [past, modulus[0]]) + past;
                (self.resists)(x, memory) + inertia * (x - 2.0 * before(1) + before(2)) - force(k, x)
            };
            let (mut low, mut high) = (-1e-3, 8e-3);
            while high - low > 1e-15 {
                let middle = 0.5 * (low + high);
                if left(middle) > 0.0 { high = middle } else { low = middle }
            }
            x.push(0.5 * (low + high));
            s.push((self.strain)(x[k], [past, modulus[0]]));
        }
        x
    }

    /// Error of the film itself, with the drive as Eq. 1 has it, under the voltages of feedforward with `law`, which follows a sine of 0.1 mm
    /// about `centre_m` and may be limited in its first `starting` steps.
    pub fn feedforward_error(&self, law: Law<f32>, actuator: &Actuator, centre_m: f64, starting: usize) -> f64 {
        let feedforward = Feedforward::new(law, actuator, CommandLimits::BENCH).expect("valid");
        let reference = |k: usize| {
            let t = k as f64 * STEP_S;
            (centre_m - 0.1e-3 * (TAU * 0.5 * t).cos()) * (1.0 - (-t).exp())
        };
        let mut state = feedforward.state(feedforward.law().state());
        let mut volts = Vec::new();
        for k in 1..=4000 {
            let command = feedforward.command(&mut state, reference(k) as f32);
            assert!(command.limited.is_none() || k < starting, "step {k}: {}", command.limited);
            volts.push(f64::from(command.voltage_v));
            feedforward.apply(&mut state, Applied::as_commanded(command.voltage_v));
        }
        let followed = self.by_the_sum(|k, x| actuator.force(volts[k], x), volts.len());
        let wanted: Vec<f64> = (1..=4000).map(reference).collect();
        // The start is a jump of the speed, which the path takes smoothly.
        relative_rms(&followed[1000..], &wanted[1000..])
    }
}

/// Displacements (m) of `law` under the loads of the steps.
pub fn run<T: Real>(law: &Law<T>, load: impl Fn(usize) -> Load<f64>, samples: usize) -> Vec<f64> {
    let mut state = law.state();
    let step = |k| {
        let Load { force_n, slope_n_per_m } = load(k);
        let load = Load { force_n: T::from_f64(force_n), slope_n_per_m: T::from_f64(slope_n_per_m) };
        law.displacement_under(&mut state, load).to_f64()
    };
    (0..samples).map(step).collect()
}
