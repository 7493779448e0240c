//! Films with a spring in series with the memory, against equations of their own.
//!
//! One is a cubic spring in series with Kelvin–Voigt elements, by Runge–Kutta steps; the others are the defining sum of their springpots, solved
//! in every step by bisection.

use std::f64::consts::TAU;

use host_io::files::parameters::Parameters;
use host_io::files::recording::Input;
use host_io::grid::{Grid, Samples};
use host_models::compression::Compression;
use host_models::cost::Cost;
use host_models::replay::expectation::{Recorded, Refit};
use host_models::replay::frequency_response::{Sweep, continuous};
use host_models::replay::full_memory::FullMemory;
use host_models::replay::memory::{MemoryChoice, Precision, RunOptions};
use host_models::replay::observer::{ObservedRecording, Tuning};
use host_models::replay::{feasibility, feedforward, simulate};
use host_models::simulation::closed_loop::{self, BenchModel};
use host_models::simulation::controllers::ControllerKind;
use host_models::simulation::plant::{FullMemoryPlant, Mismatch, Plant};
use indicatif::ProgressBar;
use num_complex::Complex;
use springpot::{Actuator, CommandLimits, Discretisation, Knot, Load, Maxwell, Preload, Spring, Springpot, Topology};

use crate::curves::FILM;
use crate::defining_sum::modulus_series;
use crate::plants::{Stiffening, StiffeningFilm};
use crate::recorded::{controller, driven, far, feedforward_errors_m, moved_m, peak, risen_sine_m, rms};

/// Stiffness (N/m) and retardation time (s) of the Kelvin–Voigt elements.
const ELEMENTS: [(f64, f64); 2] = [(40e3, 0.3), (50e3, 5.0)];
/// k₀ (N/m) and k₃ (N/m³) of the spring.
const CUBIC: (f64, f64) = (9e3, 6e9);
/// To which elongation the spring is known, m.
const RANGE_M: f64 = 3e-3;
/// Limits that no reference here meets.
const LIMITS: CommandLimits = CommandLimits { max_voltage_v: 6e3, max_field_v_per_m: 1e9, ..CommandLimits::BENCH };

/// The springs and dashpots in parallel that two Kelvin–Voigt elements in series are: K = 1 / (C_1 + C_2) has one pole.
fn kelvin_voigt(mass_kg: f64) -> Maxwell {
    let [(k1, t1), (k2, t2)] = ELEMENTS;
    let soft = k1 * k2 / (k1 + k2);
    let pole_s = (k1 * t1 + k2 * t2) / (k1 + k2);
    let stiffness = soft * (t1 + t2 - t1 * t2 / pole_s - pole_s) / pole_s;
    // Two equal springs are half as stiff in series.
    let branches = [
        [Springpot::new(2.0 * soft, 0.0), Springpot::new(2.0 * soft, 0.0)],
        [Springpot::new(stiffness, 0.0), Springpot::new(stiffness * pole_s, 1.0)],
    ];
    Maxwell::new(Springpot::new(soft * t1 * t2 / pole_s, 1.0), &branches, Topology::Parallel, mass_kg).expect("valid")
}

/// The film whose own equations are those of [`StiffeningFilm`].
fn ordinary() -> (Parameters, Stiffening) {
    let [first, second] = ELEMENTS;
    let truth =
        Stiffening { spring: CUBIC, inertia: (0.1, 0.0), ..Stiffening::with([first, second, (f64::INFINITY, 1.0)]) };
    let actuator = Actuator { stretch_coupling: truth.coupling, preload: Preload::Settled, ..FILM };
    (in_series(kelvin_voigt(actuator.mass_kg), actuator), truth)
}

/// `model` in series with the cubic spring, which two pieces are exactly.
fn in_series(model: Maxwell, actuator: Actuator) -> Parameters {
    let (k0, k3) = CUBIC;
    let knot = |e: f64| Knot { displacement: e, value: k0 * e + k3 * e.powi(3), slope: k0 + 3.0 * k3 * e * e };
    let spring = Spring::new(&[-RANGE_M, 0.0, RANGE_M].map(knot)).expect("a spring");
    let film = Parameters::preset("table3-n1").expect("there");
    Parameters { model, actuator, curve: None, spring: Some(spring), sensor_offset_m: 0.0, ..film }
}

