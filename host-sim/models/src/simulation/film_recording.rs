//! Recordings of the simulated film under a given voltage.

use std::path::Path;

use crate::error::{Error, Result};
use crate::files::output;
use crate::grid::Grid;
use crate::quantity::{at_most, positive};
use crate::simulation::film::{Film, Instruments, Readings, Waveform};

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

    /// Writes the recording as CSV.
    pub fn write(&self, path: &Path) -> Result<()> {
        let time = self.grid.times_s();
        output::write_columns(
            path,
            &[
                ("time_s", Some(time.as_slice())),
                ("voltage_v", Some(&self.voltage_v)),
                ("displacement_m", Some(&self.displacement_m)),
            ],
        )
    }

    /// Its samples.
    pub fn grid(&self) -> Grid {
        self.grid
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

/// The signal that is played to a film at rest, and the instruments that record it.
#[derive(Clone, Debug, PartialEq)]
pub struct Session {
    /// The voltage.
    pub waveform: Waveform,
    /// Length of the recording, s.
    pub duration_s: f64,
    /// Samples per second.
    pub rate_hz: f64,
    /// Sensor and monitor.
    pub instruments: Instruments,
    /// Seed of their noise.
    pub seed: u64,
}

/// Largest number of samples of a recording: the film's states at all of them are kept in memory.
const MAX_SAMPLES: usize = 20_000_000;

impl Session {
    /// The grid of the recording.
    ///
    /// # Errors
    ///
    /// [`Error::Field`] naming what no bench has.
    pub fn grid(&self) -> Result<Grid> {
        let Self { waveform, duration_s, rate_hz, instruments, .. } = self;
        positive("duration_s", *duration_s)?;
        positive("rate_hz", *rate_hz)?;
        if waveform.frequencies_hz.is_empty() {
            return Err(Error::field("frequency_hz", "none is given; a voltage has at least one"));
        }
        for &frequency in &waveform.frequencies_hz {
            positive("frequency_hz", frequency)?;
            if frequency > 0.5 * rate_hz {
                let cause = format!("{frequency:?} Hz is above half the rate; a recording cannot show it");
                return Err(Error::field("frequency_hz", cause));
            }
        }
        at_most("peak_voltage_v", waveform.peak_v, 1e6)?;
        at_most("noise_m", instruments.displacement_noise_m, 1.0)?;
        at_most("quantum_m", instruments.displacement_quantum_m, 1.0)?;
        at_most("monitor_noise_v", instruments.monitor_noise_v, 1e6)?;
        let grid = Grid::covering(*duration_s, *rate_hz)?;
        if !(2..=MAX_SAMPLES).contains(&grid.samples) {
            let cause = format!("{} samples at this rate; from 2 to {MAX_SAMPLES} are possible", grid.samples);
            return Err(Error::field("duration_s", cause));
        }
        Ok(grid)
    }

    /// The recording of `film`.
    ///
    /// # Errors
    ///
    /// As [`grid`](Self::grid) and [`FilmRecording::new`].
    pub fn record(&self, film: &Film) -> Result<FilmRecording> {
        FilmRecording::new(film, &self.waveform, self.grid()?, self.instruments, self.seed)
    }
}
