use maud::html;

use super::result::Report;
use crate::fit::Fit;
use crate::fit::objective::Observation;
use crate::fit::observation::Direction;
use crate::fit::selection::name_of;
use crate::report::html;
use crate::report::plot::{COLOURS, Line, Panel};

/// The page of a fit: what was found, how well it agrees, and how far it can be trusted.
pub(in crate::commands) fn page(report: &Report, fit: &Fit, observations: &[Observation], drive: Direction) -> String {
    let recordings: Vec<(bool, Vec<String>)> = report
        .recordings
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
    let structures: Vec<(bool, Vec<String>)> = report
        .structures
        .iter()
        .map(|row| {
            let cells = vec![
                format!("{}, n = {}", name_of(row.topology), row.branches),
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
    let end = |end: Option<f64>| end.map_or_else(|| "open".into(), |value| format!("{value:.4e}"));
    let estimates: Vec<(bool, Vec<String>)> = report
        .trust
        .iter()
        .flat_map(|trust| &trust.estimates)
        .map(|e| (false, vec![e.name.clone(), format!("{:.5e}", e.value), end(e.low), end(e.high)]))
        .collect();
    let body = html! {
        p {
            (report.topology) " with n = " (report.branches) ", R² mean " (format!("{:.6}", report.r2_mean)) ", "
            (report.evaluations) " evaluations in " (format!("{:.1}", report.seconds)) " s. Parameters: "
            code { (report.parameters_file) } "."
        }
        @for warning in &report.warnings { p.warning { (warning) } }
        h2 { "Agreement" }
        (html::table(&["recording", "R²", "NRMSE %", "RMSE", "samples"], &recordings))
        (html::figure(&panels(fit, observations, drive)))
        @if !structures.is_empty() {
            h2 { "Structures" }
            @let judged = if report.recordings.len() > 1 { "on left-out recordings" } else { "by the Bayesian criterion" };
            p { "The smallest structure that is not worse than the best " (judged) " is chosen." }
            (html::table(
                &["structure", "variables", "R²", "NRMSE %", "ΔAIC", "ΔBIC", "left out, NRMSE %"],
                &structures,
            ))
        }
        @if !estimates.is_empty() {
            h2 { "Parameters" }
            p {
                "SI units, with 95 % intervals from the profile likelihood. An end that the data do not set is open, or for an "
                "order 0 or 1."
            }
            (html::table(&["parameter", "value", "from", "to"], &estimates))
        }
    };
    html::page("Fit of the fully fractional generalised Maxwell model", &body)
}

/// Measured and modelled, and their difference, for every recording.
fn panels(fit: &Fit, observations: &[Observation], drive: Direction) -> Vec<Panel> {
    let (what, factor, unit, fine, fine_unit) = match drive {
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
