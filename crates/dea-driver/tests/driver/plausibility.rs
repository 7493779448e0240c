//! Readings of a sensor, value by value: when it counts as frozen, for how long, and what a reset clears.

use dea_driver::{Motion, Plausibility, PlausibilityLimits, SensorFault};
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;

use crate::bench::bench_limits;

const LIMITS: PlausibilityLimits =
    PlausibilityLimits { low: -1e-3, high: 9e-3, jump: 0.4e-3, stuck_ticks: 500, stuck_band: 2e-6 };

/// Ticks of a block: a tenth of `stuck_ticks`.
const BLOCK: u32 = LIMITS.stuck_ticks / 10;

/// Ticks in a run with a film and its model at these places, m.
fn record(motion: &mut Motion, ticks: u32, film_m: f32, model_m: f32) {
    (0..ticks).for_each(|_| motion.record(film_m, model_m, || model_m, true, true));
}

/// A run before which a sample was lost, and whose law may be that of another film.
fn begin_unseen(motion: &mut Motion) {
    motion.record(f32::NAN, 0.0, || 0.0, false, false);
    motion.begin_run();
    motion.presume_softer();
}

/// How much softer than its model a film counts.
fn softness(motion: &Motion) -> f32 {
    motion.furthest(1e-3) / 1e-3
}

/// In a run.
fn begun() -> Motion {
    let mut motion = Motion::new(LIMITS);
    motion.begin_run();
    motion
}

/// A sensor of noise `noise_m` (rms) whose film is at `film_m(tick)`, and its model at `model_m(tick)`: the ticks in which it counts as frozen.
fn frozen_ticks(noise_m: f64, ticks: u32, film_m: impl Fn(u32) -> f64, model_m: impl Fn(u32) -> f64) -> Vec<u32> {
    frozen_beside(noise_m, ticks, film_m, |tick| [model_m(tick); 2])
}

/// The same of a model and its drive.
fn frozen_beside(
    noise_m: f64,
    ticks: u32,
    film_m: impl Fn(u32) -> f64,
    beside_m: impl Fn(u32) -> [f64; 2],
) -> Vec<u32> {
    let (normal, mut random) = (Normal::new(0.0, noise_m).expect("valid"), Pcg64::seed_from_u64(11));
    let mut motion = Motion::new(LIMITS);
    motion.record(0.0, 0.0, || 0.0, true, false);
    motion.begin_run();
    let is_frozen = |&tick: &u32| {
        let sensor_m = film_m(tick) + normal.sample(&mut random);
        let [model_m, drive_m] = beside_m(tick).map(|metres| metres as f32);
        motion.record(sensor_m as f32, model_m, || drive_m, true, true);
        motion.is_frozen(true)
    };
    (0..ticks).filter(is_frozen).collect()
}

/// With the noise of a converter and that of a whole sensor: within four tenths of `stuck_ticks` after the model has moved, and for as long as it
/// does not move, also when a swing brings the model back.
#[test]
fn a_frozen_sensor_is_reported_within_four_tenths_of_its_ticks() {
    for noise_m in [0.1e-6, 1e-6, 3e-6, 10e-6] {
        for moved in [50, 137, 480, 700, 1210] {
            let far_m = 20e-6 + 10.0 * noise_m;
            let jumps = |tick| if tick < moved { 0.0 } else { far_m };
            let swings = |tick| if (moved..moved + 170).contains(&tick) { far_m } else { 0.0 };
            for frozen in [
                frozen_ticks(noise_m, moved + 1000, |_| 0.0, jumps),
                frozen_ticks(noise_m, moved + 1000, |_| 0.0, swings),
            ] {
                let first = frozen[0];
                assert!((moved + 100..moved + 200).contains(&first), "{noise_m}: {first}, moved in tick {moved}");
                assert_eq!(frozen, (first..moved + 1000).collect::<Vec<_>>(), "{noise_m}, moved in tick {moved}");
            }
        }
    }
    // Less than five bands, and creep of 4 bands in `stuck_ticks`, prove nothing.
    let none: [u32; 0] = [];
    assert_eq!(frozen_ticks(0.1e-6, 3000, |_| 0.0, |tick| if tick < 700 { 0.0 } else { 9.9e-6 }), none);
    assert_eq!(frozen_ticks(0.1e-6, 10_000, |_| 0.0, |tick| 16e-9 * f64::from(tick)), none);
}

