//! Parameter blobs, and the flash that keeps them.

use dea_driver::chips::DacCode;
use dea_driver::{
    BLOB_LEN, Blob, BlobHeader, Controller, DriverState, Inputs, Mode, Outputs, Parameters, RamFlash, SCHEMA, Store,
    StoreError,
};

use crate::line::crc32;
use crate::{BOARD, GOOD_BLOB};

/// Bytes before the contents of a blob, and before a blob in its slot.
const HEADER: usize = 10;
const SLOT_HEADER: usize = 8;
/// Bytes of an erasable part.
const SECTOR: usize = 1024;

/// Reads bytes as a blob, or as what a flash holds, as the first byte states:
///
/// | modulo 4 | the rest |
/// | --- | --- |
/// | 0 | a blob, as it is |
/// | 1 | the contents of a blob, which get a header and a checksum |
/// | 2 | the flash: the first half in one slot, the second in the other |
/// | 3 | two slots: sequence numbers, what each holds, and the contents of a blob |
///
/// Returns whether a blob was accepted.
pub fn run(data: &[u8]) -> bool {
    let Some((&kind, rest)) = data.split_first() else { return false };
    match kind % 4 {
        0 => decode(rest),
        1 => decode(&sealed(rest)),
        2 => {
            let mut flash = RamFlash::default();
            let (first, second) = rest.split_at(rest.len() / 2);
            for (sector, bytes) in flash.bytes.chunks_mut(SECTOR).zip([first, second]) {
                sector.iter_mut().zip(bytes).for_each(|(at, &byte)| *at = byte);
            }
            load(&flash)
        }
        _ => slots(rest),
    }
}

/// A blob for this board with these contents.
fn sealed(contents: &[u8]) -> Vec<u8> {
    let contents = &contents[..contents.len().min(2000)];
    let mut blob =
        [b"DEA\x01".as_slice(), &SCHEMA.to_le_bytes(), &BOARD.to_le_bytes(), &(contents.len() as u16).to_le_bytes()]
            .concat();
    blob.extend(contents);
    blob.extend(crc32(&blob).to_le_bytes());
    blob
}

fn decode(bytes: &[u8]) -> bool {
    let header = BlobHeader::read(bytes);
    assert_eq!(header.is_ok(), bytes.len() >= HEADER && bytes.starts_with(b"DEA\x01"));
    let Ok(blob) = Blob::decode(bytes, BOARD) else { return false };
    let header = header.expect("a blob has one");
    let end = HEADER + usize::from(header.length) + 4;
    assert!(end <= BLOB_LEN && header.board == BOARD);
    let (body, checksum) = bytes[..end].split_last_chunk().expect("longer");
    assert_eq!(crc32(body).to_le_bytes(), *checksum);
    assert_eq!(blob.checksum(), Some(u32::from_le_bytes(*checksum)));
    // Postcard's numbers may be written longer than they need be, and a newer schema than a law needs may be stated: what is encoded
    // again is shorter or of the older schema then, and the same.
    let again = encoded(&blob);
    let schema = |blob: &[u8]| u16::from_le_bytes([blob[4], blob[5]]);
    if again.len() == end && schema(&again) == schema(bytes) {
        assert_eq!(again, bytes[..end], "encoded again");
    } else {
        assert!(again.len() <= end && schema(&again) <= schema(bytes), "{} bytes from {end}", again.len());
        let shorter = Blob::decode(&again, BOARD).expect("what was accepted is accepted again");
        assert_eq!(shorter.parameters(), blob.parameters());
        assert_eq!(encoded(&shorter), again);
    }
    holds(blob.parameters());
    drives(blob);
    true
}

fn encoded(blob: &Blob) -> Vec<u8> {
    let mut bytes = vec![0; BLOB_LEN];
    let length = blob.parameters().encode(BOARD, &mut bytes).expect("what was accepted is accepted again");
    bytes.truncate(length);
    bytes
}

