//! Laws behind an elastic curve.

use num_complex::Complex;

use crate::curve::{Curve, Knot, MAX_KNOTS, Place, Table};
use crate::error::LawError;
use crate::kernel::Discretisation;
use crate::law::beside::Beside;
use crate::law::response::Tangent;
use crate::law::series::Series;
use crate::law::{Law, LawState, Memory};
use crate::numbers::Numbers;
use crate::scalar::Scalar;

/// Constants of a law behind a curve, besides its memory.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Curved<T> {
    pub(super) shape: Shape<T>,
    /// g_0, N/m.
    pub(super) instant: T,
    /// Inertia that acts on the change of the increment, N/m.
    pub(super) inertia: T,
    /// Inertia that acts on the last three increments while the film goes on with its last, newest first, N/m.
    past_inertia: [T; 3],
    /// Smallest and largest stiffness of one step, N/m.
    pub(super) least: T,
    pub(super) largest: T,
}

/// The memory of a film at the next step if it goes on with its increment, and what acts on it there.
#[derive(Clone, Copy)]
pub(crate) struct Remembered<T> {
    /// The memory's force, N, and the value of its strain measure, m.
    pub(crate) force: T,
    pub(crate) value: T,
    /// Weight of that force, slope of the measure, and force per displacement within the step (N/m), all as the law has them.
    pub(crate) weight: T,
    pub(crate) slope: T,
    pub(crate) stiffness: T,
    /// Stiffness of slow changes over that at rest, likewise.
    pub(crate) steepness: T,
}

/// The curves of a law.
#[derive(Debug, PartialEq)]
#[repr(u32)] // a step asks for 0 first
pub(crate) enum Shape<T> {
    /// A curve before spring and memory.
    Before(Table<T>),
    /// A spring besides the memory: one variant, so that a step behind a curve asks no more than whether there is one.
    Sprung(Sprung<T>),
}

/// A spring besides the memory.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Sprung<T> {
    /// Beside it; the memory has a strain measure of its own. As many pieces as a curve in all.
    Beside(Beside<T>),
    /// In series with it.
    Series(Series<T>),
}

impl<T: Clone> Clone for Shape<T> {
    // Not inlined: copies of each would stay on the stack of a small chip.
    #[inline(never)]
    fn clone(&self) -> Self {
        match self {
            Self::Before(table) => Self::Before(table.clone()),
            Self::Sprung(spring) => Self::Sprung(spring.clone()),
        }
    }
}

/// The place of a film on the curve of its law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bend<T> {
    /// Where position 0 lies on the curve, m.
    pub(crate) origin: T,
    /// The place at the next step if the film goes on with its increment.
    pub(crate) ahead: Place<T>,
    /// T there minus T at the last step, m.
    pub(crate) predicted: T,
    /// The increment before the last, m.
    pub(crate) past: T,
    /// Force per displacement within the next step, N/m.
    pub(crate) stiffness: T,
    /// Stiffness of slow changes there over that at rest.
    pub(crate) slope: T,
    /// With a spring: the memory's force at the next step if the increment stays, and the force of the increments before it in the inertia, N.
    pub(crate) memory: T,
    pub(crate) inertia: T,
    /// Stretch of a spring in series, m, and its rounding error (Kahan). `ahead` and `predicted` are then of the spring and of the memory.
    pub(crate) elongation: T,
    pub(crate) elongation_surplus: T,
}

impl<T: Scalar> Bend<T> {
    /// That of a film without a curve, whose stiffness (N/m) is the same everywhere.
    pub(crate) fn straight(stiffness: T) -> Self {
        Self {
            origin: T::ZERO,
            ahead: Place::straight(),
            predicted: T::ZERO,
            past: T::ZERO,
            stiffness,
            slope: T::from_f64(1.0),
            memory: T::ZERO,
            inertia: T::ZERO,
            elongation: T::ZERO,
            elongation_surplus: T::ZERO,
        }
    }

    /// Stretch of a spring in series after an `increment` (m), and its rounding error.
    #[inline]
    pub(super) fn elongated(&self, increment: T) -> (T, T) {
        let addend = increment - self.elongation_surplus;
        let elongation = self.elongation + addend;
        (elongation, (elongation - self.elongation) - addend)
    }
}

