//! Laws with fewer modes.

use heapless::Vec;
use num_complex::Complex;

use crate::kernel::quadrature::MAX_NODES;
use crate::law::compressed::{Compressed, Decay, INERTIA};
use crate::law::curved::{Shape, Sprung};
use crate::law::response::Tangent;
use crate::law::{Law, Memory};
use crate::scalar::Scalar;

/// A mode that others may have been merged into.
#[derive(Clone, Copy)]
struct Mode {
    /// 1 − ρ.
    loss: f64,
    /// N/m.
    weight: f64,
}

impl<T: Scalar, const HEAD: usize, const FAST: usize, const SLOW: usize> Law<T, Compressed<T, HEAD, FAST, SLOW>> {
    /// This law with a head of `H` increments and at most `F + S` modes: a cheaper model, such as for a limit of the stroke.
    ///
    /// Neighbouring modes are merged, in the groups of which the worst changes the modulus least at its time scale.
    /// The sum of their weights stays. What a shorter head loses are the first milliseconds: the modes begin earlier, and what they miss of
    /// the increments that leave the head is added to its last weight. Inertia and curve stay as they are.
    ///
    /// From the default law to a head of 4 and 18 modes, the displacement under a force that is held, swung or stepped stays between
    /// 0.75 % below and 1.2 % above that of this law, in % of its largest (`coarser` in the tests of this crate: the published parameters, random
    /// and hard models).
    ///
    /// [`tail_error`](Compressed::tail_error) of the result is infinite: it is not computed.
    ///
    /// ```
    /// use springpot::{Compressed, Law, LawOptions, Preset};
    ///
    /// # fn main() -> Result<(), Box<dyn core::error::Error>> {
    /// let law: Law<f32> = Law::compressed(&Preset::TABLE3_N2.model()?, LawOptions::at_step(1e-3))?;
    /// let coarse: Law<f32, Compressed<f32, 4, 11, 7>> = law.coarser();
    ///
    /// let (mut film, mut watched) = (law.state(), coarse.state());
    /// for _ in 0..10_000 {
    ///     law.displacement(&mut film, 10.0);
    ///     coarse.displacement(&mut watched, 10.0);
    /// }
    /// assert!((watched.position() / film.position() - 1.0).abs() < 0.005);
    /// # Ok(())
    /// # }
    /// ```
    #[must_use]
    // Not inlined: its list of modes would stay on the stack of a caller that builds more than this law.
    #[inline(never)]
    pub fn coarser<const H: usize, const F: usize, const S: usize>(&self) -> Law<T, Compressed<T, H, F, S>> {
        let () = Compressed::<T, H, F, S>::SIZES_FIT;
        const { assert!(H >= INERTIA && HEAD >= INERTIA, "the inertia of a second-order method is in the head") };
        let memory = &self.memory;
        let mut modes = Vec::<Mode, MAX_NODES>::new();
        for (loss, weight) in memory.modes() {
            let mode = Mode { loss: loss.to_f64(), weight: weight.to_f64() };
            // One that loses all in a step was never earlier.
            if mode.weight > 0.0 && mode.loss < 1.0 {
                // There is room for all.
                let _ = modes.push(Mode { weight: mode.later(HEAD, H), ..mode });
            }
        }
        let mut head = [T::ZERO; H];
        let tail = |j: usize| modes.iter().map(|mode| mode.later(H, j)).sum::<f64>();
        for (j, head) in head.iter_mut().enumerate() {
            *head = memory.head.get(j).map_or_else(|| T::from_f64(tail(j)), |&g| g);
        }
        let missed: f64 = memory.head.iter().enumerate().skip(H).map(|(j, g)| g.to_f64() - tail(j)).sum();
        head[H - 1] = T::from_f64(head[H - 1].to_f64() + missed);

        let modes = merged(&mut modes, F + S);
        let (fast, slow) = modes.split_at(modes.len() - modes.len().min(S));
        let (fast, slow, massless) = (table(fast), table(slow), memory.massless);
        Law {
            step_s: self.step_s,
            instant: self.instant,
            stiffness: self.stiffness,
            mass_per_step2: self.mass_per_step2,
            method: self.method,
            curved: self.curved.clone(),
            memory: Compressed { head, fast, slow, tail_error: f64::INFINITY, massless },
        }
    }
}

