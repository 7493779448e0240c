//! Films that are not linear: fits and feedforward against films of other equations, and full memory against closed forms.

use std::f64::consts::TAU;
use std::path::Path;

use crate::plants::{LITTLE_CREEP, MUCH_CREEP, Stiffening, StiffeningFilm};
use crate::recorded::{
    driven, far, feedforward_errors_m, fitted, moved_m, noise, nrmse_pct, observation, parallel, parameters, recorded,
    risen_sine_m, rms,
};
use host_io::files::parameters::{ElasticCurve, Parameters};
use host_io::files::recording::{Direction, Input};
use host_io::grid::{Grid, Samples};
use host_models::fit::Settings;
use host_models::fit::bend::Bend;
use host_models::fit::observation::Observation;
use host_models::fit::settings::CurveChoice;
use host_models::references::minimum_jerk;
use host_models::replay::feasibility::Feasibility;
use host_models::replay::memory::{MemoryChoice, Precision, RunOptions};
use host_models::replay::{feasibility, simulate};
use host_models::simulation::plant::{FullMemoryPlant, Mismatch};
use indicatif::ProgressBar;
use springpot::{
    Actuator, CommandLimits, Curve, Discretisation, Maxwell, Measure, Rubber, Spring, Springpot, Topology,
};

pub(crate) const FILM: Actuator =
    Actuator { length_m: 0.03, width_m: 0.02, thickness_m: 100e-6, mass_kg: 0.1, ..Actuator::KARNER_2022 };

/// Sines of 3.5 kV on the stiffening film, 100 values a second with 4 µm of noise.
fn recordings(elements: [(f64, f64); 3]) -> Vec<Observation> {
    let mut noise = noise(7, 4e-6);
    let mut record = |hz: f64| {
        let mut film = StiffeningFilm::new(Stiffening::with(elements), 1e-3);
        let volts = |t: f64| 1750.0 * (1.0 - (TAU * hz * t).cos());
        recorded(&mut film, 1e-3, 80_000, 50.0, volts, |x| x + noise())
    };
    vec![record(0.4), record(0.15), record(0.08)]
}

fn settings(curve: CurveChoice, branches: Vec<usize>) -> Settings {
    Settings { actuator: FILM, starts: 4, curve, ..parallel(branches) }
}

/// The nonlinearity is found by itself, and feedforward follows with it on the other film.
#[test]
fn a_film_that_stiffens_in_series_is_fitted_and_followed() {
    let observations = recordings(LITTLE_CREEP);
    let [linear, settings] = [CurveChoice::None, CurveChoice::Auto].map(|curve| settings(curve, vec![1, 2]));
    let (without, with) = (fitted(&observations, &linear), fitted(&observations, &settings));
    println!("NRMSE {:.3} % without, {:.3} % with", nrmse_pct(&without), nrmse_pct(&with));
    assert!(with.candidate.is_in_series(), "{:?}", with.structures);
    assert!(nrmse_pct(&with) < 0.2 && nrmse_pct(&without) > 1.5 * nrmse_pct(&with));
    assert!(with.warnings.iter().any(|warning| warning.contains("only one amplitude")), "{:?}", with.warnings);

    let rms_pct = feedforward_pct(&parameters(&with, &settings, Direction::Force), LITTLE_CREEP);
    println!("feedforward: {rms_pct:.3} % of peak to peak");
    assert!(rms_pct < 0.5, "{rms_pct}");
}

