//! How a sensor moves beside the film's model.

use crate::safety::PlausibilityLimits;

/// Blocks in `stuck_ticks`, and in the time over which a film is compared with its model.
const BLOCKS: u8 = 10;
/// A sensor is still if the model moves by this many times as far, and by more than this many bands.
const MOVES: f32 = 5.0;
/// And by more than this share of its displacement: a film that is held while the voltage changes differs from its model by less.
const MOVES_SHARE: f32 = 0.04;
/// How far a model counts, in ranges of its drive.
const BY_DRIVE: f32 = 2.0;
/// Lag in blocks behind which a drive still moves its model, as by creep.
const LAG_BLOCKS: f32 = 20.0;
/// Bands by which the model moves while a sensor that moves by half of that shows a film.
const MOVES_ALONG: f32 = 10.0;
/// Bands of displacement from which the model shows how soft the film is.
const SHOWS: f32 = 25.0;
/// Softest film beside its model.
const MAX_SOFTNESS: f32 = 4.0;
/// Softness that a film is presumed to have, until so many blocks have shown it.
const PRESUMED: f32 = 1.15;
const PRESUMED_BLOCKS: u8 = 10;

/// Compares a displacement sensor with the model under the commanded voltage alone: whether the sensor is frozen, and how much further the
/// film goes than its model.
///
/// Both are averaged over blocks of a tenth of `stuck_ticks`, so that neither the noise of a converter nor that of a whole sensor hides a
/// frozen one.
///
/// **Frozen**: within ten blocks the model has moved by more than five bands and a 25th of its displacement, and two blocks later, in which
/// a late sensor would have followed, the sensor by less than a fifth of that. This ends when the sensor moves. The comparison restarts
/// after ten blocks, so that creep does not count. The model's motion counts up to twice what its drive explains, directly or behind a lag
/// of twenty blocks, so that the swing of a model with too little damping does not count. Where the film need not follow, since voltages
/// may be played without one, a sensor is frozen only after it has moved by half of what the model does since the last
/// [`reset`](Self::reset).
///
/// **Softness**: the largest ratio of the film's displacement to its model's in this run, averaged over ten blocks, while the model was
/// within the upper half of its largest such mean; 1 at least. It does not decrease, since a sensor that fails slowly makes a film seem
/// stiffer. With another law than the fitted one a film is [presumed](Self::presume_softer) to be softer until the sensor has shown it for
/// ten blocks.
///
/// **Offset**: the sensor minus its model at 0 V before the run: creep from before a reset, for example.
///
/// ```
/// use dea_driver::{Limits, Motion};
///
/// let mut motion = Motion::new(Limits::bench(160e-6).sensor);
/// motion.record(0.1e-3, 0.0, || 0.0, true, false);
/// motion.begin_run();
/// // A film that goes a third further than its model, from 0.1 mm on.
/// for tick in 0..2000_u16 {
///     let model_m = 0.5e-6 * f32::from(tick);
///     motion.record(0.1e-3 + 4.0 / 3.0 * model_m, model_m, || model_m, true, true);
/// }
/// assert!(!motion.is_frozen(true) && (motion.furthest(1e-3) / 1.43e-3 - 1.0).abs() < 0.02);
/// ```
#[derive(Clone, Copy, Debug)]
#[allow(clippy::struct_excessive_bools)] // no two of them are one state
pub struct Motion {
    band_m: f32,
    block_ticks: u32,
    /// Ticks of this block, sums of sensor and model (m), and whether a value was implausible.
    ticks: u32,
    sums: [f32; 2],
    is_spoiled: bool,
    /// Blocks of this window, and the lowest and highest of sensor, model, drive, and drive behind a lag, m.
    blocks: u8,
    low: [f32; 4],
    high: [f32; 4],
    /// Drive behind a lag, m; NaN before the first block of a run.
    lagged_m: f32,
    /// How far the model had moved one and two blocks ago, as far as its drive explains it, m.
    before: [f32; 2],
    is_still: bool,
    has_moved: bool,
    /// Slow means of sensor and model in this run, and the largest of the model, m.
    means: [f32; 2],
    peak_m: f32,
    softness: f32,
    min_softness: f32,
    /// Blocks that still have to show the film in this run, the softness that they show, and whether the film is presumed softer with the next plausible one.
    unshown: u8,
    shown: f32,
    presumes: bool,
    /// NaN until it is known.
    offset_m: f32,
}

impl Motion {
    /// A comparison without values.
    #[must_use]
    pub const fn new(limits: PlausibilityLimits) -> Self {
        Self::in_blocks(limits.stuck_band, limits.stuck_ticks.div_ceil(BLOCKS as u32))
    }

