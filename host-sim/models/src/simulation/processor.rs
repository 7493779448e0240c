//! The processor in the loop: the firmware's laws, step by step beside the same code on this host.
//!
//! The firmware runs in QEMU or on a board and takes its input through the link. Results are compared bit by bit.

use std::path::Path;

use dea_driver::chips::{AdcRange, DacCode};
use dea_driver::server::Denial;
use dea_driver::wire::{Answer, BATCH, Command, Followed, Identity, Mode, Step, Target, TickCodes, Ticked};
use dea_driver::{Blob, Controller as HostController, Device, DriverState, Parameters};
use host_io::choice;
use indicatif::ProgressBar;
use rayon::prelude::*;
use springpot::{Applied, SensorSample};

use crate::error::{Error, Result};
use crate::files::parameters::DisplacementSensor;
use crate::files::recording::{Input, Recording};
use crate::grid::Grid;
use crate::link::{Client, Emulator, Port, named};
use crate::references;
use crate::simulation::closed_loop::{self, BenchModel};
use crate::simulation::controllers::{Controller, ControllerOutput};
use crate::simulation::film::{Film, Plant};

choice! {
    /// The code of the firmware that is compared.
    pub enum FirmwareLaw {
        /// The model and Eq. 1, both ways, under a recorded voltage.
        Step = "step",
        /// The observer, along a recorded voltage and displacement.
        Observer = "observer",
        /// Feedforward, its loop closed around a simulated film.
        Feedforward = "feedforward",
        /// Tracking, likewise, with a sensor of 5 µm noise at 100 Hz that is 10 ms late.
        Tracking = "tracking",
        /// The whole tick, codes of the converters in and out, along a recorded voltage and displacement.
        Tick = "tick",
    }
}

impl FirmwareLaw {
    /// Whether it follows references: the files are those, not recordings.
    pub fn follows_references(self) -> bool {
        matches!(self, Self::Feedforward | Self::Tracking)
    }
}

/// A task for the firmware and for the host.
#[derive(Clone, Debug, PartialEq)]
pub enum Task {
    /// Step the model under these voltages (V).
    Step(Vec<f32>),
    /// Observe under these voltages (V) with, where there are any, displacements of the film (m).
    Observe(Vec<Target>),
    /// Tick the whole controller, with these voltages (V) as set-points and these displacements of the film (m) at its sensor. The monitor
    /// shows what it has commanded two ticks ago, as a converter does that answers with the sample of the frame before.
    Tick(Vec<(f32, f32)>),
    /// Close the loop around a film along a reference.
    Follow {
        /// Mode of the controller.
        mode: Mode,
        /// The film.
        plant: Plant,
        /// Displacement, m.
        reference: Vec<f64>,
        /// Its grid.
        grid: Grid,
    },
}

/// Options of the tasks that are made of files.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TaskOptions {
    /// The code that is compared.
    pub law: FirmwareLaw,
    /// The film of a closed loop.
    pub plant: Option<Plant>,
    /// Steps per second.
    pub rate_hz: f64,
    /// Length of a task, s; the whole file if not given.
    pub duration_s: Option<f64>,
}

impl Task {
    /// The task of `recording`: to step or observe it, or to follow it as a reference, as [`FirmwareLaw::follows_references`] states.
    /// `sensor` is the displacement sensor that made the recording.
    ///
    /// # Errors
    ///
    /// [`Error`] naming the file or the option that cannot be used.
    pub fn from_recording(recording: &Recording, options: &TaskOptions, sensor: DisplacementSensor) -> Result<Self> {
        match options.law {
            FirmwareLaw::Feedforward => return Self::along(recording, options, Mode::Feedforward),
            FirmwareLaw::Tracking => return Self::along(recording, options, Mode::Tracking),
            FirmwareLaw::Step | FirmwareLaw::Observer | FirmwareLaw::Tick => {}
        }
        if options.plant.is_some() {
            let cause = "a recording is its own film; use `law` feedforward or tracking";
            return Err(Error::field("plant", cause));
        }
        let Input::Voltage(voltage) = recording.drive()? else {
            let cause = "a controller plays voltages: a column voltage_v or voltage_kv is needed";
            return Err(Error::file(recording.path(), cause));
        };
        let grid = Grid::covering(options.shortened(recording.duration_s()), options.rate_hz)?;
        let volts: Vec<f32> = grid.resample(&voltage).into_iter().map(|volts| volts as f32).collect();
        Ok(match options.law {
            FirmwareLaw::Step => Self::Step(volts),
            FirmwareLaw::Tick => {
                let readings = grid.resample(&recording.displacement()?);
                let displacements = readings.into_iter().map(|reading| sensor.film_displacement_m(reading) as f32);
                Self::Tick(volts.into_iter().zip(displacements).collect())
            }
            _ => Self::Observe(with_samples(recording, grid, &volts, sensor)?),
        })
    }

