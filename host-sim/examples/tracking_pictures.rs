//! Draws the pictures of `docs/tracking.md`, from fits to the committed recordings.
//!
//! `cargo run --release -p host-sim --example tracking_pictures -- docs`

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use host_sim::files::parameters::Parameters;
use host_sim::files::recording::{Direction, Recording};
use host_sim::fit::observation::observe;
use host_sim::fit::{self, Settings};
use host_sim::grid::Grid;
use host_sim::references::{Reference, Shape};
use host_sim::replay::memory::Precision;
use host_sim::report::figure::{Colour, Figure, Line, Panel};
use host_sim::report::figure_file;
use host_sim::simulation::closed_loop::{self, BenchModel, LoopRun};
use host_sim::simulation::controllers::{self, ControllerKind, ControllerSettings};
use host_sim::simulation::film::{Film, Plant};
use indicatif::ProgressBar;
use rayon::prelude::*;
use springpot::{CommandLimits, Limited, ObserverOptions, Topology};

static NEVER: AtomicBool = AtomicBool::new(false);

fn main() -> host_sim::Result<()> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or_else(|| "docs".into()));
    let soft = Subject::new(Plant::Hossain, "hossain", Reference::new(Shape::Sine, 1.5e-3, 4e-3, 10.0))?;
    let stiff = Subject::new(Plant::Wang, "wang", Reference::new(Shape::Sine, 0.3e-3, 1.2e-3, 10.0))?;
    controllers(&folder.join("tracking.svg"), &soft)?;
    bandwidth(&folder.join("bandwidth.svg"), &[&soft, &stiff])?;
    lost_sensor(&folder.join("lost-sensor.svg"), &soft)?;
    limits(&folder.join("limits.svg"), &soft)
}

/// A film, what was fitted to it, and a reference.
struct Subject {
    name: &'static str,
    film: Film,
    parameters: Parameters,
    reference: Vec<f64>,
    grid: Grid,
    limits: CommandLimits,
}

impl Subject {
    fn new(plant: Plant, name: &'static str, reference: Reference) -> host_sim::Result<Self> {
        let observations = [5, 7, 13]
            .map(|period| PathBuf::from(format!("tests/recordings/{name}-{period}s.csv")))
            .iter()
            .map(|path| Ok(observe(&Recording::read(path)?, Direction::Force, 1.0)?.0))
            .collect::<host_sim::Result<Vec<_>>>()?;
        let settings = Settings {
            topologies: vec![Topology::Parallel],
            branches: vec![4],
            uncertainty: false,
            ..Settings::default()
        };
        let candidate = fit::fit(&observations, &settings, &NEVER, &|_| ())?.candidate;
        let parameters = Parameters {
            curve: None,
            spring: None,
            temperature: None,
            method: springpot::Discretisation::Gl,
            name: name.into(),
            actuator: candidate.actuator,
            model: candidate.model()?,
            sensor_offset_m: candidate.offset_m,
            sensor_delay_s: 0.0,
            assumed_sizes: false,
            board: None,
            provenance: None,
        };
        let grid = Grid::covering(155.0, 1000.0)?;
        let reference = reference.on(grid)?;
        Ok(Self { name, film: Film::new(plant), parameters, reference, grid, limits: CommandLimits::BENCH })
    }

    fn with(&self, reference: Vec<f64>, grid: Grid) -> Self {
        Self { parameters: self.parameters.clone(), reference, grid, ..*self }
    }

    fn run(
        &self,
        kind: ControllerKind,
        bandwidth_hz: f64,
        stiffness: f64,
        bench: &BenchModel,
    ) -> host_sim::Result<LoopRun> {
        let observer = ObserverOptions::at_bandwidth(bandwidth_hz);
        let peak_m = self.reference.iter().copied().fold(0.0, f64::max);
        let limits = if stiffness > 1.0 {
            CommandLimits { max_voltage_v: 8000.0, max_field_v_per_m: 6e7, ..self.limits }
        } else {
            self.limits
        };
        let settings = ControllerSettings { rate_hz: self.grid.rate_hz, limits, observer, learning: None, peak_m };
        let mut controller = controllers::build(kind, &self.parameters, &settings, Precision::F32)?;
        let film = self.film.stiffened(stiffness);
        closed_loop::track(&film, bench, controller.as_mut(), &self.reference, self.grid, &ProgressBar::hidden())
    }

