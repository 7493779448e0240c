//! Steps of laws with a spring in series with their memory.

use crate::curve::{Place, Spring, Table};
use crate::error::LawError;
use crate::law::curved::{Curved, Remembered, Shape, Sprung, divides};
use crate::law::series::Series;
use crate::law::{Law, LawState, Memory};
use crate::scalar::Scalar;

impl<T: Scalar, M: Memory<T>> Law<T, M> {
    /// This law with `spring` in series: the elongations of memory and spring add up, and both have the same force. The inertia acts on the
    /// sum. Knots are rounded to the number type.
    ///
    /// ```text
    /// x = y + e,      F = m ẍ + f,      f = S(e) = ∫ K(t − τ) dy(τ)
    /// ```
    ///
    /// This describes films whose instantaneous elasticity stiffens while their creep stays proportional to the force: the share of the
    /// creep grows with the load, which no [curve before](Self::behind) or [spring beside](Self::beside) the memory describes. A memory
    /// that relaxes dissipates work over every closed path, also in series with a spring that rises.
    ///
    /// States of the law without it do not fit: make new ones.
    ///
    /// ```
    /// use springpot::{Law, LawOptions, Preset, Spring};
    ///
    /// # fn main() -> Result<(), Box<dyn core::error::Error>> {
    /// let model = Preset::TABLE3_N2.model()?;
    /// let spring = Spring::through(&[(0.0, 0.0), (0.5e-3, 6.0), (1e-3, 20.0)])?;
    /// let memory: Law<f64> = Law::compressed(&model, LawOptions::at_step(1e-3))?;
    /// let film = memory.clone().in_series(&spring)?;
    ///
    /// // Under 15 N: the creep of the memory, and the spring.
    /// let (crept, alone) = (film.settled(15.0, 60.0), memory.settled(15.0, 60.0));
    /// let elongation = crept.position() - alone.position();
    /// assert!((spring.force(elongation) / 15.0 - 1.0).abs() < 1e-9);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    ///
    /// [`LawError::SeriesSpring`] for a spring that does not rise everywhere, [`LawError::NothingToSolve`] where the number type cannot hold the
    /// stiffness.
    pub fn in_series(mut self, spring: &Spring) -> Result<Self, LawError> {
        self.add_series(spring)?;
        Ok(self)
    }

    /// Puts `spring` in series with the memory.
    #[inline(never)]
    pub(crate) fn add_series(&mut self, spring: &Spring) -> Result<(), LawError> {
        let table = Table::<T, 1>::new(spring.knots());
        // What the rounded knots make is a spring as well.
        let rounded = table.spring()?;
        let (elongation_m, slope) = rounded.min_slope();
        if !divides(T::from_f64(slope)) {
            return Err(LawError::SeriesSpring { elongation_m, slope });
        }
        let (newest, _) = self.method.inertia();
        let Self { instant, mass_per_step2, .. } = *self;
        let at = |slope: f64| T::from_f64(instant * slope / (instant + slope) + newest * mass_per_step2);
        let series = Series { spring: table, slow: T::ZERO, scale: T::ZERO };
        self.bend_to(Shape::Sprung(Sprung::Series(series)), [slope, rounded.max_slope().1].map(at))?;
        // At 1 Hz, as the observer's gains are.
        let memory = self.memory_stiffness(1.0);
        if let Some(Curved { shape: Shape::Sprung(Sprung::Series(series)), .. }) = &mut self.curved {
            series.slow = T::from_f64(memory);
            series.scale = T::from_f64(1.0 + memory / rounded.slope(0.0));
        }
        Ok(())
    }

    /// Whether a spring is in series with the memory.
    pub(super) fn is_in_series(&self) -> bool {
        matches!(self.bent(), Some((_, Shape::Sprung(Sprung::Series(_)))))
    }

    /// The spring in series, as the number type holds it.
    pub(crate) fn rounded_series(&self) -> Option<Spring> {
        match self.bent()?.1 {
            Shape::Sprung(Sprung::Series(series)) => series.spring.spring().ok(),
            _ => None,
        }
    }

    /// [`force`](Self::force) with a spring in series. Not inlined, here and below: a step without one would pay for it.
    #[inline(never)]
    pub(super) fn force_in_series(
        &self,
        curved: &Curved<T>,
        series: &Series<T>,
        state: &mut LawState<T, M>,
        displacement: T,
    ) -> T {
        let increment = state.increment_to(displacement);
        state.position = displacement;
        state.position_surplus = T::ZERO;
        let [force, shift] = series.force_at(curved, state, increment);
        series.advance(curved, &self.memory, state, increment, shift);
        force
    }

