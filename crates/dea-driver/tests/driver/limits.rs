//! Limits: commands stay within them, and those that protect nothing or cannot be kept are refused.

use dea_driver::{
    Blob, Cause, Controller, Device, DriverState, Limits, LimitsError, Mode, MonitorLimits, PlausibilityLimits,
    Supervisor,
};
use springpot::{AmplifierLag, Curve, Law, LawOptions, Maxwell, Preset, Real, Spring};

use crate::bench::{bench_limits, changed_parameters};
use crate::film_bench::{FilmBench, rides_through};
use crate::supervisor_bench::{Bench, RATE_HZ};

#[test]
fn commands_stay_within_voltage_field_and_slew() {
    let limits = bench_limits();
    let mut bench = Bench::run(&limits);
    let mut last = bench.supervisor.command_v();
    for wanted in [1e9, f32::INFINITY, -1e9, f32::NAN, 3000.0, f32::NEG_INFINITY, 6500.0] {
        for _ in 0..200 {
            let command = bench.supervisor.command(wanted, 1.0);
            assert!((0.0..=6500.0).contains(&command), "{wanted}: {command} V");
            // 50 kV/s at 1 kHz.
            assert!((command - last).abs() <= 50.001, "{wanted}: from {last} to {command} V");
            last = command;
        }
        // Not a number counts as 0 V.
        assert_eq!(last, if wanted > 0.0 { wanted.min(6500.0) } else { 0.0 }, "{wanted}");
    }
    // 42 V/µm over 160 µm are 6720 V; over 100 µm 4200 V.
    let thin = Limits { thickness_m: 100e-6, ..limits };
    let mut bench = Bench::run(&thin);
    for _ in 0..200 {
        bench.supervisor.command(6500.0, 1.0);
    }
    assert!((bench.supervisor.command_v() - 4200.0).abs() < 0.1);
    // A film that is stretched is thinner: the field outranks the slew.
    assert!((bench.supervisor.command(6500.0, 1.05) - 4000.0).abs() < 0.1);
    assert!((bench.supervisor.command(6500.0, f32::NAN) - 4050.0).abs() < 0.1, "50 kV/s upwards");
    // One that is shorter than at rest, or whose thickness is not a number, has no more voltage than at rest.
    for thinning in [0.9, f32::NAN] {
        for _ in 0..10 {
            bench.supervisor.command(6500.0, thinning);
        }
        assert!((bench.supervisor.command_v() - 4200.0).abs() < 0.1, "{thinning}");
    }
    // Less than a volt is a voltage.
    for _ in 0..100 {
        bench.supervisor.command(0.5, 1.0);
    }
    assert!((bench.supervisor.command_v() - 0.5).abs() < 1e-3);
}

type Change = fn(&mut Limits);

fn checked(change: impl Fn(&mut Limits)) -> Result<(), LimitsError> {
    let mut limits = bench_limits();
    change(&mut limits);
    Supervisor::new(&limits, RATE_HZ).map(drop)
}

/// Each of `changes` is refused as `debug` has it, in one line with the values that were compared.
fn refused(debug: &str, changes: &[(Change, &[&str])]) {
    for (number, (change, values)) in changes.iter().enumerate() {
        let error = checked(*change).expect_err(debug);
        assert!(format!("{error:?}").starts_with(debug), "{error:?} instead of {debug}, change {number}");
        let text = error.to_string();
        assert!(!text.contains('\n') && values.iter().all(|value| text.contains(value)), "{values:?} in {text}");
    }
}

