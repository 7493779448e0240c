//! Amplifiers that are identified from logs, against logs of an integration of their own.

use std::f64::consts::TAU;
use std::path::Path;

use host_io::files::amplifier_log::AmplifierLog;
use host_models::amplifier::{Identification, Time, identify};

use crate::recorded::noise;
use crate::sweep::full_sweep;

#[derive(Clone, Copy)]
struct Bench {
    rise_s: f64,
    fall_s: f64,
    /// Falls go towards the command with `fall_s`, not towards 0 V.
    first_order: bool,
    max_slew_v_per_s: f64,
    gain: f64,
    offset_v: f64,
    noise_v: f64,
    quantum_v: f64,
    /// How long before its row a command acts, s.
    early_s: f64,
}

const BENCH: Bench = Bench {
    rise_s: 0.1,
    fall_s: 0.1,
    first_order: false,
    max_slew_v_per_s: f64::INFINITY,
    gain: 1.02,
    offset_v: 10.0,
    noise_v: 3.0,
    quantum_v: 0.16,
    early_s: 0.0,
};

impl Bench {
    /// Rate of change (V/s) at `voltage` under `command`: the equations of the amplifier, without the code under test.
    fn slope(&self, voltage: f64, command: f64) -> f64 {
        let away = command - voltage;
        let slope = if away > 0.0 {
            away / self.rise_s
        } else if self.first_order {
            away / self.fall_s
        } else {
            (away / self.rise_s.min(self.fall_s)).max(-voltage / self.fall_s)
        };
        slope.clamp(-self.max_slew_v_per_s, self.max_slew_v_per_s)
    }

    /// The log of `command` in Euler steps of 50 µs.
    fn log(&self, rate_hz: f64, duration_s: f64, command: impl Fn(f64) -> f64) -> AmplifierLog {
        let steps = (2e4 / rate_hz).round();
        let step_s = 1.0 / (rate_hz * steps);
        let mut noise_v = noise(7, self.noise_v);
        let mut voltage = command(0.0);
        let mut csv = String::from("time_s,command_v,monitor_v\n");
        for row in 0..(duration_s * rate_hz) as u32 {
            let time_s = f64::from(row) / rate_hz;
            let read = self.gain * voltage + self.offset_v + noise_v();
            let read = self.quantum_v * (read / self.quantum_v).round();
            csv += &format!("{time_s},{},{read}\n", command(time_s));
            for step in 0..steps as u32 {
                voltage += step_s * self.slope(voltage, command(time_s + self.early_s + step_s * f64::from(step)));
            }
        }
        AmplifierLog::from_csv(Path::new("log.csv"), csv.as_bytes()).expect("a log")
    }
}

/// Up and down, twice to 0 V, a new one every 2 s.
fn steps(time_s: f64) -> f64 {
    [0.0, 3000.0, 0.0, 4500.0, 1500.0, 0.0][(time_s / 2.0 + 1e-9) as usize % 6]
}

/// Up and down in steps of 500 V and 1 s.
fn staircase(time_s: f64) -> f64 {
    let stair = (time_s + 1e-9) as usize % 10;
    500.0 * if stair <= 5 { stair as f64 } else { (10 - stair) as f64 }
}

fn sine(low: f64, high: f64, period_s: f64) -> impl Fn(f64) -> f64 {
    move |time_s| 0.5 * (low + high) - 0.5 * (high - low) * (TAU * time_s / period_s).cos()
}

fn known(time: Time) -> f64 {
    match time {
        Time::Known(value, [low, high]) => {
            assert!(low <= value && value <= high, "{time:?}");
            value
        }
        Time::Open(_) => panic!("{time:?}"),
    }
}

/// Asserts that `log` shows both times within `share`, and the monitor's gain and offset.
#[track_caller]
fn identified(log: &AmplifierLog, bench: &Bench, share: f64) -> Identification {
    let found = identify(log).expect("identified");
    let (rise, fall) = (known(found.rise), known(found.fall));
    println!(
        "{rise:.4} {fall:.4} s, gain {:.4}, {:.2} V, residual {:.2} V",
        found.gain.0, found.offset_v.0, found.residual_v
    );
    assert!((rise - bench.rise_s).abs() <= share * bench.rise_s, "rise {rise}");
    assert!((fall - bench.fall_s).abs() <= share * bench.fall_s, "fall {fall}");
    assert!(
        (found.gain.0 - bench.gain).abs() < 0.003 && (found.offset_v.0 - bench.offset_v).abs() < 5.0,
        "{:?}",
        found.gain
    );
    assert!((0.9..1.1).contains(&(found.residual_v / bench.noise_v)), "{}", found.residual_v);
    assert!(found.warnings.is_empty(), "{:?}", found.warnings);
    found
}

