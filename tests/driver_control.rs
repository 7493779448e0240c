//! The control tick around a simulated film, and the loop test.

use dea_driver::chips::{AdcCode, Calibration, DacCode};
use dea_driver::wire::{Answer, BATCH, Command, Mode, Reject, Target};
use dea_driver::{Blob, Cause, Controller, Inputs, OnSensorFault, Outputs, Parameters, Refusal, SensorFault, State};
use springpot::{
    Actuator, Applied, CommandLimits, Law, Limited, ObserverOptions, Options, Preset, Sample, Tracking, VoltageDrive,
};
use tests::{board_parameters, paper_force};

/// A bench around a controller: an amplifier of 1000:1, a sensor of 1 mm/V at 1 V, and the model itself as film, or one that
/// is pulled less.
struct Bench {
    controller: Controller,
    parameters: Parameters,
    film: springpot::State<f64>,
    law: Law<f64>,
    drive: VoltageDrive<f64>,
    high_voltage_v: f64,
    displacement_m: f64,
    noise: u32,
    /// Electrostatic force in units of what the model takes it for.
    force_scale: f64,
}

/// The sensor reads 1 V of a film at rest, so that both ways are in its range.
fn parameters() -> Parameters {
    let mut parameters = board_parameters();
    parameters.sensor = Calibration { offset: -1e-3, gain: 1e-3, quadratic: 0.0 };
    parameters
}

impl Bench {
    fn new() -> Self {
        let parameters = parameters();
        let model = Preset::named("table3-n2").expect("a preset").model().expect("valid");
        let law: Law<f64> = Law::compressed(&model, Options::at_step(1e-3)).expect("valid");
        let drive = VoltageDrive::new(&Actuator::KARNER_2022, 6500.0, law.stiffness()).expect("valid");
        let controller = Controller::new(Blob::new(parameters.clone()).expect("valid"));
        let film = law.state();
        Self {
            controller,
            parameters,
            film,
            law,
            drive,
            high_voltage_v: 0.0,
            displacement_m: 0.0,
            noise: 1,
            force_scale: 1.0,
        }
    }

    fn inputs(&mut self) -> Inputs {
        self.noise = self.noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = f64::from(self.noise >> 16) / 65_536.0 * 5e-6;
        let adc = |volts: f64| AdcCode((volts / 10.24 * 65_536.0) as u16);
        Inputs {
            interlock_closed: true,
            monitor: Some(adc(self.high_voltage_v / 1000.0)),
            displacement: Some(adc(1.0 + (self.displacement_m + noise) / 1e-3)),
        }
    }

    fn tick(&mut self, spoil: impl FnOnce(&mut Inputs)) -> Outputs {
        let mut inputs = self.inputs();
        spoil(&mut inputs);
        let outputs = self.controller.tick(inputs);
        let volts = f64::from(outputs.command.volts(self.parameters.command_range)) * 1000.0;
        self.high_voltage_v = if outputs.enable { volts } else { 0.0 };
        let load = self.drive.load(self.high_voltage_v * self.force_scale.sqrt());
        self.displacement_m = self.law.displacement_under(&mut self.film, load);
        outputs
    }

    fn obey(&mut self, command: Command) -> Answer {
        self.controller.obey(&command).expect("the controller's")
    }

    fn start(&mut self, mode: Mode) {
        self.tick(|_| ());
        assert_eq!(self.obey(Command::Arm), Answer::Done);
        assert_eq!(self.obey(Command::Start(mode)), Answer::Done);
    }
}

#[test]
fn follows_the_voltage_that_was_set_and_observes() {
    let mut bench = Bench::new();
    bench.start(Mode::Voltage);
    assert_eq!(bench.obey(Command::SetVoltage(4000.0)), Answer::Done);
    let mut outputs = bench.tick(|_| ());
    for tick in 0..3000 {
        if tick % 100 == 0 {
            assert_eq!(bench.obey(Command::Heartbeat), Answer::Done);
        }
        outputs = bench.tick(|_| ());
    }
    assert_eq!(bench.controller.supervisor().state(), State::Running);
    assert_eq!(outputs.command, DacCode(26_214), "4 V of 10 V");
    // The estimate is where the film is, to the sensor's noise of 0…5 µm.
    let predicted = f64::from(outputs.sample.predicted_m);
    assert!((predicted - bench.displacement_m).abs() < 5e-6, "{predicted} m for {} m", bench.displacement_m);
    assert!((f64::from(outputs.sample.displacement_m) - bench.displacement_m).abs() < 10e-6);
    assert_eq!(outputs.sample.tick, 3002);
}

