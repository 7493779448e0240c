//! Loops in which the film is its own sensor.

use springpot::{Applied, FilmReading, SelfSensed, SelfSensing, SelfSensingFault, SelfSensingState, SensorSample};

use crate::error::{Error, Result};
use crate::grid::Grid;
use crate::progress::Watch;
use crate::simulation::closed_loop::{LoopRun, LoopTick, held, torn};
use crate::simulation::controllers::{Controller, ControllerOutput};
use crate::simulation::electrical::ElectricalBench;

/// Self-sensing on a bench, tick by tick.
pub struct SensedBench<'a, 'b> {
    bench: &'b mut ElectricalBench<'a>,
    sensing: &'b SelfSensing<f32>,
    state: SelfSensingState<f32>,
    reading: FilmReading<f64>,
}

impl<'a, 'b> SensedBench<'a, 'b> {
    /// `sensing` on `bench`, from rest.
    pub fn at_rest(bench: &'b mut ElectricalBench<'a>, sensing: &'b SelfSensing<f32>) -> Self {
        let reading = FilmReading { voltage_v: 0.0, current_a: 0.0 };
        Self { bench, state: sensing.state(), sensing, reading }
    }

    /// The bench.
    pub fn bench(&mut self) -> &mut ElectricalBench<'a> {
        self.bench
    }

    /// Why the film cannot be sensed.
    #[must_use]
    pub fn fault(&self) -> Option<SelfSensingFault> {
        self.state.fault()
    }

    /// First half of a tick: the readings of the last one.
    pub fn sense(&mut self) -> Option<SelfSensed<f32>> {
        let FilmReading { voltage_v, current_a } = self.reading;
        let reading = FilmReading { voltage_v: voltage_v as f32, current_a: current_a as f32 };
        self.sensing.sense(&mut self.state, reading)
    }

    /// Second half: `voltage_v` (V) with the tone, 0 V once there is a fault.
    pub fn drive(&mut self, voltage_v: f64) {
        let commanded = match self.fault() {
            None => f64::from(self.sensing.drive(&self.state, voltage_v as f32)),
            Some(_) => 0.0,
        };
        self.reading = self.bench.tick(commanded);
    }
}

/// [`follow`] along `reference` (m, on `grid`), every tick kept; `progress` counts samples and may end the run.
///
/// # Errors
///
/// As [`follow`], and [`Error::Computation`] for a fault.
pub fn track(
    sensed: &mut SensedBench,
    controller: &mut dyn Controller,
    reference: &[f64],
    grid: Grid,
    progress: &dyn Watch,
) -> Result<LoopRun> {
    let mut run = LoopRun::default();
    let found = follow(sensed, controller, held(reference), grid, |k, _, tick| run.keep(k, &tick, progress))?;
    let Some((fault, tick)) = found else { return Ok(run) };
    let cause = match fault {
        SelfSensingFault::NoTone => "the amplifier passes no tone",
        SelfSensingFault::Shorted => "the film conducts",
        SelfSensingFault::CurrentMonitor => "the current has no tone",
        _ => "an electrode is lost: too little capacitance, or too much resistance; is the relation that of this film?",
    };
    Err(Error::Computation(format!("self-sensing ended at 0 V at {:.3} s: {cause}", grid.time_s(tick))))
}

/// Runs `controller` along `reference` (m, of the number of a sample of `grid`) on `sensed`, which is at rest; its samples are those of the film
/// itself. `seen` is shown every tick before the voltage is applied, and may break something.
///
/// With a fault the run goes on at 0 V. Returns the fault, and the tick in which it was found.
///
/// # Errors
///
/// [`Error::Computation`] where the film is torn or pulled in, and what `seen` returns.
pub fn follow(
    sensed: &mut SensedBench,
    controller: &mut dyn Controller,
    reference: impl Fn(usize) -> f64,
    grid: Grid,
    mut seen: impl FnMut(usize, &mut ElectricalBench, LoopTick) -> Result<()>,
) -> Result<Option<(SelfSensingFault, usize)>> {
    let (mut commanded, mut asked) = (0.0, reference(0));
    let mut shaped = asked;
    let mut found = None;
    for k in 0..grid.samples {
        let displacement_m = sensed.bench.plant().displacement_m();
        let sample = sensed.sense().map(|sensed| SensorSample {
            displacement_m: f64::from(sensed.sample.displacement_m),
            age_ticks: sensed.sample.age_ticks,
        });
        found = found.or_else(|| sensed.fault().map(|fault| (fault, k)));
        let target = reference(k + 1);
        let output = match found {
            None => controller.tick(Applied::as_commanded(commanded), sample, target),
            Some(_) => ControllerOutput::default(),
        };
        seen(k, sensed.bench, LoopTick { asked_m: asked, reference_m: shaped, displacement_m, output })?;
        asked = target;
        shaped = output.reference_m.unwrap_or(target);
        commanded = output.voltage_v;
        sensed.drive(commanded);
        if !sensed.bench.plant().holds() {
            return Err(torn(grid.time_s(k), commanded));
        }
    }
    Ok(found)
}
