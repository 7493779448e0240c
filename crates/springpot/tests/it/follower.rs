//! The composed control law as a program uses it, on films that are a known factor away from their law.

use std::f32::consts::TAU;

use springpot::{
    Actuator, Applied, CommandLimits, Feedforward, Follower, FollowerState, Law, LawOptions, LawState, Learning,
    LearningOptions, ObserverOptions, Preset, SensorSample, Tracking, VoltageDrive,
};

const ACTUATOR: Actuator = Actuator::KARNER_2022;
const LIMITS: CommandLimits = CommandLimits::BENCH;

fn law() -> Law<f32> {
    Law::compressed(&Preset::TABLE3_N2.model().expect("valid"), LawOptions::at_step(1e-3)).expect("valid")
}

/// No type is named: what is not given is inferred.
fn tracking() -> Follower<f32> {
    let law = law();
    let options = LearningOptions { period_s: Some(1.0), ..LearningOptions::BENCH };
    let learning = Learning::new(&law, &ACTUATOR, LIMITS.max_voltage_v, options).expect("valid");
    let tracking = Tracking::new(law, &ACTUATOR, LIMITS, ObserverOptions::at_bandwidth(0.5)).expect("valid");
    Follower::new(tracking).with_learning(learning)
}

/// A film that goes `gain` times as far as its law says.
struct Film {
    law: Law<f32>,
    drive: VoltageDrive<f32>,
    state: LawState<f32>,
    gain: f32,
    voltage_v: f32,
    tick: u32,
}

impl Film {
    fn new(gain: f32) -> Self {
        let law = law();
        let drive = VoltageDrive::new(&ACTUATOR, LIMITS.max_voltage_v, law.stiffness()).expect("valid");
        Self { state: law.state(), law, drive, gain, voltage_v: 0.0, tick: 0 }
    }

    /// A tick under the last voltage: what was applied, the displacement (m), and a sample every 10 ms.
    fn tick(&mut self) -> (Applied<f32>, f32, Option<SensorSample<f32>>) {
        let displacement_m = self.gain * self.law.displacement_under(&mut self.state, self.drive.load(self.voltage_v));
        let sample = self.tick.is_multiple_of(10).then_some(SensorSample { displacement_m, age_ticks: 0 });
        self.tick += 1;
        (Applied::as_commanded(self.voltage_v), displacement_m, sample)
    }
}

/// Holds 0.8 mm for `ticks`; the error at the end as a share of it.
fn held(follower: &Follower<f32>, state: &mut FollowerState<f32>, film: &mut Film, ticks: u32) -> f32 {
    let mut error = 0.0;
    for _ in 0..ticks {
        let (applied, displacement_m, sample) = film.tick();
        error = displacement_m / 0.8e-3 - 1.0;
        film.voltage_v = follower.step(state, applied, sample, 0.8e-3).voltage_v;
    }
    error
}

/// Feedforward is off by what the film is off; the sensor takes it away, and with feedback off it is there again.
#[test]
fn feedback_is_switched_between_ticks() {
    // Learning would take the mean of the error away.
    let follower = Follower::new(tracking().compensator().clone());
    let mut state = follower.state(law().state());
    let mut film = Film::new(1.1);
    state.set_feedback(false);
    let alone = held(&follower, &mut state, &mut film, 3000);
    assert!((alone - 0.1).abs() < 1e-3, "{alone}");
    state.set_feedback(true);
    let corrected = held(&follower, &mut state, &mut film, 10_000);
    assert!(corrected.abs() < 1e-3, "{corrected}");
    state.set_feedback(false);
    state.forget_correction();
    // Nothing of it returns while there is no sensor.
    let mut unseen = state.clone();
    for tick in 0..2000 {
        let forgotten = (unseen.observer().disturbance(), unseen.observer().force_scale());
        assert_eq!(forgotten, (0.0, 1.0), "tick {tick}");
        follower.observe(&mut unseen, Applied::as_commanded(film.voltage_v), None);
    }
    // The film of the model keeps where the sensor has taken it, so the error returns as slowly as the film forgets.
    let alone = held(&follower, &mut state, &mut film, 3000);
    assert!((0.02..0.1).contains(&alone), "{alone}");
}

/// The largest error (m) in each second of 1 Hz cycles.
fn cycles(follower: &Follower<f32>, state: &mut FollowerState<f32>, film: &mut Film, seconds: usize) -> Vec<f32> {
    let (mut reference_m, mut errors) = (0.8e-3, vec![0.0_f32; seconds]);
    for tick in 0..1000 * seconds {
        let (applied, displacement_m, sample) = film.tick();
        errors[tick / 1000] = errors[tick / 1000].max((displacement_m - reference_m).abs());
        reference_m = 1e-3 - 0.2e-3 * (TAU * (tick % 1000) as f32 * 1e-3).cos();
        film.voltage_v = follower.step(state, applied, sample, reference_m).voltage_v;
    }
    errors
}

/// The next run begins with the learned cycles of the last one if they are carried over, and without them otherwise.
#[test]
fn learned_cycles_are_carried_over_on_order() {
    let run = |carries_over: bool, forgets: bool| {
        let follower = tracking();
        let mut state = follower.state(law().state());
        // Learning alone takes the samples.
        state.set_feedback(false);
        let mut film = Film::new(1.1);
        let first = cycles(&follower, &mut state, &mut film, 40);
        // A second in which something else holds the voltage.
        for _ in 0..1000 {
            let (applied, _, sample) = film.tick();
            follower.observe(&mut state, applied, sample);
            follower.standby(&mut state);
            assert_eq!(state.added(), 0.0);
        }
        if carries_over {
            state.carry_over();
        }
        if forgets {
            state.forget_cycles();
        }
        (first, cycles(&follower, &mut state, &mut film, 10))
    };
    let ((first, carried), (_, anew), (_, forgotten)) = (run(true, false), run(false, false), run(true, true));
    // What was forgotten after the order is not carried over.
    assert_eq!(forgotten, anew);
    assert!(first[2] > 10e-6 && first[39] < 1e-6, "{first:?}");
    let [carried, anew] = [carried, anew].map(|errors| errors[2]);
    println!("third cycle: {:.2} µm carried over, {:.2} µm anew", 1e6 * carried, 1e6 * anew);
    assert!(carried < 0.2 * anew, "{carried:e} of {anew:e}");
}

/// A reference begins where the film is after others have moved it: no jump, whatever the compensator.
#[test]
fn following_begins_without_a_jump() {
    let law = law();
    let follower = Follower::new(Feedforward::new(law.clone(), &ACTUATOR, LIMITS).expect("valid"));
    let mut state = follower.state(law.state());
    let mut held_v = 0.0;
    for _ in 0..2000 {
        follower.observe(&mut state, Applied::as_commanded(3000.0), None);
        held_v = follower.standby(&mut state).voltage_v;
    }
    let reference = state.displacement();
    let begun = follower.step(&mut state, Applied::as_commanded(3000.0), None, reference);
    // A tick later the film would have crept by what 2 V hold.
    assert!((begun.voltage_v - held_v).abs() < 5.0, "{held_v} V, then {} V", begun.voltage_v);
    assert!(begun.limited.is_none());
}
