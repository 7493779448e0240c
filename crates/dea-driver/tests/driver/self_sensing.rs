//! The film as its own sensor: a tone on the drive of a run that tracks, within every limit, and what ends it.

use std::ops::Range;

use dea_driver::chips::Converters;
use dea_driver::wire::{Answer, Command, Reject};
use dea_driver::{
    AdaptationOrder, BLOB_LEN, Blob, BlobError, Cause, Controller, DriverState, Inputs, Mode, OnSensorFault, Outputs,
    Parameters, RamFlash, SelfSensor, SensorFault, Store,
};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::{CapacitanceRelation, SelfSensingError, SelfSensingOptions};

use crate::bench::{board_parameters, encoded};
use crate::board::{BOARD, sealed};
use crate::circuit::{CONVERTERS, Circuit, relation, sensed_parameters, sensor};
use crate::film_bench::{FilmBench, adc_v};
use crate::host::Host;

/// A controller around a film in its circuit.
struct Bench {
    film: FilmBench,
    circuit: Circuit,
    /// At the ADC of the current, V, and whether that answers.
    current_adc_v: Option<f32>,
    has_current: bool,
    /// Whether the displacement sensor is there.
    has_sensor: bool,
    /// The last four commands, V: an amplifier without the tone gives their mean.
    commands_v: [f64; 4],
    passes_tone: bool,
}

impl Bench {
    fn with(parameters: Parameters, has_sensor: bool) -> Self {
        let mut film = FilmBench::with(Parameters { self_sensing: None, ..parameters.clone() });
        film.controller = Controller::new(Blob::with_converters(parameters, &CONVERTERS).expect("valid"));
        let (circuit, current_adc_v, commands_v) = (Circuit::new(3), None, [0.0; 4]);
        Self { film, circuit, current_adc_v, has_current: true, has_sensor, commands_v, passes_tone: true }
    }

    /// Tracking, without a displacement sensor.
    fn tracking() -> Self {
        let mut bench = Self::with(sensed_parameters(), false);
        bench.start(Mode::Tracking);
        bench
    }

    /// The same after a rise to 0.8 mm within a second, and so many ticks more.
    fn risen(ticks: u32) -> Self {
        let mut bench = Self::tracking();
        bench.run(rise, 1500 + ticks);
        bench
    }

    fn start(&mut self, mode: Mode) {
        self.tick(|_| ());
        self.film.ask(Controller::arm).expect("healthy");
        self.film.start_armed(mode);
    }

    fn tick(&mut self, spoil: impl FnOnce(&mut Inputs)) -> Outputs {
        let has_sensor = self.has_sensor;
        self.film.controller.note_current(self.current_adc_v.filter(|_| self.has_current));
        if !self.passes_tone {
            self.film.high_voltage_v = self.commands_v.iter().sum::<f64>() / 4.0;
        }
        let outputs = self.film.tick(|inputs| {
            if !has_sensor {
                inputs.sensor_adc_v = None;
            }
            spoil(inputs);
        });
        self.commands_v.rotate_left(1);
        self.commands_v[3] = self.film.high_voltage_v;
        self.current_adc_v = Some(self.circuit.tick(self.film.high_voltage_v, self.film.displacement_m));
        outputs
    }

    fn state(&self) -> DriverState {
        self.film.controller.supervisor().state()
    }

    /// Ticks until it is disabled, at 0 V, each of which `spoil` may alter.
    fn ends(&mut self, spoil: impl Fn(&mut Inputs)) -> Option<u32> {
        (1..200).find(|_| {
            self.film.controller.heartbeat();
            let outputs = self.tick(&spoil);
            !outputs.enable && outputs.dac_v == 0.0
        })
    }

    /// Ticks towards `reference_m` (m).
    fn run(&mut self, reference_m: impl Fn(f64) -> f64, ticks: u32) {
        for k in 0..ticks {
            self.film.set_reference(reference_m(1e-3 * f64::from(k)) as f32);
            self.tick(|_| ());
        }
    }
}

/// A rise to 0.8 mm, and a slow swing about it.
fn swing(time_s: f64) -> f64 {
    0.8e-3 * (time_s / 2.0).min(1.0) - 0.1e-3 * (0.6 * time_s).sin()
}

/// A rise to 0.8 mm within a second.
fn rise(time_s: f64) -> f64 {
    0.8e-3 * time_s.min(1.0)
}

