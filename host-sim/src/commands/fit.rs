use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, ValueEnum};
use serde::Serialize;
use sha2::{Digest, Sha256};
use springpot::{Actuator, MAX_BRANCHES, Topology};

use crate::agreement::Agreement;
use crate::error::{Error, Result, shown};
use crate::fit::candidate::{Candidate, Variable};
use crate::fit::objective::Observation;
use crate::fit::observe::{self, Direction};
use crate::fit::robust::Loss;
use crate::fit::selection::{Row, name_of};
use crate::fit::trust::Trust;
use crate::fit::{self, Fit, Method, Settings};
use crate::interrupt;
use crate::output::{self, Folders};
use crate::parameters::Parameters;
use crate::recording::Recording;
use crate::reduce;
use crate::terminal;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Where the parameters go.
    #[arg(long, value_name = "P.toml")]
    out: PathBuf,
    #[command(flatten)]
    options: FitOptions,
    /// Fit each recording alone; writes one file per recording beside --out.
    #[arg(long)]
    each: bool,
    /// Where a page with tables and figures goes.
    #[arg(long, value_name = "R.html")]
    report: Option<PathBuf>,
    /// Recordings to fit.
    #[arg(value_name = "REC.csv", required = true)]
    recordings: Vec<PathBuf>,
}

