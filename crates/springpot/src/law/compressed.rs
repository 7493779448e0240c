//! The default memory: a head of exact values and a tail of exponential modes.

use num_complex::Complex;

use crate::error::LawError;
use crate::kernel::Discretisation;
use crate::kernel::laplace::Kernel;
use crate::kernel::power_series::TERMS;
use crate::kernel::quadrature::MAX_NODES;
use crate::kernel::tail::{self, DecayMode};
use crate::law::sealed::Steps;
use crate::law::{Law, LawState};
use crate::model::Maxwell;
use crate::numbers::{Numbers, Record};
use crate::scalar::Scalar;

/// Options of a law with a compressed memory: step, horizon, tolerance and discretisation.
///
/// ```
/// use springpot::{Law, LawOptions, Preset};
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// let model = Preset::TABLE3_N2.model()?;
/// // 500 Hz, a memory of one hour, and the default tolerance.
/// let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(2e-3).with_horizon(3600.0))?;
/// assert_eq!(law.step_s(), 2e-3);
///
/// // A step that no recursion has is refused.
/// assert!(Law::<f32>::compressed(&model, LawOptions::at_step(0.0)).is_err());
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct LawOptions {
    /// Step h in seconds.
    pub step_s: f64,
    /// Time over which the memory is accurate, in seconds. Slower relaxation is kept, but not resolved. The run may be
    /// longer.
    pub horizon_s: f64,
    /// Largest accepted error of the relaxation modulus beyond the head, relative to the modulus K(1/t) of the model at that
    /// time t.
    pub tolerance: f64,
    /// How s is discretised.
    #[cfg_attr(feature = "serde", serde(default))]
    pub method: Discretisation,
}

impl LawOptions {
    /// 24 h.
    pub const DEFAULT_HORIZON_S: f64 = 86_400.0;

    /// A horizon of [`DEFAULT_HORIZON_S`](Self::DEFAULT_HORIZON_S), a tolerance of 1e-5 and [`Discretisation::Gl`] at step `step_s` (s).
    #[must_use]
    pub const fn at_step(step_s: f64) -> Self {
        Self { step_s, horizon_s: Self::DEFAULT_HORIZON_S, tolerance: 1e-5, method: Discretisation::Gl }
    }

    /// The same with another memory horizon (s).
    #[must_use]
    pub const fn with_horizon(mut self, horizon_s: f64) -> Self {
        self.horizon_s = horizon_s;
        self
    }

    /// The same with another tolerance.
    #[must_use]
    pub const fn with_tolerance(mut self, tolerance: f64) -> Self {
        self.tolerance = tolerance;
        self
    }

    /// The same with another discretisation.
    ///
    /// ```
    /// use springpot::{Law, Maxwell, Discretisation, LawOptions, Springpot, Topology};
    ///
    /// # fn main() -> Result<(), Box<dyn core::error::Error>> {
    /// // A springpot of order 0.2 under t² N for 10 s at 100 Hz creeps to 2 t^2.2 / Γ(3.2).
    /// let model = Maxwell::new(Springpot::new(1.0, 0.2), &[], Topology::Eq11, 0.0)?;
    /// let exact = 2.0 * f64::powf(10.0, 2.2) / 2.423_965_479_935_368;
    /// let error = |method| -> Result<f64, springpot::LawError> {
    ///     let law: Law<f64> = Law::compressed(&model, LawOptions::at_step(0.01).with_method(method))?;
    ///     let mut state = law.state();
    ///     law.warm_up(&mut state, (0..=1000).map(|k| (0.01 * f64::from(k)).powi(2)));
    ///     Ok(state.position() / exact - 1.0)
    /// };
    /// assert!(error(Discretisation::Gl)?.abs() > 1e-4);
    /// assert!(error(Discretisation::Bdf2)?.abs() < 1e-6);
    /// # Ok(())
    /// # }
    /// ```
    #[must_use]
    pub const fn with_method(mut self, method: Discretisation) -> Self {
        self.method = method;
        self
    }
}