/// The largest error in so many of the last of `ticks`, m.
fn error_m(bench: &mut Bench, ticks: Range<u32>, last: u32) -> f64 {
    let (from, mut largest_m) = (ticks.end - last, 0.0f64);
    for k in ticks {
        let reference_m = swing(1e-3 * f64::from(k));
        bench.film.set_reference(reference_m as f32);
        bench.tick(|_| ());
        assert_eq!(bench.state(), DriverState::Running, "tick {k}");
        if k >= from {
            largest_m = largest_m.max((bench.film.displacement_m - reference_m).abs());
        }
    }
    largest_m
}

/// A film with a tenth less force than the model's, without another sensor: without a monitor of the current the tracking is off by as much.
#[test]
fn a_film_is_tracked_by_itself_alone() {
    let mut sensed = Bench::tracking();
    sensed.film.force_scale = 0.9;
    let sensed_m = error_m(&mut sensed, 0..20_000, 10_000);
    let mut plain = Bench::with(Parameters { self_sensing: None, ..sensed_parameters() }, false);
    plain.film.force_scale = 0.9;
    plain.start(Mode::Tracking);
    let plain_m = error_m(&mut plain, 0..20_000, 10_000);
    println!("{:.1} um, without {:.1} um", 1e6 * sensed_m, 1e6 * plain_m);
    assert!(sensed_m < 15e-6 && plain_m > 60e-6, "{sensed_m} m, {plain_m} m");
}

/// A relation that is off by a tenth, beside a displacement sensor: that one is followed, and what it has shown of the relation stays when it is lost.
#[test]
fn another_sensor_corrects_the_film_and_may_be_lost() {
    let off = CapacitanceRelation { stroke_m: relation().stroke_m.map(|a| 1.1 * a), ..relation() };
    let bench = |has_sensor| {
        let parameters = Parameters { self_sensing: Some(sensor(&off)), ..sensed_parameters() };
        let mut bench = Bench::with(parameters, has_sensor);
        bench.film.force_scale = 0.9;
        bench.start(Mode::Tracking);
        bench
    };
    let mut both = bench(true);
    let both_m = error_m(&mut both, 0..20_000, 10_000);
    both.has_sensor = false;
    let lost_m = error_m(&mut both, 20_000..40_000, 20_000);
    let alone_m = error_m(&mut bench(false), 0..20_000, 10_000);
    println!("both {both_m:.2e} m, lost {lost_m:.2e} m, never there {alone_m:.2e} m");
    assert!(both_m < 10e-6 && lost_m < 30e-6 && alone_m > 60e-6, "{both_m} m, {lost_m} m, {alone_m} m");
}

/// In every other mode, and before there is a reference, the voltage is what it would be without.
#[test]
fn there_is_no_tone_but_where_it_is_used() {
    let commands = |parameters: Parameters, mode: Mode| {
        let mut bench = Bench::with(parameters, true);
        bench.start(mode);
        let mut commands = Vec::new();
        for k in 0..3000u16 {
            match mode {
                Mode::Voltage => bench.film.set_voltage(f32::from(k)),
                Mode::Feedforward => bench.film.set_reference(0.2e-6 * f32::from(k)),
                Mode::Tracking => bench.film.controller.heartbeat(),
            }
            commands.push(bench.tick(|_| ()).telemetry.command_v);
        }
        commands
    };
    for mode in [Mode::Voltage, Mode::Feedforward, Mode::Tracking] {
        let with = commands(sensed_parameters(), mode);
        let mut plain = Parameters { self_sensing: None, ..sensed_parameters() };
        if mode == Mode::Feedforward {
            // As much as the tone leaves to the law, whose constants may then round otherwise.
            plain.limits.max_slew_v_per_s = 50e3;
        }
        let largest_v = with.iter().zip(&commands(plain, mode)).fold(0.0, |most: f32, (a, b)| most.max((a - b).abs()));
        assert!(largest_v <= if mode == Mode::Feedforward { 0.01 } else { 0.0 }, "{mode:?}: {largest_v} V");
        assert_eq!(with.last().is_some_and(|&volts| volts > 1000.0), mode != Mode::Tracking);
    }
}

