//! Demand of a reference on an amplifier that lags, against a film whose voltage has a closed form.

use std::path::Path;

use host_io::files::parameters::Parameters;
use host_io::grid::Grid;
use host_models::replay::feasibility::{self, Feasibility};
use springpot::CommandLimits;

/// Time up to which the reference is held, s.
const HELD_S: f64 = 5.0;
const DURATION_S: f64 = 8.0;

/// A spring without mass, which is at 0.5 mm under 4 kV: V = 4 kV · √(x / 0.5 mm).
fn spring(board: &str) -> Parameters {
    let toml = |c: f64| {
        format!(
            "schema = 1\nname = \"spring\"\n[actuator]\nrelative_permittivity = 4.7\nlength_m = 0.04\nwidth_m = 0.06\n\
             thickness_m = 160e-6\nmass_kg = 0.0\n[model]\ntopology = \"eq11\"\nmain = {{ c = {c:?}, alpha = 0.0 }}\nbranches = []\n{board}"
        )
    };
    let read = |c: f64| Parameters::from_toml(Path::new("spring.toml"), &toml(c)).expect("parameters");
    let force_per_square = 1.0 / read(1.0).actuator.squared_voltage(1.0, 0.0);
    read(force_per_square * 4000.0_f64.powi(2) / 0.5e-3)
}

/// The check of a voltage along `volts` (V).
fn check(board: &str, volts: impl Fn(f64) -> f64) -> Feasibility {
    let parameters = spring(board);
    let grid = Grid::covering(DURATION_S, 1000.0).expect("a grid");
    let path: Vec<f64> = grid.times_s().into_iter().map(|t| 0.5e-3 * (volts(t) / 4000.0).powi(2)).collect();
    let board = parameters.board.clone().expect("a board");
    // A voltage that is released begins to fall at once.
    let limits = CommandLimits { max_acceleration_m_per_s2: 10.0, ..board.command_limits() };
    feasibility::check(&parameters, &path, grid, &limits).expect("a check")
}

const BLEEDER: &str = "[board.amplifier]\nrise_s = 0.1\nfall_s = 0.5\n";
const IDEAL: &str = "[board]\nid = 1029\n";

/// Up in 2 s, held, and down with the time constant `time_s`.
fn let_go(time_s: f64) -> impl Fn(f64) -> f64 {
    move |now| {
        if now < 2.0 { 2000.0 * now } else { 4000.0 * (-(now - HELD_S).max(0.0) / time_s).exp() }
    }
}

/// V̇ = −V / T: too fast for a bleeder of 0.5 s exactly where T < 0.5 s, from the moment of letting go until 1 % of the largest voltage.
#[test]
fn a_film_is_let_go_no_faster_than_the_bleeder_lets_it() {
    let slow = check(BLEEDER, let_go(0.51));
    assert!(slow.feasible, "{slow:?}");
    let fast = check(BLEEDER, let_go(0.45));
    let asked = fast.amplifier.expect("an amplifier");
    assert!(!fast.feasible && fast.first_s.is_none(), "{fast:?}");
    assert!((asked.falls_too_fast_s.expect("a time") - HELD_S).abs() < 2e-3, "{asked:?}");
    let until = 0.45 * (4000.0_f64 / 60.0).ln();
    assert!((asked.falls_too_fast_pct - 100.0 * until / DURATION_S).abs() < 0.05, "{asked:?}");
    assert_eq!((asked.leads_too_high_pct, asked.leads_too_high_s), (0.0, None));
    // Without the amplifier's lag all that is possible, without a warning.
    let ideal = check(IDEAL, let_go(0.45));
    assert!(ideal.feasible && ideal.amplifier.is_none(), "{ideal:?}");
    assert!(!serde_json::to_string(&ideal).expect("JSON").contains("amplifier"));
}

/// 2 kV/s behind a lag of 0.1 s take 200 V more: too much from 5.8 kV on.
#[test]
fn a_command_that_leads_stays_within_the_largest_voltage() {
    let ramp = |most: f64| move |now: f64| (2000.0 * now).min(most);
    assert!(check(BLEEDER, ramp(5790.0)).feasible);
    let high = check(BLEEDER, ramp(5900.0));
    let asked = high.amplifier.expect("an amplifier");
    assert!(!high.feasible && high.above_largest_pct == 0.0, "{high:?}");
    assert!((asked.leads_too_high_s.expect("a time") - 2.9).abs() < 2e-3, "{asked:?}");
    assert!((asked.leads_too_high_pct - 100.0 * 0.05 / DURATION_S).abs() < 0.04, "{asked:?}");
    assert_eq!(asked.falls_too_fast_s, None);
    assert!(check(IDEAL, ramp(5900.0)).feasible);
}

/// An offset that the check names is checked: with it the reference is released slowly enough, with less it is not.
#[test]
fn offsets_know_the_amplifier() {
    // A sine of force that needs −V̇ / V up to 2.26 / s, where the bleeder gives 2 / s.
    let rise = |now: f64| {
        let share = (now / 2.0).min(1.0);
        share.powi(3) * (10.0 + share * (6.0 * share - 15.0))
    };
    let volts = |now: f64| 4000.0 * (rise(now) * (0.3 + 0.25 * (3.0 * now).sin())).sqrt();
    let low = check(BLEEDER, volts);
    assert!(!low.feasible, "{low:?}");
    assert!(check(IDEAL, volts).feasible);
    let ideal = check(IDEAL, volts);
    let least = low.least_offset_m.expect("an offset");
    assert!(least > ideal.least_offset_m.expect("an offset"), "{least}");
    let raised = |offset_m: f64| {
        check(BLEEDER, move |now: f64| {
            (volts(now).powi(2) + 4000.0_f64.powi(2) * rise(now) * offset_m / 0.5e-3).max(0.0).sqrt()
        })
    };
    assert!(raised(1.001 * least + 1e-8).feasible);
    assert!(!raised(least - 0.01 * least.abs() - 1e-6).feasible);
}