/// A film that moves a quarter as far as its model, a fifth of `stuck_ticks` late, is believed: swings of 0.1 to 200 Hz, and ramps.
#[test]
fn a_sensor_that_moves_late_and_little_is_not_frozen() {
    for hz in [0.1, 0.3, 1.0, 3.0, 5.0, 7.0, 10.0, 20.0, 33.0, 200.0] {
        let model_m = |tick: u32| 0.5e-3 * (1.0 - (std::f64::consts::TAU * hz * f64::from(tick) / 1000.0).cos());
        let film_m = |tick: u32| 0.25 * model_m(tick.saturating_sub(99));
        assert_eq!(frozen_ticks(3e-6, 20_000, film_m, model_m), [0; 0], "{hz} Hz");
    }
    let model_m = |tick: u32| 1e-9 * f64::from(tick.saturating_sub(512)).powi(2);
    assert_eq!(frozen_ticks(3e-6, 3000, |tick| 0.25 * model_m(tick.saturating_sub(99)), model_m), [0; 0]);
}

/// A model with less damping than its film swings on at its own resonance after a kick, of which its film keeps nothing. A sensor that is frozen while the drive moves
/// is reported as without the swing.
#[test]
fn a_model_that_swings_by_itself_shows_no_frozen_sensor() {
    for hz in [1.7, 2.5, 3.3, 5.0] {
        for kicked in (700..1200).step_by(23) {
            let swing = |tick: u32, damping: f64| {
                let angle = std::f64::consts::TAU * hz * f64::from(tick.saturating_sub(kicked)) / 1000.0;
                20e-6 * (-damping * angle).exp() * angle.sin()
            };
            let kick = |tick: u32| if (kicked..kicked + 80).contains(&tick) { 0.2e-3 } else { 0.0 };
            // A film that creeps back, or is driven from 3 s on.
            let driven = |tick: u32| 0.2e-6 * f64::from(tick.saturating_sub(3000));
            let rests = |tick: u32| 0.2e-3 - 2e-9 * f64::from(tick);
            let film = |tick| rests(tick) + swing(tick, 0.3);
            let beside = |tick| [rests(tick) + swing(tick, 0.02), kick(tick)];
            assert_eq!(frozen_beside(2e-6, 4000, film, beside).len(), 0, "{hz} Hz, {kicked}");
            let beside = |tick| [rests(tick) + swing(tick, 0.02) + driven(tick), kick(tick) + driven(tick)];
            let first = frozen_beside(2e-6, 4000, film, beside)[0];
            assert!((3100..3900).contains(&first), "{hz} Hz, {kicked}: {first}");
        }
    }
}

/// Begins a run of 30 blocks, and returns whether a sensor that stays at 0 counts as frozen in it, beside a model and its drive, m, by the block.
fn freezes(motion: &mut Motion, beside_m: impl Fn(u32) -> [f32; 2]) -> bool {
    motion.begin_run();
    (0..30 * BLOCK).any(|tick| {
        let [model_m, drive_m] = beside_m(tick / BLOCK);
        motion.record(0.0, model_m, || drive_m, true, true);
        motion.is_frozen(true)
    })
}