/// Limits that would protect nothing are no limits.
#[test]
fn limits_without_an_end_are_refused() {
    let changes: [(Change, &[&str]); 16] = [
        (|l| l.heartbeat_s = 10.5, &["heartbeat_s", "10.5", "at most 10"]),
        (|l| l.max_disturbance_share = 1.1, &["max_disturbance_share", "1.1", "0.4"]),
        (|l| l.monitor.band_share = 0.6, &["monitor.band_share", "0.6", "0.5"]),
        (|l| l.monitor.settle_s = 1.5, &["monitor.settle_s", "1.5", "1"]),
        (|l| l.monitor.band_v = 4000.0, &["monitor.band_v", "4000", "650"]),
        (|l| l.max_voltage_v = 1e6, &["max_voltage_v", "1000000", "50000"]),
        (|l| l.max_slew_v_per_s = 1e38, &["max_slew_v_per_s", "6500000"]),
        (|l| l.max_displacement_m = 1e30, &["max_displacement_m", "0.009"]),
        (|l| l.max_displacement_m = 9.1e-3, &["max_displacement_m", "0.0091", "0.009"]),
        (|l| l.max_field_v_per_m = 1e30, &["max_field_v_per_m", "500000000"]),
        (|l| l.thickness_m = 0.1, &["thickness_m", "0.1", "0.01"]),
        (|l| l.discharge_s = 61.0, &["discharge_s", "61", "60"]),
        (|l| l.sensor.jump = 5e-3, &["sensor.jump", "0.005", "0.0024"]),
        (|l| l.sensor.jump = 2.6e-3, &["sensor.jump", "0.0026", "0.0024"]),
        (|l| l.sensor.stuck_band = 0.1e-3, &["sensor.stuck_band", "0.0001", "0.00008"]),
        (|l| l.sensor.stuck_ticks = 10_001, &["sensor.stuck_ticks", "10001", "10000"]),
    ];
    refused("TooLarge", &changes);
    // A monitor that may be as slow as this would be dead for 19 s before it shows.
    refused("TooSmall", &[(|l| l.monitor.slew_v_per_s = 12.5, &["monitor.slew_v_per_s", "12.5", "6500"])]);
}

#[test]
fn limits_that_cannot_be_kept_are_refused() {
    for bad in [0.0, -1.5, f32::NAN, f32::INFINITY] {
        type Field = fn(&mut Limits) -> &mut f32;
        let fields: [(&str, Field); 8] = [
            ("max_voltage_v", |l| &mut l.max_voltage_v),
            ("max_field_v_per_m", |l| &mut l.max_field_v_per_m),
            ("thickness_m", |l| &mut l.thickness_m),
            ("max_slew_v_per_s", |l| &mut l.max_slew_v_per_s),
            ("max_displacement_m", |l| &mut l.max_displacement_m),
            ("max_disturbance_share", |l| &mut l.max_disturbance_share),
            ("heartbeat_s", |l| &mut l.heartbeat_s),
            ("discharge_s", |l| &mut l.discharge_s),
        ];
        for (name, field) in fields {
            let text = checked(|limits| *field(limits) = bad).expect_err(name).to_string();
            assert_eq!(text, format!("{name} is {bad}; it must be finite and greater than 0"));
        }
        let error = Supervisor::new(&bench_limits(), bad).expect_err("refused");
        assert!(matches!(error, LimitsError::NotPositive { quantity: "rate_hz", .. }), "{error}");
    }
    let monitor = |l: &mut Limits| {
        l.monitor = MonitorLimits { slew_v_per_s: 7e4, band_v: 61.0, band_share: -0.25, settle_s: 0.125 };
    };
    let changes: [(Change, &[&str]); 11] = [
        (monitor, &["70000", "61", "-0.25", "0.125"]),
        (|l| l.monitor.slew_v_per_s = 0.0, &[]),
        (|l| l.monitor.slew_v_per_s = -1.0, &[]),
        (|l| l.monitor.slew_v_per_s = f32::NAN, &[]),
        (|l| l.monitor.slew_v_per_s = f32::INFINITY, &[]),
        (|l| l.monitor.band_v = 0.0, &[]),
        (|l| l.monitor.band_v = f32::NAN, &[]),
        (|l| l.monitor.band_share = -0.01, &[]),
        (|l| l.monitor.band_share = f32::NAN, &[]),
        (|l| l.monitor.settle_s = -0.01, &[]),
        (|l| l.monitor.settle_s = f32::INFINITY, &[]),
    ];
    refused("Monitor", &changes);
    let sensor = |l: &mut Limits| {
        l.sensor = PlausibilityLimits { low: 0.25, high: 0.125, jump: 0.5, stuck_ticks: 77, stuck_band: 0.0625 };
    };
    let changes: [(Change, &[&str]); 13] = [
        (sensor, &["0.25", "0.125", "0.5", "77", "0.0625", "at least 5"]),
        (|l| l.sensor.low = l.sensor.high, &[]),
        (|l| l.sensor.low = f32::NEG_INFINITY, &[]),
        (|l| l.sensor.low = f32::NAN, &[]),
        (|l| l.sensor.high = f32::INFINITY, &[]),
        (|l| l.sensor.high = f32::NAN, &[]),
        (|l| l.sensor.jump = 0.0, &[]),
        (|l| l.sensor.jump = f32::NAN, &[]),
        (|l| l.sensor.jump = f32::INFINITY, &[]),
        (|l| l.sensor.stuck_ticks = 0, &[]),
        (|l| l.sensor.stuck_ticks = 4, &[]),
        (|l| l.sensor.stuck_band = 0.0, &[]),
        (|l| l.sensor.stuck_band = f32::NAN, &[]),
    ];
    refused("Sensor", &changes);
    let lag = AmplifierLag { rise_s: 6.75, fall_s: 0.25 };
    let supervisor = Supervisor::new(&bench_limits(), RATE_HZ).expect("valid");
    let text = supervisor.behind(lag, RATE_HZ).expect_err("refused").to_string();
    assert!(["6.75", "0.25", "0 to 6.66"].iter().all(|value| text.contains(value)), "{text}");
}

