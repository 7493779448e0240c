//! Checks of the result of a fit: what each branch does, and warnings about the result.

use std::f64::consts::FRAC_PI_2;
use std::fmt;

use host_io::choice::Choice;
use host_io::terminal::rounded;
use num_complex::Complex;
use serde::Serialize;
use springpot::{Actuator, Maxwell, Springpot, TemperatureDependence, Topology};

use super::candidate::Candidate;
use super::observation::{Excitation, MIN_SPAN_K, Observation, temperatures_c};
use super::preparation::Severity::{Caution, Note, Serious};
use super::preparation::Warning;
use super::residuals::{Loss, Whiteness};
use super::selection::{StructureRow, has_one_amplitude};
use super::settings::Settings;
use super::uncertainty::Uncertainty;
use crate::files::parameters::plausibility;
use crate::files::recording::Input;
use crate::statistics::{median, peak, percentile_range, robust_deviation};

/// Sizes that are not the film's own, and a scale of the force that is not that of the sizes: only a voltage needs them.
pub fn of_sizes(settings: &Settings, fitted: &Actuator, excitation: Excitation, warnings: &mut Vec<Warning>) {
    if !excitation.voltage_driven {
        return;
    }
    let stated = settings.actuator.relative_permittivity;
    let scale = fitted.relative_permittivity;
    // Of assumed sizes the warning below says that they are only proportional.
    let is_stated = !settings.assumed_sizes && plausibility::is_permittivity(stated);
    if is_stated && !plausibility::is_permittivity(scale) {
        warnings.push(Note.warning(format!(
            "relative_permittivity = {} instead of {stated} is the scale of the force in which mass_kg has the inertia that was recorded: \
             c and forces are in it, voltages and displacements do not depend on it; correct mass_kg or the sizes if they are wrong",
            rounded(scale)
        )));
    }
    let stated = plausibility::doubts(&settings.actuator, true);
    let found = plausibility::doubts(fitted, true).into_iter().filter(|doubt| !stated.contains(doubt));
    warnings.extend(
        found.map(|doubt| {
            Serious.warning(format!("{doubt}, as fitted: state the right sizes and mass_kg, and hold them"))
        }),
    );
    if settings.assumed_sizes {
        let Actuator { length_m, width_m, thickness_m, .. } = settings.actuator;
        warnings.push(Serious.warning(format!(
            "the film's sizes are assumed ({:.0} mm × {:.0} mm × {:.0} µm, the paper's): displacements hold well below the resonance, \
             forces and c are only proportional, and no field limit is checked; give the film's own sizes with `actuator`",
            1e3 * length_m,
            1e3 * width_m,
            1e6 * thickness_m
        )));
    }
}

/// Temperatures whose effect was not fitted, or is that of no elastomer.
pub fn of_temperatures(observations: &[Observation], candidate: &Candidate, warnings: &mut Vec<Warning>) {
    /// Slopes, 1/K, and activation energies, kJ/mol, of elastomers.
    const MAX_SLOPE: f64 = 0.03;
    const ACTIVATIONS: std::ops::RangeInclusive<f64> = -10.0..=250.0;
    if let Some(TemperatureDependence { stiffness_per_k, activation_kj_per_mol, .. }) = candidate.temperature
        && (stiffness_per_k.abs() > MAX_SLOPE || !ACTIVATIONS.contains(&activation_kj_per_mol))
    {
        warnings.push(Serious.warning(format!(
            "{:.1} % of the stiffness per K and {activation_kj_per_mol:.0} kJ/mol are those of no elastomer: record the same voltages at each temperature",
            100.0 * stiffness_per_k
        )));
    }
    let has = |observation: &&Observation| observation.temperature_c.is_some();
    if let (Some(_), Some(without)) = (observations.iter().find(has), observations.iter().find(|o| !has(o))) {
        warnings.push(Serious.warning(format!(
            "{} has no column temperature_c, and others have: it is taken as at their temperature",
            without.name
        )));
    }
    let Some((low, high)) = temperatures_c(observations).filter(|_| candidate.temperature.is_none()) else { return };
    let text = if high - low < MIN_SPAN_K {
        format!(
            "recorded at {:.1} °C: what another temperature changes is not known; recordings at two temperatures at least {MIN_SPAN_K} K apart show it",
            0.5 * (low + high)
        )
    } else {
        format!(
            "recorded at {low:.1} to {high:.1} °C, and pattern search fits no dependence on the temperature: use `method` lm"
        )
    };
    let severity = if high - low < MIN_SPAN_K { Note } else { Serious };
    warnings.push(severity.warning(text));
}

