//! The exact derivatives of the objective: what each variable does to each response near a candidate.

use num_complex::Complex;
use rayon::prelude::*;
use springpot::{Curve, Law, Load};

use super::super::candidate::{Candidate, Variable};
use super::super::transfer::{Nodes, Recursion, Spectrum, Transfer, recursion};
use super::{DriveSpectra, Evaluation, Objective, Record, Response, product, stretched};
use crate::replay::full_memory::FullMemory;

/// Share of the force by which derivatives behind a curve are taken.
const SMALL_SHARE: f64 = 1e-5;
/// Change of a curve's variable by which its derivatives are taken.
const CURVE_STEP: f64 = 1e-4;

/// Spectra on the circle that all derivatives of one response share.
#[derive(Default)]
struct Shared {
    /// Spectrum of the displacement (m), where force or voltage drives.
    displacement: Spectrum,
    /// Spectrum of T(x) behind a curve (m), on which the kernel acts.
    stretched: Spectrum,
}

impl Objective {
    /// Derivatives of the residuals with respect to `variables`, one column each.
    pub fn jacobian(&self, candidate: &Candidate, evaluation: &Evaluation, variables: &[Variable]) -> Vec<Vec<f64>> {
        let shared: Vec<Shared> = (0..self.records.len())
            .into_par_iter()
            .map(|index| {
                let record = &self.records[index];
                let circle = &self.circles[record.circle];
                match (&record.drive, &evaluation.curve) {
                    (DriveSpectra::Displacement { path, .. }, Some(curve)) => {
                        Shared { stretched: stretched(circle, curve, path), ..Shared::default() }
                    }
                    (DriveSpectra::Displacement { .. }, None) => Shared::default(),
                    (DriveSpectra::Voltage { .. } | DriveSpectra::Force { .. }, curve) => {
                        let series = &evaluation.responses[index].series;
                        let stretched = curve.as_ref().map(|curve| stretched(circle, curve, series));
                        Shared { displacement: circle.spectrum(series), stretched: stretched.unwrap_or_default() }
                    }
                }
            })
            .collect();
        // What one variable does to one observation is one task.
        let pieces: Vec<Vec<f64>> = (0..variables.len() * self.records.len())
            .into_par_iter()
            .map(|task| {
                let (variable, record) = (variables[task / self.records.len()], task % self.records.len());
                self.derivative(candidate, evaluation, variable, record, &shared[record])
            })
            .collect();
        pieces.chunks(self.records.len()).map(<[Vec<f64>]>::concat).collect()
    }

    /// Derivative of the residuals of observation `index`, whose derivatives share `shared`.
    fn derivative(
        &self,
        candidate: &Candidate,
        evaluation: &Evaluation,
        variable: Variable,
        index: usize,
        shared: &Shared,
    ) -> Vec<f64> {
        let record = &self.records[index];
        let reading = &evaluation.readings[index];
        if variable == Variable::Offset && !record.measures_force() {
            let ones = vec![1.0; record.readings.measured.len()];
            return record.readings.project(reading, &evaluation.modelled[index], ones);
        }
        if variable == Variable::Delay {
            let change = record.pick_delay(&evaluation.responses[index].series, candidate);
            let change = change.unwrap_or_else(|| vec![0.0; record.readings.measured.len()]);
            return record.readings.project(reading, &evaluation.modelled[index], change);
        }
        let linearised = Linearised {
            record,
            circle: &self.circles[record.circle],
            nodes: &self.nodes[record.circle],
            transfer: &evaluation.transfers[record.circle],
            candidate,
            curve: evaluation.curve.as_ref(),
            response: &evaluation.responses[index],
            shared,
        };
        match linearised.derivative(variable) {
            Some(series) => {
                record.readings.project(reading, &evaluation.modelled[index], record.pick(&series, candidate))
            }
            None => vec![0.0; record.readings.measured.len()],
        }
    }
}

/// The response of one observation near a candidate.
struct Linearised<'a> {
    record: &'a Record,
    circle: &'a FullMemory,
    nodes: &'a Nodes,
    transfer: &'a Transfer,
    candidate: &'a Candidate,
    curve: Option<&'a Curve>,
    response: &'a Response,
    shared: &'a Shared,
}

