//! Readings of a sensor, value by value: when it counts as stuck, for how long, and what a reset clears.

use dea_driver::{Plausibility, PlausibilityLimits, SensorFault};

use crate::bench::bench_limits;

/// A sensor with the noise of its converter, and a model that is `modelled_m(tick)`: the ticks in which it counts as stuck.
fn stuck_ticks(ticks: u32, moves_m: impl Fn(u32) -> f32, modelled_m: impl Fn(u32) -> f32) -> Vec<u32> {
    let limits = PlausibilityLimits { low: -1e-3, high: 9e-3, jump: 0.4e-3, stuck_ticks: 500, stuck_band: 2e-6 };
    let mut sensor = Plausibility::new(limits);
    (0..ticks)
        .filter(|&tick| {
            let noise_m = [0.0, 0.5e-6, -0.3e-6][tick as usize % 3];
            let value = 1e-3 + moves_m(tick) + noise_m;
            sensor.check(value, value, modelled_m(tick)) == Some(SensorFault::Stuck)
        })
        .collect()
}

/// A frozen sensor is reported a fifth of `stuck_ticks` after the model has moved five bands, whenever that is, and stays stuck when a
/// swing brings the model back.
#[test]
fn a_frozen_sensor_is_reported_after_a_fifth_of_its_ticks() {
    for moved in [50, 137, 480, 700, 1210] {
        let stuck = stuck_ticks(moved + 1000, |_| 0.0, |tick| if tick < moved { 0.0 } else { 20e-6 });
        assert_eq!(stuck, (moved + 100..moved + 1000).collect::<Vec<_>>(), "moved in tick {moved}");
        let swings = |tick| if (moved..moved + 150).contains(&tick) { 20e-6 } else { 0.0 };
        assert_eq!(stuck_ticks(moved + 1000, |_| 0.0, swings), stuck, "a swing from tick {moved} on");
        let returns = |tick| if (moved..moved + 100).contains(&tick) { 20e-6 } else { 0.0 };
        assert_eq!(stuck_ticks(moved + 1000, |_| 0.0, returns), [0; 0], "back in time, from tick {moved} on");
    }
    // Less than five bands, and creep of 4 bands in `stuck_ticks`, prove nothing.
    assert_eq!(stuck_ticks(3000, |_| 0.0, |tick| if tick < 700 { 0.0 } else { 9.9e-6 }), [0; 0]);
    assert_eq!(stuck_ticks(10_000, |_| 0.0, |tick| 16e-9 * tick as f32), [0; 0]);
}

/// A sensor that follows again is plausible again, after ten good values.
#[test]
fn a_sensor_that_moves_again_is_not_stuck() {
    let model = |tick: u32| if tick < 100 { 0.0 } else { 20e-6 + 5e-9 * tick as f32 };
    let film = |tick: u32| if tick < 400 { 0.0 } else { 20e-6 + 5e-9 * tick as f32 };
    assert_eq!(stuck_ticks(5000, film, model), (200..409).collect::<Vec<_>>());
}

/// After a reset a sensor has no past: no fault, and no value from which it could have jumped.
#[test]
fn a_reset_sensor_has_no_past() {
    let mut sensor = Plausibility::new(bench_limits().sensor);
    assert_eq!(sensor.check(0.5, 0.0, f32::NAN), Some(SensorFault::Range));
    assert_eq!(sensor.check(1e-3, 1e-3, f32::NAN), Some(SensorFault::Jump));
    sensor.reset();
    assert_eq!(sensor.check(5e-3, 1e-3, f32::NAN), None);
}
