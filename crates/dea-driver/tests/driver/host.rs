//! A host, and a board without hardware that it talks with.

use dea_driver::server::{Board, Session};
use dea_driver::wire::{Answer, CHUNK, Command, Drill, FRAME_LEN, Message, Request, encode};
use dea_driver::{BLOB_LEN, Cause, Device, Drive, DriverState, Inputs, Store};

use crate::bench::board_parameters;
use crate::flash::Flash;

/// A board whose amplifier and monitor follow at once, and whose film stands still.
pub struct Bench {
    pub device: Device,
    pub store: Store<Flash>,
    pub rate_hz: f32,
    pub drive: Drive,
    ticks: u16,
    /// Survives a reset.
    pub trial: bool,
    /// Whether it is an image for drills, and the one that was asked for.
    pub drills: bool,
    pub drilled: Option<Drill>,
}

impl Board for Bench {
    type Flash = Flash;
    const ID: u16 = 7;

    fn with<R>(&mut self, work: impl FnOnce(&mut Device) -> R) -> (R, u32) {
        (work(&mut self.device), 42)
    }

    fn rates_hz(&self) -> (f32, f32) {
        (100.0, 2000.0)
    }

    fn store(&mut self) -> &mut Store<Flash> {
        &mut self.store
    }

    fn set_rate(&mut self, rate_hz: f32) {
        self.rate_hz = rate_hz;
    }

    fn stack_peak(&self) -> u32 {
        99
    }

    fn panic_message(&self) -> &str {
        "a panic"
    }

    fn remember_trial(&mut self, on_trial: bool) {
        self.trial = on_trial;
    }

    fn remembers_trial(&self) -> bool {
        self.trial
    }

    fn drill(&mut self, drill: Drill) -> bool {
        self.drilled = self.drills.then_some(drill);
        self.drills
    }
}

/// A host, and the board that it talks with.
pub struct Host {
    pub session: Session,
    pub bench: Bench,
    /// Of the last arming.
    pub token: u16,
}

impl Host {
    /// After a reset, with nothing stored and this cause latched.
    pub fn new(latched: Option<Cause>) -> Self {
        let store = Store::new(Flash::new(), Bench::ID).expect("two sectors");
        let bench = Bench {
            device: Device::new(latched),
            store,
            rate_hz: 0.0,
            drive: Drive::OFF,
            ticks: 0,
            trial: false,
            drills: false,
            drilled: None,
        };
        Self { session: Session::new("1.2.3"), bench, token: 0 }
    }

    /// Sends a command and returns its answer.
    pub fn ask(&mut self, command: Command) -> Answer {
        let mut frame = [0; FRAME_LEN + 1];
        let length = encode(&Request { sequence: 5, token: self.token, command }, &mut frame).expect("fits");
        let mut answers: Vec<Message> =
            frame[..length].iter().filter_map(|&byte| self.session.serve(byte, &mut self.bench)).collect();
        match (answers.pop(), answers.as_slice()) {
            (Some(Message::Answer { sequence: 5, answer }), []) => answer,
            other => panic!("{other:?}"),
        }
    }

    pub fn arm(&mut self) {
        match self.ask(Command::Arm) {
            Answer::Armed { token } => self.token = token,
            other => panic!("{other:?}"),
        }
    }

    pub fn upload(&mut self, bytes: &[u8]) {
        for (index, piece) in bytes.chunks(CHUNK).enumerate() {
            let bytes = piece.iter().copied().collect();
            assert_eq!(self.ask(Command::Upload { offset: (index * CHUNK) as u16, bytes }), Answer::Done);
        }
    }

    /// After the first tick with the parameters of [`blob`].
    pub fn with_parameters() -> Self {
        let mut host = Self::new(None);
        let bytes = blob();
        host.upload(&bytes);
        assert_eq!(host.ask(Command::Try { length: bytes.len() as u16 }), Answer::Done);
        host.tick();
        host
    }

    /// A tick with healthy readings.
    pub fn tick(&mut self) {
        let bench = &mut self.bench;
        bench.ticks = bench.ticks.wrapping_add(1);
        let monitor_adc_v = Some(bench.drive.dac_v);
        let sensor_adc_v = Some(1.0 + 2e-3 * f32::from(bench.ticks % 3));
        bench.drive = bench.device.tick(Inputs { interlock_closed: true, monitor_adc_v, sensor_adc_v });
    }

    pub fn state(&mut self) -> DriverState {
        match self.ask(Command::Status) {
            Answer::Status(status) => status.state,
            other => panic!("{other:?}"),
        }
    }
}

/// Parameters of this board.
pub fn blob() -> Vec<u8> {
    let mut bytes = [0; BLOB_LEN];
    let mut parameters = board_parameters();
    // The film of this bench stands still, which no model explains.
    parameters.limits.max_disturbance_share = 0.4;
    let length = parameters.encode(Bench::ID, &mut bytes).expect("valid");
    bytes[..length].to_vec()
}
