//! A host that talks with a board.

use dea_driver::server::Session;
use dea_driver::wire::{Answer, CHUNK, Command, Status};
use dea_driver::{Cause, DriverState, RamFlash};

use crate::bench::{changed_parameters, encoded};
use crate::board::{self, BOARD, Bench};

/// A host, and the board that it talks with.
pub struct Host {
    pub session: Session,
    pub bench: Bench,
    /// Token of the last arming.
    pub token: u16,
    /// Number of the last request.
    pub sequence: u32,
}

impl Host {
    /// After a reset, with nothing stored and this cause latched.
    pub fn new(latched: Option<Cause>) -> Self {
        let bench = Bench::new(RamFlash::default(), latched);
        Self { session: Session::new("1.2.3"), bench, token: 0, sequence: 0 }
    }

    /// Sends a command and returns its answer.
    pub fn ask(&mut self, command: Command) -> Answer {
        self.sequence = self.sequence.wrapping_add(1);
        board::ask(&mut self.session, &mut self.bench, (self.sequence, self.token), command)
    }

    pub fn arm(&mut self) {
        self.arm_by(Command::Arm);
    }

    pub fn arm_by(&mut self, command: Command) {
        match self.ask(command) {
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

    /// Uploads a blob that is to be kept.
    pub fn commit(&mut self, bytes: &[u8]) -> Answer {
        self.upload(bytes);
        self.ask(Command::Commit { length: bytes.len() as u16 })
    }

    /// Uploads a blob that is only tried.
    pub fn try_blob(&mut self, bytes: &[u8]) -> Answer {
        self.upload(bytes);
        self.ask(Command::Try { length: bytes.len() as u16 })
    }

    /// After the first tick with the parameters of [`blob`].
    pub fn with_parameters() -> Self {
        let mut host = Self::new(None);
        assert_eq!(host.try_blob(&blob()), Answer::Done);
        host.tick();
        host
    }

    /// Asks for what the board does.
    pub fn done(&mut self, command: Command) {
        assert_eq!(self.ask(command.clone()), Answer::Done, "{command:?}");
    }

    /// The board gets bytes, whatever it answers.
    pub fn hear(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.session.serve(byte, &mut self.bench);
        }
    }

    /// A tick with healthy readings.
    pub fn tick(&mut self) {
        let inputs = self.bench.inputs();
        self.bench.tick(inputs);
    }

    /// Ticks with healthy readings.
    pub fn ticks(&mut self, count: u32) {
        (0..count).for_each(|_| self.tick());
    }

    pub fn status(&mut self) -> Status {
        match self.ask(Command::Status) {
            Answer::Status(status) => status,
            other => panic!("{other:?}"),
        }
    }

    pub fn state(&mut self) -> DriverState {
        self.status().state
    }
}

/// Parameters of this board.
pub fn blob() -> Vec<u8> {
    // The film of this bench does not move, which no model explains.
    encoded(&changed_parameters(|p| p.limits.max_disturbance_share = 0.4), BOARD)
}
