//! `closed-loop`: a controller follows a reference on a simulated film.

use std::num::NonZeroUsize;

use springpot::{AmplifierLag, CommandLimits, SelfSensing};

use super::options::{self, AtTemperature, LimitOptions};
use super::prelude::*;
use super::recordings::{RecordingOptions, report_sampling};
use crate::choice::Choice;
use crate::files::capacitance::CapacitanceFile;
use crate::files::recording::Recording;
use crate::grid::Grid;
use crate::quantity::{at_most, positive};
use crate::references;
use crate::replay::feasibility;
use crate::replay::memory::Precision;
use crate::report::figure::Figure;
use crate::report::figure_file::{Plot, PlotOption};
use crate::report::tracking_figure;
use crate::simulation::closed_loop::{self, BenchModel, LimitShare, LoopRun, TrackingQuality};
use crate::simulation::controllers::{self, Controller, ControllerKind};
use crate::simulation::electrical::{ElectricalBench, FilmCircuit, Monitors};
use crate::simulation::film::{self, Film};
use crate::simulation::plant::{FullMemoryPlant, Mismatch, NonlinearPlant};
use crate::simulation::self_sensed::{self, SensedBench};
use crate::simulation::tuning::ControllerTuning;
use crate::terminal::decimals;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Film: hossain or wang, or a parameter file (or preset:NAME), whose model runs with full memory and its own actuator.
    #[arg(long, value_name = "FILM", value_parser = plant_choice)]
    plant: PlantChoice,
    /// Change of the film: stiffness=F multiplies its stiffness, alpha=F all orders (parameter files only), with the stiffness
    /// at 1 rad/s kept.
    #[arg(long, value_name = "NAME=FACTOR,…", value_delimiter = ',', value_parser = mismatch_factor)]
    plant_mismatch: Vec<MismatchFactor>,
    /// Temperature of the film, °C, where it is a parameter file that was fitted at several.
    #[arg(long, value_name = "C", allow_negative_numbers = true, value_parser = quantity::celsius)]
    plant_temperature: Option<f64>,
    /// Parameter file (TOML), or preset:NAME such as preset:table3-n2.
    #[arg(long, value_name = "P")]
    params: String,
    #[command(flatten)]
    temperature: AtTemperature,
    /// Reference to follow: time_s, displacement_m.
    #[arg(long, value_name = "REF.csv")]
    reference: PathBuf,
    /// Which controller.
    #[arg(long, value_parser = named::<ControllerKind>())]
    controller: ControllerKind,
    /// Run to write: time_s, voltage_v, displacement_m, reference_m, limited, estimate_m, disturbance_n, force_scale.
    #[arg(long, value_name = "CSV")]
    out: Option<PathBuf>,
    /// Write every so many steps; as many rows as the reference has, and at least 100 per second, if left out.
    #[arg(long, value_name = "N")]
    every: Option<NonZeroUsize>,
    #[command(flatten)]
    reading: RecordingOptions,
    #[command(flatten)]
    plot: PlotOption,
    /// File of the command self-sensing: the film is its own sensor, in its circuit; hossain and wang only. It gives interval and delay of the
    /// samples. Hold for long with --adaptation 0.
    #[arg(long, value_name = "C.toml", conflicts_with_all = ["sensor_noise", "sensor_rate", "sensor_delay", "sensor_quantum", "sensor_lost",
        "amplifier_lag", "amplifier_bleeder", "monitor_error"])]
    self_sensing: Option<PathBuf>,
    /// Steps per second.
    #[arg(long, value_name = "HZ", value_parser = quantity::hertz, default_value_t = 1000.0)]
    rate: f64,
    /// Arithmetic of the controller.
    #[arg(long, value_parser = named::<Precision>(), default_value = "f32")]
    precision: Precision,
    /// Seed of the sensors' noise.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Bandwidth of tracking (default: the parameters', else 0.6), or of pi (default: 0.8); the default is lower where the model's resonance or the
    /// sensor's delay allows no more.
    #[arg(long, value_name = "HZ", value_parser = quantity::hertz)]
    bandwidth: Option<f64>,
    /// Time constant with which the force scale adapts to a disturbance that swings with the load; 0: never (default: the
    /// parameters', else 30).
    #[arg(long, value_name = "S", value_parser = quantity::seconds)]
    adaptation: Option<f64>,
    /// Learn the mean and this many harmonics (1 to 6) of the error of a periodic reference; feedforward and tracking only.
    #[arg(long, value_name = "N")]
    harmonics: Option<usize>,
    /// Period of the reference for --harmonics; taken from the reference if left out.
    #[arg(long, value_name = "S", value_parser = quantity::seconds, requires = "harmonics")]
    period: Option<f64>,
    /// Factor on the film's stiffness: the same as --plant-mismatch stiffness=FACTOR.
    #[arg(long, value_name = "FACTOR", value_parser = quantity::number)]
    stiffness: Option<f64>,
    #[command(flatten)]
    limits: LimitOptions,
    #[command(flatten)]
    sensor: SensorOptions,
}

