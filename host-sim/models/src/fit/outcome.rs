//! Result of a fit.

use std::sync::atomic::Ordering;

use super::candidate::Candidate;
use super::observation::Observation;
use super::readings::ReadingFit;
use super::search::{Context, Found};
use super::selection::StructureRow;
use super::settings::Settings;
use super::uncertainty::Uncertainty;
use super::warnings::{self, Misfit, Warning};
use crate::agreement::{Agreement, mean_r2};
use crate::error::{Error, Result};
use crate::files::recording::Input;

/// A fit.
#[derive(Clone, Debug)]
pub struct Fit {
    /// The best candidate.
    pub candidate: Candidate,
    /// Modelled values at the measured times of every observation.
    pub modelled: Vec<Vec<f64>>,
    /// Offset and gain of every observation's readings.
    pub readings: Vec<ReadingFit>,
    /// Rate of the model along every observation, Hz.
    pub rates_hz: Vec<f64>,
    /// Agreement with every observation.
    pub agreements: Vec<Agreement>,
    /// Mean of the observations' R².
    pub r2_mean: f64,
    /// Structures that were compared; empty for a single structure.
    pub structures: Vec<StructureRow>,
    /// Uncertainty of the parameters, if it was computed.
    pub uncertainty: Option<Uncertainty>,
    /// Warnings to the user.
    pub warnings: Vec<Warning>,
    /// Number of residual evaluations.
    pub evaluations: usize,
    /// Whether the search was ended early.
    pub interrupted: bool,
}

impl Fit {
    /// The fit that ends with `found`.
    ///
    /// # Errors
    ///
    /// [`Error::Computation`] if `found` has no response.
    pub(super) fn new(
        context: &Context<'_>,
        observations: &[Observation],
        settings: &Settings,
        found: Found,
        structures: Vec<StructureRow>,
        uncertainty: Option<Uncertainty>,
        interrupted: bool,
    ) -> Result<Self> {
        let objective = context.fine;
        let no_response = || Error::Computation("the fit has no response; check the units of the recordings".into());
        let mut candidate = found.candidate;
        let evaluation = objective.evaluate(&candidate).ok_or_else(no_response)?;
        let (modelled, mut readings) = (evaluation.modelled, evaluation.readings);
        // Offsets are of the sensor; the file's is that of the first recording.
        if observations[0].reading.own_offset && !matches!(observations[0].input, Input::Displacement(_)) {
            for reading in &mut readings {
                reading.offset += reading.gain * candidate.offset_m;
            }
            candidate.offset_m = readings[0].offset;
        }
        let pairs = || objective.measured().zip(&modelled);
        let agreements: Vec<Agreement> = pairs().map(|(y, x)| Agreement::new(y, x)).collect();
        let r2_mean = mean_r2(&agreements);
        let residuals: Vec<Vec<f64>> = pairs().map(|(y, x)| y.iter().zip(x).map(|(y, x)| x - y).collect()).collect();
        let left_out_pct = structures.iter().find(|row| row.chosen).and_then(|row| row.left_out_nrmse_pct);

        let mut warnings = Vec::new();
        warnings::of_sizes(settings, context.excitation, &mut warnings);
        warnings::of_excitation(context.excitation, &mut warnings);
        warnings::of_amplitudes(observations, &candidate, &mut warnings);
        if let Some(uncertainty) = &uncertainty {
            warnings::of_uncertainty(uncertainty, &candidate, &mut warnings);
            let misfit = Misfit::new(observations, &residuals, uncertainty.lag_one);
            let (drive, samples) = (&observations[0].input, objective.samples());
            warnings::of_whiteness(uncertainty, misfit, drive, left_out_pct, samples, &mut warnings);
        }
        warnings::of_convergence(found.minimum.converged || interrupted, &mut warnings);
        warnings::of_outliers(&residuals.concat(), settings.loss, &mut warnings);
        warnings::of_units(observations, &settings.actuator, r2_mean, settings.loss, &mut warnings);
        Ok(Self {
            candidate,
            readings,
            rates_hz: observations.iter().map(|observation| observation.rate_hz).collect(),
            modelled,
            agreements,
            r2_mean,
            structures,
            uncertainty,
            warnings,
            evaluations: context.evaluations.load(Ordering::Relaxed),
            interrupted,
        })
    }
}
