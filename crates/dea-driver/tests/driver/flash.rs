//! Flash whose power can fail.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};

/// Bytes of a sector.
pub const SECTOR: usize = 1024;

/// Flash of two sectors, whose power fails after a number of written or erased bytes.
#[derive(Clone, Debug)]
pub struct Flash {
    /// Its contents.
    pub bytes: Vec<u8>,
    /// Bytes that can still be erased or written.
    pub power: usize,
}

/// The power has failed, or the flash was used in a way that it does not support.
#[derive(Debug)]
pub struct Failed(NorFlashErrorKind);

impl NorFlashError for Failed {
    fn kind(&self) -> NorFlashErrorKind {
        self.0
    }
}

impl Default for Flash {
    fn default() -> Self {
        Self::new()
    }
}

impl Flash {
    /// A flash as it comes from the factory, or with something else in it.
    pub fn new() -> Self {
        Self { bytes: vec![0xff; 2 * SECTOR], power: usize::MAX }
    }

    fn spend(&mut self) -> Result<(), Failed> {
        self.power = self.power.checked_sub(1).ok_or(Failed(NorFlashErrorKind::Other))?;
        Ok(())
    }
}

impl ErrorType for Flash {
    type Error = Failed;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Failed> {
        check_read(self, offset, bytes.len()).map_err(Failed)?;
        bytes.copy_from_slice(&self.bytes[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Failed> {
        check_erase(self, from, to).map_err(Failed)?;
        for at in from as usize..to as usize {
            self.spend()?;
            self.bytes[at] = 0xff;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Failed> {
        check_write(self, offset, bytes.len()).map_err(Failed)?;
        for (at, byte) in (offset as usize..).zip(bytes) {
            self.spend()?;
            // Flash can only clear bits.
            assert_eq!(self.bytes[at] & byte, *byte, "byte {at} was not erased");
            self.bytes[at] &= byte;
        }
        Ok(())
    }
}
