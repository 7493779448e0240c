//! The tables, figures and page of the paper's study.

use std::fmt::Write;

use maud::{Markup, html};
use springpot::Topology;

use super::chart;
use super::figure::{Colour, Figure, Line, Panel};
use super::page::{self, Page, Row, Section};
use crate::choice::Choice;
use crate::files::recording::Input;
use crate::fit::Method;
use crate::fit::observation::Observation;
use crate::studies::paper::{self, StudyFit};

/// Tables and figures of a study.
pub struct StudyPage {
    tables: [Table; 3],
    pub figures: [StudyFigure; 2],
    why_eq9_stops: String,
    thinned: bool,
    /// Drive of the model, in a sentence.
    drive: &'static str,
}

/// A figure of the study.
pub struct StudyFigure {
    /// Name of its files, without the ending.
    pub name: &'static str,
    /// The figure, a panel per recording.
    pub figure: Figure,
}

/// A table: title, header, rows.
struct Table {
    title: String,
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl StudyPage {
    /// The page of `fits` to `observations`; `thinned` if pattern search saw thinned recordings.
    pub fn new(fits: &[StudyFit], observations: &[Observation], thinned: bool) -> Self {
        let names: Vec<String> = observations.iter().map(Observation::file_name).collect();
        let figure = |name, title: &str, alone| StudyFigure {
            name,
            figure: Figure::new(title, panels(fits, observations, alone)),
        };
        Self {
            tables: [table_2(fits, &names), table_3(fits), table_4(fits, &names)],
            figures: [
                figure("figure-6", "Measured and calculated, joint fit (Fig. 6)", false),
                figure("figure-7", "Measured and calculated, one fit per recording (Fig. 7)", true),
            ],
            why_eq9_stops: paper::why_eq9_stops(fits),
            thinned,
            drive: match observations.first().map(|observation| &observation.input) {
                Some(Input::Displacement(_)) => "Forces from the recorded displacements. ",
                Some(Input::Force(_)) => "Displacements from the recorded forces, without offset. ",
                _ => "Forces by Eq. 1 without coupling, displacements without offset, as in Karner et al. 2022. ",
            },
        }
    }

    pub fn html(&self) -> String {
        let tables = html! {
            @for table in &self.tables { (table.html()) }
            p { (self.why_eq9_stops) }
        };
        let figures = html! {
            @for figure in &self.figures { h3 { (figure.figure.title) } (chart::figure(&figure.figure)) }
        };
        let lead = html! {
            p {
                (self.drive)
                @if self.thinned { "Pattern search saw thinned recordings; R² is of all samples." }
            }
        };
        Page {
            title: "The study of Karner et al. 2022 on these recordings",
            lead,
            sections: vec![Section::new("tables", "Tables", tables), Section::new("figures", "Figures", figures)],
            document: None,
        }
        .html()
    }

    /// The tables as Markdown.
    pub fn markdown(&self) -> String {
        let mut text = String::new();
        for table in &self.tables {
            let _ = writeln!(text, "## {}\n", table.title);
            let _ = writeln!(text, "| {} |", table.header.join(" | "));
            let _ = writeln!(text, "|{}", " --- |".repeat(table.header.len()));
            for row in &table.rows {
                let _ = writeln!(text, "| {} |", row.join(" | "));
            }
            text.push('\n');
        }
        text.push_str(&self.why_eq9_stops);
        text.push('\n');
        if self.thinned {
            text.push_str("Pattern search saw thinned recordings; R² is of all samples.\n");
        }
        text
    }
}

impl Table {
    fn html(&self) -> Markup {
        let header: Vec<&str> = self.header.iter().map(String::as_str).collect();
        let rows: Vec<Row> = self.rows.iter().map(|row| Row::new(row.iter().map(page::text).collect())).collect();
        page::table(&self.title, &header, &rows)
    }
}

/// A row that begins with `first`, topology and method of a fit.
fn row(first: impl Into<String>, fit: &StudyFit, rest: impl IntoIterator<Item = String>) -> Vec<String> {
    [first.into(), fit.topology.name().into(), fit.method.name().into()].into_iter().chain(rest).collect()
}

/// R² of the joint fits.
fn table_2(fits: &[StudyFit], names: &[String]) -> Table {
    let joint = fits.iter().filter(|fit| fit.recording.is_none());
    let rows = joint.map(|fit| {
        let r2 = fit.agreements.iter().map(|agreement| format!("{:.6}", agreement.r2));
        let end = [format!("{:.6}", fit.r2_mean()), fit.evaluations.to_string()];
        row(fit.branches.to_string(), fit, r2.chain(end))
    });
    let mut header = vec!["n".to_owned(), "topology".into(), "method".into()];
    header.extend(names.iter().map(|name| format!("R² {name}")));
    header.extend(["R² mean".into(), "evaluations".into()]);
    Table { title: "Table 2: R² of the joint fits".into(), header, rows: rows.collect() }
}

/// Parameters of the joint fits.
fn table_3(fits: &[StudyFit]) -> Table {
    let joint = fits.iter().filter(|fit| fit.recording.is_none());
    Table {
        title: "Table 3: parameters of the joint fits, c in N·s^α/mm".into(),
        header: ["n", "topology", "method", "main (c, α)", "branches (c, α)–(c, α)"].map(str::to_owned).into(),
        rows: joint.map(|fit| row(fit.branches.to_string(), fit, <[String; 2]>::from(fit.elements()))).collect(),
    }
}

/// Fits to one recording.
fn table_4(fits: &[StudyFit], names: &[String]) -> Table {
    let alone = fits.iter().filter_map(|fit| Some((fit, &names[fit.recording?])));
    let rows = alone.map(|(fit, name)| {
        let (main, branches) = fit.elements();
        row(name, fit, [main, branches, format!("{:.6}", fit.r2_mean())])
    });
    Table {
        title: format!("Table 4: each recording alone, n = {}, c in N·s^α/mm", paper::BRANCHES_ALONE),
        header: ["recording", "topology", "method", "main (c, α)", "branches (c, α)–(c, α)", "R²"]
            .map(str::to_owned)
            .into(),
        rows: rows.collect(),
    }
}

/// Measured and calculated with two branches: by the paper's procedure, and by the best of this tool.
fn panels(fits: &[StudyFit], observations: &[Observation], alone: bool) -> Vec<Panel> {
    let of_force = observations.iter().any(|o| matches!(o.input, Input::Displacement(_)));
    let (factor, axis) = if of_force { (1.0, "force (N)") } else { (1e3, "displacement (mm)") };
    let scaled = |values: &[f64]| values.iter().map(|x| factor * x).collect::<Vec<f64>>();
    observations
        .iter()
        .enumerate()
        .map(|(index, observation)| {
            let time = &observation.measured.time_s;
            let measured = Line::new("measured", time, &scaled(&observation.measured.value));
            let mut panel = Panel::new(observation.file_name(), "time (s)", axis).with(measured.beneath());
            for (method, topology, colour) in [
                (Method::PatternSearch, Topology::Eq11, Colour::VERMILION),
                (Method::Lm, Topology::Parallel, Colour::BLUE),
            ] {
                let wanted = |e: &&StudyFit| {
                    e.method == method
                        && e.topology == topology
                        && e.branches == paper::BRANCHES_ALONE
                        && e.recording == alone.then_some(index)
                };
                if let Some(fit) = fits.iter().find(wanted) {
                    let values = &fit.modelled[if alone { 0 } else { index }];
                    let label = format!("{}, {}", topology.name(), method.name());
                    panel = panel.with(Line::new(label, time, &scaled(values)).coloured(colour));
                }
            }
            panel
        })
        .collect()
}