/// Inputs that do not vary.
pub fn of_excitation(excitation: Excitation, warnings: &mut Vec<Warning>) {
    if !excitation.varies {
        let shown =
            if excitation.displacement_fitted { "creep under one load" } else { "relaxation at one displacement" };
        warnings.push(Note.warning(format!("the input is constant: the recordings show {shown} only")));
    }
}

/// A sensor that is late.
pub fn of_delay(candidate: &Candidate, uncertainty: Option<&Uncertainty>, warnings: &mut Vec<Warning>) {
    let delay = uncertainty.and_then(|uncertainty| uncertainty.estimates.iter().find(|e| e.name == "delay_s"));
    let interval = match delay.map(|delay| (delay.low, delay.high)) {
        Some((Some(low), Some(high))) => format!(" ({:.1} to {:.1} ms)", 1e3 * low, 1e3 * high),
        _ => String::new(),
    };
    let ms = 1e3 * candidate.delay_s.abs();
    let text = if candidate.delay_s > 0.0 {
        format!(
            "the stroke lags by {ms:.1} ms{interval}: a late sensor, or, if the voltage is a command, the amplifier. The film is fitted without \
             that lag, and an observer takes the sensor as so late; `sensor_delay_s` fixes it"
        )
    } else {
        format!(
            "the voltage lags the stroke by {ms:.1} ms{interval}: a slow monitor, clocks that differ, or a stroke that was smoothed without delay (moving average, filtfilt). The film is fitted without that lag; \
             `sensor_delay_s` fixes it"
        )
    };
    warnings.push(Caution.warning(text));
}

/// Structures that fit better than the chosen one and could not be compared on what was left out.
pub fn of_structures(rows: &[StructureRow], warnings: &mut Vec<Warning>) {
    let chosen = rows.iter().find(|row| row.chosen).map_or(0.0, |row| row.nrmse_pct);
    for row in rows.iter().filter(|row| row.nrmse_pct < chosen && row.left_out_missing.is_some()) {
        warnings.push(Caution.warning(format!(
            "{} n = {} {} fits with {:.3} % instead of {chosen:.3} % and was not chosen, because {}; ask for it with `curve` and `branches`",
            row.topology.name(),
            row.branches,
            row.nonlinearity(),
            row.nrmse_pct,
            row.left_out_missing.as_deref().unwrap_or_default()
        )));
    }
}

/// A curve or a saturation that one amplitude alone determines.
pub fn of_amplitudes(observations: &[Observation], candidate: &Candidate, warnings: &mut Vec<Warning>) {
    let bent = !candidate.is_straight() || candidate.actuator.saturation_v.is_some();
    if bent && has_one_amplitude(observations) {
        warnings.push(Caution.warning(
            "only one amplitude was recorded: the curve is open, since creep and stiffening look alike there; record a second \
             amplitude, half as large"));
    }
}

/// An order of the main springpot at its limit.
pub fn of_order(candidate: &Candidate, warnings: &mut Vec<Warning>) {
    let what = match candidate.elements[0].alpha {
        0.0 => "0, its lower limit: a plain spring, without creep beyond the slowest relaxation time",
        1.0 => "1, its upper limit: a plain dashpot, which never comes to rest under a constant load",
        _ => return,
    };
    warnings.push(Note.warning(format!("main.alpha is {what}; record longer, with slower and faster cycles")));
}

