//! The exact derivatives of the objective: what each variable does to each response near a candidate.

use num_complex::Complex;
use rayon::prelude::*;
use springpot::{Curve, Springpot};

use super::super::bend::Elastic;
use super::super::candidate::{Candidate, Curves, Variable};
use super::super::readings::ReadingFit;
use super::super::transfer::{Nodes, Spectrum, Transfer};
use super::series::Near;
use super::tangent::{LANES, Tangent};
use super::{DriveSpectra, Evaluation, Film, Objective, Record, product, stretched};
use crate::replay::full_memory::FullMemory;

/// Change of a curve's variable by which its derivatives are taken.
const CURVE_STEP: f64 = 1e-4;

/// Spectra on the circle that all derivatives of one response share.
#[derive(Default)]
struct Shared {
    /// Spectrum of the displacement (m), where force or voltage drives.
    displacement: Spectrum,
    /// Spectrum of T(x) behind a curve (m), on which the kernel acts.
    stretched: Spectrum,
    /// Beside a spring: T' at every step, and the memory's force (N).
    weighted: Option<[Vec<f64>; 2]>,
    /// Changes of a displacement with the force, where they are not a product of spectra.
    tangent: Option<Tangent>,
}

/// Change of the force with a variable, N, and under the same force of the displacement, m, of a film with a spring in series.
#[derive(Default)]
struct Change {
    force: Option<Vec<f64>>,
    moved: Option<Vec<f64>>,
}

impl Change {
    fn times(self, share: f64) -> Self {
        let times = |mut series: Vec<f64>| {
            if share != 1.0 {
                series.iter_mut().for_each(|value| *value *= share);
            }
            series
        };
        Self { force: self.force.map(times), moved: self.moved.map(times) }
    }

    fn plus(self, other: Self) -> Self {
        let plus = |one: Option<Vec<f64>>, other: Option<Vec<f64>>| match (one, other) {
            (Some(mut one), Some(other)) => {
                one.iter_mut().zip(other).for_each(|(one, other)| *one += other);
                Some(one)
            }
            (one, other) => one.or(other),
        };
        Self { force: plus(self.force, other.force), moved: plus(self.moved, other.moved) }
    }
}

impl Objective {
    /// Derivatives of the residuals with respect to `variables`, one column each.
    pub fn jacobian(&self, candidate: &Candidate, evaluation: &Evaluation, variables: &[Variable]) -> Vec<Vec<f64>> {
        let bends = variables.iter().filter_map(|&variable| Some((variable, curves_beside(candidate, variable)?)));
        let bends: Vec<(Variable, [Curve; 2])> = bends.collect();
        let near: Vec<Linearised> = (0..self.records.len())
            .into_par_iter()
            .map(|index| Linearised::new(self, evaluation, &bends, index))
            .collect();
        // What a few variables do to one observation is one task.
        let few: Vec<&[Variable]> = variables.chunks(LANES).collect();
        let pieces: Vec<Vec<Vec<f64>>> = (0..few.len() * near.len())
            .into_par_iter()
            .map(|task| near[task % near.len()].columns(few[task / near.len()]))
            .collect();
        let columns = |pieces: &[Vec<Vec<f64>>]| -> Vec<Vec<f64>> {
            (0..pieces[0].len()).map(|lane| pieces.iter().flat_map(|piece| &piece[lane]).copied().collect()).collect()
        };
        pieces.chunks(near.len()).flat_map(columns).collect()
    }
}

/// The curve where `variable` is less and where it is more than in `candidate` by [`CURVE_STEP`]; none if it does not change it.
fn curves_beside(candidate: &Candidate, variable: Variable) -> Option<[Curve; 2]> {
    if !variable.is_of_bend() {
        return None;
    }
    let value = variable.get(candidate);
    let at = |value: f64| -> Option<Curve> {
        let mut bend = candidate.clone();
        variable.set(&mut bend, value);
        bend.bend.curve().ok().flatten()
    };
    Some([at(value - CURVE_STEP)?, at(value + CURVE_STEP)?])
}

