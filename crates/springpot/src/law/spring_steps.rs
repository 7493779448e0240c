//! Steps of laws with a spring beside their memory, in a strain measure of its own.

use crate::curve::{Curve, MAX_SPRING_KNOTS, Spring, Table};
use crate::error::{CurveError, LawError};
use crate::law::beside::{Beside, Met};
use crate::law::curved::{Curved, Shape, Sprung, divides};
use crate::law::{Law, LawState, Memory};
use crate::scalar::Scalar;

/// Share of the stiffness of one step that the memory's force may take where the curve bends: a step takes what is left as its stiffness at
/// the least, so that no force makes it divide by 0.
const BENT_SHARE: f64 = 0.3;
/// Places at which the stiffness is looked for, in each piece.
const PLACES: u8 = 8;

impl<T: Scalar, M: Memory<T>> Law<T, M> {
    /// This law in the strain measure `measure` beside `spring`: its memory acts on T(x) and its force with the weight T'(x), the spring and the
    /// inertia on x. Knots are rounded to the number type.
    ///
    /// ```text
    /// F = m ẍ + E(x) + T'(x) · ∫ K(t − τ) dT(x(τ))
    /// ```
    ///
    /// The weight makes force and strain measure work-conjugate: over a closed path the film dissipates the work that its memory
    /// dissipates. T is most often of the family [`Measure`](crate::Measure). With a spring without stiffness and T(x) = x this law is
    /// unchanged.
    ///
    /// States of the law without them do not fit: make new ones.
    ///
    /// ```
    /// use springpot::{Law, LawOptions, Measure, Preset, Spring};
    ///
    /// # fn main() -> Result<(), Box<dyn core::error::Error>> {
    /// let model = Preset::TABLE3_N2.model()?;
    /// let (spring, measure) = (Spring::linear(9e3)?, Measure { exponent: 0.0, length_m: 0.06 }.curve(-1e-3, 5e-3)?);
    /// let memory: Law<f64> = Law::compressed(&model, LawOptions::at_step(1e-3))?;
    /// let film = memory.clone().beside(&spring, &measure)?;
    ///
    /// // Held at 3 mm: the spring, and the memory at Hencky's strain of it.
    /// let (mut held, mut alone) = (film.state(), memory.state());
    /// let (mut force, mut relaxing) = (0.0, 0.0);
    /// for _ in 0..1000 {
    ///     force = film.force(&mut held, 3e-3);
    ///     relaxing = memory.force(&mut alone, measure.value(3e-3));
    /// }
    /// assert!((force / (spring.force(3e-3) + measure.slope(3e-3) * relaxing) - 1.0).abs() < 1e-9);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    ///
    /// As [`behind`](Self::behind), [`LawError::Curve`] for a measure of more knots than [`MAX_SPRING_KNOTS`], and [`LawError::Unstable`] for a spring that falls so steeply that it and the memory have no stiffness
    /// within a step.
    pub fn beside(mut self, spring: &Spring, measure: &Curve) -> Result<Self, LawError> {
        self.bend(measure)?;
        self.add_spring(spring)?;
        Ok(self)
    }

    /// Puts `spring` beside the memory of a law that is behind its measure.
    #[inline(never)]
    pub(crate) fn add_spring(&mut self, spring: &Spring) -> Result<(), LawError> {
        let Some(measure) = self.measure()? else { return Ok(()) };
        let spring = Table::<T, 1>::new(spring.knots());
        // What the rounded knots make is a spring as well.
        spring.spring()?;
        let (newest, _) = self.method.inertia();
        let (mut least, mut largest) = ((0.0, f64::INFINITY), 0.0f64);
        for displacement in places(&measure).chain(places(&spring)) {
            let slope_of = |table: &Table<T, 1>| table.place(displacement, T::ZERO).slope.to_f64();
            let slope = slope_of(&measure);
            let stiffness = slope_of(&spring) + self.instant * slope * slope + newest * self.mass_per_step2;
            largest = largest.max(stiffness);
            if stiffness.is_nan() || stiffness < least.1 {
                least = (displacement.to_f64(), stiffness);
            }
        }
        let held = T::from_f64((1.0 - BENT_SHARE) * least.1);
        if !divides(held) || !divides(T::from_f64(largest)) {
            let (displacement_m, stiffness) = least;
            return Err(LawError::Unstable { displacement_m, stiffness });
        }
        // At 1 Hz, as the observer's gains are.
        let memory = self.memory_stiffness(1.0);
        let at_rest = spring.place(T::ZERO, T::ZERO).slope.to_f64() + memory;
        // A film that pulls itself in at rest has no such scale.
        let shares = if at_rest > 0.0 { [1.0 / at_rest, memory / at_rest] } else { [0.0, 1.0] };
        let [spring_share, memory_share] = shares.map(T::from_f64);
        if let Some(curved) = &mut self.curved {
            curved.least = held;
            curved.largest = T::from_f64(largest);
            curved.shape = Shape::Sprung(Sprung::Beside(Beside { measure, spring, spring_share, memory_share }));
        }
        Ok(())
    }

