//! Registers of the converters on an STM32G4: channel 1 of DAC1, at PA4, and ADC1 and ADC2 side by side.

use core::ops::RangeInclusive;

use cortex_m::asm;
use dea_driver::chips::{AdcError, AmplifierError};
use stm32_metapac::adc::Adc;
use stm32_metapac::adc::regs::{Cr as AdcCr, Isr, Sqr1};
use stm32_metapac::adccommon::regs::Ccr;
use stm32_metapac::dac::regs::{Cr as DacCr, Mcr};
use stm32_metapac::{ADC1, ADC2, ADC12_COMMON, DAC1, RCC};

use super::Rcc;

const BOTH: [Adc; 2] = [ADC1, ADC2];
/// The fastest clock of two ADCs, Hz.
const ADC_HZ: u32 = 52_000_000;
/// Polls of an ADC for a result that is ready by then.
const PATIENCE: u32 = 1000;
/// Cycles of a conversion after sampling, rounded up together with it.
const CONVERSION_CYCLES: u32 = 13;
/// The channel of the chip's own reference, at ADC1, and that of the DAC's pin, at ADC2.
pub const REFERENCE: u8 = 18;
pub const DAC_PIN: u8 = 17;
/// Sampling times: 47.5 cycles for the sensors, 640.5 for the chip's reference, which takes 4 µs, and for the DAC, whose output has 15 kΩ.
pub const SENSORS: Sampling = Sampling { bits: 0b100, cycles: 48 };
pub const SLOW: Sampling = Sampling { bits: 0b111, cycles: 641 };
/// Where the factory has put the code of the reference at 3.0 V, and its codes within the data sheet's 1.182 to 1.232 V.
pub const FACTORY: *const u16 = 0x1fff_75aa as *const u16;
pub const FACTORY_V: f32 = 3.0;
pub const FACTORY_CODES: RangeInclusive<u16> = 1614..=1682;
/// An ADC with its regulator, and one that is on.
pub const READY: u32 = 1 << 28;
pub const ON: u32 = READY | 1;
/// Calibrates; starts.
const ADCAL: u32 = 1 << 31;
pub const ADSTART: u32 = 1 << 2;
/// Twelve bits, by software, the last conversion counts.
const CFGR: u32 = 1 << 31 | 1 << 12;
/// The DAC's channel 1, without its buffer, to its pin.
const DAC_ON: u32 = 1;
const TO_PIN: u32 = 0b010;

/// A sampling time: its bits in a register, and its cycles of the ADC.
pub struct Sampling {
    bits: u32,
    cycles: u32,
}

/// ADC1 and ADC2.
pub struct Pair {
    channels: [u8; 2],
    /// Bits of the common control register.
    control: u32,
    /// Cycles of the core: of the start, and of a cycle of the ADCs.
    start_cycles: u32,
    ratio: u32,
}

/// The mode of the ADCs' clock, as its bits, and cycles of the core in a cycle of the ADCs.
pub fn clock(rcc: &Rcc) -> (u32, u32) {
    if rcc.core_hz / 2 <= ADC_HZ { (2, 2) } else { (3, 4) }
}

/// Calibrates an ADC, whose regulator is on, and switches it on.
pub fn switch_on(adc: Adc, ratio: u32) {
    adc.cr().write_value(AdcCr(READY | ADCAL));
    // 116 cycles.
    (0..PATIENCE).any(|_| adc.cr().read().0 & ADCAL == 0);
    // Four cycles until it can be switched on.
    asm::delay(8 * ratio);
    adc.cr().write_value(AdcCr(ON));
    (0..PATIENCE).any(|_| adc.isr().read().adrdy());
}

impl Pair {
    /// `channels`: those of monitor and sensor, 1 to 9, whose pins are analog. To be called once.
    pub fn new(channels: [u8; 2], rcc: &mut Rcc) -> Self {
        RCC.ahb2enr().modify(|w| w.set_adc12en(true));
        let (mode, ratio) = clock(rcc);
        // With the reference's switch. 20 µs: the regulators and the reference take that at the most.
        Self { channels, control: 1 << 22 | mode << 16, start_cycles: rcc.core_hz / 50_000, ratio }
    }

