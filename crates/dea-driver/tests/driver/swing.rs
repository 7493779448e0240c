//! A loop through the sensor that is unstable swings the command from end to end: it trips. References as large as the film allows
//! do the same on purpose, and do not.

use std::f64::consts::TAU;

use dea_driver::{Cause, DriverState, Mode, Parameters};
use springpot::{Law, LawOptions, Maxwell, Springpot, Topology};

use crate::bench::{law, of_law};
use crate::film_bench::FilmBench;

/// Ends that the command reaches in turn over `duration_s` while `reference` (m) is tracked, and the state at the end.
fn swings(bench: &mut FilmBench, duration_s: u32, reference: impl Fn(f64) -> f64) -> (u32, DriverState) {
    bench.start(Mode::Tracking);
    let (mut ends, mut at_top) = (0, false);
    for tick in 0..duration_s * 1000 {
        if tick % 10 == 0 && bench.controller.supervisor().enables() {
            bench.set_reference(reference(f64::from(tick) / 1000.0) as f32);
        }
        let volts = bench.tick(|_| ()).telemetry.command_v;
        if (volts >= 5000.0 && !at_top) || (volts <= 0.0 && at_top) {
            (ends, at_top) = (ends + 1, !at_top);
        }
    }
    (ends, bench.state())
}

/// A bench whose limits let as much pass as limits may.
fn parameters(law: &Law<f32>, bandwidth_hz: f32) -> Parameters {
    let mut parameters = of_law(law);
    parameters.control.bandwidth_hz = bandwidth_hz;
    parameters.limits.max_displacement_m = 8.5e-3;
    parameters.limits.max_disturbance_share = 0.4;
    parameters
}

/// A film with little damping that carries `mass_kg`.
fn springy(mass_kg: f64) -> Maxwell {
    Maxwell::new(Springpot::new(3e5, 0.05), &[], Topology::Eq11, mass_kg).expect("valid")
}

/// The film carries far more than its model knows: its resonance is near 3 Hz, and a bandwidth of 2.5 Hz is too much for it.
#[test]
fn a_loop_that_swings_trips() {
    let options = LawOptions::at_step(1e-3);
    let law = Law::compressed(&springy(0.316), options).expect("valid");
    let heavy = Law::compressed(&springy(850.0), options).expect("valid");
    let mut bench = FilmBench { film: heavy.state(), law: heavy, ..FilmBench::with(parameters(&law, 2.5)) };
    let (ends, state) = swings(&mut bench, 20, |t| 0.1e-3 * (1.0 - (TAU * 0.1 * t).cos()));
    assert_eq!(state, DriverState::Tripped(Cause::Disturbance), "{ends} ends");
    assert!(ends <= 2, "{ends}");
}

#[test]
fn references_as_large_as_the_film_allows_do_not_trip() {
    for (frequency_hz, amplitude_m) in [(0.1, 2e-3), (0.5, 4e-3), (1.0, 4e-3), (2.0, 4e-3)] {
        let mut bench = FilmBench::with(parameters(&law(), 0.6));
        let (ends, state) = swings(&mut bench, 30, |t| amplitude_m * (1.0 - (TAU * frequency_hz * t).cos()));
        assert_eq!(state, DriverState::Running, "{frequency_hz} Hz, {ends} ends");
    }
    // From end to end twice a second.
    let mut bench = FilmBench::with(parameters(&law(), 0.6));
    let (ends, state) = swings(&mut bench, 30, |t| if t % 1.0 < 0.5 { 8e-3 } else { 0.0 });
    assert_eq!(state, DriverState::Running, "{ends} ends");
    assert!(ends > 40, "{ends}");
}
