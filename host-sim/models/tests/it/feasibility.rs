//! Limits of references that a film itself would follow: acceleration, the board's displacement, and what sampling leaves of them.

use std::f64::consts::{PI, TAU};

use host_io::files::parameters::Parameters;
use host_io::grid::{Grid, Samples};
use host_models::references::minimum_jerk;
use host_models::replay::feasibility::{self, Feasibility, Limit};
use host_models::sampling;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::{Actuator, CommandLimits, Maxwell, Springpot, Topology};

/// Limits of voltage that none of the references here meets.
const LIMITS: CommandLimits = CommandLimits {
    max_voltage_v: 20e3,
    max_field_v_per_m: 1e9,
    max_slew_v_per_s: 1e9,
    max_velocity_m_per_s: 10.0,
    ..CommandLimits::BENCH
};
const RATE_HZ: f64 = 1000.0;

/// A light film, so that its own mass asks for little.
fn film() -> Parameters {
    let film = Parameters::preset("table3-n2").expect("a preset");
    let model = Maxwell::new(Springpot::new(1e4, 0.1), &[], Topology::Parallel, 1e-3).expect("valid");
    Parameters { model, actuator: Actuator { mass_kg: 1e-3, ..film.actuator }, ..film }
}

/// `amplitude_m` at `hz` about 1.5 mm, after a rise of 2 s, as `rows_hz` rows a second show it.
fn sine(amplitude_m: f64, hz: f64, rows_hz: f64, grid: Grid) -> Vec<f64> {
    let time_s: Vec<f64> = (0..=(10.1 * rows_hz) as usize).map(|k| k as f64 / rows_hz).collect();
    let at = |t: f64| {
        let grown = minimum_jerk((t - 2.0) / 3.0);
        1.5e-3 * minimum_jerk(t / 2.0) + amplitude_m * grown * (TAU * hz * t).sin()
    };
    let value = time_s.iter().map(|t| at(*t)).collect();
    grid.resample(&Samples { time_s, value })
}

fn binds(found: &Feasibility, limit: Limit) -> bool {
    found.binding.iter().any(|binding| binding.limit == limit)
}

#[test]
fn an_acceleration_beyond_the_limit_is_not_feasible() {
    let (film, grid) = (film(), Grid { rate_hz: RATE_HZ, samples: 10_001 });
    let mut random = Pcg64::seed_from_u64(81);
    let mut beyond = 0;
    for draw in 0..40 {
        let hz = random.random_range(3.0..20.0);
        let amplitude_m = random.random_range(0.05e-3..0.4e-3);
        let asked = amplitude_m * (TAU * hz).powi(2);
        let share = if draw % 2 == 0 { random.random_range(0.3..0.9) } else { random.random_range(1.25..3.0) };
        let limits = CommandLimits { max_acceleration_m_per_s2: asked / share, ..LIMITS };
        // Straight lines between rows are off by a thousandth of the range at the most.
        let rows_hz = RATE_HZ / f64::from(1 + draw % 3);
        let reference = sine(amplitude_m, hz, rows_hz, grid);
        let found = feasibility::check(&film, &reference, grid, &limits).expect("a check");
        let case = format!("{draw}: {amplitude_m} m at {hz} Hz, {share} of the limit, {:?}", found.binding);
        assert_eq!(found.feasible, share < 1.0, "{case}");
        assert_eq!(binds(&found, Limit::Acceleration), share > 1.0, "{case}");
        if let Some(binding) = found.binding.iter().find(|binding| binding.limit == Limit::Acceleration) {
            assert!((0.7..1.4).contains(&(binding.needed / asked)), "{case}");
            beyond += 1;
        }
    }
    assert_eq!(beyond, 20);
    // A corner that is rounded in a few ticks takes nothing off.
    let ramp: Vec<f64> =
        (0..grid.samples).map(|k| 1e-3 * minimum_jerk(k as f64 / 2000.0).max(f64::from(k as u32) * 1e-7)).collect();
    assert!(feasibility::check(&film, &ramp, grid, &LIMITS).expect("a check").feasible);
}

