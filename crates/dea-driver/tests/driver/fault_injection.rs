//! Fault injection: faults that an image for it causes when a host asks, and no other image.

use dea_driver::server::{Board, Session};
use dea_driver::wire::{Answer, Command, InjectedFault, Reject};
use dea_driver::{Device, DriverState, RamFlash, Store};

use crate::board::{BOARD, Bench, ask};
use crate::host::{Host, blob};

/// A board that does not implement fault injection.
struct WithoutFaults(Bench);

impl Board for WithoutFaults {
    type Flash = RamFlash;
    const ID: u16 = BOARD;

    fn with<R>(&mut self, work: impl FnOnce(&mut Device) -> R) -> (R, u32) {
        self.0.with(work)
    }

    fn rates_hz(&self) -> (f32, f32) {
        self.0.rates_hz()
    }

    fn store(&mut self) -> &mut Store<RamFlash> {
        self.0.store()
    }

    fn set_rate(&mut self, rate_hz: f32) {
        self.0.set_rate(rate_hz);
    }
}

/// A board neither injects faults nor stops feeding its watchdog unless it implements that.
#[test]
fn a_board_without_fault_injection_rejects_it() {
    let mut board = WithoutFaults(Bench::new(RamFlash::default(), None));
    for command in [Command::InjectFault(InjectedFault::Hang), Command::StopFeedingWatchdog, Command::Inspect] {
        assert_eq!(ask(&mut Session::new("1.2.3"), &mut board, (5, 0), command), Answer::Rejected(Reject::Unknown));
    }
}

/// A board without memory over a reset begins as if nothing had been tried.
#[test]
fn a_board_without_memory_has_no_trial() {
    let mut board = WithoutFaults(Bench::new(RamFlash::default(), None));
    board.store().save(&blob()).expect("saved");
    Session::new("1.2.3").begin(&mut board).expect("stored");
    let inputs = board.0.inputs();
    board.0.tick(inputs);
    let Answer::Status(status) = ask(&mut Session::new("1.2.3"), &mut board, (5, 0), Command::Status) else {
        panic!("no status")
    };
    assert_eq!(status.state, DriverState::Disarmed);
}

/// An image for fault injection causes the fault that was asked for, and confirms it.
#[test]
fn an_image_for_fault_injection_causes_the_fault() {
    let mut host = Host::new(None);
    host.bench.injected = Some(vec![]);
    host.done(Command::InjectFault(InjectedFault::Bus));
    assert_eq!(host.bench.injected, Some(vec![InjectedFault::Bus]));
}
