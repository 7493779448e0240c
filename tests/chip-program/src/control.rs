//! The laws of control: a tick of each, without converters and supervisor.

use core::hint::black_box;

use springpot::{
    Adapting, Applied, CommandLimits, Feedforward, FilmReading, Law, Learning, LearningOptions, LearningState, Limited,
    Maxwell, Observer, ObserverOptions, SelfSensing, SelfSensingOptions, SensorSample, Tracking,
};

use crate::{Checksum, FILMS, Name, Report, STEPS, repeat};

/// Reports bits and cost of a tick of each law of control along `model`. Each has a stack of its own.
#[inline(never)]
pub fn run(report: &mut impl Report, name: impl Fn(&'static str) -> Name, model: &Maxwell) {
    let law = |model| name("law").film.law(model);
    feedforward(report, name("feedforward"), law(model));
    observer(report, name("observer"), law(model));
    tracking(report, name("tracking"), law(model));
    adaptive(report, name("adaptive"), law(model));
    // What it learns does not depend on the curves.
    if !name("learning").film.is_curved() {
        learning(report, name("learning"), &law(model));
    }
    // Nor does self-sensing depend on the model.
    if name("law").film == FILMS[1] {
        self_sensing(report, &name);
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

/// A tone of 50 V at a film that moves, whose relation creeps: in the mean of the ticks of its blocks, and in the longest of them.
#[inline(never)]
fn self_sensing(report: &mut impl Report, name: impl Fn(&'static str) -> Name) {
    let Ok(config) = SelfSensing::<f32>::new(&crate::relation(), SelfSensingOptions::BENCH) else { panic!("refused") };
    let mut state = config.state();
    let mut before = 0.0;
    let mut tick = |k: f32| {
        let voltage_v = config.drive(&state, 5.0 * k);
        let current_a = (700e-9 + 1e-10 * k) * (voltage_v - before);
        before = voltage_v;
        let sensed = config.sense(&mut state, black_box(FilmReading { voltage_v, current_a }));
        sensed.map_or(state.drive_v(), |sensed| sensed.sample.displacement_m + sensed.variance_m2)
    };
    ticks(report, name("self-sensing"), &mut tick);
    // Whole blocks have ended: the next tick has a displacement.
    report.cost(name("self-sensing-longest"), || tick(black_box(3.0)));
}
