//! The objective of a fit: model minus measurement over all recordings, with its exact derivatives.
//!
//! Responses are computed with full memory in the frequency domain. Without coupling a response is a product there, and so
//! are its derivatives with respect to every c and α. With coupling the force depends on the response,
//! `x = H (F (1 + κ x) + W)`: the compressed recursion approximates it in one pass over the samples, and corrections with full
//! memory remove the remaining error. The derivatives obey the same equation with other right-hand sides.

mod linearised;
mod series;
mod tangent;

use num_complex::Complex;
use rayon::prelude::*;
use springpot::{Actuator, Curve, Discretisation, Load, Preload};

use super::candidate::{Candidate, Curves};
use super::observation::Observation;
use super::readings::{ReadingFit, Readings};
use super::residuals::Whiteness;
use super::transfer::{Nodes, Spectrum, Transfer};
use crate::error::{Error, Result};
use crate::files::recording::Input;
use crate::grid::Grid;
use crate::replay::full_memory::FullMemory;
use crate::statistics::range;

/// Most steps of a recording in a fit: each costs about a kilobyte.
const MAX_SAMPLES: usize = 1 << 22;

fn too_long(name: &str, samples: f64) -> Error {
    Error::Computation(format!(
        "{name}: {samples:.0} steps at its median rate; a fit is limited to {MAX_SAMPLES}, cut the recording or thin it"
    ))
}

/// Growth 1 + κ x of the force below which a coupling is beyond its meaning.
const MIN_GROWTH: f64 = 0.05;

/// Model minus measurement over all observations.
pub struct Objective {
    circles: Vec<FullMemory>,
    nodes: Vec<Nodes>,
    /// How the observations of every circle are stepped.
    kinds: Vec<Kind>,
    records: Vec<Record>,
}

/// Observations whose films are stepped alike.
#[derive(Clone, Copy, PartialEq)]
struct Kind {
    step_s: f64,
    method: Discretisation,
    temperature_c: Option<f64>,
}

struct Record {
    circle: usize,
    samples: usize,
    drive: DriveSpectra,
    readings: Readings,
    measured_at: Places,
    /// Times of the measured samples in steps of the grid.
    places: Vec<f64>,
    rate_hz: f64,
}

/// The input of an observation on its circle.
enum DriveSpectra {
    /// Squared voltage (V²) over time and as a spectrum, and the spectrum of a constant 1.
    Voltage { squared: Vec<f64>, spectrum: Spectrum, ones: Spectrum },
    /// Force, N, over time and as a spectrum.
    Force { force: Vec<f64>, spectrum: Spectrum },
    /// Displacement, m, likewise.
    Displacement { path: Vec<f64>, spectrum: Spectrum },
}

impl DriveSpectra {
    fn new(input: &Input, grid: Grid, circle: &FullMemory) -> Self {
        let values = grid.resample_curved(input.samples());
        match input {
            Input::Voltage(_) => {
                let squared: Vec<f64> = values.iter().map(|v| v * v).collect();
                let spectrum = circle.spectrum(&squared);
                Self::Voltage { squared, spectrum, ones: circle.spectrum(&vec![1.0; grid.samples]) }
            }
            Input::Force(_) => Self::Force { spectrum: circle.spectrum(&values), force: values },
            Input::Displacement(_) => Self::Displacement { spectrum: circle.spectrum(&values), path: values },
        }
    }

    /// The loads on the film: of a voltage by Eq. 1 with coupling and saturation,
    /// F = `force_per_square_volt` V² / (1 + (V/V_s)²) (1 + κ x) plus the weight of the preload; none of a displacement.
    fn loads(&self, actuator: &Actuator) -> Vec<Load<f64>> {
        let (scale, weight) = (actuator.force_per_square_volt(), actuator.preload_n());
        let slope = scale * actuator.stretch_coupling;
        let electrostatic = |v2: f64| Load { force_n: scale * v2 + weight, slope_n_per_m: slope * v2 };
        match self {
            Self::Voltage { squared, .. } => squared.iter().map(|&v2| electrostatic(actuator.saturated(v2))).collect(),
            Self::Force { force, .. } => force.iter().map(|&force_n| Load { force_n, slope_n_per_m: 0.0 }).collect(),
            Self::Displacement { .. } => Vec::new(),
        }
    }
}

