//! Registers of the converters on an STM32F4: channel 2 of the DAC, at PA5, and ADC1 and ADC2 side by side.

use cortex_m::asm;
use dea_driver::chips::{AdcError, AmplifierError};
use stm32f4xx_hal::pac::{ADC_COMMON, ADC1, ADC2, DAC, adc1};
use stm32f4xx_hal::rcc::{Enable, Rcc, Reset};

/// The fastest clock of an ADC, Hz.
const ADC_HZ: u32 = 36_000_000;
/// Polls of an ADC for its result, which is ready by then.
const PATIENCE: u32 = 1000;
/// Cycles of a conversion after sampling.
const CONVERSION_CYCLES: u32 = 12;
/// The channel of the chip's own reference, at ADC1, and that of the DAC's pin, at ADC2.
pub const REFERENCE: u8 = 17;
pub const DAC_PIN: u8 = 5;
/// Sampling times: 56 cycles for the sensors, 480 for the chip's reference, which takes 10 µs, and for the DAC, whose output has 15 kΩ.
pub const SENSORS: Sampling = Sampling { bits: 0b011, cycles: 56 };
pub const SLOW: Sampling = Sampling { bits: 0b111, cycles: 480 };
/// Where the factory has put the code of the reference at 3.3 V, and its codes within the data sheet's 1.18 to 1.24 V.
pub const FACTORY: *const u16 = 0x1fff_7a2a as *const u16;
pub const FACTORY_V: f32 = 3.3;
pub const FACTORY_CODES: core::ops::RangeInclusive<u16> = 1464..=1539;
/// Channel 2 of the DAC is on, without its buffer and without a trigger.
const DAC_CR: u32 = 1 << 16 | 1 << 17;

/// A sampling time: its bits in a register, and its cycles of the ADC.
pub struct Sampling {
    bits: u32,
    cycles: u32,
}

/// ADC1 and ADC2.
pub struct Pair {
    adc1: ADC1,
    adc2: ADC2,
    common: ADC_COMMON,
    channels: [u8; 2],
    /// Bits of the common control register.
    control: u32,
    /// Cycles of the core: of the start, and of a cycle of the ADCs.
    start_cycles: u32,
    ratio: u32,
}

/// The divider of the ADCs' clock, as its bits, and cycles of the core in a cycle of the ADCs.
pub fn clock(rcc: &Rcc) -> (u32, u32) {
    let (core_hz, bus_hz) = (rcc.clocks.hclk().raw(), rcc.clocks.pclk2().raw());
    let divider = (0..4).find(|&divider| bus_hz / (2 * (divider + 1)) <= ADC_HZ).unwrap_or(3);
    (divider, 2 * (divider + 1) * (core_hz / bus_hz))
}

impl Pair {
    /// `channels`: those of monitor and sensor, 0 to 9, whose pins are analog. To be called once.
    pub fn new(channels: [u8; 2], rcc: &mut Rcc) -> Self {
        ADC1::enable(rcc);
        ADC2::enable(rcc);
        ADC1::reset(rcc);
        let (divider, ratio) = clock(rcc);
        // With the reference's switch.
        let control = 1 << 23 | divider << 16;
        // 20 µs: the ADCs take 3, the reference 10.
        let start_cycles = rcc.clocks.hclk().raw() / 50_000;
        // SAFETY: they are the caller's.
        let (adc1, adc2, common) = unsafe { (ADC1::steal(), ADC2::steal(), ADC_COMMON::steal()) };
        Self { adc1, adc2, common, channels, control, start_cycles, ratio }
    }

    /// Sets both up.
    pub fn set(&self) {
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

    /// Checks that both are as they were set.
    pub fn check(&self) -> Result<(), AdcError> {
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
        Ok(())
    }

    /// A conversion of each, at the same time. Nothing is on the buses meanwhile, which would disturb it.
    pub fn convert(&self, channels: [u8; 2], sampling: &Sampling) -> Result<[u16; 2], AdcError> {
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
}

/// A channel of the DAC.
pub struct Channel(DAC);

impl Channel {
    /// The channel after a reset. To be called once.
    pub fn new(rcc: &mut Rcc) -> Self {
        DAC::enable(rcc);
        DAC::reset(rcc);
        // SAFETY: it is the caller's.
        Self(unsafe { DAC::steal() })
    }

    /// It drives its pin.
    pub fn start(&self) {
        // SAFETY: as the reference manual has them.
        self.0.cr().write(|w| unsafe { w.bits(DAC_CR) });
    }

    pub fn write(&self, code: u16) {
        // SAFETY: twelve bits.
        self.0.dhr12r2().write(|w| unsafe { w.bits(code.into()) });
    }

    /// Checks that it is as it was set.
    pub fn check(&self) -> Result<(), AmplifierError> {
        let [wanted, found] = [DAC_CR, self.0.cr().read().bits()].map(|bits| (bits >> 16) as u16);
        if found == wanted { Ok(()) } else { Err(AmplifierError::Readback { wanted, found }) }
    }

    /// The code that it holds.
    pub fn held(&self) -> u16 {
        self.0.dor2().read().bits() as u16
    }
}
