//! Recordings of the simulated film under a given voltage.

use std::path::Path;

use springpot::{FilmReading, SelfSensing};

use crate::error::{Error, Result};
use crate::files::capacitance::ToneRecording;
use crate::files::output;
use crate::grid::Grid;
use crate::quantity::{at_most, positive};
use crate::simulation::closed_loop;
use crate::simulation::electrical::{ElectricalBench, FilmCircuit, Monitors};
use crate::simulation::film::{Film, Instruments, Readings, Waveform};
use crate::simulation::plant::NonlinearPlant;

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

/// A recording of `film` in its circuit: every tick of the tone of `tone_v` (V) on the session's voltage. The sensor reads in every tick.
///
/// # Errors
///
/// As [`Session::grid`], [`Error::Field`] for a tone that cannot be sensed, and [`Error::Computation`] where the film runs away.
pub fn with_tone(session: &Session, film: &Film, monitors: Monitors, tone_v: f64) -> Result<ToneRecording> {
    let grid = session.grid()?;
    let circuit = FilmCircuit::of_film(film);
    let (substeps, substep_s) = closed_loop::substeps(grid);
    let options = monitors.options(&circuit, tone_v, grid.step_s());
    let sensing = SelfSensing::<f32>::new(&circuit.relation_of_sizes(1e-3), options)
        .map_err(|error| Error::field("tone", error.to_string()))?;
    let mut plant = NonlinearPlant::at_rest(film, substep_s);
    let mut bench = ElectricalBench::new(circuit, monitors, &mut plant, (substeps, grid.step_s()), session.seed);
    let mut sensor = Readings::new(session.instruments, session.seed);
    // Only the tone of it is needed.
    let mut state = sensing.state();
    let mut recording = ToneRecording { step_s: grid.step_s(), ..ToneRecording::default() };
    for time_s in grid.times_s() {
        let drive = sensing.drive(&state, session.waveform.voltage_v(time_s) as f32);
        let reading = bench.tick(f64::from(drive));
        sensing.sense(
            &mut state,
            FilmReading { voltage_v: reading.voltage_v as f32, current_a: reading.current_a as f32 },
        );
        if !bench.plant().holds() {
            return Err(Error::Computation("the film runs away under this voltage (pull-in); lower it".into()));
        }
        recording.voltage_v.push((reading.voltage_v * 1e3).round() / 1e3);
        recording.current_a.push((reading.current_a * 1e11).round() / 1e11);
        recording.displacement_m.push((sensor.displacement_m(bench.plant().displacement_m()) * 1e8).round() / 1e8);
    }
    Ok(recording)
}

/// Writes `recording` as CSV.
pub fn write_with_tone(recording: &ToneRecording, path: &Path) -> Result<()> {
    let digits = |k: usize| (k as f64 * recording.step_s * 1e9).round() / 1e9;
    let time: Vec<f64> = (1..=recording.voltage_v.len()).map(digits).collect();
    output::write_columns(
        path,
        &[
            ("time_s", Some(time.as_slice())),
            ("voltage_v", Some(&recording.voltage_v)),
            ("current_a", Some(&recording.current_a)),
            ("displacement_m", Some(&recording.displacement_m)),
        ],
    )
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
