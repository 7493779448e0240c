//! Promises of `docs/safety.md` on every board: controller, bench and converters together, at the registers of the chip, with a perfect amplifier
//! and a sensor that rests.

use board_on_host::board::Board;
#[cfg(feature = "self-sensing")]
use board_on_host::film::Film;
use dea_driver::chips::Calibration;
#[cfg(feature = "self-sensing")]
use dea_driver::chips::Converters;
use dea_driver::{
    BLOB_LEN, Blob, Cause, Controller, Device, DriverState, Limits, Mode, Parameters, PlausibilityLimits, SensorFault,
};
use springpot::{Actuator, Law, LawOptions, Preset};

use super::kinds::{Kind, SET_UP, Ticks, board_of, is_enabled, on_every_board};
use super::start::Core;

/// The parameters of a bench like the paper's at the converters of a board.
pub fn parameters<K: Kind>() -> Parameters {
    let model = Preset::TABLE3_N2.model().expect("valid");
    let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(1e-3)).expect("valid");
    let sensor = PlausibilityLimits { low: -0.5e-3, high: 8e-3, jump: 0.5e-3, stuck_ticks: 100, stuck_band: 6e-6 };
    Parameters {
        amplifier: Calibration::linear(K::GAIN),
        monitor: Calibration::linear(K::GAIN),
        sensor: K::SENSOR,
        limits: Limits { max_displacement_m: 6e-3, sensor, ..Limits::bench(160e-6) },
        ..Parameters::bench(&law, Actuator::KARNER_2022)
    }
}

pub struct Running<K: Kind> {
    pub board: Board,
    pub kind: K,
    bench: K::Bench,
    pub device: Device,
    /// A film in its circuit, instead of a perfect amplifier and a sensor that rests, and an output of the current monitor that replaces that of it, V.
    #[cfg(feature = "self-sensing")]
    pub film: Option<Film>,
    #[cfg(feature = "self-sensing")]
    pub current_v: Option<f64>,
    /// Readings that a fault replaces, V.
    pub monitor_v: Option<f64>,
    pub sensor_v: Option<f64>,
    /// The sensor's output, V.
    shown_v: f64,
    ticks: u32,
}

impl<K: Kind> Running<K> {
    /// A board that has been switched on, with the interlock closed.
    fn new() -> Self {
        Self::with(&parameters::<K>())
    }

    /// The same with these parameters.
    pub fn with(parameters: &Parameters) -> Self {
        let (board, kind) = board_of::<K>();
        let bench = K::start(&board, Core::Crystal);
        let mut device = Device::new(None);
        // A host encodes for the board's number, the board checks by its own converters.
        let mut bytes = [0; BLOB_LEN];
        let length = parameters.encode(K::ID, &mut bytes).expect("kept by these converters");
        #[cfg(feature = "self-sensing")]
        let converters = Converters { current_v: Some(K::CURRENT_V), ..K::CONVERTERS };
        #[cfg(not(feature = "self-sensing"))]
        let converters = K::CONVERTERS;
        let blob = Blob::decode_for(&bytes[..length], K::ID, &converters).expect("as the host checked");
        device.install(Controller::new(blob)).expect("disarmed");
        let mut running = Self {
            board,
            kind,
            bench,
            device,
            #[cfg(feature = "self-sensing")]
            film: None,
            #[cfg(feature = "self-sensing")]
            current_v: None,
            monitor_v: None,
            sensor_v: None,
            shown_v: 0.0,
            ticks: 0,
        };
        running.interlock(Some(true));
        (0..2 * SET_UP).for_each(|_| running.tick());
        running
    }

    fn interlock(&self, level: Option<bool>) {
        self.board.chip(|chip| chip.connect(K::INTERLOCK, level));
    }

    /// The same at 3 kV.
    fn at_3_kv() -> Self {
        let mut running = Self::new();
        running.device.arm().expect("healthy");
        running.device.start(Mode::Voltage).expect("armed");
        running.device.set_voltage(3000.0).expect("within the limits");
        (0..80).for_each(|_| running.tick());
        assert_eq!(running.device.state(), DriverState::Running, "{}", K::NAME);
        assert!((running.film_v() - 3000.0).abs() < 0.02 * 3000.0, "{}: {} V", K::NAME, running.film_v());
        running
    }

    /// At the film of a perfect amplifier, V.
    pub fn film_v(&self) -> f64 {
        let enabled = is_enabled::<K>(&self.board);
        if enabled { f64::from(K::GAIN) * self.kind.command_v(&self.board) } else { 0.0 }
    }

    /// A tick of the application.
    pub fn tick(&mut self) {
        self.ticks += 1;
        let start = self.board.chip(|chip| chip.now_ns());
        let inputs = self.bench.sample();
        #[cfg(feature = "self-sensing")]
        self.device.note_current(self.bench.current_adc_v(1000.0));
        let drive = self.device.tick(inputs);
        if self.bench.apply(drive).is_err() {
            self.device.trip(Cause::Bus);
        }
        self.device.report(self.bench.inspection());
        self.device.heartbeat();
        #[cfg(feature = "self-sensing")]
        let by_film = self.advance_film();
        self.board.chip(|chip| chip.wait_ns(1_000_000 - (chip.now_ns() - start)));
        // Noise of a sensor at 0.1 V more than an open one has, on a range of 10 V.
        let share = 1000.0 / f64::from(K::GAIN);
        let [monitor_v, sensor_v] = [self.film_v() / f64::from(K::GAIN), share];
        #[cfg(feature = "self-sensing")]
        let [monitor_v, sensor_v] = by_film.unwrap_or([monitor_v, sensor_v]);
        let sensor_v = sensor_v + share * 4e-3 * f64::from(self.ticks % 7);
        self.kind.set_monitor(&self.board, self.monitor_v.unwrap_or(monitor_v));
        self.shown_v = self.sensor_v.unwrap_or(sensor_v);
        self.kind.set_sensor(&self.board, self.shown_v);
    }

