//! The exact answer with full memory, by FFT.
//!
//! In the Grünwald–Letnikov discretisation a response is a quotient of power series in the delay ζ. On a circle |ζ| = r
//! slightly inside the unit circle these are Fourier transforms of r^k times the samples, and (1 − ζ)/h is s. The model's
//! K(s) is evaluated here from its springpots, not by the library.

use host_fft::Planner;
use num_complex::Complex;
use springpot::{Maxwell, Springpot, Topology};

/// A circle for responses of up to `samples` samples.
pub struct FullMemory {
    samples: usize,
    points: usize,
    /// ln r.
    ln_radius: f64,
    /// ln s on the upper half circle, (1 − ζ)/h or what the method has instead.
    ln_s: Vec<Complex<f64>>,
}

impl FullMemory {
    /// The circle for `samples` samples at `step_s`.
    ///
    /// With p points and N samples what wraps around shrinks by r^p and rounding grows by r^−N. Both are equal for
    /// ln r = ln ε / (p + N); with p ≥ 4 N that leaves 1e-12.
    pub fn new(samples: usize, step_s: f64) -> Self {
        Self::discretised(samples, step_s, |difference| difference.ln())
    }

    /// The same for s = (3 − 4ζ + ζ²)/2h = (1 − ζ)(1 + (1 − ζ)/2)/h instead of (1 − ζ)/h.
    pub fn of_second_order(samples: usize, step_s: f64) -> Self {
        Self::discretised(samples, step_s, |difference| difference.ln() + (0.5 * difference + 1.0).ln())
    }

    /// `ln_delta` is the logarithm of h s, from 1 − ζ.
    fn discretised(samples: usize, step_s: f64, ln_delta: impl Fn(Complex<f64>) -> Complex<f64>) -> Self {
        let points = (4 * samples).next_power_of_two();
        let ln_radius = f64::EPSILON.ln() / (points + samples) as f64;
        let ln_s = (0..=points / 2)
            .map(|k| {
                let ln_zeta = Complex::new(ln_radius, -std::f64::consts::TAU * k as f64 / points as f64);
                ln_delta(minus_expm1(ln_zeta)) - step_s.ln()
            })
            .collect();
        Self { samples, points, ln_radius, ln_s }
    }

    /// Displacement (m) of `model` under `force` (N), one value per step from rest.
    pub fn displacement(&self, model: &Maxwell, force: &[f64]) -> Vec<f64> {
        self.filter(force, |ln_s| stiffness(model, ln_s).inv())
    }

    /// Force (N) of `model` along `displacement` (m), one value per step from rest.
    pub fn force(&self, model: &Maxwell, displacement: &[f64]) -> Vec<f64> {
        self.filter(displacement, |ln_s| stiffness(model, ln_s))
    }

    fn filter(&self, input: &[f64], transfer: impl Fn(Complex<f64>) -> Complex<f64>) -> Vec<f64> {
        assert!(input.len() <= self.samples);
        let mut planner = Planner::new();
        let damping = |k: usize| (self.ln_radius * k as f64).exp();
        let mut time: Vec<f64> = input.iter().enumerate().map(|(k, value)| value * damping(k)).collect();
        time.resize(self.points, 0.0);
        let mut spectrum = vec![Complex::ZERO; self.points / 2 + 1];
        planner.forward(self.points).process(&mut time, &mut spectrum).expect("lengths fit");
        spectrum.iter_mut().zip(&self.ln_s).for_each(|(value, &ln_s)| *value *= transfer(ln_s));
        // Both ends are real, up to rounding.
        spectrum[0].im = 0.0;
        spectrum[self.points / 2].im = 0.0;
        planner.backward(self.points).process(&mut spectrum, &mut time).expect("lengths fit");
        let unscaled = self.points as f64;
        time.iter().take(input.len()).enumerate().map(|(k, value)| value / (unscaled * damping(k))).collect()
    }
}

/// m s² + K(s), N/m (Eq. 11 and its parallel form).
fn stiffness(model: &Maxwell, ln_s: Complex<f64>) -> Complex<f64> {
    let modulus = |element: Springpot| (ln_s * element.alpha).exp() * element.c;
    let compliance = |pair: &[Springpot; 2]| modulus(pair[0]).inv() + modulus(pair[1]).inv();
    let branches = model.branches();
    let of_branches: Complex<f64> = match model.topology() {
        _ if branches.is_empty() => Complex::ZERO,
        Topology::Eq11 => branches.iter().map(compliance).sum::<Complex<f64>>().inv() * branches.len() as f64,
        Topology::Parallel => branches.iter().map(|pair| compliance(pair).inv()).sum(),
    };
    (ln_s * 2.0).exp() * model.mass_kg() + modulus(model.main()) + of_branches
}

/// 1 − e^z without cancellation near z = 0.
fn minus_expm1(z: Complex<f64>) -> Complex<f64> {
    let half = (0.5 * z.im).sin();
    Complex::new(2.0 * half * half - z.re.exp_m1() * z.im.cos(), -z.re.exp() * z.im.sin())
}