/// The memory of a film in a few dozen numbers.
///
/// `HEAD` increments are kept and weighted exactly. What is older flows into `FAST + SLOW` decaying modes with positive
/// weights: small Maxwell elements in parallel that approximate the springpots' long memory:
///
/// ```text
/// Σ_{j≥0} g_j Δx_{k−j} ≈ Σ_{j=0..HEAD} g_j Δx_{k−j} + Σ_i A_i y_i,      y_i ← y_i + (Δx_{k−HEAD−1} − (1 − ρ_i) y_i)
/// ```
///
/// Cutting the sum instead (the short-memory principle, [`Window`](crate::Window)) loses the creep, because what is cut
/// *is* the creep. The rates ρ_i and weights A_i are the Gauss quadrature rule of the model's relaxation spectrum, so the
/// weights are positive for every model, springs and discrete relaxation times are exact, and a narrow line in the
/// spectrum gets the nodes it needs.
///
/// With [`Discretisation::Bdf2`] the modes miss what dies out within a few steps after the head; its sum is added to g_HEAD.
///
/// # Rounding
///
/// A Maxwell element is a spring of extension y behind a dashpot of displacement z, and y + z is the displacement S that
/// has left the head. `FAST` elements, whose extension decays quickly, store y; rounding errors decay as well. `SLOW`
/// elements, whose dashpots hardly move, store z with compensated summation (Kahan) and share one compensated S: neither a
/// decay of 1e-10 per step nor an increment of 1e-9 m is lost in f32. 1 − ρ is stored, since f32
/// cannot hold ρ near 1.
///
/// The defaults hold 1e-7 in f64 from 100 Hz to 5 kHz and 2.5e-7 more in f32 over 24 h; `Compressed<T, 8, 14, 4>`, with a
/// horizon of an hour at 1 kHz, is a lean memory that holds 1e-4 over that hour, in f32 and in both directions.
#[derive(Clone, Debug, PartialEq)]
pub struct Compressed<T, const HEAD: usize = 12, const FAST: usize = 12, const SLOW: usize = 24> {
    /// g_0 + g_1, g_2, …, g_HEAD in N/m, with inertia where the method has it there.
    pub(crate) head: [T; HEAD],
    pub(crate) fast: [Decay<T>; FAST],
    pub(crate) slow: [Decay<T>; SLOW],
    pub(crate) tail_error: f64,
    /// The first of `head` without the inertia that a second-order method adds to it.
    pub(crate) massless: [T; INERTIA],
}

/// Increments before the newest that inertia reaches back to.
pub(crate) const INERTIA: usize = 3;

/// The constants of a Maxwell element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Decay<T> {
    /// 1 − ρ, the share of the spring's extension that is lost in a step.
    pub(crate) loss: T,
    /// Stiffness of the spring, N/m.
    pub(crate) weight: T,
}

/// The numbers of a [`Decay`].
pub(crate) const DECAY: Record<2> = Record {
    name: "decay",
    about: "A mode of the memory: a Maxwell element.",
    fields: [("loss", "1 - rho, what it forgets in a step"), ("weight", "stiffness of its spring, N/m")],
};

/// The dashpot of a slow Maxwell element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Dashpot<T> {
    pub(crate) displacement: T,
    /// Rounding error of `displacement`.
    pub(crate) surplus: T,
}

/// The history of a [`Compressed`] memory.
#[derive(Clone, Debug, PartialEq)]
pub struct CompressedHistory<T, const HEAD: usize, const FAST: usize, const SLOW: usize> {
    /// The last increments twice, so that from `newest` on they are always contiguous.
    pub(crate) increments: [[T; HEAD]; 2],
    pub(crate) newest: usize,
    /// Displacement that has left the head, and its rounding error.
    pub(crate) left: T,
    pub(crate) left_surplus: T,
    /// Extensions of the fast springs.
    pub(crate) fast: [T; FAST],
    pub(crate) slow: [Dashpot<T>; SLOW],
}

/// One number for each mode of a [`Compressed`] memory.
#[derive(Clone, Debug)]
pub struct PerMode<T, const FAST: usize, const SLOW: usize> {
    fast: [T; FAST],
    slow: [T; SLOW],
}

