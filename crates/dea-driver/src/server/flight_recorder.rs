//! The last ticks of runs, in memory that a reset leaves as it is.

use crate::control::FlightRecord;

/// Memory of a record: its number, tick, state, values, limits, and a checksum of those. Any bits may be in it after power-up.
pub type FlightSlot = [u32; 10];

/// Records per second at the most.
const RATE_HZ: f32 = 1000.0;

/// Keeps the last ticks of runs, including the last one of each, in memory `S` that survives a reset; construct it on the same slots after
/// the reset.
///
/// ```
/// use dea_driver::server::FlightRecorder;
/// use dea_driver::DriverState;
/// use dea_driver::wire::FlightRecord;
///
/// // On a chip: a static that the start does not clear.
/// let mut memory = [[0; 10]; 64];
/// let record = FlightRecord {
///     tick: 7,
///     state: DriverState::Running,
///     command_v: 3000.0,
///     monitor_v: 2998.0,
///     displacement_m: 1e-3,
///     predicted_m: 1.01e-3,
///     reference_m: 1e-3,
///     limited: 0,
/// };
/// FlightRecorder::new(&mut memory).push(&record, 1000.0);
/// // A reset. The memory is as it was.
/// assert_eq!(FlightRecorder::new(&mut memory).record(0), Some(record));
/// ```
#[derive(Clone, Debug)]
pub struct FlightRecorder<S> {
    slots: S,
    /// Number of the newest record; the first has 1.
    newest: u32,
    /// Ticks that were left out since.
    left_out: f32,
}

impl<S: AsRef<[FlightSlot]> + AsMut<[FlightSlot]>> FlightRecorder<S> {
    /// Continues after the records in `slots`; damaged and empty slots are ignored.
    #[must_use]
    pub fn new(slots: S) -> Self {
        let newest = slots.as_ref().iter().filter(|slot| holds(slot)).map(|slot| slot[0]).max().unwrap_or(0);
        Self { slots, newest, left_out: 0.0 }
    }

    /// Adds a tick of a run at `rate_hz`. Of more than 1000 ticks a second some are left out, but never one that ends a run.
    pub fn push(&mut self, record: &FlightRecord, rate_hz: f32) {
        self.left_out += 1.0;
        if record.state.is_live() && self.left_out * RATE_HZ < rate_hz {
            return;
        }
        self.left_out = 0.0;
        self.newest = self.newest.wrapping_add(1);
        let number = self.newest;
        let slots = self.slots.as_mut();
        let Some(slot) = slot_of(number, slots.len()).and_then(|index| slots.get_mut(index)) else { return };
        let mut state = [0; 4];
        // Every state fits, which the test of random records checks.
        let _ = postcard::to_slice(&record.state, &mut state);
        *slot = [
            number,
            record.tick,
            u32::from_le_bytes(state),
            record.command_v.to_bits(),
            record.monitor_v.to_bits(),
            record.displacement_m.to_bits(),
            record.predicted_m.to_bits(),
            record.reference_m.to_bits(),
            record.limited.into(),
            0,
        ];
        slot[9] = checksum(slot);
    }

    /// The record that was added `back` records before the newest, if it is still there and intact.
    #[must_use]
    pub fn record(&self, back: u32) -> Option<FlightRecord> {
        let number = self.newest.checked_sub(back).filter(|&number| number > 0)?;
        let slots = self.slots.as_ref();
        let slot = slots.get(slot_of(number, slots.len())?)?;
        let &[found, tick, state, command_v, monitor_v, displacement_m, predicted_m, reference_m, limited, _] = slot;
        if found != number || !holds(slot) {
            return None;
        }
        let [command_v, monitor_v, displacement_m, predicted_m, reference_m] =
            [command_v, monitor_v, displacement_m, predicted_m, reference_m].map(f32::from_bits);
        let state = postcard::from_bytes(&state.to_le_bytes()).ok()?;
        let limited = u8::try_from(limited).ok()?;
        Some(FlightRecord { tick, state, command_v, monitor_v, displacement_m, predicted_m, reference_m, limited })
    }
}

fn slot_of(number: u32, slots: usize) -> Option<usize> {
    usize::try_from(number).ok()?.checked_rem(slots)
}

fn holds(slot: &FlightSlot) -> bool {
    slot[0] > 0 && slot[9] == checksum(slot)
}

/// Not 0 for memory that is all 0 or all 1.
fn checksum(slot: &FlightSlot) -> u32 {
    slot[..9].iter().fold(0x666c_6967, |sum: u32, word| (sum ^ word).wrapping_mul(0x9e37_79b1).rotate_left(15))
}