/// A film of springpots, with or without mass.
pub(crate) fn fractional(mass_kg: f64) -> Parameters {
    let branches = [[Springpot::new(30e3, 0.05), Springpot::new(60e3, 0.8)]];
    let model = Maxwell::new(Springpot::new(18e3, 0.12), &branches, Topology::Parallel, mass_kg).expect("valid");
    in_series(model, Actuator { stretch_coupling: 30.0, mass_kg, preload: Preload::Settled, ..FILM })
}

/// Law, full memory and plant under a voltage, against the film's differential equations.
#[test]
fn is_the_film_of_its_differential_equations() {
    let (film, truth) = ordinary();
    let grid = Grid::covering(20.0, 1000.0).expect("a grid");
    let volts = |t: f64| 1900.0 * (1.0 - (TAU * 0.3 * t).cos());
    let exact = solved(truth, grid, volts);
    let stroke = peak(&exact);
    assert!(stroke > 1.5e-3, "the spring stiffens: {stroke}");

    let input =
        Input::Voltage(Samples { time_s: grid.times_s(), value: grid.times_s().into_iter().map(volts).collect() });
    for (method, most) in [(Discretisation::Gl, 1e-3), (Discretisation::Bdf2, 1e-5)] {
        let film = film.clone().with_method(method);
        let run = |memory, precision| {
            let options = RunOptions { rate_hz: grid.rate_hz, memory, precision };
            let response = simulate::response(&film, &input, grid, &options, &ProgressBar::hidden());
            response.expect("a response").displacement_m
        };
        for (memory, precision) in [
            (MemoryChoice::Compressed, Precision::F32),
            (MemoryChoice::Compressed, Precision::F64),
            (MemoryChoice::Full, Precision::F64),
        ] {
            let error = far(&run(memory, precision), &exact) / stroke;
            println!("{method:?} {memory} {precision:?}: {error:.1e}");
            // The error of the method over a step of 1 ms, with elements of 0.3 s.
            assert!(error < most, "{method:?} {memory} {precision:?}: {error:.1e}");
        }
    }
    let plant = FullMemoryPlant::at_rest(&film, Mismatch::NONE, grid.step_s(), grid.samples);
    let moved = driven(&mut plant.expect("a plant"), grid.times_s().into_iter().map(volts));
    let error = far(&moved, &exact) / stroke;
    assert!(error < 1e-3, "plant: {error:.1e}");
}

/// Displacements (m) of the film's equations at the times of `grid`.
fn solved(film: Stiffening, grid: Grid, volts: impl Fn(f64) -> f64) -> Vec<f64> {
    let mut plant = StiffeningFilm::new(film, grid.step_s());
    let at = |t: f64| {
        let x = plant.displacement_m();
        plant.step(volts(t + 0.5 * grid.step_s()));
        x
    };
    grid.times_s().into_iter().map(at).collect()
}

/// Feedforward, and a loop with a sensor, take the film of the differential equations along a sine.
#[test]
fn feedforward_and_the_closed_loop_follow_it() {
    let (film, truth) = ordinary();
    let grid = Grid::covering(20.0, 1000.0).expect("a grid");
    let wanted: Vec<f64> = grid.times_s().iter().map(|&t| risen_sine_m(t, 2.0, 0.6e-3, 1.6e-3, 0.2)).collect();
    let mut plant = StiffeningFilm::new(truth.clone(), 1e-3);
    let errors = feedforward_errors_m(&film, &wanted, LIMITS, &mut plant);
    let pct = 100.0 * rms(&errors[2000..]) / 1e-3;
    println!("feedforward {pct:.3} %");
    assert!(pct < 0.1, "{pct}");

    // The same film without its spring is far off.
    let linear = Parameters { spring: None, ..film.clone() };
    let errors = feedforward_errors_m(&linear, &wanted, LIMITS, &mut StiffeningFilm::new(truth.clone(), 1e-3));
    assert!(100.0 * rms(&errors[2000..]) / 1e-3 > 30.0);

    let (_, substep_s) = closed_loop::substeps(grid);
    let plants = || -> [Box<dyn Plant>; 2] {
        let own = FullMemoryPlant::at_rest(&film, Mismatch::NONE, substep_s, 2 * grid.samples).expect("a plant");
        [Box::new(own), Box::new(StiffeningFilm::new(truth.clone(), substep_s))]
    };
    for kind in [ControllerKind::Tracking, ControllerKind::Adaptive, ControllerKind::Window] {
        for mut plant in plants() {
            let bench = BenchModel::default();
            let mut controller = controller(kind, &film, LIMITS, None, 2e-3);
            let run =
                closed_loop::track_plant(&mut *plant, &bench, &mut *controller, &wanted, grid, &ProgressBar::hidden());
            let pct = 100.0 * rms(&run.expect("a run").error_m()[2000..]) / 1e-3;
            println!("{kind:?} {pct:.3} %");
            // The sensor has 5 µm of noise, and a window of 10 s forgets.
            assert!(pct < 0.4, "{kind:?}: {pct}");
        }
    }
}

