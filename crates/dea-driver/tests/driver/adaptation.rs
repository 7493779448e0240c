//! A law that follows its film in the tick: by order, with the sensor, until the film has moved too far.

use std::collections::VecDeque;
use std::f64::consts::TAU;

use dea_driver::wire::{Answer, Command, Reject};
use dea_driver::{
    AdaptationOrder, AdaptationStatus, BLOB_LEN, Blob, BlobError, Cause, Control, Controller, DriverState,
    LearningOrder, Mode, Parameters,
};
use springpot::{Adapted, Adapting, ControlError};

use crate::bench::{board_parameters, encoded};
use crate::board::{BOARD, sealed};
use crate::film_bench::{FilmBench as Bench, rides_through};
use crate::host::{Host, blob};

const LEARN: AdaptationOrder = AdaptationOrder::Learn { trip_at: 3.0 };
/// The temperature of a film that is much stiffer.
const STIFF: AdaptationOrder = AdaptationOrder::Temperature { stiffness: 3.0, time: 1.0 };

/// A film whose force is other than the model's, and whose sensor may be lost.
fn bench(force_scale: f64) -> Bench {
    let bench = Bench::changed(|p| {
        rides_through(p);
        p.control = Control { delay_s: 0.0, ..Control::BENCH };
    });
    Bench { force_scale, ..bench }
}

/// Sines of 5 s from `from` to `to` (s): the largest error of the last 5 s, m. Without its sensor where `lost`.
fn run(bench: &mut Bench, [from, to]: [u32; 2], lost: bool) -> f64 {
    bench.is_unplugged = lost;
    bench.track(1000 * from..1000 * to, 5000, |time_s| 0.55e-3 * time_s.min(1.0) - 0.15e-3 * (TAU * time_s / 5.0).sin())
}

/// One of which the law has learned in a run of so many seconds.
fn learned(seconds: u32) -> Bench {
    let mut bench = bench(0.9);
    bench.order_adaptation(LEARN);
    bench.start(Mode::Tracking);
    run(&mut bench, [0, seconds], false);
    bench
}

/// A film with a tenth less force: by order the law follows it, and goes on so without the sensor, in the next feedforward as well. Without the
/// order, feedforward is off by a tenth.
#[test]
fn what_was_learned_is_used_when_the_sensor_goes() {
    let error_m = |order: Option<AdaptationOrder>| {
        let mut bench = bench(0.9);
        if let Some(order) = order {
            bench.order_adaptation(order);
        }
        bench.start(Mode::Tracking);
        run(&mut bench, [0, 60], false);
        let lost_m = run(&mut bench, [60, 120], true);
        bench.ask(Controller::stop).expect("it runs");
        bench.run(30_000);
        bench.start_armed(Mode::Feedforward);
        let feedforward_m = run(&mut bench, [0, 20], true);
        println!("{order:?}: {lost_m}, {feedforward_m}; {:?}", bench.controller.adaptation());
        (lost_m, feedforward_m, bench)
    };
    let (_, plain_m, bench) = error_m(None);
    assert_eq!(bench.controller.adaptation().adapting, Adapting::Off);
    assert!(plain_m > 40e-6);
    let (lost_m, feedforward_m, bench) = error_m(Some(LEARN));
    assert!(lost_m < 4e-6 && feedforward_m < 5e-6, "{lost_m} m, {feedforward_m} m");
    let adapted = bench.controller.adaptation().adapted;
    assert!((adapted.force_scale - 0.9).abs() < 0.01 && (0.8..1.6).contains(&adapted.ageing), "{adapted:?}");
    let change = bench.controller.adaptation().stiffness_change;
    assert!((change - 0.1 / 0.9).abs() < 0.02, "{change}");
}

