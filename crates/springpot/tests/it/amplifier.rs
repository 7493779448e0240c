//! Amplifiers that lag, against closed forms: e^(−t/τ) up and down, and what a command must be to follow a course.

use springpot::{
    Actuator, AmplifierLag, AmplifierModel, Applied, CommandLimits, ControlError, Feedforward, Law, LawOptions,
    Limited, Preset,
};

const STEP_S: f64 = 1e-3;

fn model(rise_s: f64, fall_s: f64) -> AmplifierModel<f64> {
    AmplifierModel::new(AmplifierLag { rise_s, fall_s }, STEP_S).expect("valid")
}

/// The voltage after `seconds` of `command`, from `voltage`.
fn after(model: &AmplifierModel<f64>, voltage: f64, command: f64, seconds: f64) -> f64 {
    (0..(seconds / STEP_S).round() as u32).fold(voltage, |voltage, _| model.advance(voltage, command))
}

#[test]
fn rises_and_falls_as_exponentials() {
    for (rise_s, fall_s) in [(0.1_f64, 0.1_f64), (0.05, 0.5), (0.2, 0.05)] {
        let model = model(rise_s, fall_s);
        let risen = after(&model, 0.0, 3000.0, 0.15);
        assert!((risen - 3000.0 * (1.0 - (-0.15 / rise_s).exp())).abs() < 1e-9, "{rise_s}: {risen}");
        // To 0 V: the bleeder's time constant, or the lag's where it is slower.
        let fallen = after(&model, 3000.0, 0.0, 0.15);
        let slower = if fall_s > rise_s { fall_s } else { rise_s.min(fall_s) };
        assert!((fallen - 3000.0 * (-0.15 / slower).exp()).abs() < 1e-9, "{fall_s}: {fallen}");
    }
    // A small step down is followed with the lag, a large one at the bleeder's speed until the lag is slower.
    let small = after(&model(0.05, 0.5), 3000.0, 2900.0, 0.1);
    assert!((small - 2900.0 - 100.0 * (-2.0_f64).exp()).abs() < 1e-9, "{small}");
    let large = after(&model(0.05, 0.5), 3000.0, 1000.0, 0.1);
    assert!((large - 3000.0 * (-0.2_f64).exp()).abs() < 1e-9, "{large}");
    // None: at once.
    assert_eq!(model(0.0, 0.0).advance(3000.0, 17.0), 17.0);
    assert_eq!(model(0.0, 0.5).advance(17.0, 3000.0), 3000.0);
    assert!((model(0.0, 0.5).advance(3000.0, 0.0) - 3000.0 * (-0.002_f64).exp()).abs() < 1e-9);
}

fn feedforward(amplifier: AmplifierLag) -> Feedforward<f64> {
    let model = Preset::TABLE3_N2.model().expect("valid");
    let law: Law<f64> = Law::compressed(&model, LawOptions::at_step(STEP_S)).expect("a law");
    Feedforward::new(law, &Actuator::KARNER_2022, CommandLimits { amplifier, ..CommandLimits::BENCH }).expect("valid")
}

/// Voltages of the film at the end of this tick and of the one before it, V, to what the monitor reads.
type Reading<'a> = &'a dyn Fn(u32, [f64; 2]) -> Option<f64>;

/// Follows `reference` (m, by the time) for `ticks` behind `amplifier`, where `known` is stated: the largest error of the film whose voltage
/// lags as an exponential in parts of a tick, in m, and the limits that were met, after `settled_s`.
fn run(
    [amplifier, known]: [AmplifierLag; 2],
    ticks: u32,
    settled_s: f64,
    reference: impl Fn(f64) -> f64,
    read: Reading,
) -> (f64, Limited) {
    let (feedforward, ideal) = (feedforward(known), feedforward(AmplifierLag::NONE));
    let rest = ideal.law().state();
    let (mut state, mut film) = (feedforward.state(rest.clone()), rest);
    let (mut commanded_v, mut voltages, mut largest, mut met) = (0.0, [0.0_f64; 2], 0.0_f64, Limited::NONE);
    for k in 0..ticks {
        let now = f64::from(k) * STEP_S;
        feedforward.apply(&mut state, Applied { commanded_v, reading_v: read(k, voltages) });
        let next = feedforward.command(&mut state, reference(now));
        commanded_v = next.voltage_v;
        // An Euler integration of its own.
        let mut voltage = voltages[0];
        for _ in 0..200 {
            let slowest = if amplifier.fall_s == 0.0 { f64::NEG_INFINITY } else { -voltage / amplifier.fall_s };
            voltage += 5e-6 * ((commanded_v - voltage) / amplifier.rise_s).max(slowest);
        }
        voltages = [voltage, voltages[0]];
        let displacement = ideal.law().displacement_under(&mut film, ideal.drive().load(voltage));
        if now > settled_s {
            largest = largest.max((displacement - reference(now)).abs());
            met |= next.limited;
        }
    }
    (largest, met)
}

/// Up 0.8 mm and down by 0.3 mm in `seconds` each, by minimum jerk.
fn follows(amplifier: AmplifierLag, known: AmplifierLag, seconds: f64) -> (f64, Limited) {
    let rise = |s: f64| s * s * s * (10.0 - s * (15.0 - 6.0 * s));
    let reference = |now: f64| {
        let s = now / seconds;
        0.8e-3 * if s < 1.0 { rise(s) } else { 1.0 - 0.4 * rise((s - 1.0).min(1.0)) }
    };
    // At 0 V the voltage begins as a root, faster than any amplifier.
    run([amplifier, known], (2.5 * seconds / STEP_S) as u32, 0.3 * seconds, reference, &|_, _| None)
}