    /// Steps a film with a spring in series whose increment changes by `change` (m); returns where it is then (m).
    #[inline(never)]
    pub(super) fn change_increment_in_series(
        &self,
        curved: &Curved<T>,
        series: &Series<T>,
        state: &mut LawState<T, M>,
        change: T,
    ) -> T {
        let (position, increment) = state.moved(change);
        let ahead = &state.bend.ahead;
        let off = state.bend.memory - (ahead.knot + ahead.beyond);
        let shift = (ahead.slope * change - off) / (curved.instant + ahead.slope);
        series.advance(curved, &self.memory, state, increment, shift);
        position
    }
}

impl<T: Scalar> Series<T> {
    /// [`Law::force_to`] with the spring in series.
    #[inline(never)]
    pub(super) fn force_to<M: Memory<T>>(&self, curved: &Curved<T>, state: &LawState<T, M>, displacement: T) -> T {
        self.force_at(curved, state, state.increment_to(displacement))[0]
    }

    /// The force (N) of a film `increment` (m) from the last step, and how its memory's increment then differs from the last one, m.
    ///
    /// Two steps of Newton's method: a displacement may jump.
    #[inline]
    fn force_at<M: Memory<T>>(&self, curved: &Curved<T>, state: &LawState<T, M>, increment: T) -> [T; 2] {
        let change = increment - state.increment;
        let memory = state.bend.memory;
        let shift = |at: &Place<T>, change: T| {
            (at.slope * change - (memory - (at.knot + at.beyond))) / (curved.instant + at.slope)
        };
        let first = shift(&state.bend.ahead, change);
        // The spring has what that leaves of the change; the rest along its tangent there.
        let (elongation, surplus) = state.bend.elongated((increment - state.bend.predicted) - first);
        let last = shift(&self.spring.place(elongation, surplus), first);
        let inertia = state.bend.inertia + curved.inertia * change;
        [memory + curved.instant * last + inertia, last]
    }

    /// Stores the newest `increment` (m), with which that of the memory changes by `shift` (m).
    #[inline]
    fn advance<M: Memory<T>>(
        &self,
        curved: &Curved<T>,
        memory: &M,
        state: &mut LawState<T, M>,
        increment: T,
        shift: T,
    ) {
        let inertia = curved.store(state, increment);
        let stretched = state.bend.predicted + shift;
        (state.bend.elongation, state.bend.elongation_surplus) = state.bend.elongated(increment - stretched);
        state.bend.predicted = stretched;
        let remembered = memory.advance(&mut state.history, stretched);
        self.meet(curved, state, remembered, inertia);
    }

    /// Completes `state` for the next step: the force and the stiffness that it meets ahead, from the force of the `memory` there and
    /// that of past increments in the `inertia` (N).
    #[inline]
    pub(super) fn meet<M: Memory<T>>(&self, curved: &Curved<T>, state: &mut LawState<T, M>, memory: T, inertia: T) {
        let (elongation, surplus) = state.bend.elongated(state.increment - state.bend.predicted);
        let ahead = self.spring.place(elongation, surplus);
        let share = ahead.slope / (curved.instant + ahead.slope);
        let elastic = ahead.knot + ahead.beyond;
        state.base = elastic + (share * (memory - elastic) + inertia);
        state.bend.ahead = ahead;
        state.bend.memory = memory;
        state.bend.inertia = inertia;
        state.bend.stiffness = curved.instant * share + curved.inertia;
        state.bend.slope = self.scale * (ahead.slope / (self.slow + ahead.slope));
    }

    /// Where the memory of a film in `state` goes on to.
    #[inline]
    pub(super) fn remembered<M: Memory<T>>(curved: &Curved<T>, state: &LawState<T, M>) -> Remembered<T> {
        let (bend, slope) = (&state.bend, state.bend.ahead.slope);
        let share = slope / (curved.instant + slope);
        Remembered {
            force: bend.memory,
            value: (state.position + bend.origin) - bend.elongation + bend.predicted,
            weight: share,
            slope: share,
            stiffness: bend.stiffness,
            steepness: bend.slope,
        }
    }
}