/// Hold keeps what was learned, off brings back the law as it was fitted, and so do an acknowledged trip and other parameters.
#[test]
fn it_is_held_forgotten_and_switched_off() {
    let ageing = |bench: &Bench| bench.controller.adaptation().adapted.ageing;
    let ends = |bench: &Bench| (ageing(bench), bench.controller.adaptation().adapting);

    let mut held = learned(30);
    held.order_adaptation(AdaptationOrder::Hold);
    let before = ageing(&held);
    held.force_scale = 1.1;
    run(&mut held, [30, 60], false);
    assert!(before > 0.8 && (ageing(&held) - before).abs() < 0.02, "{before}: {:?}", held.controller.adaptation());
    held.order_adaptation(AdaptationOrder::Forget);
    run(&mut held, [60, 61], false);
    assert_eq!(ends(&held), (0.0, Adapting::Hold));
    held.order_adaptation(AdaptationOrder::Off);
    run(&mut held, [61, 90], false);
    assert_eq!(ends(&held), (0.0, Adapting::Off));

    let mut forgotten = learned(30);
    forgotten.force_scale = 1.0;
    forgotten.order_adaptation(AdaptationOrder::Forget);
    run(&mut forgotten, [30, 60], false);
    assert!(ends(&forgotten).0 < 0.1 && ends(&forgotten).1 == Adapting::Learn, "{:?}", ends(&forgotten));

    let mut tripped = learned(30);
    tripped.trip_and_acknowledge();
    assert_eq!(ends(&tripped), (0.0, Adapting::Learn));
}

/// A film, or a sensor, that has moved too far from its commissioning trips, in every mode that has a sensor.
#[test]
fn a_film_that_has_aged_too_far_trips() {
    for (force_scale, trip_at, trips) in [(0.9, 0.8, true), (0.9, 1.5, false), (1.3, 2.0, true), (1.0, 0.8, false)] {
        let mut bench = bench(force_scale);
        bench.order_adaptation(AdaptationOrder::Learn { trip_at });
        bench.start(Mode::Tracking);
        run(&mut bench, [0, 60], false);
        let wanted = if trips { DriverState::Tripped(Cause::Ageing) } else { DriverState::Running };
        let status = bench.controller.adaptation();
        assert_eq!(bench.state(), wanted, "{force_scale}, {trip_at}: {status:?}");
        assert!(!trips || bench.high_voltage_v < 1.0);
    }
}

/// A film at another temperature is followed without a sensor once the temperature is ordered, over stops and trips, in feedforward too; the stroke
/// that is watched is that of the film as it was fitted.
#[test]
fn a_temperature_that_is_ordered_is_used() {
    // 0.9 of the force is 1/0.9 of the stiffness.
    let order = AdaptationOrder::Temperature { stiffness: 1.0 / 0.9, time: 1.0 };
    let followed = |ordered: bool| {
        let mut bench = bench(0.9);
        if ordered {
            bench.order_adaptation(order);
            bench.trip_and_acknowledge();
        }
        bench.start(Mode::Feedforward);
        (run(&mut bench, [0, 20], true), bench)
    };
    let [(fitted_m, _), (ordered_m, mut bench)] = [false, true].map(followed);
    assert!(ordered_m < 5e-6 && fitted_m > 40e-6, "{ordered_m} and {fitted_m} m");
    let AdaptationStatus { adapting, adapted, stiffness, time, .. } = bench.controller.adaptation();
    assert!((stiffness * 0.9 - 1.0).abs() < 1e-3 && time == 1.0);
    assert_eq!((adapting, adapted.ageing), (Adapting::Hold, 0.0));
    // It is not learned: there is nothing to keep.
    bench.order_adaptation(AdaptationOrder::Keep);
    assert_eq!(bench.controller.parameters().adapted, None);
    for (stiffness, time) in [(0.2, 1.0), (1.0, 3.5), (f32::NAN, 1.0)] {
        let order = AdaptationOrder::Temperature { stiffness, time };
        assert!(bench.ask(|controller| controller.order_adaptation(order)).is_err());
    }
    assert_eq!(bench.controller.adaptation().stiffness, stiffness);

    // A film that is stated to be stiffer takes more voltage than the watch allows: it trips within its stroke.
    let mut wrong = Bench::changed(|p| {
        rides_through(p);
        p.limits.max_displacement_m = 1e-3;
    });
    wrong.order_adaptation(STIFF);
    wrong.start(Mode::Feedforward);
    wrong.is_unplugged = true;
    wrong.track(0..20_000, 0, |time_s| 0.7e-3 * time_s.min(1.0));
    assert_eq!(wrong.state(), DriverState::Tripped(Cause::ModelDisplacement));
    assert!(wrong.furthest_m < 1e-3, "{} m", wrong.furthest_m);
}

