//! A month without a reset: the film that the controller steps in single precision against the same in double, and counters that wrap.
//!
//! Film: 30 days at 1 kHz under a voltage that repeats daily, 144 levels of sines and holds with steps between. Pass: the mean of every
//! day is within 1e-4 of that in double precision, relative to it. Both step the compressed memory, so that this is rounding alone; the
//! compression is compared with full memory elsewhere. 3 days of 60 s each in the sample, 30 days (2.6e9 ticks, each precision in its
//! own thread) in full.
//!
//! Counters: the longest interval of a stream, and a set-point after more ticks than a ramp counts. The supervisor's ticks wrap in
//! `commands`. By inspection: every other counter saturates and
//! is compared with a limit that is reached long before (`excess`, `same`, `away_ticks`, `live_ticks`, `ticks_since_heartbeat`, `since`
//! of samples, `dropped`, damaged and unknown frames), or starts again below its limit (`since` of the stream).

use std::thread;

use dea_driver::{Blob, Controller, Device, DriverState, Inputs, Mode, Telemetry};
use springpot::{Actuator, Law, LawState, Real, VoltageDrive};

use crate::bench::{board_parameters, law};
use crate::scale::cases;

/// Levels of a day, and ticks of a sine.
const LEVELS: u64 = 144;
const PERIOD: u64 = 7000;

/// The voltage of every tick of a day, V; exact in single precision.
struct Day {
    ticks: u64,
    levels_v: Vec<f32>,
    sine: Vec<f32>,
}

impl Day {
    fn new(ticks: u64) -> Self {
        // Multiples of 100 V in an order without a pattern: 37 and 41 have no divisor in common.
        let levels_v = (0..LEVELS).map(|level| 800.0 + 100.0 * (level * 37 % 41) as f32).collect();
        let angle = |tick: u64| std::f64::consts::TAU * tick as f64 / PERIOD as f64;
        let sine = (0..PERIOD).map(|tick| 0.7 + 0.3 * angle(tick).sin() as f32).collect();
        Self { ticks, levels_v, sine }
    }

    fn volts(&self, level: usize, tick: usize) -> f32 {
        // Every third level is held.
        if level.is_multiple_of(3) { self.levels_v[level] } else { self.levels_v[level] * self.sine[tick] }
    }

    /// Mean and largest displacement of each of `days`, m, by the step of a film.
    fn follow(&self, days: u64, mut step: impl FnMut(f32) -> f64) -> Vec<[f64; 2]> {
        let per_level = self.ticks / LEVELS;
        let mut in_period = 0;
        let mut day = || {
            let (mut sum, mut largest) = (0.0, 0.0f64);
            for level in 0..LEVELS as usize {
                for _ in 0..per_level {
                    in_period = if in_period + 1 == PERIOD as usize { 0 } else { in_period + 1 };
                    let displacement_m = step(self.volts(level, in_period));
                    sum += displacement_m;
                    largest = largest.max(displacement_m);
                }
            }
            [sum / (per_level * LEVELS) as f64, largest]
        };
        (0..days).map(|_| day()).collect()
    }
}

fn law_and_drive<T: Real>() -> (Law<T>, VoltageDrive<T>, LawState<T>) {
    let law: Law<T> = law();
    let drive = VoltageDrive::new(&Actuator::KARNER_2022, 6500.0, law.stiffness()).expect("valid");
    let rest = law.state();
    (law, drive, rest)
}

#[test]
fn single_precision_keeps_the_daily_mean() {
    let (days, ticks) = (cases(3, 30), cases(60_000, 86_400_000));
    let single = thread::spawn(move || {
        let (law, drive, mut film) = law_and_drive::<f32>();
        Day::new(ticks).follow(days, |volts| law.displacement_under(&mut film, drive.load(volts)).into())
    });
    let (law, drive, mut film) = law_and_drive::<f64>();
    let double = Day::new(ticks).follow(days, |volts| law.displacement_under(&mut film, drive.load(volts.into())));
    let single = single.join().expect("no panic");
    let errors: Vec<f64> =
        single.iter().zip(&double).map(|([mean, _], [exact, _])| (mean / exact - 1.0).abs()).collect();
    let worst = errors.iter().fold(0.0, |worst: f64, &error| worst.max(error));
    println!("month: {days} days of {ticks} ticks, relative errors of the daily means {errors:?}");
    assert!(double.iter().all(|[mean, largest]| *mean > 0.1e-3 && largest > mean));
    assert!(worst <= 1e-4, "{errors:?}");
}

/// Every record of the longest interval, and a set-point that comes after more ticks than are counted.
#[test]
fn counters_of_16_bits_do_not_overflow() {
    let mut device = Device::new(None);
    device.install(Controller::new(Blob::new(board_parameters()).expect("valid"))).expect("disabled");
    device.stream(u16::MAX);
    let mut drive_v = 0.0;
    let mut tick = |device: &mut Device, number: u32| {
        let sensor_adc_v = Some(1.0 + 1e-3 * (number % 3) as f32);
        device.heartbeat();
        drive_v = device.tick(Inputs { interlock_closed: true, monitor_adc_v: Some(drive_v), sensor_adc_v }).dac_v;
        drive_v
    };
    tick(&mut device, 1);
    device.arm().expect("healthy");
    device.start(Mode::Voltage).expect("armed");
    device.set_voltage(100.0).expect("within the limits");
    let longest = u32::from(u16::MAX);
    for number in 2..=3 * longest {
        tick(&mut device, number);
    }
    let records: Vec<Telemetry> = std::iter::from_fn(|| device.telemetry()).collect();
    let ticks: Vec<u32> = records.iter().map(|record| record.tick).collect();
    assert_eq!(ticks, [longest, 2 * longest, 3 * longest]);
    assert!(records.iter().all(|record| record.dropped == 0));
    // 50 ms from 100 V to 600 V, however long it was.
    device.set_voltage(600.0).expect("within the limits");
    let volts: Vec<f32> = (1..=60).map(|number| 1000.0 * tick(&mut device, number)).collect();
    for (number, volts) in (1u8..).zip(&volts) {
        let line_v = 100.0 + 10.0 * f32::from(number.min(50));
        assert!((volts - line_v).abs() < 0.01, "{volts} V in tick {number}");
    }
    assert_eq!(device.state(), DriverState::Running);
}