/// With the tone on every command is within slew, voltage and field, whatever the reference, and is 0 V in the tick that ends the run.
#[test]
fn the_tone_keeps_every_limit() {
    for (max_voltage_v, max_field_v_per_m) in [(6500.0, 4.2e7), (3000.0, 4.2e7), (6500.0, 2e7)] {
        let mut parameters = sensed_parameters();
        let limits = &mut parameters.limits;
        (limits.max_voltage_v, limits.max_field_v_per_m) = (max_voltage_v, max_field_v_per_m);
        limits.max_disturbance_share = 0.4;
        let mut bench = Bench::with(parameters, true);
        bench.film.force_scale = 1.1;
        bench.start(Mode::Tracking);
        bench.has_sensor = false;
        let mut random = Pcg64::seed_from_u64(5);
        let (mut before_v, mut highest_v, mut tones) = (0.0f32, 0.0f32, 0);
        for tick in 0..30_000u32 {
            if tick.is_multiple_of(700) {
                bench.film.set_reference(random.random_range(-0.5e-3..3e-3));
            }
            bench.film.controller.heartbeat();
            let longest_m = bench.film.displacement_m as f32;
            let command_v = bench.tick(|_| ()).telemetry.command_v;
            assert_eq!(bench.state(), DriverState::Running, "tick {tick}");
            assert!((command_v - before_v).abs() < 100.01, "tick {tick}: {before_v} V, then {command_v} V");
            assert!((0.0..=max_voltage_v).contains(&command_v), "tick {tick}: {command_v} V");
            // 0.2 % for a tick of motion and what the sensed film is off.
            let most_v = 1.002 * max_field_v_per_m * 160e-6 / (1.0 + longest_m / 0.04);
            assert!(command_v <= most_v, "tick {tick}: {command_v} V of {most_v} V");
            tones += u32::from((command_v - before_v).abs() > 25.0);
            (before_v, highest_v) = (command_v, highest_v.max(command_v));
        }
        assert!(tones > 28_000, "the tone was on in {tones} of 30000 ticks");
        assert!(highest_v > 0.98 * max_voltage_v.min(max_field_v_per_m * 155e-6), "{highest_v} V");
        bench.film.ask(Controller::disarm).expect("running");
        let outputs = bench.tick(|_| ());
        assert_eq!((outputs.enable, outputs.dac_v), (false, 0.0));
    }
}

/// A part that breaks ends the run at 0 V within a tenth of a second with its cause, at any tick of a block; acknowledged and armed again it tracks as before.
#[test]
fn what_breaks_ends_at_0_v_with_its_cause() {
    type Break = fn(&mut Bench);
    let breaks: [(Cause, Break); 8] = [
        (Cause::Electrode, |bench| bench.circuit.electrodes_ohm = 1e12),
        (Cause::FilmShorted, |bench| bench.circuit.leak_ohm = 12e6),
        (Cause::FilmShorted, |bench| bench.circuit.leak_ohm = 20e6),
        (Cause::CurrentMonitor, |bench| bench.circuit.stuck_a = Some(0.0)),
        (Cause::CurrentMonitor, |bench| bench.circuit.stuck_a = Some(0.2e-3)),
        (Cause::CurrentMonitor, |bench| bench.circuit.gain = 0.05),
        (Cause::CurrentMonitor, |bench| bench.has_current = false),
        (Cause::NoTone, |bench| bench.passes_tone = false),
    ];
    for (index, (cause, spoil)) in breaks.into_iter().enumerate() {
        for at in 0..20 {
            let mut bench = Bench::risen(at);
            assert_eq!(bench.state(), DriverState::Running);
            spoil(&mut bench);
            let ends = bench.ends(|_| ());
            assert_eq!(bench.state(), DriverState::Tripped(cause), "{index} at {at}: {ends:?}");
            assert!(ends.is_some_and(|ticks| ticks <= 80), "{index} at {at}: {ends:?}");
            if at == 7 {
                (bench.circuit, bench.passes_tone, bench.has_current) = (Circuit::new(4), true, true);
                bench.film.ask(Controller::acknowledge).expect("tripped");
                bench.film.controller.heartbeat();
                bench.tick(|_| ());
                bench.start(Mode::Tracking);
                bench.run(rise, 5000);
                assert_eq!(bench.state(), DriverState::Running, "{index}");
                assert!((bench.film.displacement_m - 0.8e-3).abs() < 40e-6, "{index}: {} m", bench.film.displacement_m);
            }
        }
    }
}