/// A plant on the command line.
#[derive(Clone, Debug)]
enum PlantChoice {
    Nonlinear(film::Plant),
    Parameters(String),
}

fn plant_choice(text: &str) -> std::result::Result<PlantChoice, String> {
    match film::Plant::from_name(text) {
        Some(film) => Ok(PlantChoice::Nonlinear(film)),
        None if text.starts_with("preset:") || Path::new(text).exists() => Ok(PlantChoice::Parameters(text.into())),
        None => Err("use hossain, wang, a parameter file or preset:NAME".into()),
    }
}

/// A quantity of the plant, and its factor.
#[derive(Clone, Copy, Debug)]
enum MismatchFactor {
    Stiffness(f64),
    Alpha(f64),
}

fn mismatch_factor(text: &str) -> std::result::Result<MismatchFactor, String> {
    let usage = || "use stiffness=FACTOR or alpha=FACTOR, from 0.2 to 5".to_owned();
    let (name, factor) = text.split_once('=').ok_or_else(usage)?;
    let factor = quantity::number(factor).ok().filter(|factor| (0.2..=5.0).contains(factor)).ok_or_else(usage)?;
    match name {
        "stiffness" => Ok(MismatchFactor::Stiffness(factor)),
        "alpha" => Ok(MismatchFactor::Alpha(factor)),
        _ => Err(usage()),
    }
}

#[derive(Clone, Debug, Args)]
struct SensorOptions {
    /// RMS noise of the displacement sensor.
    #[arg(long, value_name = "M", value_parser = quantity::metres, default_value_t = BenchModel::default().sensor_noise_m)]
    sensor_noise: f64,
    /// Samples of the displacement sensor per second; the parameters' or 100 if left out.
    #[arg(long, value_name = "HZ", value_parser = quantity::hertz)]
    sensor_rate: Option<f64>,
    /// Time until a sample arrives; the parameters' or 10 ms if left out.
    #[arg(long, value_name = "S", value_parser = quantity::seconds)]
    sensor_delay: Option<f64>,
    /// Resolution of the sensor; 0 for none.
    #[arg(long, value_name = "M", value_parser = quantity::metres, default_value_t = BenchModel::default().sensor_quantum_m)]
    sensor_quantum: f64,
    /// Times from which and to which the sensor is lost, such as 60:90; may be given more than once.
    #[arg(long, value_name = "FROM:TO", value_parser = interval)]
    sensor_lost: Vec<(f64, f64)>,
    /// Time constant of the amplifier; 0: none.
    #[arg(long, value_name = "S", value_parser = quantity::seconds, default_value_t = 0.0)]
    amplifier_lag: f64,
    /// Time constant of the fastest fall of the voltage, by the amplifier's bleeder; 0: no limit. The controller uses rise_s and
    /// fall_s of board.amplifier.
    #[arg(long, value_name = "S", value_parser = quantity::seconds, default_value_t = 0.0)]
    amplifier_bleeder: f64,
    /// Relative error of the voltage monitor, which has 3 V of noise. If left out, the controller reads no monitor; where the board's
    /// amplifier lags it reads one without error.
    #[arg(long, value_name = "SHARE", value_parser = quantity::share)]
    monitor_error: Option<f64>,
}

fn interval(text: &str) -> std::result::Result<(f64, f64), String> {
    text.split_once(':')
        .and_then(|(from, to)| Some((quantity::seconds(from).ok()?, quantity::seconds(to).ok()?)))
        .filter(|(from, to)| from < to)
        .ok_or_else(|| "use FROM:TO, such as 60s:90s, FROM before TO".into())
}

