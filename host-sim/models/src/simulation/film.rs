//! A nonlinear viscoelastic film, simulated, to try models and controllers on.
//!
//! It is deliberately *not* the model of this project: a fit to its recordings is no inverse crime. A strip of VHB 4910 in pure
//! shear (L₀ = 10 mm, W₀ = 49 mm, H₀ = 1 mm), 40/49 of its width under electrodes, is stretched by a weight of 316 g. With λ
//! its stretch, ξ_i the stretch of the dashpots of three Maxwell branches and V the voltage
//!
//! ```text
//! m L₀ λ'' = m g − c_d L₀ λ' − W₀ H₀ [ P_eq + Σ G_i (λ/ξ_i² − ξ_i²/λ³) − (40/49) ε₀ ε_r (V/H₀)² λ ]
//! ξ_i' = ξ_i ((λ/ξ_i)² − (λ/ξ_i)⁻²) / (4 τ_i)
//! P_eq = G_eq g(I₁) (λ − λ⁻³),   I₁ = λ² + 1 + λ⁻²
//! ```
//!
//! with the constants of Hossain et al. 2012 (neo-Hookean, g = 1) or Wang et al. 2016 (Arruda–Boyce).

use std::f64::consts::TAU;

use differential_equations::prelude::{ExplicitRungeKutta, IVP};
use host_io::choice;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use springpot::{EPSILON_0, GRAVITY};

use crate::error::{Error, Result};

choice! {
    /// Which film.
    pub enum Plant {
        /// Constants after Hossain et al. 2012: soft, 5 mm at 6 kV, stretched six times by the weight.
        Hossain = "hossain",
        /// Constants after Wang et al. 2016: stiffening (Arruda–Boyce), 1.6 mm at 6 kV.
        Wang = "wang",
    }
}

const LENGTH_M: f64 = 10e-3;
const WIDTH_M: f64 = 49e-3;
const THICKNESS_M: f64 = 1e-3;
const ELECTRODE_SHARE: f64 = 40.0 / 49.0;
const PERMITTIVITY: f64 = 4.7;
const MASS_KG: f64 = 0.316;
/// Viscous drag on the weight, N·s/m.
const DRAG: f64 = 2.0;

/// λ, λ' and the three ξ.
pub type FilmState = [f64; 5];

/// The film's constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Film {
    equilibrium_pa: f64,
    /// Stretch at which Arruda–Boyce chains are taut, where they are used.
    limit_stretch: Option<f64>,
    /// Modulus (Pa) and relaxation time (s) of the branches.
    branches: [(f64, f64); 3],
    /// Share of the weight that pulls; its inertia stays.
    pull: f64,
    rest_stretch: f64,
}

impl Film {
    /// The film of `plant`.
    pub fn new(plant: Plant) -> Self {
        let mut film = match plant {
            Plant::Hossain => Self {
                // Scaled from 13.7 kPa so that the weight stretches it six times.
                equilibrium_pa: 10.55e3,
                limit_stretch: None,
                branches: [(56.4e3, 0.82), (31.5e3, 10.7), (19.8e3, 500.0)],
                pull: 1.0,
                rest_stretch: 1.0,
            },
            Plant::Wang => Self {
                equilibrium_pa: 15.36e3,
                limit_stretch: Some(5.99),
                branches: [(26.06e3, 0.6074), (26.53e3, 6.56), (10.83e3, 61.25)],
                pull: 1.0,
                rest_stretch: 1.0,
            },
        };
        film.rest_stretch = film.stretch_under_weight();
        film
    }

    /// The film with all its stiffness (springs and branches) times `factor`, at rest where its own weight holds it.
    #[must_use]
    pub fn stiffened(mut self, factor: f64) -> Self {
        self.equilibrium_pa *= factor;
        for (modulus, _) in &mut self.branches {
            *modulus *= factor;
        }
        self.rest_stretch = self.stretch_under_weight();
        self
    }

    /// The film at another temperature: all its stiffness times `stiffness`, all relaxation times times `times`. What stretches it softens
    /// with it, as a film of the same material that pulls against it: it rests where it did.
    #[must_use]
    pub fn warmed(mut self, stiffness: f64, times: f64) -> Self {
        self.equilibrium_pa *= stiffness;
        for (modulus, time) in &mut self.branches {
            *modulus *= stiffness;
            *time *= times;
        }
        self.pull *= stiffness;
        self
    }

