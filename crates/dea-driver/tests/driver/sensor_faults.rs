//! Sensors that fail in ways that look plausible, while tracking: it must not drive the film beyond its stroke. Healthy ones, and
//! films that need not move, are not suspected.

use dea_driver::{AdaptationOrder, Cause, Controller, DriverState, Mode, Parameters, SensorFault};
use rand::SeedableRng;
use rand_distr::{Distribution, Normal};
use rand_pcg::Pcg64;
use springpot::Actuator;

use crate::film_bench::{FilmBench, adc_v, rides_through, sensor_adc_v};

/// Tick of the fault.
const FAULT: u32 = 20_000;

/// A sensor: its reading (m) of a film, by the ticks since the fault, where the film is, and where it was then (m).
pub struct Sensor<'a> {
    pub reads_m: &'a dyn Fn(u32, f64, f64) -> f64,
    /// Noise of the whole sensor before the fault, m rms.
    pub noise_m: f64,
    /// Noise of the converter, in steps of 0.156 µm.
    pub noise_lsb: f64,
}

/// With the noise of a laser and its converter.
fn reading(reads_m: &dyn Fn(u32, f64, f64) -> f64) -> Sensor<'_> {
    Sensor { reads_m, noise_m: 3e-6, noise_lsb: 0.6 }
}

/// One that is right.
const HEALTHY: Sensor<'static> = Sensor { reads_m: &|_, film_m, _| film_m, noise_m: 3e-6, noise_lsb: 0.6 };

/// One that shows where the film was, and the noise of its converter.
fn frozen(noise_lsb: f64) -> Sensor<'static> {
    Sensor { reads_m: &|_, _, held_m| held_m, noise_m: 3e-6, noise_lsb }
}

/// How a run ended.
#[derive(Debug)]
pub struct End {
    pub state: DriverState,
    /// After the fault.
    pub ticks: u32,
    /// Largest displacement of the film, m.
    pub furthest_m: f64,
}

/// A film of so many times the model's force, with this stroke.
fn film(force_scale: f64, max_displacement_m: f32) -> FilmBench {
    FilmBench { force_scale, ..FilmBench::changed(|p| p.limits.max_displacement_m = max_displacement_m) }
}

/// A swing between 0.2 and 0.6 mm of 0.1 Hz, for as long as it takes.
fn reference_m(tick: u32) -> f64 {
    let time_s = f64::from(tick) / 1000.0;
    (time_s / 2.0).min(1.0) * (0.4e-3 - 0.2e-3 * (0.628 * time_s).sin())
}

/// Runs until it trips, for `ticks` after the fault at the most.
fn run(bench: FilmBench, sensor: &Sensor, ticks: u32) -> End {
    run_along(bench, Mode::Tracking, reference_m, sensor, ticks)
}

/// Along `wanted_m`, in voltages of a film of 27 kN/m where `mode` follows no reference.
pub fn run_along(mut bench: FilmBench, mode: Mode, wanted_m: impl Fn(u32) -> f64, sensor: &Sensor, ticks: u32) -> End {
    let normal = Normal::new(0.0, 1.0).expect("valid");
    let mut random = Pcg64::seed_from_u64(7);
    bench.start(mode);
    let mut held_m = 0.0;
    for tick in 0..FAULT + ticks {
        if tick.is_multiple_of(10) {
            match mode {
                Mode::Voltage => {
                    let per_square_volt = Actuator::KARNER_2022.force_per_square_volt();
                    bench.set_voltage((wanted_m(tick) * 27e3 / per_square_volt).sqrt() as f32);
                }
                _ => bench.set_reference(wanted_m(tick) as f32),
            }
        }
        let film_m = bench.displacement_m;
        let shown_m = if tick < FAULT {
            held_m = film_m;
            film_m + sensor.noise_m * normal.sample(&mut random)
        } else {
            (sensor.reads_m)(tick - FAULT, film_m, held_m)
        };
        let lsb = sensor.noise_lsb * normal.sample(&mut random);
        bench.tick(|inputs| inputs.sensor_adc_v = Some(sensor_adc_v(shown_m, lsb)));
        let state = bench.state();
        if state != DriverState::Running {
            assert!(tick >= FAULT, "it trips while it is healthy, in tick {tick}: {state:?}");
            return End { state, ticks: tick - FAULT, furthest_m: bench.furthest_m };
        }
    }
    End { state: DriverState::Running, ticks, furthest_m: bench.furthest_m }
}

