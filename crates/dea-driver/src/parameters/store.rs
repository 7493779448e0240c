//! Parameters that survive a power loss: two slots of flash, the newest valid one wins.
//!
//! The blob is written first, the slot's header, a sequence number and its complement, last. The power may fail at any byte:
//! until the header is complete, the slot does not count, and the other one is untouched. The contents of a slot are
//! checked by the blob's own checksum.
//!
//! An erased slot does not show that it held a newer set. So both slots are in use from the first save on, and a set that is
//! alone shows it.

use core::fmt;
use core::marker::PhantomData;

use embedded_storage::nor_flash::{NorFlash, NorFlashError, NorFlashErrorKind};
use springpot::Compressed;

use crate::chips::Converters;
use crate::parameters::{BLOB_LEN, Blob, BlobError, ControllerMemory, Parameters};

/// Bytes before the blob: sequence number and its complement.
const HEADER: usize = 8;
/// Bytes of a slot.
const SLOT: usize = HEADER + BLOB_LEN;
/// The sequence number of the first set of earlier versions, which wrote it to the first slot alone. No other set gets it.
const ALONE: u32 = 1;

/// Two slots in a flash of two erasable parts, for parameters of a law with the memory `M`.
///
/// ```
/// # use dea_driver::RamFlash;
/// use dea_driver::{BLOB_LEN, Parameters, Store, StoreError};
/// # use springpot::{Actuator, Law, LawOptions, Preset};
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// # let flash = RamFlash::default();
/// # let law: Law<f32> = Law::compressed(&Preset::TABLE3_N2.model()?, LawOptions::at_step(1e-3))?;
/// # let parameters = Parameters::bench(&law, Actuator::KARNER_2022);
/// # let mut bytes = [0; BLOB_LEN];
/// # let length = parameters.encode(7, &mut bytes)?;
/// // `flash` is a NorFlash, `bytes` a blob for board 7.
/// let mut store = Store::new(flash, 7).expect("room for two slots");
/// assert!(matches!(store.load(), Err(StoreError::Empty(None))));
/// store.save(&bytes[..length]).expect("valid");
/// let stored = store.load().expect("saved");
/// assert_eq!((stored.blob.parameters(), stored.newer_lost), (&parameters, false));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Store<F, M: ControllerMemory = Compressed<f32>> {
    flash: F,
    board: u16,
    converters: Converters,
    slot_bytes: u32,
    memory: PhantomData<M>,
}

/// Parameters as they were found.
#[derive(Clone, Debug)]
pub struct Stored<M: ControllerMemory = Compressed<f32>> {
    /// The newest valid set.
    pub blob: Blob<M>,
    /// Whether a newer set was damaged, or cut off while it was saved. The loaded set may allow more.
    pub newer_lost: bool,
}

/// Why the store failed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum StoreError {
    /// The flash does not have two erasable parts that hold a slot, or has words that do not divide eight bytes.
    #[error(
        "the flash has no two parts that can be erased and hold {SLOT} bytes each, or has words that do not divide 8 bytes"
    )]
    Geometry,
    /// The flash failed.
    #[error("the flash failed: {0}")]
    Flash(NorFlashErrorKind),
    /// No slot holds valid parameters; the fault of the newest slot, if one was ever written, [`BlobError::Truncated`] where a save
    /// that was cut off has left no more than a part of one.
    #[error(fmt = no_parameters)]
    Empty(Option<BlobError>),
    /// The blob to be written was refused.
    #[error("the blob is not stored: {0}")]
    Refused(BlobError),
}

#[allow(clippy::ref_option, clippy::trivially_copy_pass_by_ref)] // as the derive passes it
fn no_parameters(fault: &Option<BlobError>, text: &mut fmt::Formatter) -> fmt::Result {
    text.write_str("no parameters are stored")?;
    fault.map_or(Ok(()), |fault| write!(text, " that can be read: {fault}"))
}

impl<F: NorFlash> Store<F> {
    /// A store in the first two equal parts of `flash`, each a whole number of its erasable parts, for a `board` with
    /// [its converters](Converters::of_board).
    ///
    /// # Errors
    ///
    /// [`StoreError::Geometry`] for a flash that cannot hold two slots.
    pub fn new(flash: F, board: u16) -> Result<Self, StoreError> {
        Self::with_converters(flash, board, Converters::of_board(board))
    }
}

impl<F: NorFlash, M: ControllerMemory> Store<F, M> {
    /// The same for a board with other `converters`, or a law with another memory.
    #[allow(clippy::missing_errors_doc)] // as the one above
    pub fn with_converters(flash: F, board: u16, converters: Converters) -> Result<Self, StoreError> {
        let half = flash.capacity() / 2;
        let slot = half - half % F::ERASE_SIZE.max(1);
        let words = |size: usize| size > 0 && HEADER.is_multiple_of(size) && BLOB_LEN.is_multiple_of(size);
        let slot_bytes = u32::try_from(slot).map_err(|_| StoreError::Geometry)?;
        if slot < SLOT || !words(F::WRITE_SIZE) || !words(F::READ_SIZE) {
            return Err(StoreError::Geometry);
        }
        Ok(Self { flash, board, converters, slot_bytes, memory: PhantomData })
    }

    /// Checks a blob for this board.
    ///
    /// # Errors
    ///
    /// [`StoreError::Refused`].
    pub fn decode(&self, bytes: &[u8]) -> Result<Blob<M>, StoreError> {
        Blob::decode_for(bytes, self.board, &self.converters).map_err(StoreError::Refused)
    }

