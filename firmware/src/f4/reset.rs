//! Why the chip was reset: every cause but switching on is latched.

use dea_driver::Cause;
use stm32f4xx_hal::pac::{FLASH, RCC};

use crate::panic::Message;

/// Takes the flags of the last reset, so that the next one finds its own.
pub fn cause(rcc: &RCC, panic_message: &Message) -> Option<Cause> {
    let flags = rcc.csr().read();
    rcc.csr().modify(|_, w| w.rmvf().set_bit());
    match panic_message.as_str() {
        "" => {}
        text => {
            defmt::error!("the last run panicked: {}", text);
            return Some(Cause::Panic);
        }
    }
    // Below 1.8 V the chip cannot distinguish a dip from being switched on: there every flag of the supply is set. Every reset sets that
    // of the pin.
    if flags.wdgrstf().bit_is_set() || flags.wwdgrstf().bit_is_set() {
        Some(Cause::Watchdog)
    } else if flags.porrstf().bit_is_set() {
        None
    } else if flags.borrstf().bit_is_set() {
        Some(Cause::BrownOut)
    } else if flags.padrstf().bit_is_set() || flags.sftrstf().bit_is_set() || flags.lpwrrstf().bit_is_set() {
        Some(Cause::Reset)
    } else {
        // An emulator has no flags.
        None
    }
}

/// Checks the protections in the option bytes: a watchdog that starts with the chip, and a reset before the supply is too low.
pub fn check_option_bytes(flash: &FLASH) -> Option<Cause> {
    let options = flash.optcr().read();
    let (by_software, too_low) = (options.wdg_sw().bit_is_set(), options.bor_lev().bits() != 0);
    if by_software {
        defmt::warn!("the watchdog starts with the firmware, not with the chip: see WDG_SW in docs/wiring.md");
    }
    if too_low {
        defmt::warn!("the brown-out reset is not at its highest level: see BOR_LEV in docs/wiring.md");
    }
    (by_software || too_low).then_some(Cause::OptionBytes)
}