/// A search that did not converge.
pub fn of_convergence(converged: bool, warnings: &mut Vec<Warning>) {
    if !converged {
        warnings.push(
            Caution.warning(
                "the search ran out of iterations, so the parameters are not final and have no intervals; continue it with `start` and this \
                 result",
            ),
        );
    }
}

/// Values of `candidate` that the data do not determine.
pub fn of_uncertainty(uncertainty: &Uncertainty, candidate: &Candidate, warnings: &mut Vec<Warning>) {
    if !uncertainty.undetermined.is_empty() {
        let sets = uncertainty.undetermined.join("; ");
        let branches = described_branches(candidate, &|branch| sets.contains(&format!("branches[{branch}]")));
        warnings.push(Note.warning(format!("the recordings leave {sets} free: other values fit as well{branches}")));
    }
    let at_bound = |branch: usize, quantity: &str| {
        let of_branch = format!("branches[{branch}]");
        let here = |name: &str| name.starts_with(&of_branch) && name.ends_with(quantity);
        uncertainty.estimates.iter().any(|estimate| estimate.at_bound && here(&estimate.name))
    };
    let idle = described_branches(candidate, &|branch| at_bound(branch, ".c"));
    if !idle.is_empty() {
        warnings.push(
            Note.warning(format!("a branch whose c is on its bound has no effect: fewer branches will do{idle}")),
        );
    }
    if uncertainty.estimates.iter().any(|estimate| estimate.at_bound && estimate.name == "main.c") {
        warnings.push(Note.warning("main.c is on its bound: the springpot beside the branches has no effect"));
    }
    let others: Vec<String> = uncertainty
        .estimates
        .iter()
        .filter(|e| e.at_bound && !e.name.ends_with(".c") && !e.name.ends_with(".alpha"))
        .map(|e| format!("{} = {}", e.name, e.value))
        .collect();
    if !others.is_empty() {
        warnings.push(Caution.warning(format!("on their bounds: {}", others.join(", "))));
    }
}

/// The branches of `candidate` that `concerns` names, each with its relaxation time and its share of the stiffness, in brackets;
/// empty without such branches.
fn described_branches(candidate: &Candidate, concerns: &dyn Fn(usize) -> bool) -> String {
    let all = branch_rows(candidate).into_iter().enumerate();
    let described: Vec<String> =
        all.filter(|(branch, _)| concerns(*branch)).map(|(_, branch)| branch.to_string()).collect();
    if described.is_empty() { String::new() } else { format!(" ({})", described.join("; ")) }
}

/// The part of a measurement that a model does not explain, in % of its stroke: of the range between the 2nd and the 98th percentile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Misfit {
    /// RMS of all residuals, %.
    pub rms_pct: f64,
    /// RMS of the part that is not noise, %: what is left of the residuals at a distance of one sample.
    pub systematic_pct: f64,
    /// The same of the error on what was left out; twice that of the fit where nothing was.
    pub left_out_pct: f64,
}