/// A frozen sensor still shows the noise of its converter, or of all that is behind the place where it froze. Without the comparison with
/// the model it was never noticed: the film was driven to 6 kV within 7 s while tracking, and to 1.3 times its stroke by voltages.
#[test]
fn a_frozen_sensor_trips_within_a_second() {
    for mode in [Mode::Tracking, Mode::Feedforward, Mode::Voltage] {
        for noise_lsb in [0.0, 0.3, 2.0, 20.0, 64.0] {
            let end = run_along(film(1.0, 1e-3), mode, reference_m, &frozen(noise_lsb), 10_000);
            println!("{mode:?}, frozen with {noise_lsb} LSB: {end:?}");
            assert_eq!(end.state, DriverState::Tripped(Cause::Sensor(SensorFault::Stuck)), "{mode:?}, {noise_lsb} LSB");
            assert!(end.ticks <= 1000 && end.furthest_m < 0.75e-3, "{mode:?}, {noise_lsb} LSB: {end:?}");
        }
    }
}

/// A voltage that is held: nothing moves but creep, and the film is softer than its model, as the sensor has shown before it froze.
/// The film went to 1.25 times its stroke.
#[test]
fn a_softer_film_under_a_held_voltage_keeps_its_stroke() {
    let rise = |tick: u32| 0.75e-3 * (f64::from(tick) / 10_000.0).min(1.0);
    let end = run_along(film(1.25, 1e-3), Mode::Voltage, rise, &frozen(20.0), 400_000);
    println!("{end:?}");
    assert!(end.furthest_m < 1.03e-3 && end.state != DriverState::Running, "{end:?}");
}

/// References that are too fast for the observer to adapt its force scale, on a film that warms by as much as a fit never sees, and a sensor
/// that drifts after that: 1.28 to 1.61 times its stroke, at -3 um/s without a trip.
#[test]
fn a_film_that_has_warmed_keeps_its_stroke() {
    for (force_scale, period_s, um_per_s) in [(1.43, 2.0, 3.0), (1.67, 0.7, 10.0)] {
        let drifts = |ticks: u32, film_m: f64, _: f64| film_m - 1e-9 * um_per_s * f64::from(ticks);
        let swings = |tick: u32| {
            let time_s = f64::from(tick) / 1000.0;
            (time_s / 2.0).min(1.0) * (1.2e-3 - 0.4e-3 * (core::f64::consts::TAU * time_s / period_s).cos())
        };
        let limits = |p: &mut Parameters| (p.limits.max_displacement_m, p.limits.max_disturbance_share) = (2e-3, 0.4);
        let bench = FilmBench { force_scale, ..FilmBench::changed(limits) };
        let end = run_along(bench, Mode::Tracking, swings, &reading(&drifts), 200_000);
        let case = format!("{force_scale}, {period_s} s, {um_per_s} um/s: {end:?}");
        println!("{case}");
        assert!(end.furthest_m < 2.1e-3 && end.state != DriverState::Running, "{case}");
    }
}

/// Drift, a slip below the plausible jump, and a gain that falls: the film stays within its stroke and a tenth, for 100 s.
#[test]
fn a_sensor_that_reads_too_little_does_not_lead_the_film_away() {
    type Reads = fn(u32, f64, f64) -> f64;
    let faults: [(&str, f32, Reads); 5] = [
        ("drift of -20 um/s", 1e-3, |ticks, film_m, _| film_m - 20e-9 * f64::from(ticks)),
        ("drift of -1 mm/s", 1e-3, |ticks, film_m, _| film_m - 1e-6 * f64::from(ticks)),
        ("slip of 0.3 mm", 0.8e-3, |_, film_m, _| film_m - 0.3e-3),
        ("gain of 0.5 within 10 s", 1e-3, |ticks, film_m, _| {
            film_m * (1.0 - 0.5 * (f64::from(ticks) / 10_000.0).min(1.0))
        }),
        ("gain of 3", 1e-3, |_, film_m, _| film_m * 3.0),
    ];
    for (name, limit_m, reads_m) in faults {
        let end = run(film(1.0, limit_m), &reading(&reads_m), 100_000);
        println!("{name}: {end:?}");
        assert!(end.furthest_m < 1.1 * f64::from(limit_m), "{name}: {end:?}");
    }
}

