//! `self-sensing`: the relation of capacitance and displacement from a recording with a tone, and whether the monitors suffice.

use std::fmt::Write as _;

use super::prelude::*;
use super::{Verdict, options};
use crate::files::capacitance::ToneRecording;
use crate::fit::capacitance::{self, Report};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Recording of every tick: time_s, voltage_v, current_a (mean since the row before), displacement_m. The tone has four rows a period.
    #[arg(value_name = "REC.csv")]
    recording: PathBuf,
    /// File to write with the relation, the tone and the monitors (TOML), if they suffice.
    #[arg(long, value_name = "C.toml")]
    out: Option<PathBuf>,
    /// Parameter file (TOML), of whose board the slew limit and the amplifier are checked.
    #[arg(long, value_name = "P")]
    params: Option<String>,
    /// Capacitance of the cable without the film, pF: distinguishes a lost film from a broken current monitor. 0: not known.
    #[arg(long, value_name = "PF", value_parser = quantity::number, default_value_t = 0.0)]
    cable: f64,
}

#[derive(Serialize)]
struct Printed {
    recording: String,
    #[serde(flatten)]
    report: Report,
    /// Why the board does not pass the tone.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    refusals: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    out: Option<String>,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<Verdict> {
    let path = arguments.recording.as_path();
    if !(0.0..=1e6).contains(&arguments.cable) {
        return Err(Error::field("cable", format!("{:?} pF must be from 0 to 1000000", arguments.cable)));
    }
    arguments.out.iter().try_for_each(|out| output::check(out, &[path], Folders::Exist))?;
    let parameters = arguments.params.as_deref().map(options::load).transpose()?;
    let recording = ToneRecording::read(path)?;
    let bar = Progress::unknown("identify the relation");
    let (file, mut report) =
        capacitance::identify(&recording, 1e-12 * arguments.cable).map_err(|error| Error::file(path, error))?;
    bar.finish_and_clear();
    let board = parameters.map(|parameters| parameters.board_or_bench(1.0 / file.options.step_s));
    let refusals =
        board.map_or_else(Vec::new, |board| capacitance::refusals(&board, report.tone_v.round(), file.options.step_s));
    report.senses &= refusals.is_empty();
    let out = arguments.out.as_deref().filter(|_| report.senses);
    if let Some(out) = out {
        output::write_whole(out, |text| text.write_all(file.to_toml().as_bytes()))?;
    }
    let printed = Printed { recording: shown(path), report, refusals, out: out.map(shown) };
    terminal::report(json, &printed, || text(&printed))?;
    Ok(if report.senses { Verdict::Yes } else { Verdict::No })
}

/// The film as its own sensor, by a recording with a current.
#[derive(Serialize)]
pub(super) struct Checked {
    recording: String,
    #[serde(flatten)]
    report: Option<Report>,
    /// In words.
    pub(super) text: String,
}

/// Checks the recording at `path`; none if it has no current.
pub(super) fn check(path: &Path) -> Option<Checked> {
    if !ToneRecording::has_current(path) {
        return None;
    }
    let identified = ToneRecording::read(path)
        .and_then(|recording| capacitance::identify(&recording, 0.0).map_err(|error| Error::file(path, error)));
    let recording = shown(path);
    let (report, text) = match identified {
        Ok((_, report)) => {
            let printed = Printed { recording: recording.clone(), report, refusals: Vec::new(), out: None };
            (Some(report), text(&printed))
        }
        Err(error) => (None, error.to_string()),
    };
    Some(Checked { recording, report, text })
}

fn text(Printed { recording, report, refusals, out }: &Printed) -> String {
    let Report { tone_v, voltage_noise_v, current_noise_a, voltage_step_v, current_step_a, .. } = report;
    let mut text = format!(
        "{recording}: a tone of {tone_v:.1} V; noise {voltage_noise_v:.2} V in steps of {voltage_step_v:.2} V, {:.1} nA in steps of {:.1} nA\n\
         {:.1} pF at rest, {:.1} pF at {:.3} mm; residual {:.2} % of the stroke, without creep {:.2} %\n",
        1e9 * current_noise_a,
        1e9 * current_step_a,
        1e12 * report.rest_f,
        1e12 * report.max_f,
        1e3 * report.stroke_m,
        report.residual_pct,
        report.residual_without_creep_pct
    );
    let (noise, residual) = (report.noise_pct, report.residual_pct);
    // Noise is in the residual as well.
    let more_v = (tone_v * noise.max(residual)).ceil();
    let is_coarse = *current_step_a > 0.25 * current_noise_a || *voltage_step_v > 0.25 * voltage_noise_v;
    let shares =
        format!("{noise:.2} % of the stroke is noise over 50 ms, {residual:.2} % is not explained; 1 % is the most");
    text.push_str(&match refusals.as_slice() {
        [] if report.senses => format!("yes: {shares}"),
        [] if noise < 0.5 => format!("no: {shares}: drive without jumps, and hold levels for longer"),
        [] if is_coarse => format!("no: {shares}: use converters with more bits, or {more_v:.0} V of tone"),
        [] => format!("no: {shares}: use monitors with less noise, or {more_v:.0} V of tone"),
        refusals => format!("no: {}", refusals.join("; ")),
    });
    if let Some(out) = out {
        let _ = write!(text, "; in {out}");
    }
    text
}
