//! A bench with the converters on the chip: a channel of the DAC, and ADC1 and ADC2 side by side.
//!
//! All of them refer to the chip's analog supply. ADC1 compares it with the chip's own reference in every tick, and ADC2 reads the DAC's output back
//! from its pin, so that each of them shows that it converts. The DAC has no buffer: with it the output does not come below 0.2 V.

use dea_driver::chips::{AdcError, AmplifierError, Drive};
use dea_driver::wire::{Inspection, Part};
use dea_driver::{Controller, Inputs};

use super::family::Rcc;
#[cfg(feature = "self-sensing")]
use super::family::adc3::Adc3;
use super::family::converters::{Channel, DAC_PIN, FACTORY, FACTORY_CODES, FACTORY_V, Pair, REFERENCE, SENSORS, SLOW};
#[cfg(feature = "self-sensing")]
use crate::current::Current;
use crate::pin::Pin;

/// Codes of a converter.
const CODES: f32 = 4096.0;
/// Samples of each sensor in a tick: their mean has less noise.
const SAMPLES: u16 = 8;
/// Weight of a tick in the mean of the reference's code, and the change of that mean after which the supply is updated. Between updates a
/// reading changes only with its own code, so that a stuck sensor reads the same.
const SUPPLY_WEIGHT: f32 = 1.0 / 64.0;
const SUPPLY_CODES: f32 = 1.0;
/// Largest change of the supply by the chip's reference since the first measurement: a regulator that warms changes by less. A reference
/// that fails looks the same, and nothing else shows it.
pub const MAX_SUPPLY_CHANGE: f32 = 0.04;
/// Largest difference at the DAC's pin by offset, linearity and load, and by the ADC: codes at 0 V, and a divisor of the code.
const PIN_CODES: u16 = 24;
const PIN_SHARE: u16 = 50;

/// Readings of both ADCs at the beginning of a tick, and the supply.
#[derive(Clone, Copy)]
struct Sample {
    monitor_v: f32,
    sensor_v: f32,
    /// The code of the DAC's pin.
    pin: u16,
    supply_v: f32,
}

/// ADC1 for the voltage monitor and ADC2 for the sensor.
struct Adcs {
    pair: Pair,
    channels: [u8; 2],
    /// The range of the supply.
    supply_v: [f32; 2],
    is_set: bool,
    /// The code of the reference: the first one, its mean, and the one that the supply follows from. NaN before the first.
    first: f32,
    mean: f32,
    used: f32,
}

impl Adcs {
    fn new(channels: [u8; 2], supply_v: [f32; 2], rcc: &mut Rcc) -> Self {
        let pair = Pair::new(channels, rcc);
        let (first, mean, used) = (f32::NAN, f32::NAN, f32::NAN);
        Self { pair, channels, supply_v, is_set: false, first, mean, used }
    }

    /// Converts both sensors, the chip's reference and the DAC's pin. An ADC that does not answer, or is not as it was set, is set up again.
    fn sample(&mut self) -> Result<Sample, AdcError> {
        if !self.is_set {
            self.pair.set();
        }
        let sampled = self.convert();
        self.is_set = sampled.is_ok();
        sampled
    }

    fn convert(&mut self) -> Result<Sample, AdcError> {
        self.pair.check()?;
        let [reference, pin] = self.pair.convert([REFERENCE, DAC_PIN], &SLOW)?;
        let supply_v = self.supply(reference)?;
        let mut sums = [0; 2];
        for _ in 0..SAMPLES {
            let codes = self.pair.convert(self.channels, &SENSORS)?;
            sums = [sums[0] + codes[0], sums[1] + codes[1]];
        }
        let [monitor_v, sensor_v] = sums.map(|sum| f32::from(sum) * (supply_v / (CODES * f32::from(SAMPLES))));
        Ok(Sample { monitor_v, sensor_v, pin, supply_v })
    }

    /// The analog supply, V, from the `code` of the chip's reference. Refused outside of the supply's range, which an ADC that does not convert is
    /// as well, and too far from the first.
    fn supply(&mut self, code: u16) -> Result<f32, AdcError> {
        // SAFETY: the system memory can be read at any time.
        let factory = unsafe { FACTORY.read_volatile() };
        let supply_v = |code: f32| FACTORY_V * f32::from(factory) / code;
        let [low_v, high_v] = self.supply_v;
        if !FACTORY_CODES.contains(&factory) || !(low_v..=high_v).contains(&supply_v(code.into())) {
            return Err(AdcError::Range { wanted: factory, found: code });
        }
        let found = f32::from(code);
        if self.first.is_nan() {
            (self.first, self.mean) = (found, found);
        }
        if (found / self.first - 1.0).abs() > MAX_SUPPLY_CHANGE {
            return Err(AdcError::Range { wanted: self.first as u16, found: code });
        }
        self.mean += SUPPLY_WEIGHT * (found - self.mean);
        let stays = (self.mean - self.used).abs() <= SUPPLY_CODES;
        self.used = if stays { self.used } else { self.mean };
        Ok(supply_v(self.used))
    }
}

/// The amplifier behind the DAC's pin and the enable output.
struct Amplifier {
    dac: Channel,
    enable: Pin,
    /// The last code that was written.
    code: u16,
}