/// An observer of the film of the differential equations estimates what its sensor does not show, and sees no disturbance.
#[test]
fn an_observer_follows_it() {
    let (film, truth) = ordinary();
    let volts = |t: f64| 1900.0 * (1.0 - (TAU * 0.3 * t).cos());
    let grid = Grid::covering(20.0, 1000.0).expect("a grid");
    let exact = solved(truth, grid, volts);
    let (time_s, value) = grid.times_s().into_iter().zip(exact.iter().copied()).step_by(20).unzip();
    let recording = ObservedRecording {
        grid,
        voltage_v: grid.times_s().into_iter().map(volts).collect(),
        measured: Samples { time_s, value },
    };
    let tuning = Tuning::new(None, 0.0).expect("valid");
    let found = recording.estimate(&film, tuning, Precision::F32, &ProgressBar::hidden()).expect("estimates");
    let (error, disturbance) = (far(&found.displacement_m, &exact) / peak(&exact), peak(&found.disturbance_n));
    println!("{error:.1e} of the stroke, {disturbance:.1e} N");
    assert!(error < 1e-3 && disturbance < 0.05, "{error:.1e} of the stroke, {disturbance:.1e} N");
}

/// At rest the compliances of spring and elements add up; elsewhere the law and the model agree on the spring's slope.
#[test]
fn small_oscillations_add_the_compliances() {
    let (film, truth) = ordinary();
    for hz in [0.01, 0.1, 1.0, 20.0] {
        let s = Complex::new(0.0, TAU * hz);
        let element = |(k, time_s): (f64, f64)| (k * (s * time_s + 1.0)).inv();
        let compliance = ELEMENTS.map(element).iter().sum::<Complex<f64>>() + 1.0 / truth.spring.0;
        let exact = (compliance.inv() + s * s * truth.inertia.0).inv();
        let found = continuous(&film, hz, 0.0);
        assert!((found / exact - 1.0).norm() < 1e-9, "{hz} Hz: {found} instead of {exact}");
    }
    let response = |at_m: f64, law_hz: Option<f64>| {
        Sweep { from_hz: 0.01, to_hz: 5.0, points: 12, at_m, law_hz }.run(&film).expect("a response")
    };
    for at_m in [0.0, 1e-3, 2e-3] {
        let (model, law) = (response(at_m, None), response(at_m, Some(1000.0)));
        for (k, (a, b)) in model.magnitude_m_per_n.iter().zip(&law.magnitude_m_per_n).enumerate() {
            // A step at 5 Hz is a 200th of a period.
            assert!((a / b - 1.0).abs() < 5e-3, "{at_m}: {a} and {b}");
            assert!((model.phase_rad[k] - law.phase_rad[k]).abs() < 2e-2, "{at_m}");
        }
    }
    assert!(response(2e-3, None).magnitude_m_per_n[0] < 0.75 * response(0.0, None).magnitude_m_per_n[0]);
}

/// A film by the sum over all that was, its spring solved by bisection.
struct Sum<'a> {
    film: &'a Parameters,
    /// κ of the memory alone, N/m.
    weights: Vec<f64>,
    step_s: f64,
    /// Displacements of the memory and of the film, m.
    memory: Vec<f64>,
    moved: Vec<f64>,
}

impl<'a> Sum<'a> {
    fn new(film: &'a Parameters, grid: Grid) -> Self {
        let Parameters { model, .. } = film;
        let massless = Maxwell::new(model.main(), model.branches(), model.topology(), 0.0).expect("valid");
        let weights = modulus_series(&massless, grid.step_s(), grid.samples);
        Self { film, weights, step_s: grid.step_s(), memory: Vec::new(), moved: Vec::new() }
    }

    fn force(&self, elongation: f64) -> f64 {
        self.film.spring.as_ref().expect("a spring").force(elongation)
    }

