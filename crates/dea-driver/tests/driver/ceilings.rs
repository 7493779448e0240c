//! Ceilings of a board, which neither a blob nor an upload exceeds.

use dea_driver::chips::{Ceilings, Converters};
use dea_driver::wire::{Answer, Command, Reject};
use dea_driver::{Blob, BlobError, Limits, RamFlash, Store, StoreError};

use crate::bench::{board_parameters, changed_parameters, encoded};
use crate::board::BOARD;
use crate::host::Host;

fn board(ceilings: Ceilings) -> Converters {
    Converters { ceilings, ..Converters::AD5754_ADS868X }
}

#[test]
fn no_parameters_exceed_a_ceiling() {
    let Limits { max_voltage_v, max_field_v_per_m, max_displacement_m, .. } = board_parameters().limits;
    let exact = Ceilings { voltage_v: max_voltage_v, field_v_per_m: max_field_v_per_m, stroke_m: max_displacement_m };
    assert!(Blob::with_converters(board_parameters(), &board(exact)).is_ok());
    for (quantity, value, of) in [
        ("max_voltage_v", max_voltage_v, (|c, to| c.voltage_v = to) as fn(&mut Ceilings, f32)),
        ("max_field_v_per_m", max_field_v_per_m, |c, to| c.field_v_per_m = to),
        ("max_displacement_m", max_displacement_m, |c, to| c.stroke_m = to),
    ] {
        for ceiling in [value.next_down(), 0.5 * value, 0.0, -1.0, f32::NAN] {
            let mut ceilings = exact;
            of(&mut ceilings, ceiling);
            let error = Blob::with_converters(board_parameters(), &board(ceilings)).expect_err(quantity);
            let BlobError::Ceiling { quantity: named, value: found, .. } = error else { panic!("{error:?}") };
            assert_eq!((named, found), (quantity, value));
            let text = error.to_string();
            let parts = [quantity, &value.to_string(), &ceiling.to_string()];
            assert!(!text.contains('\n') && parts.iter().all(|part| text.contains(part)), "{text}");
        }
    }
}

/// Parameters that were uploaded before keep running; a set that is stored beyond them, by firmware that allowed it, does not run.
#[test]
fn an_upload_and_what_is_stored_keep_to_the_ceilings() {
    let ceilings = Ceilings { voltage_v: 6000.0, ..Ceilings::NONE };
    let within = encoded(&changed_parameters(|p| p.limits.max_voltage_v = 6000.0), BOARD);
    let beyond = encoded(&board_parameters(), BOARD);
    let mut host = Host::new(None);
    host.bench.store = Store::with_converters(RamFlash::default(), BOARD, board(ceilings)).expect("two sectors");
    assert_eq!(host.commit(&within), Answer::Done);
    let before = host.ask(Command::Query);
    assert_eq!(host.commit(&beyond), Answer::Rejected(Reject::Ceiling));
    assert_eq!(host.ask(Command::Query), before);
    assert_eq!(host.try_blob(&beyond), Answer::Rejected(Reject::Ceiling));
    host.done(Command::Reload);
    assert_eq!(host.ask(Command::Query), before);

    let mut earlier = Store::new(RamFlash::default(), BOARD).expect("two sectors");
    earlier.save(&beyond).expect("allowed then");
    let mut now: Store<_> = Store::with_converters(earlier.destroy(), BOARD, board(ceilings)).expect("two sectors");
    let refused = now.load().err();
    assert!(matches!(refused, Some(StoreError::Empty(Some(BlobError::Ceiling { .. })))), "{refused:?}");
}
