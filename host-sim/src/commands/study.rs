use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use clap::Args;
use maud::html;
use serde::Serialize;
use springpot::{Actuator, Topology};

use crate::error::Result;
use crate::files::output::{self, Folders};
use crate::files::parameters::Parameters;
use crate::files::recording::{Direction, Recording};
use crate::fit::Method;
use crate::fit::objective::Observation;
use crate::fit::observation;
use crate::fit::selection::name_of;
use crate::report::html;
use crate::report::plot::{self, COLOURS, Line, Panel};
use crate::studies::paper::{self, Entry, EntryRow, method_name};
use crate::terminal;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Folder for the page (study.html), the tables (study.md) and the figures (SVG and PNG).
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// File whose actuator table is taken: geometry, permittivity, mass, preload.
    #[arg(long, value_name = "P")]
    actuator: Option<String>,
    /// Seed of the random starts.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Let pattern search see thinned recordings only: some ten times faster, but not the paper's procedure.
    #[arg(long)]
    thinned: bool,
    /// Recordings, one per frequency.
    #[arg(value_name = "REC.csv", required = true)]
    recordings: Vec<PathBuf>,
}

/// What is written.
const FILES: [&str; 6] = ["figure-6.svg", "figure-6.png", "figure-7.svg", "figure-7.png", "study.html", "study.md"];

#[derive(Serialize)]
struct Report {
    recordings: Vec<String>,
    fits: Vec<EntryRow>,
    why_eq9_stops: String,
    files: Vec<String>,
}

/// A table: title, header, rows.
struct Table {
    title: String,
    header: Vec<String>,
    rows: Vec<Vec<String>>,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let actuator = match &arguments.actuator {
        Some(name) => Parameters::load_actuator(name)?,
        None => Actuator::KARNER_2022,
    };
    let recordings = arguments.recordings.iter().map(|path| Recording::read(path)).collect::<Result<Vec<_>>>()?;
    let observations = recordings
        .iter()
        .map(|recording| observation::observe(recording, Direction::Force, 1.0).map(|(observation, _)| observation))
        .collect::<Result<Vec<Observation>>>()?;
    for name in FILES {
        let inputs: Vec<&Path> = recordings.iter().map(Recording::path).collect();
        output::check(&arguments.out.join(name), &inputs, Folders::AreMade)?;
    }
    let names: Vec<String> = observations.iter().map(|o| o.name.clone()).collect();

    let options = paper::Options { actuator, seed: arguments.seed, thinned: arguments.thinned };
    let bar = terminal::progress(0, "study");
    // Half a study is none: Ctrl-C ends it.
    let never = AtomicBool::new(false);
    let entries = paper::study(&observations, &options, &never, &|all| {
        bar.set_length(all as u64);
        bar.inc(1);
    })?;
    bar.finish_and_clear();

    let tables = [table_2(&entries, &names), table_3(&entries), table_4(&entries, &names)];
    let why = paper::why_eq9_stops(&entries);
    let figures = [
        ("figure-6", "Measured and calculated, joint fit (Fig. 6)", panels(&entries, &observations, false)),
        ("figure-7", "Measured and calculated, one fit per recording (Fig. 7)", panels(&entries, &observations, true)),
    ];
    let page = page(&tables, &why, &figures, arguments.thinned);
    let mut markdown = markdown(&tables, &why);
    if arguments.thinned {
        markdown.push_str("Pattern search saw thinned recordings; R² is of all samples.\n");
    }
    output::make_folder(&arguments.out)?;
    let mut files = Vec::new();
    for (name, _, panels) in &figures {
        for ending in ["svg", "png"] {
            let path = arguments.out.join(format!("{name}.{ending}"));
            plot::write(&path, panels)?;
            files.push(path);
        }
    }
    for (name, text) in [("study.html", &page), ("study.md", &markdown)] {
        let path = arguments.out.join(name);
        output::write_whole(&path, |file| file.write_all(text.as_bytes()))?;
        files.push(path);
    }
    let report = Report {
        recordings: names.clone(),
        fits: entries.iter().map(|entry| EntryRow::new(entry, &names)).collect(),
        why_eq9_stops: why,
        files: files.iter().map(|path| crate::error::shown(path)).collect(),
    };
    terminal::report(json, &report, || format!("{markdown}\nwritten: {}", report.files.join(", ")))
}

fn kind(entry: &Entry) -> [String; 2] {
    [name_of(entry.topology).into(), method_name(entry.method).into()]
}

