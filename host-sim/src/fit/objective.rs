//! The objective of a fit: model minus measurement over all recordings, with its exact derivatives.
//!
//! Responses are computed with full memory in the frequency domain. Without coupling a response is a product there, and so
//! are its derivatives with respect to every c and α. With coupling the force depends on the response,
//! `x = H (F (1 + κ x) + W)`: the compressed recursion approximates it in one pass over the samples, and corrections with full
//! memory remove the remaining error. The derivatives obey the same equation with other right-hand sides.

use num_complex::Complex;
use rayon::prelude::*;
use springpot::{Actuator, Load};

use super::candidate::{Candidate, Variable};
use super::nodes::Nodes;
use super::observation::Observation;
use super::readings::{ReadingFit, Readings};
use super::transfer::{Spectrum, Transfer, recursion};
use crate::error::{Error, Result};
use crate::files::recording::Input;
use crate::grid::Grid;
use crate::replay::full_memory::FullMemory;

/// Most steps of a recording in a fit: each costs about a kilobyte.
const MOST_SAMPLES: usize = 1 << 22;

fn too_long(name: &str, samples: f64) -> Error {
    Error::Computation(format!(
        "{name}: {samples:.0} steps at its median rate; a fit is limited to {MOST_SAMPLES}, cut the recording or thin it"
    ))
}

/// Model minus measurement over all observations.
pub struct Objective {
    circles: Vec<FullMemory>,
    /// Nodes of every circle.
    nodes: Vec<Nodes>,
    /// Steps of every circle, s.
    steps: Vec<f64>,
    records: Vec<Record>,
}

/// An observation on its grid.
struct Record {
    circle: usize,
    samples: usize,
    drive: DriveSpectra,
    readings: Readings,
    measured_at: Places,
}

/// The input of an observation on its circle.
enum DriveSpectra {
    /// Squared voltage (V²) over time and as a spectrum, and the spectrum of a constant 1.
    Voltage { squared: Vec<f64>, spectrum: Spectrum, ones: Spectrum },
    /// Force, N.
    Force(Spectrum),
    /// Displacement, m.
    Displacement(Spectrum),
}

impl DriveSpectra {
    fn new(input: &Input, grid: Grid, circle: &FullMemory) -> Self {
        let values = grid.resample(input.samples());
        match input {
            Input::Voltage(_) => {
                let squared: Vec<f64> = values.iter().map(|v| v * v).collect();
                let spectrum = circle.spectrum(&squared);
                Self::Voltage { squared, spectrum, ones: circle.spectrum(&vec![1.0; grid.samples]) }
            }
            Input::Force(_) => Self::Force(circle.spectrum(&values)),
            Input::Displacement(_) => Self::Displacement(circle.spectrum(&values)),
        }
    }
}

/// Eq. 1 with coupling: F = `force_per_square_volt` V² (1 + κ x) plus the weight of the preload.
fn loads(actuator: &Actuator, squared: &[f64]) -> Vec<Load<f64>> {
    let (scale, weight) = (actuator.force_per_square_volt(), actuator.preload_n());
    let slope = scale * actuator.stretch_coupling;
    squared.iter().map(|v2| Load { force: scale * v2 + weight, slope: slope * v2 }).collect()
}