/// With the tone on, faults end as they do without: the sensor's as well, where the limits ask for one.
#[test]
fn other_faults_end_as_without_the_tone() {
    type Spoil = fn(&mut Inputs);
    let faults: [(Cause, u32, bool, Spoil); 7] = [
        (Cause::Interlock, 1, false, |inputs| inputs.interlock_closed = false),
        (Cause::Bus, 1, false, |inputs| inputs.monitor_adc_v = None),
        (Cause::Voltage, 1, false, |inputs| inputs.monitor_adc_v = Some(adc_v(u16::MAX))),
        (Cause::Monitor, 21, false, |inputs| inputs.monitor_adc_v = Some(0.0)),
        (Cause::Monitor, 21, false, |inputs| inputs.monitor_adc_v = inputs.monitor_adc_v.map(|volts| 1.1 * volts)),
        (Cause::Sensor(SensorFault::Range), 1, true, |inputs| inputs.sensor_adc_v = None),
        (Cause::Sensor(SensorFault::Range), 1, true, |inputs| inputs.sensor_adc_v = Some(adc_v(u16::MAX))),
    ];
    for (cause, most, trips, spoil) in faults {
        let mut parameters = sensed_parameters();
        if trips {
            parameters.limits.on_sensor_fault = OnSensorFault::Trip;
        }
        let mut bench = Bench::with(parameters, trips);
        bench.start(Mode::Tracking);
        bench.run(rise, 1500);
        let ends = bench.ends(spoil);
        assert_eq!((bench.state(), ends), (DriverState::Tripped(cause), Some(most)), "{cause:?}");
    }
    let mut silent = Bench::risen(0);
    let ends = (1..1000).find(|_| !silent.tick(|_| ()).enable);
    assert_eq!((silent.state(), ends), (DriverState::Tripped(Cause::Heartbeat), Some(500)));
}

/// With the tone on an arc may heal at any tick of a block, of a film whose recharge the monitor of the current shows in part, for a tick or
/// for as long as the monitor may take to settle, and the next one trips. An electrode that is lost by it ends the run.
#[test]
fn an_arc_may_heal_with_the_tone_on() {
    for (at, lasts) in (0..20).flat_map(|at| [(at, 1), (at, 7), (at, 19)]) {
        let arc = |bench: &mut Bench| {
            for k in 0..lasts {
                bench.film.controller.heartbeat();
                bench.current_adc_v = Some(adc_v(u16::MAX));
                bench.tick(|inputs| {
                    inputs.monitor_adc_v = inputs.monitor_adc_v.map(|volts| volts * k as f32 / lasts as f32);
                });
            }
        };
        let arced = || {
            let mut bench = Bench::risen(at);
            arc(&mut bench);
            bench
        };
        let mut bench = arced();
        bench.run(|_| 0.8e-3, 300);
        assert_eq!(bench.state(), DriverState::Running, "at {at}, {lasts} ticks");
        arc(&mut bench);
        assert_eq!(bench.state(), DriverState::Tripped(Cause::Monitor), "at {at}, {lasts} ticks");

        let mut lost = arced();
        lost.circuit.electrodes_ohm = 1e12;
        let ends = lost.ends(|_| ());
        assert_eq!(lost.state(), DriverState::Tripped(Cause::Electrode), "at {at}, {lasts} ticks");
        assert!(ends.is_some_and(|ticks| ticks <= 160), "at {at}, {lasts} ticks: {ends:?}");
    }
}

/// An arc that has healed earlier in the run delays nothing: it took 119 ms.
#[test]
fn what_breaks_after_an_arc_has_healed_ends_as_without_it() {
    for at in 0..20 {
        let mut bench = Bench::risen(at);
        bench.film.controller.heartbeat();
        bench.tick(|inputs| inputs.monitor_adc_v = Some(0.0));
        bench.run(|_| 0.8e-3, 100);
        assert_eq!((bench.state(), bench.film.controller.supervisor().falls()), (DriverState::Running, 1));
        bench.circuit.electrodes_ohm = 1e12;
        let ends = bench.ends(|_| ());
        assert_eq!(bench.state(), DriverState::Tripped(Cause::Electrode), "at {at}");
        assert!(ends.is_some_and(|ticks| ticks <= 80), "at {at}: {ends:?}");
    }
}

