//! The converters on an STM32F4: channel 2 of the DAC, at PA5, and ADC1 and ADC2 side by side.
//!
//! All of them refer to the chip's analog supply. ADC1 compares it with the chip's own reference in every tick, and ADC2 reads the DAC's output back
//! from its pin, so that each of them shows that it converts. The DAC has no buffer: with it the output does not come below 0.2 V.

use cortex_m::asm;
use dea_driver::chips::{AdcError, AmplifierError, Converters, Drive};
use stm32f4xx_hal::gpio::{Output, Pin};
use stm32f4xx_hal::pac::{ADC_COMMON, ADC1, ADC2, DAC, adc1};
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};

/// Codes of a converter.
const CODES: f32 = 4096.0;
/// The fastest clock of an ADC, Hz.
const ADC_HZ: u32 = 36_000_000;
/// Samples of each sensor in a tick: their mean has less noise.
const SAMPLES: u16 = 8;
/// How often an ADC is asked for its result, which is there by then.
const PATIENCE: u32 = 1000;
/// Cycles of a conversion after sampling.
const CONVERSION_CYCLES: u32 = 12;
/// The channel of the chip's own reference, at ADC1, and that of the DAC's pin.
const REFERENCE: u8 = 17;
const DAC_PIN: u8 = 5;
/// Sampling times: 56 cycles for the sensors, 480 for the chip's reference, which takes 10 µs, and for the DAC, whose output has 15 kΩ.
const SENSORS: Sampling = Sampling { bits: 0b011, cycles: 56 };
const SLOW: Sampling = Sampling { bits: 0b111, cycles: 480 };
/// Where the factory has put the code of the reference at 3.3 V, and its codes within the data sheet's 1.18 to 1.24 V.
const FACTORY: *const u16 = 0x1fff_7a2a as *const u16;
const FACTORY_V: f32 = 3.3;
const FACTORY_CODES: core::ops::RangeInclusive<u16> = 1464..=1539;
/// Weight of a tick in the mean of the reference's code, and how far that mean moves before the supply counts as another one: a reading
/// changes only with its own code otherwise, so that a sensor which is stuck stays the same.
const SUPPLY_WEIGHT: f32 = 1.0 / 64.0;
const SUPPLY_CODES: f32 = 1.0;
/// Largest change of the supply, as the chip's reference shows it, since it was measured first: a regulator that warms changes by less. A reference that
/// fails, which nothing else would show, looks the same.
pub const MAX_SUPPLY_CHANGE: f32 = 0.04;
/// Channel 2 of the DAC is on, without its buffer and without a trigger.
const DAC_CR: u32 = 1 << 16 | 1 << 17;
/// The DAC's pin is off by its offset, linearity and load, and by the ADC's: so many codes at 0 V, and this share of the code.
const PIN_CODES: u16 = 24;
const PIN_SHARE: u16 = 50;

/// A sampling time: its bits in a register, and its cycles of the ADC.
struct Sampling {
    bits: u32,
    cycles: u32,
}

/// Readings of both ADCs at the beginning of a tick, and the supply.
#[derive(Clone, Copy)]
pub struct Sample {
    pub monitor_v: f32,
    pub sensor_v: f32,
    /// The code of the DAC's pin.
    pin: u16,
    supply_v: f32,
}

/// ADC1 for the voltage monitor and ADC2 for the sensor.
pub struct Adcs {
    adc1: ADC1,
    adc2: ADC2,
    common: ADC_COMMON,
    channels: [u8; 2],
    /// Bits of the common control register.
    control: u32,
    /// Cycles of the core: of the start, and of a cycle of the ADCs.
    start_cycles: u32,
    ratio: u32,
    is_set: bool,
    /// The code of the reference: the first one, its mean, and the one that the supply follows from. NaN before the first.
    first: f32,
    mean: f32,
    used: f32,
}

impl Adcs {
    /// `channels`: those of monitor and sensor, 0 to 9, whose pins are analog.
    pub fn new(adc1: ADC1, adc2: ADC2, common: ADC_COMMON, channels: [u8; 2], rcc: &mut Rcc) -> Self {
        ADC1::enable(rcc);
        ADC2::enable(rcc);
        ADC1::reset(rcc);
        let (core_hz, bus_hz) = (rcc.clocks.hclk().raw(), rcc.clocks.pclk2().raw());
        let divider = (0..4).find(|&divider| bus_hz / (2 * (divider + 1)) <= ADC_HZ).unwrap_or(3);
        // With the reference's switch.
        let control = 1 << 23 | divider << 16;
        // 20 µs: the ADCs take 3, the reference 10.
        let (start_cycles, ratio) = (core_hz / 50_000, 2 * (divider + 1) * (core_hz / bus_hz));
        let (first, mean, used) = (f32::NAN, f32::NAN, f32::NAN);
        Self { adc1, adc2, common, channels, control, start_cycles, ratio, is_set: false, first, mean, used }
    }

    /// Converts both sensors, the chip's reference and the DAC's pin. An ADC that does not answer, or is not as it was set, is set up again.
    pub fn sample(&mut self) -> Result<Sample, AdcError> {
        if !self.is_set {
            self.set();
        }
        let sampled = self.convert();
        self.is_set = sampled.is_ok();
        sampled
    }

