//! The program in its flash, compared with itself at the start.

/// Words of a step.
const STEP: usize = 256;

/// The sum of a program's image at the start, and the progress of a check.
///
/// ```
/// use dea_driver::server::Image;
///
/// let mut words = vec![0x1234_5678; 10_000];
/// let mut image = Image::new(&words);
/// assert!((0..1000).all(|_| image.is_intact(&words)));
/// words[4711] ^= 1 << 20;
/// assert!(!(0..40).all(|_| image.is_intact(&words)));
/// ```
#[derive(Clone, Debug)]
pub struct Image {
    at_start: u32,
    next: usize,
    sum: u32,
}

impl Image {
    /// The image of `words` as they are now.
    #[must_use]
    pub fn new(words: &[u32]) -> Self {
        Self { at_start: sum(0, words), next: 0, sum: 0 }
    }

    /// Checks a further kilobyte of the same `words`; false if a pass over all of them has ended with another sum than at the start.
    pub fn is_intact(&mut self, words: &[u32]) -> bool {
        let rest = words.get(self.next..).unwrap_or_default();
        let (step, rest) = rest.split_at(rest.len().min(STEP));
        self.sum = sum(self.sum, step);
        self.next += step.len();
        if !rest.is_empty() {
            return true;
        }
        self.next = 0;
        core::mem::take(&mut self.sum) == self.at_start
    }
}

/// A bit that flips changes the sum, whichever it is. The words are read from their memory each time.
fn sum(before: u32, words: &[u32]) -> u32 {
    words.iter().fold(before, |sum, &word| sum.rotate_left(5) ^ core::hint::black_box(word))
}
