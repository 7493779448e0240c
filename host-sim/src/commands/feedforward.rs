//! `feedforward`: the voltage that makes the film follow a reference, or whether there is one.

use super::Verdict;
use super::options::{self, LimitOptions, RunArguments};
use super::prelude::*;
use super::recordings::RecordingOptions;
use crate::grid::Grid;
use crate::replay::expectation::{Expectation, Recorded};
use crate::replay::feasibility::{self, Binding, Feasibility, Limit, Smaller};
use crate::replay::feedforward::{self, VoltagePlan};
use crate::report::axis::{DISPLACEMENT, MICROMETRES, VOLTAGE};
use crate::report::figure::{Colour, Figure, Line, Panel};
use crate::report::figure_file::PlotOption;
use crate::simulation::closed_loop::LimitShare;
use crate::terminal::decimals;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    model: RunArguments,
    #[command(flatten)]
    limits: LimitOptions,
    /// Reference to follow: time_s, displacement_m.
    #[arg(long, value_name = "REF.csv")]
    reference: PathBuf,
    /// Voltage to write: time_s, voltage_v, displacement_m, limited, reference_m.
    #[arg(long, value_name = "V.csv", required_unless_present = "check")]
    out: Option<PathBuf>,
    /// Report whether the reference can be followed, which limit is in the way, and what would make it so, before any voltage is
    /// applied. The exit status is 1 where it cannot be followed.
    #[arg(long)]
    check: bool,
    #[command(flatten)]
    reading: RecordingOptions,
    #[command(flatten)]
    plot: PlotOption,
}