impl SensorOptions {
    /// The bench of a controller within `limits`, which reads its monitor where the amplifier lags, as the driver does.
    fn bench(
        &self,
        limits: &CommandLimits,
        (sensor_rate_hz, sensor_delay_s): (f64, f64),
        seed: u64,
    ) -> Result<BenchModel> {
        at_most("sensor_noise", self.sensor_noise, 1.0)?;
        at_most("sensor_quantum", self.sensor_quantum, 1.0)?;
        at_most("amplifier_lag", self.amplifier_lag, 10.0)?;
        at_most("amplifier_bleeder", self.amplifier_bleeder, 10.0)?;
        at_most("monitor_error", self.monitor_error.unwrap_or(0.0).abs(), 0.5)?;
        Ok(BenchModel {
            sensor_noise_m: self.sensor_noise,
            sensor_rate_hz,
            sensor_delay_s,
            sensor_quantum_m: self.sensor_quantum,
            sensor_lost_s: self.sensor_lost.clone(),
            amplifier_lag_s: self.amplifier_lag,
            amplifier_bleeder_s: self.amplifier_bleeder,
            monitor_error: self.monitor_error.or((limits.amplifier != AmplifierLag::NONE).then_some(0.0)),
            seed,
        })
    }
}

#[derive(Serialize)]
struct Report {
    controller: &'static str,
    samples: usize,
    /// The harmonics that were learned.
    #[serde(skip_serializing_if = "Option::is_none")]
    harmonics: Option<usize>,
    #[serde(flatten)]
    quality: TrackingQuality,
    #[serde(skip_serializing_if = "Option::is_none")]
    out: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    plot: Option<String>,
    /// Note on the electric field, if the film's sizes are assumed.
    #[serde(skip_serializing_if = "Option::is_none")]
    field_note: Option<String>,
    /// Note on the observer's bandwidth, if it is lower than the default.
    #[serde(skip_serializing_if = "Option::is_none")]
    bandwidth_note: Option<String>,
    /// Note on the period, if it is not the reference's.
    #[serde(skip_serializing_if = "Option::is_none")]
    cycles_note: Option<String>,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    if let Some(factor) = arguments.stiffness.filter(|factor| !(0.2..=5.0).contains(factor)) {
        return Err(Error::field("stiffness", format!("{factor:?} must be from 0.2 to 5")));
    }
    let mismatch = arguments.mismatch()?;
    let parameters = arguments.temperature.load(&arguments.params)?;
    let mut limits = arguments.limits.limits(parameters.board.as_ref())?;
    let own_sensor = arguments.self_sensing.as_deref().map(CapacitanceFile::read).transpose()?;
    let own = own_sensor.as_ref().map(|file| &file.options);
    if let Some(options) = own {
        if (options.step_s * arguments.rate - 1.0).abs() > 1e-6 {
            let cause = format!("{:?} Hz is not the rate of the tone, {:.1} Hz", arguments.rate, 1.0 / options.step_s);
            return Err(Error::field("rate", cause));
        }
        // Room for the tone.
        limits.max_voltage_v -= options.tone_v;
        positive("max_voltage", limits.max_voltage_v)?;
    }
    let tuning = ControllerTuning {
        rate_hz: arguments.rate,
        bandwidth_hz: arguments.bandwidth,
        adaptation_s: arguments.adaptation,
        sensor_rate_hz: own.map(|options| 1.0 / options.sample_interval_s()).or(arguments.sensor.sensor_rate),
        sensor_delay_s: own
            .map(|options| options.age_ticks() as f64 * options.step_s)
            .or(arguments.sensor.sensor_delay),
        harmonics: arguments.harmonics,
        period_s: arguments.period,
    };
    let bench = arguments.sensor.bench(&limits, tuning.sensor(&parameters), arguments.seed)?;
    let mut settings = tuning.settings(arguments.controller, &parameters, limits)?;
    let asked = arguments.reading.read_reference(&arguments.reference)?;
    report_sampling(&asked, &asked.displacement_drive()?, arguments.rate);
    let (reference, grid) = references::on_grid(&asked, arguments.rate)?;
    let plot = arguments.check_outputs()?;
    settings.peak_m = reference.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let about = |error: Error| error.about(&arguments.params, &arguments.reference);
    let mut controller =
        controllers::build(arguments.controller, &parameters, &settings, arguments.precision).map_err(about)?;