    /// The film under another weight of the same inertia, `share` times as heavy, at rest where that holds it.
    #[must_use]
    pub fn loaded(mut self, share: f64) -> Self {
        self.pull *= share;
        self.rest_stretch = self.stretch_under_weight();
        self
    }

    /// Stretch λ₀ at which the film carries the weight at rest.
    pub fn rest_stretch(&self) -> f64 {
        self.rest_stretch
    }

    /// Length at rest under the weight, m.
    pub fn length_m(&self) -> f64 {
        LENGTH_M * self.rest_stretch
    }

    /// Capacitance at rest under the weight, F: of constant volume, as long and as thin as it is there.
    pub fn capacitance_f(&self) -> f64 {
        let area_m2 = ELECTRODE_SHARE * WIDTH_M * self.length_m();
        EPSILON_0 * PERMITTIVITY * area_m2 * self.rest_stretch / THICKNESS_M
    }

    /// The state at rest under the weight.
    pub fn rest(&self) -> FilmState {
        let stretch = self.rest_stretch;
        [stretch, 0.0, stretch, stretch, stretch]
    }

    /// Displacement in m from rest under the weight.
    pub fn displacement_m(&self, state: &FilmState) -> f64 {
        LENGTH_M * (state[0] - self.rest_stretch)
    }

    /// Time derivative of `state` (per second) under `voltage` (V).
    pub fn derivative(&self, voltage: f64, state: &FilmState) -> FilmState {
        let [stretch, speed, ref dashpots @ ..] = *state;
        let field = voltage / THICKNESS_M;
        let mut stress =
            self.equilibrium_stress(stretch) - ELECTRODE_SHARE * EPSILON_0 * PERMITTIVITY * field * field * stretch;
        let mut flow = [0.0; 3];
        for ((flow, &dashpot), &(modulus, time)) in flow.iter_mut().zip(dashpots).zip(&self.branches) {
            let elastic = (stretch / dashpot).powi(2);
            stress += modulus * (elastic / stretch - 1.0 / (elastic * stretch));
            *flow = dashpot * (elastic - 1.0 / elastic) / (4.0 * time);
        }
        let force = self.pull * MASS_KG * GRAVITY - DRAG * LENGTH_M * speed - WIDTH_M * THICKNESS_M * stress;
        [speed, force / (MASS_KG * LENGTH_M), flow[0], flow[1], flow[2]]
    }

    /// States at `times` (s, increasing from 0) under `voltage` (V as a function of s), from `start`.
    ///
    /// # Errors
    ///
    /// [`Error::Computation`] where the film runs away (pull-in) and the integration ends.
    pub fn states(&self, start: FilmState, times: &[f64], voltage: impl Fn(f64) -> f64) -> Result<Vec<FilmState>> {
        let Some((&first, &last)) = times.first().zip(times.last()) else { return Ok(Vec::new()) };
        let derivative = |t: f64, state: &FilmState, slope: &mut FilmState| {
            *slope = self.derivative(voltage(t), state);
        };
        let solution = IVP::ode_from_fn(derivative, first, last, start)
            .t_eval(times)
            .method(ExplicitRungeKutta::dop853().rtol(1e-9).atol(1e-12).max_steps(usize::MAX))
            .solve()
            .map_err(|e| Error::Computation(format!("the film runs away under this voltage (pull-in): {e:?}")))?;
        if solution.y.len() != times.len() || !solution.y.iter().all(|state| self.holds(state)) {
            return Err(Error::Computation("the film runs away under this voltage (pull-in); lower it".into()));
        }
        Ok(solution.y)
    }

    /// The state `duration_s` after `state` under a constant `voltage` (V), in `parts` steps of the classical Runge–Kutta
    /// method, as a control loop needs from tick to tick.
    #[must_use]
    pub fn advanced(&self, state: &FilmState, voltage: f64, duration_s: f64, parts: usize) -> FilmState {
        let step = duration_s / parts as f64;
        let ahead = |state: &FilmState, slope: &FilmState, by: f64| -> FilmState {
            std::array::from_fn(|i| state[i] + by * slope[i])
        };
        let mut state = *state;
        for _ in 0..parts {
            let a = self.derivative(voltage, &state);
            let b = self.derivative(voltage, &ahead(&state, &a, 0.5 * step));
            let c = self.derivative(voltage, &ahead(&state, &b, 0.5 * step));
            let d = self.derivative(voltage, &ahead(&state, &c, step));
            let slope = std::array::from_fn(|i| (a[i] + 2.0 * (b[i] + c[i]) + d[i]) / 6.0);
            state = ahead(&state, &slope, step);
        }
        state
    }

