//! States have names that a program can write in its own types, with the default memory, a lean one and a window.

use springpot::{
    Actuator, Applied, CommandLimits, Compressed, Feedforward, FeedforwardState, Law, LawOptions, LawState, Observer,
    ObserverOptions, ObserverState, Preset, Tracking, TrackingState, Window,
};

type Lean = Compressed<f32, 8, 14, 4>;

/// As a program keeps them.
type Default = (LawState<f32>, FeedforwardState<f32>, ObserverState<f32>, TrackingState<f32>);
type WithLean =
    (LawState<f32, Lean>, FeedforwardState<f32, Lean>, ObserverState<f32, Lean, 16>, TrackingState<f32, Lean, 16>);

/// A window in borrowed storage, as a controller without allocation has it.
struct Borrowed<'a> {
    film: LawState<f32, Window<f32, &'a mut [f32]>>,
}

/// The four states with one memory.
type States<M, const PAST: usize> =
    (LawState<f32, M>, FeedforwardState<f32, M>, ObserverState<f32, M, PAST>, TrackingState<f32, M, PAST>);

/// A tick of each state of `law`, with a memory of `PAST` ticks.
fn ticked<const H: usize, const F: usize, const S: usize, const PAST: usize>(
    law: &Law<f32, Compressed<f32, H, F, S>>,
) -> States<Compressed<f32, H, F, S>, PAST> {
    let film = law.state();
    let (actuator, limits) = (Actuator::KARNER_2022, CommandLimits::BENCH);
    let options = ObserverOptions::at_bandwidth(0.6);
    let feedforward = Feedforward::new(law.clone(), &actuator, limits).expect("valid");
    let observer = Observer::<_, _, PAST>::with_past(law.clone(), &actuator, 6000.0, options).expect("valid");
    let tracking = Tracking::<_, _, PAST>::with_past(law.clone(), &actuator, limits, options).expect("valid");
    let (mut fed, mut observed) = (feedforward.state(film.clone()), observer.state(film.clone()));
    let (mut tracked, mut film) = (tracking.state(film.clone()), film);
    // A clone is equal until it is stepped, and Debug shows the history.
    let before = tracked.clone();
    assert_eq!(before, tracked);
    let applied = Applied::as_commanded(3000.0);
    let driven = feedforward.apply(&mut fed, applied);
    assert_eq!(observer.observe(&mut observed, applied, None), driven);
    assert_eq!(tracking.observe(&mut tracked, applied, None), driven);
    assert_ne!(before, tracked);
    assert!(format!("{before:?}").contains("history"));
    assert!(law.displacement(&mut film, 30.0) > 0.0 && driven > 0.0);
    (film, fed, observed, tracked)
}

#[test]
fn memories_are_a_parameter_that_has_a_default() {
    let model = Preset::TABLE3_N2.model().expect("valid");
    let options = LawOptions::at_step(1e-3);
    let law: Law<f32> = Law::compressed(&model, options).expect("valid");
    let states: Default = ticked(&law);
    let lean: Law<f32, Lean> =
        Law::compressed(&model, options.with_horizon(3600.0).with_tolerance(1e-3)).expect("valid");
    let smaller: WithLean = ticked(&lean);
    assert!(size_of_val(&smaller) < size_of_val(&states));
}

#[test]
fn a_window_steps_in_borrowed_storage() {
    let (mut weights, mut increments) = ([0.0f32; 50], [0.0f32; 50]);
    let model = Preset::TABLE3_N2.model().expect("valid");
    let law: Law<f32, Window<f32, &mut [f32]>> = Law::window(&model, 1e-3, &mut weights[..]).expect("valid");
    let mut borrowed = Borrowed { film: law.state(&mut increments[..]).expect("same length") };
    assert!(law.displacement(&mut borrowed.film, 30.0) > 0.0);
}