/// A sensor that lies so slowly that the controller takes it for a film that becomes stiffer: its force scale and its disturbance follow the
/// lie for ten minutes, and so does all of the law where it follows a film that changes, however far it may. The model that watches the stroke
/// follows nothing of it, whether the film is as its model, softer or stiffer.
#[test]
fn a_sensor_that_lies_slowly_does_not_raise_the_stroke() {
    type Reads = fn(u32, f64, f64) -> f64;
    let lies: [(&str, Reads); 3] = [
        ("gain of 0.4 within 10 min", |ticks, film_m, _| film_m * (1.0 - 0.6 * f64::from(ticks) / 600_000.0)),
        ("drift of -1 um/s", |ticks, film_m, _| film_m - 1e-9 * f64::from(ticks)),
        ("creep of half of what it shows within 10 min", |ticks, film_m, _| {
            film_m * (1.0 - 0.08 * (1.0 + f64::from(ticks) / 1000.0).ln())
        }),
    ];
    for adaptation in [None, Some(AdaptationOrder::Learn { trip_at: f32::INFINITY })] {
        for (name, reads_m) in lies {
            for force_scale in [0.87, 1.0, 1.15] {
                let limits =
                    |p: &mut Parameters| (p.limits.max_displacement_m, p.limits.max_disturbance_share) = (0.8e-3, 0.4);
                let mut bench = FilmBench { force_scale, ..FilmBench::changed(limits) };
                adaptation.into_iter().for_each(|order| bench.order_adaptation(order));
                let end = run(bench, &reading(&reads_m), 600_000);
                let case = format!("{adaptation:?}, {name}, {force_scale}: {end:?}");
                println!("{case}");
                assert!(end.furthest_m < 1.05 * 0.8e-3, "{case}");
                assert_eq!(end.state, DriverState::Tripped(Cause::ModelDisplacement), "{case}");
            }
        }
    }
}

/// A film that has shown to be softer than its model goes further than the model when the sensor drifts: as far as the model says with the
/// force scale that was learned. The model alone let it go to 1.25 times its stroke.
#[test]
fn a_softer_film_keeps_its_stroke_as_well() {
    for (force_scale, um_per_s) in [(1.11, 100.0), (1.25, 25.0), (1.25, 60.0)] {
        let drifts = |ticks: u32, film_m: f64, _: f64| film_m - 1e-9 * um_per_s * f64::from(ticks);
        let end = run(film(force_scale, 1e-3), &reading(&drifts), 60_000);
        println!("{force_scale}, {um_per_s} um/s: {end:?}");
        assert!(end.furthest_m < 1.05e-3, "{force_scale}, {um_per_s} um/s: {end:?}");
        assert!(end.state != DriverState::Running, "{force_scale}, {um_per_s} um/s: {end:?}");
        // As long as the sensor is right it goes to the end of its stroke without a trip.
        let end = run(film(force_scale, 0.63e-3), &HEALTHY, 60_000);
        assert_eq!(end.state, DriverState::Running, "{force_scale}: {end:?}");
        assert!(end.furthest_m > 0.59e-3, "{end:?}");
    }
}

/// A sensor that leads away from the model trips, however wide the stroke is.
#[test]
fn more_force_than_the_model_explains_trips() {
    let drifts = |ticks: u32, film_m: f64, _: f64| film_m - 0.2e-6 * f64::from(ticks);
    let end = run(film(1.0, 8e-3), &reading(&drifts), 100_000);
    println!("{end:?}");
    assert_eq!(end.state, DriverState::Tripped(Cause::Disturbance));
}

