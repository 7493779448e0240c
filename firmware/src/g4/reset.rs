//! Why the chip was reset: every cause but switching on is latched.

use dea_driver::Cause;
use stm32_metapac::RCC;
use stm32_metapac::flash::Flash;

use super::Rcc;
use crate::panic::Message;

/// The highest of the levels below which the supply resets the chip.
const MAX_LEVEL: u8 = 4;

/// Takes the flags of the last reset, so that the next one finds its own.
pub fn cause(_: &Rcc, panic_message: &Message) -> Option<Cause> {
    let flags = RCC.csr().read();
    RCC.csr().modify(|w| w.set_rmvf(true));
    match panic_message.as_str() {
        "" => {}
        text => {
            defmt::error!("the last run panicked: {}", text);
            return Some(Cause::Panic);
        }
    }
    // This chip does not distinguish a supply that dips from being switched on. Every reset sets the flag of the pin.
    if flags.iwdgrstf() || flags.wwdgrstf() {
        Some(Cause::Watchdog)
    } else if flags.borrstf() {
        None
    } else if flags.pinrstf() || flags.sftrstf() || flags.lpwrrstf() || flags.oblrstf() {
        Some(Cause::Reset)
    } else {
        None
    }
}

/// Checks the option bytes: a watchdog that starts with the chip, a reset before the supply is too low, and two banks of flash.
pub fn check_option_bytes(flash: &Flash) -> Option<Cause> {
    let options = flash.optr().read();
    let (by_software, too_low) = (options.idwg_sw(), options.bor_lev() != MAX_LEVEL);
    if by_software {
        defmt::warn!("the watchdog starts with the firmware, not with the chip: see IWDG_SW in docs/boards.md");
    }
    if too_low {
        defmt::warn!("the brown-out reset is not at its highest level: see BOR_LEV in docs/boards.md");
    }
    if !options.dbank() {
        defmt::warn!("the flash is one bank, and keeps no parameters: see DBANK in docs/boards.md");
    }
    (by_software || too_low || !options.dbank()).then_some(Cause::OptionBytes)
}
