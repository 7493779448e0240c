//! Models of creep side by side: error and cost against the number of fitted quantities.

use super::figure::{Line, Panel};
use crate::studies::compare::{FAMILIES, ModelRow};

/// The error on the recordings, the error on recordings that were left out where there is one, and the time of a step.
pub fn panels(models: &[ModelRow]) -> Vec<Panel> {
    type Kind = (&'static str, &'static str, fn(&ModelRow) -> Option<f64>);
    const KINDS: [Kind; 4] = [
        ("Error on the recordings that were fitted", "NRMSE (% of p-p)", |row| Some(row.nrmse_pct)),
        ("Error on recordings that were left out", "NRMSE (% of p-p)", |row| row.left_out_nrmse_pct),
        ("Error after the part that was fitted", "RMS error (% of RMS)", |row| row.beyond_pct),
        ("Time of a step on this machine", "time (ns)", |row| Some(row.step_ns)),
    ];
    KINDS
        .into_iter()
        .map(|(title, label, value)| {
            let panel = Panel::new(title, "fitted quantities", label).logarithmic(false, true);
            let lines = FAMILIES.into_iter().map(|family| line(models, family, value));
            lines.filter(|line| !line.points.is_empty()).fold(panel, Panel::with)
        })
        .filter(|panel| !panel.lines.is_empty())
        .collect()
}

fn line(models: &[ModelRow], family: &str, value: fn(&ModelRow) -> Option<f64>) -> Line {
    let rows = models.iter().filter(|row| row.family == family);
    let mut points: Vec<(f64, f64)> = rows.filter_map(|row| Some((row.parameters as f64, value(row)?))).collect();
    points.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (x, y): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
    Line::new(family, &x, &y).marked()
}
