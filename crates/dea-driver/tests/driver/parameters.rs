//! Parameters: which ones run after an upload and after a reset, and whether the host gets a report.

use dea_driver::wire::{Answer, Command, Reject};
use dea_driver::{Cause, DriverState, RamFlash, Refusal, Store};

use crate::bench::{changed_parameters, encoded, law_at, of_law};
use crate::board::BOARD;
use crate::host::{Host, blob};

#[test]
fn parameters_are_kept_by_commit_and_run_by_try() {
    let mut host = Host::with_parameters();
    assert_eq!(host.ask(Command::Reload), Answer::Rejected(Reject::NoParameters), "try does not store");
    assert_eq!(host.commit(&blob()), Answer::Done);
    host.done(Command::Reload);
    let mut damaged = blob();
    damaged[50] ^= 1;
    assert_eq!(host.try_blob(&damaged), Answer::Rejected(Reject::Blob));
    host.upload(&damaged);
    assert_eq!(host.ask(Command::Try { length: 12 }), Answer::Rejected(Reject::Upload));
    assert_eq!(host.ask(Command::Reload), Answer::Done, "the stored ones stay");
}

/// Parameters that a board cannot run are not stored either: at 4 kHz it would have nothing to run after a reset.
#[test]
fn what_a_board_cannot_run_is_not_stored() {
    let mut host = Host::with_parameters();
    assert_eq!(host.commit(&blob()), Answer::Done);
    let mut fast = of_law(&law_at(4000.0));
    fast.limits.sensor.stuck_ticks = 2000;
    let fast = encoded(&fast, BOARD);
    assert_eq!(host.commit(&fast), Answer::Rejected(Reject::Rate));
    assert_eq!(host.ask(Command::Reload), Answer::Done, "the stored ones stay");
}

/// A board whose newest parameters are damaged runs the older ones, which may allow more, and says so until it is acknowledged.
#[test]
fn damaged_parameters_are_not_replaced_silently() {
    let stricter = encoded(&changed_parameters(|p| p.limits.max_voltage_v = 800.0), BOARD);
    let permissive = blob();
    let mut host = Host::new(None);
    for blob in [&permissive, &stricter] {
        assert_eq!(host.commit(blob), Answer::Done);
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
            host.done(Command::Acknowledge);
        }
        assert_eq!(host.state(), tripped);
        assert_eq!(host.ask(Command::Arm), Answer::Refused(Refusal::State(tripped)));
        host.done(Command::Acknowledge);
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
    let tries = |host: &mut Host| assert_eq!(host.try_blob(&blob()), Answer::Done);
    let latched = DriverState::Tripped(Cause::Parameters);
    let mut host = Host::new(None);
    assert_eq!(host.commit(&blob()), Answer::Done);
    host = reset(host);
    assert_eq!(host.state(), DriverState::Disarmed, "nothing was tried");
    tries(&mut host);
    assert_eq!(host.state(), DriverState::Disarmed);
    host = reset(host);
    assert_eq!(host.state(), latched);
    // A reset does not acknowledge it, nor does another trial.
    host = reset(host);
    assert_eq!(host.state(), latched);
    tries(&mut host);
    assert_eq!(host.state(), latched);
    host.done(Command::Acknowledge);
    host = reset(host);
    assert_eq!(host.state(), latched, "the second trial");
    host.done(Command::Acknowledge);
    host = reset(host);
    assert_eq!(host.state(), DriverState::Disarmed);
    // A trial that ends by itself: taken back, or kept.
    tries(&mut host);
    host.done(Command::Reload);
    host = reset(host);
    assert_eq!(host.state(), DriverState::Disarmed);
    tries(&mut host);
    assert_eq!(host.commit(&blob()), Answer::Done);
    assert_eq!(reset(host).state(), DriverState::Disarmed);
}
