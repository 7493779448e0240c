//! The result of a sitting, and its verdict.

use std::path::PathBuf;

use host_io::choice::Choice;
use serde::Serialize;

use super::bench::Check;
use super::diagnosis::{Cause, Finding};
use super::plan::{Plan, Step};
use super::ramp::{self, Limits};
use super::verification::{MIN_SEGMENTS, Quality};
use crate::fit::Warning;
use crate::fit::capacitance::Prospect;

/// Share by which monitor and command may differ where voltages that are commanded in advance miss.
const MONITOR_ERROR: f64 = 0.005;

/// The verdict.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Verdict {
    /// Whether the film follows, as far as all steps show.
    pub passed: bool,
    /// In one sentence.
    pub sentence: String,
    /// The next thing to do.
    pub next: String,
}

/// Creep with and without compensation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Creep {
    /// Growth of the stroke under a constant voltage, % of it.
    pub without_pct: f64,
    /// Growth of the error while tracking, from the first to the last third, % of the range.
    pub with_pct: f64,
}

/// The result.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    /// The verdict.
    pub verdict: Verdict,
    /// Faults, that of most weight first.
    pub findings: Vec<Finding>,
    /// Where the bench is, and its firmware.
    pub bench: String,
    /// Firmware of its controller.
    pub firmware: String,
    /// Limits of film and bench.
    pub limits: Limits,
    /// Steps that were done.
    pub steps: Vec<&'static str>,
    /// The self-test.
    pub self_test: Vec<Check>,
    /// A gauge, and how the sensor read it, m.
    pub gauge_m: Option<[f64; 2]>,
    /// The ramp.
    pub ramp: Option<ramp::Report>,
    /// Largest error of feedforward along the excitation and R², by the fit.
    pub fit: Option<FitRow>,
    /// The film as its own sensor: how far amplifier and voltage monitor suffice.
    pub self_sensing: Option<Prospect>,
    /// Checksum of the parameters that were read back.
    pub checksum: Option<u32>,
    /// The film without the sensor.
    pub feedforward: Option<Quality>,
    /// The film with it.
    pub tracking: Option<Quality>,
    /// Monitor over command along the segments without the sensor, less 1.
    pub monitor_error: Option<f64>,
    /// Creep.
    pub creep: Option<Creep>,
    /// Time of the film, s.
    pub film_s: f64,
    /// Files that were read or written, in their order.
    #[serde(skip)]
    pub files: Vec<PathBuf>,
    /// Rows of the hold and of the tracking, for the picture: time (s), displacement and reference (m).
    #[serde(skip)]
    pub picture: [Vec<[f64; 3]>; 2],
}

/// A fit in the record.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FitRow {
    /// Name of its topology, and number of branches.
    pub branches: usize,
    /// R².
    pub r2: f64,
    /// Part of the stroke that it leaves, without noise, %.
    pub misfit_pct: f64,
    /// Bandwidth of the observer, Hz: as the board states it, or less where the model's resonance is near.
    pub bandwidth_hz: f32,
    /// Its warnings, the most severe first.
    pub warnings: Vec<Warning>,
}

impl Report {
    pub(super) fn judge(&mut self, plan: &Plan) {
        if let [hold, tracked] = &self.picture
            && let (Some(first), Some(last)) = (hold.first(), hold.last())
            && tracked.len() > 300
        {
            let error = |rows: &[[f64; 3]]| rows.iter().map(|row| row[1] - row[2]).sum::<f64>() / rows.len() as f64;
            let third = tracked.len() / 3;
            let range = tracked.iter().fold((f64::MAX, f64::MIN), |(l, h), row| (l.min(row[2]), h.max(row[2])));
            let drift = error(&tracked[2 * third..]) - error(&tracked[..third]);
            self.creep = Some(Creep {
                without_pct: 100.0 * (last[1] - first[1]) / first[1],
                with_pct: 100.0 * drift.abs() / (range.1 - range.0),
            });
        }
        for (quality, allowed_pct, how) in [
            (&self.feedforward, plan.allowed_pct[0], "without the sensor"),
            (&self.tracking, plan.allowed_pct[1], "with the sensor"),
        ] {
            let Some(quality) = quality else { continue };
            let before = self.findings.len();
            if quality.largest_pct > allowed_pct {
                let measured =
                    format!("{:.1} % RMS in the worst segment {how}, {allowed_pct} % are allowed", quality.largest_pct);
                self.findings.push(Finding::new(Cause::Error, measured));
            } else if quality.rms_pct > quality.predicted_pct[1].max(0.3) {
                let measured = format!(
                    "{:.2} % RMS {how}, predicted were at most {:.2} %: the film or the bench is not what was fitted",
                    quality.rms_pct, quality.predicted_pct[1]
                );
                self.findings.push(Finding::new(Cause::Unexplained, measured));
            }
            // Voltages that are commanded in advance miss by it twice, in force.
            if let (Some(finding), Some(error)) = (self.findings.get_mut(before), self.monitor_error)
                && error.abs() > MONITOR_ERROR
            {
                let measured =
                    format!("{}; the monitor differs from the command by {:+.1} %", finding.measured, 100.0 * error);
                *finding = Finding::new(Cause::MonitorGain, measured);
            }
        }
        let (passed, sentence, next) = match (self.findings.first(), &self.feedforward, &self.tracking) {
            (Some(finding), ..) => (
                false,
                format!("not commissioned: {} ({})", finding.cause.name(), finding.measured),
                finding.advice.into(),
            ),
            (None, Some(open), Some(closed)) => {
                let creep = self.creep.map_or_else(String::new, |creep| {
                    format!("; creep removed: {:.1} → {:.1} %", creep.without_pct, creep.with_pct)
                });
                // Bounds are rounded up.
                let [closed_pct, open_pct] = [closed, open].map(|quality| (100.0 * quality.largest_pct).ceil() / 100.0);
                let sentence =
                    format!("follows within {closed_pct:.2} % RMS, {open_pct:.2} % without the sensor{creep}");
                let missing = [
                    (self.steps.len() < Step::CHOICES.len(), "run all steps at once for a record that passes"),
                    (
                        open.segments.min(closed.segments) < MIN_SEGMENTS,
                        "verify with at least 59 segments for a record that passes",
                    ),
                    (self.gauge_m.is_none(), "check the sensor with a gauge for a record that passes"),
                ];
                match missing.iter().find(|(is_missing, _)| *is_missing) {
                    Some((_, what)) => (false, sentence, (*what).into()),
                    None => (true, sentence, "play references within the stroke and the band of this record".into()),
                }
            }
            (None, ..) => (false, format!("done: {}", self.steps.join(", ")), "go on with the next step".into()),
        };
        self.verdict = Verdict { passed, sentence, next };
    }
}
