//! The mean current of the film in each tick, from a converter that nothing else uses: it converts all the time, and a DMA puts its codes into a ring.

use core::cell::UnsafeCell;
use core::mem::replace;

/// Codes in the ring: more than the 875 of a tick of 4 ms, below which the film cannot be its own sensor.
pub const LEN: usize = 1024;
/// Codes of the converter.
const CODES: f32 = 4096.0;
/// Weight of a tick in the level.
const WEIGHT: f32 = 1.0 / 64.0;
/// Largest share by which the codes of a tick may be more or fewer than its time has.
const MAX_OFF: f32 = 0.25;

/// Codes that the DMA writes and the ticks read.
pub struct Ring(UnsafeCell<[u16; LEN]>);

/// The ring: the DMA has its address.
pub static RING: Ring = Ring(UnsafeCell::new([0; LEN]));

// SAFETY: codes are read one by one, each of which the DMA writes at once.
unsafe impl Sync for Ring {}

impl Ring {
    /// Where it begins.
    pub const fn start(&self) -> *mut u16 {
        self.0.get().cast()
    }

    /// The code at an index, which is taken within the ring.
    fn code(&self, index: usize) -> u32 {
        // SAFETY: the index is within the array; the DMA writes it at any time.
        unsafe { self.start().add(index % LEN).read_volatile() }.into()
    }
}

/// Registers of the converter and its DMA.
pub trait Converter {
    /// Codes in a second.
    fn codes_per_s(&self) -> f32;
    /// Sets both up: the first code goes to the begin of the ring.
    fn set(&self);
    /// Codes that the DMA has left until the ring begins again; none if anything is not as it was set, or codes were lost.
    fn left(&self) -> Option<usize>;
}

/// The mean of each tick.
pub struct Current<C> {
    converter: C,
    /// Where the DMA was in the tick before.
    from: Option<usize>,
    /// Mean code of the ticks before; NaN before the first.
    level: f32,
}

impl<C: Converter> Current<C> {
    pub const fn new(converter: C) -> Self {
        Self { converter, from: None, level: f32::NAN }
    }

    /// The mean since the last call, in one of `rate_hz` (Hz), as a share of the supply. None in the first tick, and if the converter or its DMA has
    /// stopped, lost codes or its settings, or the tick was late: then both are set up again.
    ///
    /// Behind the filter at its pin the current of a step is a peak, whose sum is its charge, and the number of codes changes by one from tick to tick, with
    /// the tone. So what is above the level is divided by the number that the time of a tick has, which is a fraction.
    pub fn mean(&mut self, rate_hz: f32) -> Option<f32> {
        let wanted = self.converter.codes_per_s() / rate_hz;
        let to = self.converter.left().map(|left| LEN - left);
        let (from, is_set) = (replace(&mut self.from, to), to.is_some());
        let count = from.zip(to).map(|(from, to)| (LEN + to - from) % LEN);
        let fits = count.is_none_or(|count| (count as f32 - wanted).abs() <= MAX_OFF * wanted);
        if !is_set || !fits {
            self.converter.set();
            self.from = None;
            return None;
        }
        let (from, count) = (from?, count?);
        let sum: u32 = (from..from + count).map(|index| RING.code(index)).sum();
        let (sum, count) = (sum as f32, count as f32);
        let level = if self.level.is_nan() { sum / count } else { self.level };
        let mean = level + (sum - count * level) / wanted;
        self.level = level + WEIGHT * (mean - level);
        Some(mean / CODES)
    }
}
