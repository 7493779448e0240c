//! States have names that a program can write in its own types, with the default memory, a lean one and a window.

use springpot::{
    Actuator, Applied, CommandLimits, Compressed, Feedforward, FeedforwardState, Law, LawOptions, LawState, Observer,
    ObserverOptions, ObserverState, Preset, Tracking, TrackingState, Window,
};

type Lean = Compressed<f32, 8, 14, 4>;

/// As a program keeps them.
struct Default {
    film: LawState<f32>,
    feedforward: FeedforwardState<f32>,
    observer: ObserverState<f32>,
    tracking: TrackingState<f32>,
}

struct WithLean {
    film: LawState<f32, Lean>,
    feedforward: FeedforwardState<f32, Lean>,
    observer: ObserverState<f32, Lean, 16>,
    tracking: TrackingState<f32, Lean, 16>,
}

/// A window in borrowed storage, as a controller without allocation has it.
struct Borrowed<'a> {
    film: LawState<f32, Window<f32, &'a mut [f32]>>,
}

const ACTUATOR: Actuator = Actuator::KARNER_2022;
const LIMITS: CommandLimits = CommandLimits::BENCH;

fn options() -> LawOptions {
    LawOptions::at_step(1e-3).with_horizon(3600.0).with_tolerance(1e-3)
}

fn observer_options() -> ObserverOptions {
    ObserverOptions::at_bandwidth(0.6)
}

#[test]
fn the_default_memory_needs_no_name() {
    let law: Law<f32> =
        Law::compressed(&Preset::ALL[1].model().expect("valid"), LawOptions::at_step(1e-3)).expect("valid");
    let film = law.state();
    let feedforward = Feedforward::new(law.clone(), &ACTUATOR, LIMITS).expect("valid");
    let observer = Observer::new(law.clone(), &ACTUATOR, 6000.0, observer_options()).expect("valid");
    let tracking = Tracking::new(law.clone(), &ACTUATOR, LIMITS, observer_options()).expect("valid");
    let mut states = Default {
        feedforward: feedforward.state(film.clone()),
        observer: observer.state(film.clone()),
        tracking: tracking.state(film.clone()),
        film,
    };
    // A clone is equal until it is stepped, and Debug shows the history.
    let before = states.tracking.clone();
    assert_eq!(before, states.tracking);
    tracking.observe(&mut states.tracking, Applied::as_commanded(3000.0), None);
    assert_ne!(before, states.tracking);
    assert!(format!("{before:?}").contains("history"));
    let x = law.displacement(&mut states.film, 30.0);
    let predicted = observer.observe(&mut states.observer, Applied::as_commanded(3000.0), None);
    let driven = feedforward.apply(&mut states.feedforward, Applied::as_commanded(3000.0));
    assert_eq!(predicted, driven);
    assert!(x > 0.0 && driven > 0.0);
}

#[test]
fn a_lean_memory_is_a_parameter() {
    let law: Law<f32, Lean> = Law::compressed(&Preset::ALL[1].model().expect("valid"), options()).expect("valid");
    let film = law.state();
    let feedforward = Feedforward::new(law.clone(), &ACTUATOR, LIMITS).expect("valid");
    let observer = Observer::<_, _, 16>::with_past(law.clone(), &ACTUATOR, 6000.0, observer_options()).expect("valid");
    let tracking = Tracking::<_, _, 16>::with_past(law.clone(), &ACTUATOR, LIMITS, observer_options()).expect("valid");
    let mut states = WithLean {
        feedforward: feedforward.state(film.clone()),
        observer: observer.state(film.clone()),
        tracking: tracking.state(film.clone()),
        film,
    };
    law.displacement(&mut states.film, 30.0);
    let applied = Applied::as_commanded(3000.0);
    let driven = feedforward.apply(&mut states.feedforward, applied);
    assert_eq!(tracking.observe(&mut states.tracking, applied, None), driven);
    assert_eq!(observer.observe(&mut states.observer, Applied::as_commanded(3000.0), None), driven);
    assert!(size_of::<WithLean>() < size_of::<Default>());
}

#[test]
fn a_window_steps_in_borrowed_storage() {
    let (mut weights, mut increments) = ([0.0f32; 50], [0.0f32; 50]);
    let model = Preset::ALL[1].model().expect("valid");
    let law: Law<f32, Window<f32, &mut [f32]>> = Law::window(&model, 1e-3, &mut weights[..]).expect("valid");
    let mut borrowed = Borrowed { film: law.state(&mut increments[..]).expect("same length") };
    assert!(law.displacement(&mut borrowed.film, 30.0) > 0.0);
}
