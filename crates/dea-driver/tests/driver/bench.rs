//! The bench of these tests: limits and parameters of a film like the paper's.

use dea_driver::{BLOB_LEN, ControllerMemory, Limits, Parameters, PlausibilityLimits, Readings};
use springpot::{Actuator, Law, LawOptions, Preset, Real, Spring};

/// Limits of a bench with a film like the paper's.
pub fn bench_limits() -> Limits {
    Limits {
        max_voltage_v: 6500.0,
        sensor: PlausibilityLimits { low: -0.9e-3, high: 9e-3, jump: 0.4e-3, stuck_ticks: 500, stuck_band: 2e-6 },
        ..Limits::bench(160e-6)
    }
}

/// The law of the paper's model with two branches, in single or double precision.
pub fn law_at<T: Real>(rate_hz: f64) -> Law<T> {
    let model = Preset::TABLE3_N2.model().expect("valid");
    Law::compressed(&model, LawOptions::at_step(1.0 / rate_hz)).expect("valid")
}

/// The same at 1 kHz.
pub fn law<T: Real>() -> Law<T> {
    law_at(1000.0)
}

/// The same with a spring in series, which stiffens fivefold within the stroke.
pub fn law_in_series<T: Real>() -> Law<T> {
    let spring = Spring::through(&[(-0.1e-3, -15.0), (0.0, 0.0), (0.2e-3, 40.0), (0.5e-3, 220.0)]).expect("valid");
    law().in_series(&spring).expect("valid")
}

/// Parameters of a board with that bench.
pub fn board_parameters() -> Parameters {
    of_law(&law())
}

/// The same with a change.
pub fn changed_parameters(change: impl FnOnce(&mut Parameters)) -> Parameters {
    let mut parameters = board_parameters();
    change(&mut parameters);
    parameters
}

/// The same with a law of any size.
pub fn of_law<M: ControllerMemory>(law: &Law<f32, M>) -> Parameters<M> {
    let name = "table3-n2".try_into().expect("short");
    Parameters { name, limits: bench_limits(), ..Parameters::bench(law, Actuator::KARNER_2022) }
}

/// The bytes of these parameters for a board.
pub fn encoded<M: ControllerMemory>(parameters: &Parameters<M>, board: u16) -> Vec<u8> {
    let mut bytes = [0; BLOB_LEN];
    let length = parameters.encode(board, &mut bytes).expect("valid");
    bytes[..length].to_vec()
}

/// Readings with a closed interlock, and a model that explains the film.
pub fn readings(monitor_v: f32, displacement_m: f32, predicted_m: f32) -> Readings {
    Readings {
        interlock_closed: true,
        monitor_v,
        displacement_m,
        predicted_m,
        open_loop_m: predicted_m,
        is_frozen: false,
        disturbance_share: 0.0,
    }
}
