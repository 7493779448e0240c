//! Parameters survive whatever happens to them: damage is refused, power may go at any byte.

use dea_driver::chips::{Calibration, CalibrationError, MAX_POINTS};
use dea_driver::{BLOB_LEN, Blob, BlobError, Parameters, Store, StoreError};
use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use springpot::{Actuator, ActuatorError, CurveError, Knot, Law, LawError, LawOptions, VoltageDrive};

use crate::bench::board_parameters;
use crate::flash::{Flash, SECTOR};

const BOARD: u16 = 0x0405;

fn named(name: &str) -> Parameters {
    Parameters { name: name.try_into().expect("short"), ..board_parameters() }
}

fn bytes_of(parameters: &Parameters) -> Vec<u8> {
    let mut bytes = [0; BLOB_LEN];
    let length = parameters.encode(BOARD, &mut bytes).expect("valid");
    bytes[..length].to_vec()
}

fn store(flash: Flash) -> Store<Flash> {
    Store::new(flash, BOARD).expect("two sectors")
}

/// The name of what is loaded, and whether newer ones were lost.
fn found(store: &mut Store<Flash>) -> (String, bool) {
    let stored = store.load().expect("there");
    (stored.blob.parameters().name.to_string(), stored.newer_lost)
}

#[test]
fn a_blob_comes_back_as_it_was() {
    let mut parameters = board_parameters();
    let blob = Blob::decode(&bytes_of(&parameters), BOARD).expect("valid");
    assert_eq!(*blob.parameters(), parameters);
    // The law is the one that a host steps, to the bit.
    let model = springpot::Preset::TABLE3_N2.model().expect("valid");
    let law = Law::compressed(&model, LawOptions::at_step(1e-3)).expect("valid");
    let observer = blob.follower().compensator().observer();
    assert_eq!(observer.law(), &law);
    let drive = VoltageDrive::new(&Actuator::KARNER_2022, 6500.0, law.stiffness()).expect("valid");
    assert_eq!(observer.drive(), &drive);
    // The largest there can be: a full name.
    parameters.name = "a name of thirty-two characters.".try_into().expect("short");
    let bytes = bytes_of(&parameters);
    println!("blob: at most {} bytes", bytes.len());
    assert_eq!(Blob::decode(&bytes, BOARD).expect("valid").into_parameters(), parameters);
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

/// Values that are whole but wrong are refused, by name, before anything is written.
#[test]
fn wrong_values_are_refused() {
    let good = board_parameters();
    let refused = |change: &dyn Fn(&mut Parameters)| {
        let mut parameters = good.clone();
        change(&mut parameters);
        let mut bytes = [0; BLOB_LEN];
        let error = parameters.encode(BOARD, &mut bytes).expect_err("wrong");
        assert_eq!(bytes, [0; BLOB_LEN]);
        println!("{error}");
        error
    };
    // The text of a refusal states the values that were compared, in one line.
    let states = |change: &dyn Fn(&mut Parameters), is: &dyn Fn(BlobError) -> bool, values: &[&str]| {
        let error = refused(change);
        assert!(is(error), "{error:?}");
        let text = error.to_string();
        assert!(!text.contains('\n'), "{text}");
        for value in values {
            assert!(text.contains(value), "{value} is missing: {text}");
        }
    };
    for nan in [f64::NAN, f64::INFINITY, -1.0] {
        let wrong_law = |which, change: &dyn Fn(&mut Parameters)| {
            assert_eq!(refused(change), BlobError::Law(LawError::Coefficient(which)));
        };
        wrong_law("instant", &|p| p.law.instant = nan);
        wrong_law("tail_error", &|p| p.law.tail_error = nan);
        wrong_law("fast", &|p| p.law.fast[11].1 = nan as f32);
        wrong_law("slow", &|p| p.law.slow[0].0 = nan as f32);
        assert!(matches!(
            refused(&|p| p.actuator.thickness_m = nan),
            BlobError::Actuator(ActuatorError::NotPositive { .. })
        ));
        assert!(matches!(refused(&|p| p.actuator.mass_kg = nan), BlobError::Actuator(ActuatorError::Mass(_))));
        assert!(matches!(
            refused(&|p| p.actuator.stretch_coupling = nan * f64::INFINITY),
            BlobError::Actuator(ActuatorError::Coupling(_))
        ));
        assert!(matches!(
            refused(&|p| p.actuator.saturation_v = Some(nan)),
            BlobError::Actuator(ActuatorError::Saturation(_))
        ));
        let knot = Knot { displacement: 0.0, value: 0.0, slope: 1.0 };
        let last = Knot { displacement: 1e-3, value: nan as f32, slope: 1.0 };
        let curve = refused(&|p| p.law.curve.extend([knot, last]));
        let falls =
            matches!(curve, BlobError::Law(LawError::Curve(CurveError::NotMonotone { slope, .. })) if slope < 0.0);
        assert!(falls || curve == BlobError::Law(LawError::Curve(CurveError::Knot { index: 1 })), "{curve:?}");
        assert!(matches!(refused(&|p| p.rate_hz = nan as f32), BlobError::Rate { .. }));
        assert!(matches!(refused(&|p| p.limits.max_voltage_v = nan as f32), BlobError::Limits(_)));
        assert!(matches!(
            refused(&|p| p.monitor = Calibration::linear(nan as f32)),
            BlobError::Calibration("monitor", CalibrationError::Falls { .. })
        ));
    }
    states(&|p| p.sensor_offset_m = f32::NAN, &|e| matches!(e, BlobError::Offset { .. }), &["NaN"]);
    states(&|p| p.rate_hz = 0.5, &|e| matches!(e, BlobError::Rate { .. }), &["0.5", "1 to 100000"]);
    assert_eq!(refused(&|p| p.law.head[3] = f32::NAN), BlobError::Law(LawError::Coefficient("head")));
    assert_eq!(refused(&|p| p.law.slow[5].0 = 1.01), BlobError::Law(LawError::Coefficient("slow")));
    // Instruments that cannot show or reach the largest voltage of the limits, and limits for another film.
    let short = |which: &'static str| move |e| matches!(e, BlobError::Reach { instrument, .. } if instrument == which);
    let points = |points: &[[f32; 2]]| Calibration::points(points).expect("rising");
    let linear = Calibration::linear;
    states(&|p| p.monitor = linear(625.0), &short("monitor"), &["monitor", "6399.9", "10.23", "6755 V"]);
    states(&|p| p.amplifier = linear(600.0), &short("amplifier"), &["amplifier", "6000 V", "10 V", "6500 V"]);
    states(&|p| p.amplifier = points(&[[0.0, 0.0], [5.0, 6000.0]]), &short("amplifier"), &["6000 V", "6500 V"]);
    states(&|p| p.monitor = points(&[[0.0, 0.0], [5.0, 6000.0]]), &short("monitor"), &["6000 V", "6755 V"]);
    // A step of 16 bits of 10 V is 153 V at the film, and 76 V where the points are steepest.
    let coarse = |e| matches!(e, BlobError::Coarse { .. });
    states(&|p| p.amplifier = linear(1e6), &coarse, &["152.5", "60 V"]);
    let steep = points(&[[0.0, 0.0], [1.0, 10.0], [1.01, 5010.0], [10.0, 7000.0]]);
    states(&|p| p.amplifier = steep.clone(), &coarse, &["76.2", "60 V"]);
    // An amplifier above 0 V at rest.
    let rest = |e| matches!(e, BlobError::Rest { .. });
    let offset = Calibration::Parabola { offset: 7000.0, gain: 1000.0, quadratic: 0.0 };
    states(&|p| p.amplifier = offset.clone(), &rest, &["7000 V", "60 V"]);
    states(&|p| p.amplifier = points(&[[0.0, 100.0], [5.0, 8000.0]]), &rest, &["100 V", "60 V"]);
    // Points that fall.
    let falling: dea_driver::heapless::Vec<_, MAX_POINTS> =
        [[0.0, 0.0], [2.0, 3000.0], [1.0, 7000.0]].as_slice().try_into().expect("room");
    let falls = |e| matches!(e, BlobError::Calibration("amplifier", CalibrationError::Point { number: 2, .. }));
    states(&|p| p.amplifier = Calibration::Points(falling.clone()), &falls, &["2 V, 3000", "1 V, 7000"]);
    let thickness = |e| matches!(e, BlobError::Thickness { .. });
    states(&|p| p.limits.thickness_m = 170e-6, &thickness, &["0.00017", "0.00016"]);
    // A sensor that seems plausible when it is unplugged, and when it is saturated; one that is stuck before it could show it.
    let unplugged = |e| matches!(e, BlobError::Unplugged { .. });
    states(&|p| p.limits.sensor.low = -1.1e-3, &unplugged, &["-0.0011 m", "0.009 m", "-0.001 m", "0.0092"]);
    states(&|p| p.limits.sensor.high = 9.3e-3, &unplugged, &["-0.0009 m", "0.0093 m", "-0.001 m", "0.0092"]);
    states(&|p| p.sensor_offset_m = -0.2e-3, &unplugged, &["-0.0009 m", "0.009 m", "-0.0008", "0.0094"]);
    states(&|p| p.limits.sensor.stuck_ticks = 99, &|e| matches!(e, BlobError::Stuck { .. }), &["99", "100.0"]);
    // A sensor that is lost between two samples.
    assert!(matches!(refused(&|p| p.control.lost_after_s = 0.009), BlobError::Control(_)));
    // A coupling that pulls the film in within a step.
    assert!(matches!(
        refused(&|p| p.actuator.stretch_coupling = 1e9),
        BlobError::Actuator(ActuatorError::PullIn { .. })
    ));
}

#[test]
fn the_newest_valid_set_wins() {
    let mut store = store(Flash::new());
    assert!(matches!(store.load(), Err(StoreError::Empty(_))));
    for name in ["one", "two", "three", "four", "five"] {
        assert_eq!(store.save(&bytes_of(&named(name))).expect("saved").parameters().name, name);
        assert_eq!(found(&mut store), (name.to_owned(), false));
    }
    // The newest gets damaged: the one before is still there.
    let mut flash = store.destroy();
    let newest = usize::from(flash.bytes[SECTOR] > flash.bytes[0]);
    flash.bytes[newest * SECTOR + 100] ^= 0x10;
    let mut store = self::store(flash);
    assert_eq!(found(&mut store), ("four".to_owned(), true));
    // And the next one replaces the damaged one.
    store.save(&bytes_of(&named("six"))).expect("saved");
    assert_eq!(found(&mut store), ("six".to_owned(), false));
    // What would be refused is not written.
    let before = store.destroy();
    let mut store = self::store(before.clone());
    let damaged = &bytes_of(&named("seven"))[1..];
    assert!(matches!(store.save(damaged), Err(StoreError::Refused(_))));
    assert_eq!(store.destroy().bytes, before.bytes);
}

/// Sets that this version refuses, and whatever else a sector held before, are older than what is saved: nothing is lost then.
#[test]
fn what_is_saved_over_refused_sets_is_the_newest() {
    let old_schema = |sequence: u32| {
        let mut slot = [sequence.to_le_bytes(), (!sequence).to_le_bytes()].concat();
        slot.extend(bytes_of(&named("old")));
        slot[12] = 1;
        slot.resize(SECTOR, 0xff);
        slot
    };
    for (first, second) in [(7, 8), (8, 7), (u32::MAX, 0)] {
        let flash = Flash { bytes: [old_schema(first), old_schema(second)].concat(), power: usize::MAX };
        let mut store = store(flash);
        assert!(matches!(store.load(), Err(StoreError::Empty(Some(_)))));
        store.save(&bytes_of(&named("new"))).expect("saved");
        assert_eq!(found(&mut store), ("new".to_owned(), false), "over {first} and {second}");
    }
    let used = Flash { bytes: [vec![0xff; SECTOR], vec![0x5a; SECTOR]].concat(), power: usize::MAX };
    let mut store = store(used);
    store.save(&bytes_of(&named("new"))).expect("saved");
    assert_eq!(found(&mut store), ("new".to_owned(), false));
}

/// A slot as doc/blob.md describes it.
fn slot(sequence: u32, blob: &[u8]) -> Vec<u8> {
    let mut bytes = [sequence.to_le_bytes(), (!sequence).to_le_bytes()].concat();
    bytes.extend(blob);
    bytes.resize(SECTOR, 0xff);
    bytes
}

/// The second set is damaged, and the save that would replace it is cut off, at every thirteenth byte: the first one never runs
/// silently. With flash of this version, and of earlier ones, which wrote the first set to one slot alone.
#[test]
fn a_save_over_a_damaged_set_that_is_cut_off_is_reported() {
    let [first, second, third] = ["first", "second", "third"].map(|name| bytes_of(&named(name)));
    let written = {
        let mut store = store(Flash::new());
        store.save(&first).expect("saved");
        store.save(&second).expect("saved");
        store.destroy().bytes
    };
    let earlier = [slot(1, &first), slot(2, &second)].concat();
    for (which, bytes) in [("this", written), ("earlier", earlier)] {
        let damaged = if bytes[SECTOR..].windows(6).any(|window| window == b"second") { SECTOR } else { 0 };
        // In its header, and in its blob.
        for at in [0, 5, 100, 300] {
            let mut bytes = bytes.clone();
            bytes[damaged + at] ^= 0x10;
            for power in (0..=4 * SECTOR).step_by(13) {
                let mut store = store(Flash { bytes: bytes.clone(), power });
                let saved = store.save(&third).is_ok();
                let mut flash = store.destroy();
                flash.power = usize::MAX;
                match self::store(flash).load() {
                    Ok(stored) => {
                        let is_newest = stored.blob.parameters().name == "third";
                        assert!(is_newest || stored.newer_lost, "{which} version, byte {at}, cut after {power} bytes");
                        assert!(is_newest && !stored.newer_lost || !saved);
                    }
                    Err(error) => {
                        assert!(matches!(error, StoreError::Empty(Some(_))), "{which}, {at}, {power}: {error:?}");
                        assert!(!saved);
                    }
                }
            }
        }
    }
}

/// The first set is stored twice. One of the two is damaged, and the save over it is cut off: the other one is still there. Both are
/// damaged: the fault of the newest is reported.
#[test]
fn the_first_set_is_stored_twice() {
    let [first, second] = ["first", "second"].map(|name| bytes_of(&named(name)));
    let mut store = store(Flash::new());
    store.save(&first).expect("saved");
    let written = store.destroy();
    for damaged in [0, SECTOR] {
        for power in (0..SECTOR).step_by(13) {
            let mut flash = Flash { power, ..written.clone() };
            flash.bytes[damaged + 100] ^= 0x10;
            let mut store = self::store(flash);
            store.save(&second).expect_err("cut off");
            let flash = Flash { power: usize::MAX, ..store.destroy() };
            assert_eq!(found(&mut self::store(flash)).0, "first", "{damaged}, {power}");
        }
    }
    let mut flash = written;
    for damaged in [0, SECTOR] {
        flash.bytes[damaged + 100] ^= 0x10;
    }
    assert_eq!(self::store(flash).load().err(), Some(StoreError::Empty(Some(BlobError::Checksum))));
}

/// Numbers that wrap pass over those of sets that are alone: whichever slot they are in, a set beside which another was cut off reports it.
#[test]
fn no_number_that_wraps_marks_a_first_set() {
    let [one, two] = ["one", "two"].map(|name| bytes_of(&named(name)));
    for [first, second] in [[u32::MAX - 1, u32::MAX], [u32::MAX, u32::MAX - 1]] {
        let bytes = [slot(first, &one), slot(second, &two)].concat();
        let mut store = store(Flash { bytes, power: usize::MAX });
        for name in ["three", "four", "five"] {
            store.save(&bytes_of(&named(name))).expect("saved");
            assert_eq!(found(&mut store), (name.to_owned(), false));
            let flash = store.destroy();
            let has_name = |sector: &[u8]| sector.windows(name.len()).any(|window| window == name.as_bytes());
            let other = if has_name(&flash.bytes[..SECTOR]) { SECTOR } else { 0 };
            let mut cut_off = flash.clone();
            cut_off.bytes[other..other + SECTOR].fill(0xff);
            assert_eq!(found(&mut self::store(cut_off)), (name.to_owned(), true));
            store = self::store(flash);
        }
    }
}

/// A save writes one slot alone, but for the first one ever: the set before stays.
#[test]
fn a_save_leaves_the_other_slot() {
    let old = slot(5, &bytes_of(&named("old")));
    let bytes = [old.clone(), vec![0xff; SECTOR]].concat();
    let mut store = store(Flash { bytes, power: usize::MAX });
    store.save(&bytes_of(&named("new"))).expect("saved");
    assert_eq!(store.destroy().bytes[..SECTOR], old);
}

/// A board of an earlier version with its first set: that is no loss, before and after another one is saved.
#[test]
fn the_first_set_of_earlier_versions_is_no_loss() {
    let bytes = [slot(1, &bytes_of(&named("old"))), vec![0xff; SECTOR]].concat();
    let mut store = store(Flash { bytes, power: usize::MAX });
    assert_eq!(found(&mut store), ("old".to_owned(), false));
    store.save(&bytes_of(&named("new"))).expect("saved");
    assert_eq!(found(&mut store), ("new".to_owned(), false));
}

/// Power goes after every possible byte of a save: the old set or the new one is there, never neither and never a mixture.
#[test]
fn power_may_go_at_any_byte() {
    let fresh = {
        let mut store = store(Flash::new());
        store.save(&bytes_of(&named("old"))).expect("saved");
        store.destroy()
    };
    // From a flash with one set, and from one with two.
    let used = {
        let mut store = store(fresh.clone());
        store.save(&bytes_of(&named("older"))).expect("saved");
        store.save(&bytes_of(&named("old"))).expect("saved");
        store.destroy()
    };
    let new = bytes_of(&named("new"));
    for start in [fresh, used] {
        let (mut old_kept, mut new_there) = (0, 0);
        for power in 0.. {
            let mut flash = start.clone();
            flash.power = power;
            let mut store = self::store(flash);
            let saved = store.save(&new).is_ok();
            let mut flash = store.destroy();
            flash.power = usize::MAX;
            let untouched = flash.bytes == start.bytes;
            let mut store = self::store(flash);
            match self::found(&mut store) {
                // Never silently: the new set was cut off, unless nothing of it has reached the flash.
                (name, lost) if name == "old" => {
                    assert_eq!(lost, !untouched, "after {power} bytes");
                    old_kept += 1;
                }
                (name, lost) if name == "new" => {
                    assert!(!lost, "after {power} bytes");
                    new_there += 1;
                }
                (other, _) => panic!("{other} after {power} bytes"),
            }
            // The store goes on working.
            store.save(&bytes_of(&named("next"))).expect("saved");
            assert_eq!(self::found(&mut store), ("next".to_owned(), false));
            if saved {
                break;
            }
        }
        println!("power lost after each byte: the old set {old_kept} times, the new one {new_there} times");
        assert!(old_kept > SECTOR + BLOB_LEN && new_there >= 1);
    }
}

/// A set that is in one slot alone, as its number and the other slot show: the first of all of an earlier version, which wrote it
/// to the first slot, or one beside which another was cut off.
#[test]
fn a_set_in_one_slot_is_the_first_or_lost_another() {
    let slot = |sequence: u32| {
        let mut slot = [sequence.to_le_bytes(), (!sequence).to_le_bytes()].concat();
        slot.extend(bytes_of(&named("alone")));
        slot.resize(SECTOR, 0xff);
        slot
    };
    let erased = vec![0xff; SECTOR];
    let mut begun = erased.clone();
    begun[100] = 0;
    for (sequence, other, lost) in [(1, &erased, false), (1, &begun, true), (2, &erased, true), (2, &begun, true)] {
        let first = [slot(sequence), other.clone()].concat();
        let second = [other.clone(), slot(sequence)].concat();
        for (bytes, lost) in [(first, lost), (second, true)] {
            let mut store = store(Flash { bytes, power: usize::MAX });
            assert_eq!(found(&mut store), ("alone".to_owned(), lost), "number {sequence}");
        }
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
        match Store::new(Words::<READ, WRITE, PART>, BOARD) {
            Ok(_) => true,
            Err(error) => {
                assert_eq!(error, StoreError::Geometry);
                false
            }
        }
    }
    assert!(takes::<1, 4, 1024>() && takes::<8, 8, 1024>() && takes::<1, 1, 2048>() && takes::<4, 2, 1024>());
    assert!(!takes::<1, 4, 1023>() && !takes::<1, 4, 1016>());
    assert!(!takes::<16, 4, 1024>() && !takes::<1, 16, 1024>() && !takes::<1, 256, 1024>());
    assert!(!takes::<3, 4, 1024>() && !takes::<1, 3, 1024>() && !takes::<0, 4, 1024>() && !takes::<1, 0, 1024>());
}

#[test]
fn a_flash_that_is_too_small_is_refused() {
    let flash = Flash { bytes: vec![0xff; SECTOR], power: usize::MAX };
    assert!(matches!(Store::new(flash, BOARD), Err(StoreError::Geometry)));
}
