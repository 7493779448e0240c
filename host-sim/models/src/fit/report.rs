//! The report of a fit: one document for the command line's JSON, its page and Python; and as text.

use std::fmt::Write;
use std::path::Path;

use host_io::choice::Choice;
use host_io::terminal::rounded;
use serde::Serialize;
use springpot::{Actuator, TemperatureDependence};

use super::checks::{self, BranchRow};
use super::{Fit, StructureRow, Uncertainty, Warning};
use crate::agreement::{Agreement, RecordingAgreement};
use crate::compression::Compression;
use crate::cost::Cost;
use crate::files::parameters::Parameters;
use crate::files::recording::Direction;
use crate::replay::expectation::Expectation;

/// Rate that the compression is reported for, Hz: the usual rate of a controller.
const CONTROLLER_HZ: f64 = 1000.0;

/// When, by which program and by which command a result was made.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Origin {
    /// Date and time, UTC.
    pub date: String,
    /// Program and version.
    pub tool: String,
    /// The command as a shell takes it.
    pub command: String,
}

/// The report of a fit.
#[derive(Serialize)]
pub struct FitReport {
    /// One row per recording.
    pub recordings: Vec<RecordingRow>,
    /// Mean of the recordings' R².
    pub r2_mean: f64,
    /// Largest RMS error to expect of feedforward, or of a predicted force, within what was recorded, % of the stroke or of the force's range.
    pub expected_pct: f64,
    /// The file of the parameters, if they are written to one.
    pub parameters_file: Option<String>,
    /// Duration, s.
    pub seconds: f64,
    /// Number of residual evaluations.
    pub evaluations: usize,
    /// Topology of the model.
    pub topology: &'static str,
    /// Number of branches.
    pub branches: usize,
    /// Input of the model: `force` or `displacement`.
    pub drive: &'static str,
    /// Whether the search was ended early.
    pub interrupted: bool,
    /// Structures that were compared; empty for a single structure.
    pub structures: Vec<StructureRow>,
    /// Uncertainty of the parameters, if it was computed.
    pub uncertainty: Option<Uncertainty>,
    /// Cost of the compression of the law's memory at the controller's usual rate; none if there is no law at that rate.
    pub compression: Option<Compression>,
    /// Cost of the law on a controller.
    pub cost: Cost,
    /// Relaxation times of the branches.
    pub relaxations: Vec<BranchRow>,
    /// The film and its actuator.
    pub film: FilmRow,
    /// The error to expect of feedforward along a reference, if one is given.
    #[serde(flatten)]
    pub expectation: Option<Expectation>,
    /// When, by which program and by which command, if a command made it.
    pub made: Option<Origin>,
    /// Warnings to the user.
    pub warnings: Vec<Warning>,
}

/// A film and its actuator.
#[derive(Serialize)]
pub struct FilmRow {
    /// The actuator.
    #[serde(flatten)]
    pub actuator: Actuator,
    /// Reading of the displacement sensor at x = 0, m.
    pub sensor_offset_m: f64,
    /// Time by which the displacement sensor's readings are late, s.
    pub sensor_delay_s: f64,
    /// Whether length, width and thickness are assumed.
    pub sizes_assumed: bool,
    /// The elastic curve: `linear` for none.
    pub curve: String,
    /// How the temperature changes it, if that is known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub temperature: Option<TemperatureDependence>,
}

/// Agreement of a fit with a recording.
#[derive(Serialize)]
pub struct RecordingRow {
    /// The agreement itself.
    #[serde(flatten)]
    pub agreement: RecordingAgreement,
    /// SHA-256 of the file.
    pub sha256: String,
    /// Rate of the model along the recording, Hz.
    pub rate_hz: f64,
    /// Offset of its readings where it has its own, m or N.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<f64>,
    /// Gain of its readings where it has its own, relative to the first recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain: Option<f64>,
}

impl FitReport {
    /// The report of `fit` to the recordings in `files`, which took `seconds`.
    pub fn new(fit: &Fit, parameters: &Parameters, direction: Direction, files: &[&Path], seconds: f64) -> Self {
        let digests = digests(parameters);
        let row = |(index, (file, agreement)): (usize, (&&Path, &Agreement))| RecordingRow {
            agreement: RecordingAgreement::new(file, direction, agreement),
            sha256: digests.get(index).cloned().unwrap_or_default(),
            rate_hz: fit.rates_hz[index],
            offset: fit.readings[index].own_offset(),
            gain: fit.readings[index].own_gain(),
        };
        Self {
            recordings: files.iter().zip(&fit.agreements).enumerate().map(row).collect(),
            r2_mean: fit.r2_mean,
            expected_pct: fit.expected_pct,
            parameters_file: None,
            seconds,
            evaluations: fit.evaluations,
            topology: fit.candidate.topology.name(),
            branches: fit.candidate.branches(),
            drive: direction.name(),
            interrupted: fit.interrupted,
            structures: fit.structures.clone(),
            uncertainty: fit.uncertainty.clone(),
            compression: Compression::new(parameters.film(), CONTROLLER_HZ).ok(),
            cost: Cost::new(parameters.film()),
            relaxations: checks::branch_rows(&fit.candidate),
            film: FilmRow {
                actuator: parameters.actuator,
                sensor_offset_m: parameters.sensor_offset_m,
                sensor_delay_s: parameters.sensor_delay_s,
                sizes_assumed: parameters.assumed_sizes,
                curve: fit.candidate.curve_name(),
                temperature: parameters.temperature,
            },
            expectation: None,
            made: None,
            warnings: fit.warnings.clone(),
        }
    }