/// The same without coupling, as a spectrum, from those of the saturated square of the voltage and of a constant 1.
fn uncoupled_force(actuator: &Actuator, squared: &Spectrum, ones: &Spectrum) -> Spectrum {
    let (scale, weight) = (actuator.force_per_square_volt(), actuator.preload_n());
    squared.iter().zip(ones).map(|(f, one)| f * scale + one * weight).collect()
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
    films: Vec<Film>,
    /// Displacements (m), or forces (N), on the grid.
    pub(super) responses: Vec<Vec<f64>>,
    /// Stretch of a spring in series (m) on the grid; empty without one.
    elongations: Vec<Vec<f64>>,
}

/// A candidate at the temperature (°C) of a circle, on that circle.
struct Film {
    temperature_c: Option<f64>,
    candidate: Candidate,
    curves: Option<Curves>,
    transfer: Transfer,
}

/// The response of a film on the grid of an observation.
struct Response {
    modelled: Vec<f64>,
    series: Vec<f64>,
    elongation: Vec<f64>,
}

impl Objective {
    /// The objective over `observations` of films with this `preload`. The model steps with second-order differences, so that nothing of it explains
    /// the step; after jumps those are no better, and first-order ones take a jump as one within a step.
    ///
    /// # Errors
    ///
    /// [`Error`] for no observations, or one that is too long for its rate.
    pub fn new(observations: &[Observation], preload: Preload) -> Result<Self> {
        let jumps = |observation: &Observation| preload == Preload::FromStart || observation.jumps();
        Self::with_methods(observations, |o| if jumps(o) { Discretisation::Gl } else { Discretisation::Bdf2 })
    }

    /// The same with second-order differences throughout, for the long steps of thinned observations.
    pub fn thinned(observations: &[Observation]) -> Result<Self> {
        Self::with_methods(observations, |_| Discretisation::Bdf2)
    }

    fn with_methods(observations: &[Observation], method: impl Fn(&Observation) -> Discretisation) -> Result<Self> {
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
        if let Some((long, grid)) = observations.iter().zip(&grids).find(|(_, grid)| grid.samples > MAX_SAMPLES) {
            return Err(too_long(&long.name, grid.samples as f64));
        }
        let kind = |(o, grid): (&Observation, &Grid)| Kind {
            step_s: grid.step_s(),
            method: method(o),
            temperature_c: o.temperature_c,
        };
        let of: Vec<Kind> = observations.iter().zip(&grids).map(kind).collect();
        let (circles, kinds) = circles(&grids, &of);
        let records = observations
            .iter()
            .zip(grids)
            .zip(of)
            .map(|((observation, grid), of)| {
                let Observation { measured, weight, sample_weights, reading, .. } = observation;
                let circle = kinds.iter().position(|kind| *kind == of).unwrap_or(0);
                Record {
                    circle,
                    samples: grid.samples,
                    drive: DriveSpectra::new(&observation.input, grid, &circles[circle]),
                    readings: Readings::new(measured, *weight, sample_weights.clone(), *reading),
                    measured_at: Places::new(&measured.time_s, grid),
                    places: measured.time_s.iter().map(|t| t * grid.rate_hz).collect(),
                    rate_hz: grid.rate_hz,
                }
            })
            .collect();
        let nodes = circles.iter().map(Nodes::new).collect();
        Ok(Self { circles, nodes, kinds, records })
    }

    /// Steps of the model, s: one for each rate.
    pub(super) fn steps_s(&self) -> impl Iterator<Item = f64> {
        self.kinds.iter().map(|kind| kind.step_s)
    }

    /// Measured values of every observation.
    pub fn measured(&self) -> impl Iterator<Item = &[f64]> {
        self.records.iter().map(|record| record.readings.measured.as_slice())
    }

    /// Cost below which residuals are smaller than any sensor resolves: of recordings that are computed.
    pub(super) fn negligible(&self) -> f64 {
        const SHARE: f64 = 1e-6;
        let of = |record: &Record| {
            let (low, high) = range(&record.readings.measured);
            let weight = record.readings.weight.powi(2);
            0.5 * weight * record.readings.measured.len() as f64 * (SHARE * (high - low)).powi(2)
        };
        self.records.iter().map(of).sum()
    }

