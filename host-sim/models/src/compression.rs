//! Cost of the compression of a law's memory, for machines and people.

use serde::Serialize;
use springpot::CompressionBound;

use crate::error::Result;
use crate::files::parameters::Film;

/// The bounds of the law that a controller steps.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Compression {
    /// Rate of the law, Hz.
    pub rate_hz: f64,
    /// Its bounds; null where they do not exist.
    #[serde(flatten)]
    pub bound: CompressionBound,
}

impl Compression {
    /// The bounds of the default law of `film` in f32 at `rate_hz`.
    pub fn new(film: Film<'_>, rate_hz: f64) -> Result<Self> {
        let law = film.compressed_law::<f32>(rate_hz)?;
        Ok(Self { rate_hz, bound: film.compression_bound(&law) })
    }

    /// One line of text.
    pub fn text(&self) -> String {
        let CompressionBound { horizon_s, force_per_increment, force_per_stroke, .. } = self.bound;
        let displacement = if self.bound.displacement_per_stroke.is_finite() {
            format!(
                "displacement within {:.1e} of the stroke and {:.1e} of the largest increment",
                self.bound.displacement_per_stroke, self.bound.displacement_per_increment
            )
        } else {
            "displacement without a bound (a mass behind a curve)".to_owned()
        };
        format!(
            "compression at {} Hz, over {horizon_s} s from rest: {displacement}, force within {force_per_stroke:.1e} N/m of \
             the stroke and {force_per_increment:.1e} N/m of the largest increment",
            self.rate_hz
        )
    }
}
