//! The laws of control: a tick of each, without converters and supervisor.

use core::hint::black_box;

use springpot::{
    Adapting, Applied, CommandLimits, Feedforward, Law, Learning, LearningOptions, LearningState, Limited, Maxwell,
    Observer, ObserverOptions, SensorSample, Tracking,
};

use crate::{Checksum, Name, Report, STEPS, repeat};

/// Reports bits and cost of a tick of each law of control along `model`. Each has a stack of its own.
#[inline(never)]
pub fn run(report: &mut impl Report, name: impl Fn(&'static str) -> Name, model: &Maxwell) {
    let law = |model| name("law").film.law(model);
    feedforward(report, name("feedforward"), law(model));
    observer(report, name("observer"), law(model));
    tracking(report, name("tracking"), law(model));
    adaptive(report, name("adaptive"), law(model));
    // What it learns does not depend on the curve.
    if !name("learning").film.curved {
        learning(report, name("learning"), &law(model));
    }
}

/// A reference of up to 1 mm, and a sensor beside it.
fn reference(k: f32) -> f32 {
    1e-9 * k * k
}

fn sample(k: f32) -> Option<SensorSample<f32>> {
    Some(SensorSample { displacement_m: 0.98 * reference(k), age_ticks: 10 })
}

/// Ticks on the way: bits of what `tick` gives, then what it costs, a sample coming in every tick.
fn ticks(report: &mut impl Report, name: Name, mut tick: impl FnMut(f32) -> f32) {
    let mut checksum = Checksum::default();
    for k in 0..STEPS {
        checksum.add(tick(f32::from(k)));
    }
    report.bits(name, checksum);
    report.cost_of_step(name, STEPS, || repeat(&mut tick), || repeat(|k| k));
}

#[inline(never)]
fn feedforward(report: &mut impl Report, name: Name, law: Law<f32>) {
    let rest = law.state();
    let Ok(config) = Feedforward::new(law, &name.film.actuator(), CommandLimits::BENCH) else { panic!("refused") };
    let mut state = config.state(rest);
    let mut voltage = 0.0;
    ticks(report, name, |k| {
        config.apply(&mut state, Applied::as_commanded(voltage));
        voltage = config.command(&mut state, reference(k)).voltage_v;
        voltage
    });
}

#[inline(never)]
fn observer(report: &mut impl Report, name: Name, law: Law<f32>) {
    let rest = law.state();
    let options = ObserverOptions::at_bandwidth(0.6);
    let Ok(config) = Observer::new(law, &name.film.actuator(), 6000.0, options) else { panic!("refused") };
    let mut state = config.state(rest);
    ticks(report, name, |k| config.observe(&mut state, Applied::as_commanded(5.0 * k), sample(k)));
}

#[inline(never)]
fn tracking(report: &mut impl Report, name: Name, law: Law<f32>) {
    let rest = law.state();
    let options = ObserverOptions::at_bandwidth(0.6);
    let Ok(config) = Tracking::new(law, &name.film.actuator(), CommandLimits::BENCH, options) else {
        panic!("refused")
    };
    let mut state = config.state(rest);
    let mut voltage = 0.0;
    ticks(report, name, |k| {
        config.observe(&mut state, Applied::as_commanded(voltage), black_box(sample(k)));
        voltage = config.command(&mut state, reference(k)).voltage_v;
        voltage
    });
}

/// Tracking of a film that changes, over dozens of its rounds.
#[inline(never)]
fn adaptive(report: &mut impl Report, name: Name, law: Law<f32>) {
    let rest = law.state();
    let options = ObserverOptions::at_bandwidth(0.6);
    let Ok(config) = Tracking::new(law, &name.film.actuator(), CommandLimits::BENCH, options) else {
        panic!("refused")
    };
    let mut state = config.state(rest);
    state.set_adapting(Adapting::Learn);
    let mut voltage = 0.0;
    ticks(report, name, |k| {
        config.observe(&mut state, Applied::as_commanded(voltage), black_box(sample(k)));
        voltage = config.command(&mut state, reference(k)).voltage_v;
        voltage
    });
}

/// In front of a law of control: a reference of 50 ms, whose blocks end within the steps, and a sample in every tenth tick.
#[inline(never)]
fn learning(report: &mut impl Report, name: Name, law: &Law<f32>) {
    let options = LearningOptions { period_s: Some(0.05), sample_interval_s: 1e-3, ..LearningOptions::BENCH };
    let Ok(config) = Learning::<f32, 24>::with_past(law, &name.film.actuator(), 6000.0, options) else {
        panic!("refused")
    };
    let mut state = config.state(0.0);
    let tick =
        |config: &Learning<f32, 24>, state: &mut LearningState<f32, 24>, k, sample: Option<SensorSample<f32>>| {
            if let Some(sample) = sample {
                state.observe(sample);
            }
            config.advance(state, reference(k), Limited::NONE)
        };
    // Until blocks have ended.
    for k in 0..3 * STEPS {
        tick(&config, &mut state, f32::from(k), sample(f32::from(k)));
    }
    let mut since = 0;
    ticks(report, name, |k| {
        since = if since == 9 { 0 } else { since + 1 };
        tick(&config, &mut state, k, black_box(sample(k).filter(|_| since == 0)))
    });
}