#[test]
fn steps_and_staircases_tell_rise_and_fall() {
    for (rise_s, fall_s) in [(0.05, 0.05), (0.1, 0.1), (0.2, 0.2), (0.1, 0.5), (0.05, 1.0), (0.2, 0.1)] {
        let bench = Bench { rise_s, fall_s, ..BENCH };
        // Ten times the rows take ten times as long.
        let rates_hz: &[f64] = if full_sweep() || fall_s == 0.5 { &[100.0, 1000.0] } else { &[100.0] };
        for &rate_hz in rates_hz {
            identified(&bench.log(rate_hz, 12.0, steps), &bench, 0.03);
            identified(&bench.log(rate_hz, 11.0, staircase), &bench, 0.03);
        }
    }
}

/// A row shows that a step has come since the row before, not when: the same for all, or each for itself.
#[test]
fn steps_between_two_rows_are_found_in_time() {
    let bench = Bench { rise_s: 0.05, fall_s: 0.2, ..BENCH };
    let uneven = |time_s: f64| {
        let times = [2.0, 4.0043, 6.0011, 8.0097, 10.0071, 12.0002];
        let at = times.iter().filter(|at| time_s >= **at - 1e-9).count();
        [0.0, 3000.0, 0.0, 4500.0, 1500.0, 3000.0, 0.0][at]
    };
    identified(&bench.log(100.0, 14.0, uneven), &bench, 0.01);
    for early_s in [0.0, 0.003, 0.007, -0.003] {
        let bench = Bench { rise_s: 0.05, fall_s: 0.2, early_s, ..BENCH };
        identified(&bench.log(100.0, 24.0, steps), &bench, 0.03);
    }
}

/// Rises of the closed form: a first-order lag behind a sine. Falls as fast are not faster than a bleeder, unless they go near 0 V.
#[test]
fn sines_tell_what_they_are_faster_than() {
    for lag_s in [0.05, 0.1, 0.2] {
        let (turn, period_s) = (TAU / 3.0, 3.0);
        let phase = (turn * lag_s).atan();
        let mut csv = String::from("time_s,command_v,voltage_v\n");
        for row in 0..3000 {
            let time_s = f64::from(row) / 100.0;
            // From rest at the mean of the sine: the particular solution, and what is left of the start.
            let swing = phase.cos() * ((turn * time_s - phase).sin() + phase.sin() * (-time_s / lag_s).exp());
            csv += &format!(
                "{time_s},{},{}\n",
                2500.0 + 1800.0 * (turn * time_s).sin(),
                1.02 * (2500.0 + 1800.0 * swing) + 10.0
            );
        }
        let log = AmplifierLog::from_csv(Path::new("log.csv"), csv.as_bytes()).expect("a log");
        let found = identify(&log).expect("identified");
        assert!((known(found.rise) - lag_s).abs() < 0.01 * lag_s, "{:?} for {lag_s} s in {period_s} s", found.rise);
        match found.fall {
            Time::Open([low, high]) => assert!(low < 1.1 * lag_s && high > 1.5 * lag_s, "{low} to {high} s"),
            Time::Known(value, _) => assert!((value - lag_s).abs() < 0.05 * lag_s, "{value}"),
        }
    }
    // Down to 0 V a bleeder shows; of a slow sine it does not.
    let bench = Bench { fall_s: 0.5, ..BENCH };
    for rate_hz in [100.0, 1000.0] {
        identified(&bench.log(rate_hz, 30.0, sine(0.0, 4000.0, 3.0)), &bench, 0.03);
        let slow = identify(&bench.log(rate_hz, 60.0, sine(700.0, 4300.0, 10.0))).expect("identified");
        assert!((known(slow.rise) - 0.1).abs() < 0.003);
        let Time::Open([low, high]) = slow.fall else { panic!("{:?}", slow.fall) };
        assert!(low < 0.5 && high > 0.5, "{low} to {high} s");
    }
}

#[test]
fn a_single_fall_in_a_minute_is_enough() {
    let bench = Bench { fall_s: 0.5, ..BENCH };
    let command = |time_s: f64| if (2.0..=50.0).contains(&time_s) { 4000.0 } else { 0.0 };
    identified(&bench.log(100.0, 60.0, command), &bench, 0.05);
}