/// Options of every command that fits.
#[derive(Clone, Debug, Args)]
pub(super) struct FitOptions {
    /// Branches of two springpots, 0 to 5, or auto.
    #[arg(long, value_name = "N|auto", default_value = "auto", value_parser = branches)]
    branches: Branches,
    /// How branches are connected.
    #[arg(long, value_enum, default_value_t = TopologyChoice::Auto)]
    topology: TopologyChoice,
    /// How parameters are searched for.
    #[arg(long, value_enum, default_value_t = Method::Lm)]
    method: Method,
    /// What drives the model.
    #[arg(long, value_enum, default_value_t = Direction::Force)]
    drive: Direction,
    /// Fit this too: stretch_coupling and offset_m (freed by default), mass_kg, or one of relative_permittivity,
    /// length_m, width_m and thickness_m.
    #[arg(long, value_name = "NAME")]
    free: Vec<String>,
    /// Do not fit this: stretch_coupling, offset_m, or with --start an element such as main.alpha or branches[0][1].c.
    #[arg(long, value_name = "NAME")]
    hold: Vec<String>,
    /// Parameters whose actuator is taken: geometry, permittivity, mass, preload, coupling.
    #[arg(long, value_name = "P")]
    actuator: Option<String>,
    /// Parameters to begin from, instead of random starts; they also give branches and topology.
    #[arg(long, value_name = "P", conflicts_with_all = ["actuator"])]
    start: Option<String>,
    /// How residuals count.
    #[arg(long, value_enum, default_value_t = Loss::Square)]
    loss: Loss,
    /// How much each recording counts, in their order.
    #[arg(long, value_name = "W,W,…", value_delimiter = ',')]
    weights: Vec<f64>,
    /// Seed of the random starts.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Random starts of every structure.
    #[arg(long, value_name = "N", default_value_t = 8)]
    starts: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Branches {
    Auto,
    Number(usize),
}

fn branches(text: &str) -> std::result::Result<Branches, String> {
    if text == "auto" {
        return Ok(Branches::Auto);
    }
    text.parse()
        .ok()
        .filter(|n| *n <= MAX_BRANCHES)
        .map(Branches::Number)
        .ok_or_else(|| format!("use auto or a number from 0 to {MAX_BRANCHES}"))
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum TopologyChoice {
    Eq11,
    Parallel,
    Auto,
}

impl FitOptions {
    fn settings(&self) -> Result<Settings> {
        let start = self.start.as_deref().map(Parameters::load).transpose()?;
        let actuator = match (&self.actuator, &start) {
            (Some(name), _) => Parameters::load(name)?.actuator,
            (None, Some(start)) => start.actuator,
            (None, None) => Actuator::KARNER_2022,
        };
        let start = start.map(|parameters| Candidate {
            actuator,
            elements: std::iter::once(parameters.model.main())
                .chain(parameters.model.branches().as_flattened().iter().copied())
                .collect(),
            topology: parameters.model.topology(),
            offset_m: parameters.sensor_offset_m,
        });
        if self.starts == 0 && start.is_none() {
            return Err(Error::option("--starts", "at least 1 is needed"));
        }

        let mut surroundings = vec![Variable::StretchCoupling, Variable::Offset];
        for name in &self.free {
            let variable = surrounding(name).ok_or_else(|| unknown("--free", name))?;
            if !surroundings.contains(&variable) {
                surroundings.push(variable);
            }
        }
        let mut held = Vec::new();
        for name in &self.hold {
            if let Some(variable) = surrounding(name) {
                surroundings.retain(|v| *v != variable);
            } else {
                let all = Variable::of_model(start.as_ref().map_or(0, Candidate::branches));
                let variable =
                    all.into_iter().find(|v| v.to_string() == *name).ok_or_else(|| unknown("--hold", name))?;
                if start.is_none() {
                    return Err(Error::option("--hold", format!("{name} needs --start, which gives its value")));
                }
                held.push(variable);
            }
        }
        if self.method == Method::PatternSearch {
            surroundings.clear();
        }
        if self.method == Method::PatternSearch && self.loss != Loss::Square {
            return Err(Error::option("--loss", "pattern search is the paper's procedure, with squares"));
        }

        let branches = match (self.branches, &start) {
            (_, Some(start)) => vec![start.branches()],
            (Branches::Number(n), None) => vec![n],
            (Branches::Auto, None) => (0..=MAX_BRANCHES).collect(),
        };
        let topologies = match (self.topology, &start) {
            (TopologyChoice::Eq11, _) => vec![Topology::Eq11],
            (TopologyChoice::Parallel, _) => vec![Topology::Parallel],
            (TopologyChoice::Auto, Some(start)) => vec![start.topology],
            (TopologyChoice::Auto, None) => vec![Topology::Parallel, Topology::Eq11],
        };
        Ok(Settings {
            method: self.method,
            branches,
            topologies,
            actuator,
            surroundings,
            held,
            start,
            loss: self.loss,
            seed: self.seed,
            starts: self.starts,
            judge: true,
        })
    }

    /// The observations, and warnings about each of them.
    fn observations(&self, recordings: &[Recording]) -> Result<(Vec<Observation>, Vec<Vec<String>>)> {
        if !(self.weights.is_empty() || self.weights.len() == recordings.len()) {
            let cause = format!("{} weights for {} recordings", self.weights.len(), recordings.len());
            return Err(Error::option("--weights", cause));
        }
        if let Some(weight) = self.weights.iter().find(|w| !(w.is_finite() && **w > 0.0)) {
            return Err(Error::option("--weights", format!("{weight} must be finite and greater than 0")));
        }
        let weight = |index: usize| self.weights.get(index).copied().unwrap_or(1.0);
        recordings
            .iter()
            .enumerate()
            // Squared residuals are weighted.
            .map(|(index, recording)| observe::observe(recording, self.drive, weight(index).sqrt()))
            .collect()
    }

    /// Parameter files that are read.
    fn parameter_files(&self) -> impl Iterator<Item = &Path> {
        self.actuator.iter().chain(&self.start).map(Path::new)
    }
}

fn surrounding(name: &str) -> Option<Variable> {
    [
        Variable::StretchCoupling,
        Variable::Offset,
        Variable::Permittivity,
        Variable::Length,
        Variable::Width,
        Variable::Thickness,
        Variable::Mass,
    ]
    .into_iter()
    .find(|variable| variable.to_string() == name)
}

fn unknown(option: &'static str, name: &str) -> Error {
    let names = "stretch_coupling, offset_m, mass_kg, relative_permittivity, length_m, width_m, thickness_m";
    Error::option(option, format!("no quantity {name:?}; there are {names} and elements such as main.alpha"))
}

/// What a fit found, for people and machines.
#[derive(Serialize)]
struct Report {
    recordings: Vec<RecordingRow>,
    r2_mean: f64,
    parameters_file: String,
    seconds: f64,
    evaluations: usize,
    topology: &'static str,
    branches: usize,
    interrupted: bool,
    structures: Vec<Row>,
    trust: Option<Trust>,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct RecordingRow {
    file: String,
    r2: f64,
    nrmse_pct: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    rmse_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    rmse_n: Option<f64>,
    samples: usize,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let settings = arguments.options.settings()?;
    let recordings = arguments.recordings.iter().map(|path| Recording::read(path)).collect::<Result<Vec<_>>>()?;
    let (observations, warnings) = arguments.options.observations(&recordings)?;
    let stop = interrupt::stop_flag();
    let jobs: Vec<(PathBuf, Vec<usize>)> = if arguments.each {
        let outputs = recordings.iter().map(|recording| beside(&arguments.out, recording.path())).collect::<Vec<_>>();
        if let Some(twice) = outputs.iter().enumerate().find(|(k, path)| outputs[..*k].contains(path)) {
            return Err(Error::option("--each", format!("two recordings would be written to {}", twice.1.display())));
        }
        outputs.into_iter().enumerate().map(|(index, path)| (path, vec![index])).collect()
    } else {
        vec![(arguments.out.clone(), (0..recordings.len()).collect())]
    };
    let inputs: Vec<&Path> =
        recordings.iter().map(Recording::path).chain(arguments.options.parameter_files()).collect();
    for (out, _) in &jobs {
        output::check(out, &inputs, Folders::Exist)?;
    }

    let mut reports = Vec::new();
    for (out, indices) in jobs {
        let chosen: Vec<Observation> = indices.iter().map(|&index| observations[index].clone()).collect();
        let files: Vec<&Path> = indices.iter().map(|&index| recordings[index].path()).collect();
        let started = Instant::now();
        let bar = terminal::spinner();
        let mut fit = fit::fit(&chosen, &settings, stop, &|message| bar.set_message(message.to_owned()))?;
        bar.finish_and_clear();
        fit.warnings.splice(0..0, indices.iter().flat_map(|&index| warnings[index].clone()));
        let seconds = started.elapsed().as_secs_f64();
        let parameters = parameters_of(&fit, &settings, &arguments.options, &files)?;
        output::write_whole(&out, |file| file.write_all(parameters.to_toml().as_bytes()))?;
        reports.push(report_of(fit, arguments.options.drive, &files, &out, seconds));
    }
    match reports.as_slice() {
        [report] if !arguments.each => terminal::report(json, report, || text(report)),
        _ => terminal::report(json, &reports, || reports.iter().map(text).collect::<Vec<_>>().join("\n\n")),
    }
}

fn beside(out: &Path, recording: &Path) -> PathBuf {
    let stem = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    out.with_file_name(format!("{}-{}.toml", stem(out), stem(recording)))
}

fn parameters_of(fit: &Fit, settings: &Settings, options: &FitOptions, files: &[&Path]) -> Result<Parameters> {
    let model = reduce::ordered(&fit.candidate.model()?)?;
    let mut provenance = toml::Table::new();
    let mut put = |key: &str, value: toml::Value| {
        provenance.insert(key.into(), value);
    };
    put("tool", format!("host-sim {} fit", env!("CARGO_PKG_VERSION")).into());
    put(
        "method",
        format!("{}, seed {}", if settings.method == Method::Lm { "lm" } else { "pattern-search" }, settings.seed)
            .into(),
    );
    put("drive", if options.drive == Direction::Force { "force" } else { "displacement" }.into());
    put("loss", if settings.loss == Loss::Square { "square" } else { "huber" }.into());
    put("evaluations", i64::try_from(fit.evaluations).unwrap_or(i64::MAX).into());
    put("r2_mean", fit.r2_mean.into());
    if fit.interrupted {
        put("interrupted", true.into());
    }
    let recordings = files
        .iter()
        .zip(&fit.agreements)
        .map(|(file, agreement)| {
            let mut table = toml::Table::new();
            table.insert("file".into(), file.display().to_string().into());
            table.insert("sha256".into(), hash(file)?.into());
            table.insert("r2".into(), agreement.r2.into());
            table.insert("nrmse_pct".into(), agreement.nrmse_pct.into());
            table.insert("samples".into(), i64::try_from(agreement.samples).unwrap_or(i64::MAX).into());
            Ok(toml::Value::Table(table))
        })
        .collect::<Result<Vec<_>>>()?;
    put("recordings", toml::Value::Array(recordings));
    if let Some(trust) = &fit.trust {
        let intervals: toml::Table = trust
            .estimates
            .iter()
            .map(|estimate| {
                // An end that the data do not set is left open.
                let ends = [estimate.low.unwrap_or(f64::NEG_INFINITY), estimate.high.unwrap_or(f64::INFINITY)];
                (estimate.name.clone(), toml::Value::Array(ends.iter().map(|&end| end.into()).collect()))
            })
            .collect();
        put("intervals_95_pct", toml::Value::Table(intervals));
    }
    let warnings: Vec<toml::Value> = fit.warnings.iter().map(|warning| warning.as_str().into()).collect();
    put("warnings", toml::Value::Array(warnings));
    let names: Vec<String> =
        files.iter().map(|file| file.file_stem().unwrap_or_default().to_string_lossy().into_owned()).collect();
    Ok(Parameters {
        name: format!("fit to {}", names.join(", ")),
        actuator: fit.candidate.actuator,
        model,
        sensor_offset_m: fit.candidate.offset_m,
        provenance: Some(provenance),
    })
}

fn hash(path: &Path) -> Result<String> {
    let bytes = fs::read(path).map_err(|e| Error::file(path, e))?;
    Ok(Sha256::digest(&bytes).iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    }))
}

fn report_of(fit: Fit, drive: Direction, files: &[&Path], out: &Path, seconds: f64) -> Report {
    let row = |(file, agreement): (&&Path, &Agreement)| RecordingRow {
        file: shown(file),
        r2: agreement.r2,
        nrmse_pct: agreement.nrmse_pct,
        rmse_m: (drive == Direction::Force).then_some(agreement.rmse),
        rmse_n: (drive == Direction::Displacement).then_some(agreement.rmse),
        samples: agreement.samples,
    };
    Report {
        recordings: files.iter().zip(&fit.agreements).map(row).collect(),
        r2_mean: fit.r2_mean,
        parameters_file: shown(out),
        seconds,
        evaluations: fit.evaluations,
        topology: name_of(fit.candidate.topology),
        branches: fit.candidate.branches(),
        interrupted: fit.interrupted,
        structures: fit.table,
        trust: fit.trust,
        warnings: fit.warnings,
    }
}

fn text(report: &Report) -> String {
    let mut text = String::new();
    if !report.structures.is_empty() {
        let _ = writeln!(text, "structure     variables        R²   NRMSE %      ΔAIC      ΔBIC  left out, NRMSE %");
        for row in &report.structures {
            let left_out = row.left_out_nrmse_pct.map_or_else(|| "–".into(), |value| format!("{value:.3}"));
            let _ = writeln!(
                text,
                "{:8} n = {} {:>9} {:>9.6} {:>9.3} {:>9.0} {:>9.0} {left_out:>12}{}",
                name_of(row.topology),
                row.branches,
                row.variables,
                row.r2_mean,
                row.nrmse_pct,
                row.delta_aic,
                row.delta_bic,
                if row.chosen { "  chosen" } else { "" }
            );
        }
        text.push('\n');
    }
    if let Some(trust) = &report.trust {
        let _ = writeln!(text, "{:22} {:>12}  95 % interval", "parameter", "value");
        for estimate in &trust.estimates {
            let end = |end: Option<f64>| end.map_or_else(|| "open".into(), |value| format!("{value:.4e}"));
            let _ = writeln!(
                text,
                "{:22} {:>12.5e}  {} … {}",
                estimate.name,
                estimate.value,
                end(estimate.low),
                end(estimate.high)
            );
        }
        text.push('\n');
    }
    for row in &report.recordings {
        let _ = writeln!(text, "{}: R² {:.6}, NRMSE {:.3} %", row.file, row.r2, row.nrmse_pct);
    }
    for warning in &report.warnings {
        let _ = writeln!(text, "warning: {warning}");
    }
    let _ = write!(
        text,
        "{}: {} with n = {}, R² mean {:.6}, {} evaluations in {:.1} s{}",
        report.parameters_file,
        report.topology,
        report.branches,
        report.r2_mean,
        report.evaluations,
        report.seconds,
        if report.interrupted { ", interrupted: the best so far" } else { "" }
    );
    text
}
