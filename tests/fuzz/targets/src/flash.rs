//! Flash of two sectors whose contents are given.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};

/// Bytes of a sector.
pub const SECTOR: usize = 1024;

/// Flash of two sectors.
#[derive(Clone, Debug, PartialEq)]
pub struct Flash(pub Vec<u8>);

impl Flash {
    /// As it comes from the factory.
    pub fn erased() -> Self {
        Self(vec![0xff; 2 * SECTOR])
    }
}

impl ErrorType for Flash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        check_read(self, offset, bytes.len())?;
        bytes.copy_from_slice(&self.0[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.len()
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        check_erase(self, from, to)?;
        self.0[from as usize..to as usize].fill(0xff);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        check_write(self, offset, bytes.len())?;
        for (at, byte) in self.0[offset as usize..].iter_mut().zip(bytes) {
            // Flash can only clear bits.
            assert_eq!(*at & byte, *byte, "written without an erase");
            *at = *byte;
        }
        Ok(())
    }
}