/// Not derived: not every number type can be compared.
impl<T: Scalar, const FAST: usize, const SLOW: usize> PartialEq for PerMode<T, FAST, SLOW> {
    fn eq(&self, other: &Self) -> bool {
        let numbers = |modes: &Self| (modes.fast.map(T::to_f64), modes.slow.map(T::to_f64));
        numbers(self) == numbers(other)
    }
}

impl<T: Scalar, const HEAD: usize, const FAST: usize, const SLOW: usize> Law<T, Compressed<T, HEAD, FAST, SLOW>> {
    /// The law of `model` with a compressed memory.
    ///
    /// Evaluates the model a few thousand times in f64, with about 10 KiB of stack and no allocation: less than a millisecond on a host; about
    /// a second on a Cortex-M4F at 168 MHz, which has f64 in software only. Such a controller can get the [`Coefficients`](crate::Coefficients)
    /// from a host instead.
    ///
    /// # Errors
    ///
    /// [`LawError`] for an invalid step, horizon or tolerance, for fewer modes than the model has discrete relaxation times,
    /// for a tail that misses the tolerance, and where the number type cannot hold the stiffness.
    pub fn compressed(model: &Maxwell, options: LawOptions) -> Result<Self, LawError> {
        let (memory, instant) = Compressed::new(model, options)?;
        Self::from_massless(options.step_s, instant, model.mass_kg(), memory, options.method)
    }

    /// The law of a massless `memory` for a film that carries `mass_kg`.
    pub(crate) fn from_massless(
        step_s: f64,
        instant: f64,
        mass_kg: f64,
        memory: Compressed<T, HEAD, FAST, SLOW>,
        method: Discretisation,
    ) -> Result<Self, LawError> {
        let memory = memory.with_inertia(mass_kg / (step_s * step_s), method)?;
        Self::from_memory(step_s, instant, mass_kg, memory, method)
    }

    /// A state at rest at x = 0.
    #[must_use]
    pub fn state(&self) -> LawState<T, Compressed<T, HEAD, FAST, SLOW>> {
        self.placed(LawState::with_history(CompressedHistory {
            increments: [[T::ZERO; HEAD]; 2],
            newest: 0,
            left: T::ZERO,
            left_surplus: T::ZERO,
            fast: [T::ZERO; FAST],
            slow: [Dashpot { displacement: T::ZERO, surplus: T::ZERO }; SLOW],
        }))
    }
}

impl<T: Scalar, const HEAD: usize, const FAST: usize, const SLOW: usize> Law<T, Compressed<T, HEAD, FAST, SLOW>> {
    /// Visits the constants of a step.
    #[doc(hidden)]
    pub fn numbers(&self, take: &mut impl Numbers<T>) {
        let Compressed { head, fast, slow, .. } = self.memory();
        take.structure("law", "The law of a film: F_k = sum over g_j dx_(k-j), the inertia included.");
        take.number("stiffness", self.stiffness(), "force per displacement within one step, N/m");
        take.array("head", *head, "g_0 + g_1, g_2, ..., N/m");
        take.records("fast", &DECAY, fast.map(Decay::numbers), "fastest first");
        take.records("slow", &DECAY, slow.map(Decay::numbers), "");
        self.curve_numbers(take);
    }
}

impl<T: Scalar, const HEAD: usize, const FAST: usize, const SLOW: usize> Compressed<T, HEAD, FAST, SLOW> {
    pub(crate) const SIZES_FIT: () = assert!(
        HEAD >= 1 && HEAD + 2 <= TERMS && FAST + SLOW >= 1 && FAST + SLOW <= MAX_NODES,
        "a compressed memory has a head of 1…62 increments and 1…64 modes"
    );

    /// The largest error of the relaxation modulus beyond the head, relative to the model's modulus K(1/t) at that
    /// time t, from the first step after the head to the horizon.
    #[must_use]
    pub fn tail_error(&self) -> f64 {
        self.tail_error
    }

