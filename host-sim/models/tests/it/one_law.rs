//! Host and controller build one control law, to the bit: `closed-loop`, `feedforward`, Python and the blob.
//!
//! `closed-loop` and Python build it from [`command_limits`] and [`ControllerTuning`], `feedforward` from [`command_limits`].

use dea_driver::Blob;
use host_io::files::parameters::Parameters;
use host_models::replay::limits::command_limits;
use host_models::replay::memory::Precision;
use host_models::simulation::controllers::{self, ControllerKind};
use host_models::simulation::tuning::ControllerTuning;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::{
    Actuator, Applied, Feedforward, Follower, Maxwell, Preset, SensorSample, Springpot, Topology, Tracking,
};

/// A limit near `usual` with as many digits as a file states.
fn near(rng: &mut Pcg64, usual: f64) -> f64 {
    format!("{:.3e}", usual * rng.random_range(0.7..1.0)).parse().expect("a number")
}

/// The tracking law of a controller that read the blob of `parameters`.
fn on_a_board(parameters: &Parameters, rate_hz: f64) -> Tracking<f32> {
    let (bytes, board) = parameters.checked_blob(rate_hz).expect("a blob");
    Blob::decode(&bytes, board.id).expect("valid").follower().compensator().clone()
}

/// The tracking law of the host, built as `closed-loop` builds it with `limits` on the command line.
fn on_the_host(parameters: &Parameters, rate_hz: f64, limits: &[(&str, f64)]) -> Tracking<f32> {
    let limits = command_limits(parameters.board.as_ref(), limits.iter().copied()).expect("limits");
    let settings =
        ControllerTuning::at_rate(rate_hz).settings(ControllerKind::Tracking, parameters, limits).expect("settings");
    let law = parameters.film().compressed_law(rate_hz).expect("a law");
    Tracking::new(law, &parameters.actuator, settings.limits, settings.observer).expect("valid")
}

/// Every preset at several rates.
#[test]
fn without_a_board_both_have_the_same_bench() {
    let presets = Preset::ALL.into_iter().flat_map(|preset| [200.0, 1000.0, 5000.0].map(|hz| (preset.name(), hz)));
    // Of the last a controller keeps 24 bits.
    let rates_hz = [100.0, 250.0, 500.0, 2000.0, 100.1, 333.3, 1000.0 / 3.0, 1234.567];
    for (name, rate_hz) in presets.chain(rates_hz.map(|rate_hz| ("table3-n2", rate_hz))) {
        let parameters = Parameters::preset(name).expect("a preset");
        let host = on_the_host(&parameters, rate_hz, &[]);
        assert_eq!(host, on_a_board(&parameters, rate_hz), "{name}, {rate_hz} Hz");
    }
}

/// A film with a resonance of little damping: both lower the bandwidth of the bench, by as much.
#[test]
fn without_a_board_both_have_a_bandwidth_that_suits_the_film() {
    let film = Parameters::load("preset:table3-n2").expect("a preset");
    let mut lowered = 0;
    for (alpha, mass_kg) in [(0.005, 80.0), (0.01, 214.0), (0.02, 160.0), (0.25, 1.0)] {
        let model = Maxwell::new(Springpot::new(4e4, alpha), &[], Topology::Eq11, mass_kg).expect("valid");
        let film = Parameters { model, actuator: Actuator { mass_kg, ..film.actuator }, ..film.clone() };
        for rate_hz in [200.0, 1000.0] {
            let law = on_the_host(&film, rate_hz, &[]);
            assert_eq!(law, on_a_board(&film, rate_hz), "order {alpha}, {mass_kg} kg, {rate_hz} Hz");
            let control = film.control(rate_hz).expect("a law");
            let note = film.bandwidth_note(rate_hz, control.bandwidth_hz.into());
            assert_eq!(note.is_some(), control.bandwidth_hz < 0.6);
            lowered += usize::from(note.is_some());
            // A bandwidth that is stated stays, or is refused.
            let stated = Parameters { board: Some(film.bench(rate_hz)), ..film.clone() };
            assert_eq!(stated.checked_blob(rate_hz).is_err(), control.bandwidth_hz < 0.6);
        }
    }
    assert!((2..8).contains(&lowered), "{lowered}");
}

