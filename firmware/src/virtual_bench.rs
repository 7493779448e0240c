//! A virtual bench instead of pins and converters, for QEMU: a closed interlock, an amplifier, and a simulated film. It goes wrong on
//! purpose where a host asks for a drill, and so shows how every fault ends.

use core::mem::replace;
use core::sync::atomic::{AtomicU8, Ordering};

use dea_driver::chips::{AdcCode, AdcRange};
use dea_driver::wire::{Drill, Inspection, Part};
use dea_driver::{AmplifierError, Controller, Drive, Inputs};

use crate::film::Film;

/// The drill that is asked for: its place in the list, from 1; 0 is none.
static ASKED: AtomicU8 = AtomicU8::new(0);

/// What can go wrong here. A tick that hangs needs a watchdog, which QEMU does not have.
const DRILLS: [Drill; 6] = [Drill::Interlock, Drill::Monitor, Drill::Sensor, Drill::Bus, Drill::Overrun, Drill::Panic];

/// The range of both simulated ADCs.
const ADC: AdcRange = AdcRange::UpTo10V24;
/// What the sensor shows before there are parameters, V.
const AT_REST_V: f32 = 1.0;
/// Most codes by which the sensor's noise is off: a living sensor is never still.
const NOISE: u32 = 8;

/// Lets the next tick go wrong. False for a fault that cannot be shown here.
pub fn ask(drill: Drill) -> bool {
    let place = DRILLS.iter().position(|&other| other == drill).map(|place| place as u8 + 1);
    ASKED.store(place.unwrap_or(0), Ordering::Relaxed);
    place.is_some()
}

/// On this bench, nothing is connected.
pub type AdcBus = ();

/// The bench. Like the board's converters its monitor is sampled at the end of a frame, and answers in that of the next tick.
pub struct Bench {
    film: Option<Film>,
    /// What the monitor shows, as its code.
    monitor: u16,
    /// What it showed in the tick before.
    sampled: u16,
    noise: u32,
    stuck: bool,
    disabled: bool,
    found: Inspection,
}

impl Bench {
    pub fn new() -> Self {
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
        Self { film: None, monitor: 0, sampled: 0, noise: 1, stuck: false, disabled: true, found }
    }

    /// Mounts the film of the present parameters, if it is another one than before.
    pub fn mount(&mut self, controller: Option<&Controller>) {
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
            // What went wrong is mended once the amplifier is off.
            self.stuck = false;
            ASKED.store(0, Ordering::Relaxed);
        }
        let asked = ASKED.load(Ordering::Relaxed);
        match DRILLS.get(usize::from(asked).wrapping_sub(1)) {
            Some(Drill::Interlock) => inputs.interlock_closed = false,
            Some(Drill::Monitor) => self.stuck = true,
            Some(Drill::Sensor) => inputs.sensor_adc_v = Some(ADC.largest_v()),
            Some(Drill::Bus) => inputs.monitor_adc_v = None,
            // Some 18 ms at 168 MHz, and 3 ms where QEMU counts a nanosecond per instruction: longer than a tick, shorter
            // than the watchdog waits.
            Some(Drill::Overrun) => cortex_m::asm::delay(3_000_000),
            Some(Drill::Panic) => panic!("a drill"),
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

    /// What the last tick has found.
    pub fn inspection(&self) -> Inspection {
        self.found
    }

    pub fn apply(&mut self, drive: Drive) -> Result<(), AmplifierError> {
        self.disabled = !drive.enable;
        if let Some(film) = &mut self.film {
            film.advance(drive);
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
