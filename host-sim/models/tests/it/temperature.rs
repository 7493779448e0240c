//! Films at several temperatures: the dependence is found from recordings, and feedforward holds at temperatures between.
//!
//! Films at another temperature are computed without the law's own rule: as the film at its reference, stepped in its own time.

use std::f64::consts::TAU;
use std::sync::atomic::AtomicBool;

use host_io::files::import::Quantity;
use host_io::files::parameters::Parameters;
use host_io::files::recording::{Direction, Recording};
use host_io::grid::Grid;
use host_models::fit::options::Branches;
use host_models::fit::{self, CurveChoice, Fit, FitOptions, Loss};
use host_models::replay::expectation::Recorded;
use host_models::replay::feedforward;
use host_models::replay::memory::{MemoryChoice, Precision, RunOptions};
use indicatif::ProgressBar;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;
use springpot::{Actuator, CommandLimits, Maxwell, Spring, Springpot, Topology};

use crate::recorded::{fitted_to, moved_m, risen_sine_m};
use crate::same_film::ACTUATOR;
use crate::sweep::full_sweep;

const LIMITS: CommandLimits = CommandLimits { max_voltage_v: 4200.0, max_field_v_per_m: 1e8, ..CommandLimits::BENCH };
const REFERENCE_C: f64 = 22.0;

/// A film at 22 °C, and how its stiffness (1/K) and its times (kJ/mol) change.
struct Film {
    parameters: Parameters,
    stiffness_per_k: f64,
    activation_kj_per_mol: f64,
    /// Seed of its noise and zeros.
    seed: u64,
}

impl Film {
    /// Random film number `seed`, of which every third has a spring in series.
    fn random(seed: u64) -> Self {
        let mut random = Pcg64::seed_from_u64(seed);
        let time_s = 10f64.powf(random.random_range(-0.3..1.0));
        let share = random.random_range(0.1..0.4);
        let branch = [Springpot::new(8.5e3 * share, 0.0), Springpot::new(8.5e3 * share * time_s, 1.0)];
        let main = Springpot::new(random.random_range(7e3..9e3), random.random_range(0.05..0.15));
        let model = Maxwell::new(main, &[branch], Topology::Parallel, 0.1).expect("valid");
        let knots = |e: f64| (e, 40e3 * e + 6e9 * e.powi(3));
        let spring =
            seed.is_multiple_of(3).then(|| Spring::through(&[-1e-4, 0.0, 2e-4, 4e-4, 6e-4].map(knots)).expect("valid"));
        let parameters =
            Parameters { model, actuator: ACTUATOR, spring, ..Parameters::preset("table3-n1").expect("there") };
        let stiffness_per_k = random.random_range(-0.012..0.004);
        Self { parameters, stiffness_per_k, activation_kj_per_mol: random.random_range(20.0..90.0), seed }
    }

    /// Displacement (m) at 1 kHz under `voltage_v` at a temperature: with times a and stiffness k the film is itself with its time in steps of 1/a,
    /// 1/k of the force, and m/(k a²) of the mass.
    fn displacement_m(&self, voltage_v: &[f64], temperature_c: f64) -> Vec<f64> {
        let stiffness = 1.0 + self.stiffness_per_k * (temperature_c - REFERENCE_C);
        let kelvin = 273.15;
        let inverse = 1.0 / (temperature_c + kelvin) - 1.0 / (REFERENCE_C + kelvin);
        let time = (self.activation_kj_per_mol / 8.314_462_618e-3 * inverse).exp();
        let model = &self.parameters.model;
        let mass_kg = model.mass_kg() / (stiffness * time * time);
        let film = Parameters {
            model: Maxwell::new(model.main(), model.branches(), model.topology(), mass_kg).expect("valid"),
            actuator: Actuator { mass_kg, ..self.parameters.actuator },
            ..self.parameters.clone()
        };
        let volts = voltage_v.iter().map(|volts| volts / stiffness.sqrt()).collect();
        moved_m(&film, volts, 1000.0 * time, MemoryChoice::Compressed)
    }

    /// 100 s of a sine of `hz` at 100 Hz with 3 µm of noise, zeroed anew.
    fn recording(&self, hz: f64, temperature_c: f64) -> Recording {
        let mut random = Pcg64::seed_from_u64(1000 * self.seed + (1e3 * (hz + temperature_c)) as u64);
        let noise = Normal::new(0.0, 3e-6).expect("valid");
        let volts: Vec<f64> = (0..100_000).map(|k| 1600.0 * (1.0 - (TAU * hz * 1e-3 * f64::from(k)).cos())).collect();
        let film = self.displacement_m(&volts, temperature_c);
        let zero_m = random.random_range(-1e-4..1e-4);
        let rows = || (0..film.len()).step_by(10);
        let columns = vec![
            (Quantity::Voltage, rows().map(|k| volts[k]).collect()),
            (Quantity::Displacement, rows().map(|k| zero_m + film[k] + noise.sample(&mut random)).collect()),
            (Quantity::Temperature, rows().map(|k| temperature_c + 0.2 * (1e-4 * k as f64).sin()).collect()),
        ];
        Recording::of_values(
            &format!("{hz} Hz at {temperature_c}.csv"),
            rows().map(|k| 1e-3 * k as f64).collect(),
            columns,
        )
        .expect("valid")
    }

