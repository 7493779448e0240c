//! A film as a law is made of it.

use springpot::{
    Compressed, CompressionBound, Curve, Discretisation, Law, LawError, LawOptions, Maxwell, Memory, Real, Spring,
};

use crate::error::{Error, Result};

/// Parameters that make a law: the model, and the elastic curve in front of it.
#[derive(Clone, Copy, Debug)]
pub struct Film<'a> {
    /// Eq. 11.
    pub model: &'a Maxwell,
    /// The curve; none for a linear film.
    pub curve: Option<&'a Curve>,
    /// The spring beside its memory, whose strain measure then is the curve; without a curve the spring is in series with the memory.
    pub spring: Option<&'a Spring>,
    /// How s is discretised.
    pub method: Discretisation,
}

/// Most steps per second of a law.
const MAX_RATE_HZ: f64 = 1e9;

/// The rate (Hz) that a controller keeps of `rate_hz`, in single precision: the one conversion, so that host and controller step one law.
pub fn controller_rate(rate_hz: f64) -> f64 {
    f64::from(rate_hz as f32)
}

impl Film<'_> {
    /// The law that the controller steps at `rate_hz`.
    pub fn compressed_law<T: Real>(self, rate_hz: f64) -> Result<Law<T, Compressed<T>>> {
        // Beyond, a horizon has more steps than can be counted.
        if rate_hz > MAX_RATE_HZ {
            return Err(Error::field("rate_hz", format!("{rate_hz:?} Hz; a law takes at most {MAX_RATE_HZ:e} Hz")));
        }
        let options = LawOptions::at_step(1.0 / controller_rate(rate_hz)).with_method(self.method);
        let law = Law::compressed(self.model, options).map_err(|error| match error {
            LawError::Step(_) | LawError::Horizon { .. } => {
                Error::field("rate_hz", format!("{rate_hz:?} Hz; a law needs at least 1e-3 Hz"))
            }
            error => error.into(),
        })?;
        self.behind(law)
    }

    /// How far a `law` of this film can be from full memory over the default horizon.
    #[must_use]
    pub fn compression_bound<T: Real>(self, law: &Law<T, Compressed<T>>) -> CompressionBound {
        law.compression_bound(self.model, LawOptions::DEFAULT_HORIZON_S)
    }

    /// `law` with the curves of this film.
    ///
    /// # Errors
    ///
    /// [`Error`] for a curve that the law is refused behind.
    pub fn behind<T: Real, M: Memory<T>>(self, law: Law<T, M>) -> Result<Law<T, M>> {
        Ok(match (self.curve, self.spring) {
            (Some(measure), Some(spring)) => law.beside(spring, measure)?,
            (Some(curve), None) => law.behind(curve)?,
            (None, Some(spring)) => law.in_series(spring)?,
            (None, None) => law,
        })
    }
}

impl<'a> From<&'a Maxwell> for Film<'a> {
    /// A linear film, stepped as in the paper.
    fn from(model: &'a Maxwell) -> Self {
        Self { model, curve: None, spring: None, method: Discretisation::Gl }
    }
}