    /// Steps to where `missing`, which falls with the elongation, is 0; it takes displacement, the spring's force, and the inertia's.
    fn step(&mut self, missing: impl Fn(f64, f64, f64) -> f64) {
        let past: f64 = self.memory.iter().rev().zip(&self.weights[1..]).map(|(y, weight)| weight * y).sum();
        let [last, before] = [1, 2].map(|back| self.moved.len().checked_sub(back).map_or(0.0, |k| self.moved[k]));
        let memory = |elongation: f64| (self.force(elongation) - past) / self.weights[0];
        let inertia = |x: f64| self.film.model.mass_kg() / self.step_s.powi(2) * (x - 2.0 * last + before);
        let (mut low, mut high) = (-0.1, 0.1);
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            let x = middle + memory(middle);
            if missing(x, self.force(middle), inertia(x)) > 0.0 { low = middle } else { high = middle }
        }
        let y = memory(low);
        self.memory.push(y);
        self.moved.push(low + y);
    }

    /// The force (N) of the film after its last step.
    fn shown(&self) -> f64 {
        let at = |back: usize| self.moved.len().checked_sub(back).map_or(0.0, |k| self.moved[k]);
        let inertia = self.film.model.mass_kg() / self.step_s.powi(2) * (at(1) - 2.0 * at(2) + at(3));
        self.force(at(1) - self.memory.last().expect("a step")) + inertia
    }
}

/// Full memory under loads and along a path, and the plant, against that sum: with mass and without it, under a force that jumps, with springs
/// that stiffen and that soften.
#[test]
fn full_memory_is_the_sum_over_the_past() {
    // Much softer from 0.2 mm on.
    let knots = [(-5e-3, -22.0, 3e3), (-2e-4, -8.0, 8e3), (0.0, 0.0, 4e4), (2e-4, 8.0, 8e3), (5e-3, 22.0, 3e3)];
    let soft = Spring::new(&knots.map(|(displacement, value, slope)| Knot { displacement, value, slope }));
    let soft = Parameters { spring: Some(soft.expect("a spring")), ..fractional(0.0) };
    for film in [fractional(0.0), fractional(0.1), soft] {
        let mass_kg = film.model.mass_kg();
        let grid = Grid::covering(4.0, 100.0).expect("a grid");
        let volts = |t: f64| if t < 0.5 { 0.0 } else { 2500.0 + 900.0 * (TAU * 0.7 * t).sin() };
        let loads: Vec<Load<f64>> = grid.times_s().into_iter().map(|t| film.actuator.load(volts(t))).collect();
        let mut sum = Sum::new(&film, grid);
        loads.iter().for_each(|load| sum.step(|x, f, inertia| load.force_n + load.slope_n_per_m * x - f - inertia));
        let stroke = peak(&sum.moved);
        assert!(stroke > 1e-3, "{stroke}");

        let circle = FullMemory::new(grid.samples, grid.step_s());
        let full = circle.displacement_under(film.film(), &loads, grid.step_s()).expect("it converges");
        let plant = FullMemoryPlant::at_rest(&film, Mismatch::NONE, grid.step_s(), grid.samples);
        let plant = driven(&mut plant.expect("a plant"), grid.times_s().into_iter().map(volts));
        let errors = [full, plant].map(|moved| far(&moved, &sum.moved) / stroke);
        println!("{mass_kg} kg: {errors:?}");
        assert!(errors.iter().all(|error| *error < 1e-11), "{mass_kg} kg: {errors:?}");

        let path: Vec<f64> = grid.times_s().iter().map(|t| 1e-3 * (1.0 - (TAU * 0.5 * t).cos())).collect();
        let mut sum = Sum::new(&film, grid);
        let mut shown = |&wanted: &f64| {
            sum.step(|x, _, _| wanted - x);
            sum.shown()
        };
        let exact: Vec<f64> = path.iter().map(&mut shown).collect();
        let error = far(&circle.force_along(film.film(), &path), &exact) / peak(&exact);
        println!("{mass_kg} kg along a path: {error:.1e}");
        assert!(error < 1e-11, "{mass_kg} kg: {error:.1e}");
    }
}

/// Full memory plans a voltage for a path, which takes the film along it.
#[test]
fn full_memory_inverts_itself() {
    let film = fractional(0.0);
    let grid = Grid::covering(6.0, 100.0).expect("a grid");
    let wanted: Vec<f64> = grid.times_s().iter().map(|&t| risen_sine_m(t, 2.0, 0.8e-3, 1.8e-3, 0.5)).collect();
    let options = RunOptions { rate_hz: 100.0, memory: MemoryChoice::Full, precision: Precision::F64 };
    let plan = feedforward::plan(&film, &wanted, grid, &options, LIMITS, &ProgressBar::hidden()).expect("a plan");
    assert!(far(&moved_m(&film, plan.voltage_v, 100.0, MemoryChoice::Full), &wanted) < 1e-8 * 1.8e-3);
}

