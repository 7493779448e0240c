//! Parameters survive whatever happens to them: damage is refused, the newest set runs or its loss is reported. The campaign cuts the power.

use dea_driver::chips::{AdcError, AmplifierError, Calibration, MAX_POINTS};
use dea_driver::wire::FrameError;
use dea_driver::{BLOB_LEN, Blob, BlobError, Parameters, RamFlash, Store, StoreError};
use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use springpot::Knot;

use crate::bench::{board_parameters, encoded};
use crate::board::{self, SECTOR};

const BOARD: u16 = 0x0405;

fn named(name: &str) -> Parameters {
    Parameters { name: name.try_into().expect("short"), ..board_parameters() }
}

fn bytes_of(parameters: &Parameters) -> Vec<u8> {
    encoded(parameters, BOARD)
}

fn slot(sequence: u32, name: &str) -> Vec<u8> {
    board::slot(sequence, &bytes_of(&named(name)))
}

fn store(slots: [Vec<u8>; 2]) -> Store<RamFlash> {
    let bytes = slots.concat().try_into().expect("two sectors");
    Store::new(RamFlash { bytes }, BOARD).expect("two sectors")
}

/// The name of what is loaded, and whether newer ones were lost.
fn found(store: &mut Store<RamFlash>) -> (String, bool) {
    let stored = store.load().expect("there");
    (stored.blob.parameters().name.to_string(), stored.newer_lost)
}

/// Every single bit flip, every truncation, and any other bytes are refused.
#[test]
fn damage_is_refused() {
    let bytes = bytes_of(&board_parameters());
    for bit in 0..8 * bytes.len() {
        let mut damaged = bytes.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        assert!(Blob::decode(&damaged, BOARD).is_err(), "bit {bit}");
    }
    for length in 0..bytes.len() {
        assert_eq!(Blob::decode(&bytes[..length], BOARD).err(), Some(BlobError::Truncated), "{length} bytes");
    }
    assert_eq!(Blob::decode(&[0xff; BLOB_LEN], BOARD).err(), Some(BlobError::Magic));
    assert_eq!(Blob::decode(&[0; BLOB_LEN], BOARD).err(), Some(BlobError::Magic));
    assert_eq!(Blob::decode(&bytes, BOARD + 1).err(), Some(BlobError::Board { found: BOARD }));
}

