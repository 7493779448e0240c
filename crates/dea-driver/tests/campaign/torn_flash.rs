//! A simulated NOR flash whose power fails in the middle of an erase or of a write.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use crate::board::SECTOR;

const WORD: usize = 4;
const ERASED: u32 = u32::MAX;

#[derive(Clone, Copy, Debug, PartialEq)]
struct Word {
    value: u32,
    /// Bits that read otherwise from time to time, until they are erased again.
    unstable: u32,
}

/// Two erasable parts. The power fails after a number of operations: an erase is one, and so is every word that is written.
///
/// What is left behind is what data sheets of NOR flash leave open. Of a part that was being erased every word is erased, as it was,
/// or unstable. Of a word that was being written some bits are programmed, some are not, and some are unstable.
#[derive(Clone, Debug)]
pub struct TornFlash {
    words: Vec<Word>,
    operations_left: Option<u64>,
    has_power: bool,
    random: Pcg64,
}

/// The power has failed, or the flash was used in a way that it does not support.
#[derive(Debug)]
pub struct Failed(NorFlashErrorKind);

impl NorFlashError for Failed {
    fn kind(&self) -> NorFlashErrorKind {
        self.0
    }
}

impl TornFlash {
    pub fn new(bytes: &[u8], seed: u64) -> Self {
        assert_eq!(bytes.len(), 2 * SECTOR);
        let (words, _) = bytes.as_chunks::<WORD>();
        let words = words.iter().map(|&word| Word { value: u32::from_le_bytes(word), unstable: 0 }).collect();
        Self { words, operations_left: None, has_power: true, random: Pcg64::seed_from_u64(seed) }
    }

    /// Lets the power fail in the operation after `operations` more.
    pub fn fail_after(&mut self, operations: u64) {
        self.operations_left = Some(operations);
    }

    /// The power returns, and stays.
    pub fn restart(&mut self) {
        self.has_power = true;
        self.operations_left = None;
    }

    pub fn has_power(&self) -> bool {
        self.has_power
    }

    /// A bit of one of the parts flips for good.
    pub fn flip(&mut self, part: usize, bit: usize) {
        self.words[part * SECTOR / WORD + bit / 32].value ^= 1 << (bit % 32);
    }

    /// Counts an operation; false in the one in which the power fails.
    fn spend(&mut self) -> Result<bool, Failed> {
        if !self.has_power {
            return Err(Failed(NorFlashErrorKind::Other));
        }
        match &mut self.operations_left {
            Some(0) => self.has_power = false,
            Some(left) => *left -= 1,
            None => {}
        }
        Ok(self.has_power)
    }

    fn tear_erase(&mut self, words: core::ops::Range<usize>) {
        // How far it came, from not at all to next to the end, and how the rest divides.
        let [erased, untouched]: [f64; 2] = match self.random.random_range(0..6) {
            0 => [1.0, 0.0],
            1 => [0.0, 1.0],
            2 => [0.99, 0.0],
            3 => [0.0, 0.99],
            _ => {
                let erased: f64 = self.random.random();
                [erased, self.random.random_range(0.0..=1.0 - erased)]
            }
        };
        let noisy = self.random.random_bool(0.3);
        for index in words {
            let draw: f64 = self.random.random();
            let word = &mut self.words[index];
            if draw < erased {
                *word = Word { value: ERASED, unstable: 0 };
            } else if draw >= erased + untouched {
                // Bits on their way to 1; or a word of which nothing is known.
                word.unstable = if noisy { ERASED } else { !word.value | word.unstable };
            }
        }
    }

    fn tear_write(&mut self, index: usize, value: u32) {
        let programmed: u32 = self.random.random();
        let unstable: u32 = self.random.random();
        let word = &mut self.words[index];
        let cleared = !value;
        word.value &= !(cleared & programmed);
        word.unstable |= cleared & unstable;
    }
}

impl ErrorType for TornFlash {
    type Error = Failed;
}

impl ReadNorFlash for TornFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Failed> {
        check_read(self, offset, bytes.len()).map_err(Failed)?;
        if !self.has_power {
            return Err(Failed(NorFlashErrorKind::Other));
        }
        let mut held = None;
        for (at, byte) in (offset as usize..).zip(bytes) {
            let index = at / WORD;
            let word = match held {
                Some((of, word)) if of == index => word,
                _ => {
                    let Word { value, unstable } = self.words[index];
                    let noise: u32 = if unstable == 0 { 0 } else { self.random.random() };
                    (value ^ (noise & unstable)).to_le_bytes()
                }
            };
            held = Some((index, word));
            *byte = word[at % WORD];
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.words.len() * WORD
    }
}

impl NorFlash for TornFlash {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Failed> {
        check_erase(self, from, to).map_err(Failed)?;
        let words = from as usize / WORD..to as usize / WORD;
        if !self.spend()? {
            self.tear_erase(words);
            return Err(Failed(NorFlashErrorKind::Other));
        }
        self.words[words].fill(Word { value: ERASED, unstable: 0 });
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Failed> {
        check_write(self, offset, bytes.len()).map_err(Failed)?;
        let (words, _) = bytes.as_chunks::<WORD>();
        for (index, word) in (offset as usize / WORD..).zip(words) {
            let value = u32::from_le_bytes(*word);
            let erased = Word { value: ERASED, unstable: 0 };
            assert_eq!(self.words[index], erased, "word {index} is written without having been erased");
            if !self.spend()? {
                self.tear_write(index, value);
                return Err(Failed(NorFlashErrorKind::Other));
            }
            self.words[index].value = value;
        }
        Ok(())
    }
}
