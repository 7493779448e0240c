//! The models find what they are there to find: each violation, from registers that are set wrongly on purpose.

use board_on_host::board::Board;
use board_on_host::chip::Block;
use board_on_host::chip::family::Family;
use board_on_host::chip::gpio::Pin;
use board_on_host::chip::rcc::Oscillators;
use board_on_host::chip::violation::Violation;
use board_on_host::hal::gpio::{PinState, Speed, gpiob};
use board_on_host::hal::pac::SPI2;
use board_on_host::hal::prelude::*;
use board_on_host::hal::rcc::Config;
use board_on_host::hal::spi::Spi;

use super::slaves::{Recorder, dac_wiring};
use super::start::crystal;

/// SPI2 on its pins, their pads at `speed`, in mode 0. The select stays with the caller.
fn spi2(board: &Board, config: Config, speed: Speed, hz: u32) -> (Spi<SPI2>, gpiob::PB12) {
    let chip = board.peripherals();
    let mut rcc = chip.RCC.freeze(config);
    let pins = chip.GPIOB.split(&mut rcc);
    let sck = pins.pb13.into_alternate().speed(speed);
    let mosi = pins.pb15.into_alternate().speed(speed);
    let mode = board_on_host::hal::hal::spi::MODE_0;
    (Spi::new(chip.SPI2, (Some(sck), Some(pins.pb14), Some(mosi)), mode, hz.Hz(), &mut rcc), pins.pb12)
}

/// Compares a register with its reset value in the vendor's description of the chip.
macro_rules! assert_as_reset {
    ($($register:expr),* $(,)?) => {$(
        let before = $register.read().bits();
        $register.reset();
        assert_eq!(before, $register.read().bits(), stringify!($register));
    )*};
}

#[test]
fn registers_begin_as_the_vendor_describes_them() {
    let board = Board::new(Oscillators::default());
    let chip = board.peripherals();
    let rcc = &chip.RCC;
    assert_as_reset!(rcc.cr(), rcc.pllcfgr(), rcc.cfgr(), rcc.cir(), rcc.plli2scfgr(), rcc.csr(), rcc.bdcr());
    assert_as_reset!(rcc.ahb1enr(), rcc.ahb2enr(), rcc.ahb3enr(), rcc.apb1enr(), rcc.apb2enr());
    assert_as_reset!(rcc.ahb1lpenr(), rcc.ahb2lpenr(), rcc.ahb3lpenr(), rcc.apb1lpenr(), rcc.apb2lpenr());
    // SAFETY: the clocks of ports A to C.
    rcc.ahb1enr().modify(|r, w| unsafe { w.bits(r.bits() | 0b111) });
    let (a, b, c) = (&chip.GPIOA, &chip.GPIOB, &chip.GPIOC);
    assert_as_reset!(a.moder(), a.otyper(), a.pupdr(), a.odr(), a.afrl(), a.afrh());
    assert_as_reset!(b.moder(), b.otyper(), b.ospeedr(), b.pupdr(), b.odr(), b.afrl(), b.afrh());
    assert_as_reset!(c.moder(), c.otyper(), c.ospeedr(), c.pupdr(), c.odr(), c.afrl(), c.afrh());
    rcc.apb1enr().modify(|_, w| w.spi2en().set_bit().usart2en().set_bit().tim5en().set_bit());
    assert_as_reset!(chip.SPI2.cr1(), chip.SPI2.cr2(), chip.SPI2.sr(), chip.USART2.sr(), chip.USART2.cr1());
    assert_as_reset!(chip.USART2.brr(), chip.TIM5.cr1(), chip.TIM5.ccmr2_input(), chip.TIM5.ccer(), chip.TIM5.or());
    rcc.apb1enr().modify(|_, w| w.dacen().set_bit());
    rcc.apb2enr().modify(|_, w| w.adc1en().set_bit().adc2en().set_bit());
    let (adc, dac) = (&chip.ADC2, &chip.DAC);
    assert_as_reset!(chip.ADC1.sr(), chip.ADC1.cr1(), chip.ADC1.cr2(), adc.smpr1(), adc.smpr2(), adc.sqr1());
    assert_as_reset!(adc.sqr3(), adc.htr(), chip.ADC_COMMON.ccr(), dac.cr(), dac.dhr12r2());
    assert_eq!(board.violations(), []);
}

/// Those of an STM32G474, as they are in the vendor's description (stm32g4 0.16), which no dependency of this package has. Its values of RCC_CR and
/// FLASH_ACR are not those of the reference manual.
#[test]
fn registers_of_the_other_chip_begin_as_the_vendor_describes_them() {
    let board = Board::with(Family::G4, Oscillators::default());
    for (name, address, value) in [
        ("RCC_CFGR", 0x4002_1008, 0x0000_0005),
        ("RCC_PLLCFGR", 0x4002_100c, 0x0000_1000),
        ("RCC_CSR", 0x4002_1094, 0x0c00_0000),
        ("FLASH_CR", 0x4002_2014, 0xc000_0000),
        ("FLASH_OPTR", 0x4002_2020, 0xffef_f8aa),
        ("PWR_CR1", 0x4000_7000, 0x0000_0200),
        ("PWR_CR5", 0x4000_7080, 0x0000_0100),
        ("GPIOA_MODER", 0x4800_0000, 0xabff_ffff),
        ("GPIOB_MODER", 0x4800_0400, 0xffff_febf),
        ("GPIOC_MODER", 0x4800_0800, 0xffff_ffff),
        ("ADC1_CR", 0x5000_0008, 0x2000_0000),
        ("ADC2_CFGR", 0x5000_010c, 0x8000_0000),
    ] {
        assert_eq!(board.chip(|chip| chip.peek(address)), value, "{name}");
    }
}