/// With much creep as well. A curve and a saturation need the coupling for it, which raises the share of the creep with the load, by more than the
/// film can thin: the field limit follows the thinning.
#[test]
fn a_film_that_stiffens_and_creeps_much_is_followed() {
    let observations = recordings(MUCH_CREEP);
    let [linear, auto, both] =
        [CurveChoice::None, CurveChoice::Auto, CurveChoice::Both].map(|curve| settings(curve, vec![2]));
    let without = fitted(&observations, &linear);
    let straight = feedforward_pct(&parameters(&without, &linear, Direction::Force), MUCH_CREEP);
    let series = fitted(&observations, &auto);
    let series_pct = feedforward_pct(&parameters(&series, &auto, Direction::Force), MUCH_CREEP);
    println!("in series: NRMSE {:.3} %, feedforward {series_pct:.3} %", nrmse_pct(&series));
    assert!(series.candidate.is_in_series() && nrmse_pct(&series) < 0.2 && series_pct < 0.5, "{:?}", series.structures);

    let with = fitted(&observations, &both);
    println!("NRMSE {:.3} % without, {:.3} % with: {:?}", nrmse_pct(&without), nrmse_pct(&with), with.structures);
    let bent = parameters(&with, &both, Direction::Force);
    let rms_pct = feedforward_pct(&bent, MUCH_CREEP);
    println!("feedforward: {straight:.3} % of peak to peak without, {rms_pct:.3} % with, {:?}", bent.actuator);
    assert!(nrmse_pct(&with) < 0.6 && rms_pct < 1.5, "{rms_pct}");
    let compared = with.structures.iter().all(|row| row.left_out_nrmse_pct.is_some() && row.left_out_missing.is_none());
    assert!(compared, "every structure is compared on recordings that were left out: {:?}", with.structures);
    assert!(bent.curve.is_some() && bent.actuator.saturation_v.is_some());
    let most = 3.0 / FILM.length_m;
    assert!(bent.actuator.stretch_coupling > most && bent.actuator.thinning_per_m() == most, "{:?}", bent.actuator);
}

/// Error (RMS, % of peak to peak) with which feedforward takes the film of `elements` along a sine from 1 to 2.6 mm, after 2 s.
fn feedforward_pct(parameters: &Parameters, elements: [(f64, f64); 3]) -> f64 {
    let wanted: Vec<f64> = (0..=40_000).map(|k| risen_sine_m(1e-3 * f64::from(k), 2.0, 1e-3, 2.6e-3, 0.2)).collect();
    let mut film = StiffeningFilm::new(Stiffening::with(elements), 1e-3);
    let errors = feedforward_errors_m(parameters, &wanted, CommandLimits::BENCH, &mut film);
    100.0 / 1.6e-3 * rms(&errors[2000..])
}

/// Stress and stretch of Gent's rubber with a springpot's memory, from closed forms: loading at a constant rate and back is a sum of
/// ramps of T only where T is linear, so the strain is held: c T(x) t^−α / Γ(1 − α), at four strains.
#[test]
fn the_curve_of_rubber_is_found_in_relaxations() {
    let rubber = Rubber { share: 0.5, limit: 60.0, rest_stretch: 1.0, free_length_m: 0.02 };
    let curve = rubber.curve(0.0, 60e-3).expect("rises");
    const GAMMA_0_85: f64 = 1.117_612_857_664_556;
    let relaxation = |strain_m: f64| {
        let time_s: Vec<f64> = (1..=400).map(|k| 0.1 * f64::from(k)).collect();
        let value = time_s.iter().map(|t| 300.0 * curve.value(strain_m) * t.powf(-0.15) / GAMMA_0_85).collect();
        let drive = Samples { value: vec![strain_m; time_s.len()], time_s: time_s.clone() };
        observation(&format!("{strain_m} m"), Input::Displacement(drive), Samples { time_s, value }, 80.0)
    };
    let observations = [5e-3, 15e-3, 35e-3, 55e-3].map(relaxation);
    let actuator = Actuator { mass_kg: 0.0, ..FILM };
    let settings = Settings { actuator, starts: 8, ..settings(CurveChoice::Auto, vec![0, 1]) };
    let fit = fitted(&observations, &settings);
    assert!(fit.r2_mean > 0.9999, "{} {:?}", fit.r2_mean, fit.structures);
    let found = fit.candidate.bend.curve().expect("a curve").expect("not straight");
    let scale = fit.candidate.elements[0].c / 300.0;
    for x in [5e-3, 20e-3, 35e-3, 50e-3] {
        let share = found.value(x) * scale / curve.value(x);
        assert!((share - 1.0).abs() < 0.03, "{x} m: {share}, {:?}", fit.candidate.bend);
    }
}