    /// Whether the film is intact in `state`: neither torn nor pulled in.
    #[must_use]
    pub fn holds(&self, state: &FilmState) -> bool {
        state[0] > 0.1 && state[0] < self.largest_stretch()
    }

    fn equilibrium_stress(&self, stretch: f64) -> f64 {
        let stiffening = self.limit_stretch.map_or(1.0, |limit| {
            let invariant = stretch * stretch + 1.0 + 1.0 / (stretch * stretch);
            let chain = (invariant / 3.0).sqrt();
            let z = chain / limit;
            // Inverse Langevin function, Cohen's approximation.
            limit / (3.0 * chain) * z * (3.0 - z * z) / (1.0 - z * z)
        });
        self.equilibrium_pa * stiffening * (stretch - stretch.powi(-3))
    }

    /// Stretch beyond which the film has torn, or its chains are taut.
    fn largest_stretch(&self) -> f64 {
        self.limit_stretch.map_or(12.0, |limit| 0.99 * limit * 3f64.sqrt())
    }

    fn stretch_under_weight(&self) -> f64 {
        let pull = self.pull * MASS_KG * GRAVITY / (WIDTH_M * THICKNESS_M);
        let (mut low, mut high) = (1.0, self.largest_stretch());
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if self.equilibrium_stress(middle) > pull {
                high = middle;
            } else {
                low = middle;
            }
        }
        0.5 * (low + high)
    }
}

/// A unipolar voltage, `V̂/2 (1 − mean of cos 2πft)` over its frequencies.
#[derive(Clone, Debug, PartialEq)]
pub struct Waveform {
    /// Peak V̂ in V.
    pub peak_v: f64,
    /// Frequencies f in Hz.
    pub frequencies_hz: Vec<f64>,
}

impl Waveform {
    /// The voltage at `time_s`, V.
    pub fn voltage_v(&self, time_s: f64) -> f64 {
        let tones = self.frequencies_hz.iter().map(|f| (TAU * f * time_s).cos());
        0.5 * self.peak_v * (1.0 - tones.sum::<f64>() / self.frequencies_hz.len() as f64)
    }
}

/// Noise and resolution of the bench's instruments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instruments {
    /// RMS noise of the displacement sensor, m.
    pub displacement_noise_m: f64,
    /// Resolution of the displacement sensor, m; 0 for none.
    pub displacement_quantum_m: f64,
    /// RMS noise of the voltage monitor, V.
    pub monitor_noise_v: f64,
}

impl Default for Instruments {
    fn default() -> Self {
        Self { displacement_noise_m: 5e-6, displacement_quantum_m: 1e-6, monitor_noise_v: 3.0 }
    }
}

/// Readings of the instruments, noise from a seed.
#[derive(Debug)]
pub struct Readings {
    instruments: Instruments,
    random: Pcg64,
}

impl Readings {
    /// Readings of `instruments`; the same seed gives the same noise.
    pub fn new(instruments: Instruments, seed: u64) -> Self {
        Self { instruments, random: Pcg64::seed_from_u64(seed) }
    }

    /// The displacement sensor's reading (m) at `displacement` (m).
    pub fn displacement_m(&mut self, displacement: f64) -> f64 {
        let noisy = displacement + self.noise(self.instruments.displacement_noise_m);
        let quantum = self.instruments.displacement_quantum_m;
        if quantum > 0.0 { (noisy / quantum).round() * quantum } else { noisy }
    }

    /// The voltage monitor's reading (V) at `voltage` (V).
    pub fn voltage_v(&mut self, voltage: f64) -> f64 {
        voltage + self.noise(self.instruments.monitor_noise_v)
    }

    fn noise(&mut self, rms: f64) -> f64 {
        let unit: f64 = StandardNormal.sample(&mut self.random);
        rms * unit
    }
}
