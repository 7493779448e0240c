//! A controller around a simulated film.

use std::ops::Range;

use dea_driver::chips::{AdcCode, AdcRange, DacCode};
use dea_driver::{
    AdaptationOrder, Blob, Cause, Controller, ControllerMemory, DriverState, Inputs, Mode, OnSensorFault, Outputs,
    Parameters,
};
use springpot::{Actuator, Compressed, Law, VoltageDrive};

use crate::bench::{board_parameters, changed_parameters, law};
use crate::circuit::{amplified, converted};

/// A bench around a controller: an amplifier of 1000:1, a sensor of 1 mm/V at 1 V, and the model itself as film, or one
/// with less force.
pub struct FilmBench<M: ControllerMemory = Compressed<f32>> {
    pub controller: Controller<M>,
    pub parameters: Parameters<M>,
    pub film: springpot::LawState<f64>,
    pub law: Law<f64>,
    pub drive: VoltageDrive<f64>,
    pub high_voltage_v: f64,
    pub displacement_m: f64,
    /// Farthest displacement so far, m.
    pub furthest_m: f64,
    /// Whether the sensor is unplugged: its converter is at the end of its range.
    pub is_unplugged: bool,
    pub noise: u32,
    /// Electrostatic force in units of the model's.
    pub force_scale: f64,
    /// Time constants of the amplifier, s: of its lag, and of the bleeder that lets it fall.
    pub amplifier_s: [f64; 2],
}

impl FilmBench {
    pub fn new() -> Self {
        Self::with(board_parameters())
    }

    /// A bench whose parameters have a change.
    pub fn changed(change: impl FnOnce(&mut Parameters)) -> Self {
        Self::with(changed_parameters(change))
    }
}

impl<M: ControllerMemory> FilmBench<M> {
    pub fn with(parameters: Parameters<M>) -> Self {
        Self::around(law(), parameters)
    }

    pub fn around(law: Law<f64>, parameters: Parameters<M>) -> Self {
        let drive = VoltageDrive::new(&Actuator::KARNER_2022, 6500.0, law.min_stiffness()).expect("valid");
        let controller = Controller::new(Blob::new(parameters.clone()).expect("valid"));
        let film = law.state();
        Self {
            controller,
            parameters,
            film,
            law,
            drive,
            high_voltage_v: 0.0,
            displacement_m: 0.0,
            furthest_m: 0.0,
            is_unplugged: false,
            noise: 1,
            force_scale: 1.0,
            amplifier_s: [0.0; 2],
        }
    }

    pub fn inputs(&mut self) -> Inputs {
        self.noise = self.noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = f64::from(self.noise >> 16) / 65_536.0 * 5e-6;
        let code = |volts: f64| (volts / 10.24 * 65_536.0) as u16;
        let sensor = if self.is_unplugged { u16::MAX } else { code(1.0 + (self.displacement_m + noise) / 1e-3) };
        Inputs {
            interlock_closed: true,
            monitor_adc_v: Some(adc_v(code(self.high_voltage_v / 1000.0))),
            sensor_adc_v: Some(adc_v(sensor)),
        }
    }

    pub fn tick(&mut self, spoil: impl FnOnce(&mut Inputs)) -> Outputs {
        let mut inputs = self.inputs();
        spoil(&mut inputs);
        self.follow(inputs)
    }

    /// A tick with a host that is alive.
    pub fn live_tick(&mut self, spoil: impl FnOnce(&mut Inputs)) -> Outputs {
        self.controller.heartbeat();
        self.tick(spoil)
    }

    /// Ticks without a fault, with a host that is alive.
    pub fn run(&mut self, ticks: u32) {
        for _ in 0..ticks {
            self.live_tick(|_| ());
        }
    }

    /// Sets the reference (m, by the time in s) in each of `ticks`; returns the largest error of the `last` of them, m. NaN: it does not run any more.
    pub fn track(&mut self, ticks: Range<u32>, last: u32, reference_m: impl Fn(f64) -> f64) -> f64 {
        let (from, mut largest_m) = (ticks.end - last, 0.0f64);
        for tick in ticks {
            let reference_m = reference_m(f64::from(tick) / 1000.0);
            self.set_reference(reference_m as f32);
            self.tick(|_| ());
            if self.state() != DriverState::Running {
                return f64::NAN;
            }
            if tick >= from {
                largest_m = largest_m.max((self.displacement_m - reference_m).abs());
            }
        }
        largest_m
    }