    fn along(recording: &Recording, options: &TaskOptions, mode: Mode) -> Result<Self> {
        let plant = options.plant.ok_or_else(|| Error::field("plant", "a film is needed: hossain or wang"))?;
        let (mut reference, grid) = references::on_grid(recording, options.rate_hz)?;
        let duration_s = options.shortened((grid.samples - 1) as f64 / options.rate_hz);
        let samples = Grid::covering(duration_s, options.rate_hz)?.samples;
        reference.truncate(samples);
        Ok(Self::Follow { mode, plant, reference, grid: Grid { samples, ..grid } })
    }

    /// Number of steps.
    pub fn steps(&self) -> usize {
        match self {
            Self::Step(volts) => volts.len(),
            Self::Observe(targets) => targets.len(),
            Self::Tick(inputs) => inputs.len(),
            Self::Follow { reference, .. } => reference.len(),
        }
    }

    /// Runs the task from rest in the firmware at `client` and in the `host`'s controller, and compares them.
    fn compare(&self, client: &mut Client, host: &mut HostController, progress: &ProgressBar) -> Result<BitComparison> {
        client.order(Command::Rest)?;
        host.rest();
        let mut comparison = BitComparison::default();
        match self {
            Self::Step(volts) => {
                for batch in volts.chunks(BATCH) {
                    let here = batch.iter().map(|&volts| host.step(volts));
                    comparison.add_batch(client.step(batch)?, here, step_bits);
                    progress.inc(batch.len() as u64);
                }
            }
            Self::Observe(targets) => {
                for batch in targets.chunks(BATCH) {
                    let here = batch.iter().map(|&target| host.follow(Mode::Voltage, target));
                    comparison.add_batch(follow(client, Mode::Voltage, batch)?, here, followed_bits);
                    progress.inc(batch.len() as u64);
                }
            }
            Self::Tick(inputs) => {
                let mut bench = CodeBench::new(host)?;
                for batch in inputs.chunks(BATCH) {
                    let (codes, here): (Vec<TickCodes>, Vec<Ticked>) =
                        batch.iter().map(|&(volts, metres)| bench.tick(volts, metres)).collect::<Result<_>>()?;
                    comparison.state = here.last().map(|tick| named(tick.state));
                    comparison.add_batch(client.tick(Mode::Voltage, &codes)?, here, ticked_bits);
                    progress.inc(batch.len() as u64);
                }
            }
            Self::Follow { mode, plant, reference, grid } => {
                let mut chip = ChipController { client, host, mode: *mode, comparison, fault: None };
                let (film, bench) = (Film::new(*plant), BenchModel::default());
                let run = closed_loop::track(&film, &bench, &mut chip, reference, *grid, progress);
                if let Some(fault) = chip.fault {
                    return Err(fault);
                }
                comparison = chip.comparison;
                comparison.tracking_rms_pct = run?.quality().tracking_rms_pct;
            }
        }
        Ok(comparison)
    }
}

impl TaskOptions {
    fn shortened(&self, seconds: f64) -> f64 {
        self.duration_s.map_or(seconds, |most| seconds.min(most))
    }
}

