//! No bench: QEMU has no converters and its pins read 0. What a board sees that nothing is connected to.

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

    /// There is nothing that could be enabled.
    pub fn apply(&mut self, drive: Drive) -> Result<(), AmplifierError> {
        if drive.enable { Err(AmplifierError::Bus) } else { Ok(()) }
    }
}
