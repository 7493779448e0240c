//! A law steps a model forwards and backwards with one equation.

mod beside;
mod bound;
mod coarser;
mod coefficients;
mod compressed;
mod curved;
mod response;
mod saved;
mod series;
mod series_steps;
mod spring_steps;
mod state_traits;
mod warm_start;
mod window;

pub use bound::CompressionBound;
pub use coefficients::Coefficients;
pub use compressed::{Compressed, LawOptions};
pub(crate) use compressed::{DECAY, Decay};
pub(crate) use response::Tangent;
pub use window::Window;

use crate::actuator::Load;
use crate::error::LawError;
use crate::kernel::Discretisation;
use crate::scalar::Scalar;

use curved::{Bend, Curved, Shape, Sprung};
pub(crate) use state_traits::state_traits;

/// How a law remembers the past: [`Compressed`] (the default) or [`Window`].
///
/// The trait is sealed: the law is only right if both methods describe the same recursion with constants of one model, which
/// the tests of this crate show for the two memories here. Use it as a bound to write code for both.
pub trait Memory<T: Scalar>: sealed::Steps<T> {}

impl<T: Scalar, M: sealed::Steps<T>> Memory<T> for M {}

pub(crate) mod sealed {
    use num_complex::Complex;

    /// The steps of a memory: implemented by the memories of this crate alone.
    pub trait Steps<T> {
        /// The part that changes with every step. A [`LawState`](crate::LawState) holds it.
        type History;
        /// One number for each decaying mode.
        type PerMode: Clone + core::fmt::Debug + PartialEq;

        /// Decaying modes, fastest first.
        const MODES: usize;

        /// Stores the newest increment of displacement (m) and returns the force (N) that the film would show at the
        /// next step if it went on with that increment.
        ///
        /// The same number of operations every time; cannot fail.
        fn advance(&self, history: &mut Self::History, increment: T) -> T;

        /// Drops the inertia that a second-order method has in its weights: a law behind a curve steps it itself.
        fn leave_inertia(&mut self);

        /// Zeros, one for each mode.
        fn per_mode() -> Self::PerMode;

        /// The number of mode `index`; `None` beyond the last.
        fn of_mode_mut(numbers: &mut Self::PerMode, index: usize) -> Option<&mut T>;

        /// 1 − ρ and the weight (N/m) of mode `index`.
        fn mode(&self, index: usize) -> [T; 2];

        /// The extension (m) of the spring of mode `index`.
        fn extension(history: &Self::History, index: usize) -> T;

        /// Lets the dashpot of mode `index` flow by `flow` (m) in addition: its spring becomes as much shorter.
        fn relax(history: &mut Self::History, index: usize, flow: T);

        /// The transfer function of [`advance`](Self::advance), N/m, from the delay of one step ζ and 1 − ζ.
        fn response(&self, delay: Complex<f64>, difference: Complex<f64>) -> Complex<f64>;
    }
}

