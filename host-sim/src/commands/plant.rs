//! `plant` (or `twin`): simulates a recording of a nonlinear film.

use super::prelude::*;
use crate::simulation::electrical::Monitors;
use crate::simulation::film::{Film, Instruments, Plant, Waveform};
use crate::simulation::film_recording::{self, Session};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Which film.
    #[arg(long, value_parser = named::<Plant>())]
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
    /// Recording to write: time_s, voltage_v, displacement_m.
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
    /// Add a tone of this amplitude, four samples a period, and record current_a, for self-sensing: the film in its circuit, with the noise of
    /// its converters.
    #[arg(long, value_name = "V", value_parser = quantity::volts)]
    tone: Option<f64>,
    /// Bits of the converters of voltage and current.
    #[arg(long, value_name = "N", requires = "tone", value_parser = clap::value_parser!(u32).range(8..=24), default_value_t = Monitors::default().bits)]
    bits: u32,
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

#[derive(Serialize)]
struct WithTone {
    out: String,
    samples: usize,
    /// Amplitude of the tone, V.
    tone_v: f64,
    /// Bits of the converters.
    bits: u32,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let session = arguments.session();
    let grid = session.grid()?;
    output::check(&arguments.out, &[], Folders::Exist)?;
    let film = Film::new(arguments.plant);
    let bar = Progress::unknown("integrate the film");
    if let Some(tone_v) = arguments.tone {
        let monitors = Monitors { bits: arguments.bits, ..Monitors::default() };
        let recording = film_recording::with_tone(&session, &film, monitors, tone_v)?;
        bar.finish_and_clear();
        film_recording::write_with_tone(&recording, &arguments.out)?;
        let report = WithTone { out: shown(&arguments.out), samples: grid.samples, tone_v, bits: arguments.bits };
        return terminal::report(json, &report, || {
            format!("{}: {} samples with a tone of {tone_v} V, {} bits", report.out, report.samples, report.bits)
        });
    }
    let recording = session.record(&film)?;
    bar.finish_and_clear();
    recording.write(&arguments.out)?;

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
    fn session(&self) -> Session {
        Session {
            waveform: Waveform { peak_v: self.peak_voltage, frequencies_hz: self.frequency.clone() },
            duration_s: self.duration,
            rate_hz: self.rate,
            instruments: Instruments {
                displacement_noise_m: self.noise,
                displacement_quantum_m: self.quantum,
                monitor_noise_v: self.monitor_noise,
            },
            seed: self.seed,
        }
    }
}