/// A temperature of another film, on one that is softer than its law, and a jump before a late sensor has shown that: the film counts as softer from the order
/// on, within a run as well, and where a sample is lost as the run begins. It went to 1.18 times its stroke.
#[test]
fn a_temperature_of_another_film_keeps_the_stroke() {
    for (mode, is_before, is_lost) in [Mode::Feedforward, Mode::Tracking]
        .into_iter()
        .flat_map(|mode| [(mode, true, false), (mode, true, true), (mode, false, false)])
    {
        let bench = Bench::changed(|p| {
            rides_through(p);
            (p.limits.max_displacement_m, p.limits.max_disturbance_share) = (1e-3, 0.4);
        });
        let mut bench = Bench { force_scale: 1.15, ..bench };
        let mut late = VecDeque::from([None; 10]);
        let mut run = |bench: &mut Bench, ticks: u16, is_lost: bool| {
            for _ in 0..ticks {
                bench.live_tick(|inputs| {
                    late.push_back(inputs.sensor_adc_v);
                    inputs.sensor_adc_v = late.pop_front().flatten().filter(|_| !is_lost);
                });
            }
        };
        if is_before {
            bench.order_adaptation(STIFF);
        }
        // The law follows it within seconds.
        run(&mut bench, 5000, false);
        bench.ask(Controller::arm).expect("healthy");
        run(&mut bench, 1, is_lost);
        bench.start_armed(mode);
        if !is_before {
            bench.order_adaptation(STIFF);
            run(&mut bench, 5000, false);
        }
        bench.set_reference(0.85e-3);
        run(&mut bench, 3000, false);
        let furthest_m = bench.furthest_m;
        println!("{mode:?}, before: {is_before}, lost: {is_lost}: {furthest_m} m, {:?}", bench.state());
        assert!(furthest_m < 1.05e-3, "{mode:?}, before: {is_before}, lost: {is_lost}: {furthest_m} m");
    }
}

/// The changes of a film are stored with the parameters, and used by the controller that is built from them: as good without a sensor as before.
#[test]
fn what_was_kept_is_used_after_a_restart() {
    let mut learned = learned(60);
    learned.order_adaptation(AdaptationOrder::Keep);
    let kept = encoded(learned.controller.parameters(), BOARD);
    let read = Blob::decode(&kept, BOARD).expect("its own").into_parameters();
    assert_eq!(&read, learned.controller.parameters());

    let mut restarted = Bench { force_scale: 0.9, ..Bench::with(read) };
    let AdaptationStatus { adapting, adapted, stiffness_change, .. } = restarted.controller.adaptation();
    assert!((stiffness_change - 0.1 / 0.9).abs() < 0.02, "{stiffness_change}");
    let before = learned.controller.adaptation().adapted;
    assert_eq!((adapting, adapted.memory, adapted.rate), (Adapting::Hold, before.memory, before.rate));
    assert!((adapted.force_scale / before.force_scale - 1.0).abs() < 1e-4, "{adapted:?} after {before:?}");
    restarted.start(Mode::Feedforward);
    let error_m = run(&mut restarted, [0, 20], true);
    assert!(error_m < 5e-6, "{error_m} m");
    let adapted = restarted.controller.adaptation().adapted;
    assert!((adapted.ageing - before.ageing).abs() < 1e-3, "{adapted:?} after {before:?}");
}

/// Numbers that no law can have learned are refused when a blob is made, and when it is read; blobs without any are as they were.
#[test]
fn what_no_law_has_learned_is_refused() {
    let with = |adapted| Parameters { adapted: Some(adapted), self_test_above_v: 1e3, ..board_parameters() };
    let is_out_of_range =
        |refused: &Option<BlobError>| matches!(refused, Some(BlobError::Control(ControlError::OutOfRange { .. })));
    let sound = Adapted {
        force_scale: 0.5,
        uncertainty: 0.1,
        memory: 0.7,
        rate: -1.1,
        stretch: 0.25,
        bias_n: 0.01,
        ageing: 2.0,
    };
    let mut bytes = encoded(&with(sound), BOARD);
    let usual = encoded(&Parameters { adapted: None, ..with(sound) }, BOARD);
    assert_eq!(bytes.len(), usual.len() + 28);
    let kept = Blob::decode(&bytes, BOARD).expect("sound");
    assert_eq!(kept.parameters(), &with(sound));
    // As which parameters a host knows them.
    assert_eq!(kept.checksum(), usual.last_chunk().copied().map(u32::from_le_bytes));
    for unsound in [
        Adapted { force_scale: 0.2, ..sound },
        Adapted { force_scale: -1.0, ..sound },
        Adapted { force_scale: f32::NAN, ..sound },
        Adapted { memory: 0.71, ..sound },
        Adapted { rate: f32::INFINITY, ..sound },
        Adapted { stretch: -0.26, ..sound },
        Adapted { bias_n: 1e3, ..sound },
        Adapted { bias_n: f32::NAN, ..sound },
        Adapted { uncertainty: f32::NAN, ..sound },
        Adapted { ageing: f32::INFINITY, ..sound },
    ] {
        let refused = with(unsound).encode(BOARD, &mut [0; BLOB_LEN]).err();
        assert!(is_out_of_range(&refused), "{unsound:?}: {refused:?}");
    }
    // The scale is the first of the last seven numbers, before the checksum.
    let end = bytes.len() - 4;
    bytes[end - 28..end - 24].copy_from_slice(&5f32.to_le_bytes());
    let refused = Blob::decode(&sealed(&bytes[..end]), BOARD).err();
    assert!(is_out_of_range(&refused), "{refused:?}");
}

