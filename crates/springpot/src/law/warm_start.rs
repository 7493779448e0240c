//! Warm starts: states of films that were loaded before the run.

use crate::curve::{Curve, Spring};
use crate::kernel::power_series::TERMS;
use crate::kernel::quadrature::MAX_NODES;
use crate::law::compressed::{Compressed, Dashpot};
use crate::law::series::elongation;
use crate::law::{Law, LawState, Memory};
use crate::scalar::Scalar;

impl<T: Scalar, M: Memory<T>> Law<T, M> {
    /// Steps `state` through a recorded history of `forces` (N), one per step.
    pub fn warm_up(&self, state: &mut LawState<T, M>, forces: impl IntoIterator<Item = T>) {
        for force in forces {
            self.displacement(state, force);
        }
    }

    /// Steps `state` through a recorded history of `displacements` (m), one per step.
    pub fn warm_up_along(&self, state: &mut LawState<T, M>, displacements: impl IntoIterator<Item = T>) {
        for displacement in displacements {
            self.force(state, displacement);
        }
    }
}

impl<T: Scalar, const HEAD: usize, const FAST: usize, const SLOW: usize> Law<T, Compressed<T, HEAD, FAST, SLOW>> {
    /// The state of a film that has crept under a constant `force` (N) for `duration_s` from rest, without inertia.
    ///
    /// Equal to that many steps of [`displacement`](Law::displacement) of a law without mass to about 1e-6, and of one
    /// with mass once its oscillation has decayed. Costs some thousand steps even for days: creep slows down, so steps are
    /// solved in blocks whose length grows with the time passed. A negative or NaN duration counts as 0.
    #[must_use]
    pub fn settled(&self, force: T, duration_s: f64) -> LawState<T, Compressed<T, HEAD, FAST, SLOW>> {
        let mut creep = Creep::new(self, force.to_f64());
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
        let steps = libm::round(duration_s / self.step_s()) as u64;
        let mut done = 0;
        while done < steps {
            let block = (done / Creep::<HEAD>::FINENESS).min(steps - done);
            if block < Creep::<HEAD>::MIN_BLOCK {
                creep.step();
                done += 1;
            } else {
                creep.block(block);
                done += block;
            }
        }
        self.state_after(&creep)
    }

    /// The state of a film that has been held at `displacement` (m) for `duration_s`, at rest before: in closed form, as after
    /// [`warm_up_along`](Law::warm_up_along) with that many equal displacements.
    ///
    /// With a spring in series the memory is taken as held, with the film at `displacement` at the end. In a film that is really held the
    /// memory stretches gradually, as the spring relaxes, and remembers less.
    #[must_use]
    #[inline(never)]
    pub fn held(&self, displacement: T, duration_s: f64) -> LawState<T, Compressed<T, HEAD, FAST, SLOW>> {
        let steps = libm::fmax(libm::round(duration_s / self.step_s()), 1.0);
        let position = displacement.to_f64();
        let elongation = if self.is_in_series() { self.held_elongation(position, steps) } else { 0.0 };
        // Behind a curve what relaxes is T(x).
        let stretch = self.curved.as_ref().map_or(position, |curved| curved.value_and_slope(position).0) - elongation;
        let lost = |loss: T| lost_share(loss, steps) * stretch;
        let mut state = self.state();
        (state.history.left, state.history.left_surplus) = split(stretch);
        for (slot, mode) in state.history.fast.iter_mut().zip(&self.memory().fast) {
            let extension = stretch - lost(mode.loss);
            state.base = state.base + mode.weight * T::from_f64(extension);
            *slot = T::from_f64(extension);
        }
        for (slot, mode) in state.history.slow.iter_mut().zip(&self.memory().slow) {
            let (displacement, surplus) = split(lost(mode.loss));
            state.base = state.base + mode.weight * (state.history.left - displacement);
            *slot = Dashpot { displacement, surplus };
        }
        (state.position, state.position_surplus) = split(position);
        (state.bend.elongation, state.bend.elongation_surplus) = split(elongation);
        self.placed_after(state, T::ZERO)
    }

    /// Stretch (m) of the spring in series with a memory that has been held for so many `steps`, both at `position` (m). Not inlined: its knots in f64 would
    /// stay on the stack of a film without it.
    #[inline(never)]
    fn held_elongation(&self, position: f64, steps: f64) -> f64 {
        let left = self.memory().modes().map(|(loss, weight)| weight.to_f64() * (1.0 - lost_share(loss, steps))).sum();
        self.rounded_series().map_or(0.0, |spring| elongation(&spring, left, position))
    }