/// Feedforward brings a film that the model knows to its reference, and holds it there while it creeps.
#[test]
fn feedforward_holds_a_creeping_film() {
    let mut bench = Bench::new();
    bench.start(Mode::Feedforward);
    assert_eq!(bench.obey(Command::SetReference(0.8e-3)), Answer::Done);
    let mut voltages = Vec::new();
    for tick in 0..20_000 {
        if tick % 100 == 0 {
            bench.obey(Command::Heartbeat);
        }
        let outputs = bench.tick(|_| ());
        if tick > 1000 {
            voltages.push(outputs.sample.command_v);
            assert!((bench.displacement_m - 0.8e-3).abs() < 2e-6, "tick {tick}: {} m", bench.displacement_m);
        }
    }
    // What holds it sinks, because the film creeps.
    assert!(voltages[voltages.len() - 1] < 0.9 * voltages[0]);
}

/// A film that is pulled a tenth less than the model says: feedforward is off by as much, tracking finds it out.
#[test]
fn tracking_follows_a_film_that_the_model_does_not_know() {
    let off = |mode| {
        let mut bench = Bench { force_scale: 0.9, ..Bench::new() };
        bench.start(mode);
        let mut largest = 0.0f64;
        for tick in 0..20_000 {
            // Up within two seconds, then swinging, slowly enough for the bandwidth.
            let time_s = f64::from(tick) / 1000.0;
            let reference = 0.8e-3 * (time_s / 2.0).min(1.0) - 0.1e-3 * (0.6 * time_s).sin();
            assert_eq!(bench.obey(Command::SetReference(reference as f32)), Answer::Done);
            bench.tick(|_| ());
            if tick > 10_000 {
                largest = largest.max((bench.displacement_m - reference).abs());
            }
        }
        assert_eq!(bench.controller.supervisor().state(), State::Running);
        (largest, bench.tick(|_| ()).sample)
    };
    let (feedforward, _) = off(Mode::Feedforward);
    let (tracking, sample) = off(Mode::Tracking);
    println!("off by {:.1} µm, with the sensor {:.1} µm; {sample:?}", 1e6 * feedforward, 1e6 * tracking);
    assert!(feedforward > 60e-6 && tracking < 8e-6);
    // Where the film is swinging, the log tells by how much it is pulled less.
    assert!((sample.force_scale - 0.9).abs() < 0.05 && sample.limited == 0);
}

/// With a sensor that may fail, tracking goes on without it, and comes back to it, without a jump.
#[test]
fn tracking_goes_on_without_its_sensor() {
    let mut parameters = parameters();
    parameters.limits.on_sensor_fault = OnSensorFault::OpenLoop;
    let controller = Controller::new(Blob::new(parameters.clone()).expect("valid"));
    let mut bench = Bench { parameters, controller, force_scale: 0.95, ..Bench::new() };
    bench.start(Mode::Tracking);
    assert_eq!(bench.obey(Command::SetReference(0.8e-3)), Answer::Done);
    let mut before = None;
    for tick in 0..20_000 {
        bench.obey(Command::Heartbeat);
        let unplugged = (10_000..15_000).contains(&tick);
        let outputs = bench.tick(|inputs| {
            if unplugged {
                inputs.displacement = Some(AdcCode(u16::MAX));
            }
        });
        assert_eq!(bench.controller.supervisor().state(), State::Running, "tick {tick}");
        if tick > 5000 {
            assert!((bench.displacement_m - 0.8e-3).abs() < 15e-6, "tick {tick}: {} m", bench.displacement_m);
            let step = before.map_or(0.0, |before: f32| (outputs.sample.command_v - before).abs());
            assert!(step < 5.0, "tick {tick}: {step} V in a tick, of 50 allowed");
        }
        before = Some(outputs.sample.command_v);
    }
}