    let bar = Progress::over(grid.samples as u64, "closed loop");
    let run = match &own_sensor {
        Some(file) => arguments.tracked_by_itself(file, controller.as_mut(), (&reference, grid), mismatch, &bar),
        None => arguments.tracked(&bench, controller.as_mut(), (&reference, grid), mismatch, &bar),
    };
    bar.finish_and_clear();
    let run = run.map_err(about)?;
    let is_chosen = arguments.bandwidth.is_none() && arguments.controller.has_observer();
    let bandwidth_note = || parameters.bandwidth_note(arguments.rate, settings.observer.bandwidth_hz);
    let report = Report {
        cycles_note: tuning.cycles_note(&reference),
        bandwidth_note: if is_chosen { bandwidth_note() } else { None },
        controller: arguments.controller.name(),
        samples: grid.samples,
        harmonics: arguments.harmonics,
        quality: run.quality(),
        out: arguments.out.as_deref().map(shown),
        plot: arguments.plot.path().map(shown),
        field_note: options::field_note(&parameters),
    };
    let out = arguments.out.as_deref().map(|path| stage(path, &run, grid, arguments.step(&asked))).transpose()?;
    let name = arguments.controller.name();
    let figure = || Figure::new(format!("Closed loop: {name}"), tracking_figure::panels(&[(name, &run)], grid));
    plot.write(&report, out, figure)?;
    let beyond = feasibility::beyond_board(&parameters, &reference);
    let notes = [&report.field_note, &report.bandwidth_note, &report.cycles_note, &beyond];
    terminal::warnings(json, notes.into_iter().flatten());
    terminal::report(json, &report, || text(&report))
}

impl Arguments {
    /// The change of the film: each quantity is given once.
    fn mismatch(&self) -> Result<Mismatch> {
        let (mut stiffness, mut alpha) = (None, None);
        let given = self.stiffness.map(MismatchFactor::Stiffness);
        for factor in given.iter().chain(&self.plant_mismatch) {
            let (name, before) = match *factor {
                MismatchFactor::Stiffness(factor) => ("stiffness", stiffness.replace(factor)),
                MismatchFactor::Alpha(factor) => ("alpha", alpha.replace(factor)),
            };
            if before.is_some() {
                let cause = format!("{name} is given twice; give one factor, which is the whole change");
                return Err(Error::field("plant_mismatch", cause));
            }
        }
        Ok(Mismatch {
            stiffness: stiffness.unwrap_or(Mismatch::NONE.stiffness),
            alpha: alpha.unwrap_or(Mismatch::NONE.alpha),
        })
    }

    /// The run of `controller` along `reference` on the plant.
    fn tracked(
        &self,
        bench: &BenchModel,
        controller: &mut (dyn Controller + Send),
        (reference, grid): (&[f64], Grid),
        mismatch: Mismatch,
        bar: &Progress,
    ) -> Result<LoopRun> {
        match &self.plant {
            PlantChoice::Nonlinear(_) if self.plant_temperature.is_some() => {
                let cause = "this film has no temperature; name a parameter file as `plant`";
                Err(Error::field("plant_temperature", cause))
            }
            PlantChoice::Nonlinear(_) if mismatch.alpha != 1.0 => {
                let cause = "alpha: this film has no springpots; its stiffness may differ";
                Err(Error::field("plant_mismatch", cause))
            }
            PlantChoice::Nonlinear(film) => {
                let film = Film::new(*film).stiffened(mismatch.stiffness);
                closed_loop::track(&film, bench, controller, reference, grid, bar)
            }
            PlantChoice::Parameters(name) => {
                let film = options::load_at(name, "plant_temperature", self.plant_temperature)?;
                let (substeps, substep_s) = closed_loop::substeps(grid);
                let mut plant = FullMemoryPlant::at_rest(&film, mismatch, substep_s, substeps * grid.samples)
                    .map_err(|error| error.about(name, &self.reference))?;
                closed_loop::track_plant(&mut plant, bench, controller, reference, grid, bar)
            }
        }
    }