/// Each bound of the limits belongs to what is allowed.
#[test]
fn limits_at_their_bounds_are_kept() {
    let changes: [Change; 7] = [
        |l| l.sensor.stuck_ticks = 5,
        |l| l.monitor.slew_v_per_s = 6500.0,
        // A quarter of the range of 9.9 mm.
        |l| l.sensor.jump = 2.4e-3,
        // Ten seconds.
        |l| l.sensor.stuck_ticks = 10_000,
        |l| l.sensor.stuck_ticks = 5000,
        |l| l.monitor.settle_s = 0.0,
        |l| l.monitor.band_share = 0.0,
    ];
    changes.iter().for_each(|&change| assert_eq!(checked(change), Ok(())));
}

/// Values that a file need not state: a tenth of the force, a second, and 2 µm. With them it is the bench of the film in docs/formats.md.
#[test]
fn limits_that_are_not_stated_have_values() {
    let stated = serde_json::json!({
        "max_voltage_v": 6000.0, "max_field_v_per_m": 4.2e7, "thickness_m": 160e-6, "max_slew_v_per_s": 50e3,
        "max_displacement_m": 8e-3, "on_sensor_fault": "trip", "heartbeat_s": 0.5,
        "monitor": { "slew_v_per_s": 1e5, "band_v": 60.0, "band_share": 0.03, "settle_s": 0.02 },
        "sensor": { "low": -0.5e-3, "high": 9e-3, "jump": 0.5e-3, "stuck_ticks": 500 },
    });
    let limits: Limits = serde_json::from_value(stated).expect("complete");
    assert_eq!((limits.max_disturbance_share, limits.discharge_s, limits.sensor.stuck_band), (0.1, 1.0, 2e-6));
    assert_eq!(limits, Limits::bench(160e-6));
}

/// The model alone trips where the full law under the same voltage is between 1.5 % before the end of the stroke and its end, whatever
/// the published film, alone, behind a curve, with two and with a spring in series: what `Law::coarser` promises.
#[test]
fn the_model_alone_keeps_the_stroke() {
    let curve = Curve::through(&[(-1e-3, -0.8e-3), (0.0, 0.0), (1e-3, 1.1e-3), (2e-3, 2.6e-3)]).expect("rises");
    let spring = Spring::of_curve(&curve, 2e4).expect("valid");
    for preset in Preset::ALL {
        for (kind, (curve, spring)) in
            [(None, None), (Some(&curve), None), (Some(&curve), Some(&spring)), (None, Some(&spring))]
                .iter()
                .enumerate()
        {
            let furthest_m = stroke_at_the_trip(&preset.model().expect("valid"), *curve, *spring);
            println!("{} {kind}: trips at {:.4} mm of 1", preset.name(), 1e3 * furthest_m);
            assert!((0.985e-3..=1e-3).contains(&furthest_m), "{}: {furthest_m}", preset.name());
        }
    }
}