/// Checks parameters that were not refused against dea-driver/doc/blob.md and docs/own-board.md.
fn holds(parameters: &Parameters) {
    let Parameters { rate_hz, limits, actuator, control, .. } = parameters;
    assert!((1.0..=100_000.0).contains(rate_hz));
    let positive = [limits.max_voltage_v, limits.max_field_v_per_m, limits.thickness_m, limits.max_slew_v_per_s];
    let more = [limits.max_displacement_m, limits.max_disturbance_share, limits.heartbeat_s, limits.discharge_s];
    assert!(positive.iter().chain(&more).all(|value| value.is_finite() && *value > 0.0), "{limits:?}");
    assert!(limits.heartbeat_s <= 10.0 && limits.max_disturbance_share <= 0.5 && limits.max_voltage_v <= 50e3);
    let share = f64::from(limits.thickness_m) / actuator.thickness_m;
    assert!((0.98..=1.02).contains(&share), "limits for another film");
    // The monitor shows more than is allowed, and an unplugged sensor is not plausible.
    assert!(parameters.monitor.apply(10.24) >= limits.max_voltage_v);
    let unplugged_m = parameters.sensor.apply(0.0) - parameters.sensor_offset_m;
    assert!(!(limits.sensor.low..=limits.sensor.high).contains(&unplugged_m));
    assert!(limits.sensor.low < limits.sensor.high && limits.sensor.stuck_ticks > 0);
    assert!(control.lost_after_s > 0.0 && control.bandwidth_hz > 0.0);
}

/// Runs a controller of these parameters at the largest voltage: whatever they are, it keeps them, and an open interlock ends it.
fn drives(blob: Blob) {
    let parameters = blob.parameters().clone();
    let limits = parameters.limits;
    let mut controller = Controller::new(blob);
    let rest_v = parameters.sensor.invert(parameters.sensor_offset_m);
    let mut command_v = 0.0;
    let mut tick = |controller: &mut Controller, interlock_closed: bool| -> Outputs {
        let monitor_adc_v = Some(parameters.monitor.invert(command_v));
        let outputs = controller.tick(Inputs { interlock_closed, monitor_adc_v, sensor_adc_v: Some(rest_v) });
        let Outputs { enable, dac_v, telemetry } = outputs;
        let step_v = telemetry.command_v - command_v;
        assert!((0.0..=limits.max_voltage_v).contains(&telemetry.command_v), "{} V", telemetry.command_v);
        assert!(telemetry.command_v <= 1.0001 * limits.max_field_v_per_m * limits.thickness_m);
        let (slew_v, rounding_v) = (limits.max_slew_v_per_s / parameters.rate_hz, 1e-6 * limits.max_voltage_v);
        assert!(!enable || step_v <= slew_v + rounding_v, "{step_v} V in a tick, instead of {slew_v} V");
        assert!(enable || dac_v == 0.0, "disabled, with {dac_v} V");
        // NaN, of a gain whose square is not finite, is a code of 0 V. What the amplifier makes of the code is within the monitor's band
        // of the command, and a step of the DAC, which of an amplifier of an absurd gain is more than that.
        let range = parameters.command_range;
        let DacCode(code) = DacCode::from_volts(dac_v, range);
        let film_v = |code: u16| parameters.amplifier.apply(DacCode(code).volts(range));
        let step_v = film_v(code.saturating_add(1)) - film_v(code.saturating_sub(1));
        let most_v = telemetry.command_v + step_v + limits.monitor.band_v + 1e-3 * limits.max_voltage_v;
        assert!(film_v(code) <= most_v, "{} V for a command of {} V", film_v(code), telemetry.command_v);
        command_v = telemetry.command_v;
        outputs
    };
    assert!(!tick(&mut controller, true).enable, "disarmed");
    if controller.arm().is_err() {
        return;
    }
    assert_eq!(tick(&mut controller, true).telemetry.command_v, 0.0, "armed");
    if controller.start(Mode::Voltage).is_ok() && controller.set_voltage(limits.max_voltage_v).is_ok() {
        for _ in 0..100 {
            tick(&mut controller, true);
        }
    }
    let off = tick(&mut controller, false);
    assert!(!off.enable && matches!(controller.supervisor().state(), DriverState::Tripped(_)));
}

/// A slot of a flash: a complete header, and a blob that this board takes.
struct Slot {
    sequence: Option<u32>,
    blob: Option<Vec<u8>>,
    erased: bool,
}

fn slot(sector: &[u8]) -> Slot {
    let word = |at: usize| u32::from_le_bytes(*sector[at..].first_chunk().expect("longer"));
    let sequence = (word(0) == !word(4)).then_some(word(0));
    let body = &sector[SLOT_HEADER..][..BLOB_LEN];
    let blob = Blob::decode(body, BOARD).ok().map(|blob| encoded(&blob));
    Slot { sequence, blob, erased: sector[..SLOT_HEADER + BLOB_LEN].iter().all(|&byte| byte == 0xff) }
}

