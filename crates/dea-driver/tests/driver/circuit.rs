//! A film in its circuit, and the monitor of its current.

use dea_driver::chips::{AdcCode, AdcRange, Calibration, CommandRange, Converters, DacCode};
use dea_driver::wire::boards;
use dea_driver::{Control, OnSensorFault, Outputs, Parameters, SelfSensor};
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use springpot::{Actuator, CapacitanceRelation, SelfSensingOptions};

use crate::bench::board_parameters;

/// A board with a monitor of the current, whose sensors are those of [`board_parameters`].
pub const CONVERTERS: Converters = Converters::of_board(boards::STM32F405);

/// A tick, s.
const STEP_S: f64 = 1e-3;
/// Film at rest and cable, F.
const REST_F: f64 = 600e-12;
const CABLE_F: f64 = 100e-12;
/// The monitor's current per volt, A, and its output at 0 A, V.
const PER_VOLT_A: f64 = 50e-6;
const MIDDLE_V: f64 = 5.0;

/// Reading of an ADC of 0 to 10.24 V: the code that is nearest to `volts` and so many `codes` more, V.
pub fn converted(volts: f64, codes: f64) -> f32 {
    let code = (volts / 10.24 * 65_536.0 + codes).round().clamp(0.0, 65_535.0);
    AdcCode(code as u16).volts(AdcRange::UpTo10V24)
}

/// The high voltage of an amplifier of 1000:1 without any lag, V.
pub fn amplified(outputs: &Outputs, range: CommandRange) -> f64 {
    let command_v = f64::from(DacCode::from_volts(outputs.dac_v, range).volts(range));
    if outputs.enable { 1000.0 * command_v } else { 0.0 }
}

/// A film behind its electrodes, with a leak, beside a cable, on an amplifier that steps at the begin of a tick.
#[derive(Clone)]
pub struct Circuit {
    pub electrodes_ohm: f64,
    pub leak_ohm: f64,
    /// Reading of the monitor: of the current it is so many times as much, or this (A).
    pub gain: f64,
    pub stuck_a: Option<f64>,
    amplifier_v: f64,
    film_v: f64,
    random: Pcg64,
}

impl Circuit {
    pub fn new(seed: u64) -> Self {
        Self {
            electrodes_ohm: 50e3,
            leak_ohm: 5e9,
            gain: 1.0,
            stuck_a: None,
            amplifier_v: 0.0,
            film_v: 0.0,
            random: Pcg64::seed_from_u64(seed),
        }
    }

    /// The output of the monitor at its ADC, V, after a tick at `volts` (V) of a film at `displacement_m` (m).
    pub fn tick(&mut self, volts: f64, displacement_m: f64) -> f32 {
        let film_f = REST_F * (1.0 + displacement_m / Actuator::KARNER_2022.length_m).powi(2);
        // Towards the divider of electrodes and leak.
        let share = self.leak_ohm / (self.leak_ohm + self.electrodes_ohm);
        let time_s = share * self.electrodes_ohm * film_f;
        let left = (-STEP_S / time_s).exp();
        let off_v = self.film_v - share * volts;
        let mean_v = share * volts + off_v * time_s / STEP_S * (1.0 - left);
        self.film_v = share * volts + off_v * left;
        let cable_a = CABLE_F * (volts - self.amplifier_v) / STEP_S;
        self.amplifier_v = volts;
        let noise: f64 = StandardNormal.sample(&mut self.random);
        let shown_a = self.gain * ((volts - mean_v) / self.electrodes_ohm + cable_a) + 1e-6;
        converted(MIDDLE_V + self.stuck_a.unwrap_or(shown_a) / PER_VOLT_A, 2.0 * noise)
    }
}

/// The film's relation by its sizes, beside the cable, up to 4 mm.
pub fn relation() -> CapacitanceRelation {
    let film = CapacitanceRelation::of_geometry(REST_F, Actuator::KARNER_2022.length_m, 2.0, 1.2 * REST_F);
    let (rest_f, growth) = (REST_F + CABLE_F, (REST_F + CABLE_F) / REST_F);
    let [a, b, c] = film.stroke_m;
    CapacitanceRelation {
        rest_f,
        max_f: 1.2 * REST_F + CABLE_F,
        stroke_m: [growth * a, growth.powi(2) * b, growth.powi(3) * c],
        uncertainty_m: 50e-6,
        ..film
    }
}

/// Self-sensing of this film.
pub fn sensor(relation: &CapacitanceRelation) -> SelfSensor {
    let current =
        Calibration::Parabola { offset: (-MIDDLE_V * PER_VOLT_A) as f32, gain: PER_VOLT_A as f32, quadratic: 0.0 };
    // Half of what the monitor shows.
    let options = SelfSensingOptions { max_current_a: 0.12e-3, ..SelfSensingOptions::BENCH };
    SelfSensor::new(relation, options, current).expect("valid")
}

/// Parameters with self-sensing, with or without another sensor.
pub fn sensed_parameters() -> Parameters {
    let mut parameters = board_parameters();
    parameters.limits.max_slew_v_per_s = 100e3;
    parameters.limits.on_sensor_fault = OnSensorFault::OpenLoop;
    parameters.control = Control {
        max_velocity_m_per_s: 0.015,
        sample_interval_s: 0.02,
        delay_s: 0.014,
        lost_after_s: 0.2,
        ..parameters.control
    };
    Parameters { self_sensing: Some(sensor(&relation())), ..parameters }
}
