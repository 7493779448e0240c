//! A digest of values in memory.

use postcard::ser_flavors::Flavor;
use serde::Serialize;
use springpot::Numbers;

/// Rotates and adds: a bit that flips changes the digest, whichever it is.
pub(crate) struct Fold(u32);

impl Fold {
    fn push(&mut self, word: u32) {
        self.0 = self.0.rotate_left(5) ^ word;
    }
}

impl Flavor for Fold {
    type Output = u32;

    fn try_push(&mut self, data: u8) -> postcard::Result<()> {
        self.push(data.into());
        Ok(())
    }

    fn try_extend(&mut self, data: &[u8]) -> postcard::Result<()> {
        let (words, rest) = data.as_chunks();
        for &word in words {
            self.push(u32::from_le_bytes(word));
        }
        for &byte in rest {
            self.push(byte.into());
        }
        Ok(())
    }

    fn finalize(self) -> postcard::Result<u32> {
        Ok(self.0)
    }
}

impl Numbers<f32> for Fold {
    fn number(&mut self, _name: &'static str, value: f32, _about: &'static str) {
        self.push(value.to_bits());
    }

    fn count(&mut self, _name: &'static str, value: u32, _about: &'static str) {
        self.push(value);
    }
}

/// The digest of the numbers that `visit` visits.
pub(crate) fn digest_of(visit: impl FnOnce(&mut Fold)) -> u32 {
    let mut fold = Fold(!0);
    visit(&mut fold);
    fold.0
}

/// The digest of the serialised `value`.
#[inline(never)]
pub(crate) fn digest(value: &impl Serialize) -> u32 {
    // Nothing in memory fails to be written.
    postcard::serialize_with_flavor(value, Fold(!0)).unwrap_or_default()
}