    /// Compiled once, not for each way to spoil what is measured.
    #[inline(never)]
    fn follow(&mut self, inputs: Inputs) -> Outputs {
        let outputs = self.controller.tick(inputs);
        let telemetry = &outputs.telemetry;
        assert!(telemetry.command_v <= self.parameters.limits.max_voltage_v && telemetry.predicted_m.is_finite());
        self.stretch(self.amplified(amplified(&outputs, self.parameters.command_range)));
        outputs
    }

    /// A tick of the film at so many volts.
    pub fn stretch(&mut self, volts: f64) {
        self.high_voltage_v = volts;
        let load = self.drive.load(volts * self.force_scale.sqrt());
        self.displacement_m = self.law.displacement_under(&mut self.film, load);
        self.furthest_m = self.furthest_m.max(self.displacement_m);
    }

    /// The high voltage a millisecond later, in parts of 10 µs.
    fn amplified(&self, command_v: f64) -> f64 {
        let [lag_s, bleeder_s] = self.amplifier_s;
        if lag_s == 0.0 {
            return command_v;
        }
        (0..100).fold(self.high_voltage_v, |volts, _| {
            let rate = (command_v - volts) / lag_s;
            let slowest = if bleeder_s > 0.0 { -volts / bleeder_s } else { f64::NEG_INFINITY };
            volts + 1e-5 * rate.max(slowest)
        })
    }

    pub fn code(&self, outputs: &Outputs) -> DacCode {
        DacCode::from_volts(outputs.dac_v, self.parameters.command_range)
    }

    /// A request of a host.
    pub fn ask<R>(&mut self, request: impl FnOnce(&mut Controller<M>) -> R) -> R {
        self.controller.heartbeat();
        request(&mut self.controller)
    }

    pub fn state(&self) -> DriverState {
        self.controller.supervisor().state()
    }

    pub fn order_adaptation(&mut self, order: AdaptationOrder) {
        self.ask(|controller| controller.order_adaptation(order)).expect("within bounds");
    }

    pub fn set_voltage(&mut self, volts: f32) {
        self.ask(|controller| controller.set_voltage(volts)).expect("within the limits");
    }

    pub fn set_reference(&mut self, metres: f32) {
        self.ask(|controller| controller.set_reference(metres)).expect("within the limits");
    }

    /// A trip, and the time until the film is at 0 V.
    pub fn trip_and_acknowledge(&mut self) {
        self.controller.trip(Cause::Interlock);
        self.run(1000);
        self.ask(Controller::acknowledge).expect("tripped");
    }

    pub fn start(&mut self, mode: Mode) {
        self.tick(|_| ());
        self.ask(Controller::arm).expect("healthy");
        self.start_armed(mode);
    }

    /// The same in a run of this voltage, V.
    pub fn at_voltage(mut self, volts: f32) -> Self {
        self.start(Mode::Voltage);
        self.set_voltage(volts);
        self
    }

    /// The same in a run of this reference, m.
    pub fn at_reference(mut self, mode: Mode, metres: f32) -> Self {
        self.start(mode);
        self.set_reference(metres);
        self
    }

    pub fn start_armed(&mut self, mode: Mode) {
        self.ask(|controller| controller.start(mode)).expect("armed");
    }
}

/// Lets a run go on without its sensor.
pub fn rides_through(parameters: &mut Parameters) {
    parameters.limits.on_sensor_fault = OnSensorFault::OpenLoop;
}

/// Volts of a code.
pub fn adc_v(code: u16) -> f32 {
    AdcCode(code).volts(AdcRange::UpTo10V24)
}

/// Volts of a sensor of 1 mm/V at 1 V that shows `shown_m` (m), and so many codes more.
pub fn sensor_adc_v(shown_m: f64, codes: f64) -> f32 {
    converted(1.0 + shown_m / 1e-3, codes)
}
