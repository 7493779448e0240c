//! The processor in the loop.

mod tasks;

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use dea_driver::wire::{Command, Identity, Mode, Target};
use dea_driver::{Blob, Controller};
use indicatif::ProgressBar;
use rayon::prelude::*;
use serde::Serialize;

use self::tasks::{Comparison, Task};
use crate::bench::film::Plant;
use crate::error::{Error, Result, shown};
use crate::files::parameters::{Board, Parameters};
use crate::files::recording::{Input, Recording};
use crate::grid::Grid;
use crate::link::{Client, Emulator, Port};
use crate::references;
use crate::terminal;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Parameter file (TOML), or preset:NAME such as preset:table3-n2.
    #[arg(long, value_name = "P")]
    params: String,
    /// Which code of the firmware.
    #[arg(long, value_enum, default_value_t = Law::Step)]
    law: Law,
    /// The film of feedforward and tracking.
    #[arg(long, value_enum)]
    plant: Option<Plant>,
    /// Steps per second.
    #[arg(long, value_name = "HZ", default_value_t = 1000.0)]
    rate: f64,
    /// So much of every file; all of it if not given.
    #[arg(long, value_name = "SECONDS")]
    duration: Option<f64>,
    /// A real board instead of QEMU: a serial port, or tcp:HOST:PORT.
    #[arg(long, value_name = "PORT", conflicts_with = "image")]
    port: Option<String>,
    /// Firmware image for QEMU; this project's, built if need be, if not given.
    #[arg(long, value_name = "ELF")]
    image: Option<PathBuf>,
    /// Recordings to step or observe, or references to follow.
    #[arg(value_name = "REC.csv", required = true)]
    files: Vec<PathBuf>,
}

/// What runs on the processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Law {
    /// The model and Eq. 1, both ways, under a recorded voltage.
    Step,
    /// The observer, along a recorded voltage and displacement.
    Observer,
    /// Feedforward, its loop closed around a simulated film.
    Feedforward,
    /// Tracking, likewise, with a sensor of 5 µm noise at 100 Hz that is 10 ms late.
    Tracking,
}

#[derive(Serialize)]
struct Row {
    file: String,
    steps: usize,
    mismatches: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    tracking_rms_pct: Option<f64>,
}

#[derive(Serialize)]
struct Report {
    recordings: Vec<Row>,
    steps: usize,
    mismatches: usize,
    /// In QEMU, with what taking a frame apart costs: the law alone stands in the README.
    #[serde(skip_serializing_if = "Option::is_none")]
    instructions_per_step: Option<f64>,
    /// The same on a real board.
    #[serde(skip_serializing_if = "Option::is_none")]
    cycles_per_step: Option<f64>,
    firmware: String,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let parameters = Parameters::load(&arguments.params)?;
    let rate_hz = super::board_rate(arguments.rate)?;
    if arguments.duration.is_some_and(|seconds| !(seconds.is_finite() && seconds > 0.0)) {
        return Err(Error::option("--duration", "must be finite and greater than 0 s"));
    }
    let board = parameters.board.clone().unwrap_or_else(|| Board::bench(&parameters.actuator));
    let refused = |error: Error| error.about(&arguments.params, arguments.params.as_ref());
    let blob = parameters.to_blob(&board, rate_hz).map_err(refused)?;
    // The very code of the controller, on this host.
    let decoded = Blob::decode(&blob, board.id).map_err(|e| refused(Error::Computation(e.to_string())))?;
    let twin = Controller::new(decoded);
    let tasks = arguments.files.iter().map(|path| arguments.task(path, rate_hz)).collect::<Result<Vec<Task>>>()?;

    let bar = terminal::progress(tasks.iter().map(|task| task.steps() as u64).sum(), "pil");
    let test = Test { twin, blob, bar };
    let runs = match &arguments.port {
        // One after the other: there is one board.
        Some(name) => {
            let mut board = test.connect(Port::open(name)?)?;
            let runs = tasks.iter().map(|task| test.run(task, &mut board)).collect::<Result<Vec<Run>>>();
            // The parameters of the test are not those of the bench: back to those that it keeps. A board that keeps none
            // says so, which is no fault here.
            let _ = board.0.ask(Command::Reload);
            runs?
        }
        None => {
            let image = match &arguments.image {
                Some(image) => image.clone(),
                None => {
                    Emulator::build_image()?;
                    Emulator::default_image()
                }
            };
            let emulated = |task| {
                let (_emulator, port) = Emulator::start(&image)?;
                test.run(task, &mut test.connect(port)?)
            };
            // No more emulators at once than there are cores. Nothing that is compared depends on time, and the emulator's
            // port waits long enough for one that is starved.
            tasks.par_iter().map(emulated).collect::<Result<Vec<Run>>>()?
        }
    };
    test.bar.finish_and_clear();
    arguments.report(&runs, json)
}

/// What came of a file, and which firmware did it.
type Run = (Comparison, String);

/// What is compared with a controller.
struct Test {
    twin: Controller,
    blob: Vec<u8>,
    bar: ProgressBar,
}

