//! The device: a controller around a film, between the requests of a host.

use dea_driver::server::Denial;
use dea_driver::wire::Reject;
use dea_driver::{
    Blob, Cause, Controller, Device, Drive, DriverState, Inputs, Mode, Motion, OnSensorFault, Parameters, Readings,
    Refusal, Telemetry,
};
use springpot::{Compressed, Law, LawState, VoltageDrive};

use super::{Counts, Mood, RATE_HZ, Source, limits};
use crate::bench::changed_parameters;
use crate::reference::Reference;
use crate::scale::cases;

/// A sensor of 1 mm/V that reads 1 V at rest, a monitor of 1 V/kV.
const M_PER_V: f32 = 1e-3;
const REST_M: f32 = -1e-3;

fn parameters(on_sensor_fault: OnSensorFault) -> Parameters {
    changed_parameters(|p| {
        p.limits = limits(on_sensor_fault);
        // Below the largest voltage once the film has thinned.
        (p.limits.max_field_v_per_m, p.limits.sensor.stuck_ticks) = (2.55e7, 100);
    })
}

/// The memory of a controller's film that no sensor corrects.
type Watched = Compressed<f32, 4, 11, 7>;

struct Bench {
    device: Device,
    reference: Reference,
    parameters: Parameters,
    law: Law<f32, Watched>,
    drive: VoltageDrive<f32>,
    /// The model under the commanded voltage alone, as the controller has it, which is also the film of this bench.
    film: LawState<f32, Watched>,
    /// Whether that is still a film that was at the end of its stroke for an hour, since no sensor has shown it at 0 V.
    is_assumed: bool,
    source: Source,
    mode: Mode,
    reference_is_set: bool,
    motion: Motion,
    /// Displacement per slow change of the load, m/N, and the load of the tick before, N.
    compliance_m_per_n: f32,
    load_n: f32,
    /// Share by which its law may be behind the film.
    margin: f32,
    last: Option<Telemetry>,
    disturbance_n: f32,
    output: Drive,
}

impl Bench {
    fn new(on_sensor_fault: OnSensorFault, seed: u64) -> Self {
        let parameters = parameters(on_sensor_fault);
        let blob = Blob::new(parameters.clone()).expect("valid");
        let observer = blob.follower().compensator().observer();
        let (law, drive): (Law<f32, Watched>, _) = (observer.law().coarser(), *observer.drive());
        let stroke_m = f64::from(parameters.limits.max_displacement_m);
        let margin = observer.law().margin_of(&law, stroke_m, parameters.actuator.stretch_coupling) as f32;
        let compliance =
            |at_m| observer.law().frequency_response_about(parameters.control.bandwidth_hz.into(), at_m).l1_norm();
        let compliance_m_per_n = compliance(0.0).max(compliance(stroke_m)) as f32;
        let mut device = Device::new(Some(Cause::Watchdog));
        device.stream(1);
        Self {
            device,
            reference: Reference::new(&parameters.limits, RATE_HZ),
            film: law.held(parameters.limits.max_displacement_m, 3600.0),
            is_assumed: true,
            law,
            drive,
            motion: Motion::new(parameters.limits.sensor).beyond_by(margin),
            compliance_m_per_n,
            load_n: 0.0,
            margin,
            parameters,
            source: Source::new(seed),
            mode: Mode::Voltage,
            reference_is_set: false,
            last: None,
            disturbance_n: 0.0,
            output: Drive::OFF,
        }
    }

    /// Without parameters nothing is enabled, whatever is asked for.
    fn without_parameters(&mut self) {
        let none = Err(Denial::Rejected(Reject::NoParameters));
        assert_eq!(self.device.state(), DriverState::Tripped(Cause::Watchdog));
        assert_eq!(self.device.arm(), none);
        assert_eq!(self.device.start(Mode::Voltage), none);
        assert_eq!(self.device.set_voltage(100.0), none);
        assert_eq!(self.device.set_reference(1e-4), none);
        let inputs = self.inputs();
        assert_eq!(self.device.tick(inputs), Drive::OFF);
    }