/// A lag of 0.1 s is followed as if it did not, where that is known; by 1 % of the stroke and more, where it is not.
#[test]
fn the_command_leads() {
    let slow = AmplifierLag { rise_s: 0.1, fall_s: 0.5 };
    let (known, met) = follows(slow, slow, 3.0);
    let (unknown, _) = follows(slow, AmplifierLag::NONE, 3.0);
    println!("known {:.3} µm, unknown {:.1} µm", 1e6 * known, 1e6 * unknown);
    assert!(known < 0.3e-6 && met.is_none(), "{known}, {met:?}");
    assert!(unknown > 20e-6);
}

/// Faster down than the bleeder lets the voltage fall: the flag says so.
#[test]
fn a_fall_that_is_too_fast_is_flagged() {
    let slow = AmplifierLag { rise_s: 0.05, fall_s: 3.0 };
    let (error, met) = follows(slow, slow, 1.0);
    assert!(met.contains(Limited::AMPLIFIER) && error > 20e-6, "{error}, {met:?}");
}

#[test]
fn invalid_amplifier_times_are_refused() {
    for wrong in [-1e-3, 10.1, f64::NAN, f64::INFINITY] {
        let error =
            AmplifierModel::<f32>::new(AmplifierLag { rise_s: wrong, fall_s: 0.0 }, STEP_S).expect_err("refused");
        assert!(matches!(error, ControlError::OutOfRange { quantity: "amplifier.rise_s", .. }), "{error}");
        let error =
            AmplifierModel::<f32>::new(AmplifierLag { rise_s: 0.0, fall_s: wrong }, STEP_S).expect_err("refused");
        assert!(matches!(error, ControlError::OutOfRange { quantity: "amplifier.fall_s", .. }), "{error}");
    }
    let slowest = AmplifierLag { rise_s: 10.0, fall_s: 10.0 };
    assert_eq!(AmplifierModel::<f32>::new(slowest, STEP_S).map(drop), Ok(()));
}

/// The largest error of the last of six cycles of a sine of 3 s, m.
fn cycles(amplifier: AmplifierLag, known: AmplifierLag, read: Reading) -> f64 {
    let reference = |now: f64| {
        0.7e-3 * (now / 1.5).min(1.0) - 0.15e-3 * (core::f64::consts::TAU * (now - 1.5).max(0.0) / 3.0).sin()
    };
    run([amplifier, known], 18_000, 15.0, reference, read).0
}

/// An amplifier that is up to 1.4 times slower or faster than it says: the readings of a monitor that is exact, late by a tick with 10 V
/// of noise, negative, or lost at times leave a third of the error and less: what the first cycles did to the film stays a while.
#[test]
fn the_amplifiers_time_follows_from_the_monitor() {
    let stated = AmplifierLag { rise_s: 0.1, fall_s: 0.5 };
    // A fixed pattern of 10 V, without mean or memory to speak of.
    let noise = |k: u32| 10.0 * (f64::from(k.wrapping_mul(2_654_435_761) >> 8) / f64::from(1 << 23) - 1.0);
    for by in [0.7, 0.8, 1.2, 1.4] {
        let real = AmplifierLag { rise_s: by * 0.1, fall_s: by * 0.5 };
        let blind = cycles(real, stated, &|_, _| None);
        let readings: [(&str, Reading); 4] = [
            ("exact", &|_, [now, _]| Some(now)),
            ("late, with noise", &|k, [_, before]| Some(before + noise(k))),
            ("negative", &|_, [now, _]| Some(-now)),
            ("lost at times", &|k, [now, _]| (k % 7 < 3).then_some(if k % 2 == 0 { now } else { f64::NAN })),
        ];
        for (name, reading) in readings {
            let informed = cycles(real, stated, reading);
            println!("{by} {name}: {:.2} µm, without {:.2} µm", 1e6 * informed, 1e6 * blind);
            assert!(informed < 0.35 * blind, "{by} {name}: {informed}, {blind}");
        }
    }
    // Of one that is as it says nothing changes for the worse.
    let exact = cycles(stated, stated, &|_, _| None);
    let informed = cycles(stated, stated, &|k, [_, before]| Some(before + noise(k)));
    println!("as stated: {:.2} and {:.2} µm", 1e6 * exact, 1e6 * informed);
    assert!(informed < exact + 0.3e-6, "{informed}, {exact}");
}

/// One that rises at once shows nothing of its speed while it rises, whatever the monitor reads: then its bleeder has the stated time.
#[test]
fn an_amplifier_that_rises_at_once_is_no_faster() {
    let feedforward = feedforward(AmplifierLag { rise_s: 0.0, fall_s: 0.05 });
    let mut state = feedforward.state(feedforward.law().state());
    for k in 1..1000 {
        let commanded_v = 2.0 * f64::from(k);
        feedforward.apply(&mut state, Applied::as_monitored(commanded_v, 0.9 * commanded_v));
    }
    let before_v = state.film_voltage();
    feedforward.apply(&mut state, Applied::as_commanded(0.0));
    let left = state.film_voltage() / before_v;
    assert!((left - (-STEP_S / 0.05).exp()).abs() < 1e-9, "{left}");
}