    /// The modes as (1 − ρ, weight in N/m), fastest first; unused ones have weight 0.
    pub fn modes(&self) -> impl Iterator<Item = (T, T)> + '_ {
        self.fast.iter().chain(&self.slow).map(|decay| (decay.loss, decay.weight))
    }

    /// The memory without inertia, and g_0.
    fn new(model: &Maxwell, options: LawOptions) -> Result<(Self, f64), LawError> {
        let () = Self::SIZES_FIT;
        let LawOptions { step_s, horizon_s, tolerance, method } = options;
        if !(step_s.is_finite() && step_s > 0.0) {
            return Err(LawError::Step(step_s));
        }
        #[allow(clippy::cast_precision_loss)] // a head is short
        let head_s = (HEAD + 2) as f64 * step_s;
        if !(horizon_s.is_finite() && horizon_s > 2.0 * head_s) {
            return Err(LawError::Horizon { horizon_s, head_s });
        }
        if tolerance.is_nan() || tolerance <= 0.0 {
            return Err(LawError::Tolerance(tolerance));
        }

        let kernel = Kernel::new(model, step_s, method);
        let modes = tail::modes(model, step_s, horizon_s, HEAD, FAST + SLOW, method)?;
        let tail_error = tail::error(model, &kernel, &modes, horizon_s, HEAD);
        if tail_error.is_nan() {
            return Err(LawError::NothingToSolve);
        }
        if tail_error > tolerance {
            return Err(LawError::ToleranceMissed { reached: tail_error, asked: tolerance });
        }

        let g = kernel.head();
        let mut head = [T::ZERO; HEAD];
        head[0] = T::from_f64(g[0] + g[1]);
        for (weight, &g) in head[1..].iter_mut().zip(&g[2..]) {
            *weight = T::from_f64(g);
        }
        if method != Discretisation::Gl {
            let missed = tail::missed(g, &modes, HEAD);
            head[HEAD - 1] = T::from_f64(if HEAD == 1 { g[0] + g[1] } else { g[HEAD] } + missed);
        }
        // The slowest modes go to the compensated slots; unused slots stay zero.
        let (fast, slow) = modes.split_at(modes.len() - modes.len().min(SLOW));
        let massless = [T::ZERO; INERTIA];
        Ok((Self { head, fast: Decay::table(fast), slow: Decay::table(slow), tail_error, massless }, g[0]))
    }

    /// The massless memory with the part of the inertia m (δ/h)² that acts on the increments before the last change of the
    /// increment; what acts on that change is in the law's stiffness. Nothing in the discretisation of first order.
    fn with_inertia(mut self, mass_per_step2: f64, method: Discretisation) -> Result<Self, LawError> {
        for (massless, &head) in self.massless.iter_mut().zip(&self.head) {
            *massless = head;
        }
        if method == Discretisation::Gl || mass_per_step2 == 0.0 {
            return Ok(self);
        }
        if HEAD < INERTIA {
            return Err(LawError::HeadTooShort { head: HEAD, needed: INERTIA });
        }
        self.head = self.inert_head(mass_per_step2, method);
        Ok(self)
    }

    /// The head with the inertia of a second-order method.
    pub(crate) fn inert_head(&self, mass_per_step2: f64, method: Discretisation) -> [T; HEAD] {
        let mut inert = self.massless_head();
        if method != Discretisation::Gl && mass_per_step2 > 0.0 {
            let (newest, [first, second, third]) = method.inertia();
            for (head, share) in inert.iter_mut().zip([newest + first, second, third]) {
                *head = T::from_f64(head.to_f64() + share * mass_per_step2);
            }
        }
        inert
    }

    /// The head without inertia.
    pub(crate) fn massless_head(&self) -> [T; HEAD] {
        let mut head = self.head;
        for (head, &massless) in head.iter_mut().zip(&self.massless) {
            *head = massless;
        }
        head
    }
}

impl<T: Scalar> Decay<T> {
    /// As [`DECAY`] names them.
    pub(crate) fn numbers(self) -> [T; 2] {
        [self.loss, self.weight]
    }

    fn table<const N: usize>(modes: &[DecayMode]) -> [Self; N] {
        let mut table = [Self { loss: T::ZERO, weight: T::ZERO }; N];
        for (entry, mode) in table.iter_mut().zip(modes) {
            *entry = Self { loss: T::from_f64(mode.loss()), weight: T::from_f64(mode.weight) };
        }
        table
    }
}

