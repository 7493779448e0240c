use std::path::{Path, PathBuf};

use clap::Args;
use dea_driver::link::{BATCH, Command, Identity, Step};
use indicatif::ProgressBar;
use rayon::prelude::*;
use serde::Serialize;
use springpot::{Law, VoltageDrive};

use crate::error::{Error, Result, shown};
use crate::link::{Client, Emulator, Port};
use crate::parameters::{Board, Parameters};
use crate::recording::{Input, Recording};
use crate::run;
use crate::series::Grid;
use crate::terminal;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Parameter file (TOML), or preset:NAME such as preset:table3-n2.
    #[arg(long, value_name = "P")]
    params: String,
    /// Steps per second.
    #[arg(long, value_name = "HZ", default_value_t = 1000.0)]
    rate: f64,
    /// So much of every recording; all of it if not given.
    #[arg(long, value_name = "SECONDS")]
    duration: Option<f64>,
    /// A real board instead of QEMU: a serial port, or tcp:HOST:PORT.
    #[arg(long, value_name = "PORT", conflicts_with = "image")]
    port: Option<String>,
    /// Firmware image for QEMU; this project's, built if need be, if not given.
    #[arg(long, value_name = "ELF")]
    image: Option<PathBuf>,
    /// Recordings whose voltage is played.
    #[arg(value_name = "REC.csv", required = true)]
    recordings: Vec<PathBuf>,
}

#[derive(Serialize)]
struct Row {
    file: String,
    steps: usize,
    mismatches: usize,
}

#[derive(Serialize)]
struct Report {
    recordings: Vec<Row>,
    steps: usize,
    mismatches: usize,
    /// Of a step of the model with Eq. 1 both ways; of QEMU.
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
    let board = parameters.board.clone().unwrap_or_else(|| Board::bench(&parameters.actuator));
    let about = |error: Error| error.about(&arguments.params, arguments.params.as_ref());
    let blob = parameters.to_blob(&board, rate_hz).map_err(about)?;
    let law = run::compressed_law::<f32>(&parameters.model, rate_hz).map_err(about)?;
    let largest_v = f64::from(board.limits.max_voltage_v);
    let drive = VoltageDrive::new(&parameters.actuator, largest_v, law.stiffness())?;
    if arguments.duration.is_some_and(|seconds| !(seconds.is_finite() && seconds > 0.0)) {
        return Err(Error::option("--duration", "must be finite and greater than 0 s"));
    }
    let profiles =
        arguments.recordings.iter().map(|path| profile(path, arguments, rate_hz)).collect::<Result<Vec<_>>>()?;

    let bar = terminal::progress(profiles.iter().map(|profile| profile.volts.len() as u64).sum(), "pil");
    let test = Test { law, drive, blob, bar };
    let runs = match &arguments.port {
        // One after the other: there is one board.
        Some(name) => {
            let mut board = test.connect(Port::open(name)?)?;
            profiles.iter().map(|profile| test.run(profile, &mut board)).collect::<Result<Vec<Run>>>()?
        }
        None => {
            let image = match &arguments.image {
                Some(image) => image.clone(),
                None => {
                    Emulator::build_image()?;
                    Emulator::default_image()
                }
            };
            let emulated = |profile| {
                let (_emulator, port) = Emulator::start(&image)?;
                test.run(profile, &mut test.connect(port)?)
            };
            profiles.par_iter().map(emulated).collect::<Result<Vec<Run>>>()?
        }
    };
    test.bar.finish_and_clear();

    let first = runs.iter().find_map(|run| run.first.clone());
    let firmware = runs.first().map_or(String::new(), |run| run.firmware.clone());
    let mut cycles: Vec<f64> = runs.iter().flat_map(|run| run.cycles.iter().copied()).collect();
    let rows: Vec<Row> = runs.into_iter().map(|run| run.row).collect();
    cycles.sort_by(f64::total_cmp);
    let median = cycles.get(cycles.len() / 2).copied();
    let emulated = arguments.port.is_none();
    let report = Report {
        steps: rows.iter().map(|row| row.steps).sum(),
        mismatches: rows.iter().map(|row| row.mismatches).sum(),
        recordings: rows,
        instructions_per_step: median.filter(|_| emulated).map(|cycles| cycles * 1e9 / Emulator::CLOCK_HZ),
        cycles_per_step: median.filter(|_| !emulated),
        firmware,
    };
    terminal::report(json, &report, || table(&report))?;
    match first {
        None => Ok(()),
        Some(first) => Err(Error::Computation(format!(
            "the controller does not give the host's bits: {} of {} steps differ, the first in {first}",
            report.mismatches, report.steps
        ))),
    }
}

