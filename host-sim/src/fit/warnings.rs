//! Warnings to the user of a fit.

use springpot::Actuator;

use super::bend::Bend;
use super::candidate::Candidate;
use super::loss::{self, Loss};
use super::observation::{Excitation, Observation, median};
use super::uncertainty::Uncertainty;
use crate::files::recording::Input;

/// Inputs that do not vary.
pub fn of_excitation(excitation: Excitation, warnings: &mut Vec<String>) {
    if !excitation.varies {
        let shown =
            if excitation.displacement_fitted { "creep under one load" } else { "relaxation at one displacement" };
        warnings.push(format!("the input is constant: the recordings show {shown} only"));
    }
}

/// A curve or a saturation that one amplitude alone determines.
pub fn of_amplitudes(observations: &[Observation], candidate: &Candidate, warnings: &mut Vec<String>) {
    let bent = candidate.bend != Bend::Straight || candidate.actuator.saturation_v.is_some();
    let mut peaks: Vec<f64> = observations.iter().flat_map(|o| peaks(&o.input.samples().value)).collect();
    peaks.sort_by(f64::total_cmp);
    let (Some(least), Some(most)) = (peaks.first(), peaks.last()) else { return };
    // Several cycles, all as large.
    if bent && peaks.len() > observations.len() && *least > 0.8 * most {
        warnings.push(
            "only one amplitude was recorded: the curve is open, since creep and stiffening look alike there; record a second \
             amplitude, half as large"
                .into(),
        );
    }
}

/// The turning points of a drive (sizes) at the upper half of its range.
fn peaks(values: &[f64]) -> Vec<f64> {
    let most = values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
    let mut peaks = Vec::new();
    let mut highest = 0.0;
    for value in values.iter().map(|value| value.abs()) {
        if value > highest {
            highest = value;
        } else if value < 0.5 * highest && highest > 0.1 * most {
            // It has come down: that was a peak.
            peaks.push(highest);
            highest = value;
        } else if value < 0.05 * most {
            highest = value;
        }
    }
    if highest > 0.1 * most {
        peaks.push(highest);
    }
    peaks
}

/// A search that did not converge.
pub fn of_convergence(converged: bool, warnings: &mut Vec<String>) {
    if !converged {
        warnings.push("the search ran out of iterations; continue it with --start and this result".into());
    }
}

/// What the data do not determine; `residuals` in the unit of the measurement.
pub fn of_uncertainty(uncertainty: &Uncertainty, residuals: &[f64], warnings: &mut Vec<String>) {
    for set in &uncertainty.undetermined {
        warnings.push(format!("the recordings leave {set} free: other values fit as well"));
    }
    let at_bound: Vec<String> = uncertainty
        .estimates
        .iter()
        .filter(|estimate| estimate.at_bound)
        .map(|estimate| format!("{} = {}", estimate.name, estimate.value))
        .collect();
    if !at_bound.is_empty() {
        let idle = at_bound.iter().any(|name| name.contains(".c = "));
        let mend = if idle { "; a branch whose c is on its bound has no effect: fewer branches will do" } else { "" };
        warnings.push(format!("on their bounds: {}{mend}", at_bound.join(", ")));
    }
    if !uncertainty.white {
        let rms = (residuals.iter().map(|r| r * r).sum::<f64>() / residuals.len() as f64).sqrt();
        warnings.push(format!(
            "the residuals (RMS {rms:.2e}) are not white (autocorrelation {:.2} at lag one): the model is incomplete, and the \
             intervals count {:.0} independent samples instead of {}",
            uncertainty.lag_one,
            uncertainty.effective_samples,
            residuals.len()
        ));
    }
}

/// Outliers.
pub fn of_outliers(residuals: &[f64], loss: Loss, warnings: &mut Vec<String>) {
    // Outliers shift the fit, so that the mean of the other residuals is not zero.
    let middle = median(residuals);
    let centred: Vec<f64> = residuals.iter().map(|r| r - middle).collect();
    let limit = 6.0 * loss::robust_deviation(&centred);
    let outliers = centred.iter().filter(|r| r.abs() > limit).count();
    if outliers > 0 && limit > 0.0 {
        let mend = if loss == Loss::Square { "; --loss huber reduces their effect" } else { "" };
        warnings.push(format!("{outliers} outliers (more than 6 standard deviations){mend}"));
    }
}

/// Above the breakdown field of any film, V/m.
const HIGHEST_FIELD: f64 = 1e9;

/// Values that suggest wrong units.
pub fn of_units(
    observations: &[Observation],
    actuator: &Actuator,
    r2_mean: f64,
    loss: Loss,
    warnings: &mut Vec<String>,
) {
    for observation in observations {
        let name = &observation.name;
        if let Input::Voltage(voltage) = &observation.input {
            let peak = voltage.value.iter().fold(0.0, |peak: f64, v| peak.max(v.abs()));
            let field = peak / actuator.thickness_m;
            if field > HIGHEST_FIELD {
                warnings.push(format!(
                    "{name}: {peak} V over {} m are {field:.1e} V/m; check the units",
                    actuator.thickness_m
                ));
            }
        }
        if !matches!(observation.input, Input::Displacement(_)) {
            let stroke = loss::percentile_range(observation.measured.value.iter().copied());
            let size = actuator.length_m.max(actuator.width_m);
            if stroke > 2.0 * size {
                warnings.push(format!("{name}: a stroke of {stroke:.3} m of a film of {size} m; check the units"));
            }
        }
    }
    if r2_mean < 0.5 && loss == Loss::Square {
        warnings.push(format!(
            "the model explains little (R² {r2_mean:.3}): check the units, and that displacement grows with voltage"
        ));
    }
}
