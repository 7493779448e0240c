//! The objective of a fit: model minus measurement over all recordings, and its exact derivatives.
//!
//! Runs are computed with full memory in the frequency domain. A model without coupling is a product there, and so are its
//! derivatives with respect to every c and α. With coupling the force depends on the answer,
//! `x = H (F (1 + κ x) + W)`; the compressed recursion solves that in one pass over the samples, and passes through H
//! remove its last error. The derivatives obey the same equation with other right-hand sides.

use num_complex::Complex;
use rayon::prelude::*;

use super::candidate::{Candidate, Variable};
use super::transfer::{Spectrum, Transfer, coupled, recursion};
use crate::error::{Error, Result};
use crate::files::recording::Input;
use crate::grid::{Grid, Samples};
use crate::replay::full_memory::FullMemory;

/// A recording as a fit sees it.
#[derive(Clone, Debug)]
pub struct Observation {
    /// What the recording is called.
    pub name: String,
    /// What drove the film.
    pub input: Input,
    /// What was measured: displacement, or force where displacement drove.
    pub measured: Samples,
    /// Steps per second.
    pub rate_hz: f64,
    /// How much it counts.
    pub weight: f64,
}

fn too_long(name: &str, samples: f64) -> Error {
    Error::Computation(format!(
        "{name}: {samples:.0} steps at its usual rate; a fit takes {MOST_SAMPLES} at the most, cut the recording or thin it"
    ))
}

/// Samples of a recording that a fit takes: each costs about a kilobyte.
const MOST_SAMPLES: usize = 1 << 22;

/// Model minus measurement over all observations.
pub struct Objective {
    circles: Vec<FullMemory>,
    steps: Vec<f64>,
    records: Vec<Record>,
}

/// An observation on its grid.
struct Record {
    name: String,
    circle: usize,
    samples: usize,
    drive: Drive,
    measured: Vec<f64>,
    places: Places,
    weight: f64,
}

enum Drive {
    /// Squared voltage, V².
    Voltage { squared: Vec<f64>, spectrum: Spectrum, ones: Spectrum },
    /// Force, as a spectrum.
    Force(Spectrum),
    /// Displacement, as a spectrum.
    Displacement(Spectrum),
}

/// Where the measured samples lie on the grid.
enum Places {
    /// One on every grid point.
    All,
    /// Between a grid point and the next, by a share of the step.
    Between(Vec<(usize, f64)>),
}

impl Places {
    fn new(times: &[f64], grid: Grid) -> Self {
        let places: Vec<(usize, f64)> = times
            .iter()
            .map(|t| {
                let place = (t * grid.rate_hz).clamp(0.0, (grid.samples - 1) as f64);
                let before = (place as usize).min(grid.samples.saturating_sub(2));
                (before, place - before as f64)
            })
            .collect();
        let on_the_grid =
            |(k, &(before, share)): (usize, &(usize, f64))| (before as f64 + share - k as f64).abs() < 1e-6;
        if places.len() == grid.samples && places.iter().enumerate().all(on_the_grid) {
            Self::All
        } else {
            Self::Between(places)
        }
    }

    fn pick(&self, series: &[f64]) -> Vec<f64> {
        match self {
            Self::All => series.to_vec(),
            Self::Between(places) => places
                .iter()
                .map(|&(before, share)| {
                    let after = series[(before + 1).min(series.len() - 1)];
                    series[before] + share * (after - series[before])
                })
                .collect(),
        }
    }
}

/// A candidate's responses, with what its derivatives need.
pub struct Evaluation {
    /// Modelled values at the measured times, one series per observation.
    pub modelled: Vec<Vec<f64>>,
    transfers: Vec<Transfer>,
    /// Displacement on the grid.
    displacement: Vec<Vec<f64>>,
}

