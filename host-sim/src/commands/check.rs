//! `check`: whether recordings identify a film.

use std::fmt::Write;

use super::prelude::*;
use super::recordings::{self, RawOptions};
use super::{Verdict, self_sensing};
use crate::excitation::check::{self, Facts, Report, Severity};
use crate::files::recording::Recording;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    reading: RawOptions,
    /// Recordings of one film.
    #[arg(value_name = "REC.csv", required = true)]
    recordings: Vec<PathBuf>,
}

#[derive(Serialize)]
struct Checked {
    #[serde(flatten)]
    report: Report,
    /// The film as its own sensor, by each recording with a current.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    self_sensing: Vec<self_sensing::Checked>,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<Verdict> {
    let hints = arguments.reading.hints()?;
    let read = |path: &PathBuf| Recording::read_with(path, &hints);
    let recordings = arguments.recordings.iter().map(read).collect::<Result<Vec<Recording>>>()?;
    recordings.iter().for_each(recordings::report_columns);
    let mut report = check::check(&recordings);
    for finding in &mut report.findings {
        finding.finding = with_flags(&finding.finding);
        finding.advice = with_flags(&finding.advice);
    }
    let self_sensing = arguments.recordings.iter().filter_map(|path| self_sensing::check(path)).collect();
    let checked = Checked { report, self_sensing };
    terminal::report(json, &checked, || text(&checked))?;
    Ok(if checked.report.identifies { Verdict::Yes } else { Verdict::No })
}

fn text(Checked { report, self_sensing }: &Checked) -> String {
    let mut text: String = report.recordings.iter().map(line).collect();
    for finding in &report.findings {
        let kind = match finding.severity {
            Severity::Prevents => "prevents a fit",
            Severity::Weakens => "weakens a fit",
        };
        // The messages of readers and of fits name it already.
        let file = finding.file.as_ref().filter(|file| !finding.finding.starts_with(file.as_str()));
        let place = file.map_or_else(String::new, |file| format!("{file}: "));
        let _ = write!(text, "{kind}: {place}{}", finding.finding);
        text.push_str(if finding.advice.is_empty() { "\n" } else { "\n    " });
        if !finding.advice.is_empty() {
            let _ = writeln!(text, "{}", finding.advice);
        }
    }
    text.push_str(match (report.identifies, report.findings.is_empty()) {
        (true, true) => "these recordings identify a film",
        (true, false) => "these recordings identify a film, with the reservations above",
        (false, _) => "these recordings do not identify a film",
    });
    for checked in self_sensing {
        let _ = write!(text, "\nthe film as its own sensor: {}", checked.text);
    }
    text
}

fn line(facts: &Facts) -> String {
    let drive = &facts.drive;
    let list = |values: &[f64]| values.iter().map(|value| format!("{value:.4}")).collect::<Vec<_>>().join(", ");
    let (unit, per_unit) = match facts.driven_by {
        "voltage" => ("V", 1.0),
        "displacement" => ("mm", 1e3),
        _ => ("N", 1.0),
    };
    let mut text = format!(
        "{}: {:.1} s at {:.1} Hz; {} up to {:.1} {unit}, {:.1} s of rest first",
        facts.file,
        facts.duration_s,
        facts.rate_hz,
        facts.driven_by,
        per_unit * drive.peak,
        drive.rest_s
    );
    if !drive.frequencies_hz.is_empty() {
        let _ = write!(text, "; cycles of {} Hz", list(&drive.frequencies_hz));
    }
    if drive.hold_s >= 1.0 {
        let _ = write!(text, "; a hold of {:.1} s", drive.hold_s);
    }
    if let Some([low, high]) = facts.displacement_m {
        let _ = write!(text, "; stroke {:.4} to {:.4} mm", 1e3 * low, 1e3 * high);
    }
    text.push('\n');
    text
}