    /// Stretch (m) of the spring in series under `force` (N), likewise.
    #[inline(never)]
    fn crept_elongation(&self, force: f64) -> f64 {
        self.rounded_series().map_or(0.0, |spring| spring.displacement(force))
    }

    fn state_after(&self, creep: &Creep<HEAD>) -> LawState<T, Compressed<T, HEAD, FAST, SLOW>> {
        let mut state = self.state();
        let head = creep.increments.map(T::from_f64);
        let left = creep.position - creep.increments.iter().sum::<f64>();
        state.history.increments = [head; 2];
        (state.history.left, state.history.left_surplus) = split(left);
        let (fast, slow) = creep.extensions[..FAST + SLOW].split_at(FAST);
        for (slot, &extension) in state.history.fast.iter_mut().zip(fast) {
            *slot = T::from_f64(extension);
        }
        for (slot, &extension) in state.history.slow.iter_mut().zip(slow) {
            let (displacement, surplus) = split(left - extension);
            *slot = Dashpot { displacement, surplus };
        }
        state.base = T::from_f64(creep.base());
        // Behind a curve what creeps is T(x).
        let curve = creep.curve.as_ref();
        let stretched = curve.map_or(creep.position, |curve| curve.inverse(creep.position));
        let slope = curve.map_or(1.0, |curve| curve.slope(stretched));
        let elongation = self.crept_elongation(creep.force);
        (state.bend.elongation, state.bend.elongation_surplus) = split(elongation);
        (state.position, state.position_surplus) = split(stretched + elongation);
        state.increment = T::from_f64(creep.increments[0] / slope);
        self.placed_after(state, head[0])
    }
}

/// Share of a mode that has relaxed after so many `steps`.
fn lost_share<T: Scalar>(loss: T, steps: f64) -> f64 {
    -libm::expm1(steps * libm::log1p(-loss.to_f64()))
}

/// The nearest number of type T, and its rounding error.
fn split<T: Scalar>(value: f64) -> (T, T) {
    let rounded = T::from_f64(value);
    (rounded, T::from_f64(rounded.to_f64() - value))
}

/// Creep under a constant force in f64, in blocks of steps.
struct Creep<const HEAD: usize> {
    force: f64,
    /// g_0 … g_HEAD.
    head: [f64; TERMS],
    modes: [CreepMode; MAX_NODES],
    extensions: [f64; MAX_NODES],
    /// Newest first.
    increments: [f64; HEAD],
    position: f64,
    curve: Option<Curve>,
    spring: Option<Spring>,
}

impl<const HEAD: usize> Creep<HEAD> {
    /// Length of the shortest block, in steps.
    const MIN_BLOCK: u64 = HEAD as u64 + 2;
    /// Time passed over the length of a block.
    const FINENESS: u64 = 200;

    fn new<T: Scalar, const FAST: usize, const SLOW: usize>(
        law: &Law<T, Compressed<T, HEAD, FAST, SLOW>>,
        force: f64,
    ) -> Self {
        let mut head = [0.0; TERMS];
        head[0] = law.instant();
        for (slot, weight) in head[1..].iter_mut().zip(law.memory().massless_head()) {
            *slot = weight.to_f64();
        }
        head[1] -= head[0];
        let mut modes = [CreepMode { loss: 0.0, ln_left: 0.0, weight: 0.0 }; MAX_NODES];
        for (slot, (loss, weight)) in modes.iter_mut().zip(law.memory().modes()) {
            let loss = loss.to_f64();
            *slot = CreepMode { loss, ln_left: libm::log1p(-loss), weight: weight.to_f64() };
        }
        let (curve, spring) = (law.rounded_curve(), law.rounded_spring());
        let (extensions, increments) = ([0.0; MAX_NODES], [0.0; HEAD]);
        Self { force, head, modes, extensions, increments, position: 0.0, curve, spring }
    }

