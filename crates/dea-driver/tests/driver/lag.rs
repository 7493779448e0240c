//! Amplifiers that lag: the command leads, the monitor's check expects it, and a film has the time that its bleeder takes.

use std::f64::consts::TAU;

use dea_driver::{Blob, BlobError, Cause, Controller, DriverState, LimitsError, Mode, Monitor, Supervisor};
use springpot::AmplifierLag;

use crate::bench::{bench_limits, changed_parameters, readings};
use crate::film_bench::{FilmBench as Bench, adc_v, rides_through};
use crate::supervisor_bench::RATE_HZ;

fn bench(amplifier_s: [f64; 2], known: AmplifierLag) -> Bench {
    let bench = Bench::changed(|p| (p.amplifier_lag, p.control.delay_s) = (known, 0.0));
    Bench { amplifier_s, ..bench }
}

/// A sine of 3 s for 20 s: the largest error after 6 s in m, and the state at the end.
fn follow(mut bench: Bench, mode: Mode) -> (f64, DriverState) {
    bench.start(mode);
    let error_m = bench.track(0..20_000, 14_000, |time_s| {
        0.7e-3 * (time_s / 2.0).min(1.0) - 0.15e-3 * (TAU * (time_s - 2.0).max(0.0) / 3.0).sin()
    });
    (error_m, bench.state())
}

/// 0.1 s up, 0.5 s down: what is left is the sensor's noise of 0 to 5 µm where both are known. Where nothing is, the monitor does not follow
/// the command and trips.
#[test]
fn the_command_leads_an_amplifier_that_lags() {
    let known = AmplifierLag { rise_s: 0.1, fall_s: 0.5 };
    for mode in [Mode::Feedforward, Mode::Tracking] {
        let (error, state) = follow(bench([0.1, 0.5], known), mode);
        println!("{mode:?}: {:.2} µm", 1e6 * error);
        assert!(state == DriverState::Running && error < 5e-6, "{mode:?}: {error} m, {state:?}");
        let (_, state) = follow(bench([0.1, 0.5], AmplifierLag::NONE), mode);
        assert_eq!(state, DriverState::Tripped(Cause::Monitor), "{mode:?}");
    }
    // Of one that is a fifth faster or slower than it says nothing trips.
    for by in [0.8, 1.2] {
        let (_, state) = follow(bench([by * 0.1, by * 0.5], known), Mode::Tracking);
        assert_eq!(state, DriverState::Running, "{by}");
    }
}

/// A monitor that reads too little, within its band, behind a stated lag: the model took its word, and the film went to 1.11 to 1.61 times its
/// stroke. There is no sensor.
#[test]
fn a_monitor_that_reads_too_little_does_not_hide_the_stroke() {
    for (gain, band_share) in [(1.0, 0.03), (0.95, 0.06), (0.9, 0.12), (0.8, 0.25)] {
        let lag = AmplifierLag { rise_s: 0.05, fall_s: 0.2 };
        let bench = Bench::changed(|p| {
            rides_through(p);
            (p.amplifier_lag, p.limits.max_displacement_m, p.limits.monitor.band_share) = (lag, 1e-3, band_share);
        });
        let mut bench = Bench { amplifier_s: [0.05, 0.2], ..bench };
        bench.start(Mode::Voltage);
        for tick in 0..200_000u32 {
            let time_s = f64::from(tick) / 1000.0;
            if bench.controller.supervisor().runs() {
                bench.set_voltage((2400.0 * (time_s / 30.0).min(1.0) + 300.0 * (time_s * TAU).sin().max(0.0)) as f32);
            }
            let monitor_v = gain * bench.high_voltage_v / 1000.0;
            bench.tick(|inputs| {
                inputs.monitor_adc_v = Some(adc_v((monitor_v / 10.24 * 65_536.0) as u16));
                inputs.sensor_adc_v = None;
            });
        }
        let (state, furthest_m) = (bench.state(), bench.furthest_m);
        println!("{gain}: {state:?}, {furthest_m} m");
        let of_stroke = [Cause::ModelDisplacement, Cause::Displacement].map(DriverState::Tripped);
        assert!(of_stroke.contains(&state), "{gain}: {state:?}");
        assert!(furthest_m <= 1e-3, "{gain}: {furthest_m} m");
    }
}

