//! The memories that the law of a controller can have.

use core::fmt::Debug;

use serde::Serialize;
use serde::de::DeserializeOwned;
use springpot::{Coefficients, Compressed, Follower, Law, LawError, LawState, Memory, Numbers, Tracking};

/// The memory of the model that limits the stroke, for which 1 % is enough: see [`Law::coarser`].
pub(crate) type Watched = Compressed<f32, 4, 11, 7>;

/// A memory that the law of a controller can have: a [`Compressed`] of any size, in single precision.
///
/// ```
/// use dea_driver::{Blob, Controller, Parameters};
/// use springpot::{Actuator, Compressed, Law, LawOptions, Preset};
///
/// /// 8 + 18 weights instead of 12 + 36 make a cheaper tick.
/// type Lean = Compressed<f32, 8, 14, 4>;
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// let options = LawOptions::at_step(1e-3).with_horizon(3600.0).with_tolerance(1e-3);
/// let law: Law<f32, Lean> = Law::compressed(&Preset::TABLE3_N2.model()?, options)?;
/// let controller = Controller::new(Blob::new(Parameters::bench(&law, Actuator::KARNER_2022))?);
/// assert!(size_of_val(&controller) < size_of::<Controller>());
/// # Ok(())
/// # }
/// ```
///
/// The trait is sealed, as [`Memory`] is. Use it as a bound to write code for all of them.
pub trait ControllerMemory: Memory<f32, History: Clone + Debug> + Clone + Debug + PartialEq {
    /// Numbers of the law, as [`Parameters`](crate::Parameters) hold them.
    type Coefficients: Clone + Debug + PartialEq + Serialize + DeserializeOwned;

    /// Head, fast and slow weights.
    #[doc(hidden)]
    const SIZES: [usize; 3];

    /// The numbers of `law`.
    #[doc(hidden)]
    fn coefficients(law: &Law<f32, Self>) -> Self::Coefficients;

    /// Visits the constants of a tick of `follower`.
    #[doc(hidden)]
    fn numbers(follower: &Follower<f32, Tracking<f32, Self>>, take: &mut impl Numbers<f32>);

    /// Whether the law of `coefficients` has a spring beside its memory, and one in series with it.
    #[doc(hidden)]
    fn springs(coefficients: &Self::Coefficients) -> [bool; 2];

    /// The law of `coefficients`: [`Law::from_coefficients`].
    #[doc(hidden)]
    fn law(coefficients: &Self::Coefficients, step_s: f64, mass_kg: f64) -> Result<Law<f32, Self>, LawError>;

    /// A state of `law` at rest.
    #[doc(hidden)]
    fn at_rest(law: &Law<f32, Self>) -> LawState<f32, Self>;

    /// The law of the film that no sensor corrects.
    #[doc(hidden)]
    fn watched(law: &Law<f32, Self>) -> Law<f32, Compressed<f32, 4, 11, 7>>;
}

impl<const HEAD: usize, const FAST: usize, const SLOW: usize> ControllerMemory for Compressed<f32, HEAD, FAST, SLOW> {
    type Coefficients = Coefficients<f32, HEAD, FAST, SLOW>;

    const SIZES: [usize; 3] = [HEAD, FAST, SLOW];

    fn coefficients(law: &Law<f32, Self>) -> Self::Coefficients {
        law.coefficients()
    }

    fn numbers(follower: &Follower<f32, Tracking<f32, Self>>, take: &mut impl Numbers<f32>) {
        follower.compensator().numbers(take);
        follower.compensator().numbers_of_changes(take);
        if let Some(learning) = follower.learning() {
            learning.numbers(take);
        }
    }

    fn springs(coefficients: &Self::Coefficients) -> [bool; 2] {
        [coefficients.has_spring(), coefficients.has_spring_in_series()]
    }

    fn law(coefficients: &Self::Coefficients, step_s: f64, mass_kg: f64) -> Result<Law<f32, Self>, LawError> {
        Law::from_coefficients(coefficients, step_s, mass_kg)
    }

    fn at_rest(law: &Law<f32, Self>) -> LawState<f32, Self> {
        law.state()
    }

    fn watched(law: &Law<f32, Self>) -> Law<f32, Watched> {
        law.coarser()
    }
}
