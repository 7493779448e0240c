//! Garbled replies of every shipped supply: no single one makes the host believe a voltage that the commands of its time do not explain.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use host_io::error::Result;
use host_io::supply::{Line, Session, Supply, shipped};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::emulated::{Fault, World};

/// Garbled replies of all supplies together.
const GARBLED: usize = 1_000_000;
/// Time between set-points, s.
const TICK_S: f64 = 0.02;

/// A supply that gives each set-point at once.
struct Device {
    world: Rc<RefCell<World>>,
    now_s: f64,
    command: String,
    replies: VecDeque<u8>,
    /// Whether a byte of the next reply to be sent is changed, lost, doubled or inserted.
    garbles: bool,
    random: Pcg64Mcg,
}

/// The host's end of its wire.
struct Wire(Rc<RefCell<Device>>);

impl Device {
    fn obey(&mut self) {
        let command = std::mem::take(&mut self.command);
        let Some(reply) = self.world.borrow_mut().at_once(&command) else { return };
        let mut bytes = format!("{reply}\r\n").into_bytes();
        if std::mem::take(&mut self.garbles) {
            let at = self.random.random_range(0..bytes.len() - 1);
            match self.random.random_range(0..5) {
                0 => bytes[at] ^= 1 << self.random.random_range(0..8),
                1 => drop(bytes.remove(at)),
                2 => bytes.insert(at, bytes[at]),
                3 => bytes.insert(at, self.random.random()),
                _ => drop(bytes.drain(at..bytes.len() - 2)),
            }
        }
        self.replies.extend(bytes);
    }
}

impl Line for Wire {
    fn name(&self) -> &str {
        "garbled"
    }

    fn now_s(&self) -> f64 {
        self.0.borrow().now_s
    }

    fn send(&mut self, bytes: &[u8]) -> Result<()> {
        let mut device = self.0.borrow_mut();
        for &byte in bytes {
            match byte {
                b'\r' | b'\n' => device.obey(),
                _ => device.command.push(char::from(byte)),
            }
        }
        Ok(())
    }

    fn receive(&mut self, until_s: f64) -> Result<Option<u8>> {
        let mut device = self.0.borrow_mut();
        let byte = device.replies.pop_front();
        device.now_s = if byte.is_none() { until_s.max(device.now_s) } else { device.now_s };
        Ok(byte)
    }
}

/// Every other reply is garbled while the voltage goes up and down. A misread reply is one whose number is not what the device sent, is taken for
/// the voltage and does not end the run. The numbers that are taken for it all lie within the error of the read-back of what the commands of its time
/// explain; a single one never shows as a deviation.
#[test]
fn no_garbled_reply_is_misread() {
    let supplies: Vec<&str> = shipped().collect();
    for name in &supplies {
        let supply = Supply::load(name).expect("shipped");
        let device = Rc::new(RefCell::new(Device {
            world: World::new(name, Fault::Nothing, 0.0),
            now_s: 0.0,
            command: String::new(),
            replies: VecDeque::new(),
            garbles: false,
            random: Pcg64Mcg::seed_from_u64(7),
        }));
        let begin = || Session::begin(supply.clone(), Box::new(Wire(Rc::clone(&device)))).expect("begins");
        let slew_v_per_s = 0.2 * supply.max_voltage_v;
        let (mut session, mut since_s) = (begin(), device.borrow().now_s);
        let (mut garbled, mut ended, mut other, mut largest_v) = (0, 0, 0, 0.0_f64);
        for k in 0.. {
            if garbled == GARBLED / supplies.len() {
                break;
            }
            // Up and down between 0 and 0.8 of the largest voltage.
            let phase_s = (device.borrow().now_s - since_s) % 8.0;
            let volts = slew_v_per_s * phase_s.min(8.0 - phase_s);
            let garbles = k % 2 == 1;
            garbled += usize::from(garbles);
            let before_v = session.reading_v();
            // The reply to the set-point, where there is one, or that to the query.
            let at_query = supply.set.reply.is_none() || device.borrow_mut().random.random();
            device.borrow_mut().garbles = garbles && !at_query;
            let set = session.set(volts);
            device.borrow_mut().garbles |= garbles && at_query;
            let until_s = device.borrow().now_s + TICK_S;
            let listened = set.and_then(|_| if session.is_reading() { Ok(()) } else { session.query() });
            if listened.and_then(|()| session.listen(until_s)).is_err() {
                ended += 1;
                drop(session);
                device.borrow_mut().replies.clear();
                device.borrow_mut().garbles = false;
                (session, since_s) = (begin(), device.borrow().now_s);
                continue;
            }
            let sent_v = device.borrow().world.borrow().sent_v;
            let read_v = session.reading_v().filter(|read_v| garbles && Some(*read_v) != before_v);
            if let Some(read_v) = read_v.filter(|read_v| (read_v - sent_v).abs() > 1e-6) {
                other += 1;
                largest_v = largest_v.max((read_v - sent_v).abs());
                // What is explained: the commands of the settling time and of two ticks, and the read-back's own error.
                let explained_v =
                    slew_v_per_s * (supply.settle_s + 3.0 * TICK_S) + supply.read_band_v + 0.02 * (volts + 200.0);
                assert!((read_v - sent_v).abs() <= explained_v, "{name}: {read_v} V for {sent_v} V");
            }
            assert_eq!(session.deviation_v(), 0.0, "{name}: a single garbled reply counts as a deviation");
        }
        println!(
            "{name}: {garbled} garbled, {ended} ended the run, {other} taken as up to {largest_v:.0} V more or less"
        );
    }
}