/// Healthy sensors of any noise do not trip: while the film swings, and while it is held and only creeps.
#[test]
fn a_healthy_sensor_is_not_suspected() {
    for (noise_m, noise_lsb) in [(0.0, 0.0), (0.0, 0.3), (0.1e-6, 0.6), (3e-6, 0.6), (20e-6, 2.0)] {
        let end = run(film(1.0, 1e-3), &Sensor { noise_m, noise_lsb, ..HEALTHY }, 60_000);
        assert_eq!(end.state, DriverState::Running, "{noise_m} m: {end:?}");
    }
    let mut bench = film(1.0, 1e-3);
    bench.start(Mode::Tracking);
    for tick in 0..120_000 {
        if tick % 100 == 0 {
            bench.set_reference(0.5e-3);
        }
        // A converter whose noise is less than its step: what it shows is the film alone.
        let code = ((1.0 + bench.displacement_m / 1e-3) / 10.24 * 65_536.0) as u16;
        bench.tick(|inputs| inputs.sensor_adc_v = Some(adc_v(code ^ (tick & 1) as u16)));
        assert_eq!(bench.state(), DriverState::Running, "tick {tick}");
    }
}

/// A sensor that has not moved yet need not, without a reference that is followed: neither in a run of voltages without a film, as an amplifier is
/// calibrated, whatever reference was set, nor when its model creeps back.
#[test]
fn a_sensor_is_not_stuck_before_there_is_a_reference() {
    let mut bench = FilmBench::new();
    bench.start(Mode::Voltage);
    let still = |bench: &mut FilmBench, ticks: u16| {
        for tick in 0..ticks {
            bench.live_tick(|inputs| inputs.sensor_adc_v = Some(adc_v(6400 + tick % 3)));
            assert_eq!(bench.state(), DriverState::Running, "tick {tick}");
        }
    };
    for step in 0..20u16 {
        bench.set_voltage(300.0 * f32::from(step));
        still(&mut bench, 1000);
    }
    bench.set_reference(0.5e-3);
    still(&mut bench, 1000);
    bench.ask(Controller::stop).expect("running");
    bench.start_armed(Mode::Feedforward);
    still(&mut bench, 2000);
}

/// A trip that is acknowledged ends that as well: the film may have been taken off.
#[test]
fn a_sensor_need_not_move_again_after_a_trip() {
    let mut bench = FilmBench::new();
    for is_on in [true, false] {
        bench.start(Mode::Voltage);
        for tick in 0..1500 {
            bench.set_voltage(3000.0);
            bench.tick(|inputs| {
                inputs.sensor_adc_v = inputs.sensor_adc_v.filter(|_| is_on).or(Some(adc_v(6400 + tick % 3)))
            });
            assert_eq!(bench.state(), DriverState::Running, "{is_on}, tick {tick}");
        }
        bench.tick(|inputs| inputs.interlock_closed = false);
        bench.run(1001);
        bench.ask(Controller::acknowledge).expect("tripped");
        // It is off: the sensor shows 0.
        (bench.film, bench.displacement_m) = (bench.law.state(), 0.0);
    }
}

/// A monitor that does not answer trips at once, also while nothing is commanded.
#[test]
fn a_silent_monitor_trips_while_armed() {
    let mut bench = FilmBench::new();
    bench.tick(|_| ());
    bench.ask(Controller::arm).expect("healthy");
    bench.tick(|inputs| inputs.monitor_adc_v = None);
    assert_eq!(bench.state(), DriverState::Tripped(Cause::Bus));
}

/// A sensor that is not believed any more, since a sample was lost while the estimate was far away, still shows the end of the stroke. A film
/// with half as much force again as its model went to 1.57 times its stroke.
#[test]
fn a_reading_beyond_the_stroke_trips_whether_it_is_believed_or_not() {
    let bench = FilmBench::changed(|p| {
        rides_through(p);
        p.limits.max_displacement_m = 2.5e-3;
    });
    let mut bench = FilmBench { force_scale: 1.5, ..bench };
    bench.start(Mode::Feedforward);
    for tick in 0..60_000u32 {
        if bench.controller.supervisor().runs() {
            bench.set_reference((2.45e-3 * (f64::from(tick) / 40_000.0).min(1.0)) as f32);
        }
        bench.tick(|inputs| inputs.sensor_adc_v = inputs.sensor_adc_v.filter(|_| tick != 25_000));
    }
    assert_eq!(bench.state(), DriverState::Tripped(Cause::Displacement));
    assert!(bench.furthest_m < 2.51e-3, "{} m", bench.furthest_m);
}
