//! A simulated bench: the driver's own controller around a simulated film, with faults on request.

use dea_driver::{Blob, Controller, DriverState, Inputs};
use host_io::choice;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::bench::{Bench, Check, Mode, Pilot, ROWS_HZ, Row};
use crate::error::{Error, Result};
use crate::files::parameters::{Board, Parameters};
use crate::simulation::film::{Instruments, Readings};
use crate::simulation::plant::Plant;
use crate::statistics::mean;

choice! {
    /// A fault of a bench.
    pub enum FaultKind {
        /// The sensor counts the other way.
        SensorSign = "sensor-sign",
        /// The sensor's readings times this.
        SensorScale = "sensor-scale",
        /// The monitor's readings times this.
        MonitorGain = "monitor-gain",
        /// The amplifier lags by this time constant, s.
        Lag = "lag",
        /// The sensor's readings are late by this, s.
        SensorDelay = "sensor-delay",
        /// The sensor's mount rings at this frequency, Hz.
        Resonance = "resonance",
        /// The mount slips by this share of the stroke, every minute or two.
        Slip = "slip",
        /// The voltage sags by this share at the largest voltage, less below.
        Leak = "leak",
        /// Arcs per second above two thirds of the largest voltage so far.
        Arc = "arc",
        /// Share of the time without a reading of the sensor.
        DropOuts = "drop-outs",
        /// The sensor's readings end at this, m.
        Saturation = "saturation",
        /// The amplifier ends at this, V.
        AmplifierEnd = "amplifier-end",
        /// The stroke is smaller by this factor.
        LittleStroke = "little-stroke",
        /// The controller's clock is slow by this share.
        Clock = "clock",
        /// The sensor's zero drifts by this, m/s.
        Drift = "drift",
        /// Friction holds the target back by this, m.
        Friction = "friction",
        /// The amplifier gives this times its command.
        AmplifierGain = "amplifier-gain",
        /// The monitor's zero is off by this, V.
        MonitorOffset = "monitor-offset",
        /// The film's stroke grows by this share in 1000 s, as one that warms up.
        Softening = "softening",
        /// The sensor picks up 50 Hz of this amplitude, m.
        Hum = "hum",
        /// The bench shakes for half a second every ten seconds or so, by this, m.
        Shaking = "shaking",
        /// The film has no voltage for this time, s, every half a minute or so, which the monitor does not see.
        Contact = "contact",
    }
}

/// A fault, and how strong it is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    /// Which one.
    pub kind: FaultKind,
    /// Its strength, in the unit of its kind.
    pub strength: f64,
}

const RATE_HZ: f64 = 1000.0;
/// Ticks of a row.
const TICKS: u64 = (RATE_HZ / ROWS_HZ) as u64;
/// Ticks before a run, in which the controller sees the sensor.
const SETTLING: u64 = 100;
/// Ticks in which the film discharges after a run, and is at 0 V for as long as the board wants to see it.
const DISCHARGE: u64 = 1100;

/// A simulated bench.
pub struct SimulatedBench<'a> {
    plant: Box<dyn Plant + 'a>,
    /// Ticks per substep of the plant, or substeps per tick: one of them is 1.
    substeps: (u64, u64),
    board: Board,
    parameters: Parameters,
    kept: Parameters,
    controller: Controller,
    faults: Vec<Fault>,
    readings: Readings,
    random: Pcg64,
    ticks: u64,
    /// Commanded and on the film, V.
    command_v: f64,
    film_v: f64,
    highest_v: f64,
    arc_ticks: u64,
    lost_ticks: u64,
    slipped_m: f64,
    next_slip: u64,
    /// Position and speed of the mount's ringing, m and m/s; the target behind friction, m.
    mount: (f64, f64),
    stuck_m: f64,
    /// Readings that are on their way, m.
    late_m: std::collections::VecDeque<f64>,
    /// Largest displacement of the film so far, m.
    furthest_m: f64,
}

