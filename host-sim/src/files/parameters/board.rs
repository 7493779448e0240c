//! What a board needs to know besides actuator and model: its converters, and what film and bench allow.

use dea_driver::chips::{Calibration, CommandRange};
use dea_driver::{
    BLOB_LEN, BlobError, Control, Limits, MonitorLimits, OnSensorFault, Parameters as BoardParameters,
    PlausibilityLimits,
};
use heapless::String;
use serde::{Deserialize, Serialize};
use springpot::{Actuator, Law, Options};

use super::Parameters;
use crate::error::{Error, Result};

/// The `[board]` table of a parameter file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Board {
    /// The board a blob is for.
    pub id: u16,
    /// Range of the amplifier's command, at the DAC.
    pub command_range: CommandRange,
    /// Command (V) → high voltage (V).
    pub amplifier: Calibration,
    /// Monitor (V) → high voltage (V).
    pub monitor: Calibration,
    /// Displacement sensor (V) → displacement (m).
    pub sensor: Calibration,
    /// What film and bench allow.
    pub limits: Limits,
    /// How references are followed and the film is observed.
    #[serde(default = "Board::control")]
    pub control: Control,
}

impl Board {
    /// The board of the firmware in this repository.
    pub const STM32F405: u16 = 0x0405;

    /// A bench like the paper's around `actuator`: 6 kV from an amplifier and a monitor of 1000:1 on 0…10 V, a sensor of
    /// 1 mm/V, and limits on the safe side of them.
    pub fn bench(actuator: &Actuator) -> Self {
        let thickness_m = actuator.thickness_m as f32;
        Self {
            id: Self::STM32F405,
            command_range: CommandRange::TenVolts,
            amplifier: Calibration::linear(1000.0),
            monitor: Calibration::linear(1000.0),
            // 1 V at rest: an unplugged one reads −1 mm, which is out of its range.
            sensor: Calibration { offset: -1e-3, gain: 1e-3, quadratic: 0.0 },
            limits: Limits {
                max_voltage_v: 6000.0,
                max_field_v_per_m: 4.2e7,
                thickness_m,
                max_slew_v_per_s: 50e3,
                max_displacement_m: 8e-3,
                monitor: MonitorLimits { slew_v_per_s: 100e3, band_v: 60.0, band_share: 0.03, settle_s: 0.02 },
                sensor: PlausibilityLimits { low: -0.5e-3, high: 9e-3, jump: 0.5e-3, stuck_ticks: 1000 },
                on_sensor_fault: OnSensorFault::Trip,
                heartbeat_s: 0.5,
            },
            control: Self::control(),
        }
    }

    fn control() -> Control {
        Control::BENCH
    }

    /// The table as TOML, numbers as short as they were written.
    pub(super) fn to_toml(&self) -> toml::Table {
        let mut table = toml::Table::try_from(self).unwrap_or_default();
        table.iter_mut().for_each(|(_, value)| shorten(value));
        table
    }
}

/// Single-precision numbers as they print, instead of with the digits of their double.
fn shorten(value: &mut toml::Value) {
    match value {
        toml::Value::Float(number) => *number = (*number as f32).to_string().parse().unwrap_or(*number),
        toml::Value::Table(table) => table.iter_mut().for_each(|(_, value)| shorten(value)),
        _ => {}
    }
}

impl Parameters {
    /// The blob of these parameters for a controller that ticks at `rate_hz`, on `board`.
    ///
    /// # Errors
    ///
    /// [`Error::Law`] for a model that has no law at this rate, [`Error::Computation`] for what a controller would refuse.
    pub fn to_blob(&self, board: &Board, rate_hz: f64) -> Result<Vec<u8>> {
        let rate_hz = rate_hz as f32;
        let law: Law<f32> = Law::compressed(&self.model, Options::at_step(1.0 / f64::from(rate_hz)))?;
        let parameters = BoardParameters {
            name: shortened(&self.name),
            rate_hz,
            law: law.coefficients(),
            actuator: self.actuator,
            sensor_offset_m: self.sensor_offset_m as f32,
            command_range: board.command_range,
            amplifier: board.amplifier,
            monitor: board.monitor,
            sensor: board.sensor,
            limits: board.limits,
            control: board.control,
        };
        let mut bytes = vec![0; BLOB_LEN];
        let refused = |error: BlobError| Error::Computation(error.to_string());
        let length = parameters.encode(board.id, &mut bytes).map_err(refused)?;
        bytes.truncate(length);
        Ok(bytes)
    }
}

/// As much of a name as a blob holds.
fn shortened(name: &str) -> String<32> {
    let mut short = String::new();
    for letter in name.chars() {
        if short.push(letter).is_err() {
            break;
        }
    }
    short
}