impl Amplifier {
    /// Brings the command to 0 V before the DAC drives its pin. `enable` is low.
    fn new(enable: Pin, rcc: &mut Rcc) -> Self {
        let mut amplifier = Self { dac: Channel::new(rcc), enable, code: 0 };
        amplifier.start();
        amplifier
    }

    fn start(&mut self) {
        self.write(0);
        self.dac.start();
    }

    fn write(&mut self, code: u16) {
        self.dac.write(code);
        self.code = code;
    }

    /// Applies the `drive` of a tick: disables before anything else, enables at 0 V, and only if the DAC is as it was set and its pin is where it
    /// was driven in the tick before.
    fn apply(&mut self, drive: Drive, sample: Option<Sample>) -> Result<(), AmplifierError> {
        if !drive.enable {
            self.enable.set(false);
        }
        let held = self.check(sample);
        match (held, drive.enable) {
            (Ok(supply_v), true) => {
                self.enable.set(true);
                self.write(code_of(drive.dac_v, supply_v));
            }
            (Ok(_), false) => self.write(0),
            (Err(_), _) => {
                self.enable.set(false);
                self.start();
            }
        }
        held.map(drop)
    }

    /// Checks that the DAC holds the last code, and that its pin shows it. Returns the supply, V.
    fn check(&self, sample: Option<Sample>) -> Result<f32, AmplifierError> {
        self.dac.check()?;
        let held = self.dac.held();
        let Some(Sample { pin, supply_v, .. }) = sample else { return Err(AmplifierError::Bus) };
        for (found, off) in [(held, 0), (pin, PIN_CODES + self.code / PIN_SHARE)] {
            if self.code.abs_diff(found) > off {
                return Err(AmplifierError::Readback { wanted: self.code, found });
            }
        }
        Ok(supply_v)
    }
}

/// The nearest code to `volts` at the DAC's pin: saturates, and NaN is 0 V.
fn code_of(volts: f32, supply_v: f32) -> u16 {
    ((volts * (CODES / supply_v) + 0.5) as u16).min(4095)
}

/// There is no bus.
pub type AdcBus = ();

/// The pins of a bench, the enable output low and those of the converters analog.
pub struct Pins {
    pub enable: Pin,
    pub interlock: Pin,
    /// Channels of monitor and sensor.
    pub channels: [u8; 2],
    /// The channel of the current's monitor, at ADC3.
    #[cfg(feature = "self-sensing")]
    pub current: u8,
    /// The range of the supply, V.
    pub supply_v: [f32; 2],
}

/// The bench on the board's pins.
pub struct Bench {
    amplifier: Amplifier,
    adcs: Adcs,
    sample: Option<Sample>,
    #[cfg(feature = "self-sensing")]
    current: Current<Adc3>,
    interlock: Pin,
    found: Inspection,
}

impl Bench {
    /// Brings the amplifier's command to 0 V.
    pub fn new(pins: Pins, _: &'static mut Option<AdcBus>, rcc: &mut Rcc) -> Self {
        let Pins { enable, interlock, channels, supply_v, .. } = pins;
        Self {
            amplifier: Amplifier::new(enable, rcc),
            adcs: Adcs::new(channels, supply_v, rcc),
            sample: None,
            #[cfg(feature = "self-sensing")]
            current: Current::new(Adc3::new(pins.current, rcc)),
            interlock: interlock.input_pulled_down(),
            found: Inspection::STARTING,
        }
    }

    /// The converters need nothing of the controller.
    pub fn prepare(&mut self, _: Option<&Controller>) {}

    /// State of the parts in the last tick.
    pub fn inspection(&self) -> Inspection {
        self.found
    }

    /// Samples interlock and sensors.
    pub fn sample(&mut self) -> Inputs {
        let sampled = self.adcs.sample();
        self.sample = sampled.ok();
        let [monitor, sensor] = [sampled.map(|s| s.monitor_v), sampled.map(|s| s.sensor_v)];
        let interlock_closed = self.interlock.is_high();
        let part = |read: Result<f32, AdcError>| Part::from(read);
        self.found = Inspection {
            interlock_closed,
            enable_high: self.amplifier.enable.is_high(),
            dac: self.found.dac,
            monitor: part(monitor),
            sensor: part(sensor),
            monitor_adc_v: monitor.unwrap_or(f32::NAN),
            sensor_adc_v: sensor.unwrap_or(f32::NAN),
        };
        Inputs { interlock_closed, monitor_adc_v: monitor.ok(), sensor_adc_v: sensor.ok() }
    }

    /// The mean current since the last tick, one of `rate_hz` (Hz), V at its pin: up to the moment in which the voltage monitor was read.
    #[cfg(feature = "self-sensing")]
    pub fn current_adc_v(&mut self, rate_hz: f32) -> Option<f32> {
        let share = self.current.mean(rate_hz);
        Some(share? * self.sample?.supply_v)
    }

    /// Applies the drive of a tick to the amplifier.
    pub fn apply(&mut self, drive: Drive) -> Result<(), AmplifierError> {
        // The sample is of the command before this one: the next tick has its own.
        let applied = self.amplifier.apply(drive, self.sample.take());
        self.found.dac = applied.into();
        applied
    }
}
