//! Laws behind an elastic curve.

use crate::curve::{Curve, Knot, Place, Table};
use crate::error::LawError;
use crate::kernel::Discretisation;
use crate::law::{Law, LawState, Memory};
use crate::numbers::Numbers;
use crate::scalar::Scalar;

/// Constants of a law behind a curve, besides its memory.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Curved<T> {
    table: Table<T>,
    /// g_0, N/m.
    instant: T,
    /// Inertia that acts on the change of the increment, N/m.
    inertia: T,
    /// Inertia that acts on the last three increments while the film goes on with its last, newest first, N/m.
    past_inertia: [T; 3],
    /// Smallest and largest stiffness of one step, N/m.
    least: T,
    largest: T,
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
}

impl<T: Scalar> Bend<T> {
    pub(crate) fn straight() -> Self {
        Self { origin: T::ZERO, ahead: Place::straight(), predicted: T::ZERO, past: T::ZERO }
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
        let table = Table::new(curve);
        // What the rounded knots make is a curve as well.
        let rounded = table.curve()?;
        let (newest, [first, second, third]) = method.inertia();
        let inertia = |share: f64| T::from_f64(share * mass_per_step2);
        let at = |slope: f64| T::from_f64(instant * slope + newest * mass_per_step2);
        let curved = Curved {
            table,
            instant: T::from_f64(instant),
            inertia: inertia(newest),
            past_inertia: [newest + first, second, third].map(inertia),
            least: at(rounded.min_slope().1),
            largest: at(rounded.max_slope().1),
        };
        for stiffness in [curved.least, curved.largest] {
            let (held, inverse) = (stiffness.to_f64(), T::from_f64(1.0 / stiffness.to_f64()).to_f64());
            if !(held.is_finite() && held > 0.0 && inverse.is_finite() && inverse > 0.0) {
                return Err(LawError::NothingToSolve);
            }
        }
        self.memory.leave_inertia();
        self.curved = Some(curved);
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

    /// The knots of the law's curve; none without one.
    pub(crate) fn knots(&self) -> impl Iterator<Item = Knot<T>> + '_ {
        self.curved.iter().flat_map(|curved| curved.table.knots())
    }

    /// Visits what a step behind a curve computes with.
    pub(crate) fn curve_numbers(&self, take: &mut impl Numbers<T>) {
        let Some(Curved { table, instant, inertia, past_inertia, .. }) = &self.curved else { return };
        take.structure("curve", "An elastic curve T in front of a law: its memory acts on T(x), the inertia on x.");
        take.number("instant", *instant, "force per T within one step, N/m");
        take.number("inertia", *inertia, "of the change of the increment, N/m");
        take.array("past_inertia", *past_inertia, "of the last three increments, newest first, N/m");
        table.numbers(take);
    }

    /// The curve, as the number type holds it.
    pub(crate) fn rounded_curve(&self) -> Option<Curve> {
        self.curved.as_ref().and_then(|curved| curved.table.curve().ok())
    }

    /// `state` with its place on the curve.
    pub(crate) fn placed(&self, mut state: LawState<T, M>) -> LawState<T, M> {
        if let Some(curved) = &self.curved {
            let place = curved.place(&state, state.position, state.position_surplus);
            state.bend.ahead = curved.look_ahead(&state, state.increment);
            state.bend.predicted = state.bend.ahead.minus(&place);
        }
        state
    }

    /// `state` with its place on the curve, and its base for the increments of the curve's value, of which the last was
    /// `stretched` (m).
    pub(crate) fn placed_after(&self, state: LawState<T, M>, stretched: T) -> LawState<T, M> {
        let mut state = self.placed(state);
        if let Some(curved) = &self.curved {
            state.base = state.base + curved.instant * (state.bend.predicted - stretched);
        }
        state
    }

    /// Smallest slope of the curve, 1 without one.
    pub(crate) fn min_slope(&self) -> f64 {
        if self.curved.is_none() {
            return 1.0;
        }
        let (newest, _) = self.method.inertia();
        (self.min_stiffness().to_f64() - newest * self.mass_per_step2) / self.instant
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

impl<T: Scalar> Curved<T> {
    /// Stiffness of one step where the curve has the slope `slope`, N/m.
    #[inline]
    pub(super) fn stiffness(&self, slope: T) -> T {
        self.instant * slope + self.inertia
    }

    /// The place on the curve at `displacement` − `surplus` (m).
    #[inline]
    pub(super) fn place<M: Memory<T>>(&self, state: &LawState<T, M>, displacement: T, surplus: T) -> Place<T> {
        self.table.place(displacement + state.bend.origin, surplus)
    }

    /// T (m) and T' at `displacement` (m) from the curve's origin.
    pub(super) fn value_and_slope(&self, displacement: f64) -> (f64, f64) {
        let place = self.table.place(T::from_f64(displacement), T::ZERO);
        (place.knot.to_f64() + place.beyond.to_f64(), place.slope.to_f64())
    }

    /// The force (N) where T is `off` (m) from its value ahead and the film `increment` (m) from the last step.
    #[inline]
    pub(super) fn force_at<M: Memory<T>>(&self, state: &LawState<T, M>, off: T, increment: T) -> T {
        let change = increment - state.increment;
        state.base + (self.instant * off + self.inertia * change)
    }

    /// The place (m) where the film will be if it goes on with `increment` (m).
    #[inline]
    pub(super) fn look_ahead<M: Memory<T>>(&self, state: &LawState<T, M>, increment: T) -> Place<T> {
        let addend = increment - state.position_surplus;
        let position = state.position + addend;
        let surplus = (position - state.position) - addend;
        self.place(state, position, surplus)
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
        let Bend { origin, predicted, past, .. } = state.bend;
        let stretched = predicted + off;
        let [newest, second, third] = self.past_inertia;
        let inertia = newest * increment + (second * state.increment + third * past);
        let predicted = ahead.minus(&place);
        state.bend = Bend { origin, ahead, predicted, past: state.increment };
        state.increment = increment;
        let change = self.instant * (predicted - stretched) + inertia;
        state.base = memory.advance(&mut state.history, stretched) + change;
    }
}