#[test]
fn a_linear_film_stays_linear() {
    let model = Maxwell::new(Springpot::new(2e4, 0.15), &[], Topology::Parallel, 0.1).expect("valid");
    let grid = Grid::covering(60.0, 50.0).expect("a grid");
    let mut noise = noise(3, 4e-6);
    let parameters = Parameters { model, actuator: FILM, ..Parameters::preset("table3-n1").expect("there") };
    let observations = [0.4, 0.1].map(|hz| {
        let volts: Vec<f64> = grid.times_s().iter().map(|t| 1750.0 * (1.0 - (TAU * hz * t).cos())).collect();
        let moved_m = moved_m(&parameters, volts.clone(), 50.0, MemoryChoice::Full);
        let value = moved_m.into_iter().map(|x| x + noise()).collect();
        let input = Input::Voltage(Samples { time_s: grid.times_s(), value: volts });
        observation("linear", input, Samples { time_s: grid.times_s(), value }, 50.0)
    });
    let fit = fitted(&observations, &Settings { starts: 8, ..settings(CurveChoice::Auto, vec![0, 1]) });
    assert_eq!(
        (fit.candidate.bend, fit.candidate.actuator.saturation_v),
        (Bend::Straight, None),
        "{:?}",
        fit.structures
    );
}

/// A fractional kernel behind Gent's curve, strokes to 30 %: numbers of measured VHB 4910.
fn bent_parameters() -> Parameters {
    let rubber = Rubber { share: 0.5, limit: 137.0, rest_stretch: 1.4, free_length_m: 0.02 };
    let curve = ElasticCurve::rubber(rubber, -2e-3, 10e-3).expect("rises");
    let model = Maxwell::new(Springpot::new(6e3, 0.11), &[], Topology::Parallel, 0.1).expect("valid");
    let actuator = Actuator { stretch_coupling: 30.0, saturation_v: Some(9e3), ..FILM };
    Parameters { model, actuator, curve: Some(curve), ..Parameters::preset("table3-n1").expect("there") }
}

/// The same kernel in Hencky's strain beside a spring that stiffens.
fn two_curves() -> Parameters {
    let measure = Measure { exponent: 0.0, length_m: 0.03 };
    let curve = ElasticCurve::measure(measure, -2e-3, 10e-3).expect("a film with a length");
    let spring = Spring::through(&[(-2e-3, -6.0), (0.0, 0.0), (5e-3, 20.0), (10e-3, 60.0)]).expect("a spring");
    Parameters { curve: Some(curve), spring: Some(spring), ..bent_parameters() }
}

/// The same kernel in series with four such springs.
fn in_series() -> Parameters {
    let film = two_curves();
    let spring = film.spring.map(|spring| spring.scaled(4.0).expect("a spring"));
    Parameters { curve: None, spring, ..film }
}

/// Compressed and full memory, forwards and backwards, in both discretisations, and the plant, which solves every step exactly: behind a curve,
/// with two, and with a spring in series.
#[test]
fn every_way_to_run_a_curve_agrees() {
    let grid = Grid::covering(8.0, 500.0).expect("a grid");
    let volts: Vec<f64> = grid.times_s().iter().map(|t| 1600.0 * (1.0 - (TAU * 0.6 * t).cos())).collect();
    let input = Input::Voltage(Samples { time_s: grid.times_s(), value: volts.clone() });
    let bar = ProgressBar::hidden();
    let films = [bent_parameters(), two_curves(), in_series()].into_iter();
    let films = films
        .flat_map(|film| [Discretisation::Gl, Discretisation::Bdf2].map(|method| film.clone().with_method(method)));
    for parameters in films {
        let method = parameters.method;
        let run = |memory, input: &Input| {
            let options = RunOptions { memory, precision: Precision::F64, rate_hz: 500.0 };
            simulate::response(&parameters, input, grid, &options, &bar).expect("a response")
        };
        let full = run(MemoryChoice::Full, &input);
        let largest = full.displacement_m.iter().copied().fold(0.0, f64::max);
        assert!((2e-3..9e-3).contains(&largest), "{largest}");
        let compressed = run(MemoryChoice::Compressed, &input);
        assert!(far(&full.displacement_m, &compressed.displacement_m) < 1e-5 * largest, "{method:?}");
        let path = Input::Displacement(Samples { time_s: grid.times_s(), value: full.displacement_m.clone() });
        let back = run(MemoryChoice::Full, &path);
        let force = full.force_n.iter().copied().fold(0.0, f64::max);
        assert!(far(&back.force_n, &full.force_n) < 1e-7 * force, "{method:?}");
        let back = run(MemoryChoice::Compressed, &path);
        assert!(far(&back.force_n, &full.force_n) < 1e-5 * force, "{method:?}");
        if method == Discretisation::Gl {
            let plant = FullMemoryPlant::at_rest(&parameters, Mismatch::NONE, grid.step_s(), grid.samples);
            let stepped = driven(&mut plant.expect("a plant"), volts.iter().copied());
            assert!(far(&stepped, &full.displacement_m) < 1e-8 * largest);
        }
    }
}

