use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use crate::bench::film::{Film, Instruments, Plant, Readings, Waveform};
use crate::error::{Error, Result, shown};
use crate::files::output::{self, Folders};
use crate::grid::Grid;
use crate::terminal;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Which film.
    #[arg(long, value_enum)]
    plant: Plant,
    /// Frequency of the unipolar voltage V̂/2 (1 − cos 2πft); give it more than once for several tones.
    #[arg(long, value_name = "HZ", required = true)]
    frequency: Vec<f64>,
    /// Length of the recording.
    #[arg(long, value_name = "S")]
    duration: f64,
    /// Samples per second.
    #[arg(long, value_name = "HZ")]
    rate: f64,
    /// Where the recording goes: time_s, voltage_v, displacement_m.
    #[arg(long, value_name = "REC.csv")]
    out: PathBuf,
    /// Peak of the voltage.
    #[arg(long, value_name = "V", default_value_t = 6000.0)]
    peak_voltage: f64,
    /// Seed of the sensors' noise.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// RMS noise of the displacement sensor, m.
    #[arg(long, value_name = "M", default_value_t = Instruments::default().displacement_noise_m)]
    noise: f64,
    /// Steps in which the displacement sensor reads, m; 0 for none.
    #[arg(long, value_name = "M", default_value_t = Instruments::default().displacement_quantum_m)]
    quantum: f64,
    /// RMS noise of the voltage monitor, V.
    #[arg(long, value_name = "V", default_value_t = Instruments::default().monitor_noise_v)]
    monitor_noise: f64,
}

#[derive(Serialize)]
struct Report {
    out: String,
    samples: usize,
    /// Stretch under the weight alone.
    rest_stretch: f64,
    /// Largest displacement in the first and in the last full period, without sensor noise, m.
    first_peak_m: f64,
    last_peak_m: f64,
}

/// A recording has no more samples: the film's states at all of them stand in memory.
const MOST_SAMPLES: usize = 20_000_000;

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let positive = |option, value: f64| {
        if value.is_finite() && value > 0.0 {
            Ok(())
        } else {
            Err(Error::option(option, format!("{value:?} must be finite and greater than 0")))
        }
    };
    let at_most = |option, value: f64, most: f64| {
        if (0.0..=most).contains(&value) {
            Ok(())
        } else {
            Err(Error::option(option, format!("{value:?} must be from 0 to {most}")))
        }
    };
    positive("--duration", arguments.duration)?;
    positive("--rate", arguments.rate)?;
    for &frequency in &arguments.frequency {
        positive("--frequency", frequency)?;
        if frequency > 0.5 * arguments.rate {
            let cause = format!("{frequency:?} Hz is above half the rate; a recording cannot show it");
            return Err(Error::option("--frequency", cause));
        }
    }
    at_most("--peak-voltage", arguments.peak_voltage, 1e6)?;
    at_most("--noise", arguments.noise, 1.0)?;
    at_most("--quantum", arguments.quantum, 1.0)?;
    at_most("--monitor-noise", arguments.monitor_noise, 1e6)?;
    let grid = Grid::covering(arguments.duration, arguments.rate)?;
    if !(2..=MOST_SAMPLES).contains(&grid.samples) {
        let cause = format!("{} samples at this rate; from 2 to {MOST_SAMPLES} are possible", grid.samples);
        return Err(Error::option("--duration", cause));
    }
    output::check(&arguments.out, &[], Folders::Exist)?;

    let film = Film::new(arguments.plant);
    let waveform = Waveform { peak_v: arguments.peak_voltage, frequencies_hz: arguments.frequency.clone() };
    let times: Vec<f64> = (0..grid.samples).map(|k| grid.time_s(k)).collect();
    let bar = terminal::spinner();
    bar.set_message("integrate the film");
    let states = film.states(film.rest(), &times, |t| waveform.voltage_v(t))?;
    bar.finish_and_clear();

    let instruments = Instruments {
        displacement_noise_m: arguments.noise,
        displacement_quantum_m: arguments.quantum,
        monitor_noise_v: arguments.monitor_noise,
    };
    let mut readings = Readings::new(instruments, arguments.seed);
    let truth: Vec<f64> = states.iter().map(|state| film.displacement_m(state)).collect();
    let (voltage, displacement): (Vec<f64>, Vec<f64>) = times
        .iter()
        .zip(&truth)
        .map(|(&t, &x)| (readings.voltage_v(waveform.voltage_v(t)), readings.displacement_m(x)))
        .unzip();
    let comments =
        ["a nonlinear film, simulated; not a measurement".to_owned(), format!("host-sim {}", command(arguments))];
    // Recorders write so many digits.
    let voltage: Vec<f64> = voltage.iter().map(|v| (v * 1e2).round() / 1e2).collect();
    let displacement: Vec<f64> = displacement.iter().map(|x| (x * 1e8).round() / 1e8).collect();
    output::write_columns(
        &arguments.out,
        &comments,
        &[("time_s", Some(&times)), ("voltage_v", Some(&voltage)), ("displacement_m", Some(&displacement))],
    )?;

    let slowest = arguments.frequency.iter().copied().fold(f64::INFINITY, f64::min);
    let period = ((grid.rate_hz / slowest) as usize).clamp(1, grid.samples);
    let last_full = (grid.samples / period - 1) * period;
    let peak = |from: usize| truth[from..][..period].iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let report = Report {
        out: shown(&arguments.out),
        samples: grid.samples,
        rest_stretch: film.rest_stretch(),
        first_peak_m: peak(0),
        last_peak_m: peak(last_full),
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

/// The command that makes this recording again.
fn command(arguments: &Arguments) -> String {
    let plant = match arguments.plant {
        Plant::Hossain => "hossain",
        Plant::Wang => "wang",
    };
    let frequencies: String = arguments.frequency.iter().map(|f| format!(" --frequency {f}")).collect();
    format!(
        "twin --plant {plant}{frequencies} --duration {} --rate {} --peak-voltage {} --seed {} --noise {} --quantum {} --monitor-noise {} --out {}",
        arguments.duration,
        arguments.rate,
        arguments.peak_voltage,
        arguments.seed,
        arguments.noise,
        arguments.quantum,
        arguments.monitor_noise,
        arguments.out.display()
    )
}