    fn set(&mut self) {
        // SAFETY: bits of registers as the reference manual has them: the sampling times, 12 bits, one conversion.
        unsafe {
            self.common.ccr().write(|w| w.bits(self.control));
            for adc in self.both() {
                adc.cr1().write(|w| w.bits(0));
                adc.smpr1().write(|w| w.bits(SLOW.bits << 21));
                adc.smpr2().write(|w| w.bits(self.sampling()));
                adc.sqr1().write(|w| w.bits(0));
                adc.cr2().write(|w| w.bits(1));
            }
        }
        asm::delay(self.start_cycles);
    }

    fn both(&self) -> [&adc1::RegisterBlock; 2] {
        [&self.adc1, &self.adc2]
    }

    /// Sampling times of channels 0 to 9.
    fn sampling(&self) -> u32 {
        let [monitor, sensor] = self.channels.map(|channel| SENSORS.bits << (3 * channel));
        monitor | sensor | SLOW.bits << (3 * DAC_PIN)
    }

    fn convert(&mut self) -> Result<Sample, AdcError> {
        for adc in self.both() {
            for (wanted, found) in [
                (0, adc.cr1().read().bits()),
                (1, adc.cr2().read().bits()),
                (self.sampling(), adc.smpr2().read().bits()),
                (self.control, self.common.ccr().read().bits()),
            ] {
                if found != wanted {
                    return Err(AdcError::Range { wanted: wanted as u16, found: found as u16 });
                }
            }
        }
        let [reference, pin] = self.pair([REFERENCE, DAC_PIN], &SLOW)?;
        let supply_v = self.supply(reference)?;
        let mut sums = [0; 2];
        for _ in 0..SAMPLES {
            let codes = self.pair(self.channels, &SENSORS)?;
            sums = [sums[0] + codes[0], sums[1] + codes[1]];
        }
        let [monitor_v, sensor_v] = sums.map(|sum| f32::from(sum) * (supply_v / (CODES * f32::from(SAMPLES))));
        Ok(Sample { monitor_v, sensor_v, pin, supply_v })
    }

    /// A conversion of each, at the same time. Nothing is on the buses meanwhile, which would disturb it.
    fn pair(&self, channels: [u8; 2], sampling: &Sampling) -> Result<[u16; 2], AdcError> {
        for (adc, channel) in self.both().into_iter().zip(channels) {
            // SAFETY: a channel has five bits.
            adc.sqr3().write(|w| unsafe { w.bits(channel.into()) });
            adc.cr2().modify(|_, w| w.swstart().set_bit());
        }
        asm::delay(self.ratio * (sampling.cycles + CONVERSION_CYCLES));
        let mut codes = [0; 2];
        for (adc, code) in self.both().into_iter().zip(&mut codes) {
            if !(0..PATIENCE).any(|_| adc.sr().read().eoc().bit_is_set()) {
                return Err(AdcError::Bus);
            }
            *code = adc.dr().read().bits() as u16;
        }
        Ok(codes)
    }

    /// The analog supply, V, from the `code` of the chip's reference. Refused outside of the supply's range, which an ADC that does not convert is
    /// as well, and too far from the first.
    fn supply(&mut self, code: u16) -> Result<f32, AdcError> {
        // SAFETY: the system memory can be read at any time.
        let factory = unsafe { FACTORY.read_volatile() };
        let supply_v = |code: f32| FACTORY_V * f32::from(factory) / code;
        let [low_v, high_v] = Converters::STM32F4_SUPPLY_V;
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
pub struct Amplifier<const P: char, const N: u8> {
    dac: DAC,
    enable: Pin<P, N, Output>,
    /// The last code that was written.
    code: u16,
}

impl<const P: char, const N: u8> Amplifier<P, N> {
    /// Brings the command to 0 V before the DAC drives its pin. `enable` is low.
    pub fn new(dac: DAC, enable: Pin<P, N, Output>, rcc: &mut Rcc) -> Self {
        DAC::enable(rcc);
        DAC::reset(rcc);
        let mut amplifier = Self { dac, enable, code: 0 };
        amplifier.start();
        amplifier
    }

    fn start(&mut self) {
        self.write(0);
        // SAFETY: as the reference manual has them.
        self.dac.cr().write(|w| unsafe { w.bits(DAC_CR) });
    }

    fn write(&mut self, code: u16) {
        // SAFETY: twelve bits.
        self.dac.dhr12r2().write(|w| unsafe { w.bits(code.into()) });
        self.code = code;
    }

    /// Applies the `drive` of a tick: disables before anything else, enables at 0 V, and only if the DAC is as it was set and its pin is where it
    /// was driven in the tick before.
    pub fn apply(&mut self, drive: Drive, sample: Option<Sample>) -> Result<(), AmplifierError> {
        if !drive.enable {
            self.enable.set_low();
        }
        let held = self.check(sample);
        match (held, drive.enable) {
            (Ok(supply_v), true) => {
                self.enable.set_high();
                self.write(code_of(drive.dac_v, supply_v));
            }
            (Ok(_), false) => self.write(0),
            (Err(_), _) => {
                self.enable.set_low();
                self.start();
            }
        }
        held.map(drop)
    }

    /// Checks that the DAC holds what it was sent last, and that its pin shows it. Returns the supply.
    fn check(&self, sample: Option<Sample>) -> Result<f32, AmplifierError> {
        let (control, held) = (self.dac.cr().read().bits(), self.dac.dor2().read().bits() as u16);
        if control != DAC_CR {
            return Err(AmplifierError::Readback { wanted: (DAC_CR >> 16) as u16, found: (control >> 16) as u16 });
        }
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