/// What a sensor reads that is not believed does not move the voltage either.
#[test]
fn a_sensor_that_is_not_believed_does_not_limit_the_field() {
    let mut parameters = parameters();
    parameters.limits.on_sensor_fault = OnSensorFault::OpenLoop;
    parameters.limits.max_field_v_per_m = 3e7;
    parameters.actuator.stretch_coupling = 29.0;
    let controller = Controller::new(Blob::new(parameters.clone()).expect("valid"));
    let mut bench = Bench { parameters, controller, ..Bench::new() };
    bench.start(Mode::Voltage);
    bench.obey(Command::SetVoltage(4500.0));
    for _ in 0..300 {
        bench.obey(Command::Heartbeat);
        bench.tick(|_| ());
    }
    let before = bench.tick(|_| ()).sample.command_v;
    // 4.8 kV at rest; at the 9 mm that it reads it would be 3.8 kV.
    let after = bench.tick(|inputs| inputs.displacement = Some(AdcCode(u16::MAX))).sample.command_v;
    assert!(before > 4300.0 && (after - before).abs() < 5.0, "{before} V, then {after} V");
}

/// The model feels the voltage that stood until the trip, in the tick that trips.
#[test]
fn the_model_feels_the_last_tick_before_a_trip() {
    let predicted = |trips: bool| {
        let mut bench = Bench::new();
        bench.start(Mode::Feedforward);
        bench.obey(Command::SetReference(0.8e-3));
        for _ in 0..300 {
            bench.tick(|_| ());
        }
        bench.tick(|inputs| inputs.interlock_closed = !trips).sample.predicted_m
    };
    assert_eq!(predicted(true).to_bits(), predicted(false).to_bits());
}

/// With parameters for it, the driver needs no displacement sensor at all.
#[test]
fn feedforward_needs_no_sensor() {
    let mut parameters = parameters();
    parameters.limits.on_sensor_fault = OnSensorFault::OpenLoop;
    let controller = Controller::new(Blob::new(parameters.clone()).expect("valid"));
    let mut bench = Bench { parameters, controller, ..Bench::new() };
    bench.tick(|inputs| inputs.displacement = None);
    for command in [Command::Arm, Command::Start(Mode::Feedforward), Command::SetReference(0.8e-3)] {
        assert_eq!(bench.obey(command), Answer::Done);
    }
    for tick in 0..5000 {
        bench.obey(Command::Heartbeat);
        bench.tick(|inputs| inputs.displacement = None);
        assert!(tick < 1000 || (bench.displacement_m - 0.8e-3).abs() < 2e-6, "tick {tick}: {} m", bench.displacement_m);
    }
    assert_eq!(bench.controller.supervisor().state(), State::Running);
}

/// What was set for one run is gone when it ends, however it ends: the next one begins at 0 V.
#[test]
fn targets_do_not_outlive_a_run() {
    let ends: [fn(&mut Bench); 4] = [
        // A trip from elsewhere, between two ticks: an overrun.
        |bench| {
            bench.controller.supervisor_mut().trip(Cause::Overrun);
            bench.tick(|_| ());
            assert_eq!(bench.obey(Command::Acknowledge), Answer::Done);
            bench.tick(|_| ());
            assert_eq!(bench.obey(Command::Arm), Answer::Done);
        },
        |bench| assert_eq!(bench.obey(Command::Stop), Answer::Done),
        |bench| {
            assert_eq!(bench.obey(Command::Disarm), Answer::Done);
            // The monitor must have seen 0 V.
            bench.tick(|_| ());
            bench.tick(|_| ());
            assert_eq!(bench.obey(Command::Arm), Answer::Done);
        },
        |bench| {
            bench.tick(|inputs| inputs.interlock_closed = false);
            assert_eq!(bench.obey(Command::Acknowledge), Answer::Done);
            bench.tick(|_| ());
            assert_eq!(bench.obey(Command::Arm), Answer::Done);
        },
    ];
    for mode in [Mode::Voltage, Mode::Feedforward] {
        for end in ends {
            let mut bench = Bench::new();
            bench.start(mode);
            bench.obey(Command::SetVoltage(4000.0));
            bench.obey(Command::SetReference(0.8e-3));
            for _ in 0..300 {
                bench.tick(|_| ());
            }
            assert!(bench.high_voltage_v > 2000.0, "{mode:?}");
            end(&mut bench);
            for _ in 0..100 {
                bench.obey(Command::Heartbeat);
                bench.tick(|_| ());
            }
            assert_eq!(bench.obey(Command::Start(mode)), Answer::Done);
            let largest = (0..300).fold(0.0f32, |largest, _| largest.max(bench.tick(|_| ()).sample.command_v));
            // A film that still creeps back is held where it is, which takes little.
            assert!(largest < if mode == Mode::Voltage { 1.0 } else { 1500.0 }, "{mode:?}: {largest} V");
        }
    }
}