/// Where the full law is when the model's displacement trips a stroke of 1 mm, under a voltage that rises until then. The sensor is stuck
/// in its noise at rest.
fn stroke_at_the_trip(model: &Maxwell, curve: Option<&Curve>, spring: Option<&Spring>) -> f64 {
    fn shaped<T: Real>(model: &Maxwell, curve: Option<&Curve>, spring: Option<&Spring>) -> Law<T> {
        let law = Law::compressed(model, LawOptions::at_step(1e-3)).expect("valid");
        match (curve, spring) {
            (Some(curve), Some(spring)) => law.beside(spring, curve).expect("valid"),
            (Some(curve), None) => law.behind(curve).expect("rises"),
            (None, Some(spring)) => law.in_series(spring).expect("rises"),
            (None, None) => law,
        }
    }
    let law: Law<f64> = shaped(model, curve, spring);
    let parameters = changed_parameters(|p| {
        (p.law, p.limits.max_displacement_m) = (shaped(model, curve, spring).coefficients(), 1e-3);
    });
    let mut bench = FilmBench::around(law, parameters);
    bench.start(Mode::Voltage);
    for tick in 0..60_000_u32 {
        bench.set_voltage((tick as f32 / 10.0).min(6000.0));
        bench.tick(|inputs| inputs.sensor_adc_v = Some(1.0 + 2e-3 * (tick % 3) as f32));
        match bench.state() {
            DriverState::Running => {}
            DriverState::Tripped(Cause::ModelDisplacement) => return bench.furthest_m,
            state => panic!("tick {tick}: {state:?}"),
        }
    }
    panic!("it did not trip; the film is at {} m", bench.displacement_m)
}

/// A film that a device drives by voltages, whose parameters and memory may change.
struct Loaded {
    bench: FilmBench,
    device: Device,
}

/// Its sensor.
#[derive(Clone, Copy, Debug)]
enum Sensor {
    Healthy,
    Lost,
    /// In the noise of its converter, at rest.
    Frozen,
}

impl Loaded {
    fn new() -> Self {
        let bench = FilmBench::changed(|p| {
            rides_through(p);
            p.limits.max_displacement_m = 1e-3;
        });
        let mut loaded = Self { bench, device: Device::new(None) };
        loaded.upload();
        loaded
    }

    fn upload(&mut self) {
        let controller = Controller::new(Blob::new(self.bench.parameters.clone()).expect("valid"));
        self.device.install(controller).expect("off");
    }

    /// In a run of `volts`, or disarmed at 0 V.
    fn run(&mut self, ticks: u32, volts: f32, sensor: Sensor) -> DriverState {
        for tick in 0..ticks {
            let mut inputs = self.bench.inputs();
            inputs.sensor_adc_v = match sensor {
                Sensor::Healthy => inputs.sensor_adc_v,
                Sensor::Lost => None,
                Sensor::Frozen => Some(1.0 + 2e-4 * (tick % 3) as f32),
            };
            if tick == 1 && volts > 0.0 {
                self.device.arm().expect("healthy");
                self.device.start(Mode::Voltage).expect("armed");
            }
            if tick > 1 && volts > 0.0 && self.device.state() == DriverState::Running {
                self.device.set_voltage(volts).expect("within the limits");
                self.device.heartbeat();
            }
            let drive = self.device.tick(inputs);
            self.bench.stretch(if drive.enable { f64::from(drive.dac_v) * 1000.0 } else { 0.0 });
        }
        self.device.state()
    }
}