impl Test {
    fn connect(&self, port: Port) -> Result<(Client, Identity)> {
        let (mut client, identity) = Client::new(port)?;
        client.upload(&self.blob, false)?;
        Ok((client, identity))
    }

    fn run(&self, task: &Task, (client, identity): &mut (Client, Identity)) -> Result<Run> {
        let comparison = task.run(client, &mut self.twin.clone(), &self.bar)?;
        Ok((comparison, identity.firmware.to_string()))
    }
}

impl Arguments {
    /// What the controller is put to with the file at `path`.
    fn task(&self, path: &Path, rate_hz: f64) -> Result<Task> {
        let shortened = |seconds: f64| self.duration.map_or(seconds, |most| seconds.min(most));
        let mode = match self.law {
            Law::Step | Law::Observer => {
                if self.plant.is_some() {
                    return Err(Error::option(
                        "--plant",
                        "a recording is its own film; use --law feedforward or tracking",
                    ));
                }
                let recording = Recording::read(path)?;
                let Input::Voltage(voltage) = recording.drive()? else {
                    return Err(Error::file(
                        path,
                        "a controller plays voltages: a column voltage_v or voltage_kv is needed",
                    ));
                };
                let grid = Grid::covering(shortened(recording.duration_s()), rate_hz)?;
                let volts: Vec<f32> = grid.resample(&voltage).into_iter().map(|volts| volts as f32).collect();
                return Ok(match self.law {
                    Law::Step => Task::Step(volts),
                    _ => Task::Observe(with_samples(&recording, grid, &volts)?),
                });
            }
            Law::Feedforward => Mode::Feedforward,
            Law::Tracking => Mode::Tracking,
        };
        let plant = self.plant.ok_or_else(|| Error::option("--plant", "a film is needed: hossain or wang"))?;
        let (mut reference, grid) = references::read(path, rate_hz)?;
        let samples = Grid::covering(shortened((grid.samples - 1) as f64 / rate_hz), rate_hz)?.samples;
        reference.truncate(samples);
        Ok(Task::Follow { mode, plant, reference, grid: Grid { samples, ..grid } })
    }

    fn report(&self, runs: &[Run], json: bool) -> Result<()> {
        let rows: Vec<Row> = self
            .files
            .iter()
            .zip(runs)
            .map(|(path, (comparison, _))| Row {
                file: shown(path),
                steps: comparison.steps,
                mismatches: comparison.mismatches,
                tracking_rms_pct: comparison.tracking_rms_pct,
            })
            .collect();
        let mut cycles: Vec<f64> = runs.iter().flat_map(|(comparison, _)| comparison.cycles.iter().copied()).collect();
        cycles.sort_by(f64::total_cmp);
        let median = cycles.get(cycles.len() / 2).copied();
        let emulated = self.port.is_none();
        let report = Report {
            steps: rows.iter().map(|row| row.steps).sum(),
            mismatches: rows.iter().map(|row| row.mismatches).sum(),
            recordings: rows,
            instructions_per_step: median.filter(|_| emulated).map(|cycles| cycles * 1e9 / Emulator::CLOCK_HZ),
            cycles_per_step: median.filter(|_| !emulated),
            firmware: runs.first().map_or(String::new(), |(_, firmware)| firmware.clone()),
        };
        terminal::report(json, &report, || table(&report))?;
        let first =
            self.files.iter().zip(runs).find_map(|(path, (comparison, _))| Some((path, comparison.first.as_ref()?)));
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

/// Voltages with the measured displacements, each at the step that follows it.
fn with_samples(recording: &Recording, grid: Grid, volts: &[f32]) -> Result<Vec<Target>> {
    let measured = recording.displacement()?;
    let mut targets: Vec<Target> = volts.iter().map(|&value| Target { value, sample_m: None }).collect();
    for (time_s, displacement) in measured.time_s.iter().zip(&measured.value) {
        let step = (time_s * grid.rate_hz - 1e-6).ceil().max(0.0) as usize;
        if let Some(target) = targets.get_mut(step) {
            target.sample_m = Some(*displacement as f32);
        }
    }
    Ok(targets)
}

fn table(report: &Report) -> String {
    let width = report.recordings.iter().map(|row| row.file.len()).max().unwrap_or(0).max("recording".len());
    let mut text = format!("{:width$} {:>9} {:>11}\n", "recording", "steps", "mismatches");
    for Row { file, steps, mismatches, tracking_rms_pct } in &report.recordings {
        let tracking = tracking_rms_pct.map_or(String::new(), |error| format!("   tracking error {error:.4} % RMS"));
        text += &format!("{file:width$} {steps:>9} {mismatches:>11}{tracking}\n");
    }
    text += &format!("{:width$} {:>9} {:>11}\n", "all", report.steps, report.mismatches);
    let cost = match (report.instructions_per_step, report.cycles_per_step) {
        (Some(count), _) => format!("{count:.0} instructions a step"),
        (None, Some(count)) => format!("{count:.0} cycles a step"),
        (None, None) => "nothing to count".into(),
    };
    text + &format!("firmware {}, {cost}", report.firmware)
}