/// The newest slot whose blob is valid wins, and newer ones that are damaged or cut off are reported.
fn load(flash: &RamFlash) -> bool {
    let slots: Vec<Slot> = flash.bytes.chunks(SECTOR).map(slot).collect();
    let mut store = Store::new(flash.clone(), BOARD).expect("two sectors");
    let loaded = store.load();
    let found = loaded.as_ref().ok().map(|stored| (encoded(&stored.blob), stored.newer_lost));
    // Of two numbers that are as far apart as can be, neither is newer.
    let order = match (slots[0].sequence, slots[1].sequence) {
        (Some(first), Some(second)) => match second.wrapping_sub(first) {
            0 | 0x8000_0000 => None,
            1..0x8000_0000 => Some(vec![1, 0]),
            _ => Some(vec![0, 1]),
        },
        (Some(_), None) => Some(vec![0]),
        (None, Some(_)) => Some(vec![1]),
        (None, None) => Some(vec![]),
    };
    if let Some(order) = order {
        let expected = order.iter().position(|&index| slots[index].blob.is_some()).map(|place| {
            let index = order[place];
            // Earlier versions wrote the first set of all to the first slot alone, as number 1.
            let first_of_all = slots[index].sequence == Some(1) && index == 0 && slots[1].erased;
            let lost = place > 0 || (order.len() == 1 && !first_of_all);
            (slots[index].blob.clone().expect("valid"), lost)
        });
        assert_eq!(found, expected, "of the newest slots {order:?}");
    }
    if found.is_none() {
        assert!(matches!(loaded, Err(StoreError::Empty(_))), "{loaded:?}");
    }
    let accepted = found.is_some();
    save(store, &slots, found.map(|(bytes, _)| bytes));
    accepted
}

/// Saved parameters are found. The ones before stay beside them, unless both slots hold what was saved, or it was number 1, beside which
/// remains of another set count more than it.
fn save(mut store: Store<RamFlash>, slots: &[Slot], old: Option<Vec<u8>>) {
    store.save(&GOOD_BLOB).expect("whatever the flash holds");
    let stored = store.load().expect("saved");
    let checksum = u32::from_le_bytes(*GOOD_BLOB.last_chunk().expect("longer"));
    assert_eq!((stored.blob.checksum(), stored.newer_lost), (Some(checksum), false));
    let flash = store.destroy();
    if let Some(old) = old {
        let kept = flash.bytes.chunks(SECTOR).map(slot).zip(slots).any(|(now, before)| {
            now.sequence == before.sequence && now.blob.as_ref() == Some(&old) && before.blob.as_ref() == Some(&old)
        });
        let in_both = flash.bytes.chunks(SECTOR).map(slot).all(|now| now.blob.as_deref() == Some(&GOOD_BLOB[..]));
        let was_first = slots.iter().any(|before| before.sequence == Some(1) && before.blob.as_ref() == Some(&old));
        assert!(kept || in_both || was_first, "the set that ran was erased first");
    }
}

/// Two slots of sequence numbers (4 bytes each), what they hold (a byte, four bits each), and the contents of a blob.
fn slots(data: &[u8]) -> bool {
    let Some((&[a0, a1, a2, a3, b0, b1, b2, b3, held], contents)) = data.split_first_chunk() else { return false };
    let given = sealed(contents);
    let mut flash = RamFlash::default();
    let numbers = [[a0, a1, a2, a3], [b0, b1, b2, b3]].map(u32::from_le_bytes);
    for ((sector, sequence), held) in flash.bytes.chunks_mut(SECTOR).zip(numbers).zip([held & 15, held >> 4]) {
        let mut blob = if held & 1 == 0 { GOOD_BLOB.clone() } else { given.clone() };
        blob.truncate(BLOB_LEN);
        if held & 2 != 0 {
            // A bit of it has flipped, or the end was cut off.
            let at = blob.len() / 2;
            blob[at] ^= 4;
        }
        let complement = if held & 4 == 0 { !sequence } else { sequence };
        if held & 8 == 0 {
            let slot = [&sequence.to_le_bytes(), &complement.to_le_bytes(), blob.as_slice()].concat();
            sector[..slot.len()].copy_from_slice(&slot);
        }
    }
    load(&flash)
}
