//! A controller on converters of one's own: a 12-bit DAC of 0 to 2.5 V, a 12-bit ADC of 0 to 3.3 V, ticked 500 times a second
//! by a loop of one's own. The film is simulated, and shows a tenth less force than its model.

use std::error::Error;

use dea_driver::chips::{Calibration, Ceilings, Converters, Resolution};
use dea_driver::{
    Blob, Control, Controller, DriverState, Inputs, Limits, Mode, Outputs, Parameters, PlausibilityLimits,
};
use springpot::{Actuator, Law, LawOptions, Preset, VoltageDrive};

/// Ticks per second.
const RATE_HZ: u16 = 500;

/// Full scale of both converters, V.
const DAC_V: f32 = 2.5;
const ADC_V: f32 = 3.3;

/// Their ranges, for the checks of the parameters, and the ceilings of the bench. An ADC ends one count below its full scale.
const CONVERTERS: Converters = Converters {
    command_v: Some(DAC_V),
    monitor_v: ADC_V * (4095.0 / 4096.0),
    sensor_v: ADC_V * (4095.0 / 4096.0),
    current_v: None,
    resolution: Resolution::bits(12),
    ceilings: Ceilings { voltage_v: 6.25e3, field_v_per_m: 6e7, stroke_m: 8e-3 },
};

/// The nearest of 4096 codes: saturates, and NaN is 0 V.
fn dac_code(volts: f32) -> u16 {
    ((volts * (4096.0 / DAC_V) + 0.5) as u16).min(4095)
}

fn adc_volts(code: u16) -> f32 {
    f32::from(code) * (ADC_V / 4096.0)
}

/// The parameters of this bench: an amplifier of 2500 V per volt, a monitor of 2000 V per volt, a sensor of 3 mm per volt that
/// reads 0.5 V at rest and 0 V when it is unplugged.
fn parameters(law: &Law<f32>, actuator: Actuator) -> Parameters {
    let limits = Limits::bench(actuator.thickness_m as f32);
    Parameters {
        amplifier: Calibration::linear(2500.0),
        monitor: Calibration::linear(2000.0),
        sensor: Calibration::Parabola { offset: -1.5e-3, gain: 3e-3, quadratic: 0.0 },
        limits: Limits {
            max_displacement_m: 6e-3,
            sensor: PlausibilityLimits { low: -1e-3, high: 8e-3, stuck_band: 3e-6, ..limits.sensor },
            ..limits
        },
        control: Control { bandwidth_hz: 0.5, ..Control::BENCH },
        ..Parameters::bench(law, actuator)
    }
}

/// Converters, interlock and enable output of the board; here with a simulated film behind them.
struct Board {
    /// The enable output.
    enable: bool,
    /// The DAC's register.
    dac: u16,
    film: Film,
}

impl Board {
    /// Samples the inputs at the beginning of a tick. A converter that does not answer is `None`.
    fn sample(&mut self) -> Inputs {
        Inputs {
            interlock_closed: true,
            monitor_adc_v: Some(adc_volts(self.film.monitor_code())),
            sensor_adc_v: Some(adc_volts(self.film.sensor_code())),
        }
    }

    /// Writes the outputs at its end. The enable output comes first where it goes low, and last where it goes high.
    fn put_out(&mut self, outputs: &Outputs) {
        if outputs.enable {
            self.dac = dac_code(outputs.dac_v);
            self.enable = true;
        } else {
            self.enable = false;
            self.dac = 0;
        }
    }
}

/// One tick: at a fixed rate, above everything but the link's bytes.
fn tick(controller: &mut Controller, board: &mut Board) -> Outputs {
    let inputs = board.sample();
    let outputs = controller.tick(inputs);
    board.put_out(&outputs);
    outputs
}

/// Moves the simulated film under the present voltage until the next tick.
fn wait(board: &mut Board) {
    board.film.step(if board.enable { board.dac } else { 0 });
}

pub fn main() -> Result<(), Box<dyn Error>> {
    let actuator = Actuator::KARNER_2022;
    let model = Preset::TABLE3_N2.model()?;
    let step_s = 1.0 / f64::from(RATE_HZ);
    let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(step_s))?;
    let blob = Blob::with_converters(parameters(&law, actuator), &CONVERTERS)?;
    let mut controller = Controller::new(blob);

    let film: Law<f64> = Law::compressed(&model, LawOptions::at_step(step_s))?;
    let mut board = Board { enable: false, dac: 0, film: Film::new(film, &actuator)? };

    // Nothing can be armed before the first tick has seen the sensors.
    tick(&mut controller, &mut board);
    wait(&mut board);
    controller.arm()?;
    controller.start(Mode::Tracking)?;
    let mut furthest_m = 0.0f64;
    for k in 0..30 * u32::from(RATE_HZ) {
        // A reference every 20 ms, up to 0.8 mm within two seconds. To set one is the heartbeat.
        if k % 10 == 0 {
            let time_s = k as f32 / f32::from(RATE_HZ);
            controller.set_reference(0.8e-3 * (time_s / 2.0).min(1.0))?;
            controller.heartbeat();
        }
        tick(&mut controller, &mut board);
        wait(&mut board);
        if k > 10 * u32::from(RATE_HZ) {
            furthest_m = furthest_m.max((board.film.displacement_m - 0.8e-3).abs());
        }
    }
    let state = controller.supervisor().state();
    println!("{state:?}; from 10 s to 30 s no further than {:.1} µm from 0.8 mm", 1e6 * furthest_m);
    assert_eq!(state, DriverState::Running);
    assert!(furthest_m < 10e-6);
    Ok(())
}

/// A film with amplifier, monitor and sensor, simulated.
struct Film {
    law: Law<f64>,
    state: springpot::LawState<f64>,
    drive: VoltageDrive<f64>,
    voltage_v: f64,
    displacement_m: f64,
    noise: u16,
}

impl Film {
    fn new(law: Law<f64>, actuator: &Actuator) -> Result<Self, springpot::ActuatorError> {
        let drive = VoltageDrive::new(actuator, 6500.0, law.stiffness())?;
        Ok(Self { state: law.state(), law, drive, voltage_v: 0.0, displacement_m: 0.0, noise: 0 })
    }

    fn step(&mut self, dac: u16) {
        self.voltage_v = 2500.0 * f64::from(dac) * f64::from(DAC_V) / 4096.0;
        // A tenth less force, which goes with the voltage squared.
        let load = self.drive.load(0.9f64.sqrt() * self.voltage_v);
        self.displacement_m = self.law.displacement_under(&mut self.state, load);
    }

    fn monitor_code(&self) -> u16 {
        (self.voltage_v / 2000.0 * 4096.0 / f64::from(ADC_V)) as u16
    }

    fn sensor_code(&mut self) -> u16 {
        self.noise = (self.noise + 1) % 3;
        let volts = 0.5 + self.displacement_m / 3e-3;
        (volts * 4096.0 / f64::from(ADC_V)) as u16 + self.noise - 1
    }
}
