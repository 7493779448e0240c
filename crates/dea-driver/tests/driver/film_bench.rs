//! A controller around a simulated film.

use dea_driver::chips::{AdcCode, AdcRange, DacCode};
use dea_driver::{AdaptationOrder, Blob, Controller, DriverState, Inputs, Mode, Outputs, Parameters};
use springpot::{Actuator, Law, LawOptions, Preset, VoltageDrive};

use crate::bench::board_parameters;

/// A bench around a controller: an amplifier of 1000:1, a sensor of 1 mm/V at 1 V, and the model itself as film, or one
/// with less force.
pub struct FilmBench {
    pub controller: Controller,
    pub parameters: Parameters,
    pub film: springpot::LawState<f64>,
    pub law: Law<f64>,
    pub drive: VoltageDrive<f64>,
    pub high_voltage_v: f64,
    pub displacement_m: f64,
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

    pub fn with(parameters: Parameters) -> Self {
        let model = Preset::TABLE3_N2.model().expect("valid");
        Self::around(Law::compressed(&model, LawOptions::at_step(1e-3)).expect("valid"), parameters)
    }

    /// A bench with a film of this `law`.
    pub fn around(law: Law<f64>, parameters: Parameters) -> Self {
        let drive = VoltageDrive::new(&Actuator::KARNER_2022, 6500.0, law.stiffness()).expect("valid");
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
            noise: 1,
            force_scale: 1.0,
            amplifier_s: [0.0; 2],
        }
    }

    pub fn inputs(&mut self) -> Inputs {
        self.noise = self.noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = f64::from(self.noise >> 16) / 65_536.0 * 5e-6;
        let adc_v = |volts: f64| Some(adc_v((volts / 10.24 * 65_536.0) as u16));
        Inputs {
            interlock_closed: true,
            monitor_adc_v: adc_v(self.high_voltage_v / 1000.0),
            sensor_adc_v: adc_v(1.0 + (self.displacement_m + noise) / 1e-3),
        }
    }

    pub fn tick(&mut self, spoil: impl FnOnce(&mut Inputs)) -> Outputs {
        let mut inputs = self.inputs();
        spoil(&mut inputs);
        self.follow(inputs)
    }

    /// Ticks without a fault, with a host that is alive.
    pub fn run(&mut self, ticks: u32) {
        for _ in 0..ticks {
            self.controller.heartbeat();
            self.tick(|_| ());
        }
    }

    /// Compiled once, not for each way to spoil what is measured.
    #[inline(never)]
    fn follow(&mut self, inputs: Inputs) -> Outputs {
        let outputs = self.controller.tick(inputs);
        let volts = f64::from(self.code(&outputs).volts(self.parameters.command_range)) * 1000.0;
        self.high_voltage_v = self.amplified(if outputs.enable { volts } else { 0.0 });
        let load = self.drive.load(self.high_voltage_v * self.force_scale.sqrt());
        self.displacement_m = self.law.displacement_under(&mut self.film, load);
        outputs
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
    pub fn ask<R>(&mut self, request: impl FnOnce(&mut Controller) -> R) -> R {
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

    pub fn start(&mut self, mode: Mode) {
        self.tick(|_| ());
        self.ask(Controller::arm).expect("healthy");
        self.start_armed(mode);
    }

    pub fn start_armed(&mut self, mode: Mode) {
        self.ask(|controller| controller.start(mode)).expect("armed");
    }
}

/// Volts of a code.
pub fn adc_v(code: u16) -> f32 {
    AdcCode(code).volts(AdcRange::UpTo10V24)
}