/// The response of one observation near a candidate.
struct Linearised<'a> {
    record: &'a Record,
    circle: &'a FullMemory,
    nodes: &'a Nodes,
    transfer: &'a Transfer,
    /// The temperature of the film, °C, and the candidate there.
    temperature_c: Option<f64>,
    candidate: &'a Candidate,
    curves: Option<&'a Curves>,
    /// The curve beside the candidate's, for each variable that bends it.
    bends: &'a [(Variable, [Curve; 2])],
    /// Displacement (m), or force (N), on the grid.
    series: &'a [f64],
    /// Displacement (m) on the grid.
    displacement: &'a [f64],
    /// The readings that were modelled, and what is the recording's own of them.
    modelled: &'a [f64],
    reading: &'a ReadingFit,
    shared: Shared,
    series_near: Option<Near<'a>>,
}

impl<'a> Linearised<'a> {
    /// Near a candidate the response of observation `index` of `objective`.
    fn new(
        objective: &'a Objective,
        evaluation: &'a Evaluation,
        bends: &'a [(Variable, [Curve; 2])],
        index: usize,
    ) -> Self {
        let record = &objective.records[index];
        let circle = &objective.circles[record.circle];
        let Film { temperature_c, candidate, curves, transfer } = &evaluation.films[record.circle];
        let curves = curves.as_ref();
        let series = &evaluation.responses[index];
        let displacement = match &record.drive {
            DriveSpectra::Displacement { path, .. } => path,
            DriveSpectra::Voltage { .. } | DriveSpectra::Force { .. } => series,
        };
        let mut shared = Shared::default();
        let elongation = &evaluation.elongations[index];
        let place = (circle, &objective.nodes[record.circle]);
        let near = transfer.in_series.as_ref().and_then(|_| Near::new(place, transfer, candidate, series, elongation));
        if let Some(Curves { curve, spring }) = curves {
            shared.stretched = stretched(circle, curve, displacement);
            shared.weighted = spring.as_ref().map(|_| {
                let memory = circle.series(product(&shared.stretched, &transfer.kernel), record.samples);
                let at = curve.evaluator();
                [displacement.iter().map(|&x| at(x)[1]).collect(), memory]
            });
        }
        if !record.measures_force() {
            shared.displacement = circle.spectrum(series);
            let memory = shared.weighted.as_ref().map(|[_, memory]| memory.as_slice());
            let tangent = |law| {
                let tangent = Tangent::new(law, candidate, curves, memory, record, series);
                match &near {
                    Some(near) => tangent.in_series(&near.slopes),
                    None => tangent,
                }
            };
            shared.tangent = transfer.law.as_ref().map(tangent);
        }
        Self {
            record,
            circle,
            nodes: &objective.nodes[record.circle],
            transfer,
            temperature_c: *temperature_c,
            candidate,
            curves,
            bends,
            series,
            displacement,
            modelled: &evaluation.modelled[index],
            reading: &evaluation.readings[index],
            shared,
            series_near: near,
        }
    }

    /// Derivatives of the residuals with respect to up to [`LANES`] variables.
    fn columns(&self, variables: &[Variable]) -> Vec<Vec<f64>> {
        let readings = &self.record.readings;
        let is_of_film = |variable: &Variable| match variable {
            Variable::Offset => self.record.measures_force(),
            Variable::Delay => false,
            _ => true,
        };
        let change = |variable: &Variable| {
            let changes = self.at_temperature(*variable).into_iter().filter(|_| is_of_film(variable));
            changes.map(|(share, variable)| self.change(variable).times(share)).fold(Change::default(), Change::plus)
        };
        let changes: Vec<Change> = variables.iter().map(change).collect();
        let (mut moved, offsets): (Vec<_>, Vec<_>) = changes.into_iter().map(|c| (c.force, c.moved)).unzip();
        match &self.shared.tangent {
            Some(tangent) if variables.len() <= LANES / 2 => tangent.moved::<{ LANES / 2 }>(&mut moved),
            Some(tangent) => tangent.moved::<LANES>(&mut moved),
            None => {}
        }
        for (series, offset) in moved.iter_mut().zip(offsets) {
            series.iter_mut().flatten().zip(offset.iter().flatten()).for_each(|(value, offset)| *value += offset);
        }
        let column = |(variable, moved): (&Variable, Option<Vec<f64>>)| {
            let change = match variable {
                Variable::Offset if !self.record.measures_force() => Some(vec![1.0; readings.measured.len()]),
                Variable::Delay => self.record.pick_delay(self.series, self.candidate),
                _ => moved.map(|series| self.record.pick(&series, self.candidate)),
            };
            let change = change.unwrap_or_else(|| vec![0.0; readings.measured.len()]);
            readings.project(self.reading, self.modelled, change)
        };
        variables.iter().zip(moved).map(column).collect()
    }