/// Values that come a hundred times a second are joined by straight lines, not by stairs.
#[test]
fn references_are_joined_by_lines() {
    let mut bench = Bench::new();
    bench.start(Mode::Feedforward);
    let mut last = 0.0f32;
    for tick in 0..2000 {
        if tick % 10 == 0 {
            // 0.4 mm/s: 4 µm from one value to the next.
            assert_eq!(bench.obey(Command::SetReference(0.4e-6 * tick as f32)), Answer::Done);
        }
        let reference_m = bench.tick(|_| ()).sample.reference_m;
        let step = reference_m - last;
        assert!(tick < 100 || (0.35e-6..0.45e-6).contains(&step), "tick {tick}: {step} m");
        last = reference_m;
    }
}

/// Following begins where the film is, whatever was asked for before.
#[test]
fn following_begins_without_a_jump() {
    let mut bench = Bench::new();
    bench.start(Mode::Voltage);
    bench.obey(Command::SetVoltage(4000.0));
    for _ in 0..1000 {
        bench.obey(Command::Heartbeat);
        bench.tick(|_| ());
    }
    // It was stretched, and is still creeping back when it is asked to go on.
    assert_eq!(bench.obey(Command::Stop), Answer::Done);
    for _ in 0..200 {
        bench.obey(Command::Heartbeat);
        bench.tick(|_| ());
    }
    let (from, increment) = (bench.displacement_m, 0.05 / 1000.0);
    assert_eq!(bench.obey(Command::Start(Mode::Feedforward)), Answer::Done);
    assert_eq!(bench.obey(Command::SetReference(2e-3)), Answer::Done);
    let first = bench.tick(|_| ()).sample;
    assert!((f64::from(first.reference_m) - from).abs() <= 1.01 * increment, "{} m after {from} m", first.reference_m);
    assert!(Limited::ALL.iter().any(|(limit, _)| u32::from(limit.bits()) & u32::from(first.limited) != 0));
}

#[test]
fn faults_end_at_0_v_within_the_tick() {
    type Spoil = fn(&mut Inputs);
    let faults: [(Cause, Spoil); 5] = [
        (Cause::Interlock, |inputs| inputs.interlock_closed = false),
        (Cause::Bus, |inputs| inputs.monitor = None),
        (Cause::Sensor(SensorFault::Range), |inputs| inputs.displacement = None),
        (Cause::Sensor(SensorFault::Range), |inputs| inputs.displacement = Some(AdcCode(u16::MAX))),
        (Cause::Voltage, |inputs| inputs.monitor = Some(AdcCode(u16::MAX))),
    ];
    for (cause, spoil) in faults {
        let mut bench = Bench::new();
        bench.start(Mode::Voltage);
        bench.obey(Command::SetVoltage(5000.0));
        for _ in 0..200 {
            bench.tick(|_| ());
        }
        assert!(bench.high_voltage_v > 4900.0);
        let outputs = bench.tick(spoil);
        assert_eq!(
            (outputs.enable, outputs.command, outputs.sample.command_v),
            (false, DacCode::ZERO, 0.0),
            "{cause:?}"
        );
        assert_eq!(bench.controller.supervisor().state(), State::Tripped(cause));
        assert_eq!(bench.obey(Command::Arm), Answer::Refused(Refusal::State(State::Tripped(cause))));
    }
}

#[test]
fn values_that_make_no_sense_are_rejected() {
    let mut bench = Bench::new();
    // 6500 V, and the monitor's band of 60 V and 3 %.
    for volts in [-1.0, f32::NAN, f32::INFINITY, 6756.0] {
        assert_eq!(bench.obey(Command::SetVoltage(volts)), Answer::Rejected(Reject::Value), "{volts} V");
    }
    for metres in [f32::NAN, f32::INFINITY, 8.1e-3, -8.1e-3] {
        assert_eq!(bench.obey(Command::SetReference(metres)), Answer::Rejected(Reject::Value), "{metres} m");
    }
    assert_eq!(bench.controller.obey(&Command::Identify), None, "the board's, not the controller's");
}