impl<'a> SimulatedBench<'a> {
    /// A bench of `plant`, which rests and advances by `substep_s`, behind a controller of `parameters` with their board; noise and random
    /// faults from `seed`.
    ///
    /// # Errors
    ///
    /// [`Error`] for parameters that a controller refuses.
    pub fn new(
        plant: Box<dyn Plant + 'a>,
        substep_s: f64,
        parameters: &Parameters,
        instruments: Instruments,
        faults: Vec<Fault>,
        seed: u64,
    ) -> Result<Self> {
        let board = parameters.board_or_bench(RATE_HZ);
        let mut random = Pcg64::seed_from_u64(seed);
        let per_tick = 1.0 / (RATE_HZ * substep_s);
        Ok(Self {
            plant,
            substeps: ((1.0 / per_tick).round().max(1.0) as u64, per_tick.round().max(1.0) as u64),
            controller: Controller::new(blob(parameters, &board)?),
            parameters: parameters.clone(),
            kept: parameters.clone(),
            board,
            faults,
            readings: Readings::new(instruments, seed),
            next_slip: random.random_range(40_000..180_000),
            random,
            ticks: 0,
            command_v: 0.0,
            film_v: 0.0,
            highest_v: 0.0,
            arc_ticks: 0,
            lost_ticks: 0,
            slipped_m: 0.0,
            mount: (0.0, 0.0),
            stuck_m: 0.0,
            late_m: std::collections::VecDeque::new(),
            furthest_m: 0.0,
        })
    }

    /// Largest displacement of the film so far, m, and the voltage on it, V.
    pub fn film(&self) -> (f64, f64) {
        (self.furthest_m, self.film_v)
    }

    fn fault(&self, kind: FaultKind) -> Option<f64> {
        self.faults.iter().find(|fault| fault.kind == kind).map(|fault| fault.strength)
    }

    fn film_m(&self) -> f64 {
        let softer = self.fault(FaultKind::Softening).unwrap_or(0.0) * self.ticks as f64 / (1000.0 * RATE_HZ);
        self.plant.displacement_m() * (1.0 + softer) / self.fault(FaultKind::LittleStroke).unwrap_or(1.0)
    }

    /// The sensor's reading of the film as it is, m; none while it is lost.
    fn sensed_m(&mut self) -> Option<f64> {
        let mut x = self.film_m();
        if let Some(hz) = self.fault(FaultKind::Resonance) {
            let (omega, step_s) = (std::f64::consts::TAU * hz, 1.0 / RATE_HZ);
            let (at, speed) = &mut self.mount;
            *speed += step_s * (omega * omega * (x - *at) - 0.1 * omega * *speed);
            *at += step_s * *speed;
            x = *at;
        }
        if let Some(width_m) = self.fault(FaultKind::Friction) {
            self.stuck_m = self.stuck_m.clamp(x - width_m, x + width_m);
            x = self.stuck_m;
        }
        if let Some(share) = self.fault(FaultKind::Slip)
            && self.ticks >= self.next_slip
        {
            self.slipped_m += share * self.furthest_m;
            self.next_slip += self.random.random_range(60_000..120_000);
        }
        let time_s = self.ticks as f64 / RATE_HZ;
        if let Some(amplitude_m) = self.fault(FaultKind::Hum) {
            x += amplitude_m * (std::f64::consts::TAU * 50.02 * time_s).sin();
        }
        if let Some(amplitude_m) = self.fault(FaultKind::Shaking)
            && (time_s + 3.0 * (0.03 * time_s).sin()).rem_euclid(10.0) < 0.5
        {
            x += amplitude_m * (std::f64::consts::TAU * 7.3 * time_s).sin();
        }
        x += self.slipped_m + self.fault(FaultKind::Drift).unwrap_or(0.0) * time_s;
        x = self.scaled_m(x);
        x = x.min(self.fault(FaultKind::Saturation).unwrap_or(f64::INFINITY));
        self.late_m.push_back(x);
        let late = (self.fault(FaultKind::SensorDelay).unwrap_or(0.0) * RATE_HZ) as usize;
        if self.late_m.len() > late + 1 {
            self.late_m.pop_front();
        }
        let reading = self.readings.displacement_m(self.late_m[0]);
        if let Some(share) = self.fault(FaultKind::DropOuts) {
            // Twenty ticks each.
            if self.lost_ticks == 0 && self.random.random_bool(share / 20.0) {
                self.lost_ticks = 20;
            }
            if self.lost_ticks > 0 {
                self.lost_ticks -= 1;
                return None;
            }
        }
        Some(reading)
    }