impl Objective {
    /// The objective over `observations`.
    ///
    /// # Errors
    ///
    /// [`Error`] for no observations, or one that is too long for its rate.
    pub fn new(observations: &[Observation]) -> Result<Self> {
        if observations.is_empty() {
            return Err(Error::Computation("there is nothing to fit".into()));
        }
        let grids = observations
            .iter()
            .map(|o| {
                let duration_s = o.input.samples().time_s.last().copied().unwrap_or(0.0);
                Grid::covering(duration_s, o.rate_hz).map_err(|_| too_long(&o.name, duration_s * o.rate_hz))
            })
            .collect::<Result<Vec<Grid>>>()?;
        if let Some((long, grid)) = observations.iter().zip(&grids).find(|(_, grid)| grid.samples > MOST_SAMPLES) {
            return Err(too_long(&long.name, grid.samples as f64));
        }
        // Recordings of one rate share a circle for the longest of them.
        let mut circles: Vec<FullMemory> = Vec::new();
        let mut steps: Vec<f64> = Vec::new();
        for grid in &grids {
            if !steps.contains(&grid.step_s()) {
                let same = grids.iter().filter(|other| other.rate_hz == grid.rate_hz);
                let longest = same.map(|other| other.samples).max().unwrap_or(grid.samples);
                circles.push(FullMemory::with_oversampling(longest, grid.step_s(), 2));
                steps.push(grid.step_s());
            }
        }
        let records = observations
            .iter()
            .zip(grids)
            .map(|(observation, grid)| {
                let circle = steps.iter().position(|&step| step == grid.step_s()).unwrap_or(0);
                let memory = &circles[circle];
                let values = grid.resample(observation.input.samples());
                let drive = match observation.input {
                    Input::Voltage(_) => {
                        let squared: Vec<f64> = values.iter().map(|v| v * v).collect();
                        let spectrum = memory.spectrum(&squared);
                        Drive::Voltage { squared, spectrum, ones: memory.spectrum(&vec![1.0; grid.samples]) }
                    }
                    Input::Force(_) => Drive::Force(memory.spectrum(&values)),
                    Input::Displacement(_) => Drive::Displacement(memory.spectrum(&values)),
                };
                Record {
                    name: observation.name.clone(),
                    circle,
                    samples: grid.samples,
                    drive,
                    measured: observation.measured.value.clone(),
                    places: Places::new(&observation.measured.time_s, grid),
                    weight: observation.weight,
                }
            })
            .collect();
        Ok(Self { circles, steps, records })
    }

