//! A simulated bench that goes wrong on purpose, instead of pins and converters: an image with the feature `drills` shows in
//! QEMU how every fault ends.

use core::mem::replace;
use core::sync::atomic::{AtomicU8, Ordering};

use dea_driver::chips::{AdcCode, AdcRange, DacCode};
use dea_driver::wire::Drill;
use dea_driver::{AmplifierError, Drive, Inputs};

/// The drill that is asked for: its place in the list, from 1; 0 is none.
static ASKED: AtomicU8 = AtomicU8::new(0);

const DRILLS: [Drill; 7] =
    [Drill::Interlock, Drill::Monitor, Drill::Sensor, Drill::Bus, Drill::Overrun, Drill::Panic, Drill::Hang];

/// The range of both simulated ADCs.
const ADC: AdcRange = AdcRange::UpTo10V24;

/// Lets the next tick go wrong.
pub fn ask(drill: Drill) {
    let place = DRILLS.iter().position(|&other| other == drill).map_or(0, |place| place as u8 + 1);
    ASKED.store(place, Ordering::Relaxed);
}

/// On this bench, nothing is connected.
pub type AdcBus = ();

/// An amplifier and a monitor that follow at once, and a sensor on a film that stands still. Like the board's converters they are
/// sampled at the end of a frame, and answer in that of the next tick.
pub struct Bench {
    /// What the amplifier gives, as its monitor's code.
    monitor: u16,
    /// What it gave in the tick before.
    sampled: u16,
    ticks: u32,
    stuck: bool,
    disabled: bool,
}

impl Bench {
    pub fn new() -> Self {
        defmt::error!("a simulated bench: this image is for drills alone");
        Self { monitor: 0, sampled: 0, ticks: 0, stuck: false, disabled: true }
    }

    pub fn sample(&mut self) -> Inputs {
        self.ticks = self.ticks.wrapping_add(1);
        // 1 V, and the noise of a living sensor: 4 µm peak to peak.
        let displacement = 6400 + 8 * (self.ticks % 4) as u16;
        let mut inputs = Inputs {
            interlock_closed: true,
            monitor_adc_v: Some(AdcCode(replace(&mut self.sampled, self.monitor)).volts(ADC)),
            sensor_adc_v: Some(AdcCode(displacement).volts(ADC)),
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
            Some(Drill::Hang) => loop {
                cortex_m::asm::nop();
            },
            None => {}
        }
        inputs
    }

    pub fn apply(&mut self, drive: Drive) -> Result<(), AmplifierError> {
        self.disabled = !drive.enable;
        let code = if drive.enable { DacCode::from_volts(drive.dac_v, drive.range) } else { DacCode::ZERO };
        if !self.stuck {
            // From the DAC's volts to the monitor's code of 10.24 V: both instruments stand for the same.
            self.monitor = (code.volts(drive.range) / ADC.full_scale_v() * 65_536.0) as u16;
        }
        Ok(())
    }
}