    /// Number of measured values of every observation.
    pub fn values(&self) -> impl Iterator<Item = usize> {
        self.measured().map(<[f64]>::len)
    }

    /// Number of measured values.
    pub fn samples(&self) -> usize {
        self.values().sum()
    }

    /// The responses of `candidate`; none where elements are out of range, the film is pulled in, or numbers overflow.
    pub fn evaluate(&self, candidate: &Candidate) -> Option<Evaluation> {
        candidate.actuator.check().ok()?;
        let films = self.circles.iter().zip(&self.nodes).zip(&self.kinds);
        let films = films.map(|(place, kind)| Film::new(candidate, place, kind)).collect::<Option<Vec<Film>>>()?;
        let responses = self
            .records
            .par_iter()
            .map(|record| self.respond(record, &films[record.circle]))
            .collect::<Option<Vec<Response>>>()?;
        let (mut modelled, mut elongations) = (Vec::new(), Vec::new());
        let parts = |response: Response| {
            modelled.push(response.modelled);
            elongations.push(response.elongation);
            response.series
        };
        let responses = responses.into_iter().map(parts).collect();
        let solve = |(record, modelled): (&Record, &mut Vec<f64>)| record.readings.solve(modelled);
        let readings = self.records.iter().zip(&mut modelled).map(solve).collect();
        Some(Evaluation { modelled, readings, films, responses, elongations })
    }

    /// Modelled values at the measured times, and the same response on the grid.
    fn respond(&self, record: &Record, film: &Film) -> Option<Response> {
        let Film { candidate, curves, transfer, .. } = film;
        let curves = curves.as_ref();
        let circle = &self.circles[record.circle];
        let actuator = &candidate.actuator;
        let mut elongation = Vec::new();
        let series = match (&record.drive, &transfer.in_series, curves) {
            // It moves under a load alone.
            (DriveSpectra::Displacement { .. }, Some(_), _) => return None,
            (DriveSpectra::Displacement { path, .. }, None, Some(curves)) => transfer.film(curves).force(circle, path),
            (DriveSpectra::Displacement { spectrum, .. }, None, None) => {
                circle.series(product(spectrum, &transfer.stiffness), record.samples)
            }
            (drive, Some(law), _) => {
                let [displacement, stretched] = series::response(law, &drive.loads(actuator))?;
                elongation = stretched;
                displacement
            }
            (drive, None, Some(curves)) => {
                transfer.bent(circle, transfer.law.as_ref()?, curves, &drive.loads(actuator)).ok()?
            }
            (DriveSpectra::Force { spectrum, .. }, None, None) => {
                circle.series(product(spectrum, &transfer.compliance), record.samples)
            }
            (drive @ DriveSpectra::Voltage { squared, spectrum, ones }, None, None) => match &transfer.law {
                Some(law) => transfer.coupled(circle, law, &drive.loads(actuator)).ok()?,
                None => {
                    let saturated = |v2: &f64| actuator.saturated(*v2);
                    let saturated = actuator
                        .saturation_v
                        .map(|_| circle.spectrum(&squared.iter().map(saturated).collect::<Vec<_>>()));
                    let force = uncoupled_force(actuator, saturated.as_ref().unwrap_or(spectrum), ones);
                    circle.series(product(&force, &transfer.compliance), record.samples)
                }
            },
        };
        let grows = |x: &f64| actuator.force_growth(*x) > MIN_GROWTH;
        if !record.measures_force() && !series.iter().all(grows) {
            return None;
        }
        series.iter().all(|value| value.is_finite()).then(|| {
            let mut modelled = record.pick(&series, candidate);
            if !record.measures_force() {
                modelled.iter_mut().for_each(|x| *x = candidate.sensor().reading_m(*x));
            }
            Response { modelled, series, elongation }
        })
    }

    /// The sensor's offset (m) that fits `candidate` best; for one without a response, the mean of what was measured.
    pub fn best_offset(&self, candidate: &Candidate) -> f64 {
        let evaluation = self.evaluate(&Candidate { offset_m: 0.0, ..candidate.clone() });
        let (mut sum, mut total) = (0.0, 0.0);
        for (index, record) in self.records.iter().enumerate().filter(|(_, record)| !record.measures_force()) {
            for (k, y) in record.readings.measured.iter().enumerate() {
                let modelled = evaluation.as_ref().map_or(0.0, |evaluation| evaluation.modelled[index][k]);
                let square = record.readings.weight(k).powi(2);
                (sum, total) = (sum + square * (y - modelled), total + square);
            }
        }
        if total > 0.0 { sum / total } else { 0.0 }
    }