/// The configuration: a model at a step, built once.
///
/// One law serves many [`LawState`]s and can stay in flash. It is built fallibly by [`Law::compressed`] or [`Law::window`] and then steps
/// infallibly, with the same number of operations every time.
///
/// # The equation
///
/// With Δx_k the increment of displacement in step k, g the relaxation modulus of the model in the Grünwald–Letnikov
/// discretisation (Eq. 2 of Karner et al. 2022, s = (1 − ζ)/h with ζ the delay of one step h) and m the mass, Eq. 11 becomes
/// *exactly*
///
/// ```text
/// F_k = Σ_{j≥0} g_j Δx_{k−j} + (m/h²)(Δx_k − Δx_{k−1})
/// ```
///
/// Let `base_k` be the force that the film would show if it went on with its last increment. It is known before step k, and
/// what remains is
///
/// ```text
/// F_k − base_k = (g_0 + m/h²) (Δx_k − Δx_{k−1})
/// ```
///
/// [`displacement`](Law::displacement) solves it for Δx_k (creep, observer), [`force`](Law::force) for F_k (relaxation,
/// feedforward). Solving for the change of the increment keeps the digits of a small stiffness beside a large m/h².
///
/// With [`Discretisation::Bdf2`] s = (1 − ζ)(3 − ζ)/2h instead. g then has other values, and the inertia is
/// `(m/4h²)(9 Δx_k − 15 Δx_{k−1} + 7 Δx_{k−2} − Δx_{k−3})`: of these, 9 is in the stiffness and the rest in the head's weights.
///
/// [`Compressed`] describes how the sum over all the past takes constant time.
///
/// # With an elastic curve
///
/// [`behind`](Law::behind) puts a [`Curve`](crate::Curve) T in front: Σ g_j then acts on the increments of s = T(x), the inertia on
/// those of x. With x̂ = x_{k−1} + Δx_{k−1} and T linearised there, what remains is again
///
/// ```text
/// F_k − base_k = (g_0 T'(x̂) + m/h²) (Δx_k − Δx_{k−1})
/// ```
///
/// and the memory takes s_k = T(x̂) + T'(x̂)(x_k − x̂). What that neglects, T''(x_k − x̂)²/2, is below rounding at control rates, and
/// it does not add up: the next step starts from T of the new x̂. Where the displacement is given ([`force`](Law::force)) T is exact.
///
/// # With two curves
///
/// [`beside`](Law::beside) puts a [`Spring`](crate::Spring) E beside the memory, which has T as its own strain measure and T' as the weight of its
/// force: `F = m ẍ + E(x) + T'(x) M[T(x)]`. With M̂ the memory's force at x̂ what remains is
///
/// ```text
/// base_k = E(x̂) + T'(x̂) M̂ + inertia,      F_k − base_k = (m/h² + E'(x̂) + T'(x̂)² g_0 + T''(x̂) M̂) (Δx_k − Δx_{k−1})
/// ```
///
/// # With a spring in series
///
/// [`in_series`](Law::in_series) stretches a spring S by e and the memory by y = x − e with the same force. With ê the elongation if both go on with
/// their increments, and M̂ the memory's force there, what remains is
///
/// ```text
/// base_k = S(ê) + S'(ê) (M̂ − S(ê)) / (g_0 + S'(ê)) + inertia,      F_k − base_k = (m/h² + g_0 S'(ê) / (g_0 + S'(ê))) (Δx_k − Δx_{k−1})
/// ```
///
/// ```
/// use springpot::{Law, LawOptions, Preset};
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// let model = Preset::TABLE3_N2.model()?;
/// let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(1e-3))?;
///
/// // Creep: 20 N for 10 s. Another state of the same law follows that path and gives the force back.
/// let (mut creep, mut relaxation) = (law.state(), law.state());
/// for _ in 0..10_000 {
///     let displacement = law.displacement(&mut creep, 20.0);
///     law.force(&mut relaxation, displacement);
/// }
/// assert!((law.force_to(&relaxation, creep.position() + creep.increment()) - 20.0).abs() < 0.1);
///
/// // A film that has already hung under 3 N for ten minutes.
/// let hung = law.settled(3.0, 600.0);
/// assert!(hung.position() > 0.0);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Law<T, M = crate::Compressed<T>> {
    step_s: f64,
    /// g_0, N/m.
    instant: f64,
    /// g_0 + m/h², or what the method has instead of m/h², N/m.
    stiffness: T,
    /// m/h², N/m.
    mass_per_step2: f64,
    method: Discretisation,
    curved: Option<Curved<T>>,
    memory: M,
}

/// The state of a [`Law`]: displacement, increment and the history of its memory `M`, which change with every step.
///
/// ```
/// use springpot::{Compressed, Law, LawState};
///
/// /// A film on a controller: its law in flash, its state in RAM.
/// struct Film {
///     law: &'static Law<f32>,
///     state: LawState<f32>,
/// }
///
/// /// The same with a lean memory.
/// type Lean = Compressed<f32, 8, 14, 4>;
/// struct LeanFilm {
///     law: &'static Law<f32, Lean>,
///     state: LawState<f32, Lean>,
/// }
/// # assert!(size_of::<LeanFilm>() < size_of::<Film>());
/// ```
pub struct LawState<T: Scalar, M: Memory<T> = crate::Compressed<T>> {
    pub(crate) position: T,
    /// Rounding error of `position` (Kahan).
    pub(crate) position_surplus: T,
    pub(crate) increment: T,
    /// The force at the next step if the increment stays, N.
    pub(crate) base: T,
    /// The place of the film on the law's curve.
    pub(crate) bend: Bend<T>,
    pub(crate) history: M::History,
}

state_traits!(LawState<T, M> { position, position_surplus, increment, base, bend, history });

impl<T: Scalar, M: Memory<T>> Law<T, M> {
    pub(crate) fn from_memory(
        step_s: f64,
        instant: f64,
        mass_kg: f64,
        memory: M,
        method: Discretisation,
    ) -> Result<Self, LawError> {
        let (inertia, _) = method.inertia();
        let mass_per_step2 = mass_kg / (step_s * step_s);
        let stiffness = T::from_f64(instant + inertia * mass_per_step2);
        if !curved::divides(stiffness) {
            return Err(LawError::NothingToSolve);
        }
        Ok(Self { step_s, instant, stiffness, mass_per_step2, method, curved: None, memory })
    }