    /// Changes of the variables of the film at its temperature with `variable`.
    fn at_temperature(&self, variable: Variable) -> Vec<(f64, Variable)> {
        let Candidate { elements, spring, temperature, .. } = self.candidate;
        let (Some(dependence), Some(temperature_c)) = (temperature, self.temperature_c) else {
            return vec![(1.0, variable)];
        };
        let coefficients = |share: &dyn Fn(f64) -> f64| -> Vec<(f64, Variable)> {
            let element = |(index, element): (usize, &Springpot)| (share(element.alpha), Variable::Coefficient(index));
            elements.iter().enumerate().map(element).collect()
        };
        match variable {
            Variable::Order(element) => {
                vec![(1.0, variable), (dependence.ln_time_factor(temperature_c), Variable::Coefficient(element))]
            }
            Variable::Activation => {
                let per_activation = dependence.ln_time_per_activation(temperature_c);
                coefficients(&|alpha| alpha * per_activation)
            }
            Variable::StiffnessSlope => {
                let share = (temperature_c - dependence.reference_c) / dependence.stiffness_factor(temperature_c);
                let of_spring = match spring {
                    Some(Elastic::Free { shares, .. }) => {
                        shares.iter().enumerate().map(|(knot, own)| (share * own, Variable::Steepness(knot))).collect()
                    }
                    Some(Elastic::Rising(_)) => vec![(share, Variable::SeriesStiffness)],
                    Some(Elastic::Held(_)) | None => Vec::new(),
                };
                [coefficients(&|_| share), of_spring].concat()
            }
            _ => vec![(1.0, variable)],
        }
    }

    /// Derivative of the response on the grid, or of the force that changes it through the [`Tangent`]; none where `variable` has no effect
    /// on it.
    fn change(&self, variable: Variable) -> Change {
        let near = self.series_near.as_ref();
        if let Some((near, moved)) = near.and_then(|near| Some((near, near.moved(variable)?))) {
            let inertia = near.inertia(&moved);
            let grows = self.shared.tangent.iter().flat_map(Tangent::grows);
            let force = grows.zip(&moved).zip(inertia).map(|((grows, moved), inertia)| grows * moved - inertia);
            return Change { force: Some(force.collect()), moved: Some(moved) };
        }
        Change { force: self.force_change(variable), moved: None }
    }

    fn force_change(&self, variable: Variable) -> Option<Vec<f64>> {
        match &self.shared.weighted {
            Some(weighted) if variable.is_of_memory() || variable.is_of_curve() => {
                let mut resisted = self.change_beside(weighted, variable)?;
                if !self.record.measures_force() {
                    resisted.iter_mut().for_each(|force| *force = -*force);
                }
                Some(resisted)
            }
            _ => self.spectrum(variable).map(|spectrum| self.circle.series(spectrum, self.record.samples)),
        }
    }

    /// ∂(E(x) + T'(x) M[T(x)])/∂ `variable` of the memory or the curves along the displacement, from T' and M there.
    fn change_beside(&self, [slopes, memory]: &[Vec<f64>; 2], variable: Variable) -> Option<Vec<f64>> {
        if let Variable::Steepness(knot) = variable {
            let change = self.candidate.spring.as_ref()?.change(knot).ok()?.evaluator();
            return Some(self.displacement.iter().map(|&x| change(x)[0]).collect());
        }
        let bent = if variable.is_of_memory() { None } else { Some(self.curve_changes(variable)?) };
        let spectrum = match &bent {
            None => self.modulus_change(&self.shared.stretched, variable)?,
            Some([stretched, _]) => product(&self.circle.spectrum(stretched), &self.transfer.kernel),
        };
        let mut force = self.circle.series(spectrum, self.record.samples);
        force.iter_mut().zip(slopes).for_each(|(force, slope)| *force *= slope);
        if let Some([_, turned]) = bent {
            let turned = turned.iter().zip(memory);
            force.iter_mut().zip(turned).for_each(|(force, (slope, memory))| *force += slope * memory);
        }
        Some(force)
    }

