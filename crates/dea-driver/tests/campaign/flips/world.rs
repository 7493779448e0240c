//! A board with its host, its amplifier and its film, in whose memory a bit flips.

use dea_driver::chips::DacCode;
use dea_driver::server::Session;
use dea_driver::wire::{Answer, Command, LearningOrder, Message, Request};
use dea_driver::{
    Blob, Cause, Controller, Device, Drive, DriverState, Inputs, Mode, OnSensorFault, Parameters, RamFlash,
};

use crate::bench::{board_parameters, encoded};
use crate::board::{BOARD, Bench, frame, inspection};
use crate::circuit::{Circuit, sensed_parameters};
use crate::film::{Film, ModelFilm};
use crate::stack;

const MAX_V: f32 = 4000.0;
const STROKE_M: f32 = 1.2e-3;
/// Ticks within which a case has to end.
pub const ENDS: u32 = 900;
/// Voltage above the monitor's limit, longest, ticks.
const MAX_ABOVE: u32 = 25;

/// Activity of the controller when a bit flips.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Doing {
    Runs(Mode),
    /// Tracking, with the film as its own sensor beside the other one.
    Senses,
    Armed,
    Disarmed,
    Tripped,
}

impl Doing {
    fn mode(self) -> Option<Mode> {
        match self {
            Self::Runs(mode) => Some(mode),
            Self::Senses => Some(Mode::Tracking),
            _ => None,
        }
    }
}

pub const DOINGS: [Doing; 8] = [
    Doing::Runs(Mode::Voltage),
    Doing::Runs(Mode::Feedforward),
    Doing::Runs(Mode::Tracking),
    Doing::Runs(Mode::Tracking),
    Doing::Senses,
    Doing::Armed,
    Doing::Disarmed,
    Doing::Tripped,
];

/// An event that has to end at 0 V, with the ticks that it may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    Interlock,
    Silence,
    Monitor,
    Amplifier,
    Sensor,
    Disarm,
    /// The sensor freezes, but for its noise, and the host plays a voltage beyond the stroke, or references up to its end.
    Overdriven,
}

pub const EVENTS: [(Event, u32); 7] = [
    (Event::Interlock, 2),
    (Event::Silence, 502),
    (Event::Monitor, 60),
    (Event::Amplifier, 60),
    (Event::Sensor, 2),
    (Event::Disarm, 2),
    (Event::Overdriven, ENDS),
];

#[derive(Clone)]
pub struct World {
    pub bench: Bench,
    session: Session,
    film: Film,
    circuit: Circuit,
    current_adc_v: Option<f32>,
    pub film_v: f64,
    displacement_m: f64,
    shown_m: f64,
    pub drive: Drive,
    pub event: Option<Event>,
    doing: Doing,
    token: u16,
    sequence: u32,
    tick: u32,
    above: u32,
    pub danger: Option<&'static str>,
}

fn parameters(doing: Doing) -> Parameters {
    let mut parameters = if doing == Doing::Senses { sensed_parameters() } else { board_parameters() };
    let limits = &mut parameters.limits;
    (limits.max_voltage_v, limits.max_displacement_m, limits.on_sensor_fault) = (MAX_V, STROKE_M, OnSensorFault::Trip);
    (limits.sensor.low, limits.sensor.high) = (-0.5e-3, 3e-3);
    parameters.control.harmonics = 2;
    parameters
}

impl World {
    /// As it is before a bit flips.
    pub fn new(doing: Doing) -> Self {
        let mut bench = Bench::new(RamFlash::default(), None);
        let blob: Blob = Blob::decode(&encoded(&parameters(doing), BOARD), BOARD).expect("valid");
        bench.device.install(Controller::new(blob)).expect("disabled");
        let mut world = Self {
            bench,
            session: Session::new("1.2.3"),
            film: Film::Model(ModelFilm::new(1.0, 1.03)),
            circuit: Circuit::new(9),
            current_adc_v: None,
            film_v: 0.0,
            displacement_m: 0.0,
            shown_m: 0.0,
            drive: Drive::OFF,
            event: None,
            doing: Doing::Disarmed,
            token: 0,
            sequence: 0,
            tick: 0,
            above: 0,
            danger: None,
        };
        (0..600).for_each(|_| world.advance(None));
        if doing != Doing::Disarmed {
            let Answer::Armed { token } = world.ask(Command::Arm) else { panic!("refused") };
            world.token = token;
        }
        if let Some(mode) = doing.mode() {
            assert_eq!(world.ask(Command::Start(mode)), Answer::Done);
            if mode == Mode::Feedforward {
                assert_eq!(world.ask(Command::Learning(LearningOrder::Forget)), Answer::Done);
            }
        }
        world.doing = doing;
        if doing == Doing::Tripped {
            world.bench.device.trip(Cause::Overrun);
        }
        (0..1500).for_each(|_| world.advance(None));
        let expected = match doing {
            Doing::Runs(_) | Doing::Senses => DriverState::Running,
            Doing::Armed => DriverState::Armed,
            Doing::Disarmed => DriverState::Disarmed,
            Doing::Tripped => DriverState::Tripped(Cause::Overrun),
        };
        assert_eq!(world.state(), expected, "{doing:?}");
        world
    }

