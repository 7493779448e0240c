//! The two sectors of flash that keep the parameters.

use core::slice;

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};
use stm32f4xx_hal::flash::{FlashExt, LockedFlash};
use stm32f4xx_hal::pac::FLASH;

/// Bytes of a sector.
const SECTOR: u32 = 16 * 1024;
/// The sectors, as the chip counts them.
const SECTORS: [u8; 2] = [1, 2];
/// Where they begin in the flash; `memory.x` keeps the program away.
const START: usize = 16 * 1024;

/// Sectors 1 and 2.
pub struct ParameterFlash {
    flash: LockedFlash,
}

impl ParameterFlash {
    pub fn new(flash: FLASH) -> Self {
        Self { flash: LockedFlash::new(flash) }
    }
}

impl ErrorType for ParameterFlash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for ParameterFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        check_read(self, offset, bytes.len())?;
        let start = (self.flash.address() + START) as *const u8;
        // SAFETY: the flash is mapped there for as long as the chip has power, and nothing writes while this borrows it.
        let sectors = unsafe { slice::from_raw_parts(start, self.capacity()) };
        bytes.copy_from_slice(&sectors[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        SECTORS.len() * SECTOR as usize
    }
}

impl NorFlash for ParameterFlash {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = SECTOR as usize;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        check_erase(self, from, to)?;
        clear_faults();
        let sectors = &SECTORS[(from / SECTOR) as usize..(to / SECTOR) as usize];
        let erased = {
            let mut flash = self.flash.unlocked();
            sectors.iter().try_for_each(|&sector| flash.erase(sector))
        };
        flush_caches();
        erased.map_err(|_| NorFlashErrorKind::Other)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        check_write(self, offset, bytes.len())?;
        clear_faults();
        let written = self.flash.unlocked().program(START + offset as usize, bytes.iter());
        flush_caches();
        written.map_err(|_| NorFlashErrorKind::Other)
    }
}

/// Clears faults of earlier operations, which would be taken for faults of the next.
fn clear_faults() {
    // SAFETY: this code has the flash to itself; writing ones clears the flags.
    let status = unsafe { &*FLASH::ptr() }.sr();
    status.write(|w| {
        w.pgserr()
            .clear_bit_by_one()
            .pgperr()
            .clear_bit_by_one()
            .pgaerr()
            .clear_bit_by_one()
            .wrperr()
            .clear_bit_by_one()
    });
}

/// Empties the caches between flash and core, which do not notice that the flash has changed.
fn flush_caches() {
    // SAFETY: as above. They are off while they are emptied, as the manual asks.
    let control = unsafe { &*FLASH::ptr() }.acr();
    control.modify(|_, w| w.dcen().clear_bit().icen().clear_bit());
    control.modify(|_, w| w.dcrst().set_bit().icrst().set_bit());
    control.modify(|_, w| w.dcrst().clear_bit().icrst().clear_bit());
    control.modify(|_, w| w.dcen().set_bit().icen().set_bit());
}

/// Nothing that this flash does ends in a non-maskable interrupt.
pub fn forgives() -> bool {
    false
}