    /// The curve of this law as the strain measure of its memory. Not inlined: its knots in f64 are needed here alone.
    #[inline(never)]
    fn measure(&self) -> Result<Option<Table<T, 1>>, LawError> {
        let Some(curve) = self.rounded_curve() else { return Ok(None) };
        if curve.knots().len() > MAX_SPRING_KNOTS {
            return Err(LawError::Curve(CurveError::Knots(curve.knots().len())));
        }
        Ok(Some(Table::new(curve.knots())))
    }

    /// The spring beside the memory, as the number type holds it.
    pub(crate) fn rounded_spring(&self) -> Option<Spring> {
        match &self.curved.as_ref()?.shape {
            Shape::Before(_) | Shape::Sprung(Sprung::Series(_)) => None,
            Shape::Sprung(Sprung::Beside(beside)) => beside.spring.spring().ok(),
        }
    }

    /// [`force`](Self::force) beside a spring. Not inlined, here and below: a step without one would pay for it.
    #[inline(never)]
    pub(super) fn force_beside(
        &self,
        curved: &Curved<T>,
        beside: &Beside<T>,
        state: &mut LawState<T, M>,
        displacement: T,
    ) -> T {
        let increment = state.increment_to(displacement);
        state.position = displacement;
        state.position_surplus = T::ZERO;
        let here = beside.at(state, displacement, T::ZERO);
        let (force, off) = here.force(curved, state, increment);
        let stretched = state.bend.predicted + off;
        let ahead = here.moved(increment);
        let [change, inertia] = curved.go_on(state, increment, [here.place, ahead.place], stretched);
        let remembered = self.memory.advance(&mut state.history, stretched);
        beside.meet(curved, state, &ahead, [remembered + change, inertia]);
        force
    }

    /// Steps a film beside a spring whose increment changes by `change` (m); returns where it is then (m).
    #[inline(never)]
    pub(super) fn change_increment_beside(
        &self,
        curved: &Curved<T>,
        beside: &Beside<T>,
        state: &mut LawState<T, M>,
        change: T,
    ) -> T {
        let (position, increment) = state.moved(change);
        let place = state.bend.ahead.moved(change);
        // Of the same knot, so only the other part of the value differs.
        let off = place.beyond - state.bend.ahead.beyond;
        let ahead = beside.look_ahead(state, increment);
        let stretched = state.bend.predicted + off;
        let [change, inertia] = curved.go_on(state, increment, [place, ahead.place], stretched);
        let remembered = self.memory.advance(&mut state.history, stretched);
        beside.meet(curved, state, &ahead, [remembered + change, inertia]);
        position
    }
}

/// Displacements at the knots and between them.
fn places<T: Scalar>(table: &Table<T, 1>) -> impl Iterator<Item = T> + '_ {
    let pairs = table.knots().zip(table.knots().skip(1));
    pairs.flat_map(|(from, to)| {
        let width = to.displacement - from.displacement;
        (0..=PLACES).map(move |place| from.displacement + width * T::from_f64(f64::from(place) / f64::from(PLACES)))
    })
}

impl<T: Scalar> Beside<T> {
    /// [`Law::force_to`] beside the spring.
    #[inline(never)]
    pub(super) fn force_to<M: Memory<T>>(&self, curved: &Curved<T>, state: &LawState<T, M>, displacement: T) -> T {
        let here = self.at(state, displacement, T::ZERO);
        here.force(curved, state, state.increment_to(displacement)).0
    }

    /// Completes `state` for the next step: the force and the stiffness that it meets `ahead`, from the force of the `memory` there and
    /// that of past increments in the `inertia` (N).
    #[inline]
    pub(super) fn meet<M: Memory<T>>(
        &self,
        curved: &Curved<T>,
        state: &mut LawState<T, M>,
        ahead: &Met<T>,
        [memory, inertia]: [T; 2],
    ) {
        let [elastic, steepness] = ahead.spring;
        let slope = ahead.place.slope;
        let square = slope * slope;
        let bent = ahead.curvature * memory;
        let stiffness = curved.instant * square + (bent + (steepness + curved.inertia));
        state.base = slope * memory + (elastic + inertia);
        state.bend.memory = memory;
        state.bend.inertia = inertia;
        state.bend.stiffness = if stiffness.is_below(curved.least) { curved.least } else { stiffness };
        state.bend.slope = self.spring_share * (steepness + bent) + self.memory_share * square;
    }
}

impl<T: Scalar> Met<T> {
    /// The force (N) of the film here, `increment` (m) from the last step, and T here minus its value ahead (m).
    #[inline]
    fn force<M: Memory<T>>(&self, curved: &Curved<T>, state: &LawState<T, M>, increment: T) -> (T, T) {
        let off = self.place.minus(&state.bend.ahead);
        let memory = state.bend.memory + curved.instant * off;
        let inertia = state.bend.inertia + curved.inertia * (increment - state.increment);
        (self.place.slope * memory + (self.spring[0] + inertia), off)
    }
}