    pub fn state(&self) -> DriverState {
        self.bench.device.state()
    }

    pub fn ask(&mut self, command: Command) -> Answer {
        self.sequence = self.sequence.wrapping_add(1);
        let request = frame(&Request { sequence: self.sequence, token: self.token, command });
        let mut answer = None;
        self.session.turn(request.into_iter(), &mut self.bench, |message| {
            if let Message::Answer { answer: found, .. } = message {
                answer = Some(found.clone());
            }
        });
        answer.unwrap_or(Answer::Done)
    }

    /// A millisecond, with a bit that flips on the stack of its tick.
    pub fn advance(&mut self, flip: Option<stack::Flip>) {
        self.tick += 1;
        let seconds = f64::from(self.tick) * 1e-3;
        let noise = f64::from(self.tick % 7) * 1e-6;
        if self.event != Some(Event::Overdriven) {
            self.shown_m = self.displacement_m;
        }
        let sensor_v = 1.0 + 1e3 * (self.shown_m + noise);
        let sensor_v = if self.event == Some(Event::Sensor) { 0.0 } else { sensor_v as f32 };
        let monitor_v = if self.event == Some(Event::Monitor) { 0.0 } else { self.film_v as f32 };
        let inputs = Inputs {
            interlock_closed: self.event != Some(Event::Interlock),
            monitor_adc_v: Some(monitor_v / 1000.0),
            sensor_adc_v: Some(sensor_v),
        };
        let was_enabled = self.drive.enable;
        let device = &mut self.bench.device;
        device.note_current(self.current_adc_v);
        let (drive, code) = match flip {
            Some(flip) => {
                // An address that has flipped may lead into the film, which is in no memory of a controller.
                let film = Box::new((self.film.clone(), self.film_v, self.displacement_m, self.shown_m));
                let circuit = Box::new(self.circuit.clone());
                // Nor into what judges it, which is not beside the tick on the stack.
                let rest = Box::new((self.event, self.doing, self.tick, self.above, self.danger));
                let done = stack::with_flip(flip, || tick(device, inputs));
                (self.film, self.film_v, self.displacement_m, self.shown_m) = *film;
                self.circuit = *circuit;
                (self.event, self.doing, self.tick, self.above, self.danger) = *rest;
                done
            }
            None => tick(device, inputs),
        };
        device.report(inspection(inputs.interlock_closed, was_enabled));
        self.drive = drive;
        // The amplifier follows at once, and falls at once.
        let gain = if self.event == Some(Event::Amplifier) { 1600.0 } else { 1000.0 };
        self.film_v = if drive.enable { gain * f64::from(code.volts(drive.range)) } else { 0.0 };
        self.displacement_m = self.film.step(self.film_v);
        self.current_adc_v = Some(self.circuit.tick(self.film_v, self.displacement_m));
        // The host.
        let swing = (1.0 - (std::f64::consts::TAU * 0.5 * seconds).cos()) as f32 / 2.0;
        if self.tick.is_multiple_of(10) && self.event != Some(Event::Silence) {
            let command = match self.doing {
                Doing::Runs(Mode::Voltage) if self.event == Some(Event::Overdriven) => Command::SetVoltage(MAX_V),
                Doing::Runs(_) | Doing::Senses if self.event == Some(Event::Overdriven) => {
                    Command::SetReference(0.99 * STROKE_M)
                }
                Doing::Runs(Mode::Voltage) => Command::SetVoltage(800.0 + 2000.0 * swing),
                Doing::Runs(_) | Doing::Senses => Command::SetReference(0.2e-3 + 0.5e-3 * swing),
                _ => Command::Heartbeat,
            };
            self.ask(command);
        } else {
            self.session.turn(core::iter::empty(), &mut self.bench, |_| ());
        }
        self.judge();
    }

    /// Notes a film in danger, whatever the driver knows.
    fn judge(&mut self) {
        let limit_v = f64::from(MAX_V) * 1.03 + 60.0;
        let is_above = self.film_v > limit_v && self.event != Some(Event::Amplifier);
        self.above = if is_above { self.above + 1 } else { 0 };
        if self.above > MAX_ABOVE {
            self.danger = self.danger.or(Some("above the limit of the monitor"));
        }
        if self.displacement_m.abs() > 1.1 * f64::from(STROKE_M) {
            self.danger = self.danger.or(Some("beyond 1.1 times the stroke"));
        }
        if self.film_v > 60.0 && matches!(self.doing, Doing::Disarmed | Doing::Tripped) {
            self.danger = self.danger.or(Some("live without a run"));
        }
    }
}

/// As the firmware has it: a tick, and the code for the DAC.
#[inline(never)]
pub fn tick(device: &mut Device, inputs: Inputs) -> (Drive, DacCode) {
    let drive = device.tick(inputs);
    (drive, DacCode::from_volts(drive.dac_v, drive.range))
}