fn status(host: &mut Host) -> AdaptationStatus {
    match host.ask(Command::Adaptation) {
        Answer::Adaptation(status) => status,
        other => panic!("{other:?}"),
    }
}

/// Over the link: what is learned is kept with stored parameters alone, while the amplifier is off, and is gone from the store once it was forgotten.
#[test]
fn it_is_kept_over_the_link() {
    let mut host = Host::with_parameters();
    let keep = Command::Adapt(AdaptationOrder::Keep);
    assert_eq!(host.ask(keep.clone()), Answer::Rejected(Reject::Value), "they are only tried");
    assert_eq!(host.commit(&blob()), Answer::Done);
    let stored = |host: &mut Host| host.bench.store.load().expect("stored").blob.into_parameters().adapted;
    assert_eq!((host.ask(keep.clone()), stored(&mut host)), (Answer::Done, None));

    host.done(Command::Adapt(LEARN));
    host.tick();
    assert_eq!((host.ask(keep.clone()), stored(&mut host)), (Answer::Done, None), "nothing was learned");
    host.arm();
    assert!(matches!(host.ask(keep.clone()), Answer::Refused(_)));
    // A film that does not move under its voltage is held by a constant force.
    host.done(Command::Start(Mode::Voltage));
    for _ in 0..100 {
        host.done(Command::SetVoltage(500.0));
        host.ticks(20);
    }
    host.done(Command::Disarm);
    host.done(keep.clone());
    assert!(stored(&mut host).is_some());
    host.done(Command::Reload);
    assert_eq!(status(&mut host).adapting, Adapting::Hold);

    host.done(Command::Adapt(AdaptationOrder::Off));
    assert_eq!((host.ask(keep), stored(&mut host)), (Answer::Done, None));
}

/// Over the link: off at first, levels and parameters are checked, and other parameters switch it off.
#[test]
fn it_is_ordered_over_the_link() {
    let mut host = Host::with_parameters();
    let first = status(&mut host);
    assert_eq!((first.adapting, first.adapted.ageing, first.adapted.force_scale), (Adapting::Off, 0.0, 1.0));
    for trip_at in [0.0, -1.0, f32::NAN] {
        let answer = host.ask(Command::Adapt(AdaptationOrder::Learn { trip_at }));
        assert_eq!(answer, Answer::Rejected(Reject::Value), "{trip_at}");
    }
    host.done(Command::Adapt(AdaptationOrder::Learn { trip_at: 0.5 }));
    host.done(Command::Adapt(LEARN));
    assert_eq!((status(&mut host).adapting, status(&mut host).trip_at), (Adapting::Learn, 3.0));
    // Armed, only by the host that armed.
    host.arm();
    let token = std::mem::take(&mut host.token);
    assert_eq!(host.ask(Command::Adapt(AdaptationOrder::Off)), Answer::Rejected(Reject::Token));
    assert_eq!(status(&mut host).adapting, Adapting::Learn);
    host.token = token;
    host.done(Command::Adapt(AdaptationOrder::Hold));
    host.done(Command::Disarm);

    let control = Control { adaptation_s: 0.0, ..Control::BENCH };
    assert_eq!(host.try_blob(&encoded(&Parameters { control, ..board_parameters() }, BOARD)), Answer::Done);
    assert_eq!(status(&mut host).adapting, Adapting::Off);
    assert_eq!(host.ask(Command::Adapt(LEARN)), Answer::Rejected(Reject::Value));
    // Cycles are another matter.
    assert_eq!(host.ask(Command::Learning(LearningOrder::Forget)), Answer::Rejected(Reject::Value));
}
