//! The page of a fit.

use maud::{Markup, html};

use super::fit_report::{FitReport, RecordingRow};
use super::html;
use super::plot::{COLOURS, Line, Panel};
use crate::files::recording::Direction;
use crate::fit::Fit;
use crate::fit::observation::Observation;
use crate::fit::selection::StructureRow;
use crate::fit::settings::topology_name;
use crate::fit::uncertainty::Uncertainty;

/// The page of a fit: the model, its agreement with the recordings, and its uncertainty.
pub fn page(report: &FitReport, fit: &Fit, observations: &[Observation], direction: Direction) -> String {
    let body = html! {
        p {
            (report.topology) " with n = " (report.branches) ", R² mean " (format!("{:.6}", report.r2_mean)) ", "
            (report.evaluations) " evaluations in " (format!("{:.1}", report.seconds)) " s. Parameters: "
            code { (report.parameters_file) } "."
        }
        @for warning in &report.warnings { p.warning { (warning) } }
        h2 { "Agreement" }
        (agreement_table(&report.recordings))
        (html::figure(&panels(fit, observations, direction)))
        @if !report.structures.is_empty() {
            h2 { "Structures" }
            @let by = if report.recordings.len() > 1 { "on left-out recordings" } else { "by the Bayesian criterion" };
            p { "The smallest structure that is not worse than the best " (by) " is chosen." }
            (structure_table(&report.structures))
        }
        @if let Some(uncertainty) = report.uncertainty.as_ref().filter(|u| !u.estimates.is_empty()) {
            h2 { "Parameters" }
            p {
                "SI units, with 95 % intervals from the profile likelihood. An end that the data do not set is open, or for an "
                "order 0 or 1."
            }
            (estimate_table(uncertainty))
        }
        @if let Some(compression) = &report.compression {
            h2 { "On a controller" }
            p { (sentence(&compression.text())) }
        }
    };
    html::page("Fit of the fully fractional generalised Maxwell model", &body)
}

/// `line` with a capital and a full stop.
fn sentence(line: &str) -> String {
    let (first, rest) = line.split_at(line.chars().next().map_or(0, char::len_utf8));
    format!("{}{rest}.", first.to_uppercase())
}

fn agreement_table(recordings: &[RecordingRow]) -> Markup {
    let rows: Vec<(bool, Vec<String>)> = recordings
        .iter()
        .map(|row| {
            let rmse = row.rmse_m.map(|m| format!("{:.2} µm", 1e6 * m));
            let rmse = rmse.or_else(|| row.rmse_n.map(|n| format!("{:.3} mN", 1e3 * n))).unwrap_or_default();
            let cells = vec![
                row.file.clone(),
                format!("{:.6}", row.r2),
                format!("{:.3}", row.nrmse_pct),
                rmse,
                row.samples.to_string(),
            ];
            (false, cells)
        })
        .collect();
    html::table(&["recording", "R²", "NRMSE %", "RMSE", "samples"], &rows)
}

fn structure_table(structures: &[StructureRow]) -> Markup {
    let rows: Vec<(bool, Vec<String>)> = structures
        .iter()
        .map(|row| {
            let cells = vec![
                format!("{}, n = {}", topology_name(row.topology), row.branches),
                row.nonlinearity(),
                row.variables.to_string(),
                format!("{:.6}", row.r2_mean),
                format!("{:.3}", row.nrmse_pct),
                format!("{:.0}", row.delta_aic),
                format!("{:.0}", row.delta_bic),
                row.left_out_nrmse_pct.map_or_else(|| "–".into(), |value| format!("{value:.3}")),
            ];
            (row.chosen, cells)
        })
        .collect();
    html::table(&["structure", "curve", "variables", "R²", "NRMSE %", "ΔAIC", "ΔBIC", "left out, NRMSE %"], &rows)
}

fn estimate_table(uncertainty: &Uncertainty) -> Markup {
    let end = |end: Option<f64>| end.map_or_else(|| "open".into(), |value| format!("{value:.4e}"));
    let rows: Vec<(bool, Vec<String>)> = uncertainty
        .estimates
        .iter()
        .map(|e| (false, vec![e.name.clone(), format!("{:.5e}", e.value), end(e.low), end(e.high)]))
        .collect();
    html::table(&["parameter", "value", "from", "to"], &rows)
}

/// Measured and modelled, and their difference, for every recording.
fn panels(fit: &Fit, observations: &[Observation], direction: Direction) -> Vec<Panel> {
    let (what, factor, unit, fine, fine_unit) = match direction {
        Direction::Force => ("displacement", 1e3, "mm", 1e6, "µm"),
        Direction::Displacement => ("force", 1.0, "N", 1e3, "mN"),
    };
    observations
        .iter()
        .zip(&fit.modelled)
        .flat_map(|(observation, modelled)| {
            let time = &observation.measured.time_s;
            let scaled = |values: &[f64]| values.iter().map(|v| factor * v).collect::<Vec<f64>>();
            let difference: Vec<f64> =
                modelled.iter().zip(&observation.measured.value).map(|(model, y)| fine * (model - y)).collect();
            [
                Panel::new(&observation.name, "time (s)", format!("{what} ({unit})"))
                    .with(
                        Line::new("measured", time, &scaled(&observation.measured.value)).wide(3.0).coloured("#bdbdbd"),
                    )
                    .with(Line::new("model", time, &scaled(modelled)).coloured(COLOURS[1])),
                Panel::new(
                    format!("{}: model minus measured", observation.name),
                    "time (s)",
                    format!("difference ({fine_unit})"),
                )
                .with(Line::new("difference", time, &difference).coloured(COLOURS[2])),
            ]
        })
        .collect()
}
