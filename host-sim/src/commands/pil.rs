//! `pil`: the processor in the loop, compared with this host bit by bit.

use super::options::LawOptions;
use super::prelude::*;
use super::recordings::RecordingOptions;
use crate::link::Emulator;
use crate::simulation::film::Plant;
use crate::simulation::processor::{BitComparison, FirmwareLaw, ProcessorTest, Task, TaskOptions};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    model: LawOptions,
    /// Which code of the firmware.
    #[arg(long, value_parser = named::<FirmwareLaw>(), default_value = "step")]
    law: FirmwareLaw,
    /// The film of feedforward and tracking.
    #[arg(long, value_parser = named::<Plant>())]
    plant: Option<Plant>,
    /// Length of every file that is used; all of it if not given.
    #[arg(long, value_name = "SECONDS", value_parser = quantity::seconds)]
    duration: Option<f64>,
    /// A real board instead of QEMU: a serial port, or tcp:HOST:PORT.
    #[arg(long, value_name = "PORT", conflicts_with = "image")]
    port: Option<String>,
    /// Firmware image for QEMU; this project's if not given, built where necessary.
    #[arg(long, value_name = "ELF")]
    image: Option<PathBuf>,
    #[command(flatten)]
    reading: RecordingOptions,
    /// Recordings to step or observe, or references to follow.
    #[arg(value_name = "REC.csv", required = true)]
    files: Vec<PathBuf>,
}

#[derive(Serialize)]
struct FileComparison {
    file: String,
    steps: usize,
    mismatches: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    tracking_rms_pct: Option<f64>,
    /// At the end of whole ticks.
    #[serde(skip_serializing_if = "Option::is_none")]
    state: Option<String>,
}

#[derive(Serialize)]
struct Report {
    recordings: Vec<FileComparison>,
    steps: usize,
    mismatches: usize,
    /// In QEMU, decoding of the frame included; `tests/embedded` counts the law alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    instructions_per_step: Option<f64>,
    /// The same on a real board.
    #[serde(skip_serializing_if = "Option::is_none")]
    cycles_per_step: Option<f64>,
    firmware: String,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let parameters = arguments.model.parameters()?;
    let rate_hz = super::board_rate(arguments.model.rate)?;
    if arguments.duration.is_some_and(|seconds| !(seconds.is_finite() && seconds > 0.0)) {
        return Err(Error::field("duration", "must be finite and greater than 0 s"));
    }
    let refused = |error: Error| error.about(&arguments.model.params, arguments.model.params.as_ref());
    let (blob, board) = parameters.checked_blob(rate_hz).map_err(refused)?;
    let options = TaskOptions { law: arguments.law, plant: arguments.plant, rate_hz, duration_s: arguments.duration };
    let tasks = arguments
        .files
        .iter()
        .map(|path| {
            let recording = if arguments.law.follows_references() {
                arguments.reading.read_reference(path)?
            } else {
                arguments.reading.read_one(path)?
            };
            Task::from_recording(&recording, &options, parameters.sensor())
        })
        .collect::<Result<Vec<Task>>>()?;

    let bar = Progress::over(tasks.iter().map(|task| task.steps() as u64).sum(), "pil");
    let test = ProcessorTest::new(blob, board.id, bar.clone())?;
    let comparisons = match &arguments.port {
        // There is one board.
        Some(port) => test.on_board(port, &tasks)?,
        None => test.in_emulator(arguments.image.as_deref(), &tasks)?,
    };
    bar.finish_and_clear();
    arguments.report(&comparisons, json)
}

impl Arguments {
    fn report(&self, comparisons: &[BitComparison], json: bool) -> Result<()> {
        let rows: Vec<FileComparison> = self
            .files
            .iter()
            .zip(comparisons)
            .map(|(path, comparison)| FileComparison {
                file: shown(path),
                steps: comparison.steps,
                mismatches: comparison.mismatches,
                tracking_rms_pct: comparison.tracking_rms_pct,
                state: comparison.state.clone(),
            })
            .collect();
        let mut cycles: Vec<f64> =
            comparisons.iter().flat_map(|comparison| comparison.cycles.iter().copied()).collect();
        cycles.sort_by(f64::total_cmp);
        let median = cycles.get(cycles.len() / 2).copied();
        let emulated = self.port.is_none();
        let report = Report {
            steps: rows.iter().map(|row| row.steps).sum(),
            mismatches: rows.iter().map(|row| row.mismatches).sum(),
            recordings: rows,
            instructions_per_step: median.filter(|_| emulated).map(|cycles| cycles * 1e9 / Emulator::CLOCK_HZ),
            cycles_per_step: median.filter(|_| !emulated),
            firmware: comparisons.first().map_or(String::new(), |comparison| comparison.firmware.clone()),
        };
        terminal::report(json, &report, || table(&report))?;
        let first =
            self.files.iter().zip(comparisons).find_map(|(path, comparison)| Some((path, comparison.first.as_ref()?)));
        match first {
            None => Ok(()),
            Some((path, first)) => Err(Error::Computation(format!(
                "the controller does not give the host's bits: {} of {} steps differ, the first in {}, {first}",
                report.mismatches,
                report.steps,
                shown(path)
            ))),
        }
    }
}

fn table(report: &Report) -> String {
    let width = report.recordings.iter().map(|row| row.file.len()).max().unwrap_or(0).max("recording".len());
    let mut text = format!("{:width$} {:>9} {:>11}\n", "recording", "steps", "mismatches");
    for FileComparison { file, steps, mismatches, tracking_rms_pct, state } in &report.recordings {
        let tracking = tracking_rms_pct.map_or(String::new(), |error| format!("   tracking error {error:.4} % RMS"));
        let state = state.as_ref().map_or(String::new(), |state| format!("   {state} at the end"));
        text += &format!("{file:width$} {steps:>9} {mismatches:>11}{tracking}{state}\n");
    }
    text += &format!("{:width$} {:>9} {:>11}\n", "all", report.steps, report.mismatches);
    let cost = match (report.instructions_per_step, report.cycles_per_step) {
        (Some(count), _) => format!("{count:.0} instructions a step"),
        (None, Some(count)) => format!("{count:.0} cycles a step"),
        (None, None) => "nothing to count".into(),
    };
    text + &format!("firmware {}, {cost}", report.firmware)
}
