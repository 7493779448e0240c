//! A rate-dependent Prandtl–Ishlinskii model: hysteresis from play operators, for comparison.
//!
//! After J. Zou and G. Gu, "Modeling the Viscoelastic Hysteresis of Dielectric Elastomer Actuators with a Modified
//! Rate-Dependent Prandtl–Ishlinskii Model", Polymers 2018, 10, 525, as used for feedforward control: a cubic polynomial
//! of the input plus one-sided play operators whose thresholds grow with the input's rate,
//!
//! ```text
//! x = a₁ u + a₂ u² + a₃ u³ + Σ_i b_i P_i + x₀,     P_i ← max(u − r_i, min(u, P_i)),     r_i = i/(n+1) + β |u̇|,     b_i ≥ 0
//! ```
//!
//! with u the squared voltage (Eq. 1's force) over its largest value. It depends on the input's rate and its turning points,
//! but not on time: it has no creep.

use crate::agreement::Agreement;
use crate::error::Result;
use crate::files::recording::Input;
use crate::fit::observation::Observation;
use crate::grid::Grid;
use crate::least_squares::{self, Problem, StoppingCriteria};

const OPERATORS: usize = 10;

/// a₁, a₂, a₃, b_1…b_n, x₀ (m) and ln β (ln s).
const PARAMETERS: usize = 3 + OPERATORS + 2;

/// A fitted model.
#[derive(Clone, Debug, PartialEq)]
pub struct PrandtlIshlinskii {
    /// a₁, a₂, a₃, b_1…b_n, x₀ and ln β.
    values: [f64; PARAMETERS],
    /// Load at u = 1: V² or N.
    largest: f64,
}

/// An observation with its load on a grid.
struct LoadedObservation<'a> {
    observation: &'a Observation,
    grid: Grid,
    /// V² or N.
    load: Vec<f64>,
}

impl<'a> LoadedObservation<'a> {
    fn new(observation: &'a Observation) -> Result<Self> {
        let samples = observation.input.samples();
        let grid = Grid::covering(samples.time_s.last().copied().unwrap_or(0.0), observation.rate_hz)?;
        let values = grid.resample(samples);
        let load = match observation.input {
            Input::Voltage(_) => values.iter().map(|v| v * v).collect(),
            Input::Force(_) | Input::Displacement(_) => values,
        };
        Ok(Self { observation, grid, load })
    }

    /// 1, u, u², u³ and the play operators at the measured times.
    fn basis(&self, largest: f64, beta: f64) -> Vec<Vec<f64>> {
        let mut columns: Vec<Vec<f64>> = (0..3 + OPERATORS).map(|_| Vec::with_capacity(self.load.len())).collect();
        let mut plays = Plays::default();
        let mut before = self.load[0] / largest;
        for load in &self.load {
            let u = load / largest;
            plays.step(u, beta * ((u - before) * self.grid.rate_hz).abs());
            before = u;
            for (column, value) in columns.iter_mut().zip([u, u * u, u * u * u].iter().chain(&plays.0)) {
                column.push(*value);
            }
        }
        columns.iter().map(|column| self.grid.at(column, &self.observation.measured.time_s)).collect()
    }
}

/// One-sided play operators.
#[derive(Default)]
struct Plays([f64; OPERATORS]);

impl Plays {
    fn step(&mut self, u: f64, widening: f64) {
        for (i, play) in self.0.iter_mut().enumerate() {
            let threshold = (i + 1) as f64 / (OPERATORS + 1) as f64 + widening;
            *play = (u - threshold).max(play.min(u));
        }
    }
}

impl PrandtlIshlinskii {
    /// Number of fitted quantities.
    pub const PARAMETERS: usize = PARAMETERS;

    /// The least-squares fit to `observations`.
    pub fn fit(observations: &[Observation]) -> Result<Self> {
        let loaded = observations.iter().map(LoadedObservation::new).collect::<Result<Vec<_>>>()?;
        let largest = loaded
            .iter()
            .flat_map(|observation| &observation.load)
            .fold(f64::MIN_POSITIVE, |most, load| most.max(load.abs()));
        let fit = Regression { loaded, largest };
        let best = [-6.0, -3.0, -1.0, 1.0]
            .into_iter()
            .filter_map(|ln_beta| {
                let mut start = [0.0; PARAMETERS];
                start[PARAMETERS - 1] = ln_beta;
                least_squares::minimise(&fit, &start, StoppingCriteria { iterations: 60, decrease: 1e-8 })
            })
            .min_by(|a, b| a.cost.total_cmp(&b.cost));
        let mut values = [0.0; PARAMETERS];
        if let Some(best) = best {
            values.copy_from_slice(&best.values);
        }
        Ok(Self { values, largest })
    }

