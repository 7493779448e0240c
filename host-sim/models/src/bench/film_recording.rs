//! Recordings of the simulated film under a given voltage.

use std::path::Path;

use crate::bench::film::{Film, Instruments, Readings, Waveform};
use crate::error::Result;
use crate::files::output;
use crate::grid::Grid;

/// A film under a voltage: what its instruments recorded, and its displacement without their noise.
#[derive(Clone, Debug, PartialEq)]
pub struct FilmRecording {
    grid: Grid,
    /// Monitor of the voltage, V.
    pub voltage_v: Vec<f64>,
    /// Displacement sensor, m.
    pub displacement_m: Vec<f64>,
    /// Displacement of the film, m.
    pub film_displacement_m: Vec<f64>,
}

impl FilmRecording {
    /// Records `film` from rest under `waveform` with `instruments`, whose noise comes from `seed`.
    ///
    /// # Errors
    ///
    /// As [`Film::states`].
    pub fn new(film: &Film, waveform: &Waveform, grid: Grid, instruments: Instruments, seed: u64) -> Result<Self> {
        let times = grid.times_s();
        let states = film.states(film.rest(), &times, |t| waveform.voltage_v(t))?;
        let film_displacement_m: Vec<f64> = states.iter().map(|state| film.displacement_m(state)).collect();
        let mut readings = Readings::new(instruments, seed);
        // Rounded to the digits that recorders write.
        let (voltage_v, displacement_m) = times
            .iter()
            .zip(&film_displacement_m)
            .map(|(&t, &x)| (readings.voltage_v(waveform.voltage_v(t)), readings.displacement_m(x)))
            .map(|(v, x)| ((v * 1e2).round() / 1e2, (x * 1e8).round() / 1e8))
            .unzip();
        Ok(Self { grid, voltage_v, displacement_m, film_displacement_m })
    }

    /// Writes the recording as CSV under `comments`.
    ///
    /// # Errors
    ///
    /// [`Error::File`](crate::error::Error::File) where it cannot be written.
    pub fn write(&self, path: &Path, comments: &[String]) -> Result<()> {
        let time = self.grid.times_s();
        output::write_columns(
            path,
            comments,
            &[
                ("time_s", Some(time.as_slice())),
                ("voltage_v", Some(&self.voltage_v)),
                ("displacement_m", Some(&self.displacement_m)),
            ],
        )
    }

    /// Largest displacement of the film (m) in the first and in the last full period of `frequency_hz`.
    pub fn peaks_m(&self, frequency_hz: f64) -> [f64; 2] {
        let samples = self.grid.samples;
        let period = ((self.grid.rate_hz / frequency_hz) as usize).clamp(1, samples);
        let last_full = (samples / period - 1) * period;
        [0, last_full]
            .map(|from| self.film_displacement_m[from..][..period].iter().copied().fold(f64::NEG_INFINITY, f64::max))
    }
}