/// A model counts from five bands and a 25th of its displacement on, as far as twice its drive explains it, directly or behind a lag of twenty blocks.
/// The lag is that of this run.
#[test]
fn a_model_counts_from_its_thresholds_on() {
    let steps = |from: u32, far_m: f32| move |block: u32| if block < from { 0.0 } else { far_m };
    // From 1 mm by x = 10 um + (1 mm + x) / 25; by 100 um, 14 um of which are explained; in blocks 11 to 21 beside a drive that has stepped in block 5.
    let lag_m = 14e-6 / (2.0 * 0.95_f32.powi(7) * (1.0 - 0.95_f32.powi(10)));
    for (share, counts) in [(0.98, false), (1.02, true)] {
        let of_displacement = steps(5, share * 50e-6 / 0.96);
        assert_eq!(freezes(&mut begun(), |block| [1e-3 + of_displacement(block); 2]), counts, "{share}");
        let (model_m, drive_m) = (steps(5, 100e-6), steps(5, share * 7e-6));
        assert_eq!(freezes(&mut begun(), |block| [model_m(block), drive_m(block)]), counts, "{share} of the drive");
        let (model_m, drive_m) = (steps(12, 100e-6), steps(5, share * lag_m));
        assert_eq!(freezes(&mut begun(), |block| [model_m(block), drive_m(block)]), counts, "{share} behind the lag");
        // Ten bands with the sensor, and then without it.
        let (mut motion, along_m) = (begun(), share * 20e-6);
        record(&mut motion, 3 * BLOCK, 0.0, 0.0);
        record(&mut motion, 12 * BLOCK, along_m, along_m);
        record(&mut motion, 20 * BLOCK, along_m, 1e-3);
        assert_eq!(motion.is_frozen(false), counts, "{share} of what moves along");
    }
    let mut motion = begun();
    record(&mut motion, 30 * BLOCK, 1e-3, 1e-3);
    assert!(!freezes(&mut motion, |block| [steps(5, 100e-6)(block), 0.0]), "by the lag of the run before");
}

/// It does not outlast its run, whether or not the film was at 0 V before the next one.
#[test]
fn a_frozen_sensor_is_not_so_in_the_next_run() {
    for ends in [Motion::begin_run, |motion: &mut Motion| {
        (0..BLOCK).for_each(|_| motion.record(0.0, 0.0, || 0.0, true, false));
    }] {
        let mut motion = Motion::new(LIMITS);
        (0..BLOCK).for_each(|_| motion.record(0.0, 0.0, || 0.0, true, false));
        assert!(freezes(&mut motion, |block| [if block < 5 { 0.0 } else { 1e-3 }; 2]));
        ends(&mut motion);
        assert!(!motion.is_frozen(true));
    }
}

/// A film that moves again is no longer reported, and one that need not move is only missed once it has moved by half of what its
/// model does.
#[test]
fn a_sensor_that_moves_again_is_not_frozen() {
    let model_m = |tick: u32| if tick < 100 { 0.0 } else { 20e-6 + 5e-9 * f64::from(tick) };
    let frozen = frozen_ticks(0.1e-6, 5000, |tick| if tick < 400 { 0.0 } else { model_m(tick) }, model_m);
    let (first, last) = (frozen[0], frozen[frozen.len() - 1]);
    assert!((200..=250).contains(&first) && (400..=450).contains(&last), "{first} to {last}");

    let mut motion = Motion::new(LIMITS);
    let mut run = |share: f32| {
        motion.begin_run();
        let frozen = (0..1000u16).any(|tick| {
            let model_m = 0.5e-6 * f32::from(tick);
            motion.record(share * model_m, model_m, || model_m, true, true);
            motion.is_frozen(false)
        });
        (frozen, motion.is_frozen(true))
    };
    assert_eq!([run(0.0), run(0.45), run(0.0)], [(false, true), (false, false), (false, true)]);
    assert_eq!([run(0.55), run(0.0)], [(false, false), (true, true)]);
    motion.reset();
    assert!(!motion.is_frozen(true));
}

/// Jumps, and values out of range, say nothing about the film.
#[test]
fn a_film_is_as_soft_as_plausible_values_show() {
    let mut motion = begun();
    assert_eq!(softness(&motion), 1.0);
    for (factor, is_plausible, expected) in [(2.0, false, 1.0), (1.3, true, 1.3), (0.5, true, 1.3), (9.0, true, 4.0)] {
        (0..3000).for_each(|_| motion.record(factor * 1e-3, 1e-3, || 1e-3, is_plausible, true));
        let softness = softness(&motion);
        assert!((softness - expected).abs() < 0.015 * expected, "{factor}: {softness}");
    }
    // 0.1 mm of creep that the model does not know, at 0 V.
    (0..100).for_each(|_| motion.record(0.3e-3, 0.2e-3, || 0.2e-3, true, false));
    motion.begin_run();
    assert!((motion.furthest(1e-3) - 1.1e-3).abs() < 1e-9);
    // It is no softness.
    record(&mut motion, 3000, 1.1e-3, 1e-3);
    assert!((motion.furthest(1e-3) - 1.1e-3).abs() < 1e-9);
    // Nor is what is left of a load, where film and model creep back differently.
    record(&mut motion, 3000, 0.4e-3, 0.2e-3);
    assert!(motion.furthest(1e-3) < 1.25e-3);
    // Without a plausible value between two runs, what was known of the film stays.
    let mut motion = begun();
    record(&mut motion, 3000, 1.3e-3, 1e-3);
    let known_m = motion.furthest(1e-3);
    assert!(known_m > 1.28e-3);
    (0..3000).for_each(|_| motion.record(0.0, 0.0, || 0.0, false, false));
    motion.begin_run();
    assert_eq!(motion.furthest(1e-3), known_m);
}