impl<T: Scalar, M: Memory<T>> Law<T, M> {
    /// This law behind the elastic `curve`: its kernel acts on T(x), the inertia on x. Knots are rounded to the number type.
    ///
    /// States of the law without it do not fit: make new ones.
    ///
    /// ```
    /// use springpot::{Curve, Law, LawOptions, Preset};
    ///
    /// # fn main() -> Result<(), Box<dyn core::error::Error>> {
    /// let model = Preset::TABLE3_N2.model()?;
    /// let curve = Curve::through(&[(0.0, 0.0), (1e-3, 1.2e-3), (2e-3, 2.8e-3)])?;
    /// let law: Law<f64> = Law::compressed(&model, LawOptions::at_step(1e-3))?;
    /// let stiffening = law.clone().behind(&curve)?;
    ///
    /// // Held at 1.5 mm, the film resists with the force of the linear one at T(1.5 mm).
    /// let (mut bent, mut straight) = (stiffening.state(), law.state());
    /// let (mut force, mut linear) = (0.0, 0.0);
    /// for _ in 0..1000 {
    ///     force = stiffening.force(&mut bent, 1.5e-3);
    ///     linear = law.force(&mut straight, curve.value(1.5e-3));
    /// }
    /// assert!((force / linear - 1.0).abs() < 1e-9);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    ///
    /// [`LawError::NothingToSolve`] where the number type cannot hold the stiffness, [`LawError::Curve`] for knots that are not
    /// different in it.
    pub fn behind(mut self, curve: &Curve) -> Result<Self, LawError> {
        self.bend(curve)?;
        Ok(self)
    }

    /// Puts the law behind `curve`, or leaves it as it is.
    // Not inlined: the curve in f64 would stay on the stack of a caller that builds more than this law.
    #[inline(never)]
    pub(crate) fn bend(&mut self, curve: &Curve) -> Result<(), LawError> {
        let &mut Self { instant, mass_per_step2, method, .. } = self;
        let table = Table::new(curve.knots());
        // What the rounded knots make is a curve as well.
        let rounded = table.curve()?;
        let (newest, _) = method.inertia();
        let at = |slope: f64| T::from_f64(instant * slope + newest * mass_per_step2);
        self.bend_to(Shape::Before(table), [at(rounded.min_slope().1), at(rounded.max_slope().1)])
    }

    /// Gives the law this `shape`, with which a step has a stiffness between these two (N/m).
    pub(super) fn bend_to(&mut self, shape: Shape<T>, [least, largest]: [T; 2]) -> Result<(), LawError> {
        if !(divides(least) && divides(largest)) {
            return Err(LawError::NothingToSolve);
        }
        let (newest, [first, second, third]) = self.method.inertia();
        let inertia = |share: f64| T::from_f64(share * self.mass_per_step2);
        let past_inertia = [newest + first, second, third].map(inertia);
        let instant = T::from_f64(self.instant);
        self.curved = Some(Curved { shape, instant, inertia: inertia(newest), past_inertia, least, largest });
        self.memory.leave_inertia();
        Ok(())
    }

    /// Smallest force per displacement within one step over the range of the curve, N/m; without a curve
    /// [`stiffness`](Self::stiffness).
    #[must_use]
    pub fn min_stiffness(&self) -> T {
        self.curved.as_ref().map_or(self.stiffness, |curved| curved.least)
    }

    /// Largest force per displacement within one step, likewise.
    #[must_use]
    pub fn max_stiffness(&self) -> T {
        self.curved.as_ref().map_or(self.stiffness, |curved| curved.largest)
    }

