//! A law in numbers: computed on a host, run on a controller.

use heapless::Vec;

use crate::curve::{Curve, Knot, MAX_SPRING_KNOTS, Spring};
use crate::error::LawError;
use crate::kernel::Discretisation;
use crate::law::compressed::{Compressed, Decay, INERTIA};
use crate::law::{Law, Memory};
use crate::scalar::Scalar;

/// The numbers of a [`Law`] with a [`Compressed`] memory, apart from its step and the mass.
///
/// Building a law evaluates its model a few thousand times in f64, which takes a controller about a second and 30 KiB of
/// program. A host can do it instead and send these numbers; the law built from them is the same, bit for bit.
///
/// With the feature `serde` they can be sent by any format of serde; arrays are tuples there, without a length.
///
/// ```
/// use springpot::{Coefficients, Law, LawError, LawOptions, Preset};
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// // On the host:
/// let model = Preset::TABLE3_N2.model()?;
/// let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(1e-3))?;
/// let coefficients: Coefficients<f32> = law.coefficients();
///
/// // On the controller, which knows its step and the film's mass:
/// let received = Law::from_coefficients(&coefficients, 1e-3, model.mass_kg())?;
/// assert_eq!(received, law);
///
/// // Values that no film has are refused.
/// let damaged = Coefficients { instant: f64::NAN, ..coefficients };
/// assert_eq!(Law::from_coefficients(&damaged, 1e-3, 0.0), Err(LawError::Coefficient("instant")));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(deny_unknown_fields, bound(serialize = "T: serde::Serialize", deserialize = "T: serde::Deserialize<'de>"))
)]
pub struct Coefficients<T, const HEAD: usize = 12, const FAST: usize = 12, const SLOW: usize = 24> {
    /// How s is discretised.
    pub method: Discretisation,
    /// g_0, N/m.
    pub instant: f64,
    /// Largest error of the relaxation modulus beyond the head, relative to the modulus at that time.
    pub tail_error: f64,
    /// Unused: bytes that older versions filled with a bound of the compression. They keep the format of stored coefficients.
    #[doc(hidden)]
    pub reserved: [u8; 20],
    /// g_0 + g_1, g_2, …, g_HEAD, N/m.
    #[cfg_attr(feature = "serde", serde(with = "arrays"))]
    pub head: [T; HEAD],
    /// Fast modes as (1 − ρ, weight in N/m), fastest first.
    #[cfg_attr(feature = "serde", serde(with = "arrays"))]
    pub fast: [(T, T); FAST],
    /// Slow modes, likewise.
    #[cfg_attr(feature = "serde", serde(with = "arrays"))]
    pub slow: [(T, T); SLOW],
    /// Knots of the elastic curve, none without one; after them those of the spring, from the first knot that is not to the right of the one
    /// before it. A spring in series with the memory follows a single knot, (0, 0) with the slope 1.
    pub curve: Vec<Knot<T>, { 2 * MAX_SPRING_KNOTS }>,
}

impl<T: Scalar, const HEAD: usize, const FAST: usize, const SLOW: usize> Law<T, Compressed<T, HEAD, FAST, SLOW>> {
    /// The numbers of this law.
    #[must_use]
    pub fn coefficients(&self) -> Coefficients<T, HEAD, FAST, SLOW> {
        let memory = self.memory();
        Coefficients {
            method: self.method(),
            instant: self.instant(),
            tail_error: memory.tail_error(),
            reserved: [0; 20],
            head: memory.massless_head(),
            fast: memory.fast.map(|decay| (decay.loss, decay.weight)),
            slow: memory.slow.map(|decay| (decay.loss, decay.weight)),
            curve: self.knots().collect(),
        }
    }

    /// The law of `coefficients` at step `step_s` (s), for which they must have been computed, for a film that carries `mass_kg` (kg).
    ///
    /// # Errors
    ///
    /// [`LawError::Step`], [`LawError::Coefficient`] for values that no film has (non-finite, modes that grow or have a
    /// negative weight), [`LawError::HeadTooShort`], [`LawError::NothingToSolve`] and [`LawError::Curve`].
    pub fn from_coefficients(
        coefficients: &Coefficients<T, HEAD, FAST, SLOW>,
        step_s: f64,
        mass_kg: f64,
    ) -> Result<Self, LawError> {
        let &Coefficients { method, instant, tail_error, head, fast, slow, ref curve, .. } = coefficients;
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
        let massless = [T::ZERO; INERTIA];
        let memory = Compressed { head, fast: fast.map(decay), slow: slow.map(decay), tail_error, massless };
        // In place: a law takes a good part of a small controller's stack.
        let mut law = Self::from_massless(step_s, instant, mass_kg, memory, method)?;
        law.add_curves(curve)?;
        Ok(law)
    }
}