    const fn in_blocks(band_m: f32, block_ticks: u32) -> Self {
        Self {
            band_m,
            block_ticks,
            ticks: 0,
            sums: [0.0; 2],
            is_spoiled: false,
            blocks: 0,
            low: [0.0; 4],
            high: [0.0; 4],
            lagged_m: f32::NAN,
            before: [0.0; 2],
            is_still: false,
            has_moved: false,
            means: [0.0; 2],
            peak_m: 0.0,
            softness: 1.0,
            min_softness: 1.0,
            unshown: PRESUMED_BLOCKS,
            shown: 1.0,
            presumes: false,
            offset_m: f32::NAN,
        }
    }

    /// The constants, for a check of the memory.
    #[cfg(feature = "link")]
    pub(crate) fn constants(&self) -> (f32, u32, f32) {
        (self.band_m, self.block_ticks, self.min_softness)
    }

    /// Whether the softness is within its bounds: a smaller one would hide the stroke.
    #[cfg(feature = "link")]
    pub(crate) fn is_sound(&self) -> bool {
        (self.min_softness..=MAX_SOFTNESS).contains(&self.softness)
    }

    /// Starts again, except for the offset: creep stays.
    pub fn reset(&mut self) {
        let new = Self::in_blocks(self.band_m, self.block_ticks).beyond_by(self.min_softness - 1.0);
        *self = new.offset_by(self.offset_m);
    }

    /// The same for a model that may be behind its film by this `share` of its displacement.
    #[must_use]
    pub const fn beyond_by(self, share: f32) -> Self {
        Self { softness: 1.0 + share, shown: 1.0 + share, min_softness: 1.0 + share, ..self }
    }

    /// The same with an offset of `offset_m` (m), until a plausible sensor shows the film.
    #[must_use]
    pub const fn offset_by(self, offset_m: f32) -> Self {
        Self { offset_m, ..self }
    }

    /// The same with the offset of `before`, a comparison with the same model, and its softness until a plausible sensor begins a run.
    #[must_use]
    pub const fn with_film_of(self, before: &Self) -> Self {
        let softness = if before.softness > self.softness { before.softness } else { self.softness };
        Self { softness, shown: softness, offset_m: before.offset_m, ..self }
    }

    /// The share of [`beyond_by`](Self::beyond_by).
    #[cfg(feature = "loop-test")]
    pub(crate) const fn min_margin(&self) -> f32 {
        self.min_softness - 1.0
    }

    /// Whether the offset is known.
    #[must_use]
    pub const fn is_shown(&self) -> bool {
        !self.offset_m.is_nan()
    }

    /// Begins a run, at 0 V. Without a plausible sensor the softness stays.
    pub fn begin_run(&mut self) {
        if self.offset_m.is_nan() && !self.is_spoiled {
            self.end_block(0.0, false);
        }
        (self.ticks, self.sums, self.blocks, self.is_still) = (0, [0.0; 2], 0, false);
        self.lagged_m = f32::NAN;
        (self.means, self.peak_m) = ([0.0; 2], 0.0);
        self.presumes = false;
        if !self.is_spoiled {
            self.softness = self.min_softness;
        }
        (self.shown, self.unshown) = (self.softness, PRESUMED_BLOCKS);
    }

    /// Presumes that the film moves 15 % further than its model, until the sensor has shown it in this run. For another law than the fitted
    /// one, whose first voltages could move another film too far before a late sensor shows it. Takes effect with the first plausible
    /// value.
    pub fn presume_softer(&mut self) {
        self.presumes = self.is_spoiled;
        if !self.is_spoiled {
            self.presume_softer_now();
        }
    }

    /// The same at once: for a film that is its own sensor.
    pub(crate) const fn presume_softer_now(&mut self) {
        if self.unshown > 0 && self.softness < PRESUMED {
            self.softness = PRESUMED;
        }
    }

    /// Records sensor and model of a tick, m. `drive_m` returns the slow displacement under the load, m, at the end of a block.
    /// `is_plausible`: whether the sensor is plausible. `runs`: whether a law commands the voltage.
    #[inline]
    pub fn record(
        &mut self,
        sensor_m: f32,
        model_m: f32,
        drive_m: impl FnOnce() -> f32,
        is_plausible: bool,
        runs: bool,
    ) {
        if !(is_plausible || runs) {
            // Where a film at 0 V is shows from the next plausible value on.
            (self.ticks, self.sums, self.is_spoiled) = (0, [0.0; 2], true);
            return;
        }
        self.is_spoiled = (self.is_spoiled && self.ticks > 0) || !is_plausible;
        self.ticks += 1;
        self.sums = [self.sums[0] + sensor_m, self.sums[1] + model_m];
        if self.ticks >= self.block_ticks {
            self.end_block(drive_m(), runs);
        }
    }

