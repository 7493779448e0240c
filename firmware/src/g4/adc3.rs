//! ADC3 of an STM32G4, which converts one channel all the time, and channel 1 of DMA1, which puts its codes into the ring.

use cortex_m::asm;
use stm32_metapac::adc::regs::{Cr as AdcCr, Sqr1};
use stm32_metapac::adccommon::regs::Ccr;
use stm32_metapac::bdma::regs::Cr as DmaCr;
use stm32_metapac::{ADC3, ADC345_COMMON, DMA1, DMAMUX1, RCC};

use super::Rcc;
use super::converters::{ADSTART, ON, READY, clock, switch_on};
use crate::current::{Converter, LEN, RING};

/// Sampling of a channel for 247.5 cycles, and cycles from one code to the next.
const SAMPLING: u32 = 0b110;
const CYCLES: u32 = 260;
/// Converts all the time, each code by the DMA in each of its rounds.
const CFGR: u32 = 1 << 31 | 1 << 13 | 0b11;
const OVERRUN: u32 = 1 << 4;
/// The request of ADC3; half words to one address after the other, in rounds, on; flags of the channel.
const REQUEST: u32 = 37;
const CHANNEL: u32 = 1 << 10 | 1 << 8 | 1 << 7 | 1 << 5 | 1;
const FLAGS: u32 = 0b1111;

/// ADC3 and its channel of the DMA.
pub struct Adc3 {
    /// Its channel, 1 to 9.
    channel: u32,
    /// Bits of the common control register, and cycles of the core in one of the ADC.
    control: u32,
    ratio: u32,
    /// Cycles of the core in 20 µs, which the regulator takes.
    start_cycles: u32,
    codes_per_s: f32,
}

impl Adc3 {
    /// `channel`: 1 to 9, whose pin is analog. To be called once.
    pub fn new(channel: u8, rcc: &mut Rcc) -> Self {
        RCC.ahb2enr().modify(|w| w.set_adc345en(true));
        RCC.ahb1enr().modify(|w| {
            w.set_dma1en(true);
            w.set_dmamux1en(true);
        });
        let (mode, ratio) = clock(rcc);
        let codes_per_s = rcc.core_hz as f32 / (ratio * CYCLES) as f32;
        Self { channel: channel.into(), control: mode << 16, ratio, start_cycles: rcc.core_hz / 50_000, codes_per_s }
    }

    /// Sampling time of its channel.
    fn sampling(&self) -> u32 {
        SAMPLING << (3 * self.channel)
    }
}

impl Converter for Adc3 {
    fn codes_per_s(&self) -> f32 {
        self.codes_per_s
    }

    fn set(&self) {
        let channel = DMA1.ch(0);
        channel.cr().write_value(DmaCr(0));
        for reset in [true, false] {
            RCC.ahb2rstr().modify(|w| w.set_adc345rst(reset));
        }
        ADC345_COMMON.ccr().write_value(Ccr(self.control));
        ADC3.cr().write_value(AdcCr(0));
        ADC3.cr().write_value(AdcCr(READY));
        asm::delay(self.start_cycles);
        switch_on(ADC3, self.ratio);
        ADC3.cfgr().write(|w| w.0 = CFGR);
        ADC3.smpr().write(|w| w.0 = self.sampling());
        ADC3.sqr1().write_value(Sqr1(self.channel << 6));
        DMAMUX1.ccr(0).write(|w| w.0 = REQUEST);
        DMA1.ifcr().write(|w| w.0 = FLAGS);
        channel.par().write_value(ADC3.dr().as_ptr() as u32);
        channel.mar().write_value(RING.start() as u32);
        channel.ndtr().write(|w| w.0 = LEN as u32);
        channel.cr().write_value(DmaCr(CHANNEL));
        ADC3.cr().write_value(AdcCr(ON | ADSTART));
    }

    fn left(&self) -> Option<usize> {
        let channel = DMA1.ch(0);
        let is_as_set = [
            (ON | ADSTART, ADC3.cr().read().0),
            (CFGR, ADC3.cfgr().read().0),
            (0, ADC3.cfgr2().read().0),
            (self.sampling(), ADC3.smpr().read().0),
            (self.channel << 6, ADC3.sqr1().read().0),
            (REQUEST, DMAMUX1.ccr(0).read().0),
            (CHANNEL, channel.cr().read().0),
            (RING.start() as u32, channel.mar().read()),
            (0, ADC3.isr().read().0 & OVERRUN),
        ]
        .iter()
        .all(|(wanted, found)| wanted == found);
        let left = channel.ndtr().read().0 as usize;
        (is_as_set && left <= LEN).then_some(left)
    }
}