/// Where a film at 0 V is shows after a whole block. A block does not count with one value that is implausible or not a number, wherever it is.
#[test]
fn a_block_shows_a_film_as_a_whole() {
    let mut motion = Motion::new(LIMITS);
    for tick in 0..BLOCK {
        assert!(!motion.is_shown(), "tick {tick}");
        motion.record(0.1e-3, 0.0, || 0.0, true, false);
    }
    assert!(motion.is_shown());
    for place in [0, 1, BLOCK - 1] {
        let mut motion = begun();
        (0..30 * BLOCK).for_each(|tick| motion.record(1.5e-3, 1e-3, || 1e-3, tick % BLOCK != place, true));
        assert_eq!(softness(&motion), 1.0, "tick {place} of each block");
    }
    for (sensor_m, model_m) in [(f32::NAN, 1e-3), (1e-3, f32::NAN)] {
        let mut motion = begun();
        record(&mut motion, 1, sensor_m, model_m);
        record(&mut motion, BLOCK - 1, 1e-3, 1e-3);
        record(&mut motion, 60 * BLOCK, 1.3e-3, 1e-3);
        assert!((softness(&motion) - 1.3).abs() < 0.01, "{sensor_m}, {model_m}");
    }
}

/// The means are those of ten blocks, each of which decays by a tenth in a block; they count down to half of the model's largest. A share by which the
/// model may be behind its film stays after a reset.
#[test]
fn softness_is_of_ten_blocks_in_the_upper_half() {
    let mut motion = begun();
    record(&mut motion, 20 * BLOCK, 1e-3, 1e-3);
    record(&mut motion, 5 * BLOCK, 2e-3, 1e-3);
    let model_m = 1e-3 * (1.0 - 0.9_f32.powi(25));
    let expected = (model_m + 1e-3 * (1.0 - 0.9_f32.powi(5))) / (model_m + LIMITS.stuck_band);
    assert!((softness(&motion) - expected).abs() < 1e-3, "{} instead of {expected}", softness(&motion));
    let mut motion = begun();
    record(&mut motion, 60 * BLOCK, 1e-3, 1e-3);
    record(&mut motion, 60 * BLOCK, 1.3 * 0.55e-3, 0.55e-3);
    assert!((softness(&motion) - 1.3).abs() < 0.01, "{}", softness(&motion));
    let mut motion = Motion::new(LIMITS).beyond_by(0.125);
    motion.reset();
    assert_eq!(softness(&motion), 1.125);
}

/// From 25 bands on: a film that is a fifth softer counted as that of its model there.
#[test]
fn a_film_is_as_soft_as_a_small_displacement_shows() {
    for (bands, least) in [(24.0, 1.0), (26.0, 1.15), (100.0, 1.185)] {
        let (mut motion, model_m) = (begun(), bands * LIMITS.stuck_band);
        record(&mut motion, 3000, 1.2 * model_m, model_m);
        let softness = softness(&motion);
        let most = if bands < 25.0 { 1.0 } else { 1.2 };
        assert!((least..=most).contains(&softness), "{bands} bands: {softness}");
    }
}

