//! What a law of the firmware is put to, and compared in.

use dea_driver::Controller as Twin;
use dea_driver::wire::{Answer, BATCH, Command, Followed, Mode, Step, Target};
use indicatif::ProgressBar;
use springpot::{Applied, Limited, Sample};

use crate::bench::closed_loop::{self, Bench};
use crate::bench::controllers::{Controller, Output};
use crate::bench::film::{Film, Plant};
use crate::error::{Error, Result};
use crate::grid::Grid;
use crate::link::Client;

/// What a controller is put to.
pub(super) enum Task {
    /// Step the model under these voltages (V).
    Step(Vec<f32>),
    /// Observe these voltages (V) and, where there are any, samples (m).
    Observe(Vec<Target>),
    /// Close the loop around a film along this reference (m).
    Follow { mode: Mode, plant: Plant, reference: Vec<f64>, grid: Grid },
}

impl Task {
    /// How many steps it has.
    pub(super) fn steps(&self) -> usize {
        match self {
            Self::Step(volts) => volts.len(),
            Self::Observe(targets) => targets.len(),
            Self::Follow { reference, .. } => reference.len(),
        }
    }

    /// Puts the controller at `client` and its `twin` on this host to the task, from rest.
    pub(super) fn run(&self, client: &mut Client, twin: &mut Twin, bar: &ProgressBar) -> Result<Comparison> {
        client.order(Command::Rest)?;
        twin.rest();
        let mut comparison = Comparison::default();
        match self {
            Self::Step(volts) => {
                for batch in volts.chunks(BATCH) {
                    let (steps, cycles) = client.step(batch)?;
                    comparison.took(cycles, batch.len());
                    for (chip, &volts) in steps.iter().zip(batch) {
                        comparison.take(chip, &twin.step(volts), step_bits);
                    }
                    bar.inc(batch.len() as u64);
                }
            }
            Self::Observe(targets) => {
                for batch in targets.chunks(BATCH) {
                    let ticks = follow(client, Mode::Voltage, batch, &mut comparison)?;
                    for (chip, &target) in ticks.iter().zip(batch) {
                        comparison.take(chip, &twin.follow(Mode::Voltage, target), followed_bits);
                    }
                    bar.inc(batch.len() as u64);
                }
            }
            Self::Follow { mode, plant, reference, grid } => {
                let mut chip = Chip { client, twin, mode: *mode, comparison, fault: None };
                let run = closed_loop::run(&Film::new(*plant), &Bench::default(), &mut chip, reference, *grid, bar);
                if let Some(fault) = chip.fault {
                    return Err(fault);
                }
                comparison = chip.comparison;
                comparison.tracking_rms_pct = run?.tracked().tracking_rms_pct;
            }
        }
        Ok(comparison)
    }
}

fn follow(
    client: &mut Client,
    mode: Mode,
    batch: &[Target],
    comparison: &mut Comparison,
) -> Result<heapless::Vec<Followed, BATCH>> {
    match client.ask(Command::Follow { mode, targets: batch.iter().copied().collect() })? {
        Answer::Followed { ticks, cycles } if ticks.len() == batch.len() => {
            comparison.took(cycles, batch.len());
            Ok(ticks)
        }
        other => Err(client.unexpected(&other)),
    }
}

/// The firmware as the controller of a closed loop, with its twin on this host beside it.
struct Chip<'a> {
    client: &'a mut Client,
    twin: &'a mut Twin,
    mode: Mode,
    comparison: Comparison,
    fault: Option<Error>,
}

impl Controller for Chip<'_> {
    fn tick(&mut self, _: Applied<f64>, sample: Option<Sample<f64>>, reference_m: f64) -> Output {
        let target = Target { value: reference_m as f32, sample_m: sample.map(|sample| sample.displacement as f32) };
        let host = self.twin.follow(self.mode, target);
        let mut voltage_v = 0.0;
        // After a fault nothing is asked for any more; the film is left at 0 V.
        if self.fault.is_none() {
            match follow(self.client, self.mode, &[target], &mut self.comparison) {
                Ok(ticks) => {
                    voltage_v = f64::from(ticks[0].voltage_v);
                    self.comparison.take(&ticks[0], &host, followed_bits);
                }
                Err(error) => self.fault = Some(error),
            }
        }
        Output { voltage_v, limited: Limited::NONE, ..Output::default() }
    }
}

/// How chip and host compare.
#[derive(Debug, Default)]
pub(super) struct Comparison {
    pub(super) steps: usize,
    pub(super) mismatches: usize,
    /// The first step that differs.
    pub(super) first: Option<String>,
    /// Cycles per step, batch by batch.
    pub(super) cycles: Vec<f64>,
    /// Of a closed loop, in % of the reference's peak to peak.
    pub(super) tracking_rms_pct: Option<f64>,
}

impl Comparison {
    fn took(&mut self, cycles: u32, steps: usize) {
        self.cycles.push(f64::from(cycles) / steps as f64);
    }

    fn take<A: std::fmt::Debug>(&mut self, chip: &A, host: &A, bits: fn(&A) -> [u32; 3]) {
        if bits(chip) != bits(host) {
            self.mismatches += 1;
            let place = self.steps;
            self.first.get_or_insert_with(|| format!("step {place}: {chip:?} on the chip, {host:?} here"));
        }
        self.steps += 1;
    }
}

fn step_bits(step: &Step) -> [u32; 3] {
    [step.displacement_m, step.force_n, step.voltage_v].map(f32::to_bits)
}

fn followed_bits(tick: &Followed) -> [u32; 3] {
    [tick.voltage_v, tick.displacement_m, tick.disturbance_n].map(f32::to_bits)
}
