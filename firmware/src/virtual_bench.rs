//! A virtual bench instead of pins and converters, for QEMU: a closed interlock, an amplifier, and a simulated film. A host can inject
//! faults into it, to see how each of them ends.

use core::mem::replace;
use core::sync::atomic::{AtomicU8, Ordering};

use dea_driver::chips::{AdcCode, AdcRange};
use dea_driver::wire::{InjectedFault, Inspection, Part};
use dea_driver::{AmplifierError, Controller, Drive, Inputs};

use crate::board::Pins;
use crate::family::Rcc;
use crate::film::Film;

/// The fault to inject: its place in [`FAULTS`], from 1; 0 for no fault.
static REQUESTED: AtomicU8 = AtomicU8::new(0);

/// The faults that can be injected. A tick that hangs needs a watchdog, which QEMU does not have.
const FAULTS: [InjectedFault; 6] = [
    InjectedFault::Interlock,
    InjectedFault::Monitor,
    InjectedFault::Sensor,
    InjectedFault::Bus,
    InjectedFault::Overrun,
    InjectedFault::Panic,
];

/// The range of both simulated ADCs.
const ADC: AdcRange = AdcRange::UpTo10V24;
/// Largest output of the current monitor, V.
#[cfg(feature = "self-sensing")]
pub const CURRENT_V: f32 = ADC.max_v();
/// Reading of the sensor before there are parameters, V.
const AT_REST_V: f32 = 1.0;
/// Largest noise of the sensor, codes: a live sensor is never still.
const NOISE: u32 = 8;

/// Injects `fault` into the next tick. False for one that cannot be injected here.
pub fn inject_fault(fault: InjectedFault) -> bool {
    let place = FAULTS.iter().position(|&other| other == fault).map(|place| place as u8 + 1);
    REQUESTED.store(place.unwrap_or(0), Ordering::Relaxed);
    place.is_some()
}

/// There is no bus.
pub type AdcBus = ();

/// The bench. Like the board's converters its monitor is sampled at the end of a frame, and answers in that of the next tick.
pub struct Bench {
    film: Option<Film>,
    /// Reading of the monitor, as its code.
    monitor: u16,
    /// Its reading in the tick before.
    sampled: u16,
    /// The same for the monitor of the current.
    #[cfg(feature = "self-sensing")]
    current: [u16; 2],
    noise: u32,
    stuck: bool,
    disabled: bool,
    found: Inspection,
}

impl Bench {
    pub fn new(_: Pins, _: &'static mut Option<AdcBus>, _: &mut Rcc) -> Self {
        defmt::warn!("virtual board: a simulated film instead of pins and converters, and faults on request");
        let found = Inspection {
            interlock_closed: true,
            enable_high: false,
            dac: Part::Answers,
            monitor: Part::Answers,
            sensor: Part::Answers,
            monitor_adc_v: 0.0,
            sensor_adc_v: AT_REST_V,
        };
        Self {
            film: None,
            monitor: 0,
            sampled: 0,
            #[cfg(feature = "self-sensing")]
            current: [0; 2],
            noise: 1,
            stuck: false,
            disabled: true,
            found,
        }
    }

    /// Mounts the film of the present parameters, if it is another one than before.
    pub fn prepare(&mut self, controller: Option<&Controller>) {
        let Some(controller) = controller else { return };
        if self.film.as_ref().is_none_or(|film| !film.is_of(controller)) {
            self.film = Film::from_controller(controller);
            let name = controller.parameters().name.as_str();
            match self.film {
                Some(_) => defmt::info!("virtual board: a film as {} describe it, at rest", name),
                None => defmt::error!("virtual board: no film has the parameters {}", name),
            }
        }
    }

    pub fn sample(&mut self) -> Inputs {
        self.noise = self.noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = (self.noise >> 16) % (2 * NOISE + 1);
        let sensor = code_of(self.film.as_ref().map_or(AT_REST_V, Film::sensor_v));
        let sensor = sensor.saturating_add(noise as u16).saturating_sub(NOISE as u16);
        let mut inputs = Inputs {
            interlock_closed: true,
            monitor_adc_v: Some(AdcCode(replace(&mut self.sampled, self.monitor)).volts(ADC)),
            sensor_adc_v: Some(AdcCode(sensor).volts(ADC)),
        };
        if self.disabled {
            // A fault ends once the amplifier is off.
            self.stuck = false;
            REQUESTED.store(0, Ordering::Relaxed);
        }
        let requested = REQUESTED.load(Ordering::Relaxed);
        match FAULTS.get(usize::from(requested).wrapping_sub(1)) {
            Some(InjectedFault::Interlock) => inputs.interlock_closed = false,
            Some(InjectedFault::Monitor) => self.stuck = true,
            Some(InjectedFault::Sensor) => inputs.sensor_adc_v = Some(ADC.max_v()),
            Some(InjectedFault::Bus) => inputs.monitor_adc_v = None,
            // Some 18 ms at 168 MHz, and 3 ms where QEMU counts a nanosecond per instruction: longer than a tick, shorter
            // than the watchdog waits.
            Some(InjectedFault::Overrun) => cortex_m::asm::delay(3_000_000),
            Some(InjectedFault::Panic) => panic!("injected fault"),
            _ => {}
        }
        self.found = Inspection {
            interlock_closed: inputs.interlock_closed,
            enable_high: !self.disabled,
            monitor: if inputs.monitor_adc_v.is_some() { Part::Answers } else { Part::Bus },
            monitor_adc_v: inputs.monitor_adc_v.unwrap_or(f32::NAN),
            sensor_adc_v: inputs.sensor_adc_v.unwrap_or(f32::NAN),
            ..self.found
        };
        inputs
    }

    /// The reading of the current monitor, as old as that of the voltage monitor, V.
    #[cfg(feature = "self-sensing")]
    pub fn current_adc_v(&mut self, _: f32) -> Option<f32> {
        let [sampled, newest] = self.current;
        self.current[0] = newest;
        Some(AdcCode(sampled).volts(ADC))
    }

    /// State of the parts in the last tick.
    pub fn inspection(&self) -> Inspection {
        self.found
    }

    pub fn apply(&mut self, drive: Drive) -> Result<(), AmplifierError> {
        self.disabled = !drive.enable;
        if let Some(film) = &mut self.film {
            film.advance(drive);
            #[cfg(feature = "self-sensing")]
            {
                self.current[1] = code_of(film.current_v());
            }
            if !self.stuck {
                self.monitor = code_of(film.monitor_v());
            }
        }
        Ok(())
    }
}

/// The code nearest to `volts`. Beyond the ends the cast saturates.
fn code_of(volts: f32) -> u16 {
    (volts / ADC.full_scale_v() * 65_536.0 + 0.5) as u16
}