#[derive(Serialize)]
struct Report {
    #[serde(skip_serializing_if = "Option::is_none")]
    out: Option<String>,
    samples: usize,
    rate_hz: f64,
    /// Share of samples at which a limit was met, %, by limit.
    limited_pct: Option<f64>,
    limits_met: Option<Vec<LimitShare>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    largest_voltage_v: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    check: Option<Feasibility>,
    /// Why no error is expected of what was checked.
    #[serde(skip_serializing_if = "Option::is_none")]
    error_note: Option<String>,
    /// Note on the electric field, if the film's sizes are assumed.
    #[serde(skip_serializing_if = "Option::is_none")]
    field_note: Option<String>,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<Verdict> {
    let options = arguments.model.run_options();
    let parameters = arguments.model.law.parameters()?;
    let limits = arguments.limits.limits(parameters.board.as_ref())?;
    let (reference, grid) = arguments.reading.reference(&arguments.reference, options.rate_hz)?;
    let about = |error: Error| error.about(&arguments.model.law.params, &arguments.reference);
    let inputs = [arguments.reference.as_path(), arguments.model.law.params.as_ref()];
    let plot = arguments.plot.check_beside(&inputs, arguments.out.as_deref())?;
    let check =
        arguments.check.then(|| feasibility::check_and_mend(&parameters, &reference, grid, &limits)).transpose();
    let mut report = Report {
        out: arguments.out.as_deref().map(shown),
        samples: grid.samples,
        rate_hz: grid.rate_hz,
        limited_pct: None,
        limits_met: None,
        largest_voltage_v: None,
        check: check.map_err(about)?,
        error_note: (arguments.check && Recorded::from_parameters(&parameters).is_none()).then(|| {
            format!(
                "no error is stated: {} has no record of its recordings, which a fit writes",
                arguments.model.law.params
            )
        }),
        field_note: options::field_note(&parameters),
    };
    if arguments.out.is_some() || plot.is_wanted() {
        let bar = Progress::over(grid.samples as u64, "feedforward");
        let plan = feedforward::plan(&parameters, &reference, grid, &options, limits, &bar).map_err(about)?;
        bar.finish_and_clear();
        let met = plan.limited.iter().filter(|limited| !limited.is_none()).count();
        report.limited_pct = Some(100.0 * met as f64 / report.samples as f64);
        report.limits_met = Some(LimitShare::from_limited(&plan.limited));
        report.largest_voltage_v = Some(plan.voltage_v.iter().copied().fold(0.0, f64::max));
        let table = arguments.out.as_deref().map(|out| stage(out, grid, &plan)).transpose()?;
        let title = format!("Feedforward along {}", shown(&arguments.reference));
        plot.write(&report, table, || Figure::new(title, panels(&reference, &plan, grid)))?;
    }
    terminal::warnings(json, &report.field_note);
    if report.check.is_none() {
        terminal::warnings(json, feasibility::beyond_board(&parameters, &reference));
    }
    terminal::report(json, &report, || text(&report))?;
    Ok(if report.check.is_none_or(|check| check.feasible) { Verdict::Yes } else { Verdict::No })
}

/// The file of `plan`: a recording that `simulate` can play back.
pub(super) fn stage(path: &Path, grid: Grid, plan: &VoltagePlan) -> Result<Staged> {
    let time = grid.times_s();
    let limited: Vec<f64> = plan.limited.iter().map(|limited| f64::from(limited.bits())).collect();
    output::stage_columns(
        path,
        &[
            ("time_s", Some(time.as_slice())),
            ("voltage_v", Some(&plan.voltage_v)),
            ("displacement_m", Some(&plan.displacement_m)),
            ("limited", Some(&limited)),
            ("reference_m", Some(&plan.reference_m)),
        ],
    )
}

fn text(report: &Report) -> String {
    let mut lines = Vec::new();
    if let Some(check) = &report.check {
        lines.extend(verdict(check));
        lines.extend(report.error_note.clone());
    }
    if let (Some(out), Some(largest), Some(met)) = (&report.out, report.largest_voltage_v, &report.limits_met) {
        let met = LimitShare::text(met);
        lines.push(format!("{out}: {} samples, largest voltage {} V, {met}", report.samples, decimals(largest, 0)));
    }
    lines.join("\n")
}

fn verdict(check: &Feasibility) -> Vec<String> {
    let mm = 1e3;
    let band = |offset: f64| {
        let [low, high] = [check.low_m, check.high_m].map(|end| decimals(mm * (end + offset), 3));
        format!("{low} … {high} mm")
    };
    let mut lines = vec![format!(
        "{}: {} from 2 s on, largest voltage {} V, lowest force {} N",
        if check.feasible { "feasible" } else { "not feasible" },
        band(0.0),
        decimals(check.largest_voltage_v, 0),
        decimals(check.lowest_force_n, 3)
    )];
    if let Some(first) = check.first_s {
        lines.push(format!(
            "below 0 V {:.2} % of the time, above the largest voltage {:.2} %, first at {first:.3} s",
            check.below_zero_pct, check.above_largest_pct
        ));
    }
    lines.extend(check.binding.iter().map(limit));
    lines.extend(check.amplifier.iter().flat_map(|demand| {
        let late = "must fall faster than the amplifier's bleeder allows";
        let high = "a command that leads by the amplifier's lag is above the largest voltage";
        let line = |what: &str, pct: f64, first_s: Option<f64>| {
            Some(format!("{what} {pct:.2} % of the time, first at {:.3} s", first_s?))
        };
        [
            line(late, demand.falls_too_fast_pct, demand.falls_too_fast_s),
            line(high, demand.leads_too_high_pct, demand.leads_too_high_s),
        ]
        .into_iter()
        .flatten()
    }));
    if check.beyond_curve_pct > 0.0 {
        lines.push(format!(
            "beyond the stroke that the film's elastic curve or spring was measured over {:.2} % of the time; it goes on linearly there",
            check.beyond_curve_pct
        ));
    }
    // What limits do to the error is not expected.
    lines.extend(check.expectation.iter().filter(|_| check.feasible).flat_map(Expectation::lines));
    lines.extend(match (check.least_offset_m, check.most_offset_m, check.smaller) {
        (Some(least), Some(most), _) => Some(format!(
            "feasible with an offset of {:.3} to {:.3} mm that rises in the first 2 s: {} to {}",
            mm * least,
            mm * most,
            band(least),
            band(most)
        )),
        (.., Some(Smaller { factor, offset_m })) => Some(format!(
            "no offset makes it feasible; {factor:.1} of it with an offset of {:.3} mm that rises in the first 2 s is: {}",
            mm * offset_m,
            format_args!(
                "{:.3} … {:.3} mm",
                mm * (factor * check.low_m + offset_m),
                mm * (factor * check.high_m + offset_m)
            )
        )),
        _ if check.feasible => None,
        _ if check.high_m <= 0.0 => Some(
            "a film only moves to positive displacements, and the reference only to negative ones: change its sign, or add an offset to it".into(),
        ),
        // No offset ends a jump.
        _ if check.binding.iter().any(|binding| binding.at_s == 0.0) && jumps(check) => Some(format!(
            "the reference begins at {:.3} mm, and a film at rest is at 0: let the reference rise from 0, in 2 s or more",
            mm * check.first_m
        )),
        _ => Some("neither an offset nor a smaller stroke makes it feasible: it must be slower".into()),
    });
    lines
}

/// Whether the reference begins with a jump, of more than the noise of a recording.
fn jumps(check: &Feasibility) -> bool {
    check.first_m.abs() > 0.01 * (check.high_m - check.low_m)
}

/// Reference and model, their difference, and the voltage.
fn panels(reference: &[f64], plan: &VoltagePlan, grid: Grid) -> Vec<Panel> {
    let time = grid.times_s();
    let error: Vec<f64> = plan.displacement_m.iter().zip(reference).map(|(x, r)| x - r).collect();
    vec![
        Panel::new("Reference and model", "time (s)", DISPLACEMENT.label())
            .with(Line::new("reference", &time, &DISPLACEMENT.transform(reference)).beneath())
            .with(Line::new("model", &time, &DISPLACEMENT.transform(&plan.displacement_m))),
        Panel::new("Model minus reference", "time (s)", "difference (µm)")
            .with(Line::new("model − reference", &time, &MICROMETRES.transform(&error)).coloured(Colour::VERMILION)),
        Panel::new("Voltage", "time (s)", VOLTAGE.label())
            .with(Line::new("voltage", &time, &VOLTAGE.transform(&plan.voltage_v)).coloured(Colour::GREEN)),
    ]
}

/// A limit that is not kept, in a line.
fn limit(binding: &Binding) -> String {
    let Binding { limit, needed, allowed, at_s } = *binding;
    let (what, per_si, digits, unit, source) = match limit {
        Limit::Force => ("force", 1.0, 3, "N", ""),
        Limit::Voltage => ("voltage", 1.0, 0, "V", " (--max-voltage)"),
        Limit::Field => ("field", 1e-6, 2, "MV/m", " (--max-field)"),
        Limit::Slew => ("change of the voltage", 1e-3, 2, "kV/s", " (--max-slew)"),
        Limit::Velocity => ("speed", 1e3, 1, "mm/s", " (--max-velocity)"),
        Limit::Acceleration => ("acceleration", 1e3, 2, "mm/s²", " (--max-acceleration)"),
        Limit::Displacement => ("displacement", 1e3, 3, "mm", " (max_displacement_m of board.limits)"),
        Limit::Fall => ("fall of the voltage", 1e-3, 2, "kV/s", " by the bleeder (fall_s of board.amplifier)"),
        Limit::Lead => ("command ahead of the amplifier's lag", 1.0, 0, "V", " (--max-voltage)"),
    };
    let shown = |value: f64| format!("{} {unit}", decimals(per_si * value, digits));
    let needed = shown(needed);
    let allowed = match limit {
        Limit::Force => "0 N or more (voltage only stretches a film)".into(),
        _ => shown(allowed) + source,
    };
    format!("limit: {what}: {needed} needed at {at_s:.3} s, {allowed} allowed")
}