    /// Sets both up, calibrated.
    pub fn set(&self) {
        for reset in [true, false] {
            RCC.ahb2rstr().modify(|w| w.set_adc12rst(reset));
        }
        ADC12_COMMON.ccr().write_value(Ccr(self.control));
        for adc in BOTH {
            adc.cr().write_value(AdcCr(0));
            adc.cr().write_value(AdcCr(READY));
        }
        asm::delay(self.start_cycles);
        for adc in BOTH {
            switch_on(adc, self.ratio);
            adc.cfgr().write(|w| w.0 = CFGR);
            let [below_10, others] = self.sampling();
            adc.smpr().write(|w| w.0 = below_10);
            adc.smpr2().write(|w| w.0 = others);
        }
    }

    /// Sampling times of channels 0 to 9, and 10 to 18.
    fn sampling(&self) -> [u32; 2] {
        let [monitor, sensor] = self.channels.map(|channel| SENSORS.bits << (3 * channel));
        [monitor | sensor, [REFERENCE, DAC_PIN].map(|channel| SLOW.bits << (3 * (channel - 10))).iter().sum()]
    }

    /// Checks that both are as they were set. A first conversion of each, for nothing: one that comes more than a millisecond after the last may be wrong
    /// (errata sheet).
    pub fn check(&self) -> Result<(), AdcError> {
        let [below_10, others] = self.sampling();
        for adc in BOTH {
            for (wanted, found) in [
                (ON, adc.cr().read().0),
                (CFGR, adc.cfgr().read().0),
                (0, adc.cfgr2().read().0),
                (below_10, adc.smpr().read().0),
                (others, adc.smpr2().read().0),
                (self.control, ADC12_COMMON.ccr().read().0),
            ] {
                if found != wanted {
                    return Err(AdcError::Range { wanted: wanted as u16, found: found as u16 });
                }
            }
        }
        self.convert(self.channels, &SENSORS).map(drop)
    }

    /// A conversion of each, at the same time. Nothing is on the buses meanwhile, which would disturb it.
    pub fn convert(&self, channels: [u8; 2], sampling: &Sampling) -> Result<[u16; 2], AdcError> {
        for (adc, channel) in BOTH.into_iter().zip(channels) {
            adc.sqr1().write_value(Sqr1(u32::from(channel) << 6));
            adc.isr().write_value(Isr(0b1_1110));
        }
        BOTH.into_iter().for_each(|adc| adc.cr().write_value(AdcCr(ON | ADSTART)));
        asm::delay(self.ratio * (sampling.cycles + CONVERSION_CYCLES));
        let mut codes = [0; 2];
        for (adc, code) in BOTH.into_iter().zip(&mut codes) {
            if !(0..PATIENCE).any(|_| adc.isr().read().eoc()) {
                return Err(AdcError::Bus);
            }
            *code = adc.dr().read().0 as u16;
        }
        Ok(codes)
    }
}

/// A channel of the DAC.
pub struct Channel {
    mode: u32,
}

impl Channel {
    /// The channel after a reset. To be called once.
    pub fn new(rcc: &mut Rcc) -> Self {
        RCC.ahb2enr().modify(|w| w.set_dac1en(true));
        for reset in [true, false] {
            RCC.ahb2rstr().modify(|w| w.set_dac1rst(reset));
        }
        // Its setting depends on the clock of its bus.
        let fast = rcc.core_hz.saturating_sub(1) / 80_000_000;
        Self { mode: fast << 14 | TO_PIN }
    }

    /// It drives its pin.
    pub fn start(&self) {
        DAC1.cr().write_value(DacCr(0));
        DAC1.mcr().write_value(Mcr(self.mode));
        DAC1.cr().write_value(DacCr(DAC_ON));
    }

    pub fn write(&self, code: u16) {
        DAC1.dhr12r(0).write(|w| w.set_dhr(code));
    }

    /// Checks that it is as it was set.
    pub fn check(&self) -> Result<(), AmplifierError> {
        for (wanted, found) in [(DAC_ON, DAC1.cr().read().0), (self.mode, DAC1.mcr().read().0)] {
            if found != wanted {
                return Err(AmplifierError::Readback { wanted: wanted as u16, found: found as u16 });
            }
        }
        Ok(())
    }

    /// The code that it holds.
    pub fn held(&self) -> u16 {
        DAC1.dor(0).read().dor()
    }
}