impl Linearised<'_> {
    /// Derivative of the response on the grid; none where `variable` has no effect on it.
    fn derivative(&self, variable: Variable) -> Option<Vec<f64>> {
        let samples = self.record.samples;
        if let DriveSpectra::Displacement { path, spectrum } = &self.record.drive {
            return Some(self.circle.series(self.stiffness_change(path, spectrum, variable)?, samples));
        }
        let force = self.force_derivative(variable)?;
        let law = self.transfer.law.as_ref();
        match (law, &self.record.drive) {
            (Some(law), _) if self.curve.is_some() => Some(self.along(law, &self.circle.series(force, samples))),
            (Some(law), DriveSpectra::Voltage { squared, .. }) => {
                let actuator = &self.candidate.actuator;
                let slope = actuator.force_per_square_volt() * actuator.stretch_coupling;
                let force = self.circle.series(force, samples);
                let load = |(&force, &v2)| Load { force_n: force, slope_n_per_m: slope * actuator.saturated(v2) };
                let loads: Vec<Load<f64>> = force.iter().zip(squared).map(load).collect();
                Some(recursion(law, &loads))
            }
            _ => Some(self.circle.series(product(&force, &self.transfer.compliance), samples)),
        }
    }

    /// Change of the displacement behind the curve with a little more of `force` (N), per unit of it.
    fn along(&self, law: &Law<f64, Recursion>, force: &[f64]) -> Vec<f64> {
        let size = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, |size: f64, value| size.max(value.abs()));
        let Response { series: x, driven } = self.response;
        let largest = size(&mut driven.iter().map(|load| load.force_n));
        let little = SMALL_SHARE * largest / size(&mut force.iter().copied()).max(f64::MIN_POSITIVE);
        let with = |share: f64| -> Vec<Load<f64>> {
            let more = |(load, force): (&Load<f64>, &f64)| Load { force_n: load.force_n + share * force, ..*load };
            driven.iter().zip(force).map(more).collect()
        };
        recursion(law, &with(little)).iter().zip(x).map(|(more, x)| (more - x) / little).collect()
    }

    /// ∂(m s² x + K T(x))/∂ `variable` along displacements with this spectrum.
    fn stiffness_change(
        &self,
        displacement: &[f64],
        spectrum: &[Complex<f64>],
        variable: Variable,
    ) -> Option<Spectrum> {
        let ln_s = self.circle.ln_s();
        let stretched = if self.curve.is_some() { &self.shared.stretched } else { spectrum };
        let sensitivity = |element| product(stretched, &self.transfer.sensitivity(element, self.nodes));
        match variable {
            Variable::Coefficient(element) => Some(sensitivity(element)),
            Variable::Order(element) => Some(product(&sensitivity(element), ln_s)),
            Variable::Mass => {
                let mass_kg = self.candidate.actuator.mass_kg;
                Some(spectrum.iter().zip(ln_s).map(|(x, z)| x * (2.0 * z).exp() * mass_kg).collect())
            }
            _ if variable.is_of_curve() => {
                let change = self.curve_change(displacement, variable)?;
                Some(product(&self.circle.spectrum(&change), &self.transfer.kernel))
            }
            _ => None,
        }
    }

    /// ∂T/∂ `variable` at the displacements.
    fn curve_change(&self, displacement: &[f64], variable: Variable) -> Option<Vec<f64>> {
        let value = variable.get(self.candidate);
        let at = |value: f64| -> Option<Curve> {
            let mut bend = self.candidate.clone();
            variable.set(&mut bend, value);
            bend.bend.curve().ok().flatten()
        };
        let (more, less) = (at(value + CURVE_STEP)?, at(value - CURVE_STEP)?);
        Some(displacement.iter().map(|&x| (more.value(x) - less.value(x)) / (2.0 * CURVE_STEP)).collect())
    }

    /// The force whose response is the derivative of the displacement: ∂F/∂v − ∂(m s² x + K T(x))/∂v for the variable v, as a
    /// spectrum.
    fn force_derivative(&self, variable: Variable) -> Option<Spectrum> {
        let x = &self.response.series;
        match &self.record.drive {
            DriveSpectra::Displacement { .. } => None,
            DriveSpectra::Force { .. } => {
                let change = self.stiffness_change(x, &self.shared.displacement, variable)?;
                Some(change.iter().map(|change| -change).collect())
            }
            DriveSpectra::Voltage { squared, ones, .. } => {
                let actuator = &self.candidate.actuator;
                let scale = actuator.force_per_square_volt();
                let electrostatic = |factor: &dyn Fn(f64, f64) -> f64| {
                    let force: Vec<f64> = squared.iter().zip(x).map(|(&v2, &x)| scale * factor(v2, x)).collect();
                    self.circle.spectrum(&force)
                };
                match (variable, variable.force_exponent()) {
                    (Variable::StretchCoupling, _) => Some(electrostatic(&|v2, x| actuator.saturated(v2) * x)),
                    (Variable::Saturation, _) => {
                        // In 1/kV².
                        Some(electrostatic(&|v2, x| -1e-6 * actuator.saturated(v2).powi(2) * actuator.force_growth(x)))
                    }
                    (_, Some(exponent)) => {
                        Some(electrostatic(&|v2, x| exponent * actuator.saturated(v2) * actuator.force_growth(x)))
                    }
                    _ => {
                        let mut force: Spectrum = self
                            .stiffness_change(x, &self.shared.displacement, variable)?
                            .iter()
                            .map(|change| -change)
                            .collect();
                        if variable == Variable::Mass {
                            let weight = actuator.preload_n();
                            force.iter_mut().zip(ones).for_each(|(f, one)| *f += one * weight);
                        }
                        Some(force)
                    }
                }
            }
        }
    }
}