/// After how many ticks at 3 kV, commanded at once, a monitor that shows `shown` of a closed form trips.
fn trips_after(lag: AmplifierLag, shown: impl Fn(f64) -> f64) -> Option<u32> {
    let monitor = Monitor::new(bench_limits().monitor, RATE_HZ);
    let mut monitor = monitor.behind(lag, RATE_HZ).expect("valid");
    (0..5000).find(|&tick| !monitor.agrees(3000.0, shown(f64::from(tick) / 1000.0) as f32))
}

#[test]
fn the_monitor_expects_the_lag() {
    let lag = AmplifierLag { rise_s: 0.1, fall_s: 0.1 };
    let risen = |time_constant: f64| move |time_s: f64| 3000.0 * (1.0 - (-time_s / time_constant).exp());
    // Half to one and a half times as long as it says.
    for time_constant in [0.05, 0.1, 0.15] {
        assert_eq!(trips_after(lag, risen(time_constant)), None, "{time_constant} s");
    }
    // An amplifier that is dead, three times as slow, comes up at once as only another one does, or is a fifth beyond those bounds.
    let wrong: [(&dyn Fn(f64) -> f64, u32); 5] =
        [(&|_| 0.0, 40), (&risen(0.3), 100), (&|_| 3000.0, 40), (&risen(0.18), 300), (&risen(0.042), 100)];
    for (shown, within) in wrong {
        let tripped = trips_after(lag, shown).expect("it trips");
        println!("after {tripped} ticks");
        assert!(tripped < within, "after {tripped} ticks");
    }
    // Nothing expected, the same amplifier trips.
    assert!(trips_after(AmplifierLag::NONE, risen(0.1)).is_some());
}

/// With 0.5 s from 6.5 kV into 60 V takes 2.4 s: longer than the second of the limits. A film that stays live is reported all the same.
#[test]
fn a_film_may_take_the_time_of_its_bleeder() {
    for (bleeder_s, state) in [(0.5, DriverState::Disarmed), (1.0, DriverState::Tripped(Cause::LiveFilm))] {
        let mut bench = bench([0.05, bleeder_s], AmplifierLag { rise_s: 0.05, fall_s: 0.5 });
        bench.start(Mode::Voltage);
        for _ in 0..1000 {
            bench.set_voltage(6000.0);
            bench.tick(|_| ());
        }
        assert_eq!(bench.state(), DriverState::Running);
        bench.ask(Controller::disarm).expect("it runs");
        bench.run(6000);
        assert_eq!(bench.state(), state, "{bleeder_s} s");
    }
}

/// A time constant for each e-fold from the largest reading down to the band, and one more; 16 e-folds above the band are the end of the search.
#[test]
fn a_film_has_a_time_constant_for_each_e_fold() {
    let lag = AmplifierLag { rise_s: 0.0, fall_s: 0.5 };
    // From 6.5 kV and a band: 4.7 e-folds into 60 V, 23 into a microvolt.
    for (band_v, time_constants) in [(60.0, 6), (1e-6, 18)] {
        let mut limits = bench_limits();
        limits.monitor.band_v = band_v;
        let supervisor = Supervisor::new(&limits, RATE_HZ).and_then(|supervisor| supervisor.behind(lag, RATE_HZ));
        let mut supervisor = supervisor.expect("valid");
        supervisor.check(readings(3000.0, 1e-6, 0.0));
        let ticks = (1..20_000u16).find(|&tick| {
            supervisor.check(readings(0.0, 1e-6 * f32::from(tick % 3), 0.0));
            supervisor.arm().is_ok()
        });
        assert_eq!(ticks, Some(500 * time_constants), "{band_v} V");
    }
}

#[test]
fn times_that_no_amplifier_has_are_refused() {
    for (rise_s, fall_s) in [(-0.1, 0.0), (0.0, f64::NAN), (11.0, 0.1), (f64::INFINITY, 0.0)] {
        let error = Blob::new(changed_parameters(|p| p.amplifier_lag = AmplifierLag { rise_s, fall_s })).err();
        assert!(matches!(error, Some(BlobError::Limits(LimitsError::Amplifier(_)))), "{rise_s}, {fall_s}: {error:?}");
    }
}
