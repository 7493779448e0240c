//! The textbook memory: a window of the last samples.

use num_complex::Complex;

use crate::error::LawError;
use crate::kernel::Discretisation;
use crate::kernel::laplace::Kernel;
use crate::law::sealed::Steps;
use crate::law::{Law, LawState};
use crate::model::Maxwell;
use crate::scalar::Scalar;

/// The plain short-memory window: the Grünwald–Letnikov sum over the last `N` increments, in storage `B` of the caller
/// (an array, a `&mut [T]`, or on a host a `Vec<T>`).
///
/// This is the short-memory principle of the textbooks, for comparison. Increments before the window act as a spring, so the film stops
/// creeping after the length of the window: for orders near 0.2 a window of 10 s is wrong by three quarters of the response after 155 s.
/// [`Compressed`](crate::Compressed) completes it with a tail.
///
/// ```
/// use springpot::{Law, LawOptions, Preset, Window};
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// let model = Preset::TABLE3_N2.model()?;
/// // One second at 100 Hz, with storage on the stack.
/// let law: Law<f32, Window<f32, [f32; 100]>> = Law::window(&model, 0.01, [0.0; 100])?;
/// let whole: Law<f32> = Law::compressed(&model, LawOptions::at_step(0.01))?;
///
/// let (mut state, mut exact) = (law.state([0.0; 100])?, whole.state());
/// for _ in 0..15_500 {
///     law.displacement(&mut state, 10.0);
///     whole.displacement(&mut exact, 10.0);
/// }
/// // The window misses most of the creep of these 155 s.
/// assert!(state.position() < 0.5 * exact.position());
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Window<T, B> {
    /// g_0 + g_1, g_2, …, g_N in N/m.
    weights: B,
    /// g_{N+1}: stiffness of the spring that replaces all that was before the window.
    before: T,
}

/// The history of a [`Window`].
#[derive(Clone, Debug, PartialEq)]
pub struct WindowHistory<T, B> {
    increments: B,
    newest: usize,
    /// Displacement before the window, and its rounding error.
    before: T,
    before_surplus: T,
}

impl<T: Scalar, B: AsRef<[T]> + AsMut<[T]>> Law<T, Window<T, B>> {
    /// The law of `model` at `step_s` (s) with a plain window of as many increments as `storage` holds.
    ///
    /// # Errors
    ///
    /// [`LawError::Step`], [`LawError::EmptyWindow`] or [`LawError::NothingToSolve`].
    pub fn window(model: &Maxwell, step_s: f64, storage: B) -> Result<Self, LawError> {
        if !(step_s.is_finite() && step_s > 0.0) {
            return Err(LawError::Step(step_s));
        }
        let mut weights = storage;
        let kernel = Kernel::new(model, step_s, Discretisation::Gl);
        let length = weights.as_ref().len();
        for (j, weight) in (1..).zip(weights.as_mut()) {
            *weight = T::from_f64(kernel.at(j));
        }
        let first = weights.as_mut().first_mut().ok_or(LawError::EmptyWindow)?;
        *first = T::from_f64(kernel.at(0) + kernel.at(1));
        let before = T::from_f64(kernel.at(length + 1));
        Self::from_memory(step_s, kernel.at(0), model.mass_kg(), Window { weights, before }, Discretisation::Gl)
    }

    /// A state at rest at x = 0, in `storage` for as many increments as the window has.
    ///
    /// # Errors
    ///
    /// [`LawError::Storage`] for storage of another length.
    pub fn state(&self, storage: B) -> Result<LawState<T, Window<T, B>>, LawError> {
        let mut increments = storage;
        let (given, needed) = (increments.as_ref().len(), self.memory().weights.as_ref().len());
        if given != needed {
            return Err(LawError::Storage { given, needed });
        }
        increments.as_mut().fill(T::ZERO);
        let history = WindowHistory { increments, newest: 0, before: T::ZERO, before_surplus: T::ZERO };
        Ok(self.placed(LawState::with_history(history)))
    }
}

impl<T: Scalar, B: AsRef<[T]> + AsMut<[T]>> Steps<T> for Window<T, B> {
    type History = WindowHistory<T, B>;
    /// It has no modes.
    type PerMode = ();

    const MODES: usize = 0;

    #[inline]
    fn advance(&self, history: &mut Self::History, increment: T) -> T {
        let increments = history.increments.as_mut();
        let newest = match history.newest {
            0 => increments.len().saturating_sub(1),
            n => n - 1,
        };
        history.newest = newest;
        if let Some(slot) = increments.get_mut(newest) {
            // The oldest increment leaves its slot and joins what was before the window (Kahan's sum).
            let addend = *slot - history.before_surplus;
            let sum = history.before + addend;
            history.before_surplus = (sum - history.before) - addend;
            history.before = sum;
            *slot = increment;
        }
        let (old, recent) = increments.split_at(newest.min(increments.len()));
        let (near, far) = self.weights.as_ref().split_at(recent.len().min(self.weights.as_ref().len()));
        let sum = |weights: &[T], increments: &[T]| {
            weights.iter().zip(increments).fold(T::ZERO, |sum, (&g, &dx)| sum + g * dx)
        };
        sum(near, recent) + (sum(far, old) + self.before * history.before)
    }

    fn leave_inertia(&mut self) {}

    fn per_mode() -> Self::PerMode {}

    fn of_mode_mut((): &mut Self::PerMode, _: usize) -> Option<&mut T> {
        None
    }

    fn mode(&self, _: usize) -> [T; 2] {
        [T::ZERO; 2]
    }

    fn extension(_: &Self::History, _: usize) -> T {
        T::ZERO
    }

    fn relax(_: &mut Self::History, _: usize, _: T) {}

    fn response(&self, delay: Complex<f64>, difference: Complex<f64>) -> Complex<f64> {
        let before = Complex::new(self.before.to_f64(), 0.0) / difference;
        self.weights.as_ref().iter().rev().fold(before, |later, g| later * delay + g.to_f64())
    }
}