    /// The change with which the force is met, where the memory's force is `memory` + `stiffness` · change (N) and T(x) `value` + `steps` · change
    /// (m).
    fn change(&self, [memory, stiffness]: [f64; 2], [value, steps]: [f64; 2]) -> f64 {
        let (Some(measure), Some(spring)) = (&self.curve, &self.spring) else {
            return (self.force - memory) / stiffness;
        };
        // Newton's method in x, from where the film was.
        let mut x = measure.inverse(self.position);
        let mut change = 0.0;
        for _ in 0..30 {
            change = (measure.value(x) - value) / steps;
            let slope = measure.slope(x);
            let remembered = memory + stiffness * change;
            // A step that the spring's fall does not turn round.
            let steepness = spring.slope(x) + measure.curvature(x) * remembered + slope * slope * stiffness / steps;
            let off = self.force - spring.force(x) - slope * remembered;
            let moved = off / steepness.max(0.1 * slope * slope * stiffness / steps);
            x += moved;
            if moved.abs() <= 4.0 * f64::EPSILON * x.abs() {
                break;
            }
        }
        change
    }

    /// One step that meets the force.
    fn step(&mut self) {
        let mut known: f64 = self.increments.iter().zip(&self.head[1..]).map(|(dx, g)| g * dx).sum();
        known += self.tail();
        let increment = self.change([known, self.head[0]], [self.position, 1.0]);
        self.leave(self.increments[HEAD - 1]);
        self.increments.copy_within(..HEAD - 1, 1);
        self.increments[0] = increment;
        self.position += increment;
    }

    /// A block of `steps` ≥ `MIN_BLOCK` steps whose increments go on from the last one in equal changes, such that the
    /// last step meets the force. Second-order in the length of the block.
    #[allow(clippy::cast_precision_loss)] // far below 2^53 steps
    fn block(&mut self, steps: u64) {
        let steps = steps as f64;
        let last = self.increments[0];
        for i in (0..HEAD).rev() {
            self.leave(self.increments[i]);
        }
        // So many more leave the head before the last step: last + change, last + 2 change, …
        let leaving = steps - 1.0 - HEAD as f64;
        let (mut force, mut stiffness) = (0.0, 0.0);
        for (j, g) in self.head[..=HEAD].iter().enumerate() {
            force += g * last;
            stiffness += g * (steps - j as f64);
        }
        let mut gains = [0.0; MAX_NODES];
        for ((extension, gain), mode) in self.extensions.iter_mut().zip(&mut gains).zip(&self.modes) {
            let sums = mode.sums(leaving);
            *gain = sums.ramp;
            *extension += last * sums.constant - *extension * mode.loss * sums.constant;
            force += mode.weight * *extension;
            stiffness += mode.weight * sums.ramp;
        }
        let sum = 0.5 * steps * (steps + 1.0);
        let change = self.change([force, stiffness], [self.position + steps * last, sum]);
        for (extension, gain) in self.extensions.iter_mut().zip(gains) {
            *extension += gain * change;
        }
        self.leave(last + change * (leaving + 1.0));
        for (j, increment) in self.increments.iter_mut().enumerate() {
            *increment = last + change * (steps - j as f64);
        }
        self.position += steps * last + sum * change;
    }

    /// An increment leaves the head.
    fn leave(&mut self, increment: f64) {
        for (extension, mode) in self.extensions.iter_mut().zip(&self.modes) {
            *extension += increment - mode.loss * *extension;
        }
    }

    /// The force at the next step if the increment stays.
    fn base(&self) -> f64 {
        let head: f64 = self.increments.iter().zip(&self.head[1..]).map(|(dx, g)| g * dx).sum();
        self.head[0] * self.increments[0] + head + self.tail()
    }

    fn tail(&self) -> f64 {
        self.extensions.iter().zip(&self.modes).map(|(y, mode)| mode.weight * y).sum()
    }
}

/// A mode in f64.
#[derive(Clone, Copy)]
struct CreepMode {
    /// 1 − ρ.
    loss: f64,
    ln_left: f64,
    weight: f64,
}

/// Extension that n increments leave in a mode.
struct Sums {
    /// Σ ρ^(n−i) over i = 1…n: of increments of 1.
    constant: f64,
    /// Σ i ρ^(n−i): of increments of i.
    ramp: f64,
}

impl CreepMode {
    fn sums(&self, n: f64) -> Sums {
        let loss = self.loss;
        if loss * n < 1e-4 {
            // Closed forms cancel here: series in n · loss.
            let constant = n - loss * n * (n - 1.0) / 2.0 * (1.0 - loss * (n - 2.0) / 3.0);
            let ramp = n * (n + 1.0) / 2.0 * (1.0 - loss * (n - 1.0) / 3.0 * (1.0 - loss * (n - 2.0) / 4.0));
            Sums { constant, ramp }
        } else {
            let constant = -libm::expm1(n * self.ln_left) / loss;
            Sums { constant, ramp: (n - (1.0 - loss) * constant) / loss }
        }
    }
}