#[test]
fn what_a_log_does_not_tell_is_open() {
    let bench = Bench { fall_s: 0.5, ..BENCH };
    let up = identify(&bench.log(1000.0, 5.0, |time_s| if time_s < 1.0 { 0.0 } else { 3000.0 })).expect("identified");
    assert!((known(up.rise) - 0.1).abs() < 0.003);
    assert!(matches!(up.fall, Time::Open([_, high]) if high > 5.0), "{:?}", up.fall);
    let down = identify(&bench.log(1000.0, 5.0, |time_s| if time_s < 1.0 { 3000.0 } else { 0.0 })).expect("identified");
    assert!((known(down.fall) - 0.5).abs() < 0.015);
    assert!(matches!(down.rise, Time::Open(_)), "{:?}", down.rise);
    // Minutes from end to end: nothing shows.
    let slow = identify(&bench.log(100.0, 60.0, sine(500.0, 3000.0, 600.0)));
    let error = slow.expect_err("open").to_string();
    assert!(error.starts_with("log.csv: ") && error.contains("steps up and down to 0 V"), "{error}");
}

/// From 4 kV to 1 kV a bleeder of 0.133 s is as fast as a lag of 0.1 s: no more is reported.
#[test]
fn falls_that_end_above_0_v_leave_a_range() {
    let command = |time_s: f64| [1000.0, 4000.0][(time_s / 2.0 + 1e-9) as usize % 2];
    for noise_v in [0.01, 3.0] {
        let found = identify(&Bench { noise_v, ..BENCH }.log(200.0, 12.0, command)).expect("identified");
        assert!((known(found.rise) - 0.1).abs() < 0.003);
        let Time::Open([low, high]) = found.fall else { panic!("{:?}", found.fall) };
        assert!((low - 0.1).abs() < 0.003 && (high - 0.1333).abs() < 0.004, "{low} to {high} s");
    }
}

#[test]
fn an_amplifier_without_a_lag_has_none() {
    for rate_hz in [100.0, 1000.0] {
        // Faster than the integration's step is too fast for it.
        let bench = Bench { rise_s: 1e-4, fall_s: 1e-4, ..BENCH };
        let found = identify(&bench.log(rate_hz, 24.0, steps)).expect("identified");
        for time in [found.rise, found.fall] {
            let Time::Known(0.0, [0.0, high]) = time else { panic!("{time:?}") };
            assert!((high * rate_hz - 1.0).abs() < 1e-9, "{high}");
        }
        // A bleeder behind a source that rises at once.
        let bench = Bench { rise_s: 1e-4, fall_s: 0.5, ..BENCH };
        let found = identify(&bench.log(rate_hz, 24.0, steps)).expect("identified");
        assert_eq!(known(found.rise), 0.0);
        assert!((known(found.fall) - 0.5).abs() < 0.015, "{:?}", found.fall);
    }
}

#[test]
fn what_the_model_does_not_explain_is_reported() {
    let partial = |time_s: f64| [1000.0, 4000.0, 2000.0, 3000.0][(time_s / 2.0 + 1e-9) as usize % 4];
    let warnings = |bench: &Bench, command: &dyn Fn(f64) -> f64| {
        identify(&bench.log(1000.0, 24.0, command)).expect("identified").warnings
    };
    let bleeder = Bench { fall_s: 0.5, ..BENCH };
    assert!(warnings(&bleeder, &partial).is_empty());
    let first_order = Bench { first_order: true, ..bleeder };
    let found = identify(&first_order.log(1000.0, 24.0, partial)).expect("identified");
    assert!(found.warnings.len() == 1 && found.warnings[0].contains("towards the command"), "{:?}", found.warnings);
    assert!((known(found.fall) - 0.5).abs() < 0.015 && (known(found.rise) - 0.1).abs() < 0.003);
    let slow = Bench { max_slew_v_per_s: 2e4, rise_s: 0.02, fall_s: 0.02, ..BENCH };
    let found = warnings(&slow, &steps);
    assert!(found.len() == 1 && found[0].contains("limited in slew"), "{found:?}");
    let found = warnings(&Bench { gain: 1.3, ..bleeder }, &steps);
    assert!(found.len() == 1 && found[0].contains("calibration"), "{found:?}");
    // A coarse monitor is neither.
    assert!(warnings(&Bench { quantum_v: 20.0, noise_v: 0.01, ..bleeder }, &steps).is_empty());
}

/// Readings that are missing are left out.
#[test]
fn a_monitor_may_be_silent_for_a_while() {
    let bench = Bench { fall_s: 0.5, ..BENCH };
    let whole = bench.log(100.0, 24.0, steps);
    let mut gaps = whole.clone();
    gaps.monitor_v.iter_mut().skip(300).take(150).for_each(|volts| *volts = f64::NAN);
    let found = identified(&gaps, &bench, 0.03);
    assert_eq!(found.samples, whole.time_s.len() - 150);
}

#[test]
fn what_does_not_follow_is_refused() {
    let mut log = BENCH.log(100.0, 24.0, steps);
    log.monitor_v.reverse();
    let error = identify(&log).expect_err("nothing follows").to_string();
    assert!(error.starts_with("log.csv: ") && error.contains("does not follow command_v"), "{error}");
}