/// Voltages with the displacements that the `sensor` measured, each at the step that follows it.
fn with_samples(recording: &Recording, grid: Grid, volts: &[f32], sensor: DisplacementSensor) -> Result<Vec<Target>> {
    let measured = recording.displacement()?;
    let mut targets: Vec<Target> = volts.iter().map(|&value| Target { value, sample_m: None }).collect();
    for (time_s, &reading) in measured.time_s.iter().zip(&measured.value) {
        let step = (time_s * grid.rate_hz - 1e-6).ceil().max(0.0) as usize;
        if let Some(target) = targets.get_mut(step) {
            target.sample_m = Some(sensor.film_displacement_m(reading) as f32);
        }
    }
    Ok(targets)
}

/// The controller of a blob, on this host and in the firmware.
pub struct ProcessorTest {
    host: HostController,
    blob: Vec<u8>,
    /// Counts steps.
    pub progress: ProgressBar,
}

impl ProcessorTest {
    /// The test of `blob`, made for the board `id`.
    ///
    /// # Errors
    ///
    /// [`Error::Computation`] for a blob that a controller refuses.
    pub fn new(blob: Vec<u8>, id: u16, progress: ProgressBar) -> Result<Self> {
        let decoded = Blob::decode(&blob, id).map_err(|e| Error::Computation(e.to_string()))?;
        Ok(Self { host: HostController::new(decoded), blob, progress })
    }

    /// Runs `tasks` one after the other on the board at `port`.
    ///
    /// # Errors
    ///
    /// [`Error::Link`] for a board that does not answer or refuses.
    pub fn on_board(&self, port: &str, tasks: &[Task]) -> Result<Vec<BitComparison>> {
        let mut board = self.connect(Port::open(port)?)?;
        let comparisons = tasks.iter().map(|task| self.run(task, &mut board)).collect();
        // The test's parameters are not the bench's: the board returns to its stored ones. One that stores none refuses,
        // which is no fault of the test.
        let _ = board.0.ask(Command::Reload);
        comparisons
    }

    /// Runs `tasks` in QEMU, each in an emulator of its own, with the firmware `image` or else this project's.
    ///
    /// # Errors
    ///
    /// [`Error`] for an emulator that does not start, and as [`on_board`](Self::on_board).
    pub fn in_emulator(&self, image: Option<&Path>, tasks: &[Task]) -> Result<Vec<BitComparison>> {
        let image = match image {
            Some(image) => image.into(),
            None => {
                Emulator::build_image()?;
                Emulator::default_image()
            }
        };
        let emulated = |task| {
            let (_emulator, port) = Emulator::start(&image)?;
            self.run(task, &mut self.connect(port)?)
        };
        // No more emulators at once than there are cores. Nothing that is compared depends on time, and the emulator's port
        // waits long enough for one that gets little time.
        tasks.par_iter().map(emulated).collect()
    }

    fn connect(&self, port: Port) -> Result<(Client, Identity)> {
        let (mut client, identity) = Client::new(port)?;
        client.upload(&self.blob, false)?;
        Ok((client, identity))
    }

    fn run(&self, task: &Task, (client, identity): &mut (Client, Identity)) -> Result<BitComparison> {
        let comparison = task.compare(client, &mut self.host.clone(), &self.progress)?;
        Ok(BitComparison { firmware: identity.firmware.to_string(), ..comparison })
    }
}

/// The ticks of the firmware, and the cycles that they took.
fn follow(client: &mut Client, mode: Mode, batch: &[Target]) -> Result<(heapless::Vec<Followed, BATCH>, u32)> {
    match client.ask(Command::Follow { mode, targets: batch.iter().copied().collect() })? {
        Answer::Followed { ticks, cycles } if ticks.len() == batch.len() => Ok((ticks, cycles)),
        other => Err(client.unexpected(&other)),
    }
}

/// The host's controller, ticked through codes of converters, with the bench that gives them.
struct CodeBench {
    device: Device,
    parameters: Parameters,
    /// At the film in this tick and in the one before, V.
    stood_v: [f32; 2],
}

impl CodeBench {
    fn new(host: &HostController) -> Result<Self> {
        let mut device = Device::new(None);
        device.install(host.clone()).map_err(|refusal| Error::Computation(refusal.to_string()))?;
        device.rest().map_err(denied)?;
        Ok(Self { device, parameters: host.parameters().clone(), stood_v: [0.0; 2] })
    }