/// Frequencies at which a coarser law is compared with its own, in an octave and in all, from 1 Hz downwards: to a million seconds.
const PLACES_PER_OCTAVE: u8 = 3;
const PLACES: u8 = 60;
/// Share by which it may be stiffer faster than that, between these places and by rounding: at most 2.0e-3 on 227 random and hard laws at rates
/// from 100 to 5000 Hz.
const UNSEEN: f64 = 2.5e-3;
/// Places of the stroke at which a curve is compared.
const STROKES: u8 = 32;

impl<T: Scalar, M: Memory<T>> Law<T, M> {
    /// Largest share of the displacement by which `coarser` may be behind this law, up to `stroke_m` (m), under a voltage whose force grows
    /// by `coupling_per_m` (1/m) with the displacement. Infinite where voltages cannot hold the film within that stroke.
    ///
    /// It is the largest share by which the memory of `coarser` is stiffer, from 1 Hz to a million seconds, plus 0.25 % for faster changes,
    /// times a factor of elastic curves and coupling: with T(x) K = F (1 + κ x),
    ///
    /// ```text
    /// −dx / x = dK / K · (T / x) / (T' − κ T / (1 + κ x))
    /// ```
    ///
    /// and beside a spring, where E(x) + T'(x) T(x) K = F (1 + κ x), or with one in series, where S(e) = (x − e) K, likewise for the softest and the stiffest K
    /// of that range.
    #[must_use]
    #[inline(never)]
    pub fn margin_of<N: Memory<T>>(&self, coarser: &Law<T, N>, stroke_m: f64, coupling_per_m: f64) -> f64 {
        let size = |z: Complex<f64>| z.re * z.re + z.im * z.im;
        let mut stiffer = 0.0f64;
        let step = libm::exp2(-1.0 / f64::from(PLACES_PER_OCTAVE));
        let mut frequency_hz = 1.0;
        for _ in 0..PLACES {
            let ratio = size(coarser.dynamic_stiffness(frequency_hz, Tangent::REST))
                / size(self.dynamic_stiffness(frequency_hz, Tangent::REST));
            // Of their squares.
            stiffer = stiffer.max(0.5 * (ratio - 1.0));
            frequency_hz *= step;
        }
        stiffer += UNSEEN;
        let strokes = (1..=STROKES).map(|place| stroke_m * f64::from(place) / f64::from(STROKES));
        // A memory relaxes monotonically.
        let stiffnesses = || [frequency_hz, 1.0].map(|hz| self.memory_stiffness(hz));
        match self.bent() {
            Some((_, Shape::Sprung(Sprung::Beside(beside)))) => {
                return stiffer * beside.growth(stiffnesses(), strokes, coupling_per_m);
            }
            Some((_, Shape::Sprung(Sprung::Series(series)))) => {
                return stiffer * series.growth(stiffnesses(), strokes, coupling_per_m);
            }
            _ => {}
        }
        let growth = strokes.map(|x| {
            let (stretch, slope) = self.curved.as_ref().map_or((x, 1.0), |curved| curved.value_and_slope(x));
            let left = slope - coupling_per_m * stretch / (1.0 + coupling_per_m * x);
            if left > 0.0 { stretch / (x * left) } else { f64::INFINITY }
        });
        stiffer * growth.fold(1.0, f64::max)
    }
}

impl Mode {
    /// The weight (N/m) that is left `to` − `from` steps later, either sign.
    fn later(self, from: usize, to: usize) -> f64 {
        let kept = 1.0 - self.loss;
        let forwards = (from..to).fold(self.weight, |weight, _| weight * kept);
        (to..from).fold(forwards, |weight, _| weight / kept)
    }
}

