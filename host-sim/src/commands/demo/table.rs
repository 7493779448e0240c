//! What a demo prints.

use std::fmt::Write;

use super::Report;
use super::firmware::Firmware;
use crate::commands::following::{REFITTED_FILM, SIMULATED_FILM};
use crate::commands::replay;

/// The results of a demo in some twenty lines.
pub(super) fn text(report: &Report<'_>) -> String {
    let mut text = String::new();
    let what = if report.simulated { "simulated recordings of a nonlinear film" } else { "recordings" };
    let fit = &report.fit;
    let _ = writeln!(
        text,
        "{} {what}, fitted together in {:.1} s: {} with n = {}",
        report.replay.recordings.len(),
        fit.seconds,
        fit.topology,
        fit.branches
    );
    let _ =
        writeln!(text, "\nreplayed through the controller's code, f32 at 1 kHz:\n{}", replay::table(&report.replay));
    match &report.following.reference {
        None => {
            text.push_str("\nno sine is followed: that needs recorded voltages, and a sine that stays within them\n")
        }
        Some(sine) => {
            let _ = writeln!(
                text,
                "\na sine of {:.2} … {:.2} mm, period {:.1} s, {:.0} s: feasible, largest voltage {:.0} V",
                1e3 * sine.low_m,
                1e3 * sine.high_m,
                sine.period_s,
                sine.duration_s,
                sine.check.largest_voltage_v
            );
        }
    }
    if !report.following.closed_loop.is_empty() {
        let _ = writeln!(text, "followed on {}, error from t = 0:", film(report));
        let _ = writeln!(text, "{:12}  {:>22}  {:>10}", "controller", "RMS, % of peak to peak", "largest µm");
        for row in &report.following.closed_loop {
            let rms = row.quality.tracking_rms_pct.unwrap_or(f64::NAN);
            let _ = writeln!(text, "{:12}  {rms:>22.3}  {:>10.1}", row.controller, 1e6 * row.quality.largest_error_m);
        }
    }
    match &report.firmware {
        None => {}
        Some(Firmware::LeftOut(why)) => {
            let _ = writeln!(text, "\nthe firmware was not run: {why}");
        }
        Some(Firmware::Ran(run)) => {
            let _ = writeln!(
                text,
                "\nthe firmware in QEMU: {} of {} steps of the first recording match this host bit for bit",
                run.steps - run.mismatches,
                run.steps
            );
        }
    }
    end(text, report)
}

/// `text` with the files that were written, and what to do next.
fn end(mut text: String, report: &Report<'_>) -> String {
    let _ = write!(text, "\nwritten: {}", report.files.join(", "));
    if report.interrupted {
        text.push_str("\ninterrupted: the best so far");
    }
    if let Some(page) = report.files.iter().find(|file| file.ends_with(".html")) {
        let _ = write!(text, "\nopen {page} in a browser");
    }
    if report.simulated {
        text.push_str("; with recordings of your own: demo --recordings A.csv B.csv --actuator film-size.toml");
    } else if report.following.reference.is_some() {
        text.push_str(
            "; any signal source can play voltage.csv. film.bin has the paper's bench: before a controller drives a film, give film.toml \
             the [board] of yours",
        );
    }
    if let Some(verdict) = &report.following.verdict {
        let _ = write!(text, "\n{} {verdict}", film(report));
    }
    text
}

/// The film that follows.
fn film(report: &Report<'_>) -> &'static str {
    if report.simulated { SIMULATED_FILM } else { REFITTED_FILM }
}
