//! No bench: QEMU has no converters and its pins read 0, as on a board with nothing connected.

use dea_driver::wire::{InjectedFault, Inspection, Part};
use dea_driver::{AmplifierError, Controller, Drive, Inputs};

use crate::board::Pins;
use crate::family::Rcc;

/// There is no bus.
pub type AdcBus = ();

/// Refuses to inject a fault: nothing here can fail.
pub fn inject_fault(_: InjectedFault) -> bool {
    false
}

/// A bench without parts.
pub struct Bench;

impl Bench {
    pub fn new(_: Pins, _: &'static mut Option<AdcBus>, _: &mut Rcc) -> Self {
        Self
    }

    /// There is nothing to prepare.
    pub fn prepare(&mut self, _: Option<&Controller>) {}

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