/// Modes that are merged into one.
#[derive(Clone, Copy)]
struct Group {
    /// Sums of weight, and of weight times rate, and its powers −1 and −1/2.
    weight: f64,
    rate: f64,
    inverse: f64,
    root: f64,
}

impl Group {
    fn new(mode: Mode) -> Self {
        let Mode { loss, weight } = mode;
        Self { weight, rate: weight * loss, inverse: weight / loss, root: weight / libm::sqrt(loss) }
    }

    fn with(self, other: Self) -> Self {
        Self {
            weight: self.weight + other.weight,
            rate: self.rate + other.rate,
            inverse: self.inverse + other.inverse,
            root: self.root + other.root,
        }
    }

    /// The spread of the rates, in weights, over the modulus on that time scale, where `slower` (N/m) has not relaxed yet: the product of the means of rate
    /// and inverse, less 1, is the variance of ln rate where they differ little. Infinite where one is a spring, which never relaxes.
    fn cost(self, slower: f64) -> f64 {
        let cost = (self.rate * self.inverse / self.weight - self.weight) / (slower + self.weight);
        if cost.is_nan() { f64::INFINITY } else { cost }
    }

    /// One mode in the place of the group.
    ///
    /// Its rate is the mean of the power −1/2. The arithmetic mean makes the modulus of a power law, and with it the film, too soft by up
    /// to 4 %, the geometric one by up to 1.8 %, the harmonic one too stiff: for a spectrum that rises as the rate to the α the errors of
    /// all groups cancel at the power −α.
    fn mode(self) -> Mode {
        let mean = self.weight / self.root;
        Mode { loss: mean * mean, weight: self.weight }
    }
}

/// How many groups of neighbours that cost at most `most` there are in `modes`, from the slowest to the fastest. With `keeps`, the last of `modes` are
/// then those of the groups.
fn grouped(modes: &mut [Mode], most: f64, keeps: bool) -> usize {
    let Some(slowest) = modes.last() else { return 0 };
    let (mut slower, mut place, mut group) = (0.0, modes.len(), Group::new(*slowest));
    for k in (0..modes.len()).rev() {
        // Of the one that is faster; none closes the last group.
        let next = k.checked_sub(1).map(|faster| Group::new(modes[faster]));
        let joined = next.map(|next| group.with(next)).filter(|joined| joined.cost(slower) <= most);
        if joined.is_none() {
            slower += group.weight;
            place -= 1;
            if keeps {
                modes[place] = group.mode();
            }
        }
        group = joined.or(next).unwrap_or(group);
    }
    modes.len() - place
}

/// `modes`, from the fastest to the slowest, merged to at most `count`: in the groups of which the costliest costs least.
fn merged(modes: &mut [Mode], count: usize) -> &[Mode] {
    if modes.len() <= count {
        return modes;
    }
    // Exponents of a cost that is too small, and of one that is not; a spring is merged where all else is.
    let (mut low, mut high) = (-60.0, 60.0);
    while high - low > 1e-3 {
        let middle = 0.5 * (low + high);
        if grouped(modes, libm::exp2(middle), false) <= count { high = middle } else { low = middle }
    }
    let most = if grouped(modes, libm::exp2(high), false) <= count { libm::exp2(high) } else { f64::INFINITY };
    let kept = grouped(modes, most, true);
    &modes[modes.len() - kept..]
}

fn table<T: Scalar, const N: usize>(modes: &[Mode]) -> [Decay<T>; N] {
    let mut table = [Decay { loss: T::ZERO, weight: T::ZERO }; N];
    for (entry, mode) in table.iter_mut().zip(modes) {
        *entry = Decay { loss: T::from_f64(mode.loss), weight: T::from_f64(mode.weight) };
    }
    table
}