    /// The whiteness of what `candidate` leaves; none where it has no response.
    pub fn whiteness(&self, candidate: &Candidate) -> Option<Whiteness> {
        Some(Whiteness::new(self.values(), &self.residuals(&self.evaluate(candidate)?)))
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
}

impl Film {
    /// `candidate` on the circle with these nodes; none where its elements are out of range.
    fn new(candidate: &Candidate, place: (&FullMemory, &Nodes), kind: &Kind) -> Option<Self> {
        let candidate = candidate.at(kind.temperature_c)?.into_owned();
        let (model, curves, in_series) =
            (candidate.model().ok()?, candidate.curves().ok()?, candidate.in_series().ok()?);
        let coupled = candidate.actuator.stretch_coupling != 0.0;
        let transfer = Transfer::new(&model, place, kind.step_s, coupled, curves.as_ref(), in_series.as_ref())?;
        Some(Self { temperature_c: kind.temperature_c, candidate, curves, transfer })
    }
}

impl Record {
    fn measures_force(&self) -> bool {
        matches!(self.drive, DriveSpectra::Displacement { .. })
    }

    /// Values of a `series` on the grid when they were read: late by the delay of the displacement sensor.
    fn pick(&self, series: &[f64], candidate: &Candidate) -> Vec<f64> {
        if self.measures_force() || candidate.delay_s == 0.0 {
            return self.measured_at.pick(series);
        }
        let at = |place: &f64| delayed(series, place - candidate.delay_s * self.rate_hz).0;
        self.places.iter().map(at).collect()
    }

    /// Derivative of the same with respect to the delay, per s.
    fn pick_delay(&self, series: &[f64], candidate: &Candidate) -> Option<Vec<f64>> {
        let slope = |place: &f64| -self.rate_hz * delayed(series, place - candidate.delay_s * self.rate_hz).1;
        (!self.measures_force()).then(|| self.places.iter().map(slope).collect())
    }
}

/// Value and slope per sample of a `series` at `place`, which need not be whole, by Lagrange's cubic: before its first sample the film
/// is at rest, and after its last it stays.
fn delayed(series: &[f64], place: f64) -> (f64, f64) {
    // The floor, without a call.
    let towards_0 = place as isize;
    let before = towards_0 - isize::from(towards_0 as f64 > place);
    let u = place - before as f64;
    let at = |offset: isize| usize::try_from(before + offset).map_or(0.0, |index| series[index.min(series.len() - 1)]);
    let [a, b, c, d] = [-1, 0, 1, 2].map(at);
    // The cubic through the samples at −1, 0, 1 and 2, in powers of u.
    let first = c - a / 3.0 - b / 2.0 - d / 6.0;
    let second = 0.5 * (a + c) - b;
    let third = (d - a) / 6.0 + 0.5 * (b - c);
    (b + u * (first + u * (second + u * third)), first + u * (2.0 * second + 3.0 * u * third))
}

/// The spectrum of T(x) along `displacement` (m).
fn stretched(circle: &FullMemory, curve: &Curve, displacement: &[f64]) -> Spectrum {
    let at = curve.evaluator();
    circle.spectrum(&displacement.iter().map(|&x| at(x)[0]).collect::<Vec<_>>())
}

fn product(a: &[Complex<f64>], b: &[Complex<f64>]) -> Spectrum {
    a.iter().zip(b).map(|(a, b)| a * b).collect()
}

/// A circle for every kind of observation, as long as the longest of these.
fn circles(grids: &[Grid], of: &[Kind]) -> (Vec<FullMemory>, Vec<Kind>) {
    let (mut circles, mut kinds) = (Vec::new(), Vec::new());
    for (grid, &kind) in grids.iter().zip(of) {
        if !kinds.contains(&kind) {
            let same = grids.iter().zip(of).filter(|(_, other)| **other == kind);
            let longest = same.map(|(other, _)| other.samples).max().unwrap_or(grid.samples);
            circles.push(FullMemory::with_oversampling(longest, kind.step_s, 2, kind.method));
            kinds.push(kind);
        }
    }
    (circles, kinds)
}