/// The feasible band of a film that is not linear is bracketed: just inside it is feasible, just outside it is not.
#[test]
fn the_feasible_band_behind_a_curve_is_bracketed() {
    let _ = bracketed(&in_series());
    let parameters = bent_parameters();
    let check = bracketed(&parameters);
    assert_eq!(check(0.0).beyond_curve_pct, 0.0);
    assert!(check(9e-3).beyond_curve_pct > 10.0);
}

/// Brackets the feasible band of `parameters`, and returns the check of an offset (m).
fn bracketed(parameters: &Parameters) -> impl Fn(f64) -> Feasibility {
    let grid = Grid::covering(10.0, 200.0).expect("a grid");
    let limits = CommandLimits { max_voltage_v: 3500.0, ..CommandLimits::BENCH };
    let path = move |offset: f64| -> Vec<f64> {
        let rise = |t: f64| minimum_jerk(t / 2.0);
        let at = |t: &f64| (2e-3 + offset) * rise(*t) + 1e-3 * rise(*t) * (TAU * 0.5 * t).sin();
        grid.times_s().iter().map(at).collect()
    };
    let check = move |offset: f64| feasibility::check(parameters, &path(offset), grid, &limits).expect("checked");
    let band = check(0.0);
    let (least, most) = (band.least_offset_m.expect("a band"), band.most_offset_m.expect("a band"));
    assert!(least < most, "{band:?}");
    for (offset, feasible) in [(least + 2e-5, true), (least - 2e-5, false), (most - 2e-5, true), (most + 2e-5, false)] {
        assert_eq!(check(offset).feasible, feasible, "{offset} of {least} to {most}: {:?}", check(offset));
    }
    check
}

/// A curve in a file is used as it is written, and is unchanged when the file is written again.
#[test]
fn curves_in_parameter_files() {
    let text = bent_parameters().to_toml();
    assert!(text.starts_with("schema = 2\n"), "{text}");
    let again = Parameters::from_toml(Path::new("p.toml"), &text).expect("valid");
    assert_eq!((&again.curve, &again.actuator), (&bent_parameters().curve, &bent_parameters().actuator));
    let linear = Parameters::preset("table3-n1").expect("there").to_toml();
    assert!(linear.starts_with("schema = 1\n"));

    let points = Curve::through(&[(-1e-3, -0.8e-3), (0.0, 0.0), (2e-3, 3e-3)]).expect("rises");
    let free = Parameters { curve: Some(ElasticCurve::free(points)), ..bent_parameters() };
    let text = free.to_toml();
    let again = Parameters::from_toml(Path::new("p.toml"), &text).expect("valid");
    assert_eq!(again.to_toml(), text);

    let refused = |from: &str, to: &str, names: &[&str]| {
        let changed = text.replacen(from, to, 1);
        assert_ne!(changed, text, "{from}");
        let error = Parameters::from_toml(Path::new("p.toml"), &changed).expect_err("refused").to_string();
        for name in names {
            assert!(error.contains(name), "{error:?} does not name {name:?}");
        }
    };
    refused("schema = 2", "schema = 1", &["p.toml:12", "saturation_v", "schema = 2"]);
    refused("saturation_v = 9000.0", "saturation_v = -1.0", &["p.toml:12", "saturation_v"]);
    refused("elastic = \"free\"", "elastic = \"gent\"", &["p.toml", "[curve]", "displacement_m"]);
    refused("displacement_m = [-0.001, 0.0", "displacement_m = [-0.001, 0.003", &["p.toml", "[curve]", "knot 3"]);
    refused("value_m = [", "value_m = [0.0, ", &["4 values", "3 displacements"]);
    refused("elastic = \"free\"", "elastic = \"free\"\nshare = 0.5", &["share"]);
    refused("elastic = \"free\"", "elastic = \"cubic\"", &["p.toml", "cubic"]);
}