    /// The step h in seconds.
    #[must_use]
    pub fn step_s(&self) -> f64 {
        self.step_s
    }

    /// The discretisation of s.
    #[must_use]
    pub fn method(&self) -> Discretisation {
        self.method
    }

    /// Force per displacement within one step, g_0 + m/h² (with [`Discretisation::Bdf2`] g_0 + 9m/4h²), in N/m.
    #[must_use]
    pub fn stiffness(&self) -> T {
        self.stiffness
    }

    /// g_0, the force per displacement within one step without the mass, N/m.
    pub(crate) fn instant(&self) -> f64 {
        self.instant
    }

    /// The memory.
    #[must_use]
    pub fn memory(&self) -> &M {
        &self.memory
    }

    /// Displacement (m) at the next step from the `force` (N) that acts in it.
    #[inline]
    pub fn displacement(&self, state: &mut LawState<T, M>, force: T) -> T {
        self.change_increment(state, (force - state.base) / state.bend.stiffness)
    }

    /// Displacement (m) at the next step under a `load` that depends on that displacement.
    ///
    /// The dependence is linear, so this is one solve as well: `base + S δ = f + f' (x + Δx + δ)`.
    #[inline]
    pub fn displacement_under(&self, state: &mut LawState<T, M>, load: Load<T>) -> T {
        let force_ahead = load.force_n + load.slope_n_per_m * (state.position + state.increment);
        self.change_increment(state, (force_ahead - state.base) / (state.bend.stiffness - load.slope_n_per_m))
    }

    /// Force (N) that the film shows when it is at `displacement` (m) at the next step.
    #[inline]
    pub fn force(&self, state: &mut LawState<T, M>, displacement: T) -> T {
        let before = match self.bent() {
            None => None,
            Some((curved, Shape::Before(table))) => Some((curved, table)),
            Some((curved, Shape::Sprung(spring))) => return self.force_sprung(curved, spring, state, displacement),
        };
        let increment = state.increment_to(displacement);
        state.position = displacement;
        state.position_surplus = T::ZERO;
        match before {
            None => {
                let force = self.force_of(state, increment);
                self.advance(state, increment);
                force
            }
            Some((curved, table)) => {
                let place = table.place(displacement + state.bend.origin, T::ZERO);
                let off = place.minus(&state.bend.ahead);
                let force = curved.force_at(state, off, increment);
                // The place ahead cancels in the next call: the line through this place is enough, and its slope is one of the curve's,
                // however far the film was moved.
                let ahead = place.moved(increment);
                curved.advance(&self.memory, state, increment, [place, ahead], off);
                force
            }
        }
    }

    /// Force (N) that would bring the film to `displacement` (m) at the next step. The state stays as it is: step it with
    /// the force that the actuator then really gives.
    #[inline]
    pub fn force_to(&self, state: &LawState<T, M>, displacement: T) -> T {
        let increment = state.increment_to(displacement);
        match self.bent() {
            None => self.force_of(state, increment),
            Some((curved, Shape::Before(table))) => {
                let place = table.place(displacement + state.bend.origin, T::ZERO);
                curved.force_at(state, place.minus(&state.bend.ahead), increment)
            }
            Some((curved, Shape::Sprung(Sprung::Beside(beside)))) => beside.force_to(curved, state, displacement),
            Some((curved, Shape::Sprung(Sprung::Series(series)))) => series.force_to(curved, state, displacement),
        }
    }

    /// Force (N) that would change the film's increment by `change` (m) in the next step. The state stays as it is.
    ///
    /// As [`force_to`](Self::force_to), for a path that is known by its changes: no digits are lost in the difference of two
    /// positions. Behind a curve this is the inverse of [`displacement`](Self::displacement), linearised as there.
    #[inline]
    pub fn force_for(&self, state: &LawState<T, M>, change: T) -> T {
        state.base + state.bend.stiffness * change
    }

    /// The law's constants behind curves, and the curves.
    #[inline]
    fn bent(&self) -> Option<(&Curved<T>, &Shape<T>)> {
        self.curved.as_ref().map(|curved| (curved, &curved.shape))
    }

    #[inline]
    fn force_of(&self, state: &LawState<T, M>, increment: T) -> T {
        state.base + self.stiffness * (increment - state.increment)
    }