    /// Whether the sensor is frozen. `must_move`: whether it must move with the model even if it never has.
    #[inline]
    #[must_use]
    pub fn is_frozen(&self, must_move: bool) -> bool {
        self.is_still && (must_move || self.has_moved)
    }

    /// The furthest displacement that the film may have (m) with its model at `model_m` (m).
    #[inline]
    #[must_use]
    pub fn furthest(&self, model_m: f32) -> f32 {
        let further_m = if self.offset_m > 0.0 { self.offset_m } else { 0.0 };
        model_m * self.softness + further_m
    }

    #[inline(never)] // once in many ticks
    #[allow(clippy::cast_precision_loss)] // at most 10 s
    fn end_block(&mut self, drive_m: f32, runs: bool) {
        let ticks = self.ticks as f32;
        let means = self.sums.map(|sum| sum / ticks);
        let is_plausible = !self.is_spoiled && (means[0] - means[1]).is_finite();
        (self.ticks, self.sums, self.is_spoiled) = (0, [0.0; 2], false);
        if !runs {
            (self.blocks, self.is_still) = (0, false);
            if is_plausible {
                self.offset_m = means[0] - means[1];
            }
            return;
        }
        self.compare(means, drive_m);
        if is_plausible {
            // In later blocks the film is presumed to be so or is softer, or has been shown.
            if self.presumes {
                self.presume_softer_now();
            }
            self.soften(means);
        }
    }

    /// Compares the motion of sensor and model in this window.
    fn compare(&mut self, [sensor_m, model_m]: [f32; 2], drive_m: f32) {
        let behind_m = drive_m - self.lagged_m;
        self.lagged_m = if behind_m.is_finite() { self.lagged_m + behind_m / LAG_BLOCKS } else { drive_m };
        let means = [sensor_m, model_m, drive_m, self.lagged_m];
        // NaN is not still.
        if self.blocks == 0 || !sensor_m.is_finite() {
            (self.blocks, self.low, self.high, self.before) = (0, means, means, [0.0; 2]);
        }
        for (index, mean) in means.into_iter().enumerate() {
            if let (Some(low), Some(high)) = (self.low.get_mut(index), self.high.get_mut(index)) {
                *low = if mean < *low { mean } else { *low };
                *high = if mean > *high { mean } else { *high };
            }
        }
        let [sensor_m, model_m, drive_m, lagged_m] = [0, 1, 2, 3].map(|k: usize| self.high[k] - self.low[k]);
        let explained_m = BY_DRIVE * if drive_m > lagged_m { drive_m } else { lagged_m };
        let moved_m = if model_m < explained_m { model_m } else { explained_m };
        self.is_still = self.is_behind(self.before[1]);
        self.has_moved |= model_m > MOVES_ALONG * self.band_m && 2.0 * sensor_m > model_m;
        self.before = [moved_m, self.before[0]];
        self.blocks = if self.blocks >= BLOCKS && !self.is_behind(moved_m) { 0 } else { self.blocks.saturating_add(1) };
    }

    /// Whether the sensor is far behind a model that has moved by `moved_m` (m) in this window.
    fn is_behind(&self, moved_m: f32) -> bool {
        let least_m = MOVES * self.band_m + MOVES_SHARE * self.high[1].abs();
        moved_m > least_m && MOVES * (self.high[0] - self.low[0]) <= moved_m
    }

    /// Updates how soft the film is.
    fn soften(&mut self, means: [f32; 2]) {
        let weight = 1.0 / f32::from(BLOCKS);
        let offset_m = if self.offset_m.is_nan() { 0.0 } else { self.offset_m };
        let [film_m, model_m] = [means[0] - offset_m, means[1]];
        self.means =
            [self.means[0] + weight * (film_m - self.means[0]), self.means[1] + weight * (model_m - self.means[1])];
        let [film_m, model_m] = self.means;
        self.peak_m = if model_m > self.peak_m { model_m } else { self.peak_m };
        // What is left of an earlier load says little about the next one.
        if model_m > SHOWS * self.band_m && 2.0 * model_m > self.peak_m {
            let ratio = film_m / (model_m + self.band_m);
            let largest = |known: f32| {
                let softness = if ratio > known { ratio } else { known };
                if softness < MAX_SOFTNESS { softness } else { MAX_SOFTNESS }
            };
            (self.softness, self.shown) = (largest(self.softness), largest(self.shown));
            if self.unshown > 0 {
                self.unshown -= 1;
                self.softness = if self.unshown > 0 { self.softness } else { self.shown };
            }
        }
    }
}