/// At a temperature of another film it counts as softer from the begin of a run, before its own first samples: it trips at 0.84 of its stroke instead of 0.96.
#[test]
fn a_film_that_is_its_sensor_is_presumed_softer_until_it_is_shown() {
    let mut parameters = sensed_parameters();
    (parameters.limits.max_displacement_m, parameters.limits.max_disturbance_share) = (1e-3, 0.4);
    parameters.control.max_velocity_m_per_s = 0.0199;
    let mut bench = Bench::with(parameters, true);
    bench.film.force_scale = 1.15;
    // Another sensor has shown that it is at rest.
    bench.start(Mode::Voltage);
    bench.film.ask(Controller::disarm).expect("running");
    bench.has_sensor = false;
    let order = AdaptationOrder::Temperature { stiffness: 3.0, time: 1.0 };
    bench.film.ask(|controller| controller.order_adaptation(order)).expect("within bounds");
    for _ in 0..5000 {
        bench.tick(|_| ());
    }
    bench.start(Mode::Tracking);
    bench.film.set_reference(0.85e-3);
    assert!(bench.ends(|_| ()).is_some(), "{:?}", bench.state());
    assert!((0.5e-3..0.9e-3).contains(&bench.film.displacement_m), "{} m", bench.film.displacement_m);
}

/// A monitor of the current that lies so slowly that the controller takes it for a film that becomes stiffer, with a law that follows its film and
/// without: the model that watches the stroke follows nothing of it.
#[test]
fn a_current_monitor_that_lies_slowly_does_not_raise_the_stroke() {
    // Each hundredth of the gain is a third of a millimetre.
    for lie in [-0.03, -0.1, 0.03] {
        for order in [None, Some(AdaptationOrder::Learn { trip_at: f32::INFINITY })] {
            for force_scale in [0.87, 1.0, 1.15] {
                let mut parameters = sensed_parameters();
                (parameters.limits.max_displacement_m, parameters.limits.max_disturbance_share) = (1e-3, 0.4);
                let mut bench = Bench::with(parameters, true);
                bench.film.force_scale = force_scale;
                order.into_iter().for_each(|order| bench.film.order_adaptation(order));
                bench.start(Mode::Tracking);
                for tick in 0..620_000u32 {
                    // The sensor is lost as the lie begins.
                    bench.has_sensor = tick < 20_000;
                    bench.circuit.gain = 1.0 + lie * f64::from(tick.saturating_sub(20_000)) / 600_000.0;
                    if bench.state() != DriverState::Running {
                        break;
                    }
                    let time_s = 1e-3 * f64::from(tick);
                    let reference_m = (time_s / 2.0).min(1.0) * (0.5e-3 - 0.2e-3 * (0.628 * time_s).sin());
                    bench.film.set_reference(reference_m as f32);
                    bench.tick(|_| ());
                }
                let furthest_m = bench.film.furthest_m;
                println!("{lie}, {order:?}, {force_scale}: {:?}, {furthest_m:.3e} m", bench.state());
                assert!(furthest_m < 1.05e-3, "{lie}, {order:?}, {force_scale}: {furthest_m} m");
                let trips = bench.state() == DriverState::Tripped(Cause::ModelDisplacement);
                assert!(lie > 0.0 || trips, "{lie}, {force_scale}");
            }
        }
    }
}