impl Misfit {
    /// The misfit of `observations` with these residuals, one series each, and the `chosen` structure's errors on what was left out.
    pub fn new(observations: &[Observation], residuals: &[Vec<f64>], chosen: Option<&StructureRow>) -> Self {
        let whiteness = Whiteness::new(residuals.iter().map(Vec::len), &residuals.concat());
        let squares = observations.iter().zip(residuals).flat_map(|(observation, residuals)| {
            let stroke = percentile_range(observation.measured.value.iter().copied()).max(f64::MIN_POSITIVE);
            residuals.iter().map(move |r| (r / stroke).powi(2))
        });
        let count = residuals.iter().map(Vec::len).sum::<usize>().max(1);
        let rms_pct = 100.0 * (squares.sum::<f64>() / count as f64).sqrt();
        // White noise is correlated by chance as well.
        let correlated = (whiteness.lag_one - 2.0 / (count as f64).sqrt()).clamp(0.0, 1.0);
        let systematic_pct = rms_pct * correlated.sqrt();
        let errors = chosen.iter().flat_map(|row| [row.left_out_nrmse_pct, row.left_out_blocks_nrmse_pct]).flatten();
        let noise = chosen.map_or(0.0, |row| row.nrmse_pct.powi(2) * (1.0 - correlated));
        let left_out = errors.map(|error| (error.powi(2) - noise).max(0.0).sqrt()).reduce(f64::max);
        // What independent samples leave open of the parameters, at least.
        let open_pct = rms_pct * (8.0 / whiteness.effective_samples).sqrt().min(1.0);
        let left_out_pct = left_out.unwrap_or(2.0 * systematic_pct).max(systematic_pct).max(open_pct);
        Self { rms_pct, systematic_pct, left_out_pct }
    }
}

/// Error to expect, over what is left of the readings and in % of the stroke at the least, from which it is stated for white residuals as well.
const FAULTY: f64 = 5.0;
const WORTH_A_LINE_PCT: f64 = 0.1;

/// Residuals that are not white: how large what the model does not follow is, and what follows from it: an error of up to `expected_pct`.
pub fn of_whiteness(white: bool, misfit: Misfit, expected_pct: f64, drive: &Input, warnings: &mut Vec<Warning>) {
    // Faults of recordings are no part of the residuals.
    if white && expected_pct < FAULTY * misfit.rms_pct.max(WORTH_A_LINE_PCT) {
        return;
    }
    let (severity, size) = match misfit.systematic_pct.max(expected_pct / FAULTY) {
        small if small < 0.1 => (Note, "negligible"),
        small if small < 0.5 => (Note, "small"),
        medium if medium < 2.0 => (Caution, "notable"),
        _ => (Serious, "large"),
    };
    let (range, follows) = match drive {
        Input::Voltage(_) => ("stroke", "feedforward"),
        Input::Force(_) => ("stroke", "a predicted stroke"),
        Input::Displacement(_) => ("range of the force", "a predicted force"),
    };
    warnings.push(severity.warning(format!(
        "{size}: the model is off by {:.3} % of the {range} RMS, and about {:.3} % is not noise but what it does not follow: expect {follows} \
         to be off by up to {expected_pct:.2} % RMS of the recorded {range} within the recorded strokes, speeds and times, and by more beyond them",
        misfit.rms_pct, misfit.systematic_pct
    )));
}

/// Outliers.
pub fn of_outliers(residuals: &[f64], loss: Loss, warnings: &mut Vec<Warning>) {
    // Outliers shift the fit, so that the mean of the other residuals is not zero.
    let middle = median(residuals);
    let centred: Vec<f64> = residuals.iter().map(|r| r - middle).collect();
    let limit = 6.0 * robust_deviation(&centred);
    let outliers = centred.iter().filter(|r| r.abs() > limit).count();
    if outliers > 0 && limit > 0.0 {
        let advice = if loss == Loss::Square { "; `loss` huber reduces their effect" } else { "" };
        let share = 100.0 * outliers as f64 / residuals.len() as f64;
        warnings.push(Caution.warning(format!(
            "{outliers} outliers ({share:.2} % of the values, more than 6 standard deviations){advice}"
        )));
    }
}

/// Above the breakdown field of any film, V/m.
const MAX_FIELD: f64 = 1e9;