/// A film that was loaded for a minute creeps back for hours, and the model of a controller that starts within that began at rest: the
/// film went to 1.08 to 1.41 times its stroke. Either the sensor shows it at 0 V and is lost in the run, or the controller before did, or
/// nothing is known: then the film is taken for one that was at the end of its stroke for an hour, and less of it is left to be used. A trip that
/// is acknowledged afterwards forgets nothing of it: the film went to 1.05 to 1.27 times its stroke.
#[test]
fn creep_from_before_a_reset_or_an_upload_counts_for_the_stroke() {
    for (is_reset, sensor, is_acknowledged, loaded_ticks, loaded_v) in [
        (true, Sensor::Healthy, false, 60_000, 2200.0),
        (true, Sensor::Healthy, true, 60_000, 2200.0),
        (false, Sensor::Lost, false, 60_000, 2200.0),
        (false, Sensor::Lost, true, 60_000, 2200.0),
        (true, Sensor::Lost, false, 60_000, 2200.0),
        (true, Sensor::Lost, true, 60_000, 2200.0),
        (true, Sensor::Lost, false, 300_000, 2050.0),
    ] {
        let mut film = Loaded::new();
        // The first run begins with a film that the sensor has shown.
        film.run(500, 0.0, Sensor::Healthy);
        film.run(loaded_ticks, loaded_v, sensor);
        film.device.disarm().expect("it runs");
        film.run(1000, 0.0, sensor);
        if is_reset {
            film.device = Device::new(None);
        }
        film.upload();
        film.run(2000, 0.0, sensor);
        if is_acknowledged {
            // In a run of a tenth of a volt.
            film.run(50, 0.1, sensor);
            film.device.trip(Cause::Overrun);
            film.device.acknowledge().expect("tripped");
        }
        let state = film.run(100_000, 2400.0, Sensor::Lost);
        let furthest_m = film.bench.furthest_m;
        println!(
            "reset: {is_reset}, {sensor:?}, acknowledged: {is_acknowledged}, after {loaded_ticks} ticks: {state:?}, {furthest_m} m"
        );
        assert_eq!(state, DriverState::Tripped(Cause::ModelDisplacement));
        assert!(furthest_m <= 1e-3 && furthest_m > 0.7e-3, "{furthest_m} m");
    }
}

/// The next controller knows where the last one's film may be: by the model of another law, or how much softer than that of the same law its sensor has
/// shown it. No sensor is left then.
#[test]
fn an_upload_keeps_what_is_known_of_a_film() {
    for (is_another_law, force_scale, loaded_v) in [(true, 1.0, 2200.0), (false, 1.25, 1900.0)] {
        let mut film = Loaded::new();
        film.bench.force_scale = force_scale;
        film.run(500, 0.0, Sensor::Healthy);
        film.run(60_000, loaded_v, Sensor::Healthy);
        film.device.disarm().expect("it runs");
        film.run(1000, 0.0, Sensor::Lost);
        film.bench.parameters.law.instant *= if is_another_law { 1.001 } else { 1.0 };
        film.upload();
        film.run(2000, 0.0, Sensor::Lost);
        let state = film.run(100_000, 2400.0, Sensor::Lost);
        let furthest_m = film.bench.furthest_m;
        println!("another law: {is_another_law}, {force_scale}: {state:?}, {furthest_m} m");
        assert_eq!(state, DriverState::Tripped(Cause::ModelDisplacement));
        assert!((0.8e-3..=1.01e-3).contains(&furthest_m), "another law: {is_another_law}: {furthest_m} m");
    }
}

/// An upload of the same law keeps the model: a sensor that is frozen at rest showed a film without creep, and it went to 1.05 times its stroke.
#[test]
fn a_frozen_sensor_hides_no_creep_from_an_upload_of_the_same_law() {
    let mut film = Loaded::new();
    film.run(500, 0.0, Sensor::Healthy);
    film.run(60_000, 2200.0, Sensor::Frozen);
    film.device.disarm().expect("it runs");
    film.run(1000, 0.0, Sensor::Frozen);
    film.bench.parameters.limits.max_voltage_v = 6000.0;
    film.upload();
    film.run(2000, 0.0, Sensor::Frozen);
    let state = film.run(100_000, 2400.0, Sensor::Frozen);
    let furthest_m = film.bench.furthest_m;
    println!("{state:?}, {furthest_m} m");
    assert_eq!(state, DriverState::Tripped(Cause::ModelDisplacement));
    assert!(furthest_m <= 1e-3, "{furthest_m} m");
}