/// Values that leave no room for the tone, or that the film as a sensor is too slow for, are refused with what they must be.
#[test]
fn parameters_without_room_for_the_tone_are_refused() {
    type Spoil = fn(&mut Parameters);
    let needs: [(&str, Spoil); 11] = [
        ("rate_hz", |p| p.rate_hz = 999.0),
        ("rate_hz", |p| p.rate_hz = 1001.0),
        ("limits.max_slew_v_per_s", |p| p.limits.max_slew_v_per_s = 78e3),
        ("limits.monitor.slew_v_per_s", |p| p.limits.monitor.slew_v_per_s = 78e3),
        ("limits.max_voltage_v", |p| {
            (p.limits.max_voltage_v, p.limits.monitor.band_v, p.limits.max_slew_v_per_s) = (199.0, 10.0, 100e3);
        }),
        ("limits.max_field_v_per_m", |p| p.limits.max_field_v_per_m = 1.25e6),
        ("limits.sensor.jump", |p| p.control.max_velocity_m_per_s = 0.021),
        ("control.sample_interval_s", |p| p.control.sample_interval_s = 0.019),
        ("control.lost_after_s", |p| p.control.lost_after_s = 0.099),
        ("amplifier_lag", |p| p.amplifier_lag.rise_s = 1e-3),
        ("control.bandwidth_hz", |p| p.control.bandwidth_hz = 1.7),
    ];
    for (name, spoil) in needs {
        let mut parameters = sensed_parameters();
        spoil(&mut parameters);
        let refused = Blob::with_converters(parameters, &CONVERTERS).err();
        let found = matches!(refused, Some(BlobError::SelfSensingNeeds { quantity, value, limit, .. })
            if quantity == name && value != limit);
        assert!(found, "{name}: {refused:?}");
    }
    // Three blocks and a tick may take a tenth of a second: 12 n + 1 ticks.
    for (rate_hz, most) in [(249.0, 1), (250.0, 2), (333.0, 2), (500.0, 4), (1000.0, 8), (2410.0, 20)] {
        assert_eq!(SelfSensor::max_periods(1.0 / rate_hz), most, "{rate_hz} Hz");
        for periods in [most.max(2), most + 1] {
            let mut parameters = sensed_parameters();
            let (step_s, ticks) = (1.0 / rate_hz, f64::from(4 * periods));
            let options = SelfSensingOptions { periods, step_s, ..sensor(&relation()).options() };
            let current = sensor(&relation()).current().clone();
            parameters.self_sensing = Some(SelfSensor::new(&relation(), options, current).expect("valid"));
            parameters.rate_hz = rate_hz as f32;
            parameters.limits.max_slew_v_per_s = 1e6;
            parameters.limits.monitor.slew_v_per_s = 1e6;
            parameters.limits.sensor.stuck_ticks = 1000;
            let control = &mut parameters.control;
            control.sample_interval_s = (step_s * ticks) as f32;
            control.delay_s = (step_s * (0.5 * ticks + 4.0)) as f32;
            (control.max_velocity_m_per_s, control.bandwidth_hz, control.lost_after_s) = (0.008, 0.3, 0.3);
            let refused = Blob::with_converters(parameters, &CONVERTERS).err().map(|error| error.to_string());
            let taken_s = step_s * (3.0 * ticks + 1.0);
            let reason = format!(
                "three blocks of self-sensing and a tick take {taken_s:.3} s with {periods} periods at {rate_hz} Hz, 0.1 s at the most: use \
                 fewer periods, or a higher rate_hz"
            );
            assert_eq!(refused, (periods > most).then_some(reason), "{periods} periods at {rate_hz} Hz");
        }
    }
    let cable = CapacitanceRelation { rest_f: 90e-12, max_f: 120e-12, ..relation() };
    let other = sensor(&relation());
    assert_eq!(other.relation().rest_f, f64::from(700e-12f32));
    let refused = SelfSensor::new(&cable, other.options(), other.current().clone());
    assert!(matches!(refused, Err(SelfSensingError::Cable { .. })), "{refused:?}");
}

/// A board without a monitor of the current refuses such parameters when they are uploaded, and says why; the old ones stay.
#[test]
fn a_board_without_a_current_monitor_says_so() {
    assert_eq!(Blob::new(sensed_parameters()).err(), Some(BlobError::NoCurrent));
    let mut host = Host::with_parameters();
    let before = host.ask(Command::Query);
    let store = Store::with_converters(RamFlash::default(), BOARD, Converters::AD5754_ADS868X);
    host.bench.store = store.expect("two sectors");
    assert_eq!(host.commit(&encoded(&sensed_parameters(), BOARD)), Answer::Rejected(Reject::Current));
    assert_eq!(host.ask(Command::Query), before);
}

/// Self-sensing is a part of a blob, beside the others; without it the bytes are what they were.
#[test]
fn a_blob_carries_self_sensing() {
    let sent = Parameters { self_test_above_v: 1e3, ..sensed_parameters() };
    let bytes = encoded(&sent, BOARD);
    assert_eq!(Blob::decode(&bytes, BOARD).expect("valid").parameters(), &sent);
    let plain = encoded(&Parameters { self_sensing: None, ..sent.clone() }, BOARD);
    assert_eq!(plain[5] | 8, bytes[5]);
    assert_eq!(plain[10..plain.len() - 4], bytes[10..plain.len() - 4]);
    // Damage that the checksum does not show: a section that ends early, and a number that no springpot has.
    for (place, value) in [(plain.len() - 4 + 3, 0xff), (bytes.len() - 4 - 13 - 1, 0xff)] {
        let mut damaged = bytes[..bytes.len() - 4].to_vec();
        damaged[place] = value;
        assert!(Blob::decode(&sealed(&damaged), BOARD).is_err(), "byte {place}");
    }
    assert!(bytes.len() <= BLOB_LEN && board_parameters().self_sensing.is_none());
}
