//! The model of a parameter file as a plant, against the full-memory answer by one Fourier transform.

use host_io::files::parameters::Parameters;
use host_io::grid::Grid;
use host_models::replay::memory::MemoryChoice;
use host_models::simulation::closed_loop::LimitShare;
use host_models::simulation::plant::{FullMemoryPlant, Mismatch, Plant};
use springpot::{Actuator, Limited, Maxwell, Preload, Springpot, Topology};

use crate::recorded::{driven, far, moved_m, peak};

fn parameters(actuator: Actuator) -> Parameters {
    let sp = Springpot::new;
    let branches = [[sp(2.2e4, 0.12), sp(1.4e4, 0.85)], [sp(1.1e4, 0.05), sp(1.5e5, 0.92)]];
    let model = Maxwell::new(sp(4e4, 0.08), &branches, Topology::Parallel, actuator.mass_kg).expect("valid");
    Parameters { actuator, model, sensor_offset_m: 1e-3, ..Parameters::preset("table3-n1").expect("there") }
}

fn volts(grid: Grid) -> Vec<f64> {
    grid.times_s().iter().map(|t| 2500.0 * (1.0 - (0.9 * t).cos()) + 300.0 * (17.0 * t).sin()).collect()
}

/// Blocks that double give the same as the whole at once, with mass, weight and coupling.
#[test]
fn is_the_full_memory_answer() {
    // Neither a power of two nor a multiple of a block.
    let grid = Grid::covering(10.003, 1000.0).expect("a grid");
    let volts = volts(grid);
    for preload in [Preload::Settled, Preload::FromStart] {
        for stretch_coupling in [0.0, 30.0] {
            let parameters = parameters(Actuator { preload, stretch_coupling, ..Actuator::KARNER_2022 });
            let exact = moved_m(&parameters, volts.clone(), grid.rate_hz, MemoryChoice::Full);
            let plant = FullMemoryPlant::at_rest(&parameters, Mismatch::NONE, grid.step_s(), grid.samples);
            let stepped = driven(&mut plant.expect("a plant"), volts.iter().copied());
            let error = far(&exact, &stepped) / peak(&exact);
            println!("{preload:?}, coupling {stretch_coupling}: {error:.1e}");
            assert!(error < 1e-8, "{preload:?}, coupling {stretch_coupling}: {error:.1e}");
        }
    }
}

/// Twice as stiff moves half as far; an order that grows leaves |K| at 1 rad/s of a single springpot as it was.
#[test]
fn a_mismatch_is_what_it_says() {
    let grid = Grid::covering(4.0, 1000.0).expect("a grid");
    let mut film = parameters(Actuator { stretch_coupling: 0.0, mass_kg: 0.0, ..Actuator::KARNER_2022 });
    film.model = Maxwell::new(film.model.main(), film.model.branches(), Topology::Parallel, 0.0).expect("valid");
    let [one, two] = [1.0, 2.0].map(|stiffness| {
        let mismatch = Mismatch { stiffness, alpha: 1.0 };
        let plant = FullMemoryPlant::at_rest(&film, mismatch, grid.step_s(), grid.samples);
        driven(&mut plant.expect("valid"), volts(grid))
    });
    assert!(one.iter().zip(&two).all(|(one, two)| (one - 2.0 * two).abs() <= 1e-9 * one.abs().max(1e-9)));

    let single = Maxwell::new(Springpot::new(3e4, 0.2), &[], Topology::Parallel, 0.0).expect("valid");
    let more = Mismatch { stiffness: 1.0, alpha: 1.5 }.apply(&single).expect("valid");
    assert!((more.main().alpha - 0.3).abs() < 1e-12);
    let size = |model: &Maxwell| model.frequency_response(1.0 / std::f64::consts::TAU).norm();
    assert!((size(&more) / size(&single) - 1.0).abs() < 1e-12);
    let error = Mismatch { stiffness: 1.0, alpha: 2.0 }.apply(&film.model).expect_err("an order above 1");
    assert!(error.to_string().contains("`plant_mismatch`") && error.to_string().contains("alpha"), "{error}");
}

/// A film that is pulled in is noticed.
#[test]
fn pull_in_is_noticed() {
    let film = parameters(Actuator { stretch_coupling: 300.0, ..Actuator::KARNER_2022 });
    let mut plant = FullMemoryPlant::at_rest(&film, Mismatch::NONE, 1e-3, 20_000).expect("a plant");
    assert!(plant.holds());
    (0..20_000).for_each(|_| plant.advance(9000.0));
    assert!(!plant.holds());
}

/// Every limit is counted, not only 0 V.
#[test]
fn every_limit_is_counted() {
    let mut limited = vec![Limited::NONE; 90];
    limited.extend([Limited::FIELD; 9]);
    limited.push(Limited::FIELD | Limited::BELOW_ZERO);
    let met = LimitShare::from_limited(&limited);
    let share = |name: &str| met.iter().find(|met| met.limit == name).map(|met| met.pct);
    assert_eq!((share("field"), share("below-zero"), share("slew")), (Some(10.0), Some(1.0), None));
    assert!(LimitShare::text(&met).contains("field 10.00 %"), "{}", LimitShare::text(&met));
}