/// A law that changes within a run, and one whose sensor has lost a sample before it, count as well, once the sensor shows the film; a film that it has shown in
/// this run does not.
#[test]
fn a_film_is_presumed_softer_within_a_run() {
    let run = |motion: &mut Motion, model_m: f32| record(motion, LIMITS.stuck_ticks, model_m, model_m);
    let mut motion = begun();
    run(&mut motion, 0.0);
    motion.presume_softer();
    run(&mut motion, 0.0);
    assert_eq!(softness(&motion), 1.15);
    run(&mut motion, 1e-3);
    run(&mut motion, 1e-3);
    assert_eq!(softness(&motion), 1.0);
    motion.presume_softer();
    run(&mut motion, 1e-3);
    assert_eq!(softness(&motion), 1.0);
    // The next run begins without a plausible value: it has to show the film anew.
    begin_unseen(&mut motion);
    run(&mut motion, 0.0);
    assert_eq!(softness(&motion), 1.15);

    let mut motion = Motion::new(LIMITS);
    begin_unseen(&mut motion);
    (0..LIMITS.stuck_ticks).for_each(|_| motion.record(f32::NAN, 0.0, || 0.0, false, true));
    assert_eq!(softness(&motion), 1.0, "no sensor would end it");
    run(&mut motion, 0.0);
    assert_eq!(softness(&motion), 1.15);
    // It ends with the run.
    motion.record(f32::NAN, 0.0, || 0.0, false, false);
    let mut lost = motion;
    (0..LIMITS.stuck_ticks).for_each(|_| lost.record(0.0, 0.0, || 0.0, true, false));
    lost.begin_run();
    run(&mut lost, 0.0);
    assert_eq!(softness(&lost), 1.0);
}

/// A film whose law may be that of another is presumed softer until the sensor has shown it for ten blocks, in that run alone.
#[test]
fn a_film_is_presumed_softer_until_it_is_shown() {
    // Another law counts as long as a block is missing.
    for (blocks, counts) in [(9, 1.15), (10, 1.0)] {
        let mut motion = begun();
        record(&mut motion, blocks * BLOCK, 1e-3, 1e-3);
        motion.presume_softer();
        assert_eq!(softness(&motion), counts, "{blocks} blocks");
    }
    for (share, shown) in [(1.0, 1.0), (1.3, 1.3), (0.7, 1.0)] {
        let mut motion = begun();
        motion.presume_softer();
        assert_eq!(softness(&motion), 1.15, "it has shown nothing implausible");
        let mut blocks = |count: u32| {
            record(&mut motion, count * BLOCK, share * 1e-3, 1e-3);
            softness(&motion)
        };
        let (first, last, later) = (blocks(1), blocks(8), blocks(1));
        assert!(first >= 1.15 && last >= 1.15, "{share}: {first}, {last}");
        assert!((later - shown).abs() < 0.015 * shown, "{share}: {later}");
        motion.begin_run();
        assert_eq!(softness(&motion), 1.0);
        // Without a plausible sensor nothing would end it.
        begin_unseen(&mut motion);
        assert_eq!(softness(&motion), 1.0);
    }
}

/// After a reset a sensor has no past: no fault, and no value from which it could have jumped.
#[test]
fn a_reset_sensor_has_no_past() {
    let mut sensor = Plausibility::new(bench_limits().sensor);
    assert_eq!(sensor.check(0.5, 0.0, false), Some(SensorFault::Range));
    assert_eq!(sensor.check(1e-3, 1e-3, false), Some(SensorFault::Jump));
    sensor.reset();
    assert_eq!(sensor.check(5e-3, 1e-3, false), None);
    assert_eq!(sensor.check(5e-3, 5e-3, true), Some(SensorFault::Stuck));
}

/// The first good value after one that is not is a jump; then ten in a row end the fault.
#[test]
fn ten_good_values_in_a_row_end_a_fault() {
    let mut sensor = Plausibility::new(LIMITS);
    assert_eq!(sensor.check(f32::NAN, 0.0, false), Some(SensorFault::Range));
    assert_eq!(sensor.check(0.0, 0.0, false), Some(SensorFault::Jump));
    let faults: Vec<_> = (1..=10u8).map(|tick| sensor.check(1e-6 * f32::from(tick), 0.0, false)).collect();
    assert_eq!(faults[..9], [Some(SensorFault::Jump); 9]);
    assert_eq!(faults[9], None);
}