/// Values that are whole but wrong are refused, by name and in one line with the values that were compared, before anything is written.
#[test]
fn wrong_values_are_refused() {
    type Change<'a> = &'a dyn Fn(&mut Parameters);
    let good = board_parameters();
    let refused = |change: Change, debug: &str, values: &[&str]| {
        let mut parameters = good.clone();
        change(&mut parameters);
        let mut bytes = [0; BLOB_LEN];
        let error = parameters.encode(BOARD, &mut bytes).expect_err(debug);
        assert_eq!(bytes, [0; BLOB_LEN]);
        assert!(format!("{error:?}").starts_with(debug), "{error:?} instead of {debug}");
        let text = error.to_string();
        assert!(!text.contains('\n') && values.iter().all(|value| text.contains(value)), "{values:?} in {text}");
    };
    for nan in [f64::NAN, f64::INFINITY, -1.0] {
        let knots = [(0.0, 0.0), (1e-3, nan)].map(|(displacement, value)| (displacement, value as f32));
        let knots = knots.map(|(displacement, value)| Knot { displacement, value, slope: 1.0 });
        let bent = if nan < 0.0 { "Law(Curve(NotMonotone" } else { "Law(Curve(Knot { index: 1 }))" };
        let changes: [(Change, &str); 14] = [
            (&|p| p.law.instant = nan, "Law(Coefficient(\"instant\"))"),
            (&|p| p.law.tail_error = nan, "Law(Coefficient(\"tail_error\"))"),
            (&|p| p.law.fast[11].1 = nan as f32, "Law(Coefficient(\"fast\"))"),
            (&|p| p.law.slow[0].0 = nan as f32, "Law(Coefficient(\"slow\"))"),
            (&|p| p.law.curve.extend(knots), bent),
            (&|p| p.actuator.thickness_m = nan, "Actuator(NotPositive"),
            (&|p| p.actuator.mass_kg = nan, "Actuator(Mass"),
            (&|p| p.actuator.stretch_coupling = nan * f64::INFINITY, "Actuator(Coupling"),
            (&|p| p.actuator.saturation_v = Some(nan), "Actuator(Saturation"),
            (&|p| p.rate_hz = nan as f32, "Rate"),
            (&|p| p.limits.max_voltage_v = nan as f32, "Limits"),
            (&|p| p.monitor = Calibration::linear(nan as f32), "Calibration(\"monitor\", Falls"),
            // A sensor that is lost between two samples, and a coupling that pulls the film in within a step.
            (&|p| p.control.lost_after_s = 0.009, "Control"),
            (&|p| p.actuator.stretch_coupling = 1e9, "Actuator(PullIn"),
        ];
        changes.iter().for_each(|(change, debug)| refused(change, debug, &[]));
    }
    // A film that softens to a tenth and is pulled in there: no voltage holds it within a stroke of 8 mm, but within one of 1 mm.
    let soft = [(0.0, 0.0, 1.0), (2e-3, 2e-3, 0.1), (9e-3, 2.7e-3, 0.1)];
    let pulled_in = |p: &mut Parameters| {
        p.law.curve.extend(soft.map(|(displacement, value, slope)| Knot { displacement, value, slope }));
        p.actuator.stretch_coupling = 200.0;
    };
    refused(&pulled_in, "Margin", &["0.008", "inf", "0.25", "lower max_displacement_m"]);
    let mut shorter = good.clone();
    pulled_in(&mut shorter);
    shorter.limits.max_displacement_m = 1e-3;
    assert!(Blob::new(shorter).is_ok());
    let points = |points: &[[f32; 2]]| Calibration::points(points).expect("rising");
    let linear = Calibration::linear;
    let (monitor, amplifier) = ("Reach { instrument: \"monitor\"", "Reach { instrument: \"amplifier\"");
    let steep = points(&[[0.0, 0.0], [1.0, 10.0], [1.01, 5010.0], [10.0, 7000.0]]);
    let offset = Calibration::Parabola { offset: 7000.0, gain: 1000.0, quadratic: 0.0 };
    let falling: dea_driver::heapless::Vec<_, MAX_POINTS> =
        [[0.0, 0.0], [2.0, 3000.0], [1.0, 7000.0]].as_slice().try_into().expect("room");
    let changes: [(Change, &str, &[&str]); 19] = [
        (&|p| p.sensor_offset_m = f32::NAN, "Offset", &["NaN"]),
        (&|p| p.rate_hz = 0.5, "Rate", &["0.5", "1 to 100000"]),
        (&|p| p.law.head[3] = f32::NAN, "Law(Coefficient(\"head\"))", &[]),
        (&|p| p.law.slow[5].0 = 1.01, "Law(Coefficient(\"slow\"))", &[]),
        // Instruments that cannot show or reach the largest voltage of the limits.
        (&|p| p.monitor = linear(625.0), monitor, &["monitor", "6399.9", "10.23", "6755.0005 V"]),
        (&|p| p.amplifier = linear(600.0), amplifier, &["amplifier", "6000 V", "10 V", "6500 V"]),
        (&|p| p.amplifier = points(&[[0.0, 0.0], [5.0, 6000.0]]), amplifier, &["6000 V", "6500 V"]),
        (&|p| p.monitor = points(&[[0.0, 0.0], [5.0, 6000.0]]), monitor, &["6000 V", "6755.0005 V"]),
        (&|p| p.monitor = points(&[[0.0, 0.0], [5.0, p.limits.monitored_v()]]), monitor, &["6755 V", "6755.000"]),
        // A step of 16 bits of 10 V is 153 V at the film, and 76 V where the points are steepest.
        (&|p| p.amplifier = linear(1e6), "Coarse", &["152.5", "60 V"]),
        (&|p| p.amplifier = steep.clone(), "Coarse", &["76.2", "60 V"]),
        // An amplifier above 0 V at rest.
        (&|p| p.amplifier = offset.clone(), "Rest", &["7000 V", "60 V"]),
        (&|p| p.amplifier = points(&[[0.0, 100.0], [5.0, 8000.0]]), "Rest", &["100 V", "60 V"]),
        (
            &|p| p.amplifier = Calibration::Points(falling.clone()),
            "Calibration(\"amplifier\", Point { number: 2",
            &["2 V, 3000", "1 V, 7000"],
        ),
        (&|p| p.limits.thickness_m = 170e-6, "Thickness", &["0.00017", "0.00016"]),
        // A sensor that seems plausible when it is unplugged, and when it is saturated; one that is stuck before it could show it.
        (&|p| p.limits.sensor.low = -1.1e-3, "Unplugged", &["-0.0011 m", "0.009 m", "-0.001 m", "0.0092"]),
        (&|p| p.limits.sensor.high = 9.3e-3, "Unplugged", &["-0.0009 m", "0.0093 m", "-0.001 m", "0.0092"]),
        (&|p| p.sensor_offset_m = -0.2e-3, "Unplugged", &["-0.0009 m", "0.009 m", "-0.0008", "0.0094"]),
        (&|p| p.limits.sensor.stuck_ticks = 99, "Stuck", &["99", "100.0"]),
    ];
    changes.iter().for_each(|(change, debug, values)| refused(change, debug, values));
}