    /// The same as a spectrum, for all but what a spring changes.
    fn spectrum(&self, variable: Variable) -> Option<Spectrum> {
        if let DriveSpectra::Displacement { spectrum, .. } = &self.record.drive {
            return self.stiffness_change(spectrum, variable);
        }
        let force = self.force_derivative(variable)?;
        Some(if self.shared.tangent.is_some() { force } else { product(&force, &self.transfer.compliance) })
    }

    /// ∂(m s² x + K T(x))/∂ `variable` along displacements with this spectrum.
    fn stiffness_change(&self, spectrum: &[Complex<f64>], variable: Variable) -> Option<Spectrum> {
        let ln_s = self.circle.ln_s();
        match variable {
            Variable::Coefficient(_) | Variable::Order(_) => {
                let stretched = if self.curves.is_some() { &self.shared.stretched } else { spectrum };
                self.modulus_change(stretched, variable)
            }
            Variable::Mass => {
                let mass_kg = self.candidate.actuator.mass_kg;
                Some(spectrum.iter().zip(ln_s).map(|(x, z)| x * (2.0 * z).exp() * mass_kg).collect())
            }
            _ if variable.is_of_curve() => {
                let [change, _] = self.curve_changes(variable)?;
                Some(product(&self.circle.spectrum(&change), &self.transfer.kernel))
            }
            _ => None,
        }
    }

    /// ∂(K T)/∂ `variable` of an element, from the spectrum of T.
    fn modulus_change(&self, stretched: &[Complex<f64>], variable: Variable) -> Option<Spectrum> {
        let sensitivity = |element| product(stretched, self.transfer.sensitivity(element, self.nodes));
        match variable {
            Variable::Coefficient(element) => Some(sensitivity(element)),
            Variable::Order(element) => Some(product(&sensitivity(element), self.circle.ln_s())),
            _ => None,
        }
    }

    /// ∂/∂ `variable` of T and of T' along the displacement.
    fn curve_changes(&self, variable: Variable) -> Option<[Vec<f64>; 2]> {
        let (_, beside) = self.bends.iter().find(|(bent, _)| *bent == variable)?;
        let [less, more] = beside.each_ref().map(Curve::evaluator);
        let change = |&x: &f64| {
            let ([less, less_slope, _], [more, more_slope, _]) = (less(x), more(x));
            ((more - less) / (2.0 * CURVE_STEP), (more_slope - less_slope) / (2.0 * CURVE_STEP))
        };
        let (values, slopes) = self.displacement.iter().map(change).unzip();
        Some([values, slopes])
    }

    /// The force whose response is the derivative of the displacement: ∂F/∂v − ∂(m s² x + K T(x))/∂v for the variable v, as a
    /// spectrum.
    fn force_derivative(&self, variable: Variable) -> Option<Spectrum> {
        let actuator = &self.candidate.actuator;
        if let DriveSpectra::Voltage { squared, .. } = &self.record.drive {
            let scale = actuator.force_per_square_volt();
            let electrostatic = |factor: &dyn Fn(f64, f64) -> f64| {
                let force = squared.iter().zip(self.series).map(|(&v2, &x)| scale * factor(v2, x));
                Some(self.circle.spectrum(&force.collect::<Vec<f64>>()))
            };
            match (variable, variable.force_exponent()) {
                (Variable::StretchCoupling, _) => return electrostatic(&|v2, x| actuator.saturated(v2) * x),
                (Variable::Saturation, _) => {
                    // In 1/kV².
                    return electrostatic(&|v2, x| -1e-6 * actuator.saturated(v2).powi(2) * actuator.force_growth(x));
                }
                (_, Some(exponent)) => {
                    return electrostatic(&|v2, x| exponent * actuator.saturated(v2) * actuator.force_growth(x));
                }
                _ => {}
            }
        }
        let change = self.stiffness_change(&self.shared.displacement, variable)?;
        let mut force: Spectrum = change.iter().map(|change| -change).collect();
        if let (Variable::Mass, DriveSpectra::Voltage { ones, .. }) = (variable, &self.record.drive) {
            let weight = actuator.preload_n();
            force.iter_mut().zip(ones).for_each(|(f, one)| *f += one * weight);
        }
        Some(force)
    }
}
