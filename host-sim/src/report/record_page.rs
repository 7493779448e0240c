//! The page of a record of commissioning: the verdict in one sentence, one picture, what to do next, then the details.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::chart;
use super::figure::{Colour, Figure, Line, Panel};
use super::fit_page::warnings;
use super::numbers::{Document, Form, Numbers};
use super::origin;
use super::page::{Cell, Page, Row, Section, list, table, text};
use crate::choice::Choice;
use crate::commission::Report;
use crate::fit::report::Origin;

/// The page of `report`, which is in `document`.
pub fn html(report: &Report, entries: &BTreeMap<&str, &str>, made: &Origin, document: &Document) -> String {
    let numbers = Numbers::from_document(document);
    let lead = html! {
        p.verdict {
            @if report.verdict.passed { "Passed: " } @else { "Not passed: " }
            (report.verdict.sentence) "."
        }
        p { "Next: " (report.verdict.next) }
    };
    let mut sections = vec![Section::new("picture", "Without and with compensation", picture(report))];
    if !report.findings.is_empty() {
        sections.push(Section::new("findings", "What is wrong", findings(report)));
    }
    sections.push(Section::new("figures", "Figures", figures(&numbers)));
    if let Some(fit) = report.fit.as_ref().filter(|fit| !fit.warnings.is_empty()) {
        sections.push(Section::new("warnings", "Warnings of the fit", warnings::list(&fit.warnings, true)));
    }
    if let Some(prospect) = &report.self_sensing {
        let sentence = html! { p { "Of use where there is no displacement sensor: " (prospect.sentence()) "." } };
        sections.push(Section::new("self-sensing", "The film as its own sensor", sentence));
    }
    if report.ramp.is_some() {
        sections.push(Section::new("ramp", "Ramp", ramp(&numbers)));
    }
    if !report.self_test.is_empty() {
        let rows = report.self_test.iter().map(|check| {
            let mark = if check.passed { "passed" } else { "failed" };
            Row::new([check.what.as_str(), &check.found, &check.wanted, mark].map(text).to_vec())
        });
        let rows: Vec<Row> = rows.collect();
        sections.push(Section::new(
            "self-test",
            "Self-test",
            table("Checks", &["check", "found", "wanted", ""], &rows),
        ));
    }
    sections.push(Section::new("origin", "Where this comes from", made_of(report, entries, made)));
    Page { title: "Record of commissioning", lead, sections, document: Some(document) }.html()
}

/// The stroke under a constant voltage, and along a reference with the sensor.
fn picture(report: &Report) -> Markup {
    let column =
        |rows: &[[f64; 3]], k: usize, factor: f64| rows.iter().map(|row| factor * row[k]).collect::<Vec<f64>>();
    let [hold, tracked] = &report.picture;
    let mut panels = Vec::new();
    if !hold.is_empty() {
        let time = column(hold, 0, 1.0);
        panels.push(
            Panel::new("Without compensation: a constant voltage", "time (s)", "displacement (mm)")
                .with(Line::new("film", &time, &column(hold, 1, 1e3)).coloured(Colour::VERMILION)),
        );
    }
    if !tracked.is_empty() {
        let time = column(tracked, 0, 1.0);
        panels.push(
            Panel::new("With compensation: random segments", "time (s)", "displacement (mm)")
                .with(Line::new("reference", &time, &column(tracked, 2, 1e3)).beneath())
                .with(Line::new("film", &time, &column(tracked, 1, 1e3)).coloured(Colour::BLUE)),
        );
    }
    html! {
        @if panels.is_empty() { p { "The film was not driven as far as that." } }
        (chart::figure(&Figure::new("Commissioning", panels)))
    }
}

fn findings(report: &Report) -> Markup {
    let row = |finding: &crate::commission::Finding| {
        Row::new(vec![text(finding.cause.name()), text(&finding.measured), text(finding.advice)])
    };
    let rows: Vec<Row> = report.findings.iter().map(row).collect();
    table("That of most weight first", &["cause", "measured", "what to do"], &rows)
}

fn figures(numbers: &Numbers<'_>) -> Markup {
    let row = |name: &str, place: &str| {
        let of = numbers.at(place);
        Row::new(vec![
            text(name),
            of.number("/largest_pct", Form::Fixed(2)),
            of.number("/rms_pct", Form::Fixed(2)),
            html! { (of.number("/predicted_pct/0", Form::Fixed(2))) " to " (of.number("/predicted_pct/1", Form::Fixed(2))) },
            of.number("/segments", Form::Fixed(0)),
        ])
    };
    html! {
        (table(
            "RMS error along random segments that the fit has not seen, % of their range, without the sensor's noise; none below a quarter of it",
            &["", "worst segment", "all", "predicted, all", "segments"],
            &[row("with the sensor", "/tracking"), row("without the sensor", "/feedforward")],
        ))
        p {
            "With 59 segments or more the worst bounds the error of 95 % of such segments at 95 % confidence. The segments are drawn \
             independently; the memory of the film links their errors."
        }
        p {
            "Creep: " (numbers.number("/creep/without_pct", Form::Fixed(1))) " % of the stroke under a constant voltage, "
            (numbers.number("/creep/with_pct", Form::Fixed(2))) " % of the range with the sensor. The fit: R² "
            (numbers.number("/fit/r2", Form::Fixed(6))) ", " (numbers.number("/fit/misfit_pct", Form::Fixed(2)))
            " % of the stroke left; the observer has a bandwidth of " (numbers.number("/fit/bandwidth_hz", Form::Fixed(2)))
            " Hz. The film was driven and watched for " (numbers.number("/film_s", Form::Fixed(0))) " s."
        }
    }
}

fn ramp(numbers: &Numbers<'_>) -> Markup {
    let millimetres = |path| Cell::Number(path, Form::In(1e3, 3, "mm"));
    let columns = [
        ("voltage, V", Cell::Number("/voltage_v", Form::Fixed(0))),
        ("predicted", millimetres("/predicted_m")),
        ("measured", millimetres("/measured_m")),
        ("predicted for a minute", millimetres("/minute_m")),
        ("slope over V², of the first", Cell::Number("/slope", Form::Fixed(2))),
    ];
    html! {
        (list("Steps, each predicted before it was taken", &columns, &numbers.at("/ramp/steps")))
        p { "Ended by: " (numbers.at("/ramp").text("/ended_by")) "." }
    }
}

fn made_of(report: &Report, entries: &BTreeMap<&str, &str>, made: &Origin) -> Markup {
    let mut rows = origin::rows([&made.date, &made.tool, &made.command]).to_vec();
    let mut add = |name: &str, value: &str| rows.push(Row::new(vec![text(name), html! { code { (value) } }]));
    add("bench", &report.bench);
    add("firmware", &report.firmware);
    add("steps", &report.steps.join(", "));
    add("parameters read back", &report.checksum.map_or("no".into(), |checksum| format!("{checksum:08x}")));
    let limits = &report.limits;
    add(
        "limits",
        &format!("{:.0} V, {:.3e} V/m, {:.2} mm", limits.voltage_v, limits.field_v_per_m, 1e3 * limits.stroke_m),
    );
    entries.iter().for_each(|(name, value)| add(name, value));
    html! {
        (table("Made by, on, and as the operator stated", &["", ""], &rows))
        p {
            "record.json holds the digests of this page and of all files, in a chain; springpot verify record.json shows whether any byte \
             was changed since. Who changes a record can seal it again: keep the seal elsewhere, or sign the file. A signature shows who \
             vouches for a record, not that it is true."
        }
    }
}