    /// Ticks until it has tripped, and the cause.
    pub fn trips(&mut self) -> (u32, Cause) {
        for ticks in 1..=1000 {
            self.tick();
            if let DriverState::Tripped(cause) = self.device.state() {
                assert!(!is_enabled::<K>(&self.board), "{}: {cause:?}, and still enabled", K::NAME);
                assert_eq!(self.film_v(), 0.0, "{}: {cause:?}", K::NAME);
                return (ticks, cause);
            }
        }
        panic!("{}: it never tripped", K::NAME)
    }
}

/// A fault: its name, what it does, the causes that it may have, and the ticks after which it shows at the latest. A converter on a bus answers with
/// the reading of the tick before.
pub type Row<K> = (&'static str, fn(&mut Running<K>), &'static [Cause], u32);

pub fn rows<K: Kind>() -> [Row<K>; 9] {
    const RANGE: &[Cause] = &[Cause::Sensor(SensorFault::Range)];
    let at_supply = |running: &mut Running<K>| running.monitor_v = Some(f64::from(K::CONVERTERS.monitor_v));
    let saturates = |running: &mut Running<K>| running.sensor_v = Some(f64::from(K::CONVERTERS.sensor_v));
    let stuck = |running: &mut Running<K>| running.sensor_v = Some(running.shown_v);
    [
        ("interlock opens", |running| running.interlock(Some(false)), &[Cause::Interlock], 1),
        ("interlock breaks", |running| running.interlock(None), &[Cause::Interlock], 1),
        ("monitor breaks", |running| running.monitor_v = Some(0.0), &[Cause::Monitor], 23),
        ("monitor at a supply", at_supply, &[Cause::Voltage], 3),
        ("sensor breaks", |running| running.sensor_v = Some(0.0), RANGE, 3),
        ("sensor saturates", saturates, RANGE, 3),
        ("sensor at a voltage within its range", stuck, &[Cause::Sensor(SensorFault::Stuck)], 103),
        ("DAC fails", |running| running.kind.fail_dac(&running.board), &[Cause::Bus], 2),
        (
            "ADC of the monitor fails",
            |running| running.kind.fail_monitor(&running.board, true),
            &[Cause::Monitor, Cause::Bus],
            22,
        ),
    ]
}

fn every_fault_ends_at_0_v_on_every_board<K: Kind>() {
    for (name, spoil, causes, latest) in rows::<K>() {
        let mut running = Running::<K>::at_3_kv();
        spoil(&mut running);
        // Readings that are taken at the end of a tick are there from the next one on.
        let (ticks, cause) = running.trips();
        assert!(causes.contains(&cause), "{}, {name}: {cause:?}", K::NAME);
        assert!(ticks <= latest, "{}, {name}: only after {ticks} ticks", K::NAME);
        // It stays so.
        (0..5).for_each(|_| running.tick());
        assert_eq!((running.device.state(), running.film_v()), (DriverState::Tripped(cause), 0.0), "{name}");
    }
}

fn what_fails_before_arming_is_never_enabled<K: Kind>() {
    for (name, spoil, ..) in rows::<K>() {
        // The same value for a while is a fault only then, and a monitor at 0 V is right.
        if matches!(name, "sensor at a voltage within its range" | "monitor breaks") {
            continue;
        }
        let mut running = Running::<K>::new();
        spoil(&mut running);
        (0..25).for_each(|_| running.tick());
        let armed = running.device.arm();
        for _ in 0..5 {
            running.tick();
            assert_eq!(running.film_v(), 0.0, "{}, {name}", K::NAME);
        }
        let tripped = matches!(running.device.state(), DriverState::Tripped(_));
        assert!(armed.is_err() || tripped, "{}, {name}: {:?}", K::NAME, running.device.state());
    }
}

fn a_run_breaks_no_rule_of_the_chip_and_ends_at_0_v<K: Kind>() {
    let mut running = Running::<K>::at_3_kv();
    running.device.stop().expect("running");
    (0..5).for_each(|_| running.tick());
    assert_eq!(running.kind.command_v(&running.board), 0.0, "{}", K::NAME);
    running.device.disarm().expect("at 0 V");
    (0..5).for_each(|_| running.tick());
    assert!(!is_enabled::<K>(&running.board), "{}", K::NAME);
    assert_eq!(running.device.state(), DriverState::Disarmed, "{}", K::NAME);
    running.kind.assert_no_violations(&running.board);
}

on_every_board!(
    every_fault_ends_at_0_v_on_every_board,
    what_fails_before_arming_is_never_enabled,
    a_run_breaks_no_rule_of_the_chip_and_ends_at_0_v
);