#[test]
fn the_newest_valid_set_wins() {
    let mut store = store([vec![0xff; SECTOR], vec![0xff; SECTOR]]);
    assert!(matches!(store.load(), Err(StoreError::Empty(None))));
    for name in ["one", "two", "three", "four", "five"] {
        assert_eq!(store.save(&bytes_of(&named(name))).expect("saved").parameters().name, name);
        assert_eq!(found(&mut store), (name.to_owned(), false));
    }
    // The newest gets damaged: the one before is still there.
    let mut flash = store.destroy();
    let newest = usize::from(flash.bytes[SECTOR] > flash.bytes[0]);
    flash.bytes[newest * SECTOR + 100] ^= 0x10;
    let mut store = Store::new(flash, BOARD).expect("two sectors");
    assert_eq!(found(&mut store), ("four".to_owned(), true));
    // And the next one replaces the damaged one.
    store.save(&bytes_of(&named("six"))).expect("saved");
    assert_eq!(found(&mut store), ("six".to_owned(), false));
    // What would be refused is not written.
    let before = store.destroy();
    let mut store = Store::new(before.clone(), BOARD).expect("two sectors");
    let damaged = &bytes_of(&named("seven"))[1..];
    assert!(matches!(store.save(damaged), Err(StoreError::Refused(_))));
    // Both are damaged: the fault of the newest is reported.
    let mut flash = store.destroy();
    assert_eq!(flash, before);
    for slot in [0, SECTOR] {
        flash.bytes[slot + 100] ^= 0x10;
    }
    let mut store = Store::new(flash, BOARD).expect("two sectors");
    assert_eq!(store.load().err(), Some(StoreError::Empty(Some(BlobError::Checksum))));
}

/// Sets that this version refuses, and whatever else a sector held before, are older than what is saved: nothing is lost then.
#[test]
fn what_is_saved_over_refused_sets_is_the_newest() {
    let old_schema = |sequence: u32| {
        let mut slot = slot(sequence, "old");
        slot[12] = 1;
        slot
    };
    let mut flashes =
        [(7, 8), (8, 7), (u32::MAX, 0)].map(|(first, second)| [old_schema(first), old_schema(second)]).to_vec();
    for flash in &flashes {
        assert!(matches!(store(flash.clone()).load(), Err(StoreError::Empty(Some(_)))));
    }
    flashes.push([vec![0xff; SECTOR], vec![0x5a; SECTOR]]);
    for flash in flashes {
        let mut store = store(flash);
        store.save(&bytes_of(&named("new"))).expect("saved");
        assert_eq!(found(&mut store), ("new".to_owned(), false));
    }
}

/// Numbers that wrap pass over those of sets that are alone: whichever slot they are in, a set beside which another was cut off reports it.
#[test]
fn no_number_that_wraps_marks_a_first_set() {
    for [first, second] in [[u32::MAX - 1, u32::MAX], [u32::MAX, u32::MAX - 1]] {
        let mut store = store([slot(first, "one"), slot(second, "two")]);
        for name in ["three", "four", "five"] {
            store.save(&bytes_of(&named(name))).expect("saved");
            assert_eq!(found(&mut store), (name.to_owned(), false));
            let flash = store.destroy();
            let [first, second] = [0, SECTOR].map(|start| flash.bytes[start..][..SECTOR].to_vec());
            let is_first = first.windows(name.len()).any(|window| window == name.as_bytes());
            let erased = vec![0xff; SECTOR];
            let cut_off = if is_first { [first, erased] } else { [erased, second] };
            assert_eq!(found(&mut self::store(cut_off)), (name.to_owned(), true));
            store = Store::new(flash, BOARD).expect("two sectors");
        }
    }
}

/// A save writes one slot alone, but for the first one ever: the set before stays.
#[test]
fn a_save_leaves_the_other_slot() {
    let mut store = store([slot(5, "old"), vec![0xff; SECTOR]]);
    store.save(&bytes_of(&named("new"))).expect("saved");
    assert_eq!(store.destroy().bytes[..SECTOR], slot(5, "old"));
}

