//! A parameter blob that arrives in pieces.

use crate::parameters::BLOB_LEN;

/// Collects an upload, piece by piece in order.
#[derive(Clone, Debug)]
pub struct Upload {
    bytes: [u8; BLOB_LEN],
    length: usize,
}

/// Why a piece or an upload was refused. Offset 0 begins a new upload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum UploadError {
    /// The piece does not follow the last one.
    Gap,
    /// The upload is longer than a blob can be.
    TooLong,
    /// The upload has another length than stated.
    Length,
}

impl Default for Upload {
    fn default() -> Self {
        Self::new()
    }
}

impl Upload {
    /// Empty.
    #[must_use]
    pub const fn new() -> Self {
        Self { bytes: [0; BLOB_LEN], length: 0 }
    }

    /// Adds the piece at `offset`; offset 0 begins a new upload.
    ///
    /// # Errors
    ///
    /// [`UploadError`] where it does not follow the last piece or exceeds a blob.
    pub fn push(&mut self, offset: usize, piece: &[u8]) -> Result<(), UploadError> {
        if offset == 0 {
            self.length = 0;
        }
        if offset != self.length {
            return Err(UploadError::Gap);
        }
        let end = offset + piece.len();
        self.bytes.get_mut(offset..end).ok_or(UploadError::TooLong)?.copy_from_slice(piece);
        self.length = end;
        Ok(())
    }

    /// The complete upload, which must be `length` bytes; the next piece begins a new one.
    ///
    /// # Errors
    ///
    /// [`UploadError::Length`].
    pub fn finish(&mut self, length: usize) -> Result<&[u8], UploadError> {
        let received = core::mem::take(&mut self.length);
        if length == 0 || received != length { Err(UploadError::Length) } else { Ok(&self.bytes[..length]) }
    }
}