/// Values that suggest wrong units.
pub fn of_units(
    observations: &[Observation],
    actuator: &Actuator,
    r2_mean: f64,
    loss: Loss,
    warnings: &mut Vec<Warning>,
) {
    for observation in observations {
        let name = &observation.name;
        // Only a voltage needs the film's size.
        let Input::Voltage(voltage) = &observation.input else { continue };
        let (peak_v, thickness_m) = (peak(&voltage.value), actuator.thickness_m);
        let field = peak_v / thickness_m;
        if field > MAX_FIELD {
            let text = format!("{name}: {peak_v} V over {thickness_m} m are {field:.1e} V/m; check the units");
            warnings.push(Serious.warning(text));
        }
        let stroke = percentile_range(observation.measured.value.iter().copied());
        let size = actuator.length_m.max(actuator.width_m);
        if stroke > 2.0 * size {
            let text = format!("{name}: a stroke of {stroke:.3} m of a film of {size} m; check the units");
            warnings.push(Serious.warning(text));
        }
    }
    if r2_mean < 0.5 && loss == Loss::Square {
        let grows = match observations.first().map(|observation| &observation.input) {
            Some(Input::Force(_)) => "displacement grows with force",
            Some(Input::Displacement(_)) => "force grows with displacement",
            _ => "displacement grows with voltage",
        };
        warnings.push(
            Serious.warning(format!("the model explains little (R² {r2_mean:.3}): check the units, and that {grows}")),
        );
    }
}

/// A branch in words and numbers.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BranchRow {
    /// Its index in the parameter file, from 0.
    pub branch: usize,
    /// Time at which both of its springpots are equally stiff, s; null where they have the same order.
    pub relaxation_time_s: Option<f64>,
    /// Its share there, %; null without a time or a model.
    pub share_pct: Option<f64>,
    /// The whole that it is a share of.
    pub share_of: &'static str,
}

/// The branches of `candidate`.
pub fn branch_rows(candidate: &Candidate) -> Vec<BranchRow> {
    let model = candidate.model().ok();
    (0..candidate.branches())
        .map(|branch| {
            let [first, second] = pair(candidate, branch);
            // Both springpots are equally stiff at s = 1/τ: c_1 τ^-a = c_2 τ^-b.
            let time_s =
                (second.alpha != first.alpha).then(|| (second.c / first.c).powf(1.0 / (second.alpha - first.alpha)));
            let time_s = time_s.filter(|time_s| time_s.is_finite() && *time_s > 0.0);
            BranchRow {
                branch,
                relaxation_time_s: time_s,
                share_pct: time_s
                    .zip(model.as_ref())
                    .map(|(time_s, model)| share_pct(candidate, model, branch, time_s))
                    // Beyond the range of numbers it has none.
                    .filter(|share_pct| share_pct.is_finite()),
                share_of: match candidate.topology {
                    Topology::Parallel => "stiffness",
                    Topology::Eq11 => "compliance of all branches",
                },
            }
        })
        .collect()
}

impl fmt::Display for BranchRow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "branches[{}]: ", self.branch)?;
        let Some(time_s) = self.relaxation_time_s else {
            return f.write_str("no relaxation time, its springpots have the same order");
        };
        write!(f, "relaxation time {time_s:.3e} s")?;
        match self.share_pct {
            Some(share) => write!(f, ", {share:.2} % of the {} there", self.share_of),
            None => Ok(()),
        }
    }
}

fn pair(candidate: &Candidate, branch: usize) -> [Springpot; 2] {
    [1, 2].map(|k| candidate.elements[2 * branch + k])
}

/// The share of `branch` at s = j / `time_s`, %: of the stiffness, or of the chain's compliance.
fn share_pct(candidate: &Candidate, model: &Maxwell, branch: usize, time_s: f64) -> f64 {
    let ln_s = Complex::new(-time_s.ln(), FRAC_PI_2);
    let of = |e: &Springpot| (ln_s * e.alpha).exp() * e.c;
    let compliance = |branch: usize| pair(candidate, branch).iter().map(|e| of(e).inv()).sum::<Complex<f64>>();
    let share = match candidate.topology {
        Topology::Parallel => compliance(branch).inv() / model.modulus_of_ln(ln_s),
        Topology::Eq11 => compliance(branch) / (0..candidate.branches()).map(compliance).sum::<Complex<f64>>(),
    };
    100.0 * share.norm()
}
