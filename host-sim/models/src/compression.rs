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
        let CompressionBound { displacement_per_increment, displacement_per_stroke, .. } = self.bound;
        let within = |unit: &str, [stroke, increment]: [f32; 2], unknown: &str| {
            if stroke.is_finite() {
                format!("within {stroke:.1e}{unit} of the stroke and {increment:.1e}{unit} of the largest increment")
            } else {
                format!("without a bound ({unknown})")
            }
        };
        let displacement = within("", [displacement_per_stroke, displacement_per_increment], "a mass and a curve");
        let force = within(" N/m", [force_per_stroke, force_per_increment], "a spring in series");
        format!(
            "compression at {} Hz, over {horizon_s} s from rest: displacement {displacement}, force {force}",
            self.rate_hz
        )
    }
}