#[test]
fn a_reference_beyond_the_stroke_of_the_board_is_not_feasible() {
    let (film, grid) = (film(), Grid { rate_hz: RATE_HZ, samples: 10_001 });
    let mut random = Pcg64::seed_from_u64(82);
    for draw in 0..20 {
        let reference = sine(random.random_range(0.1e-3..0.4e-3), 1.0, RATE_HZ, grid);
        let highest = reference.iter().copied().fold(0.0, f64::max);
        let mut board = film.bench(RATE_HZ);
        board.limits.max_displacement_m = (highest * if draw % 2 == 0 { 1.2 } else { 0.8 }) as f32;
        let allowed: f64 = board.limits.max_displacement_m.into();
        let film = Parameters { board: Some(board), ..film.clone() };
        let found = feasibility::check(&film, &reference, grid, &LIMITS).expect("a check");
        assert_eq!(found.feasible, draw % 2 == 0, "{found:?}");
        assert_eq!(binds(&found, Limit::Displacement), draw % 2 == 1);
        let most = highest + found.most_offset_m.expect("an offset");
        assert!((most - allowed).abs() < 1e-6, "{most} m of {allowed}");
        assert_eq!(feasibility::beyond_board(&film, &reference).is_some(), draw % 2 == 1);
        // The limit itself is within it, in the board's own numbers.
        let stroke_m = 1e-4 * f64::from(draw + 3);
        let mut board = film.bench(RATE_HZ);
        board.limits.max_displacement_m = stroke_m as f32;
        let film = Parameters { board: Some(board), ..film };
        let held: Vec<f64> = grid.times_s().into_iter().map(|t| stroke_m * minimum_jerk(t / 2.0)).collect();
        let found = feasibility::check(&film, &held, grid, &LIMITS).expect("a check");
        assert!(found.feasible && feasibility::beyond_board(&film, &held).is_none(), "{stroke_m}: {found:?}");
    }
}

/// Motion that a model steps over, and rows that are missing.
#[test]
fn motion_between_steps_and_gaps_are_remarked() {
    let mut random = Pcg64::seed_from_u64(83);
    for draw in 0..60 {
        let hz = random.random_range(0.05..0.5);
        let rows_hz = random.random_range(50.0..200.0);
        let time_s: Vec<f64> = (0..3000).map(|k| f64::from(k) / rows_hz).collect();
        let series = |time_s: &[f64]| Samples {
            time_s: time_s.to_vec(),
            value: time_s.iter().map(|t| 3e3 * (PI * hz * t).sin().powi(2)).collect(),
        };
        let smooth = series(&time_s);
        assert_eq!(sampling::remarks(&smooth, 1000.0), Vec::<String>::new(), "{draw}");
        let remarks = sampling::remarks(&smooth, hz * random.random_range(0.3..2.5));
        assert!(remarks.len() == 1 && remarks[0].contains("between the model's steps"), "{draw}: {remarks:?}");
        let (from, rows) = (random.random_range(100..2000), random.random_range(8..900));
        let cut: Vec<f64> = [&time_s[..from], &time_s[from + rows..]].concat();
        let remarks = sampling::remarks(&series(&cut), 1000.0);
        assert!(remarks.len() == 1 && remarks[0].contains("a gap of"), "{draw}: {remarks:?}");
    }
}

/// One that ends before an offset has risen is judged as a whole, and one that does not begin at 0 shows where it begins.
#[test]
fn short_references_and_jumps_are_seen() {
    let (film, grid) = (film(), Grid { rate_hz: RATE_HZ, samples: 1001 });
    let check = |value: &dyn Fn(f64) -> f64| {
        let reference: Vec<f64> = grid.times_s().into_iter().map(value).collect();
        feasibility::check(&film, &reference, grid, &LIMITS).expect("a check")
    };
    let short = check(&|t| 1e-3 * minimum_jerk(2.0 * t) * minimum_jerk(2.0 - 2.0 * t));
    assert!(short.low_m.abs() < 1e-9 && short.high_m > 0.9e-3 && short.first_m == 0.0, "{short:?}");
    assert_eq!(check(&|_| 1e-3).first_m, 1e-3);
}
