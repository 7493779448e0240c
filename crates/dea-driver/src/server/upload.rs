//! A parameter blob that arrives in pieces.

use crate::parameters::BLOB_LEN;
use crate::wire::Reject;

/// Collects an upload, piece by piece in order.
#[derive(Clone, Debug)]
pub struct Upload {
    bytes: [u8; BLOB_LEN],
    length: usize,
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
    /// [`Reject::Upload`] where it does not follow the last piece or exceeds a blob.
    pub fn push(&mut self, offset: usize, piece: &[u8]) -> Result<(), Reject> {
        if offset == 0 {
            self.length = 0;
        }
        if offset != self.length {
            return Err(Reject::Upload);
        }
        let end = offset + piece.len();
        self.bytes.get_mut(offset..end).ok_or(Reject::Upload)?.copy_from_slice(piece);
        self.length = end;
        Ok(())
    }

    /// The room for a blob; discards the upload.
    pub fn room(&mut self) -> &mut [u8; BLOB_LEN] {
        self.length = 0;
        &mut self.bytes
    }

    /// The complete upload, which must be `length` bytes; the next piece begins a new one.
    ///
    /// # Errors
    ///
    /// [`Reject::Upload`].
    pub fn finish(&mut self, length: usize) -> Result<&[u8], Reject> {
        let received = core::mem::take(&mut self.length);
        if length == 0 || received != length { Err(Reject::Upload) } else { Ok(&self.bytes[..length]) }
    }
}
