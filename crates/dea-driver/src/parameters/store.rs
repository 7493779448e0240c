//! Parameters that outlive a power loss: two slots of flash, the newest valid one wins.
//!
//! A slot is written from its second word on, and its first words, a sequence number and its complement, last. Power may go
//! at any byte: until the last word stands, the slot does not count, and the other one is untouched. What a slot holds is
//! checked by the blob's own checksum.

use embedded_storage::nor_flash::{NorFlash, NorFlashError, NorFlashErrorKind};

use crate::parameters::{BLOB_LEN, Blob, BlobError};

/// Bytes before the blob: sequence number and its complement.
const HEADER: usize = 8;
/// Bytes of a slot.
const SLOT: usize = HEADER + BLOB_LEN;

/// Two slots in a flash of two erasable parts.
pub struct Store<F> {
    flash: F,
    board: u16,
    slot_bytes: u32,
}

/// Why the store could not do as asked.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum StoreError {
    /// The flash has no two erasable parts that hold a slot, or writes in words of more than eight bytes.
    Geometry,
    /// The flash failed.
    Flash(NorFlashErrorKind),
    /// There are no valid parameters; the newest slot's fault, if one was ever written.
    Empty(Option<BlobError>),
    /// The blob to be written was refused.
    Refused(BlobError),
}

impl<F: NorFlash> Store<F> {
    /// A store in the first two equal parts of `flash`, each a whole number of its erasable parts.
    ///
    /// # Errors
    ///
    /// [`StoreError::Geometry`] for a flash that cannot hold two slots.
    pub fn new(flash: F, board: u16) -> Result<Self, StoreError> {
        let half = flash.capacity() / 2;
        let slot = half - half % F::ERASE_SIZE.max(1);
        let words = |size: usize| size > 0 && HEADER.is_multiple_of(size) && BLOB_LEN.is_multiple_of(size);
        let slot_bytes = u32::try_from(slot).map_err(|_| StoreError::Geometry)?;
        if slot < SLOT || !words(F::WRITE_SIZE) || !words(F::READ_SIZE) {
            return Err(StoreError::Geometry);
        }
        Ok(Self { flash, board, slot_bytes })
    }

    /// The newest valid parameters.
    ///
    /// # Errors
    ///
    /// [`StoreError::Empty`] where no slot holds any, [`StoreError::Flash`].
    pub fn load(&mut self) -> Result<Blob, StoreError> {
        let mut fault = None;
        for slot in self.newest_first()?.into_iter().flatten() {
            match self.read(slot.index) {
                Ok(blob) => return Ok(blob),
                Err(StoreError::Refused(error)) => fault = fault.or(Some(error)),
                Err(error) => return Err(error),
            }
        }
        Err(StoreError::Empty(fault))
    }

    /// Writes the blob `bytes` to the slot that does not hold the newest valid parameters, and reads it back.
    ///
    /// # Errors
    ///
    /// [`StoreError::Refused`] for a blob that a controller would refuse; nothing is written then.
    pub fn save(&mut self, bytes: &[u8]) -> Result<Blob, StoreError> {
        Blob::decode(bytes, self.board).map_err(StoreError::Refused)?;
        let slots = self.newest_first()?;
        let valid = slots.into_iter().flatten().find(|slot| self.read(slot.index).is_ok());
        let (index, sequence) = valid.map_or((0, 1), |slot| (1 - slot.index, slot.sequence.wrapping_add(1).max(1)));

        let start = self.start_of(index);
        let mut body = [0xff; BLOB_LEN];
        body.iter_mut().zip(bytes).for_each(|(slot, byte)| *slot = *byte);
        let mut header = [0; HEADER];
        header[..4].copy_from_slice(&sequence.to_le_bytes());
        header[4..].copy_from_slice(&(!sequence).to_le_bytes());
        let failed = |error: F::Error| StoreError::Flash(error.kind());
        self.flash.erase(start, start + self.slot_bytes).map_err(failed)?;
        #[allow(clippy::cast_possible_truncation)] // eight
        self.flash.write(start + HEADER as u32, &body).map_err(failed)?;
        self.flash.write(start, &header).map_err(failed)?;
        // It was valid when it was written: if it is not now, the flash did not take it.
        self.read(index).map_err(|_| StoreError::Flash(NorFlashErrorKind::Other))
    }

    /// Gives the flash back.
    pub fn destroy(self) -> F {
        self.flash
    }

    fn start_of(&self, index: u32) -> u32 {
        index * self.slot_bytes
    }

    /// Slots whose header stands, newest first.
    fn newest_first(&mut self) -> Result<[Option<Slot>; 2], StoreError> {
        let slots = [self.header(0)?, self.header(1)?];
        Ok(match slots {
            // Sequence numbers may wrap: the newer one is ahead by less than half of all.
            [Some(first), Some(second)] if second.sequence.wrapping_sub(first.sequence) < 1 << 31 => {
                [Some(second), Some(first)]
            }
            other => other,
        })
    }

    fn header(&mut self, index: u32) -> Result<Option<Slot>, StoreError> {
        let mut bytes = [0; HEADER];
        self.flash.read(self.start_of(index), &mut bytes).map_err(|error| StoreError::Flash(error.kind()))?;
        let (words, _) = bytes.as_chunks::<4>();
        let [sequence, complement] = [words[0], words[1]].map(u32::from_le_bytes);
        Ok((sequence == !complement).then_some(Slot { index, sequence }))
    }

    fn read(&mut self, index: u32) -> Result<Blob, StoreError> {
        let mut body = [0; BLOB_LEN];
        #[allow(clippy::cast_possible_truncation)] // eight
        let start = self.start_of(index) + HEADER as u32;
        self.flash.read(start, &mut body).map_err(|error| StoreError::Flash(error.kind()))?;
        Blob::decode(&body, self.board).map_err(StoreError::Refused)
    }
}

#[derive(Clone, Copy)]
struct Slot {
    index: u32,
    sequence: u32,
}