    fn recordings(&self) -> Vec<Recording> {
        [(0.4, 20.0), (0.15, 30.0), (0.08, 38.0)].map(|(hz, temperature_c)| self.recording(hz, temperature_c)).into()
    }

    fn options(&self) -> FitOptions {
        let curve = if self.parameters.spring.is_some() { CurveChoice::Series } else { CurveChoice::None };
        FitOptions { branches: Branches::Auto, curve, ..FitOptions::default() }
    }
}

fn tried(recordings: &[Recording], options: &FitOptions) -> host_io::Result<(Fit, Parameters)> {
    let (fit, settings, _) = fitted_to(recordings, options, Actuator { stretch_coupling: 0.0, ..ACTUATOR })?;
    let parameters = fit.parameters(&settings, Direction::Force, &recordings.iter().collect::<Vec<_>>())?;
    Ok((fit, parameters))
}

/// Error (%, RMS of peak to peak) of feedforward with `parameters` on `film` at a temperature, and the interval that was stated.
fn followed(film: &Film, parameters: &Parameters, temperature_c: f64) -> (f64, [f64; 2]) {
    followed_with(film, &parameters.at_temperature(temperature_c).expect("within reach"), temperature_c)
}

/// The same with parameters that do not know the temperature.
fn followed_with(film: &Film, parameters: &Parameters, temperature_c: f64) -> (f64, [f64; 2]) {
    let grid = Grid::covering(60.0, 1000.0).expect("a grid");
    let wanted: Vec<f64> = grid.times_s().iter().map(|&t| risen_sine_m(t, 2.0, 0.3e-3, 0.8e-3, 0.2)).collect();
    let options = RunOptions { rate_hz: 1000.0, memory: MemoryChoice::Compressed, precision: Precision::F64 };
    let plan = feedforward::plan(parameters, &wanted, grid, &options, LIMITS, &ProgressBar::hidden()).expect("a plan");
    let moved = film.displacement_m(&plan.voltage_v, temperature_c);
    let squares = moved.iter().zip(&wanted).skip(2000).map(|(x, w)| (x - w).powi(2));
    let error_pct = 100.0 * (squares.sum::<f64>() / (wanted.len() - 2000) as f64).sqrt() / 0.5e-3;
    let recorded = Recorded::from_parameters(parameters).expect("written by the fit");
    (error_pct, recorded.expectation(parameters, &wanted, grid, 0.5e-3, plan.voltage_v).feedforward_error_pct)
}

/// Slope and activation energy are those of the film, and feedforward follows at temperatures between those of the recordings.
#[test]
fn the_dependence_on_the_temperature_is_found() {
    let films = if full_sweep() { 0..40 } else { 0..3 };
    let (mut inside, mut errors_pct, mut ignored_pct) = (0, Vec::new(), Vec::new());
    for seed in films {
        let film = Film::random(seed);
        let (_, parameters) = tried(&film.recordings(), &film.options()).expect("a fit");
        let found = parameters.temperature.expect("three temperatures").with_reference(REFERENCE_C).expect("near");
        println!("{seed}: {found:?} of {:.5}/K and {:.2} kJ/mol", film.stiffness_per_k, film.activation_kj_per_mol);
        assert!((found.stiffness_per_k - film.stiffness_per_k).abs() < 2e-4, "{seed}: {found:?}");
        assert!((found.activation_kj_per_mol - film.activation_kj_per_mol).abs() < 2.5, "{seed}: {found:?}");
        for temperature_c in [20.0, 25.0, 34.0] {
            let (error_pct, [low, high]) = followed(&film, &parameters, temperature_c);
            println!("   {temperature_c} °C: {error_pct:.3} % of {low:.3} to {high:.3} %");
            inside += usize::from((low..=high).contains(&error_pct));
            errors_pct.push(error_pct);
            ignored_pct.push(followed_with(&film, &parameters, temperature_c).0);
        }
    }
    let count = errors_pct.len();
    let within = errors_pct.iter().filter(|error| **error <= 1.0).count();
    let [median_pct, unknown_pct] = [&mut errors_pct, &mut ignored_pct].map(|errors| {
        errors.sort_by(f64::total_cmp);
        errors[count / 2]
    });
    let largest_pct = errors_pct[count - 1];
    println!(
        "{count}: median {median_pct:.3} %, largest {largest_pct:.3} %, {within} within 1 %, {inside} as stated; without the temperature {unknown_pct:.2} %"
    );
    assert!(20 * (count - within) <= count && largest_pct < 2.0 && 20 * (count - inside) <= count);
    assert!(unknown_pct > 10.0 * median_pct, "the temperature matters");
}

