//! A third plant: a springpot behind the elastic curve that was measured on VHB 4910, stretched by a weight, strokes to 30 %.
//!
//! The curve is Gent's with β = 0.50 and J = 137, the order 0.11, without a spring beside it: what one kernel behind one curve found in a
//! tensile test (stretch 1 to 5.4 and back, R² 0.9988). The plant sums over its whole past and solves the curve in every substep of half
//! a millisecond; controllers run the compressed law behind the pieces that a fit to noisy recordings found.
//!
//! `cargo test -p host-models --test it measured_curve -- --nocapture` prints the table of docs/results.md.

use std::f64::consts::TAU;

use crate::recorded;
use crate::sweep::full_sweep;
use host_io::files::parameters::{ElasticCurve, Parameters};
use host_io::files::recording::Direction;
use host_io::grid::Grid;
use host_models::fit::Settings;
use host_models::fit::observation::Observation;
use host_models::fit::settings::CurveChoice;
use host_models::references::{Reference, Shape};
use host_models::simulation::closed_loop::{self, BenchModel};
use host_models::simulation::controllers::ControllerKind;
use host_models::simulation::film::{Instruments, Readings};
use host_models::simulation::plant::{FullMemoryPlant, Mismatch};
use indicatif::ProgressBar;
use rayon::prelude::*;
use springpot::{Actuator, CommandLimits, Maxwell, Rubber, Springpot, Topology};

/// Stretched to 1.4 by the weight: 30 % are 12 mm.
const AT_REST_M: f64 = 0.04;
const REST_STRETCH: f64 = 1.4;

/// Thins with its length, at constant volume and width.
pub(crate) const ACTUATOR: Actuator = Actuator {
    length_m: AT_REST_M,
    width_m: 0.05,
    thickness_m: 100e-6,
    mass_kg: 0.3,
    stretch_coupling: 1.0 / AT_REST_M,
    ..Actuator::KARNER_2022
};

const LIMITS: CommandLimits = CommandLimits { max_field_v_per_m: 6e7, ..CommandLimits::BENCH };

pub(crate) fn film() -> Parameters {
    let rubber =
        Rubber { share: 0.5, limit: 137.0, rest_stretch: REST_STRETCH, free_length_m: AT_REST_M / REST_STRETCH };
    let curve = ElasticCurve::rubber(rubber, -2e-3, 25e-3).expect("rises");
    let model = Maxwell::new(Springpot::new(9.5e3, 0.11), &[], Topology::Parallel, ACTUATOR.mass_kg).expect("valid");
    Parameters { model, actuator: ACTUATOR, curve: Some(curve), ..Parameters::preset("table3-n1").expect("there") }
}

/// A unipolar sine of `peak_v`, 100 values a second with the noise of the bench's sensor.
fn recorded(peak_v: f64, hz: f64, seed: u64) -> Observation {
    const SECONDS: f64 = 60.0;
    let grid = Grid::covering(SECONDS, 2000.0).expect("a grid");
    let plant = FullMemoryPlant::at_rest(&film(), Mismatch::NONE, grid.step_s(), grid.samples);
    let mut plant = plant.expect("a plant");
    let mut readings = Readings::new(Instruments::default(), seed);
    let volts = |t: f64| 0.5 * peak_v * (1.0 - (TAU * hz * t).cos());
    recorded::recorded(&mut plant, grid.step_s(), grid.samples, 100.0, volts, |x| readings.displacement_m(x))
}

/// The parameters that `fit` finds in recordings of two amplitudes and three frequencies, and its mean NRMSE (%).
fn fitted(curve: CurveChoice) -> (Parameters, f64) {
    let drives = [(2700.0, 0.3, 1), (2700.0, 0.1, 2), (1700.0, 0.2, 3)];
    let observations: Vec<Observation> =
        drives.into_par_iter().map(|(peak_v, hz, seed)| recorded(peak_v, hz, seed)).collect();
    let settings = Settings {
        actuator: Actuator { stretch_coupling: 0.0, ..ACTUATOR },
        starts: 4,
        curve,
        ..recorded::parallel(vec![0, 1])
    };
    let fit = recorded::fitted(&observations, &settings);
    let largest = observations[1].measured.value.iter().copied().fold(0.0, f64::max);
    println!("{:.1} % of the length at rest, {:?}, {:?}", 100.0 * largest / AT_REST_M, fit.candidate, fit.warnings);
    assert!(largest > 0.3 * AT_REST_M, "{largest}");
    (recorded::parameters(&fit, &settings, Direction::Force), recorded::nrmse_pct(&fit))
}

/// Tracking error on the film, % of the reference's peak to peak.
fn followed(parameters: &Parameters, reference: &Reference, kind: ControllerKind) -> f64 {
    let grid = Grid::covering(100.0, 1000.0).expect("a grid");
    let values = reference.on(grid).expect("valid");
    let mut controller = recorded::controller(kind, parameters, LIMITS, None, reference.high_m);
    let (substeps, substep_s) = closed_loop::substeps(grid);
    let plant = FullMemoryPlant::at_rest(&film(), Mismatch::NONE, substep_s, substeps * grid.samples);
    let (mut plant, bench, bar) = (plant.expect("a plant"), BenchModel::default(), ProgressBar::hidden());
    let run = closed_loop::track_plant(&mut plant, &bench, controller.as_mut(), &values, grid, &bar).expect("it holds");
    let quality = run.quality();
    println!("{kind:?} {:?}: {:?}, {:.0} V", reference.shape, quality.limits_met, quality.largest_voltage_v);
    quality.tracking_rms_pct.expect("it moves")
}

#[test]
fn a_springpot_behind_the_measured_curve_is_fitted_and_followed() {
    let (parameters, nrmse_pct) = fitted(CurveChoice::Auto);
    println!("NRMSE {nrmse_pct:.3} %");
    assert!(parameters.curve.is_some() && nrmse_pct < 0.3, "{nrmse_pct}");
    // What the curve is worth: only with all references, for it takes a second fit.
    let straight = full_sweep().then(|| fitted(CurveChoice::None).0);
    let references = [
        ("sine 1/10 Hz", Reference::new(Shape::Sine, 3e-3, 12e-3, 10.0)),
        ("sine 1/3 Hz", Reference::new(Shape::Sine, 4e-3, 11e-3, 3.0)),
        ("steps, 30 s plateaus", Reference::new(Shape::Steps, 3e-3, 12e-3, 30.0)),
        ("random walk", Reference::new(Shape::RandomWalk, 2e-3, 11e-3, 6.0)),
    ];
    let count = if full_sweep() { references.len() } else { 2 };
    for (name, reference) in &references[..count] {
        let open = followed(&parameters, reference, ControllerKind::Feedforward);
        let closed = followed(&parameters, reference, ControllerKind::Tracking);
        let linear = straight.as_ref().map(|straight| followed(straight, reference, ControllerKind::Feedforward));
        let linear = linear.map_or_else(|| "–".into(), |linear| format!("{linear:.2}"));
        println!("| {name} | {linear} | {open:.3} | {closed:.3} |");
        assert!(open <= 1.0 && closed <= 0.25, "{name}: feedforward {open:.3} %, tracking {closed:.3} %");
    }
}
