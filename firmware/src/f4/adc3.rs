//! ADC3 of an STM32F4, which converts one channel all the time, and stream 0 of DMA2, which puts its codes into the ring.

use cortex_m::asm;
use stm32f4xx_hal::pac::{ADC_COMMON, ADC1, ADC3, DMA2};
use stm32f4xx_hal::rcc::{Enable, Rcc};

use super::converters::clock;
use crate::current::{Converter, LEN, RING};

/// Sampling of a channel for 84 cycles, and cycles from one code to the next.
const SAMPLING: u32 = 0b100;
const CYCLES: u32 = 84 + 12;
/// Converts all the time, each code by the DMA in each of its rounds; on, and started.
const CR2: u32 = 1 << 9 | 1 << 8 | 1 << 1 | 1;
const START: u32 = 1 << 30;
const OVERRUN: u32 = 1 << 5;
/// Half words of channel 2 to one address after the other, in rounds; on. Flags of the stream.
const STREAM: u32 = 2 << 25 | 1 << 13 | 1 << 11 | 1 << 10 | 1 << 8 | 1;
const FLAGS: u32 = 0b11_1101;
/// Polls of a stream until it is off.
const PATIENCE: u32 = 1000;

/// ADC3 and its stream.
pub struct Adc3 {
    adc: ADC3,
    dma: DMA2,
    common: ADC_COMMON,
    /// Its channel, 10 to 18.
    channel: u8,
    divider: u32,
    /// Cycles of the core in 3 µs, which it takes to start.
    start_cycles: u32,
    codes_per_s: f32,
}

impl Adc3 {
    /// `channel`: 10 to 13, whose pin is analog. To be called once.
    pub fn new(channel: u8, rcc: &mut Rcc) -> Self {
        // What the ADCs share has the clock of the first.
        ADC1::enable(rcc);
        ADC3::enable(rcc);
        DMA2::enable(rcc);
        let ((divider, ratio), core_hz) = (clock(rcc), rcc.clocks.hclk().raw());
        // SAFETY: they are the caller's; what the ADCs share is set to the same by all.
        let (adc, dma, common) = unsafe { (ADC3::steal(), DMA2::steal(), ADC_COMMON::steal()) };
        let codes_per_s = core_hz as f32 / (ratio * CYCLES) as f32;
        Self { adc, dma, common, channel, divider, start_cycles: core_hz / 250_000, codes_per_s }
    }

    /// Sampling time of its channel.
    fn sampling(&self) -> u32 {
        SAMPLING << (3 * (self.channel - 10))
    }
}

impl Converter for Adc3 {
    fn codes_per_s(&self) -> f32 {
        self.codes_per_s
    }

    fn set(&self) {
        let (adc, stream) = (&self.adc, self.dma.st(0));
        // SAFETY: bits of registers as the reference manual has them; the DMA writes the ring alone.
        unsafe {
            stream.cr().write(|w| w.bits(0));
            (0..PATIENCE).any(|_| stream.cr().read().en().bit_is_clear());
            adc.cr2().write(|w| w.bits(0));
            adc.sr().write(|w| w.bits(0));
            self.dma.lifcr().write(|w| w.bits(FLAGS));
            stream.par().write(|w| w.bits(adc.dr().as_ptr() as u32));
            stream.m0ar().write(|w| w.bits(RING.start() as u32));
            stream.ndtr().write(|w| w.bits(LEN as u32));
            stream.cr().write(|w| w.bits(STREAM));
            self.common.ccr().modify(|r, w| w.bits(r.bits() & !(0b11 << 16) | self.divider << 16));
            adc.cr1().write(|w| w.bits(0));
            adc.smpr1().write(|w| w.bits(self.sampling()));
            adc.sqr1().write(|w| w.bits(0));
            adc.sqr3().write(|w| w.bits(self.channel.into()));
            adc.cr2().write(|w| w.bits(CR2));
            asm::delay(self.start_cycles);
            adc.cr2().write(|w| w.bits(CR2 | START));
        }
    }

    fn left(&self) -> Option<usize> {
        let (adc, stream) = (&self.adc, self.dma.st(0));
        let is_as_set = [
            (CR2, adc.cr2().read().bits()),
            (0, adc.cr1().read().bits()),
            (self.sampling(), adc.smpr1().read().bits()),
            (self.channel.into(), adc.sqr3().read().bits()),
            (STREAM, stream.cr().read().bits()),
            (RING.start() as u32, stream.m0ar().read().bits()),
            (0, adc.sr().read().bits() & OVERRUN),
        ]
        .iter()
        .all(|(wanted, found)| wanted == found);
        let left = stream.ndtr().read().bits() as usize;
        (is_as_set && left <= LEN).then_some(left)
    }
}