    /// Whether it was refused; so with every request here.
    fn install(&mut self) -> bool {
        let blob = Blob::new(self.parameters.clone()).expect("valid");
        let before = self.device.state();
        let done = self.device.install(Controller::new(blob));
        if before.is_live() {
            assert_eq!(done, Err(Refusal::State(before)));
            return true;
        }
        assert_eq!(done, Ok(()));
        self.reference = Reference::after(&self.reference, RATE_HZ);
        if let DriverState::Tripped(cause) = before {
            self.reference.trip(cause);
        }
        if self.last.is_none() && self.is_assumed {
            return false;
        }
        // The law is the same: its model goes on.
        self.motion = Motion::new(self.parameters.limits.sensor).beyond_by(self.margin).with_film_of(&self.motion);
        self.last = None;
        self.disturbance_n = 0.0;
        false
    }

    fn inputs(&mut self) -> Inputs {
        let monitor_v = self.source.monitor_v(&self.reference);
        let before_m = self.last.map_or(0.0, |last| last.displacement_m);
        let displacement_m = match self.source.displacement_m(before_m) {
            shown if self.source.mood == Mood::FrozenSensor || shown.abs() > 1e-4 => shown,
            noise if self.is_assumed => noise,
            noise => self.film.position() + noise,
        };
        let silent = |source: &mut Source, value| if source.faulty() && source.one_in(3) { None } else { Some(value) };
        Inputs {
            interlock_closed: !self.source.faulty(),
            monitor_adc_v: silent(&mut self.source, monitor_v / 1000.0),
            sensor_adc_v: silent(&mut self.source, (displacement_m - REST_M) / M_PER_V),
        }
    }

    fn ask(&mut self, counts: &mut Counts) {
        counts.requests += 1;
        let before = self.reference.state;
        let refused = match self.source.below(40) {
            0..=4 => {
                let expected = self.reference.arm();
                self.reference_is_set &= expected.is_err();
                same(self.device.arm(), expected, &self.reference)
            }
            5..=9 => {
                let mode = [Mode::Voltage, Mode::Feedforward, Mode::Tracking][self.source.below(3) as usize];
                let expected = self.reference.start();
                let refused = same(self.device.start(mode), expected, &self.reference);
                if expected.is_ok() {
                    self.reference_is_set = false;
                    self.motion.begin_run();
                    if self.is_assumed && self.motion.is_shown() {
                        (self.film, self.is_assumed) = (self.law.state(), false);
                    }
                    self.mode = mode;
                    if mode == Mode::Feedforward {
                        // The model as it was fitted.
                        self.disturbance_n = 0.0;
                    }
                }
                refused
            }
            10 if self.source.one_in(8) => same(self.device.stop(), self.reference.stop(), &self.reference),
            11 if self.source.one_in(8) => same(self.device.disarm(), self.reference.disarm(), &self.reference),
            12..=15 => {
                let expected = self.reference.acknowledge();
                if expected.is_ok() {
                    // What was learned is forgotten.
                    self.disturbance_n = 0.0;
                    self.motion.reset();
                }
                same(self.device.acknowledge(), expected, &self.reference)
            }
            16 if self.source.one_in(40) => {
                self.device.trip(Cause::Overrun);
                if self.reference.state.is_live() {
                    self.reference.trip(Cause::Overrun);
                }
                false
            }
            17 if self.source.one_in(40) => self.install(),
            18..=21 => self.set_voltage(),
            22..=25 => self.set_reference(),
            _ if self.source.mood == Mood::SilentHost => false,
            _ => {
                self.device.heartbeat();
                self.reference.heartbeat();
                false
            }
        };
        counts.refused += u64::from(refused);
        assert_eq!(self.device.state(), self.reference.state);
        counts.trip(before, self.reference.state);
    }