#[test]
fn blocks_without_a_clock_and_without_a_model() {
    let board = Board::new(Oscillators::default());
    let chip = board.peripherals();
    let _ = chip.TIM5.cnt().read().bits();
    let _ = chip.WWDG.sr().read().bits();
    let address = 0x4000_2c08;
    assert_eq!(board.violations(), [Violation::NoClock(Block::Tim5), Violation::NoModel { address }]);
}

#[test]
fn clocks_beyond_their_limits() {
    let board = Board::new(Oscillators::default());
    let rcc = board.peripherals().RCC;
    // SAFETY: bits of the loop: from the crystal, 8 MHz / 4 × 168 / 2.
    rcc.pllcfgr().write(|w| unsafe { w.bits(1 << 22 | 168 << 6 | 4) });
    rcc.cr().modify(|_, w| w.hseon().set_bit());
    rcc.cr().modify(|_, w| w.pllon().set_bit());
    board.chip(|chip| chip.wait_ns(3_000_000));
    rcc.pllcfgr().modify(|_, w| w.pllsrc().hsi());
    rcc.cfgr().modify(|_, w| w.sw().pll());
    let [apb1, apb2] = ["APB1", "APB2"].map(|bus| Violation::BusClock { bus, hz: 168_000_000 });
    let slow_flash = Violation::WaitStates { set: 0, needed: 5 };
    let expected = [Violation::LoopWithoutInput, Violation::LoopSetWhileOn, apb1, apb2, slow_flash];
    assert_eq!(board.violations(), expected);
}

#[test]
fn a_select_that_moves_within_a_byte() {
    let board = Board::new(Oscillators::default());
    let (mut bus, select) = spi2(&board, Config::hsi(), Speed::VeryHigh, 100_000);
    let mut select = select.into_push_pull_output_in_state(PinState::Low);
    board.chip(|chip| chip.wire(dac_wiring(), Recorder::new(&[])));
    assert!(bus.write_nonblocking(0x55).is_ok());
    select.set_high();
    assert_eq!(board.violations(), [Violation::SelectWithinByte { pin: Pin::new('B', 12) }]);
}

#[test]
fn data_that_are_written_over_others_and_two_chips_at_once() {
    let board = Board::new(Oscillators::default());
    let (mut bus, select) = spi2(&board, Config::hsi(), Speed::VeryHigh, 100_000);
    for _ in 0..2 {
        board.chip(|chip| chip.wire(dac_wiring(), Recorder::new(&[])));
    }
    let _select = select.into_push_pull_output_in_state(PinState::Low);
    assert!(bus.write_nonblocking(1).is_ok());
    let pin = Pin::new('B', 12);
    assert_eq!(board.violations(), [Violation::TwoSelected { pin }]);
    // SAFETY: the models take what comes. One word is on the wires, one waits, and the third has no place.
    let registers = unsafe { SPI2::steal() };
    for word in 2..4 {
        registers.dr().write(|w| w.dr().set(word));
    }
    assert_eq!(board.violations().last(), Some(&Violation::Overwritten(Block::Spi(2))));
}

#[test]
fn pads_that_are_too_slow_for_their_clock_and_for_its_way_back() {
    // The last bit of a byte stays what it was in the byte before, if the bus is fast and the clock's pad is slow.
    for (speed, config, wanted) in [
        (Speed::Low, crystal(), [0x10, 0x32]),
        (Speed::VeryHigh, crystal(), [0x11, 0x32]),
        (Speed::Low, Config::hsi(), [0x11, 0x32]),
    ] {
        let board = Board::new(Oscillators::default());
        let (mut bus, select) = spi2(&board, config, speed, 2_000_000);
        let mut select = select.into_push_pull_output_in_state(PinState::High);
        board.chip(|chip| chip.wire(dac_wiring(), Recorder::new(&[0x11, 0x32])));
        let mut bytes = [0; 2];
        for _ in 0..2 {
            select.set_low();
            assert!(bus.transfer_in_place(&mut bytes).is_ok());
            // The library returns with the last bit, half a clock before its end.
            while bus.is_busy() {}
            select.set_high();
        }
        assert_eq!(bytes, wanted, "{:?}", config);
        assert_eq!(board.violations(), []);
    }
    let board = Board::new(Oscillators::default());
    let (mut bus, _) = spi2(&board, crystal(), Speed::Low, 5_250_000);
    assert!(bus.write_nonblocking(0).is_ok());
    let pads = [13, 15].map(|number| Violation::SlowPad { pin: Pin::new('B', number), sck_hz: 5_250_000 });
    assert_eq!(board.violations(), pads);
}