    /// Agreement with an observation.
    pub fn agreement(&self, observation: &Observation) -> Result<Agreement> {
        let run = LoadedObservation::new(observation)?;
        let modelled = modelled(&run.basis(self.largest, self.values[PARAMETERS - 1].exp()), &self.values);
        Ok(Agreement::new(&observation.measured.value, &modelled))
    }

    /// Calls `take` with the displacement (m) under each of `loads` (V² or N), one per step at `rate_hz`, in f32 as on a
    /// controller.
    pub fn steps_f32(&self, loads: &[f32], rate_hz: f32, mut take: impl FnMut(f32)) {
        let values = self.values.map(|value| value as f32);
        let (beta, largest) = (values[PARAMETERS - 1].exp() * rate_hz, self.largest as f32);
        let mut plays = [0f32; OPERATORS];
        let mut before = 0.0;
        for load in loads {
            let u = load / largest;
            let widening = beta * (u - before).abs();
            before = u;
            let mut x = values[PARAMETERS - 2] + u * (values[0] + u * (values[1] + u * values[2]));
            for (i, (play, weight)) in plays.iter_mut().zip(&values[3..]).enumerate() {
                let threshold = (i + 1) as f32 / (OPERATORS + 1) as f32 + widening;
                *play = (u - threshold).max(play.min(u));
                x += weight * *play;
            }
            take(x);
        }
    }
}

fn modelled(basis: &[Vec<f64>], values: &[f64]) -> Vec<f64> {
    let mut sum = vec![values[PARAMETERS - 2]; basis[0].len()];
    for (column, weight) in basis.iter().zip(values) {
        sum.iter_mut().zip(column).for_each(|(sum, value)| *sum += weight * value);
    }
    sum
}

struct Regression<'a> {
    loaded: Vec<LoadedObservation<'a>>,
    largest: f64,
}

impl Regression<'_> {
    fn bases(&self, ln_beta: f64) -> Vec<Vec<Vec<f64>>> {
        self.loaded.iter().map(|run| run.basis(self.largest, ln_beta.exp())).collect()
    }
}

impl Problem for Regression<'_> {
    type Evaluation = Vec<Vec<Vec<f64>>>;

    fn residuals(&self, values: &[f64]) -> Option<(Vec<f64>, Self::Evaluation)> {
        let bases = self.bases(values[PARAMETERS - 1]);
        let residuals = self
            .loaded
            .iter()
            .zip(&bases)
            .flat_map(|(run, basis)| {
                let pairs = modelled(basis, values).into_iter().zip(&run.observation.measured.value);
                pairs.map(|(model, y)| run.observation.weight * (model - y)).collect::<Vec<_>>()
            })
            .collect();
        Some((residuals, bases))
    }

    fn jacobian(&self, values: &[f64], bases: &Self::Evaluation) -> Vec<Vec<f64>> {
        let weighted = |values: &dyn Fn(usize) -> Vec<f64>| -> Vec<f64> {
            (0..self.loaded.len())
                .flat_map(|run| {
                    let weight = self.loaded[run].observation.weight;
                    values(run).into_iter().map(move |value| weight * value)
                })
                .collect()
        };
        let mut columns: Vec<Vec<f64>> = (0..3 + OPERATORS).map(|k| weighted(&|run| bases[run][k].clone())).collect();
        columns.push(weighted(&|run| vec![1.0; bases[run][0].len()]));
        // The thresholds' slope by differences: the operators have kinks.
        let step = 1e-3;
        let moved = self.bases(values[PARAMETERS - 1] + step);
        columns.push(weighted(&|run| {
            let pairs = modelled(&moved[run], values).into_iter().zip(modelled(&bases[run], values));
            pairs.map(|(after, before)| (after - before) / step).collect()
        }));
        columns
    }

    fn bounds(&self) -> &[(f64, f64)] {
        const FREE: (f64, f64) = (-1e3, 1e3);
        const BOUNDS: [(f64, f64); PARAMETERS] = {
            let mut bounds = [FREE; PARAMETERS];
            let mut i = 3;
            while i < 3 + OPERATORS {
                bounds[i] = (0.0, 1e3);
                i += 1;
            }
            bounds[PARAMETERS - 1] = (-15.0, 5.0);
            bounds
        };
        &BOUNDS
    }
}