    /// The report as text, without the warnings.
    pub fn text(&self) -> String {
        let mut text = String::new();
        if !self.structures.is_empty() {
            structures(&self.structures, &mut text);
            text.push('\n');
        }
        if let Some(uncertainty) = &self.uncertainty {
            estimates(uncertainty, &mut text);
            text.push('\n');
        }
        for row in &self.recordings {
            let RecordingAgreement { file, r2, nrmse_pct, rmse_n, .. } = &row.agreement;
            let _ = write!(text, "{file}: R² {r2:.6}, NRMSE {nrmse_pct:.3} %, at {} Hz", rounded(row.rate_hz));
            let (scale, unit) = if rmse_n.is_some() { (1e3, "mN") } else { (1e6, "µm") };
            if let Some(offset) = row.offset {
                let _ = write!(text, ", offset {:.3} {unit}", scale * offset);
            }
            if let Some(gain) = row.gain {
                let _ = write!(text, ", gain {gain:.5}");
            }
            text.push('\n');
        }
        let _ = write!(
            text,
            "{}{} with n = {}, R² mean {:.6}, {} evaluations in {:.1} s{}",
            self.parameters_file.as_ref().map_or_else(String::new, |file| format!("{file}: ")),
            self.topology,
            self.branches,
            self.r2_mean,
            self.evaluations,
            self.seconds,
            if self.interrupted { ", interrupted: the best so far" } else { "" }
        );
        if let Some(dependence) = &self.film.temperature {
            let warmer_c = dependence.reference_c + 10.0;
            let (stiffness, time) = (dependence.stiffness_factor(warmer_c), dependence.time_factor(warmer_c));
            let _ = write!(
                text,
                "\nparameters at {:.1} °C; 10 K warmer the film has {stiffness:.3} times the stiffness and {time:.3} times the creep times",
                dependence.reference_c
            );
        }
        for line in self.expectation.iter().flat_map(Expectation::lines) {
            let _ = write!(text, "\n{line}");
        }
        text
    }
}

/// The digests of the recordings behind `parameters`, which their provenance holds.
fn digests(parameters: &Parameters) -> Vec<String> {
    let recordings = parameters.provenance.as_ref().and_then(|table| table.get("recordings")?.as_array());
    let digest = |row: &toml::Value| row.get("sha256").and_then(toml::Value::as_str).unwrap_or_default().to_owned();
    recordings.into_iter().flatten().map(digest).collect()
}

fn structures(rows: &[StructureRow], text: &mut String) {
    let _ = writeln!(text, "structure     variables        R²   NRMSE %      ΔAIC      ΔBIC  left out, NRMSE %");
    for row in rows {
        let left_out = row.left_out_nrmse_pct.map_or_else(|| "–".into(), |value| format!("{value:.3}"));
        let _ = writeln!(
            text,
            "{:8} n = {} {:>9} {:>9.6} {:>9.3} {:>9.0} {:>9.0} {left_out:>12}  {}{}",
            row.topology.name(),
            row.branches,
            row.variables,
            row.r2_mean,
            row.nrmse_pct,
            row.delta_aic,
            row.delta_bic,
            row.nonlinearity(),
            if row.chosen { "  chosen" } else { "" }
        );
    }
}

fn estimates(uncertainty: &Uncertainty, text: &mut String) {
    let end = |end: Option<f64>| end.map_or_else(|| "open".into(), |value| format!("{value:.4e}"));
    let why = uncertainty.no_intervals.map_or_else(String::new, |why| format!(": none, {why}"));
    let _ = writeln!(text, "{:22} {:>12}  95 % interval{why}", "parameter", "value");
    for estimate in &uncertainty.estimates {
        let (low, high) = (end(estimate.low), end(estimate.high));
        let interval = if uncertainty.no_intervals.is_some() { String::new() } else { format!("{low} … {high}") };
        let _ = writeln!(text, "{:22} {:>12.5e}  {interval}", estimate.name, estimate.value);
    }
}