    /// A tick towards `volts`, with the film at `metres`: what goes in, and what comes out.
    fn tick(&mut self, volts: f32, metres: f32) -> Result<(TickCodes, Ticked)> {
        let Parameters { monitor, sensor, sensor_offset_m, amplifier, command_range, .. } = &self.parameters;
        let [now_v, before_v] = self.stood_v;
        let codes = TickCodes {
            interlock_closed: true,
            monitor: adc_code(monitor.invert(before_v)),
            sensor: adc_code(sensor.invert(metres + sensor_offset_m)),
            target: volts.abs(),
        };
        let ticked: Vec<Ticked> = self.device.tick_test(Mode::Voltage, &[codes]).map_err(denied)?;
        let ticked = ticked[0];
        let command_v =
            if ticked.enable { amplifier.apply(DacCode(ticked.command).volts(*command_range)) } else { 0.0 };
        self.stood_v = [command_v, now_v];
        Ok((codes, ticked))
    }
}

fn denied(denial: Denial) -> Error {
    Error::Computation(format!("whole ticks: {denial:?}"))
}

/// The nearest code of the board's converters.
fn adc_code(volts: f32) -> u16 {
    (volts / AdcRange::default().full_scale_v() * 65_536.0 + 0.5) as u16
}

fn ticked_bits(tick: &Ticked) -> (bool, u16, DriverState, u32) {
    (tick.enable, tick.command, tick.state, tick.predicted_m.to_bits())
}

/// The firmware as the controller of a closed loop, compared with the host's controller.
struct ChipController<'a> {
    client: &'a mut Client,
    host: &'a mut HostController,
    mode: Mode,
    comparison: BitComparison,
    fault: Option<Error>,
}

impl Controller for ChipController<'_> {
    fn tick(&mut self, _: Applied<f64>, sample: Option<SensorSample<f64>>, reference_m: f64) -> ControllerOutput {
        let target = Target { value: reference_m as f32, sample_m: sample.map(|sample| sample.displacement_m as f32) };
        let host = self.host.follow(self.mode, target);
        let mut voltage_v = 0.0;
        // After a fault the chip is asked nothing more, and the film is left at 0 V.
        if self.fault.is_none() {
            match follow(self.client, self.mode, &[target]) {
                Ok(chip) => {
                    voltage_v = f64::from(chip.0[0].voltage_v);
                    self.comparison.add_batch(chip, [host], followed_bits);
                }
                Err(error) => self.fault = Some(error),
            }
        }
        ControllerOutput { voltage_v, ..ControllerOutput::default() }
    }
}

/// Chip and host compared over a task.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BitComparison {
    /// Name and version of the firmware.
    pub firmware: String,
    /// Steps that were compared.
    pub steps: usize,
    /// Steps with other bits.
    pub mismatches: usize,
    /// The first step that differs.
    pub first: Option<String>,
    /// Cycles per step, batch by batch.
    pub cycles: Vec<f64>,
    /// Tracking error of a closed loop, in % of the reference's peak to peak.
    pub tracking_rms_pct: Option<f64>,
    /// State at the end of whole ticks: a tick that has tripped commands 0 V, and there is little left to compare.
    pub state: Option<String>,
}

impl BitComparison {
    /// Compares a batch that took the chip so many cycles with the host's.
    fn add_batch<A: std::fmt::Debug, B: PartialEq>(
        &mut self,
        (chip, cycles): (heapless::Vec<A, BATCH>, u32),
        host: impl IntoIterator<Item = A>,
        bits: fn(&A) -> B,
    ) {
        self.cycles.push(f64::from(cycles) / chip.len() as f64);
        for (chip, host) in chip.iter().zip(host) {
            if bits(chip) != bits(&host) {
                self.mismatches += 1;
                let place = self.steps;
                self.first.get_or_insert_with(|| format!("step {place}: {chip:?} on the chip, {host:?} here"));
            }
            self.steps += 1;
        }
    }
}

fn step_bits(step: &Step) -> [u32; 3] {
    [step.displacement_m, step.force_n, step.voltage_v].map(f32::to_bits)
}

fn followed_bits(tick: &Followed) -> [u32; 3] {
    [tick.voltage_v, tick.displacement_m, tick.disturbance_n].map(f32::to_bits)
}
