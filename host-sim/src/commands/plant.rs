//! `plant` (or `twin`): simulates a recording of a nonlinear film.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use crate::bench::film::{Film, Instruments, Plant, Waveform};
use crate::bench::film_recording::FilmRecording;
use crate::error::{Error, Result, shown};
use crate::files::output::{self, Folders};
use crate::grid::Grid;
use crate::progress::Progress;
use crate::quantity::{self, at_most, positive};
use crate::terminal;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Which film.
    #[arg(long, value_enum)]
    plant: Plant,
    /// Frequency of the unipolar voltage V̂/2 (1 − cos 2πft); give it more than once for several tones.
    #[arg(long, value_name = "HZ", value_parser = quantity::hertz, required = true)]
    frequency: Vec<f64>,
    /// Length of the recording.
    #[arg(long, value_name = "S", value_parser = quantity::seconds)]
    duration: f64,
    /// Samples per second.
    #[arg(long, value_name = "HZ", value_parser = quantity::hertz)]
    rate: f64,
    /// Where the recording goes: time_s, voltage_v, displacement_m.
    #[arg(long, value_name = "REC.csv")]
    out: PathBuf,
    /// Peak of the voltage.
    #[arg(long, value_name = "V", value_parser = quantity::volts, default_value_t = 6000.0)]
    peak_voltage: f64,
    /// Seed of the sensors' noise.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// RMS noise of the displacement sensor, m.
    #[arg(long, value_name = "M", value_parser = quantity::metres, default_value_t = Instruments::default().displacement_noise_m)]
    noise: f64,
    /// Resolution of the displacement sensor, m; 0 for none.
    #[arg(long, value_name = "M", value_parser = quantity::metres, default_value_t = Instruments::default().displacement_quantum_m)]
    quantum: f64,
    /// RMS noise of the voltage monitor, V.
    #[arg(long, value_name = "V", value_parser = quantity::volts, default_value_t = Instruments::default().monitor_noise_v)]
    monitor_noise: f64,
}

#[derive(Serialize)]
struct Report {
    out: String,
    samples: usize,
    /// Stretch under the weight alone.
    rest_stretch: f64,
    /// Largest displacement in the first full period, without sensor noise, m.
    first_peak_m: f64,
    /// The same in the last full period, m.
    last_peak_m: f64,
}

/// Largest number of samples of a recording: the film's states at all of them are kept in memory.
const MOST_SAMPLES: usize = 20_000_000;

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let grid = arguments.grid()?;
    output::check(&arguments.out, &[], Folders::Exist)?;
    let film = Film::new(arguments.plant);
    let waveform = Waveform { peak_v: arguments.peak_voltage, frequencies_hz: arguments.frequency.clone() };
    let instruments = Instruments {
        displacement_noise_m: arguments.noise,
        displacement_quantum_m: arguments.quantum,
        monitor_noise_v: arguments.monitor_noise,
    };
    let bar = Progress::unknown("integrate the film");
    let recording = FilmRecording::new(&film, &waveform, grid, instruments, arguments.seed)?;
    bar.finish_and_clear();
    let comments =
        ["a nonlinear film, simulated; not a measurement".to_owned(), format!("host-sim {}", arguments.command())];
    recording.write(&arguments.out, &comments)?;

    let slowest = arguments.frequency.iter().copied().fold(f64::INFINITY, f64::min);
    let [first_peak_m, last_peak_m] = recording.peaks_m(slowest);
    let report = Report {
        out: shown(&arguments.out),
        samples: grid.samples,
        rest_stretch: film.rest_stretch(),
        first_peak_m,
        last_peak_m,
    };
    terminal::report(json, &report, || {
        format!(
            "{}: {} samples, stretch at rest {:.2}, peak {:.2} mm in the first period, {:.2} mm in the last full one",
            report.out,
            report.samples,
            report.rest_stretch,
            1e3 * report.first_peak_m,
            1e3 * report.last_peak_m
        )
    })
}

impl Arguments {
    /// The grid of the recording, once all options are checked.
    fn grid(&self) -> Result<Grid> {
        positive("--duration", self.duration)?;
        positive("--rate", self.rate)?;
        for &frequency in &self.frequency {
            positive("--frequency", frequency)?;
            if frequency > 0.5 * self.rate {
                let cause = format!("{frequency:?} Hz is above half the rate; a recording cannot show it");
                return Err(Error::option("--frequency", cause));
            }
        }
        at_most("--peak-voltage", self.peak_voltage, 1e6)?;
        at_most("--noise", self.noise, 1.0)?;
        at_most("--quantum", self.quantum, 1.0)?;
        at_most("--monitor-noise", self.monitor_noise, 1e6)?;
        let grid = Grid::covering(self.duration, self.rate)?;
        if !(2..=MOST_SAMPLES).contains(&grid.samples) {
            let cause = format!("{} samples at this rate; from 2 to {MOST_SAMPLES} are possible", grid.samples);
            return Err(Error::option("--duration", cause));
        }
        Ok(grid)
    }

    /// The command that makes this recording again. It says `twin`, which every version of this tool understands.
    fn command(&self) -> String {
        let frequencies: String = self.frequency.iter().map(|f| format!(" --frequency {f}")).collect();
        format!(
            "twin --plant {}{frequencies} --duration {} --rate {} --peak-voltage {} --seed {} --noise {} --quantum {} \
             --monitor-noise {} --out {}",
            self.plant.name(),
            self.duration,
            self.rate,
            self.peak_voltage,
            self.seed,
            self.noise,
            self.quantum,
            self.monitor_noise,
            self.out.display()
        )
    }
}