/// A set that is in one slot alone, as its number and the other slot show: the first of all of an earlier version, which wrote it
/// to the first slot, or one beside which another was cut off. The next save is no loss.
#[test]
fn a_set_in_one_slot_is_the_first_or_lost_another() {
    let erased = vec![0xff; SECTOR];
    let mut begun = erased.clone();
    begun[100] = 0;
    for (sequence, other, lost) in [(1, &erased, false), (1, &begun, true), (2, &erased, true), (2, &begun, true)] {
        let alone = slot(sequence, "alone");
        for (bytes, lost) in [([alone.clone(), other.clone()], lost), ([other.clone(), alone], true)] {
            let mut store = store(bytes);
            assert_eq!(found(&mut store), ("alone".to_owned(), lost), "number {sequence}");
            store.save(&bytes_of(&named("new"))).expect("saved");
            assert_eq!(found(&mut store), ("new".to_owned(), false));
        }
    }
    // A part of a set alone is one that was lost, in either slot.
    let truncated = Some(BlobError::Truncated);
    for (first, second, fault) in [(&erased, &erased, None), (&begun, &erased, truncated), (&erased, &begun, truncated)]
    {
        let found = store([first.clone(), second.clone()]).load().err();
        assert_eq!(found, Some(StoreError::Empty(fault)));
    }
    // The first save of this version writes both slots: one that is missing later was lost.
    let mut empty = store([erased.clone(), erased.clone()]);
    empty.save(&bytes_of(&named("first"))).expect("saved");
    let bytes = empty.destroy().bytes;
    for one_slot in [[bytes[..SECTOR].to_vec(), erased.clone()], [erased, bytes[SECTOR..][..SECTOR].to_vec()]] {
        assert_eq!(found(&mut store(one_slot)), ("first".to_owned(), true));
    }
}

/// Flash of two parts of `PART` bytes, read and written in words of these sizes.
struct Words<const READ: usize, const WRITE: usize, const PART: usize>;

impl<const READ: usize, const WRITE: usize, const PART: usize> ErrorType for Words<READ, WRITE, PART> {
    type Error = NorFlashErrorKind;
}

impl<const READ: usize, const WRITE: usize, const PART: usize> ReadNorFlash for Words<READ, WRITE, PART> {
    const READ_SIZE: usize = READ;

    fn read(&mut self, _: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        bytes.fill(0xff);
        Ok(())
    }

    fn capacity(&self) -> usize {
        2 * PART
    }
}

impl<const READ: usize, const WRITE: usize, const PART: usize> NorFlash for Words<READ, WRITE, PART> {
    const WRITE_SIZE: usize = WRITE;
    const ERASE_SIZE: usize = PART;

    fn erase(&mut self, _: u32, _: u32) -> Result<(), NorFlashErrorKind> {
        Ok(())
    }

    fn write(&mut self, _: u32, _: &[u8]) -> Result<(), NorFlashErrorKind> {
        Ok(())
    }
}

/// A slot is 8 bytes and a blob of 1016. It is read and written in whole words, each of at most 8 bytes.
#[test]
fn flash_of_any_fitting_geometry_is_taken() {
    fn takes<const READ: usize, const WRITE: usize, const PART: usize>() -> bool {
        let store = Store::new(Words::<READ, WRITE, PART>, BOARD);
        assert!(matches!(store, Ok(_) | Err(StoreError::Geometry)));
        store.is_ok()
    }
    assert!(takes::<1, 4, 1024>() && takes::<8, 8, 1024>() && takes::<1, 1, 2048>() && takes::<4, 2, 1024>());
    assert!(!takes::<1, 4, 1023>() && !takes::<1, 4, 1016>());
    assert!(!takes::<16, 4, 1024>() && !takes::<1, 16, 1024>() && !takes::<1, 256, 1024>());
    assert!(!takes::<3, 4, 1024>() && !takes::<1, 3, 1024>() && !takes::<0, 4, 1024>() && !takes::<1, 0, 1024>());
}

/// A program returns the errors of store, converters and frames with `?`, and shows what is wrong.
#[test]
fn errors_are_returned_and_shown() {
    fn returned(error: impl std::error::Error + 'static) -> String {
        let fails = || -> Result<(), Box<dyn std::error::Error>> { Err(error)? };
        fails().expect_err("it fails").to_string()
    }
    let [wanted, found] = [0x0fff, 0x00a0];
    for (text, words) in [
        (returned(StoreError::Empty(None)), "no parameters are stored"),
        (returned(StoreError::Empty(Some(BlobError::Checksum))), "that can be read: the blob is damaged"),
        (returned(StoreError::Refused(BlobError::Magic)), "not stored: not a parameter blob"),
        (returned(StoreError::Geometry), "hold 1024 bytes each"),
        (returned(StoreError::Flash(NorFlashErrorKind::OutOfBounds)), "the flash failed: "),
        (returned(AmplifierError::Readback { wanted, found }), "holds 0x00a0 instead of 0x0fff"),
        (returned(AdcError::Range { wanted, found }), "returns 0x00a0 instead of 0x0fff"),
        (returned(FrameError::Version(3)), "has version 3 of the protocol"),
    ] {
        assert!(text.contains(words), "{text}");
    }
}