impl<T: Scalar, M: Memory<T>> Law<T, M> {
    /// Adds the curves of [`Coefficients::curve`].
    fn add_curves(&mut self, knots: &[Knot<T>]) -> Result<(), LawError> {
        let (curve, spring) = knots.split_at(curve_len(knots));
        match (curve, spring) {
            ([], _) => Ok(()),
            ([straight], [_, ..]) if straight.wide() == Knot::straight() => self.add_rounded(spring, Self::add_series),
            (_, []) => self.add_curve(curve),
            (_, _) => self.add_curve(curve).and_then(|()| self.add_rounded(spring, Self::add_spring)),
        }
    }

    /// Not inlined, here and below: knots in f64 would stay on the stack of a small chip.
    #[inline(never)]
    fn add_curve(&mut self, knots: &[Knot<T>]) -> Result<(), LawError> {
        // By reference: `?` would copy it.
        match &Curve::from_rounded(knots) {
            Ok(curve) => self.bend(curve),
            Err(error) => Err((*error).into()),
        }
    }

    #[inline(never)]
    fn add_rounded(
        &mut self,
        knots: &[Knot<T>],
        add: impl Fn(&mut Self, &Spring) -> Result<(), LawError>,
    ) -> Result<(), LawError> {
        match &Spring::from_rounded(knots) {
            Ok(spring) => add(self, spring),
            Err(error) => Err((*error).into()),
        }
    }
}

impl<T: Scalar, const HEAD: usize, const FAST: usize, const SLOW: usize> Coefficients<T, HEAD, FAST, SLOW> {
    /// Whether a spring is beside the memory.
    #[must_use]
    pub fn has_spring(&self) -> bool {
        (2..self.curve.len()).contains(&curve_len(&self.curve))
    }

    /// Whether a spring is in series with the memory.
    #[must_use]
    pub fn has_spring_in_series(&self) -> bool {
        let (curve, spring) = self.curve.split_at(curve_len(&self.curve));
        matches!(curve, [knot] if knot.wide() == Knot::straight()) && !spring.is_empty()
    }
}

/// How many of `knots` are of the curve. Both ranges hold 0, so that a spring begins at or to the left of where the curve ends.
fn curve_len<T: Scalar>(knots: &[Knot<T>]) -> usize {
    let ends = |pair: &[Knot<T>]| !pair[0].displacement.is_below(pair[1].displacement);
    // One knot alone is the straight curve of a film with a spring in series.
    knots.windows(2).position(ends).map_or(knots.len(), |last| last + 1)
}

/// Arrays of any length as tuples: serde itself has them up to 32 only, and not of a generic length.
#[cfg(feature = "serde")]
mod arrays {
    use core::fmt;
    use core::marker::PhantomData;

    use heapless::Vec;
    use serde::de::{Deserialize, Deserializer, Error, SeqAccess, Visitor};
    use serde::ser::{Serialize, SerializeTuple, Serializer};

    pub(super) fn serialize<E: Serialize, S: Serializer, const N: usize>(
        array: &[E; N],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(N)?;
        for element in array {
            tuple.serialize_element(element)?;
        }
        tuple.end()
    }

    pub(super) fn deserialize<'de, E, D, const N: usize>(deserializer: D) -> Result<[E; N], D::Error>
    where
        E: Deserialize<'de>,
        D: Deserializer<'de>,
    {
        deserializer.deserialize_tuple(N, Elements(PhantomData))
    }

    struct Elements<E, const N: usize>(PhantomData<E>);

    impl<'de, E: Deserialize<'de>, const N: usize> Visitor<'de> for Elements<E, N> {
        type Value = [E; N];

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(f, "an array of {N}")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<Self::Value, A::Error> {
            let mut elements = Vec::<E, N>::new();
            while elements.len() < N {
                let length = elements.len();
                let element = sequence.next_element()?.ok_or_else(|| Error::invalid_length(length, &self))?;
                // There is room for N.
                let _ = elements.push(element);
            }
            elements.into_array().map_err(|elements| Error::invalid_length(elements.len(), &self))
        }
    }
}