/// The spring has a stroke of its own: a film that creeps moves further than its spring is stretched.
#[test]
fn a_reference_is_beyond_a_spring_in_series_by_its_elongation() {
    let film = fractional(0.0);
    let grid = Grid::covering(20.0, 100.0).expect("a grid");
    let path = |most_m: f64| -> Vec<f64> { grid.times_s().iter().map(|t| most_m * t / 20.0).collect() };
    for most_m in [1.2 * RANGE_M, 7.0 * RANGE_M] {
        let mut sum = Sum::new(&film, grid);
        let mut is_beyond = |&wanted: &f64| {
            sum.step(|x, _, _| wanted - x);
            sum.moved.last().expect("a step") - sum.memory.last().expect("a step") > RANGE_M
        };
        let reference = path(most_m);
        let beyond = reference.iter().filter(|wanted| is_beyond(wanted)).count();
        let expected = 100.0 * beyond as f64 / grid.samples as f64;
        let found = feasibility::check(&film, &reference, grid, &LIMITS).expect("checked").beyond_curve_pct;
        println!("{most_m} m: {found} % beyond");
        // A sample at the edge.
        assert!((found - expected).abs() < 0.1, "{most_m} m: {found} instead of {expected} %");
        assert_eq!(found == 0.0, most_m < 2.0 * RANGE_M, "{most_m} m: {found} %");
    }
}

/// Fits to parts of recordings keep the spring in series: one that is the film itself leaves no error.
#[test]
fn fits_to_parts_keep_the_spring() {
    let film = fractional(0.1);
    let grid = Grid::covering(10.0, 100.0).expect("a grid");
    let wanted: Vec<f64> = grid.times_s().iter().map(|&t| risen_sine_m(t, 2.0, 0.8e-3, 1.8e-3, 0.2)).collect();
    let options = RunOptions { rate_hz: 100.0, memory: MemoryChoice::Compressed, precision: Precision::F64 };
    let plan = feedforward::plan(&film, &wanted, grid, &options, LIMITS, &ProgressBar::hidden()).expect("a plan");
    let recorded = |film: &Parameters| Recorded {
        stroke_m: [0.0, 2e-3],
        voltage_v: 1e4,
        speed_m_per_s: 1.0,
        time_s: 100.0,
        left_out_m: 1e-6,
        refits: vec![Refit::new(film)],
        ..Recorded::default()
    };
    let error_pct = |refit: &Parameters| {
        let voltage_v = plan.voltage_v.clone();
        recorded(refit).expectation(&film, &wanted, grid, 1e-3, voltage_v).feedforward_error_pct[1]
    };
    let (same, linear) = (error_pct(&film), error_pct(&Parameters { spring: None, ..film.clone() }));
    println!("{same:.1e} % and {linear:.0} %");
    assert!(same < 1e-3 && linear > 10.0, "{same} % and {linear} %");
}

/// A film that the voltage pulls in is noticed, by the plant as by full memory.
#[test]
fn pull_in_is_noticed() {
    let mut film = fractional(0.0);
    film.spring = Some(Spring::linear(9e3).expect("a spring"));
    film.actuator.stretch_coupling = 300.0;
    let mut plant = FullMemoryPlant::at_rest(&film, Mismatch::NONE, 1e-2, 500).expect("a plant");
    (0..500).for_each(|_| plant.advance(9000.0));
    assert!(!plant.holds());
    let loads = vec![film.actuator.load(9000.0); 500];
    let refused = FullMemory::new(500, 1e-2).displacement_under(film.film(), &loads, 1e-2);
    assert!(refused.map(|_| ()).expect_err("pulled in").to_string().contains("pull-in"));
}

/// Its cost is not that of a linear film, and the bounds that it does not have are named.
#[test]
fn cost_and_bounds_are_its_own() {
    let film = fractional(0.1);
    assert!(Cost::new(film.film()).instructions_per_step > Cost::LINEAR.instructions_per_step);
    let text = Compression::new(film.film(), 1000.0).expect("bounds").text();
    assert!(
        text.ends_with("displacement without a bound (a mass and a curve), force without a bound (a spring in series)")
    );
    let text = Compression::new(fractional(0.0).film(), 1000.0).expect("bounds").text();
    assert!(text.contains("displacement within ") && !text.contains("inf"), "{text}");
}
