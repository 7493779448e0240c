//! No bench: QEMU has no converters and its pins read 0. What a board sees that nothing is connected to.

use dea_driver::wire::{Inspection, Part};
use dea_driver::{AmplifierError, Drive, Inputs};

/// There is no bus either.
pub type AdcBus = ();

/// Nothing.
pub struct Bench;

impl Bench {
    pub const fn new() -> Self {
        Self
    }

    /// An open interlock, and converters that do not answer.
    pub fn sample(&mut self) -> Inputs {
        Inputs { interlock_closed: false, monitor_adc_v: None, sensor_adc_v: None }
    }

    /// The same, in full.
    pub fn inspection(&self) -> Inspection {
        let (dac, monitor, sensor) = (Part::Bus, Part::Bus, Part::Bus);
        let (monitor_adc_v, sensor_adc_v) = (f32::NAN, f32::NAN);
        Inspection { interlock_closed: false, enable_high: false, dac, monitor, sensor, monitor_adc_v, sensor_adc_v }
    }

    /// There is nothing that could be enabled.
    pub fn apply(&mut self, drive: Drive) -> Result<(), AmplifierError> {
        if drive.enable { Err(AmplifierError::Bus) } else { Ok(()) }
    }
}