    /// The knots of the law's curve, none without one, and after them those of its spring.
    pub(crate) fn knots(&self) -> impl Iterator<Item = Knot<T>> + '_ {
        let (before, beside, series) = match self.curved.as_ref().map(|curved| &curved.shape) {
            None => (None, None, None),
            Some(Shape::Before(table)) => (Some(table), None, None),
            Some(Shape::Sprung(Sprung::Beside(beside))) => (None, Some(beside), None),
            Some(Shape::Sprung(Sprung::Series(series))) => (None, None, Some(series)),
        };
        let springs = beside.into_iter().flat_map(Beside::knots).chain(series.into_iter().flat_map(Series::knots));
        before.into_iter().flat_map(Table::knots).chain(springs)
    }

    /// Visits the constants of a step behind a curve.
    pub(crate) fn curve_numbers(&self, take: &mut impl Numbers<T>) {
        let Some(Curved { shape, instant, inertia, past_inertia, least, .. }) = &self.curved else { return };
        take.structure("curve", "An elastic curve T in front of a law: its memory acts on T(x), the inertia on x.");
        take.number("instant", *instant, "force per T within one step, N/m");
        take.number("inertia", *inertia, "of the change of the increment, N/m");
        take.array("past_inertia", *past_inertia, "of the last three increments, newest first, N/m");
        match shape {
            Shape::Before(table) => table.numbers(take, "pieces", MAX_KNOTS - 1),
            Shape::Sprung(Sprung::Beside(beside)) => beside.numbers(take, *least),
            Shape::Sprung(Sprung::Series(series)) => series.numbers(take),
        }
    }

    /// The curve, as the number type holds it.
    pub(crate) fn rounded_curve(&self) -> Option<Curve> {
        match &self.curved.as_ref()?.shape {
            Shape::Before(table) => table.curve().ok(),
            Shape::Sprung(Sprung::Beside(beside)) => beside.measure.curve().ok(),
            Shape::Sprung(Sprung::Series(_)) => None,
        }
    }

    /// `state`, a film at rest, with its place on the curve.
    pub(crate) fn placed(&self, state: LawState<T, M>) -> LawState<T, M> {
        self.placed_after(state, T::ZERO)
    }

    /// `state` with its place on the curve. Its base is that of the memory for the increments of the curve's value, of which the last was
    /// `stretched` (m).
    pub(crate) fn placed_after(&self, mut state: LawState<T, M>, stretched: T) -> LawState<T, M> {
        let (base, instant) = (state.base, T::from_f64(self.instant));
        let memory = |predicted: T| base + instant * (predicted - stretched);
        state.bend.stiffness = self.stiffness;
        if let Some(curved) = &self.curved {
            let at = state.position + state.bend.origin;
            match &curved.shape {
                Shape::Before(table) => {
                    state.bend.ahead = table.look_ahead(&state, state.increment);
                    state.bend.predicted = state.bend.ahead.minus(&table.place(at, state.position_surplus));
                    state.base = memory(state.bend.predicted);
                    curved.meet(&mut state);
                }
                Shape::Sprung(Sprung::Beside(beside)) => {
                    let ahead = beside.look_ahead(&state, state.increment);
                    state.bend.ahead = ahead.place;
                    state.bend.predicted = ahead.place.minus(&beside.measure.place(at, state.position_surplus));
                    let memory = memory(state.bend.predicted);
                    beside.meet(curved, &mut state, &ahead, [memory, T::ZERO]);
                }
                Shape::Sprung(Sprung::Series(series)) => {
                    state.bend.predicted = stretched;
                    series.meet(curved, &mut state, base, T::ZERO);
                }
            }
        }
        state
    }

    /// Whether it is behind a curve, or has two.
    pub(crate) fn is_curved(&self) -> bool {
        self.curved.is_some()
    }

    /// Where the memory of a film in `state` goes on to, after a step.
    #[inline]
    pub(crate) fn remembered(&self, state: &LawState<T, M>) -> Remembered<T> {
        let (ahead, one) = (&state.bend.ahead, T::from_f64(1.0));
        let value = ahead.knot + ahead.beyond;
        match self.bent() {
            None => Remembered {
                force: state.base,
                value: state.position + state.increment,
                weight: one,
                slope: one,
                stiffness: self.stiffness,
                steepness: one,
            },
            Some((_, Shape::Before(_))) => Remembered {
                force: state.base,
                value,
                weight: one,
                slope: ahead.slope,
                stiffness: state.bend.stiffness,
                steepness: state.bend.slope,
            },
            Some((_, Shape::Sprung(Sprung::Beside(_)))) => Remembered {
                force: state.bend.memory,
                value,
                weight: ahead.slope,
                slope: ahead.slope,
                stiffness: state.bend.stiffness,
                steepness: state.bend.slope,
            },
            Some((curved, Shape::Sprung(Sprung::Series(_)))) => Series::remembered(curved, state),
        }
    }

    /// The film where it is softest, as slow changes see it.
    pub(crate) fn softest(&self) -> Tangent {
        match self.bent() {
            None => Tangent::REST,
            Some((curved, Shape::Before(_))) => {
                let (newest, _) = self.method.inertia();
                let memory = (curved.least.to_f64() - newest * self.mass_per_step2) / self.instant;
                Tangent { memory, ..Tangent::REST }
            }
            Some((_, Shape::Sprung(Sprung::Beside(beside)))) => beside.softest(),
            Some((_, Shape::Sprung(Sprung::Series(series)))) => series.softest(),
        }
    }

    /// The film at `displacement` (m), without the force that its memory still has there.
    pub(crate) fn tangent_at(&self, displacement: f64) -> Tangent {
        match self.bent() {
            None => Tangent::REST,
            Some((_, Shape::Before(table))) => {
                let memory = table.curve().map_or(1.0, |curve| curve.slope(displacement));
                Tangent { memory, ..Tangent::REST }
            }
            Some((_, Shape::Sprung(Sprung::Beside(beside)))) => beside.tangent_at(T::from_f64(displacement)),
            Some((_, Shape::Sprung(Sprung::Series(series)))) => series.tangent_at(displacement),
        }
    }

    /// The film at rest: every curve has the slope 1 there.
    pub(crate) fn tangent_at_rest(&self) -> Tangent {
        match self.bent() {
            Some((_, Shape::Sprung(Sprung::Beside(beside)))) => Tangent { memory: 1.0, ..beside.tangent_at(T::ZERO) },
            Some((_, Shape::Sprung(Sprung::Series(series)))) => series.tangent_at(0.0),
            _ => Tangent::REST,
        }
    }

    /// Force over displacement of the memory's slow changes, at `frequency_hz` without inertia, N/m.
    #[inline(never)]
    pub(crate) fn memory_stiffness(&self, frequency_hz: f64) -> f64 {
        let massless = self.dynamic_stiffness(frequency_hz, Tangent::REST)
            - self.dynamic_stiffness(frequency_hz, Tangent { memory: 0.0, ..Tangent::REST });
        let Complex { re, im } = massless;
        re.abs().max(im.abs())
    }

    /// m/h² of the method on the change of the increment and on the increments before it, where the memory does not have it, N/m.
    pub(crate) fn separate_inertia(&self) -> Option<(f64, [f64; 3])> {
        let separate = self.curved.is_some() && self.method != Discretisation::Gl;
        separate.then(|| {
            let (newest, past) = self.method.inertia();
            (newest * self.mass_per_step2, past.map(|share| share * self.mass_per_step2))
        })
    }
}