#[test]
fn random_limits_make_one_law() {
    let mut rng = Pcg64::seed_from_u64(27);
    let film = Parameters::load("preset:table3-n2").expect("a preset");
    for case in 0..60 {
        let given = [
            ("max_voltage_v", 6000.0),
            ("max_field_v_per_m", 4.2e7),
            ("max_slew_v_per_s", 50e3),
            ("max_velocity_m_per_s", 0.05),
            ("max_acceleration_m_per_s2", 0.5),
        ]
        .map(|(name, usual)| (name, near(&mut rng, usual)));
        let mut board = film.bench(1000.0);
        let [voltage, field, slew, velocity, acceleration] = given.map(|(_, limit)| limit as f32);
        (board.limits.max_voltage_v, board.limits.max_field_v_per_m) = (voltage, field);
        board.limits.max_slew_v_per_s = slew;
        (board.control.max_velocity_m_per_s, board.control.max_acceleration_m_per_s2) = (velocity, acceleration);
        // On the command line or in the file: one law.
        let stated = Parameters { board: Some(board.clone()), ..film.clone() };
        let law = on_a_board(&stated, 1000.0);
        assert_eq!(on_the_host(&film, 1000.0, &given), law, "case {case}, on the command line: {given:?}");
        // What a file may state as well.
        board.control.return_hz = near(&mut rng, 5.0) as f32;
        board.control.bandwidth_hz = near(&mut rng, 0.6) as f32;
        board.control.adaptation_s = near(&mut rng, 30.0) as f32;
        board.control.sample_interval_s = near(&mut rng, 0.02) as f32;
        board.control.delay_s = near(&mut rng, 0.03) as f32;
        board.control.lost_after_s = near(&mut rng, 0.3) as f32;
        let stated = Parameters { board: Some(board), ..film.clone() };
        let law = on_a_board(&stated, 1000.0);
        let read = Parameters::from_toml(std::path::Path::new("film.toml"), &stated.to_toml()).expect("parameters");
        assert_eq!(on_the_host(&read, 1000.0, &[]), law, "case {case}, in the file");
        if case < 5 {
            same_voltages(&read, &law);
        }
    }
}

/// The controllers of the bench, built as a whole, against the blob's law: a reference that meets the limits.
fn same_voltages(parameters: &Parameters, tracking: &Tracking<f32>) {
    let limits = command_limits(parameters.board.as_ref(), []).expect("limits");
    let law = tracking.observer().law().clone();
    let feedforward = Feedforward::new(law.clone(), &parameters.actuator, limits).expect("valid");
    let tracking = Follower::new(tracking.clone());
    let feedforward = Follower::new(feedforward);
    let (mut tracked, mut fed) = (tracking.state(law.state()), feedforward.state(law.state()));
    let build = |kind| {
        let settings = ControllerTuning::at_rate(1000.0).settings(kind, parameters, limits).expect("settings");
        controllers::build(kind, parameters, &settings, Precision::F32).expect("a controller")
    };
    let [mut tracking_bench, mut feedforward_bench] =
        [ControllerKind::Tracking, ControllerKind::Feedforward].map(build);
    let mut voltages = [0.0_f32; 2];
    for k in 0..300_u16 {
        let reference = if k < 150 { 2.5e-3 } else { 0.5e-3 };
        let sample = (k % 10 == 0).then_some(SensorSample { displacement_m: 1e-6 * f32::from(k), age_ticks: 10 });
        let wide =
            sample.map(|sample| SensorSample { displacement_m: f64::from(sample.displacement_m), age_ticks: 10 });
        let [by_tracking, by_feedforward] = voltages.map(Applied::as_commanded);
        let bench = [
            tracking_bench.tick(Applied::as_commanded(f64::from(voltages[0])), wide, f64::from(reference)),
            feedforward_bench.tick(Applied::as_commanded(f64::from(voltages[1])), wide, f64::from(reference)),
        ];
        voltages = [
            tracking.step(&mut tracked, by_tracking, sample, reference).voltage_v,
            feedforward.step(&mut fed, by_feedforward, sample, reference).voltage_v,
        ];
        assert_eq!(bench.map(|output| output.voltage_v), voltages.map(f64::from), "tick {k}");
    }
}
