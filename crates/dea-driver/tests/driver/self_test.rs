//! Arming above a stated voltage needs a self-test since the start.

use dea_driver::wire::{Answer, Command, Mode};
use dea_driver::{BlobError, DriverState, Parameters, Refusal, Supervisor};

use crate::bench::{board_parameters, changed_parameters, encoded};
use crate::board::{BOARD, sealed};
use crate::host::Host;

/// A film that does not move, which no model explains.
fn needing_a_test_above(above_v: f32) -> Parameters {
    changed_parameters(|p| (p.self_test_above_v, p.limits.max_disturbance_share) = (above_v, 0.4))
}

/// A host whose board runs these parameters.
fn with(host: &mut Host, above_v: f32) {
    assert_eq!(host.try_blob(&encoded(&needing_a_test_above(above_v), BOARD)), Answer::Done);
    host.tick();
}

/// Plays a voltage for 0.2 s; the largest one that is commanded, V.
fn play(host: &mut Host, volts: f32) -> f32 {
    host.done(Command::Start(Mode::Voltage));
    let largest_v = (0..200).fold(0.0_f32, |largest_v, _| {
        host.done(Command::SetVoltage(volts));
        host.tick();
        largest_v.max(1000.0 * host.bench.drive.dac_v)
    });
    assert_eq!(host.state(), DriverState::Running);
    host.done(Command::Disarm);
    host.ticks(1001);
    largest_v
}

#[test]
fn arming_above_a_stated_voltage_needs_a_self_test() {
    // The limits allow 6500 V.
    for above_v in [0.0, 1000.0, 6499.0] {
        let mut host = Host::new(None);
        with(&mut host, above_v);
        assert_eq!(host.ask(Command::Arm), Answer::Refused(Refusal::SelfTest), "{above_v} V");
        let refusals = [Refusal::SelfTest].into_iter().collect();
        assert_eq!(host.ask(Command::Preflight), Answer::Preflight { refusals, self_test_s: None });
        // The test itself may be armed, and moves no film.
        host.arm_by(Command::ArmForSelfTest);
        assert_eq!(play(&mut host, 3000.0), 500.0);
        assert_eq!(host.ask(Command::Arm), Answer::Refused(Refusal::SelfTest), "armed for a test is no test");
        host.done(Command::SelfTested);
        host.arm();
        assert_eq!(play(&mut host, 3000.0), 3000.0);
        // It is of the bench: other parameters do not change that.
        with(&mut host, 0.0);
        host.arm();
        host.done(Command::Disarm);
        // A test that is armed after it has its limit all the same.
        host.arm_by(Command::ArmForSelfTest);
        assert_eq!(play(&mut host, 3000.0), Supervisor::SELF_TEST_V);
    }
    for above_v in [6500.0, Parameters::<springpot::Compressed<f32>>::NO_SELF_TEST_V] {
        let mut host = Host::new(None);
        with(&mut host, above_v);
        host.arm();
    }
}

/// One that passed before there were parameters counts; one before a reset does not.
#[test]
fn a_self_test_is_of_this_start() {
    let mut host = Host::new(None);
    host.done(Command::SelfTested);
    with(&mut host, 1000.0);
    host.arm();
    let mut host = Host::new(None);
    with(&mut host, 1000.0);
    assert_eq!(host.ask(Command::Arm), Answer::Refused(Refusal::SelfTest));
    // Whatever else is in the way of a test is in its way.
    let open = dea_driver::Inputs { interlock_closed: false, ..host.bench.inputs() };
    host.bench.tick(open);
    assert_eq!(host.ask(Command::ArmForSelfTest), Answer::Refused(Refusal::InterlockOpen));
}

#[test]
fn a_blob_states_the_voltage_only_where_there_is_one() {
    let usual = encoded(&board_parameters(), BOARD);
    let stating = encoded(&needing_a_test_above(1000.0), BOARD);
    // The second byte of the schema, and four bytes before the checksum.
    assert_eq!((usual[5], stating[5], stating.len()), (0, 2, usual.len() + 4));
    assert_eq!(stating[stating.len() - 8..stating.len() - 4], 1000.0_f32.to_le_bytes());
    let read = |bytes: &[u8]| dea_driver::Blob::decode(bytes, BOARD).map(dea_driver::Blob::into_parameters);
    assert_eq!(read(&stating).expect("valid"), needing_a_test_above(1000.0));
    assert_eq!(read(&usual).expect("valid").self_test_above_v, 50e3);
    // A blob that states it and has none, or the other way round, holds no parameters.
    for (bytes, flag) in [(&usual, 2), (&stating, 0)] {
        let mut bytes = bytes[..bytes.len() - 4].to_vec();
        bytes[5] = flag;
        assert_eq!(read(&sealed(&bytes)).err(), Some(BlobError::Contents), "{flag}");
    }
    for above_v in [f32::NAN, f32::INFINITY, -1.0] {
        let refused = dea_driver::Blob::new(needing_a_test_above(above_v)).err();
        assert!(matches!(refused, Some(BlobError::SelfTest { .. })), "{above_v}: {refused:?}");
    }
}