/// What is compared with a controller.
struct Test {
    law: Law<f32>,
    drive: VoltageDrive<f32>,
    blob: Vec<u8>,
    bar: ProgressBar,
}

/// A voltage to play.
struct Profile {
    file: String,
    volts: Vec<f32>,
}

/// What came of a profile.
struct Run {
    row: Row,
    /// Cycles per step, batch by batch.
    cycles: Vec<f64>,
    /// The first step that differs.
    first: Option<String>,
    firmware: String,
}

impl Test {
    fn connect(&self, port: Port) -> Result<(Client, Identity)> {
        let (mut client, identity) = Client::new(port)?;
        client.upload(&self.blob, false)?;
        Ok((client, identity))
    }

    fn run(&self, profile: &Profile, (client, identity): &mut (Client, Identity)) -> Result<Run> {
        let Profile { file, volts } = profile;
        let row = Row { file: file.clone(), steps: volts.len(), mismatches: 0 };
        let mut run = Run { row, cycles: Vec::new(), first: None, firmware: identity.firmware.to_string() };
        let mut film = self.law.state();
        client.order(Command::Rest)?;
        for (index, batch) in volts.chunks(BATCH).enumerate() {
            let (steps, cycles) = client.step(batch)?;
            if batch.len() == BATCH {
                run.cycles.push(f64::from(cycles) / BATCH as f64);
            }
            for (place, (chip, &volts)) in (index * BATCH..).zip(steps.iter().zip(batch)) {
                // A step as the controller does it.
                let load = self.drive.load(volts);
                let displacement_m = self.law.displacement_under(&mut film, load);
                let voltage_v = self.drive.voltage(load.force + load.slope * displacement_m, displacement_m);
                let host = Step { displacement_m, force_n: film.base_force(), voltage_v };
                if bits(chip) != bits(&host) {
                    run.row.mismatches += 1;
                    run.first
                        .get_or_insert_with(|| format!("{file}, step {place}: {chip:?} on the chip, {host:?} here"));
                }
            }
            self.bar.inc(batch.len() as u64);
        }
        Ok(run)
    }
}

fn bits(step: &Step) -> [u32; 3] {
    [step.displacement_m, step.force_n, step.voltage_v].map(f32::to_bits)
}

fn profile(path: &Path, arguments: &Arguments, rate_hz: f64) -> Result<Profile> {
    let recording = Recording::read(path)?;
    let Input::Voltage(voltage) = recording.drive()? else {
        return Err(Error::file(path, "a controller plays voltages: a column voltage_v or voltage_kv is needed"));
    };
    let seconds = arguments.duration.map_or(recording.duration_s(), |seconds| seconds.min(recording.duration_s()));
    let volts = Grid::covering(seconds, rate_hz)?.resample(&voltage);
    Ok(Profile { file: shown(path), volts: volts.into_iter().map(|volts| volts as f32).collect() })
}

fn table(report: &Report) -> String {
    let width = report.recordings.iter().map(|row| row.file.len()).max().unwrap_or(0).max("recording".len());
    let mut text = format!("{:width$} {:>9} {:>11}\n", "recording", "steps", "mismatches");
    for Row { file, steps, mismatches } in &report.recordings {
        text += &format!("{file:width$} {steps:>9} {mismatches:>11}\n");
    }
    text += &format!("{:width$} {:>9} {:>11}\n", "all", report.steps, report.mismatches);
    let cost = match (report.instructions_per_step, report.cycles_per_step) {
        (Some(count), _) => format!("{count:.0} instructions a step"),
        (None, Some(count)) => format!("{count:.0} cycles a step"),
        (None, None) => "too short to count instructions".into(),
    };
    text + &format!("firmware {}, {cost}: model, Eq. 1 both ways", report.firmware)
}
