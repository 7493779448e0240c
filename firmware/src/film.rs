//! The film on the virtual bench: the one that the parameters describe, stepped by the law of Eq. 11, behind their amplifier and in
//! front of their monitor and sensor.

use dea_driver::chips::{Calibration, DacCode};
use dea_driver::{Controller, Drive};
use springpot::{AmplifierModel, Law, LawState, VoltageDrive};

/// Factor of the voltage on the film, so that it pulls 3 % harder than its model. Feedforward is off by that, tracking corrects it.
const STRONGER: f32 = 1.014_889;
/// Stored displacements, for a sensor whose samples are late: parameters allow a delay of 63 ticks.
const KEPT: usize = 64;

/// A film at rest once there are parameters for one.
pub struct Film {
    /// Checksum of the parameters that it was made from.
    checksum: Option<u32>,
    law: Law<f32>,
    drive: VoltageDrive<f32>,
    state: LawState<f32>,
    amplifier: Calibration,
    lag: Option<AmplifierModel<f32>>,
    monitor: Calibration,
    sensor: Calibration,
    sensor_offset_m: f32,
    /// Between the film's electrodes, V.
    voltage_v: f32,
    /// The last displacements, m, and the index of the newest.
    past: [f32; KEPT],
    newest: usize,
    /// Ticks by which a sample of the sensor is late.
    late: usize,
    #[cfg(feature = "self-sensing")]
    circuit: Option<Circuit>,
}

/// Film and cable as a capacitor of the relation that the parameters have, and the monitor of its current.
#[cfg(feature = "self-sensing")]
struct Circuit {
    rest_f: f32,
    stroke_m: [f32; 3],
    monitor: Calibration,
    rate_hz: f32,
    charge_c: f32,
    current_a: f32,
}

#[cfg(feature = "self-sensing")]
impl Circuit {
    fn new(sensor: &dea_driver::SelfSensor, rate_hz: f32) -> Self {
        let relation = sensor.relation();
        let stroke_m = relation.stroke_m.map(|a| a as f32);
        let monitor = sensor.current().clone();
        Self { rest_f: relation.rest_f as f32, stroke_m, monitor, rate_hz, charge_c: 0.0, current_a: 0.0 }
    }

    /// A tick that ends at `displacement_m` (m) and `voltage_v` (V).
    fn advance(&mut self, displacement_m: f32, voltage_v: f32) {
        let [a, b, c] = self.stroke_m;
        // Newton's method from the straight relation.
        let change = (0..3).fold(displacement_m / a, |q, _| {
            let (shown, slope) = (q * (a + q * (b + q * c)), a + q * (2.0 * b + 3.0 * c * q));
            q + (displacement_m - shown) / slope
        });
        let charge_c = self.rest_f * (1.0 + change) * voltage_v;
        self.current_a = (charge_c - self.charge_c) * self.rate_hz;
        self.charge_c = charge_c;
    }
}

impl Film {
    /// The film that `controller` is for; none for parameters that no film has.
    pub fn from_controller(controller: &Controller) -> Option<Self> {
        let parameters = controller.parameters();
        let step_s = 1.0 / f64::from(parameters.rate_hz);
        let law = Law::from_coefficients(&parameters.law, step_s, parameters.actuator.mass_kg).ok()?;
        let largest_v = STRONGER * parameters.amplifier.apply(parameters.command_range.full_scale_v());
        let drive = VoltageDrive::new(&parameters.actuator, f64::from(largest_v), law.stiffness()).ok()?;
        Some(Self {
            checksum: controller.checksum(),
            drive,
            state: law.state(),
            law,
            amplifier: parameters.amplifier.clone(),
            lag: AmplifierModel::lagging(parameters.amplifier_lag, step_s).ok()?,
            monitor: parameters.monitor.clone(),
            sensor: parameters.sensor.clone(),
            sensor_offset_m: parameters.sensor_offset_m,
            voltage_v: 0.0,
            past: [0.0; KEPT],
            newest: 0,
            #[cfg(feature = "self-sensing")]
            circuit: parameters.self_sensing.as_ref().map(|sensor| Circuit::new(sensor, parameters.rate_hz)),
            late: ((parameters.control.delay_s * parameters.rate_hz + 0.5) as usize).min(KEPT - 1),
        })
    }

    /// Whether it was made of the parameters that `controller` has now.
    pub fn is_of(&self, controller: &Controller) -> bool {
        self.checksum == controller.checksum()
    }

    /// A tick under the amplifier's output for `drive`.
    pub fn advance(&mut self, drive: Drive) {
        let code = DacCode::from_volts(drive.dac_v, drive.range);
        let given_v = self.amplifier.apply(code.volts(drive.range));
        let command_v = if drive.enable && given_v > 0.0 { given_v } else { 0.0 };
        self.voltage_v = self.lag.map_or(command_v, |lag| lag.advance(self.voltage_v, command_v));
        let load = self.drive.load(STRONGER * self.voltage_v);
        self.newest = (self.newest + 1) % KEPT;
        self.past[self.newest] = self.law.displacement_under(&mut self.state, load);
        #[cfg(feature = "self-sensing")]
        if let Some(circuit) = &mut self.circuit {
            circuit.advance(self.past[self.newest], self.voltage_v);
        }
    }

    /// The output of its voltage monitor, V.
    pub fn monitor_v(&self) -> f32 {
        self.monitor.invert(self.voltage_v)
    }

    /// The output of its current monitor, V.
    #[cfg(feature = "self-sensing")]
    pub fn current_v(&self) -> f32 {
        self.circuit.as_ref().map_or(0.0, |circuit| circuit.monitor.invert(circuit.current_a))
    }

    /// The output of its displacement sensor, V.
    pub fn sensor_v(&self) -> f32 {
        let displacement_m = self.past[(self.newest + KEPT - self.late) % KEPT];
        self.sensor.invert(displacement_m + self.sensor_offset_m)
    }
}
