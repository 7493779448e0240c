//! A sensor that reads 1 mm of a film at rest: every user of its readings applies that offset once.

use std::fmt::Write;
use std::path::Path;

use dea_driver::wire::Mode;
use dea_driver::{Blob, Controller};
use host_io::files::parameters::Parameters;
use host_io::files::recording::{Direction, Recording};
use host_io::grid::Grid;
use host_models::fit::candidate::Candidate;
use host_models::fit::objective::Objective;
use host_models::fit::observation;
use host_models::replay::comparison::Comparison;
use host_models::replay::memory::{MemoryChoice, Precision, RunOptions};
use host_models::replay::observer;
use host_models::simulation::closed_loop::{self, BenchModel};
use host_models::simulation::controllers::ControllerKind;
use host_models::simulation::film::{Film, Plant, Waveform};
use host_models::simulation::processor::{FirmwareLaw, Task, TaskOptions};
use indicatif::ProgressBar;
use springpot::{CommandLimits, Preload};

use crate::recorded::{controller, far, moved_m, peak};

const OFFSET_M: f64 = 1e-3;
const RATE_HZ: f64 = 1000.0;

fn parameters(sensor_offset_m: f64) -> Parameters {
    Parameters { sensor_offset_m, ..Parameters::preset("table3-n2").expect("a preset") }
}

/// Voltage and displacement of the model itself over 10 s, and the recording that a sensor with the offset makes of them.
fn recorded() -> (Vec<f64>, Vec<f64>, Recording) {
    let grid = Grid::covering(10.0, RATE_HZ).expect("a grid");
    let wave = Waveform { peak_v: 6000.0, frequencies_hz: vec![0.2] };
    let voltage: Vec<f64> = grid.times_s().into_iter().map(|t| wave.voltage_v(t)).collect();
    let film = moved_m(&parameters(0.0), voltage.clone(), RATE_HZ, MemoryChoice::Compressed);
    let mut csv = "time_s,voltage_v,displacement_m\n".to_owned();
    for ((t, v), x) in grid.times_s().iter().zip(&voltage).zip(&film) {
        writeln!(csv, "{t},{v},{}", x + OFFSET_M).expect("memory");
    }
    let recording = Recording::from_csv(Path::new("offset.csv"), csv.as_bytes()).expect("valid");
    (voltage, film, recording)
}

fn observer_task(recording: &Recording, parameters: &Parameters) -> Task {
    let options = TaskOptions { law: FirmwareLaw::Observer, plant: None, rate_hz: RATE_HZ, duration_s: None };
    Task::from_recording(recording, &options, parameters.sensor()).expect("a task")
}

/// The processor in the loop hands the observer displacements of the film, not readings.
#[test]
fn processor_in_the_loop_takes_the_offset_off() {
    let (_, film, recording) = recorded();
    let Task::Observe(targets) = observer_task(&recording, &parameters(OFFSET_M)) else { panic!("not to observe") };
    assert_eq!(targets.len(), film.len());
    for (target, x) in targets.iter().zip(&film) {
        // Single precision of 3 mm.
        assert!((f64::from(target.sample_m.expect("a sample each")) - x).abs() < 1e-9, "{target:?} for {x}");
    }
}

/// Replay and fit add the offset, observer and processor in the loop subtract it: with the offset the model agrees with its own
/// recording in all four, without it in none.
#[test]
fn replay_fit_observer_and_processor_agree() {
    let (voltage, film, recording) = recorded();
    let errors = |offset_m: f64| -> [f64; 4] {
        let parameters = parameters(offset_m);
        let options = RunOptions { precision: Precision::F64, ..RunOptions::default() };
        let comparison = Comparison::new(&recording, Direction::Force, &parameters, RATE_HZ).expect("comparable");
        let (_, agreement) = comparison.run(&parameters, &options, &ProgressBar::hidden()).expect("a run");

        let model = &parameters.model;
        let elements = std::iter::once(model.main()).chain(model.branches().as_flattened().iter().copied()).collect();
        let candidate = Candidate { offset_m, ..Candidate::linear(parameters.actuator, elements, model.topology()) };
        let (observation, _) = observation::observe(&recording, Direction::Force, 1.0).expect("fit to be fitted");
        let objective = Objective::new(&[observation], Preload::Settled).expect("an objective");
        let fitted = objective.residuals(&objective.evaluate(&candidate).expect("a response"));

        let measured = recording.displacement().expect("measured");
        let grid = recording.grid(RATE_HZ).expect("a grid");
        let options = observer::options(0.6, 30.0, &measured, grid).expect("options");
        let observed =
            observer::estimate(&parameters, &voltage, &measured, grid, options, Precision::F64, &ProgressBar::hidden());

        let Task::Observe(targets) = observer_task(&recording, &parameters) else { panic!("not to observe") };
        let (blob, board) = parameters.checked_blob(RATE_HZ).expect("a blob");
        let mut host = Controller::new(Blob::decode(&blob, board.id).expect("valid"));
        let followed: Vec<f64> =
            targets.iter().map(|&target| host.follow(Mode::Voltage, target).displacement_m.into()).collect();
        [agreement.rmse, peak(&fitted), observed.expect("estimates").summary().innovation_rms_m, far(&followed, &film)]
    };
    // Compressed memory, full memory and f64 differ by less than a micrometre; the offset is a thousand. The firmware takes
    // every sample as 10 ms late, in which the film moves by up to 28 µm.
    let [replay, fit, observe, pil] = errors(OFFSET_M);
    assert!(replay < 1e-6 && fit < 1e-6 && observe < 1e-6 && pil < 35e-6, "{replay} {fit} {observe} {pil}");
    let [replay, fit, observe, pil] = errors(0.0);
    assert!(replay > 5e-4 && fit > 5e-4 && observe > 5e-5 && pil > 5e-4, "{replay} {fit} {observe} {pil}");
}

/// The simulated bench's sensor has no offset, so that of the parameters changes nothing in a closed loop.
#[test]
fn closed_loop_works_on_the_film_itself() {
    let grid = Grid::covering(5.0, RATE_HZ).expect("a grid");
    let reference: Vec<f64> = grid.times_s().iter().map(|t| 1e-3 * (1.0 - (t * 1.3).cos())).collect();
    let run = |offset_m: f64| {
        let mut controller =
            controller(ControllerKind::Tracking, &parameters(offset_m), CommandLimits::BENCH, None, 2e-3);
        let (film, bench) = (Film::new(Plant::Hossain), BenchModel::default());
        closed_loop::track(&film, &bench, controller.as_mut(), &reference, grid, &ProgressBar::hidden()).expect("a run")
    };
    let (plain, offset) = (run(0.0), run(OFFSET_M));
    assert_eq!(plain.displacement_m, offset.displacement_m);
    // The sensor has an effect.
    assert!(plain.disturbance_n.iter().any(|disturbance| disturbance.abs() > 1e-3));
}