    fn time_s(&self) -> Vec<f64> {
        (0..self.grid.samples).map(|k| self.grid.time_s(k)).collect()
    }
}

fn scaled(values: &[f64], by: f64) -> Vec<f64> {
    values.iter().map(|value| by * value).collect()
}

/// Every controller on one reference.
fn controllers(path: &Path, subject: &Subject) -> host_sim::Result<()> {
    let time = subject.time_s();
    let kinds = [
        (ControllerKind::None, "no compensation", 0.6, Colour::VERMILION),
        (ControllerKind::Window, "10 s window", 0.6, Colour::ORANGE),
        (ControllerKind::Pi, "PI alone, 1 Hz", 1.0, Colour::PURPLE),
        (ControllerKind::Feedforward, "feedforward", 0.6, Colour::BLUE),
        (ControllerKind::Tracking, "tracking", 0.6, Colour::GREEN),
    ];
    let mut film = Panel::new("A sine of 1/10 Hz on the film hossain", "time (s)", "displacement (mm)")
        .with(Line::new("reference", &time, &scaled(&subject.reference, 1e3)).beneath());
    let mut error = Panel::new("Error of what compensates", "time (s)", "film − reference (µm)");
    let mut voltage = Panel::new("Voltage", "time (s)", "voltage (kV)");
    for (kind, name, bandwidth_hz, colour) in kinds {
        let run = subject.run(kind, bandwidth_hz, 1.0, &BenchModel::default())?;
        if matches!(kind, ControllerKind::None | ControllerKind::Tracking) {
            film = film.with(Line::new(name, &time, &scaled(&run.displacement_m, 1e3)).coloured(colour));
            voltage = voltage.with(Line::new(name, &time, &scaled(&run.voltage_v, 1e-3)).coloured(colour));
        }
        if matches!(kind, ControllerKind::Pi | ControllerKind::Feedforward | ControllerKind::Tracking) {
            error = error.with(Line::new(name, &time, &scaled(&run.error_m(), 1e6)).coloured(colour));
        }
    }
    figure_file::stage_image(path, &Figure::new("Tracking", vec![film, error, voltage]))?.commit()
}

/// Draws the effect of the bandwidth: error against bandwidth, on the film as it was recorded and on ones a fifth softer and
/// stiffer.
fn bandwidth(path: &Path, subjects: &[&Subject]) -> host_sim::Result<()> {
    let bandwidths: Vec<f64> = (0..=16).map(|k| 0.03 * (1.1_f64 / 0.03).powf(f64::from(k) / 16.0)).collect();
    let mut panels = Vec::new();
    for subject in subjects {
        let title = format!("Tracking error against bandwidth: {}, 1/10 Hz", subject.name);
        let mut panel = Panel::new(title, "bandwidth (Hz)", "RMS error (% of p-p)").logarithmic(true, true);
        for (stiffness, name) in [(1.0, "film as fitted"), (0.8, "20 % softer"), (1.2, "20 % stiffer")] {
            let errors = bandwidths
                .par_iter()
                .map(|&hz| {
                    Ok(subject
                        .run(ControllerKind::Tracking, hz, stiffness, &BenchModel::default())?
                        .quality()
                        .tracking_rms_pct
                        .unwrap_or(f64::NAN))
                })
                .collect::<host_sim::Result<Vec<f64>>>()?;
            // Beyond, the loop rings without end.
            let errors: Vec<f64> = errors.into_iter().map(|error| error.min(10.0)).collect();
            panel = panel.with(Line::new(name, &bandwidths, &errors));
        }
        panels.push(panel.with(Line::new("bar: 0.25 %", &[0.03, 1.1], &[0.25, 0.25]).dashed()));
    }
    figure_file::stage_image(path, &Figure::new("Bandwidth", panels))?.commit()
}