    /// A displacement by the scale of the sensor.
    fn scaled_m(&self, x: f64) -> f64 {
        let sign = if self.fault(FaultKind::SensorSign).is_some() { -1.0 } else { 1.0 };
        sign * self.fault(FaultKind::SensorScale).unwrap_or(1.0) * x
    }

    /// A tick of controller, amplifier and film.
    fn tick(&mut self) -> dea_driver::Telemetry {
        let monitor_v = self.fault(FaultKind::MonitorGain).unwrap_or(1.0) * self.film_v;
        let monitor_v = self.readings.voltage_v(monitor_v) + self.fault(FaultKind::MonitorOffset).unwrap_or(0.0);
        let sensor = &self.board.sensor.clone();
        let inputs = Inputs {
            interlock_closed: true,
            monitor_adc_v: Some(self.board.monitor.invert(monitor_v as f32)),
            // Without a target the sensor is at the lower end of its converter.
            sensor_adc_v: Some(self.sensed_m().map_or(0.0, |metres| sensor.invert(metres as f32))),
        };
        self.controller.heartbeat();
        let outputs = self.controller.tick(inputs);
        self.command_v = if outputs.enable { f64::from(self.board.amplifier.apply(outputs.dac_v)) } else { 0.0 };
        self.amplify();
        // A slow clock: more of the film's time passes in a tick.
        let share = self.fault(FaultKind::Clock).unwrap_or(0.0);
        let more = u64::from(self.random.random_bool(share.clamp(0.0, 1.0)));
        let (ticks, substeps) = self.substeps;
        if self.ticks.is_multiple_of(ticks) {
            // First between two steps of the ramp: at one it ends it, and looks like friction, a resonance or saturation.
            let is_lost = self
                .fault(FaultKind::Contact)
                .is_some_and(|lost_s| (self.ticks as f64 / RATE_HZ + 16.1).rem_euclid(31.0) < lost_s);
            let film_v = if is_lost { 0.0 } else { self.film_v };
            (0..substeps * (1 + more)).for_each(|_| self.plant.advance(film_v));
        }
        self.ticks += 1;
        self.furthest_m = self.furthest_m.max(self.film_m());
        outputs.telemetry
    }

    fn idle(&mut self, ticks: u64) {
        (0..ticks).for_each(|_| {
            self.tick();
        });
    }

    fn amplify(&mut self) {
        let largest_v = f64::from(self.board.limits.max_voltage_v);
        let mut wanted_v = self.command_v.min(self.fault(FaultKind::AmplifierEnd).unwrap_or(f64::INFINITY));
        wanted_v *= self.fault(FaultKind::AmplifierGain).unwrap_or(1.0);
        if let Some(share) = self.fault(FaultKind::Leak) {
            wanted_v *= 1.0 - share * (wanted_v / largest_v).powi(2);
        }
        let lag_s = self.fault(FaultKind::Lag).unwrap_or(0.0);
        let share = if lag_s > 0.0 { -(-1.0 / (RATE_HZ * lag_s)).exp_m1() } else { 1.0 };
        self.film_v += share * (wanted_v - self.film_v);
        self.highest_v = self.highest_v.max(self.film_v);
        if let Some(per_s) = self.fault(FaultKind::Arc)
            && self.film_v > 0.66 * self.highest_v
            && self.film_v > 500.0
            && self.random.random_bool((per_s / RATE_HZ).min(1.0))
        {
            self.arc_ticks = 8;
        }
        if self.arc_ticks > 0 {
            self.arc_ticks -= 1;
            self.film_v *= 0.2;
        }
    }

    fn link_fault(&self, cause: String) -> Error {
        Error::Link { port: self.name(), cause }
    }
}