    /// Writes the blob of `parameters` for this board to `bytes` and returns its length.
    ///
    /// # Errors
    ///
    /// [`StoreError::Refused`].
    pub fn encode(&self, parameters: &Parameters<M>, bytes: &mut [u8]) -> Result<usize, StoreError> {
        parameters.encode_for(self.board, &self.converters, bytes).map_err(StoreError::Refused)
    }

    /// The newest valid parameters, and whether there were newer ones.
    ///
    /// # Errors
    ///
    /// [`StoreError::Empty`] where no slot holds any, [`StoreError::Flash`].
    pub fn load(&mut self) -> Result<Stored<M>, StoreError> {
        let mut fault = None;
        let slots = self.newest_first()?;
        for slot in slots.into_iter().flatten() {
            match self.read(slot.index) {
                Ok(blob) => {
                    let alone = slots.iter().flatten().count() == 1;
                    let cut_off = alone && !self.is_first_of_earlier_versions(slot)?;
                    return Ok(Stored { blob, newer_lost: fault.is_some() || cut_off });
                }
                Err(StoreError::Refused(error)) => fault = fault.or(Some(error)),
                Err(error) => return Err(error),
            }
        }
        // A save that was cut off may have left no header, which is not the same as flash that was never written.
        if fault.is_none() && !(self.is_erased(0)? && self.is_erased(1)?) {
            fault = Some(BlobError::Truncated);
        }
        Err(StoreError::Empty(fault))
    }

    /// Whether `slot` was written by an earlier version as the first set ever, so that nothing is missing beside it.
    fn is_first_of_earlier_versions(&mut self, slot: Slot) -> Result<bool, StoreError> {
        Ok(slot.sequence == ALONE && slot.index == 0 && self.is_erased(1)?)
    }

    /// Writes the blob `bytes` to the slot that does not hold the newest valid parameters, and reads it back; to the other one as
    /// well if that holds no set, or the first one of an earlier version.
    ///
    /// # Errors
    ///
    /// [`StoreError::Refused`] for a blob that a controller would refuse; nothing is written then.
    pub fn save(&mut self, bytes: &[u8]) -> Result<Blob<M>, StoreError> {
        self.decode(bytes)?;
        let slots = self.newest_first()?;
        let valid = slots.into_iter().flatten().find(|slot| self.read(slot.index).is_ok());
        // Refused sets, such as those of an earlier schema, are older than the one saved now.
        let newest = slots.into_iter().flatten().next();
        let sequence = newest.map_or(ALONE + 1, Slot::next);
        let index = match valid.or(newest) {
            // Its number does not show that a newer set was beside it. What is left of that one does, and stays until this save is
            // complete.
            Some(slot) if slot.sequence == ALONE && !self.is_first_of_earlier_versions(slot)? => slot.index,
            Some(slot) => 1 - slot.index,
            None => 0,
        };
        let blob = self.write(Slot { index, sequence }, bytes)?;
        // As it was read above, not as it reads now: where no header was found there may be one whose bits are unstable, of any number.
        let beside = slots.into_iter().flatten().find(|slot| slot.index != index);
        if beside.is_none_or(|slot| slot.sequence == ALONE) {
            let copy = Slot { index, sequence }.next();
            self.write(Slot { index: 1 - index, sequence: copy }, bytes)?;
        }
        Ok(blob)
    }

    /// Writes a slot and reads it back.
    fn write(&mut self, slot: Slot, bytes: &[u8]) -> Result<Blob<M>, StoreError> {
        let start = self.start_of(slot.index);
        let mut body = [0xff; BLOB_LEN];
        body.iter_mut().zip(bytes).for_each(|(place, byte)| *place = *byte);
        let mut header = [0; HEADER];
        header[..4].copy_from_slice(&slot.sequence.to_le_bytes());
        header[4..].copy_from_slice(&(!slot.sequence).to_le_bytes());
        let failed = |error: F::Error| StoreError::Flash(error.kind());
        self.erase(slot.index)?;
        #[allow(clippy::cast_possible_truncation)] // eight
        self.flash.write(start + HEADER as u32, &body).map_err(failed)?;
        self.flash.write(start, &header).map_err(failed)?;
        // It was valid before it was written, so the flash failed.
        self.read(slot.index).map_err(|_| StoreError::Flash(NorFlashErrorKind::Other))
    }

    /// Returns the flash.
    pub fn destroy(self) -> F {
        self.flash
    }

    fn start_of(&self, index: u32) -> u32 {
        index * self.slot_bytes
    }

    /// Slots with a complete header, newest first.
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

    fn erase(&mut self, index: u32) -> Result<(), StoreError> {
        let start = self.start_of(index);
        self.flash.erase(start, start + self.slot_bytes).map_err(|error| StoreError::Flash(error.kind()))
    }

    fn is_erased(&mut self, index: u32) -> Result<bool, StoreError> {
        let mut bytes = [0; SLOT];
        self.flash.read(self.start_of(index), &mut bytes).map_err(|error| StoreError::Flash(error.kind()))?;
        Ok(bytes.iter().all(|&byte| byte == 0xff))
    }

    fn read(&mut self, index: u32) -> Result<Blob<M>, StoreError> {
        let mut body = [0; BLOB_LEN];
        #[allow(clippy::cast_possible_truncation)] // eight
        let start = self.start_of(index) + HEADER as u32;
        self.flash.read(start, &mut body).map_err(|error| StoreError::Flash(error.kind()))?;
        self.decode(&body)
    }
}

#[derive(Clone, Copy)]
struct Slot {
    index: u32,
    sequence: u32,
}

impl Slot {
    /// The sequence number of the set after this one.
    fn next(self) -> u32 {
        self.sequence.wrapping_add(1).max(ALONE + 1)
    }
}