/// R² of the joint fits.
fn table_2(entries: &[Entry], names: &[String]) -> Table {
    let header = ["n", "topology", "method"].map(str::to_owned);
    let rows = entries
        .iter()
        .filter(|e| e.recording.is_none())
        .map(|e| {
            let mut row = vec![e.branches.to_string()];
            row.extend(kind(e));
            row.extend(e.agreements.iter().map(|a| format!("{:.6}", a.r2)));
            row.extend([format!("{:.6}", e.r2_mean()), e.evaluations.to_string()]);
            row
        })
        .collect();
    let tail = ["R² mean", "evaluations"].map(str::to_owned);
    let header = header.into_iter().chain(names.iter().map(|name| format!("R² {name}"))).chain(tail).collect();
    Table { title: "Table 2: R² of the joint fits".into(), header, rows }
}

/// Parameters of the joint fits.
fn table_3(entries: &[Entry]) -> Table {
    let rows = entries
        .iter()
        .filter(|e| e.recording.is_none())
        .map(|e| {
            let (main, branches) = e.elements();
            let mut row = vec![e.branches.to_string()];
            row.extend(kind(e));
            row.extend([main, branches]);
            row
        })
        .collect();
    Table {
        title: "Table 3: parameters of the joint fits, c in N·s^α/mm".into(),
        header: ["n", "topology", "method", "main (c, α)", "branches (c, α)–(c, α)"].map(str::to_owned).into(),
        rows,
    }
}

/// Fits to one recording.
fn table_4(entries: &[Entry], names: &[String]) -> Table {
    let rows = entries
        .iter()
        .filter_map(|e| e.recording.map(|index| (e, index)))
        .map(|(e, index)| {
            let (main, branches) = e.elements();
            let mut row = vec![names[index].clone()];
            row.extend(kind(e));
            row.extend([main, branches, format!("{:.6}", e.r2_mean())]);
            row
        })
        .collect();
    Table {
        title: format!("Table 4: each recording alone, n = {}, c in N·s^α/mm", paper::BRANCHES_ALONE),
        header: ["recording", "topology", "method", "main (c, α)", "branches (c, α)–(c, α)", "R²"]
            .map(str::to_owned)
            .into(),
        rows,
    }
}

/// Measured against calculated with two branches: the paper's way, and the best of this tool.
fn panels(entries: &[Entry], observations: &[Observation], alone: bool) -> Vec<Panel> {
    let millimetres = |values: &[f64]| values.iter().map(|x| 1e3 * x).collect::<Vec<f64>>();
    observations
        .iter()
        .enumerate()
        .map(|(index, observation)| {
            let time = &observation.measured.time_s;
            let measured = Line::new("measured", time, &millimetres(&observation.measured.value));
            let mut panel = Panel::new(&observation.name, "time (s)", "displacement (mm)")
                .with(measured.wide(4.0).coloured("#bdbdbd"));
            for (method, topology, colour) in
                [(Method::PatternSearch, Topology::Eq11, COLOURS[2]), (Method::Lm, Topology::Parallel, COLOURS[1])]
            {
                let wanted = |e: &&Entry| {
                    e.method == method
                        && e.topology == topology
                        && e.branches == paper::BRANCHES_ALONE
                        && e.recording == alone.then_some(index)
                };
                if let Some(entry) = entries.iter().find(wanted) {
                    let values = &entry.modelled[if alone { 0 } else { index }];
                    let label = format!("{}, {}", name_of(topology), method_name(method));
                    panel = panel.with(Line::new(label, time, &millimetres(values)).coloured(colour));
                }
            }
            panel
        })
        .collect()
}

fn page(tables: &[Table], why: &str, figures: &[(&str, &str, Vec<Panel>)], thinned: bool) -> String {
    let body = html! {
        p {
            "Forces by Eq. 1 without coupling, displacements without offset, as in Karner et al. 2022. "
            @if thinned { "Pattern search saw thinned recordings; R² is of all samples." }
        }
        @for table in tables {
            h2 { (table.title) }
            @let header: Vec<&str> = table.header.iter().map(String::as_str).collect();
            @let rows: Vec<(bool, Vec<String>)> = table.rows.iter().map(|row| (false, row.clone())).collect();
            (html::table(&header, &rows))
        }
        p { (why) }
        @for (_, title, panels) in figures {
            h2 { (title) }
            (html::figure(panels))
        }
    };
    html::page("The study of Karner et al. 2022 on these recordings", &body)
}

fn markdown(tables: &[Table], why: &str) -> String {
    let mut text = String::new();
    for table in tables {
        let _ = writeln!(text, "## {}\n", table.title);
        let _ = writeln!(text, "| {} |", table.header.join(" | "));
        let _ = writeln!(text, "|{}", " --- |".repeat(table.header.len()));
        for row in &table.rows {
            let _ = writeln!(text, "| {} |", row.join(" | "));
        }
        text.push('\n');
    }
    text.push_str(why);
    text.push('\n');
    text
}
