use std::fmt::Write;
use std::fs;
use std::path::Path;

use serde::Serialize;
use sha2::{Digest, Sha256};

use crate::agreement::Agreement;
use crate::error::{Error, Result, shown};
use crate::files::parameters::Parameters;
use crate::fit::loss::Loss;
use crate::fit::observation::Direction;
use crate::fit::selection::{Row, name_of};
use crate::fit::uncertainty::Trust;
use crate::fit::{Fit, Method, Settings};

/// What a fit found, for people and machines.
#[derive(Serialize)]
pub(in crate::commands) struct Report {
    pub(in crate::commands) recordings: Vec<RecordingRow>,
    pub(in crate::commands) r2_mean: f64,
    pub(in crate::commands) parameters_file: String,
    pub(in crate::commands) seconds: f64,
    pub(in crate::commands) evaluations: usize,
    pub(in crate::commands) topology: &'static str,
    pub(in crate::commands) branches: usize,
    pub(in crate::commands) interrupted: bool,
    pub(in crate::commands) structures: Vec<Row>,
    pub(in crate::commands) trust: Option<Trust>,
    pub(in crate::commands) warnings: Vec<String>,
}

#[derive(Serialize)]
pub(in crate::commands) struct RecordingRow {
    pub(in crate::commands) file: String,
    pub(in crate::commands) r2: f64,
    pub(in crate::commands) nrmse_pct: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(in crate::commands) rmse_m: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(in crate::commands) rmse_n: Option<f64>,
    pub(in crate::commands) samples: usize,
}

pub(in crate::commands) fn parameters_of(
    fit: &Fit,
    settings: &Settings,
    drive: Direction,
    files: &[&Path],
) -> Result<Parameters> {
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
    put("drive", if drive == Direction::Force { "force" } else { "displacement" }.into());
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
        model: fit.candidate.model()?,
        sensor_offset_m: fit.candidate.offset_m,
        board: None,
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

pub(in crate::commands) fn report_of(fit: &Fit, drive: Direction, files: &[&Path], out: &Path, seconds: f64) -> Report {
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
        structures: fit.table.clone(),
        trust: fit.trust.clone(),
        warnings: fit.warnings.clone(),
    }
}

pub(in crate::commands) fn text(report: &Report) -> String {
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