impl<T: Scalar, const HEAD: usize, const FAST: usize, const SLOW: usize> Steps<T> for Compressed<T, HEAD, FAST, SLOW> {
    type History = CompressedHistory<T, HEAD, FAST, SLOW>;
    type PerMode = PerMode<T, FAST, SLOW>;

    const MODES: usize = FAST + SLOW;

    #[inline]
    fn advance(&self, history: &mut Self::History, increment: T) -> T {
        let newest = match history.newest.min(HEAD - 1) {
            0 => HEAD - 1,
            n => n - 1,
        };
        history.newest = newest;
        // The slot of the newest increment still holds the oldest, which leaves the head.
        let oldest = history.increments[0][newest];
        history.increments[0][newest] = increment;
        history.increments[1][newest] = increment;

        let mut slow = T::ZERO;
        if SLOW > 0 {
            let left_before = history.left;
            let addend = oldest - history.left_surplus;
            let left = left_before + addend;
            history.left_surplus = (left - left_before) - addend;
            history.left = left;
            for (dashpot, decay) in history.slow.iter_mut().zip(&self.slow) {
                let before = dashpot.displacement;
                let addend = decay.loss * (left_before - before) - dashpot.surplus;
                let displacement = before + addend;
                dashpot.surplus = (displacement - before) - addend;
                dashpot.displacement = displacement;
                slow = slow + decay.weight * (left - displacement);
            }
        }
        let mut fast = T::ZERO;
        for (extension, decay) in history.fast.iter_mut().zip(&self.fast) {
            *extension = *extension + (oldest - decay.loss * *extension);
            fast = fast + decay.weight * *extension;
        }
        let recent = &history.increments.as_flattened()[newest..newest + HEAD];
        let head = self.head.iter().zip(recent).fold(T::ZERO, |sum, (&g, &dx)| sum + g * dx);
        slow + (fast + head)
    }

    fn leave_inertia(&mut self) {
        self.head = self.massless_head();
    }

    fn per_mode() -> Self::PerMode {
        PerMode { fast: [T::ZERO; FAST], slow: [T::ZERO; SLOW] }
    }

    #[inline]
    fn of_mode_mut(numbers: &mut Self::PerMode, index: usize) -> Option<&mut T> {
        if index < FAST { numbers.fast.get_mut(index) } else { numbers.slow.get_mut(index - FAST) }
    }

    #[inline]
    fn mode(&self, index: usize) -> [T; 2] {
        let decay = if index < FAST { self.fast.get(index) } else { self.slow.get(index - FAST) };
        decay.map_or([T::ZERO; 2], |decay| [decay.loss, decay.weight])
    }

    #[inline]
    fn extension(history: &Self::History, index: usize) -> T {
        if index < FAST {
            history.fast.get(index).copied().unwrap_or(T::ZERO)
        } else {
            history.slow.get(index - FAST).map_or(T::ZERO, |dashpot| history.left - dashpot.displacement)
        }
    }

    #[inline]
    fn relax(history: &mut Self::History, index: usize, flow: T) {
        if index < FAST {
            if let Some(extension) = history.fast.get_mut(index) {
                *extension = *extension - flow;
            }
        } else if let Some(dashpot) = history.slow.get_mut(index - FAST) {
            let addend = flow - dashpot.surplus;
            let displacement = dashpot.displacement + addend;
            dashpot.surplus = (displacement - dashpot.displacement) - addend;
            dashpot.displacement = displacement;
        }
    }

    fn response(&self, delay: Complex<f64>, difference: Complex<f64>) -> Complex<f64> {
        let modes = self.modes().map(|(loss, weight)| {
            // 1 − ρζ without cancellation near ζ = 1
            Complex::new(weight.to_f64(), 0.0) / (difference + delay * loss.to_f64())
        });
        let tail = modes.fold(Complex::ZERO, |sum, mode| sum + mode);
        self.head.iter().rev().fold(tail, |later, g| later * delay + g.to_f64())
    }
}