    #[inline]
    fn change_increment(&self, state: &mut LawState<T, M>, change: T) -> T {
        let before = match self.bent() {
            None => None,
            Some((curved, Shape::Before(table))) => Some((curved, table)),
            Some((curved, Shape::Sprung(spring))) => {
                return self.change_increment_sprung(curved, spring, state, change);
            }
        };
        let (position, increment) = state.moved(change);
        match before {
            None => self.advance(state, increment),
            Some((curved, table)) => {
                let ahead = state.bend.ahead;
                let place = ahead.moved(change);
                // Of the same knot, so only the other part of the value differs.
                let off = place.beyond - ahead.beyond;
                let ahead = table.look_ahead(state, increment);
                curved.advance(&self.memory, state, increment, [place, ahead], off);
            }
        }
        position
    }

    // Not inlined, here and below: a step without a spring asks no more than whether there is one.
    #[inline(never)]
    fn force_sprung(&self, curved: &Curved<T>, spring: &Sprung<T>, state: &mut LawState<T, M>, displacement: T) -> T {
        match spring {
            Sprung::Beside(beside) => self.force_beside(curved, beside, state, displacement),
            Sprung::Series(series) => self.force_in_series(curved, series, state, displacement),
        }
    }

    #[inline(never)]
    fn change_increment_sprung(
        &self,
        curved: &Curved<T>,
        spring: &Sprung<T>,
        state: &mut LawState<T, M>,
        change: T,
    ) -> T {
        match spring {
            Sprung::Beside(beside) => self.change_increment_beside(curved, beside, state, change),
            Sprung::Series(series) => self.change_increment_in_series(curved, series, state, change),
        }
    }

    #[inline]
    fn advance(&self, state: &mut LawState<T, M>, increment: T) {
        state.increment = increment;
        state.base = self.memory.advance(&mut state.history, increment);
    }
}

impl<T: Scalar, M: Memory<T>> LawState<T, M> {
    pub(crate) fn with_history(history: M::History) -> Self {
        Self {
            position: T::ZERO,
            position_surplus: T::ZERO,
            increment: T::ZERO,
            base: T::ZERO,
            bend: Bend::straight(T::ZERO),
            history,
        }
    }

    #[inline]
    fn increment_to(&self, displacement: T) -> T {
        (displacement - self.position) + self.position_surplus
    }

    /// Moves the film on with an increment that differs by `change` (m) from the last; returns where it is then (m), and that increment.
    #[inline]
    fn moved(&mut self, change: T) -> (T, T) {
        let increment = self.increment + change;
        // Kahan's sum: what was rounded away comes back with the next increment.
        let addend = increment - self.position_surplus;
        let position = self.position + addend;
        self.position_surplus = (position - self.position) - addend;
        self.position = position;
        (position, increment)
    }

    /// The displacement at the next step if the film goes on with `increment` (m), and its rounding error.
    #[inline]
    fn ahead(&self, increment: T) -> (T, T) {
        let addend = increment - self.position_surplus;
        let position = self.position + addend;
        (position, (position - self.position) - addend)
    }

    /// The displacement at the last step, m.
    #[must_use]
    pub fn position(&self) -> T {
        self.position
    }

    /// The increment of displacement in the last step, m.
    #[must_use]
    pub fn increment(&self) -> T {
        self.increment
    }

    /// The force (N) that the film would show at the next step if it went on with its increment; at rest, the force
    /// that holds it where it is.
    #[must_use]
    pub fn base_force(&self) -> T {
        self.base
    }

    /// The film's stiffness where it is over that at rest: the slope of the law's curve, 1 without one. Beside a spring that of spring and
    /// memory together, for changes at about 1 Hz.
    #[must_use]
    pub fn slope(&self) -> T {
        self.bend.slope
    }

    /// Stretch of a spring in series with the memory, m; 0 without one.
    #[must_use]
    pub fn elongation(&self) -> T {
        self.bend.elongation
    }

    /// Whether the film is beyond the range of the law's curve, or of its spring, which go on linearly there.
    #[must_use]
    pub fn beyond_curve(&self) -> bool {
        self.bend.ahead.is_outside()
    }

    /// Measures displacement from `origin` (m) from now on: a sensor that is zeroed on a film that has already crept.
    /// The film's memory is untouched.
    ///
    /// The film keeps its place on an elastic curve.
    pub fn move_origin(&mut self, origin: T) {
        self.bend.origin = self.bend.origin + origin;
        self.position = (self.position - origin) - self.position_surplus;
        self.position_surplus = T::ZERO;
    }
}