/// The loop test steps a model of its own, bit for bit the one that `host-sim` runs.
#[test]
fn the_loop_test_is_the_law_itself() {
    let mut bench = Bench::new();
    let model = Preset::named("table3-n2").expect("a preset").model().expect("valid");
    let law: Law<f32> = Law::compressed(&model, Options::at_step(1.0 / f64::from(1000f32))).expect("valid");
    let drive = VoltageDrive::new(&Actuator::KARNER_2022, 6500.0, law.stiffness()).expect("valid");
    let voltages: Vec<f32> = paper_force(0.2, 10.0, 1000.0).iter().map(|f| (f / 140.45 * 6000.0) as f32).collect();
    for _ in 0..2 {
        assert_eq!(bench.obey(Command::Rest), Answer::Done);
        let mut film = law.state();
        for batch in voltages.chunks(BATCH) {
            let Answer::Steps { steps, .. } = bench.obey(Command::Step(batch.iter().copied().collect())) else {
                panic!("no steps");
            };
            // Ticks in between do not disturb it.
            bench.tick(|_| ());
            for (step, &volts) in steps.iter().zip(batch) {
                let load = drive.load(volts);
                let x = law.displacement_under(&mut film, load);
                assert_eq!(step.displacement_m.to_bits(), x.to_bits());
                assert_eq!(step.force_n.to_bits(), film.base_force().to_bits());
                assert!((step.voltage_v - volts).abs() < 0.01);
            }
        }
    }
    // Not with voltage on the film.
    bench.start(Mode::Voltage);
    assert_eq!(bench.obey(Command::Rest), Answer::Refused(Refusal::State(State::Running)));
    let step = Command::Step([0.0; BATCH].into());
    assert_eq!(bench.obey(step), Answer::Refused(Refusal::State(State::Running)));
}

/// The loop test of the control is `springpot::Tracking` itself, bit for bit, in all three modes.
#[test]
fn the_loop_test_of_the_control_is_the_control_itself() {
    let mut bench = Bench::new();
    let model = Preset::named("table3-n2").expect("a preset").model().expect("valid");
    let law: Law<f32> = Law::compressed(&model, Options::at_step(1e-3)).expect("valid");
    let rest = law.state();
    let limits =
        CommandLimits { max_voltage_v: 6500.0, max_velocity_m_per_s: f64::from(0.05f32), ..CommandLimits::BENCH };
    let options = ObserverOptions {
        bandwidth_hz: f64::from(0.6f32),
        sample_interval_s: f64::from(0.01f32),
        delay_s: f64::from(0.01f32),
        lost_after_s: f64::from(0.05f32),
        adaptation_s: 30.0,
    };
    let limits = CommandLimits { max_field_v_per_m: f64::from(4.2e7f32), ..limits };
    let tracking: Tracking<f32> = Tracking::new(law, &Actuator::KARNER_2022, limits, options).expect("valid");
    for mode in [Mode::Voltage, Mode::Feedforward, Mode::Tracking] {
        assert_eq!(bench.obey(Command::Rest), Answer::Done);
        let mut state = tracking.state(rest.clone());
        let mut voltage = 0.0f32;
        for k in 0..2000u16 {
            let swing = (0.01 * f64::from(k)).sin() as f32;
            let value = if mode == Mode::Voltage { 3000.0 + 2000.0 * swing } else { 0.5e-3 + 0.2e-3 * swing };
            let sample_m = (k % 10 == 0).then_some(0.4e-3 + 0.2e-3 * swing);
            let targets = [Target { value, sample_m }].into_iter().collect();
            let Answer::Followed { ticks, .. } = bench.obey(Command::Follow { mode, targets }) else {
                panic!("no ticks")
            };

            if mode == Mode::Voltage {
                voltage = value;
            }
            let sample = sample_m.filter(|_| mode != Mode::Feedforward);
            let sample = sample.map(|displacement| Sample { displacement, age_ticks: 10 });
            let x = tracking.observe(&mut state, Applied::as_commanded(voltage), sample);
            let command = tracking.command(&mut state, if mode == Mode::Voltage { x } else { value });
            if mode != Mode::Voltage {
                voltage = command.voltage;
            }
            assert_eq!(ticks[0].voltage_v.to_bits(), voltage.to_bits(), "{mode:?}, tick {k}");
            assert_eq!(ticks[0].displacement_m.to_bits(), x.to_bits());
            assert_eq!(ticks[0].disturbance_n.to_bits(), state.observer().disturbance().to_bits());
        }
    }
}
