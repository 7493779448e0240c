//! A law in numbers: computed where there is a fast processor, run where there is none.

use crate::error::LawError;
use crate::law::Law;
use crate::law::compressed::{Compressed, Decay};
use crate::scalar::Scalar;

/// The numbers of a [`Law`] with a [`Compressed`] memory.
///
/// Building a law evaluates its model a few thousand times in f64, which takes a controller about a second and 30 KiB of
/// program. A host can do it instead and send these numbers; the law that comes of them is the same, bit for bit.
#[derive(Clone, Debug, PartialEq)]
pub struct Coefficients<T, const HEAD: usize = 12, const FAST: usize = 12, const SLOW: usize = 24> {
    /// Step h, s.
    pub step_s: f64,
    /// g_0, N/m.
    pub instant: f64,
    /// Mass, kg.
    pub mass_kg: f64,
    /// g_0 + g_1, g_2, …, g_HEAD, N/m.
    pub head: [T; HEAD],
    /// Fast modes as (1 − ρ, weight in N/m), fastest first.
    pub fast: [(T, T); FAST],
    /// Slow modes, likewise.
    pub slow: [(T, T); SLOW],
    /// Largest error of the relaxation modulus beyond the head, relative to the modulus at that time.
    pub tail_error: f64,
}

impl<T: Scalar, const HEAD: usize, const FAST: usize, const SLOW: usize> Law<T, Compressed<T, HEAD, FAST, SLOW>> {
    /// The numbers of this law, whose model has the mass `mass_kg` (kg).
    #[must_use]
    pub fn coefficients(&self, mass_kg: f64) -> Coefficients<T, HEAD, FAST, SLOW> {
        let memory = self.memory();
        Coefficients {
            step_s: self.step_s(),
            instant: self.instant(),
            mass_kg,
            head: memory.head,
            fast: memory.fast.map(|decay| (decay.loss, decay.weight)),
            slow: memory.slow.map(|decay| (decay.loss, decay.weight)),
            tail_error: memory.tail_error(),
        }
    }

    /// The law of these numbers.
    ///
    /// # Errors
    ///
    /// [`LawError::Step`], [`LawError::Coefficient`] for numbers that no film has: what is not finite, modes that grow or
    /// push, and [`LawError::NothingToSolve`].
    pub fn from_coefficients(coefficients: &Coefficients<T, HEAD, FAST, SLOW>) -> Result<Self, LawError> {
        let &Coefficients { step_s, instant, mass_kg, head, fast, slow, tail_error } = coefficients;
        if !(step_s.is_finite() && step_s > 0.0) {
            return Err(LawError::Step(step_s));
        }
        let finite = |value: T| value.to_f64().is_finite();
        let decays =
            |(loss, weight): &(T, T)| (0.0..=1.0).contains(&loss.to_f64()) && finite(*weight) && weight.to_f64() >= 0.0;
        for (which, holds) in [
            ("instant", instant.is_finite() && instant >= 0.0),
            ("mass_kg", mass_kg.is_finite() && mass_kg >= 0.0),
            ("head", head.iter().all(|&g| finite(g))),
            ("fast", fast.iter().all(decays)),
            ("slow", slow.iter().all(decays)),
            ("tail_error", tail_error.is_finite() && tail_error >= 0.0),
        ] {
            if !holds {
                return Err(LawError::Coefficient(which));
            }
        }
        let decay = |(loss, weight)| Decay { loss, weight };
        let memory = Compressed { head, fast: fast.map(decay), slow: slow.map(decay), tail_error };
        Self::from_memory(step_s, instant, mass_kg, memory)
    }
}