#[test]
fn two_temperatures_are_enough() {
    let film = Film::random(1);
    let pairs = [(0.4, 20.0), (0.1, 20.0), (0.4, 35.0), (0.1, 35.0)];
    let recordings = pairs.map(|(hz, temperature_c)| film.recording(hz, temperature_c));
    let (_, parameters) = tried(&recordings, &film.options()).expect("a fit");
    for temperature_c in [20.0, 27.0] {
        let (error_pct, [low, high]) = followed(&film, &parameters, temperature_c);
        println!("{temperature_c} °C: {error_pct:.3} % of {low:.3} to {high:.3} %, {:?}", parameters.temperature);
        assert!(error_pct < 0.5 && (low..=high).contains(&error_pct), "{error_pct} of {low} to {high}");
    }
}

/// `recording` without its temperature, under another name.
fn without_temperature(recording: &Recording, name: &str) -> Recording {
    let columns = recording.columns().into_iter().zip([Quantity::Voltage, Quantity::Displacement]);
    let columns = columns.map(|((_, values), of)| (of, values)).collect();
    Recording::of_values(name, recording.time_s().to_vec(), columns).expect("valid")
}

/// Recordings at one temperature are fitted as without the column, to the bit.
#[test]
fn one_temperature_changes_nothing() {
    let film = Film::random(1);
    let with: Vec<Recording> = [0.4, 0.15].map(|hz| film.recording(hz, 25.0)).into();
    let without = with.iter().map(|with| without_temperature(with, &with.path().to_string_lossy())).collect();
    let [(with, parameters), (without, plain)] =
        [with, without].map(|recordings| tried(&recordings, &film.options()).expect("a fit"));
    assert_eq!((parameters.model, parameters.temperature), (plain.model, None));
    assert_eq!(with.candidate, without.candidate);
    let says = |fit: &Fit| fit.warnings.iter().any(|warning| warning.contains("recorded at 25.0 °C"));
    assert!(says(&with) && !says(&without));
}

#[test]
fn temperatures_that_cannot_be_used_are_refused() {
    let film = Film::random(1);
    let refused = |recordings: &[Recording]| tried(recordings, &film.options()).expect_err("refused").to_string();
    let kelvin = [film.recording(0.4, 20.0), film.recording(0.15, 25.0)].map(|recording| {
        let columns =
            recording.columns().into_iter().zip([Quantity::Voltage, Quantity::Displacement, Quantity::Temperature]);
        let columns = columns.map(|((name, values), of)| {
            let shift = if name == "temperature_c" { 273.15 } else { 0.0 };
            (of, values.into_iter().map(|value| value + shift).collect())
        });
        Recording::of_values("kelvin.csv", recording.time_s().to_vec(), columns.collect()).expect("valid")
    });
    assert!(refused(&kelvin).contains("kelvin.csv: temperature_c: a temperature of 293.15 °C"), "{}", refused(&kelvin));
    let mut some = film.recordings();
    some[1] = without_temperature(&some[1], "cold.csv");
    assert!(refused(&some).contains("cold.csv has no column temperature_c"), "{}", refused(&some));
    let huber = FitOptions { loss: Loss::Huber, ..film.options() };
    assert!(tried(&film.recordings(), &huber).expect_err("refused").to_string().contains("least squares"));
    // Beyond the recorded temperatures the error to expect grows.
    let (_, parameters) = tried(&film.recordings(), &film.options()).expect("a fit");
    let settings = film.options().settings(Some(parameters.clone()), None).expect("sound");
    let observed = film.options().observations(&[&some[1]]).expect("sound");
    let observed: Vec<_> = observed.into_iter().map(|(observation, _)| observation).collect();
    let refit = fit::fit(&observed, &settings, &AtomicBool::new(false), &|_| ()).expect_err("refused").to_string();
    assert!(refit.contains("cold.csv has no column temperature_c"), "{refit}");
    let [within, beyond] = [29.0, 47.0].map(|temperature_c| followed(&film, &parameters, temperature_c).1[1]);
    assert!(beyond > 2.0 * within, "{within} and {beyond}");
}
