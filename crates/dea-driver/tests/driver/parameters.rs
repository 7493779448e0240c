//! Parameters: which ones run after an upload and after a reset, and whether the host gets a report.

use dea_driver::wire::{Answer, Command, Reject};
use dea_driver::{Cause, DriverState, Parameters, RamFlash, Refusal, Store};
use springpot::{Law, LawOptions, Preset};

use crate::bench::{board_parameters, encoded, of_law};
use crate::board::BOARD;
use crate::host::{Host, blob};

#[test]
fn parameters_are_kept_by_commit_and_run_by_try() {
    let mut host = Host::with_parameters();
    assert_eq!(host.ask(Command::Reload), Answer::Rejected(Reject::NoParameters), "try does not store");
    host.upload(&blob());
    assert_eq!(host.ask(Command::Commit { length: blob().len() as u16 }), Answer::Done);
    assert_eq!(host.ask(Command::Reload), Answer::Done);
    let mut damaged = blob();
    damaged[50] ^= 1;
    host.upload(&damaged);
    assert_eq!(host.ask(Command::Try { length: damaged.len() as u16 }), Answer::Rejected(Reject::Blob));
    host.upload(&damaged);
    assert_eq!(host.ask(Command::Try { length: 12 }), Answer::Rejected(Reject::Upload));
    assert_eq!(host.ask(Command::Reload), Answer::Done, "the stored ones stay");
}

/// Parameters that a board cannot run are not stored either: at 4 kHz it would have nothing to run after a reset.
#[test]
fn what_a_board_cannot_run_is_not_stored() {
    let mut host = Host::with_parameters();
    host.upload(&blob());
    assert_eq!(host.ask(Command::Commit { length: blob().len() as u16 }), Answer::Done);
    let model = Preset::TABLE3_N2.model().expect("valid");
    let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(0.25e-3)).expect("valid");
    let mut fast = Parameters { rate_hz: 4000.0, ..of_law(&law) };
    fast.limits.sensor.stuck_ticks = 2000;
    let fast = encoded(&fast, BOARD);
    host.upload(&fast);
    assert_eq!(host.ask(Command::Commit { length: fast.len() as u16 }), Answer::Rejected(Reject::Rate));
    assert_eq!(host.ask(Command::Reload), Answer::Done, "the stored ones stay");
}

/// A board whose newest parameters are damaged runs the older ones, which may allow more, and says so until it is acknowledged.
#[test]
fn damaged_parameters_are_not_replaced_silently() {
    let (stricter, permissive) = {
        let mut parameters = board_parameters();
        parameters.limits.max_voltage_v = 800.0;
        (encoded(&parameters, BOARD), blob())
    };
    let mut host = Host::new(None);
    for blob in [&permissive, &stricter] {
        host.upload(blob);
        assert_eq!(host.ask(Command::Commit { length: blob.len() as u16 }), Answer::Done);
    }
    let reset = |flash: RamFlash, latched| {
        let mut host = Host::new(latched);
        host.bench.store = Store::new(flash, BOARD).expect("two sectors");
        host.session.begin(&mut host.bench).expect("older parameters");
        host.tick();
        host
    };
    let flash = host.bench.store.destroy();
    let sound = reset(flash.clone(), None);
    assert_eq!(sound.bench.device.state(), DriverState::Disarmed);
    let mut damaged = flash;
    let newest = (0..2).max_by_key(|slot| damaged.bytes[slot * 1024]).expect("two slots");
    damaged.bytes[newest * 1024 + 60] ^= 4;
    for latched in [None, Some(Cause::Watchdog)] {
        let mut host = reset(damaged.clone(), latched);
        let tripped = DriverState::Tripped(Cause::Parameters);
        if let Some(cause) = latched {
            // Each is reported by itself.
            assert_eq!(host.state(), DriverState::Tripped(cause));
            assert_eq!(host.ask(Command::Acknowledge), Answer::Done);
        }
        assert_eq!(host.state(), tripped);
        assert_eq!(host.ask(Command::Arm), Answer::Refused(Refusal::State(tripped)));
        assert_eq!(host.ask(Command::Acknowledge), Answer::Done);
        host.arm();
        // Which ones they are can be compared.
        let checksum = permissive.last_chunk().copied().map(u32::from_le_bytes);
        let Answer::Parameters { checksum: found, .. } = host.ask(Command::Query) else { panic!("no parameters") };
        assert_eq!(found, checksum);
    }
}

/// Parameters that are only tried are gone after a reset, and the stored ones may allow more.
#[test]
fn a_reset_during_a_trial_is_reported() {
    let reset = |host: Host| {
        let mut next = Host::new(None);
        next.bench.store = host.bench.store;
        next.bench.trial = host.bench.trial;
        next.session.begin(&mut next.bench).expect("stored");
        next.tick();
        next
    };
    let upload = |host: &mut Host, command: fn(u16) -> Command| {
        host.upload(&blob());
        assert_eq!(host.ask(command(blob().len() as u16)), Answer::Done);
    };
    let latched = DriverState::Tripped(Cause::Parameters);
    let mut host = Host::new(None);
    upload(&mut host, |length| Command::Commit { length });
    host = reset(host);
    assert_eq!(host.state(), DriverState::Disarmed, "nothing was tried");
    upload(&mut host, |length| Command::Try { length });
    assert_eq!(host.state(), DriverState::Disarmed);
    host = reset(host);
    assert_eq!(host.state(), latched);
    // A reset does not acknowledge it, nor does another trial.
    host = reset(host);
    assert_eq!(host.state(), latched);
    upload(&mut host, |length| Command::Try { length });
    assert_eq!(host.state(), latched);
    assert_eq!(host.ask(Command::Acknowledge), Answer::Done);
    host = reset(host);
    assert_eq!(host.state(), latched, "the second trial");
    assert_eq!(host.ask(Command::Acknowledge), Answer::Done);
    host = reset(host);
    assert_eq!(host.state(), DriverState::Disarmed);
    // A trial that ends by itself: kept, or taken back.
    upload(&mut host, |length| Command::Try { length });
    assert_eq!(host.ask(Command::Reload), Answer::Done);
    host = reset(host);
    assert_eq!(host.state(), DriverState::Disarmed);
    upload(&mut host, |length| Command::Try { length });
    upload(&mut host, |length| Command::Commit { length });
    assert_eq!(reset(host).state(), DriverState::Disarmed);
}
