//! A parameter blob that arrives in pieces.

use crate::parameters::BLOB_LEN;

/// Collects an upload, piece by piece in order.
#[derive(Clone, Debug)]
pub struct Upload {
    bytes: [u8; BLOB_LEN],
    length: usize,
}

/// Why a piece or an upload was not taken. The upload begins again with offset 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum UploadError {
    /// The piece does not follow the last one.
    Gap,
    /// The upload is longer than a blob can be.
    TooLong,
    /// The upload has another length than was said.
    Length,
}

impl Default for Upload {
    fn default() -> Self {
        Self::new()
    }
}

impl Upload {
    /// Nothing yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { bytes: [0; BLOB_LEN], length: 0 }
    }

    /// Takes in the piece that belongs at `offset`; offset 0 begins anew.
    ///
    /// # Errors
    ///
    /// [`UploadError`] where it does not follow the last piece or exceeds a blob.
    pub fn take(&mut self, offset: usize, piece: &[u8]) -> Result<(), UploadError> {
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

    /// The whole upload, which should be `length` bytes; the next one begins anew.
    ///
    /// # Errors
    ///
    /// [`UploadError::Length`].
    pub fn finish(&mut self, length: usize) -> Result<&[u8], UploadError> {
        let received = core::mem::take(&mut self.length);
        if length == 0 || received != length { Err(UploadError::Length) } else { Ok(&self.bytes[..length]) }
    }
}
