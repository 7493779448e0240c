//! A host that talks with a board.

use dea_driver::server::Session;
use dea_driver::wire::{Answer, CHUNK, Command};
use dea_driver::{Cause, DriverState, RamFlash};

use crate::bench::{board_parameters, encoded};
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
        let inputs = self.bench.inputs();
        self.bench.tick(inputs);
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
    let mut parameters = board_parameters();
    // The film of this bench does not move, which no model explains.
    parameters.limits.max_disturbance_share = 0.4;
    encoded(&parameters, BOARD)
}
