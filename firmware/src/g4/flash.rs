//! The last 8 KiB of flash, which keep the parameters: two slots of two pages each, in the bank that the program is not in.

use core::ops::Range;

use cortex_m::asm;
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};
use stm32_metapac::flash::Flash;
use stm32_metapac::flash::regs::Sr;
use stm32_metapac::{FLASH, RCC};

/// Where they begin, and their bytes; the board's memory map keeps the program away.
const START: usize = 0x0807_e000;
const CAPACITY: usize = 0x2000;
/// Bytes of a page, and the first page as the second bank counts them.
const PAGE: u32 = 2048;
const FIRST: u32 = (START as u32 - 0x0804_0000) / PAGE;
/// The keys of the flash.
const KEYS: [u32; 2] = [0x4567_0123, 0xcdef_89ab];
/// How often the flash is asked whether it is done, and cycles of the core between: 60 ms and more, where a page takes 25.
const PATIENCE: u32 = 10_000;
const PAUSE: u32 = 1000;
/// Everything that it may complain about.
const FAULTS: u32 = 0xc3fa;

/// The slots.
pub struct ParameterFlash(Flash);

impl ParameterFlash {
    pub fn new(flash: Flash) -> Self {
        Self(flash)
    }

    /// Does `work` on the unlocked flash, whose caches do not notice that it changes.
    fn unlocked(&self, work: impl FnOnce() -> Result<(), NorFlashErrorKind>) -> Result<(), NorFlashErrorKind> {
        // One bank has other pages, and other addresses in its second half.
        if !self.0.optr().read().dbank() {
            return Err(NorFlashErrorKind::Other);
        }
        if self.0.cr().read().lock() {
            KEYS.into_iter().for_each(|key| self.0.keyr().write_value(key));
        }
        self.0.sr().write_value(Sr(FAULTS));
        let done = work();
        self.0.cr().modify(|w| {
            w.set_per(false);
            w.set_pg(false);
            w.set_lock(true);
        });
        self.0.acr().modify(|w| {
            w.set_icen(false);
            w.set_dcen(false);
        });
        for reset in [true, false] {
            self.0.acr().modify(|w| {
                w.set_icrst(reset);
                w.set_dcrst(reset);
            });
        }
        self.0.acr().modify(|w| {
            w.set_icen(true);
            w.set_dcen(true);
        });
        done
    }

    /// Waits for the end of an operation.
    fn finish(&self) -> Result<(), NorFlashErrorKind> {
        let ends = (0..PATIENCE).any(|_| {
            let busy = self.0.sr().read().bsy();
            if busy {
                asm::delay(PAUSE);
            }
            !busy
        });
        if ends && self.0.sr().read().0 & FAULTS == 0 { Ok(()) } else { Err(NorFlashErrorKind::Other) }
    }
}

impl ErrorType for ParameterFlash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for ParameterFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        check_read(self, offset, bytes.len())?;
        for (address, byte) in (START + offset as usize..).zip(bytes) {
            // SAFETY: the flash is mapped there for as long as the chip has power, and nothing writes while this borrows it.
            *byte = unsafe { (address as *const u8).read_volatile() };
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        CAPACITY
    }
}

impl NorFlash for ParameterFlash {
    const WRITE_SIZE: usize = 8;
    const ERASE_SIZE: usize = PAGE as usize;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        check_erase(self, from, to)?;
        let pages: Range<u32> = FIRST + from / PAGE..FIRST + to / PAGE;
        self.unlocked(|| {
            pages.into_iter().try_for_each(|page| {
                self.0.cr().modify(|w| {
                    w.set_per(true);
                    w.set_bker(true);
                    w.set_pnb(page as u8);
                });
                self.0.cr().modify(|w| w.set_strt(true));
                self.finish()
            })
        })
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        check_write(self, offset, bytes.len())?;
        let places = (START + offset as usize..).step_by(8);
        self.unlocked(|| {
            self.0.cr().modify(|w| w.set_pg(true));
            places.zip(bytes.as_chunks().0).try_for_each(|(place, &[a, b, c, d, e, f, g, h])| {
                for (place, word) in [(place, [a, b, c, d]), (place + 4, [e, f, g, h])] {
                    // SAFETY: the address is one of the slots', which the program does not refer to.
                    unsafe { (place as *mut u32).write_volatile(u32::from_le_bytes(word)) };
                }
                self.finish()
            })
        })
    }
}

/// Forgives a word of the parameters that was cut off while it was written, which is not readable: the reason for a non-maskable interrupt unless the
/// crystal has stopped. The checksum of the parameters refuses it.
pub fn forgives() -> bool {
    let found = FLASH.eccr().read();
    let forgiven = !RCC.cifr().read().cssf() && found.eccd() && found.bk_ecc();
    if forgiven {
        // Writing ones clears the flags.
        FLASH.eccr().write_value(found);
    }
    forgiven
}