/// Thirty seconds without a sensor, on a film a twentieth softer than the fit.
fn lost_sensor(path: &Path, subject: &Subject) -> host_sim::Result<()> {
    let bench = BenchModel { sensor_lost_s: vec![(60.0, 90.0)], ..BenchModel::default() };
    let time = subject.time_s();
    let run = subject.run(ControllerKind::Tracking, 0.6, 0.95, &bench)?;
    let steps: Vec<f64> = run.voltage_v.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let error = subject.run(ControllerKind::Feedforward, 0.6, 0.95, &bench)?;
    let figure = Figure::new(
        "Sensor lost",
        vec![
            Panel::new(
                "Sensor lost from 60 s to 90 s, film 5 % softer than fitted",
                "time (s)",
                "film − reference (µm)",
            )
            .with(Line::new("feedforward alone", &time, &scaled(&error.error_m(), 1e6)).coloured(Colour::BLUE))
            .with(Line::new("tracking", &time, &scaled(&run.error_m(), 1e6)).coloured(Colour::GREEN)),
            Panel::new("What the observer has learned", "time (s)", "force scale")
                .with(Line::new("force scale", &time, &run.force_scale).coloured(Colour::GREEN)),
            Panel::new("Changes of voltage: the slew limit allows 50 V", "time (s)", "volts per tick")
                .with(Line::new("tracking", &time[1..], &steps).coloured(Colour::GREEN)),
        ],
    );
    figure_file::stage_image(path, &figure)?.commit()
}

/// A reference beyond the limits: from a large displacement almost to zero, and a jump.
fn limits(path: &Path, subject: &Subject) -> host_sim::Result<()> {
    let grid = Grid::covering(30.0, 1000.0)?;
    let reference = (0..grid.samples)
        .map(|k| match grid.time_s(k) {
            t if t < 10.0 => 3.5e-3,
            t if t < 20.0 => 0.05e-3,
            _ => 6.0e-3,
        })
        .collect();
    let subject = subject.with(reference, grid);
    let limits = CommandLimits { max_velocity_m_per_s: 4e-3, max_acceleration_m_per_s2: 10e-3, ..CommandLimits::BENCH };
    let subject = Subject { limits, ..subject };
    let time = subject.time_s();
    let run = subject.run(ControllerKind::Tracking, 0.6, 1.0, &BenchModel::default())?;
    let flag = |limit: Limited, level: f64| -> Vec<f64> {
        run.limited.iter().map(|met| if met.contains(limit) { level } else { level - 0.7 }).collect()
    };
    let figure = Figure::new(
        "Limits",
        vec![
            Panel::new("Jumps, shaped to 4 mm/s and 10 mm/s²", "time (s)", "displacement (mm)")
                .with(Line::new("asked for", &time, &scaled(&subject.reference, 1e3)).dashed())
                .with(Line::new("shaped reference", &time, &scaled(&run.reference_m, 1e3)).beneath())
                .with(Line::new("film", &time, &scaled(&run.displacement_m, 1e3)).coloured(Colour::GREEN)),
            Panel::new("Voltage", "time (s)", "voltage (kV)")
                .with(Line::new("command", &time, &scaled(&run.voltage_v, 1e-3)).coloured(Colour::BLUE)),
            Panel::new("Limits met", "time (s)", "")
                .with(Line::new("below zero", &time, &flag(Limited::BELOW_ZERO, 5.0)))
                .with(Line::new("field", &time, &flag(Limited::FIELD, 4.0)))
                .with(Line::new("largest voltage", &time, &flag(Limited::MAX_VOLTAGE, 3.0)))
                .with(Line::new("velocity", &time, &flag(Limited::VELOCITY, 2.0)))
                .with(Line::new("acceleration", &time, &flag(Limited::ACCELERATION, 1.0))),
        ],
    );
    figure_file::stage_image(path, &figure)?.commit()
}