    /// Expected answer to a value in or outside the limits.
    fn expected(&self, within: bool) -> Result<(), Denial> {
        match self.reference.state {
            _ if !within => Err(Denial::Rejected(Reject::Value)),
            state if !state.is_live() => Err(Denial::Refused(Refusal::State(state))),
            _ => Ok(()),
        }
    }

    fn set_voltage(&mut self) -> bool {
        let most = self.parameters.limits.monitored_v();
        let volts = match self.source.below(12) {
            0 => f32::NAN,
            1 => f32::INFINITY,
            2 => -1.0,
            3 => most * 1.001,
            4 => -0.0,
            5 => most,
            _ => self.source.below(4000) as f32,
        };
        let expected = self.expected(volts >= 0.0 && volts <= most);
        assert_eq!(self.device.set_voltage(volts), expected, "{volts} V");
        expected.is_err()
    }

    fn set_reference(&mut self) -> bool {
        let most = self.parameters.limits.max_displacement_m;
        let metres = match self.source.below(12) {
            0 => f32::NAN,
            1 => f32::NEG_INFINITY,
            2 => -1.001 * most,
            3 => most * 1.001,
            4 => most,
            5 => -most,
            _ => 1e-6 * self.source.below(500) as f32,
        };
        let expected = self.expected(metres.abs() <= most);
        assert_eq!(self.device.set_reference(metres), expected, "{metres} m");
        self.reference_is_set |= expected.is_ok() && self.reference.state == DriverState::Running;
        expected.is_err()
    }

    fn tick(&mut self, counts: &mut Counts) {
        self.source.next_mood();
        let inputs = self.inputs();
        let before = self.reference.state;
        let applied_v = self.reference.command_v as f32;
        let runs = before == DriverState::Running;
        if inputs.monitor_adc_v.is_none() && before.is_live() {
            // What the film is at is unknown: at once, before anything is read.
            self.reference.trip(Cause::Bus);
        }
        let runs_on = self.reference.state == DriverState::Running;
        let must_move = self.mode != Mode::Voltage && self.reference_is_set;
        let model_m = self.film.position();
        self.output = self.device.tick(inputs);
        let telemetry = self.device.telemetry().expect("every tick");
        let readings = Readings {
            interlock_closed: inputs.interlock_closed,
            monitor_v: telemetry.monitor_v,
            displacement_m: telemetry.displacement_m,
            predicted_m: self.last.map_or(0.0, |last| last.predicted_m),
            open_loop_m: self.motion.furthest(model_m),
            is_frozen: self.motion.is_frozen(must_move),
            disturbance_share: if runs_on && self.mode == Mode::Tracking { self.share() } else { 0.0 },
        };
        self.film_moves(applied_v);
        self.reference.follow(readings, self.device.state());
        let after = self.reference.state;
        let is_plausible = self.reference.sensor_faults.is_empty();
        let runs_on = after == DriverState::Running;
        let beside_m = if self.is_assumed && !runs_on { 0.0 } else { model_m };
        let drive_m = self.load_n * self.compliance_m_per_n;
        self.motion.record(telemetry.displacement_m, beside_m, || drive_m, is_plausible, runs_on);
        self.load_n = self.drive.load(applied_v).force_n;
        self.is_as_converted(&inputs, &telemetry);
        self.is_within_the_limits(applied_v, &telemetry);
        let status = self.device.status();
        assert_eq!((status.ticks, telemetry.tick), (self.reference.ticks as u32, status.ticks));
        assert_eq!(status.tripped_at, self.reference.tripped_at as u32);
        self.reference_is_set &= after == DriverState::Running;
        self.reference.command_v = f64::from(telemetry.command_v);
        self.disturbance_n = telemetry.disturbance_n;
        self.last = Some(telemetry);
        counts.ticks += 1;
        counts.running += u64::from(runs && after == DriverState::Running);
        counts.trip(before, after);
    }