    /// Names of the observations.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.records.iter().map(|record| record.name.as_str())
    }

    /// Measured values of every observation.
    pub fn measured(&self) -> impl Iterator<Item = &[f64]> {
        self.records.iter().map(|record| record.measured.as_slice())
    }

    /// Number of measured values.
    pub fn samples(&self) -> usize {
        self.records.iter().map(|record| record.measured.len()).sum()
    }

    /// The responses of `candidate`, or nothing where it has none: elements out of range, pull-in, overflow.
    pub fn evaluate(&self, candidate: &Candidate) -> Option<Evaluation> {
        let model = candidate.model().ok()?;
        candidate.actuator.check().ok()?;
        let coupled = candidate.actuator.stretch_coupling > 0.0;
        let transfers = self
            .circles
            .iter()
            .zip(&self.steps)
            .map(|(circle, &step)| Transfer::new(&model, circle, step, coupled))
            .collect::<Option<Vec<Transfer>>>()?;
        let responses = self
            .records
            .par_iter()
            .map(|record| self.respond(record, candidate, &transfers[record.circle]))
            .collect::<Option<Vec<(Vec<f64>, Vec<f64>)>>>()?;
        let (modelled, displacement) = responses.into_iter().unzip();
        Some(Evaluation { modelled, transfers, displacement })
    }

    /// Modelled values and displacement on the grid.
    fn respond(&self, record: &Record, candidate: &Candidate, transfer: &Transfer) -> Option<(Vec<f64>, Vec<f64>)> {
        let circle = &self.circles[record.circle];
        let series = match &record.drive {
            Drive::Displacement(path) => {
                let force = path.iter().zip(&transfer.stiffness).map(|(x, k)| x * k).collect();
                circle.series(force, record.samples)
            }
            Drive::Force(force) => {
                let x = force.iter().zip(&transfer.compliance).map(|(f, h)| f * h).collect();
                circle.series(x, record.samples)
            }
            Drive::Voltage { squared, spectrum, ones } => {
                let scale = candidate.actuator.force_per_square_volt();
                let weight = candidate.actuator.preload_n();
                match &transfer.law {
                    None => {
                        let x = spectrum
                            .iter()
                            .zip(ones)
                            .zip(&transfer.compliance)
                            .map(|((f, one), h)| (f * scale + one * weight) * h)
                            .collect();
                        circle.series(x, record.samples)
                    }
                    Some(law) => {
                        let force: Vec<f64> = squared.iter().map(|v2| scale * v2 + weight).collect();
                        let pull = scale * candidate.actuator.stretch_coupling;
                        coupled(circle, transfer, law, squared, pull, &force)?
                    }
                }
            }
        };
        series.iter().all(|value| value.is_finite()).then(|| {
            let modelled = match record.drive {
                Drive::Displacement(_) => record.places.pick(&series),
                _ => record.places.pick(&series).into_iter().map(|x| candidate.sensor().reading_m(x)).collect(),
            };
            (modelled, series)
        })
    }

    /// Model minus measurement, weighted, all observations in a row.
    pub fn residuals(&self, evaluation: &Evaluation) -> Vec<f64> {
        let mut residuals = Vec::with_capacity(self.samples());
        for (record, modelled) in self.records.iter().zip(&evaluation.modelled) {
            residuals.extend(modelled.iter().zip(&record.measured).map(|(model, y)| record.weight * (model - y)));
        }
        residuals
    }

    /// Derivatives of the residuals with respect to `variables`, one column each.
    pub fn jacobian(&self, candidate: &Candidate, evaluation: &Evaluation, variables: &[Variable]) -> Vec<Vec<f64>> {
        // What one variable does to one observation is one task.
        let pieces: Vec<Vec<f64>> = (0..variables.len() * self.records.len())
            .into_par_iter()
            .map(|task| {
                let (variable, record) = (variables[task / self.records.len()], task % self.records.len());
                self.derivative(candidate, evaluation, variable, record)
            })
            .collect();
        pieces.chunks(self.records.len()).map(<[Vec<f64>]>::concat).collect()
    }

    fn derivative(&self, candidate: &Candidate, evaluation: &Evaluation, variable: Variable, index: usize) -> Vec<f64> {
        let record = &self.records[index];
        let circle = &self.circles[record.circle];
        let transfer = &evaluation.transfers[record.circle];
        let forced = !matches!(record.drive, Drive::Displacement(_));
        let weighted = |series: &[f64]| -> Vec<f64> {
            record.places.pick(series).into_iter().map(|value| record.weight * value).collect()
        };
        let nothing = || vec![0.0; record.measured.len()];
        let actuator = &candidate.actuator;
        // The right-hand side: a force spectrum that, put through the film, is the derivative.
        let x = &evaluation.displacement[index];
        let modulus_change = |element: usize| -> Box<dyn Fn(usize) -> Complex<f64> + Sync> {
            let sensitivity = &transfer.sensitivities[element];
            match variable {
                Variable::Order(_) => Box::new(move |j| sensitivity[j] * circle.ln_s()[j]),
                _ => Box::new(move |j| sensitivity[j]),
            }
        };
        let spectrum: Spectrum = match variable {
            Variable::Offset if forced => return vec![record.weight; record.measured.len()],
            Variable::Coefficient(element) | Variable::Order(element) => {
                let change = modulus_change(element);
                match &record.drive {
                    Drive::Displacement(path) => {
                        let force = path.iter().enumerate().map(|(j, x)| x * change(j)).collect();
                        return weighted(&circle.series(force, record.samples));
                    }
                    Drive::Force(force) => force
                        .iter()
                        .zip(&transfer.compliance)
                        .enumerate()
                        .map(|(j, (f, h))| -f * h * change(j))
                        .collect(),
                    Drive::Voltage { .. } => {
                        circle.spectrum(x).into_iter().enumerate().map(|(j, x)| -x * change(j)).collect()
                    }
                }
            }
            Variable::StretchCoupling => match &record.drive {
                Drive::Voltage { squared, .. } => {
                    let scale = actuator.force_per_square_volt();
                    let force: Vec<f64> = squared.iter().zip(x).map(|(v2, x)| scale * v2 * x).collect();
                    circle.spectrum(&force)
                }
                _ => return nothing(),
            },
            Variable::Mass => {
                let inertia = |j: usize| (2.0 * circle.ln_s()[j]).exp() * actuator.mass_kg;
                match &record.drive {
                    Drive::Displacement(path) => {
                        let force = path.iter().enumerate().map(|(j, x)| x * inertia(j)).collect();
                        return weighted(&circle.series(force, record.samples));
                    }
                    Drive::Force(force) => {
                        let shares = force.iter().zip(&transfer.compliance).enumerate();
                        shares.map(|(j, (f, h))| -f * h * inertia(j)).collect()
                    }
                    Drive::Voltage { ones, .. } => {
                        let shares = circle.spectrum(x).into_iter().zip(ones).enumerate();
                        shares.map(|(j, (x, one))| one * actuator.preload_n() - x * inertia(j)).collect()
                    }
                }
            }
            _ => match (variable.force_exponent(), &record.drive) {
                (Some(exponent), Drive::Voltage { squared, .. }) => {
                    let scale = exponent * actuator.force_per_square_volt();
                    let coupling = actuator.stretch_coupling;
                    let force: Vec<f64> =
                        squared.iter().zip(x).map(|(v2, x)| scale * v2 * (1.0 + coupling * x)).collect();
                    circle.spectrum(&force)
                }
                _ => return nothing(),
            },
        };
        match (&transfer.law, &record.drive) {
            (Some(law), Drive::Voltage { squared, .. }) => {
                let force = circle.series(spectrum, record.samples);
                let pull = actuator.force_per_square_volt() * actuator.stretch_coupling;
                weighted(&recursion(law, squared, pull, &force))
            }
            _ => {
                let x = spectrum.iter().zip(&transfer.compliance).map(|(f, h)| f * h).collect();
                weighted(&circle.series(x, record.samples))
            }
        }
    }
}