/// The blob of `parameters` on `board`, as the controller reads it.
fn blob(parameters: &Parameters, board: &Board) -> Result<Blob> {
    // This bench has no monitor of the current.
    let bytes = parameters.to_blob(&Board { self_sensing: None, ..board.clone() }, RATE_HZ)?;
    Blob::decode(&bytes, board.id).map_err(|error| Error::Computation(error.to_string()))
}

impl Bench for SimulatedBench<'_> {
    fn name(&self) -> String {
        "simulated bench".into()
    }

    fn firmware(&self) -> String {
        format!("dea-driver {}, on this host", env!("CARGO_PKG_VERSION"))
    }

    fn self_test(&mut self) -> Result<Vec<Check>> {
        let mut seen_v = Vec::new();
        let tripped = self.run(Mode::Voltage, &mut |row| {
            seen_v.push(row.monitor_v);
            (seen_v.len() < 200).then_some(if seen_v.len() < 10 { 0.0 } else { 50.0 })
        })?;
        let rise_v = mean(seen_v.get(150..).unwrap_or_default()) - mean(seen_v.get(..10).unwrap_or_default());
        let check = |what: &str, found: String, wanted: &str, passed| Check {
            what: what.into(),
            found,
            wanted: wanted.into(),
            passed,
        };
        Ok(vec![
            check("controller", tripped.clone().unwrap_or("ran".into()), "no trip", tripped.is_none()),
            check("monitor", format!("{rise_v:.1} V"), "50 V, within 10 %", (rise_v - 50.0).abs() < 5.0),
        ])
    }

    fn install(&mut self, parameters: &Parameters, keep: bool) -> Result<u32> {
        let board = parameters.board_or_bench(RATE_HZ);
        let controller = Controller::new(blob(parameters, &board)?);
        let checksum = controller.checksum().ok_or_else(|| self.link_fault("no checksum".into()))?;
        (self.controller, self.board, self.parameters) = (controller, board, parameters.clone());
        if keep {
            self.kept = parameters.clone();
        }
        Ok(checksum)
    }

    fn restore(&mut self) -> Result<()> {
        self.install(&self.kept.clone(), true).map(drop)
    }

    fn run(&mut self, mode: Mode, pilot: &mut Pilot<'_>) -> Result<Option<String>> {
        self.idle(SETTLING);
        let begun = self.controller.arm().and_then(|()| self.controller.start(mode));
        if let Err(refusal) = begun {
            let _ = self.controller.disarm();
            return Ok(Some(refusal.to_string()));
        }
        let mut ended = None;
        for k in 0_u64.. {
            let telemetry = self.tick();
            if !self.plant.holds() {
                self.controller.trip(dea_driver::Cause::Law);
                self.tick();
                return Err(self.link_fault("the film is torn or pulled in".into()));
            }
            if let DriverState::Tripped(cause) = self.controller.supervisor().state() {
                ended = Some(format!("tripped: {cause:?}"));
                break;
            }
            if !k.is_multiple_of(TICKS) {
                continue;
            }
            let row = Row {
                time_s: self.ticks as f64 / RATE_HZ,
                host_s: self.ticks as f64 / RATE_HZ * (1.0 + self.fault(FaultKind::Clock).unwrap_or(0.0)),
                command_v: telemetry.command_v.into(),
                monitor_v: telemetry.monitor_v.into(),
                displacement_m: telemetry.displacement_m.into(),
                reference_m: telemetry.reference_m.into(),
            };
            let Some(target) = pilot(&row) else { break };
            let set = match mode {
                Mode::Voltage => self.controller.set_voltage(target as f32),
                _ => self.controller.set_reference(target as f32),
            };
            if let Err(error) = set {
                ended = Some(format!("{error}: {target}"));
                break;
            }
        }
        if ended.as_ref().is_some_and(|_| !self.controller.supervisor().state().is_live()) {
            self.idle(DISCHARGE);
            let _ = self.controller.acknowledge();
        } else {
            let _ = self.controller.disarm();
            self.idle(DISCHARGE);
        }
        Ok(ended)
    }

    fn gauge(&mut self, displacement_m: f64) -> Option<f64> {
        Some(self.scaled_m(displacement_m))
    }
}