/// Times of the measured samples on the grid.
enum Places {
    /// One sample at every grid point.
    All,
    /// A grid point for every sample, and the fraction of the step after it.
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
    /// Offset and gain of every observation's readings.
    pub readings: Vec<ReadingFit>,
    transfers: Vec<Transfer>,
    /// Responses on the grid: displacement (m), or force (N).
    responses: Vec<Vec<f64>>,
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
        let (circles, steps) = circles(&grids);
        let records = observations
            .iter()
            .zip(grids)
            .map(|(observation, grid)| {
                let circle = steps.iter().position(|&step| step == grid.step_s()).unwrap_or(0);
                Record {
                    circle,
                    samples: grid.samples,
                    drive: DriveSpectra::new(&observation.input, grid, &circles[circle]),
                    readings: Readings::of(observation),
                    measured_at: Places::new(&observation.measured.time_s, grid),
                }
            })
            .collect();
        let nodes = circles.iter().map(Nodes::of).collect();
        Ok(Self { circles, nodes, steps, records })
    }

    /// Measured values of every observation.
    pub fn measured(&self) -> impl Iterator<Item = &[f64]> {
        self.records.iter().map(|record| record.readings.measured.as_slice())
    }

    /// Number of measured values.
    pub fn samples(&self) -> usize {
        self.records.iter().map(|record| record.readings.measured.len()).sum()
    }

    /// The responses of `candidate`; none where elements are out of range, the film is pulled in, or numbers overflow.
    pub fn evaluate(&self, candidate: &Candidate) -> Option<Evaluation> {
        let model = candidate.model().ok()?;
        candidate.actuator.check().ok()?;
        let coupled = candidate.actuator.stretch_coupling > 0.0;
        let transfers = self
            .circles
            .iter()
            .zip(&self.nodes)
            .zip(&self.steps)
            .map(|((circle, nodes), &step)| Transfer::new(&model, circle, nodes, step, coupled))
            .collect::<Option<Vec<Transfer>>>()?;
        let responses = self
            .records
            .par_iter()
            .map(|record| self.respond(record, candidate, &transfers[record.circle]))
            .collect::<Option<Vec<(Vec<f64>, Vec<f64>)>>>()?;
        let (mut modelled, responses): (Vec<Vec<f64>>, Vec<Vec<f64>>) = responses.into_iter().unzip();
        let solve = |(record, modelled): (&Record, &mut Vec<f64>)| record.readings.solve(modelled);
        let readings = self.records.iter().zip(&mut modelled).map(solve).collect();
        Some(Evaluation { modelled, readings, transfers, responses })
    }

    /// Modelled values at the measured times, and the same response on the grid.
    fn respond(&self, record: &Record, candidate: &Candidate, transfer: &Transfer) -> Option<(Vec<f64>, Vec<f64>)> {
        let circle = &self.circles[record.circle];
        let series = match &record.drive {
            DriveSpectra::Displacement(path) => circle.series(product(path, &transfer.stiffness), record.samples),
            DriveSpectra::Force(force) => circle.series(product(force, &transfer.compliance), record.samples),
            DriveSpectra::Voltage { squared, spectrum, ones } => match &transfer.law {
                None => {
                    let (scale, weight) = (candidate.actuator.force_per_square_volt(), candidate.actuator.preload_n());
                    let force: Spectrum = spectrum.iter().zip(ones).map(|(f, one)| f * scale + one * weight).collect();
                    circle.series(product(&force, &transfer.compliance), record.samples)
                }
                Some(law) => transfer.coupled(circle, law, &loads(&candidate.actuator, squared)).ok()?,
            },
        };
        series.iter().all(|value| value.is_finite()).then(|| {
            let modelled = record.measured_at.pick(&series);
            let modelled = if record.measures_force() {
                modelled
            } else {
                modelled.into_iter().map(|x| candidate.sensor().reading_m(x)).collect()
            };
            (modelled, series)
        })
    }

    /// Model minus measurement, weighted, one observation after another.
    pub fn residuals(&self, evaluation: &Evaluation) -> Vec<f64> {
        let mut residuals = Vec::with_capacity(self.samples());
        for (record, modelled) in self.records.iter().zip(&evaluation.modelled) {
            let pairs = modelled.iter().zip(&record.readings.measured).enumerate();
            residuals.extend(pairs.map(|(k, (model, y))| record.readings.weight(k) * (model - y)));
        }
        residuals
    }

    /// Derivatives of the residuals with respect to `variables`, one column each.
    pub fn jacobian(&self, candidate: &Candidate, evaluation: &Evaluation, variables: &[Variable]) -> Vec<Vec<f64>> {
        let spectra: Vec<Spectrum> = (0..self.records.len())
            .into_par_iter()
            .map(|index| {
                let record = &self.records[index];
                match record.drive {
                    DriveSpectra::Voltage { .. } => self.circles[record.circle].spectrum(&evaluation.responses[index]),
                    DriveSpectra::Force(_) | DriveSpectra::Displacement(_) => Spectrum::new(),
                }
            })
            .collect();
        // What one variable does to one observation is one task.
        let pieces: Vec<Vec<f64>> = (0..variables.len() * self.records.len())
            .into_par_iter()
            .map(|task| {
                let (variable, record) = (variables[task / self.records.len()], task % self.records.len());
                self.derivative(candidate, evaluation, variable, record, &spectra[record])
            })
            .collect();
        pieces.chunks(self.records.len()).map(<[Vec<f64>]>::concat).collect()
    }

    /// Derivative of the residuals of observation `index`, whose response has this `spectrum` if a voltage drives.
    fn derivative(
        &self,
        candidate: &Candidate,
        evaluation: &Evaluation,
        variable: Variable,
        index: usize,
        spectrum: &Spectrum,
    ) -> Vec<f64> {
        let record = &self.records[index];
        let reading = &evaluation.readings[index];
        if variable == Variable::Offset && !record.measures_force() {
            let ones = vec![1.0; record.readings.measured.len()];
            return record.readings.project(reading, &evaluation.modelled[index], ones);
        }
        let linearised = Linearised {
            record,
            circle: &self.circles[record.circle],
            nodes: &self.nodes[record.circle],
            transfer: &evaluation.transfers[record.circle],
            actuator: &candidate.actuator,
            response: &evaluation.responses[index],
            spectrum,
        };
        match linearised.derivative(variable) {
            Some(series) => {
                record.readings.project(reading, &evaluation.modelled[index], record.measured_at.pick(&series))
            }
            None => vec![0.0; record.readings.measured.len()],
        }
    }
}