    /// The run of `controller` along `reference` on the film as its own sensor.
    fn tracked_by_itself(
        &self,
        file: &CapacitanceFile,
        controller: &mut (dyn Controller + Send),
        (reference, grid): (&[f64], Grid),
        mismatch: Mismatch,
        bar: &Progress,
    ) -> Result<LoopRun> {
        let PlantChoice::Nonlinear(film) = &self.plant else {
            let cause = "the film of a parameter file has no circuit; use hossain or wang";
            return Err(Error::field("self_sensing", cause));
        };
        // At rest where it was: its capacitance is that of the file.
        let film = Film::new(*film).warmed(mismatch.stiffness, 1.0);
        let sensing = SelfSensing::new(&file.relation, file.options)
            .map_err(|error| Error::field("self_sensing", error.to_string()))?;
        let (substeps, substep_s) = closed_loop::substeps(grid);
        let mut plant = NonlinearPlant::at_rest(&film, substep_s);
        let circuit = FilmCircuit::of_film(&film);
        let mut bench =
            ElectricalBench::new(circuit, Monitors::default(), &mut plant, (substeps, grid.step_s()), self.seed);
        self_sensed::track(&mut SensedBench::at_rest(&mut bench, &sensing), controller, reference, grid, bar)
    }

    /// Steps from one row that is written to the next.
    fn step(&self, reference: &Recording) -> usize {
        let interval_s = reference.duration_s() / (reference.time_s().len() - 1) as f64;
        self.every.map_or((self.rate * interval_s.min(0.01) + 1e-6) as usize, NonZeroUsize::get).max(1)
    }

    /// Refuses outputs that could not be written; the figure to draw.
    fn check_outputs(&self) -> Result<Plot> {
        let plant = match &self.plant {
            PlantChoice::Nonlinear(_) => None,
            PlantChoice::Parameters(name) => Some(Path::new(name)),
        };
        let read: Vec<&Path> = [self.reference.as_path(), self.params.as_ref()]
            .into_iter()
            .chain(plant)
            .chain(self.self_sensing.as_deref())
            .collect();
        self.plot.check_beside(&read, self.out.as_deref())
    }
}

fn text(report: &Report) -> String {
    let quality = &report.quality;
    let drift = quality.drift_pct.map(|drift| format!(", drift {} %", decimals(drift, 3))).unwrap_or_default();
    let error = match quality.tracking_rms_pct {
        Some(percent) => format!("{} % RMS", decimals(percent, 4)),
        None => format!("{} µm RMS (the reference is constant)", decimals(1e6 * quality.rms_m, 3)),
    };
    // Shaping hardly changes a reference within the limits.
    let late = match (&report.harmonics, quality.late_rms_pct, quality.late_largest_pct) {
        (Some(_), Some(rms), Some(largest)) => {
            format!("; {} % RMS and {} % at most in the last third", decimals(rms, 4), decimals(largest, 3))
        }
        _ => String::new(),
    };
    let asked = match (quality.tracking_rms_pct, quality.asked_rms_pct) {
        (Some(shaped), Some(asked)) if (asked - shaped).abs() > 0.1 => {
            format!(" of the shaped reference, {} % of the one that was asked for", decimals(asked, 2))
        }
        _ => String::new(),
    };
    format!(
        "{}: tracking error {error}{asked}{late}{drift}, largest error {} µm, largest voltage {} V, {}",
        report.controller,
        decimals(1e6 * quality.largest_error_m, 2),
        decimals(quality.largest_voltage_v, 0),
        LimitShare::text(&quality.limits_met)
    )
}

fn stage(path: &Path, run: &LoopRun, grid: Grid, step: usize) -> Result<Staged> {
    fn known(values: &[f64]) -> Option<&[f64]> {
        values.iter().any(|value| !value.is_nan()).then_some(values)
    }
    let time = grid.times_s();
    let limited: Vec<f64> = run.limited.iter().map(|limited| f64::from(limited.bits())).collect();
    output::stage_rows(
        path,
        &[
            ("time_s", Some(time.as_slice())),
            ("voltage_v", Some(&run.voltage_v)),
            ("displacement_m", Some(&run.displacement_m)),
            ("reference_m", Some(&run.reference_m)),
            ("limited", Some(&limited)),
            ("estimate_m", known(&run.estimate_m)),
            ("disturbance_n", known(&run.disturbance_n)),
            ("force_scale", known(&run.force_scale)),
        ],
        (0..grid.samples).step_by(step),
    )
}
