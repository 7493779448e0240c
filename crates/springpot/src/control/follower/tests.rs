//! The sequence that a follower replaces, written by hand: its specification, compared bit by bit.

extern crate std;

use std::vec::Vec;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::sealed::Compensates;
use super::{Compensator, Follower, FollowerState};
use crate::{
    Actuator, AmplifierLag, Applied, CommandLimits, Feedforward, Law, LawOptions, LawState, Learning, LearningOptions,
    LearningState, Limited, ObserverOptions, Preload, Preset, SensorSample, Tracking, VoltageCommand,
};

/// A tick: what happens before it, its inputs, and whether something else sets the voltage.
#[derive(Clone, Copy, Debug)]
struct Tick {
    event: Event,
    applied: Applied<f32>,
    sample: Option<SensorSample<f32>>,
    /// None in a tick whose voltage something else sets.
    reference: Option<f32>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Event {
    None,
    EndRun,
    CarryOver,
    ForgetCycles,
    ForgetCorrection,
    Feedback(bool),
}

/// The sequence by hand. The sample is handed to learning only once the run has begun, as a program without a follower does.
#[allow(clippy::struct_excessive_bools)] // the flags that programs carried
struct ByHand<C: Compensator<f32>> {
    compensator: C,
    state: C::State,
    learning: Option<Learning<f32>>,
    learned: Option<LearningState<f32>>,
    is_free: bool,
    has_begun: bool,
    carries_over: bool,
    has_feedback: bool,
}

impl<C: Compensator<f32>> ByHand<C> {
    fn tick(&mut self, tick: &Tick) -> (f32, VoltageCommand<f32>, f32) {
        let Self { compensator, state, learning, learned, .. } = self;
        let mut cycles = learning.as_ref().zip(learned.as_mut());
        match tick.event {
            Event::None => {}
            Event::EndRun => {
                self.has_begun = false;
                C::leave_cycles(state, false);
            }
            Event::CarryOver => self.carries_over = true,
            Event::ForgetCycles => {
                self.carries_over = false;
                if let Some((_, learned)) = &mut cycles {
                    learned.forget();
                }
            }
            Event::ForgetCorrection => C::forget(state),
            Event::Feedback(is_on) => self.has_feedback = is_on,
        }
        let corrects = if self.has_feedback { tick.sample } else { None };
        let x = compensator.observe(state, tick.applied, corrects);
        let Some(reference) = tick.reference else {
            self.has_begun = false;
            C::leave_cycles(state, false);
            C::correct_fully(state);
            return (x, compensator.command(state, x), 0.0);
        };
        let Some((learning, learned)) = cycles else { return (x, compensator.command(state, reference), 0.0) };
        if !self.has_begun {
            if self.carries_over {
                learned.drop_sample();
                learning.restart(learned, reference, true);
            } else {
                *learned = learning.state(reference);
            }
            self.is_free = true;
            self.has_begun = true;
            self.carries_over = false;
        }
        if let Some(sample) = tick.sample {
            learned.observe(sample);
        }
        let limited = if self.is_free { Limited::NONE } else { Limited::SLEW };
        let followed = learning.advance(learned, reference, limited);
        C::leave_cycles(state, learned.has_learned());
        let command = compensator.command(state, followed);
        self.is_free = command.limited.is_none();
        (x, command, learned.added())
    }
}

/// Ticks along cycles with whatever can happen: limits, stretches without a sensor, values that are not finite, orders, other voltages.
fn ticks(random: &mut Pcg64, count: usize, period: f32) -> Vec<Tick> {
    let (mut standby, mut blind) = (0_u32, 0_u32);
    (0..count)
        .map(|k| {
            #[allow(clippy::cast_precision_loss)] // below 2^24
            let angle = core::f32::consts::TAU * (k as f32) / period;
            let stroke = if k % 9000 > 8000 { 3e-3 } else { 0.2e-3 };
            let reference = 1e-3 - stroke * angle.cos();
            let rare = |random: &mut Pcg64, one_in: u32| random.random_range(0..one_in) == 0;
            let event = match random.random_range(0..8000) {
                0 | 1 => Event::EndRun,
                2 | 3 => Event::CarryOver,
                4 => Event::ForgetCycles,
                5 => Event::ForgetCorrection,
                6 => Event::Feedback(false),
                7 => Event::Feedback(true),
                _ => Event::None,
            };
            if rare(random, 6000) {
                standby = random.random_range(1..300);
            }
            if rare(random, 6000) {
                blind = random.random_range(1..500);
            }
            (standby, blind) = (standby.saturating_sub(1), blind.saturating_sub(1));
            let noise = random.random_range(-4e-6..4e-6_f32);
            let displacement_m = if rare(random, 300) { f32::NAN } else { 1.03 * reference + noise };
            let age_ticks = if rare(random, 300) { random.random_range(50..80) } else { random.random_range(0..15) };
            let sample = (k % 10 == 3 && blind == 0).then_some(SensorSample { displacement_m, age_ticks });
            let reference = if rare(random, 700) { f32::NAN } else { reference };
            // What becomes of the command is filled in by the run.
            let reading = rare(random, 2).then(|| if rare(random, 50) { f32::NAN } else { 1.01 + 1e-3 * noise });
            let applied = Applied { commanded_v: if rare(random, 500) { 0.5 } else { 1.0 }, reading_v: reading };
            Tick { event, applied, sample, reference: (standby == 0).then_some(reference) }
        })
        .collect()
}

fn compare<C: Compensator<f32, Film = LawState<f32>> + Clone>(
    compensator: C,
    learning: Option<Learning<f32>>,
    film: &LawState<f32>,
    ticks: &[Tick],
) -> f32 {
    let follower = Follower::new(compensator.clone());
    let follower = match learning {
        Some(learning) => follower.with_learning(learning),
        None => follower,
    };
    let mut state: FollowerState<f32, C> = follower.state(film.clone());
    let mut by_hand = ByHand {
        state: Compensates::state(&compensator, film.clone()),
        compensator,
        learned: learning.as_ref().map(|learning| learning.state(film.position())),
        learning,
        is_free: true,
        has_begun: true,
        carries_over: false,
        has_feedback: true,
    };
    let (mut commanded_v, mut added_m) = (0.0_f32, 0.0_f32);
    for (k, tick) in ticks.iter().enumerate() {
        let applied_v = commanded_v * tick.applied.commanded_v;
        let reading_v = tick.applied.reading_v.map(|share| share * applied_v);
        let tick = Tick { applied: Applied { commanded_v: applied_v, reading_v }, ..*tick };
        let (x, expected, added) = by_hand.tick(&tick);
        match tick.event {
            Event::None => {}
            Event::EndRun => state.end_run(),
            Event::CarryOver => state.carry_over(),
            Event::ForgetCycles => state.forget_cycles(),
            Event::ForgetCorrection => state.forget_correction(),
            Event::Feedback(is_on) => state.set_feedback(is_on),
        }
        let command = match tick.reference {
            // One call and two phases in turn.
            Some(reference) if k % 2 == 0 => follower.step(&mut state, tick.applied, tick.sample, reference),
            reference => {
                let estimate = follower.observe(&mut state, tick.applied, tick.sample);
                assert_eq!(estimate.to_bits(), x.to_bits(), "{k}: {tick:?}");
                match reference {
                    Some(reference) => follower.command(&mut state, reference),
                    None => follower.standby(&mut state),
                }
            }
        };
        let bits = |command: VoltageCommand<f32>| {
            let VoltageCommand { voltage_v, reference_m, force_n, limited } = command;
            ([voltage_v, reference_m, force_n].map(f32::to_bits), limited)
        };
        assert_eq!(state.displacement().to_bits(), x.to_bits(), "{k}: {tick:?}");
        assert_eq!(bits(command), bits(expected), "{k}: {command:?}, by hand {expected:?}, {tick:?}");
        assert_eq!(state.added().to_bits(), added.to_bits(), "{k}: {tick:?}");
        commanded_v = command.voltage_v;
        added_m = added_m.max(added.abs());
    }
    added_m
}

#[test]
fn a_follower_is_the_sequence_by_hand() {
    let mut random = Pcg64::seed_from_u64(27);
    for (given, preload, amplifier) in [
        (true, Preload::Settled, AmplifierLag::NONE),
        (false, Preload::FromStart, AmplifierLag { rise_s: 0.02, fall_s: 0.1 }),
    ] {
        let law: Law<f32> = Law::compressed(&Preset::TABLE3_N2.model().unwrap(), LawOptions::at_step(1e-3)).unwrap();
        let actuator = Actuator { preload, ..Actuator::KARNER_2022 };
        let limits = CommandLimits { amplifier, ..CommandLimits::BENCH };
        let options = LearningOptions { period_s: given.then_some(0.5), ..LearningOptions::BENCH };
        let learning = Learning::new(&law, &actuator, limits.max_voltage_v, options).unwrap();
        let tracking = Tracking::new(law.clone(), &actuator, limits, ObserverOptions::at_bandwidth(0.5)).unwrap();
        let feedforward = Feedforward::new(law.clone(), &actuator, limits).unwrap();
        let ticks = ticks(&mut random, 120_000, 500.0);
        for learning in [None, Some(learning)] {
            let fed = compare(feedforward.clone(), learning, &law.state(), &ticks);
            let tracked = compare(tracking.clone(), learning, &law.state(), &ticks);
            // Cycles were learned on the way, where they are.
            let least = if learning.is_some() { 1e-6 } else { 0.0 };
            assert!(fed >= least && tracked >= least, "{fed:e}, {tracked:e}");
        }
    }
}