impl Record {
    fn measures_force(&self) -> bool {
        matches!(self.drive, DriveSpectra::Displacement(_))
    }
}

/// The response of one observation near a candidate.
struct Linearised<'a> {
    record: &'a Record,
    circle: &'a FullMemory,
    nodes: &'a Nodes,
    transfer: &'a Transfer,
    actuator: &'a Actuator,
    /// On the grid: displacement (m), or force (N).
    response: &'a [f64],
    /// The same on the circle, if a voltage drives.
    spectrum: &'a [Complex<f64>],
}

impl Linearised<'_> {
    /// Derivative of the response on the grid; none where `variable` has no effect on it.
    fn derivative(&self, variable: Variable) -> Option<Vec<f64>> {
        let samples = self.record.samples;
        if let DriveSpectra::Displacement(path) = &self.record.drive {
            let force = product(path, &self.stiffness_derivative(variable)?);
            return Some(self.circle.series(force, samples));
        }
        let force = self.force_derivative(variable)?;
        match (&self.transfer.law, &self.record.drive) {
            (Some(law), DriveSpectra::Voltage { squared, .. }) => {
                let slope = self.actuator.force_per_square_volt() * self.actuator.stretch_coupling;
                let force = self.circle.series(force, samples);
                let loads: Vec<Load<f64>> =
                    force.iter().zip(squared).map(|(&force, v2)| Load { force, slope: slope * v2 }).collect();
                Some(recursion(law, &loads))
            }
            _ => Some(self.circle.series(product(&force, &self.transfer.compliance), samples)),
        }
    }

    /// ∂(m s² + K)/∂ `variable` on the circle.
    fn stiffness_derivative(&self, variable: Variable) -> Option<Spectrum> {
        let ln_s = self.circle.ln_s();
        match variable {
            Variable::Coefficient(element) => Some(self.transfer.sensitivity(element, self.nodes)),
            Variable::Order(element) => Some(product(&self.transfer.sensitivity(element, self.nodes), ln_s)),
            Variable::Mass => Some(ln_s.iter().map(|z| (2.0 * z).exp() * self.actuator.mass_kg).collect()),
            _ => None,
        }
    }

    /// The force whose response is the derivative of the displacement: ∂F/∂v − x ∂(m s² + K)/∂v for the variable v, as a
    /// spectrum.
    fn force_derivative(&self, variable: Variable) -> Option<Spectrum> {
        match &self.record.drive {
            DriveSpectra::Displacement(_) => None,
            DriveSpectra::Force(force) => {
                let change = self.stiffness_derivative(variable)?;
                let x = force.iter().zip(&self.transfer.compliance).map(|(f, h)| -f * h);
                Some(x.zip(change).map(|(x, k)| x * k).collect())
            }
            DriveSpectra::Voltage { squared, ones, .. } => {
                let scale = self.actuator.force_per_square_volt();
                let electrostatic = |scale: f64, factor: &dyn Fn(f64) -> f64| {
                    let force: Vec<f64> =
                        squared.iter().zip(self.response).map(|(v2, &x)| scale * v2 * factor(x)).collect();
                    self.circle.spectrum(&force)
                };
                match (variable, variable.force_exponent()) {
                    (Variable::StretchCoupling, _) => Some(electrostatic(scale, &|x| x)),
                    (_, Some(exponent)) => Some(electrostatic(exponent * scale, &|x| self.actuator.thinning(x))),
                    _ => {
                        let change = self.stiffness_derivative(variable)?;
                        let mut force: Spectrum = self.spectrum.iter().zip(change).map(|(x, k)| -x * k).collect();
                        if variable == Variable::Mass {
                            let weight = self.actuator.preload_n();
                            force.iter_mut().zip(ones).for_each(|(f, one)| *f += one * weight);
                        }
                        Some(force)
                    }
                }
            }
        }
    }
}

/// The product of two spectra.
fn product(a: &[Complex<f64>], b: &[Complex<f64>]) -> Spectrum {
    a.iter().zip(b).map(|(a, b)| a * b).collect()
}

/// A circle for every rate, as long as the longest recording of that rate, and the steps (s) of these circles.
fn circles(grids: &[Grid]) -> (Vec<FullMemory>, Vec<f64>) {
    let mut circles: Vec<FullMemory> = Vec::new();
    let mut steps: Vec<f64> = Vec::new();
    for grid in grids {
        if !steps.contains(&grid.step_s()) {
            let same = grids.iter().filter(|other| other.rate_hz == grid.rate_hz);
            let longest = same.map(|other| other.samples).max().unwrap_or(grid.samples);
            circles.push(FullMemory::with_oversampling(longest, grid.step_s(), 2));
            steps.push(grid.step_s());
        }
    }
    (circles, steps)
}