/// Whether a step can divide by `stiffness`.
pub(super) fn divides<T: Scalar>(stiffness: T) -> bool {
    let (held, inverse) = (stiffness.to_f64(), T::from_f64(1.0 / stiffness.to_f64()).to_f64());
    held.is_finite() && held > 0.0 && inverse.is_finite() && inverse > 0.0
}

impl<T: Scalar> Curved<T> {
    /// T (m) and T' at `displacement` (m) from the curve's origin.
    pub(super) fn value_and_slope(&self, displacement: f64) -> (f64, f64) {
        let at = T::from_f64(displacement);
        let place = match &self.shape {
            Shape::Before(table) => table.place(at, T::ZERO),
            Shape::Sprung(Sprung::Beside(beside)) => beside.measure.place(at, T::ZERO),
            // Of the memory.
            Shape::Sprung(Sprung::Series(_)) => return (displacement, 1.0),
        };
        (place.knot.to_f64() + place.beyond.to_f64(), place.slope.to_f64())
    }

    /// The force (N) where T is `off` (m) from its value ahead and the film `increment` (m) from the last step.
    #[inline]
    pub(super) fn force_at<M: Memory<T>>(&self, state: &LawState<T, M>, off: T, increment: T) -> T {
        let change = increment - state.increment;
        state.base + (self.instant * off + self.inertia * change)
    }

    /// Stores the newest `increment` (m), which led to `place`, where T is `off` (m) from its value ahead, and the place `ahead` of it.
    #[inline]
    pub(super) fn advance<M: Memory<T>>(
        &self,
        memory: &M,
        state: &mut LawState<T, M>,
        increment: T,
        [place, ahead]: [Place<T>; 2],
        off: T,
    ) {
        let stretched = state.bend.predicted + off;
        let [change, inertia] = self.go_on(state, increment, [place, ahead], stretched);
        state.base = memory.advance(&mut state.history, stretched) + (change + inertia);
        self.meet(state);
    }

    /// Stores the newest `increment`, place and place ahead, and returns the forces (N) of how the next increment of T will differ from the last
    /// one, `stretched` (m), and of past increments in the inertia.
    #[inline]
    pub(super) fn go_on<M: Memory<T>>(
        &self,
        state: &mut LawState<T, M>,
        increment: T,
        [place, ahead]: [Place<T>; 2],
        stretched: T,
    ) -> [T; 2] {
        let inertia = self.store(state, increment);
        let predicted = ahead.minus(&place);
        state.bend.ahead = ahead;
        state.bend.predicted = predicted;
        [self.instant * (predicted - stretched), inertia]
    }

    /// Stores the newest `increment`, and returns the force (N) of past increments in the inertia.
    #[inline]
    pub(super) fn store<M: Memory<T>>(&self, state: &mut LawState<T, M>, increment: T) -> T {
        let [newest, second, third] = self.past_inertia;
        let inertia = newest * increment + (second * state.increment + third * state.bend.past);
        state.bend.past = state.increment;
        state.increment = increment;
        inertia
    }

    /// Completes `state` with the stiffness that it meets ahead.
    #[inline]
    fn meet<M: Memory<T>>(&self, state: &mut LawState<T, M>) {
        let slope = state.bend.ahead.slope;
        state.bend.stiffness = self.instant * slope + self.inertia;
        state.bend.slope = slope;
    }
}

impl<T: Scalar> Table<T> {
    /// The place of a film that goes on with `increment` (m).
    #[inline]
    pub(super) fn look_ahead<M: Memory<T>>(&self, state: &LawState<T, M>, increment: T) -> Place<T> {
        let (position, surplus) = state.ahead(increment);
        self.place(position + state.bend.origin, surplus)
    }
}