    fn film_moves(&mut self, volts: f32) {
        self.law.displacement_under(&mut self.film, self.drive.load(volts));
    }

    fn share(&self) -> f32 {
        let most_v = f64::from(self.parameters.limits.max_voltage_v);
        let most_n = self.parameters.actuator.force_per_square_volt() * most_v * most_v;
        self.disturbance_n * (1.0 / most_n) as f32
    }

    fn is_as_converted(&self, inputs: &Inputs, telemetry: &Telemetry) {
        let same = |found: f32, expected: Option<f32>, tolerance: f32| match expected {
            Some(expected) if expected.is_finite() => {
                assert!((found - expected).abs() <= tolerance, "{found} {expected}")
            }
            _ => assert!(!found.is_finite(), "{found} without a converter"),
        };
        same(telemetry.monitor_v, inputs.monitor_adc_v.map(|volts| 1000.0 * volts), 0.01);
        same(telemetry.displacement_m, inputs.sensor_adc_v.map(|volts| REST_M + M_PER_V * volts), 1e-7);
    }

    /// The amplifier is enabled where it may be, and commanded within every limit.
    fn is_within_the_limits(&self, applied_v: f32, telemetry: &Telemetry) {
        let limits = &self.parameters.limits;
        let command_v = telemetry.command_v;
        let Drive { enable, dac_v, .. } = self.output;
        let state = self.reference.state;
        assert_eq!(enable, state.is_live());
        if state != DriverState::Running {
            assert_eq!((command_v, dac_v), (0.0, 0.0), "{state:?}");
            return;
        }
        let plausible = self.reference.sensor_faults.is_empty();
        let measured_m = if plausible { telemetry.displacement_m } else { 0.0 };
        let furthest_m = measured_m.max(telemetry.predicted_m).max(self.film.position()).max(0.0);
        let thinning = 1.0 + f64::from(furthest_m) / self.parameters.actuator.length_m;
        let by_field = f64::from(limits.max_field_v_per_m * limits.thickness_m) / thinning;
        let most_v = by_field.min(f64::from(limits.max_voltage_v));
        let slew = limits.max_slew_v_per_s / RATE_HZ;
        assert!((0.0..=most_v * 1.000_01).contains(&f64::from(command_v)), "{command_v} V, at most {most_v} V");
        assert!(command_v <= applied_v + slew + 0.01, "{applied_v} V to {command_v} V");
        let is_limited = f64::from(command_v) > 0.9999 * most_v;
        assert!(command_v >= applied_v - slew - 0.01 || is_limited, "{applied_v} V to {command_v} V");
        assert!((f64::from(dac_v) * 1000.0 - f64::from(command_v)).abs() < 0.01, "{dac_v} V at the DAC");
    }
}

/// Checks that an answer is as expected. Whether it was refused.
fn same(done: Result<(), Denial>, expected: Result<(), Refusal>, reference: &Reference) -> bool {
    let refused = |denial| match denial {
        Denial::Refused(refusal) => refusal,
        other => panic!("{other:?} instead of {expected:?}"),
    };
    reference.same(done.map_err(refused), expected);
    expected.is_err()
}

#[test]
fn the_device_is_the_documented_machine() {
    let ticks = cases(100_000, 2_000_000);
    let mut counts = Counts::default();
    for (seed, on_sensor_fault) in [(3, OnSensorFault::Trip), (4, OnSensorFault::OpenLoop)] {
        let mut bench = Bench::new(on_sensor_fault, seed);
        bench.without_parameters();
        assert!(!bench.install());
        for _ in 0..ticks / 2 {
            while bench.source.one_in(3) {
                bench.ask(&mut counts);
            }
            bench.tick(&mut counts);
        }
    }
    println!("commands, device: {counts:?}");
    assert!(counts.causes.len() >= 9 && counts.running > ticks / 10, "{:?}", counts.causes);
}
