//! A film behind an emulated supply, and the bytes between them and the host, with the faults that ports and supplies have.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use host_io::error::Result;
use host_io::files::parameters::Parameters;
use host_io::supply::{Line, Supply};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use springpot::{Compressed, Law, LawState, VoltageDrive};

/// Step of the world, s.
const STEP_S: f64 = 1e-3;

/// A fault, from 4 s on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    Nothing,
    /// Every reply is replaced by another device's text.
    AnotherDevice,
    /// A share of the replies has a byte changed.
    Garbled(f64),
    Truncated,
    /// Two replies run into one.
    Merged,
    Repeated,
    /// Commands come back before the replies.
    Echo,
    /// The supply restarts: output off, its name is sent.
    Reset,
    Silent,
    /// No reply and no command any more.
    Unplugged,
    /// The read-back is another share of the voltage.
    Lie(f64),
    /// The supply gives another share of the voltage than it reads back correctly.
    Sags(f64),
    SensorLost,
    Refuses,
    /// The supply, or the sensor, sends bytes without a pause and without a line end.
    Flood,
    SensorFlood,
}

/// The film, the supply and the bytes between it and the host.
pub struct World {
    pub now_s: f64,
    film: Law<f64>,
    state: LawState<f64, Compressed<f64>>,
    drive: VoltageDrive<f64>,
    pub displacement_m: f64,
    pub voltage_v: f64,
    set_v: f64,
    /// The last read-back, as its digits have it, V.
    pub sent_v: f64,
    pub is_on: bool,
    started: bool,
    last_command_s: f64,
    watchdog_s: Option<f64>,
    fault: Fault,
    protocol: &'static str,
    jitter_s: f64,
    random: Pcg64Mcg,
    command: String,
    /// Bytes on their way to the host, and when they are there.
    replies: VecDeque<(f64, u8)>,
    readings: VecDeque<(f64, u8)>,
    held: String,
    /// Bytes of a flood so far.
    flooded: u64,
    /// Time at which 0 V was reached last.
    pub zero_since_s: f64,
    pub largest_v: f64,
}

impl World {
    pub fn new(protocol: &'static str, fault: Fault, jitter_s: f64) -> Rc<RefCell<Self>> {
        let watchdog_s = Supply::load(protocol).expect("shipped").watchdog_s;
        let parameters = Parameters::load("preset:table3-n2").expect("known");
        let film: Law<f64> = parameters.film().compressed_law(1.0 / STEP_S).expect("a law");
        let drive = VoltageDrive::new(&parameters.actuator, 6000.0, film.stiffness()).expect("a drive");
        Rc::new(RefCell::new(Self {
            now_s: 0.0,
            state: film.state(),
            film,
            drive,
            displacement_m: 0.0,
            voltage_v: 0.0,
            set_v: 0.0,
            sent_v: 0.0,
            is_on: false,
            started: false,
            last_command_s: 0.0,
            watchdog_s,
            fault,
            protocol,
            jitter_s,
            random: Pcg64Mcg::seed_from_u64(31),
            command: String::new(),
            replies: VecDeque::new(),
            readings: VecDeque::new(),
            held: String::new(),
            flooded: 0,
            zero_since_s: 0.0,
            largest_v: 0.0,
        }))
    }

    fn fails(&self) -> bool {
        self.now_s > 4.0
    }

    pub fn advance(&mut self, until_s: f64) {
        while self.now_s + 0.5 * STEP_S < until_s {
            self.now_s += STEP_S;
            if self.watchdog_s.is_some_and(|seconds| self.now_s - self.last_command_s > seconds) {
                self.is_on = false;
            }
            if self.fault == Fault::Reset && self.fails() && self.started {
                (self.is_on, self.set_v, self.started) = (false, 0.0, false);
                self.send("springpot emulator");
            }
            let share = if let (Fault::Sags(share), true) = (self.fault, self.fails()) { share } else { 1.0 };
            self.voltage_v = if self.is_on { share * self.set_v } else { 0.0 };
            self.largest_v = self.largest_v.max(self.voltage_v);
            if self.voltage_v > 1.0 {
                self.zero_since_s = self.now_s;
            }
            self.displacement_m = self.film.displacement_under(&mut self.state, self.drive.load(self.voltage_v));
            let has_sensor = !(self.fault == Fault::SensorLost && self.fails());
            if has_sensor && ((self.now_s / STEP_S).round() as u64).is_multiple_of(10) {
                // The film's last digit changes with its noise.
                let noise_m = 1e-6 * (self.random.random::<f64>() - 0.5);
                let line = format!("{:.5} mm\n", 1e3 * (self.displacement_m + noise_m));
                // On the mean 10 ms old at a tick, as the parameters say.
                self.readings.extend(line.bytes().map(|byte| (self.now_s + 0.005, byte)));
            }
        }
    }

    /// A reply of the supply, as it comes to the host.
    fn send(&mut self, reply: &str) {
        let mut reply = reply.to_owned();
        if self.fails() {
            match self.fault {
                Fault::AnotherDevice => reply = "$GPGGA,123519,4807.038,N".into(),
                Fault::Garbled(share) if self.random.random::<f64>() < share => {
                    reply = garbled(&reply, &mut self.random)
                }
                Fault::Truncated => reply.truncate(reply.len() / 2),
                Fault::Silent | Fault::Unplugged => return,
                Fault::Merged if self.held.is_empty() => {
                    self.held = reply;
                    return;
                }
                Fault::Merged => reply = std::mem::take(&mut self.held) + &reply,
                Fault::Repeated => reply = format!("{reply}\r\n{reply}"),
                _ => {}
            }
        }
        let jitter_s = self.jitter_s * self.random.random::<f64>();
        let there_s = self.replies.back().map_or(0.0, |&(time_s, _)| time_s).max(self.now_s + 1e-3 + jitter_s);
        self.replies.extend(format!("{reply}\r\n").bytes().map(|byte| (there_s, byte)));
    }

    fn obey(&mut self) {
        let command = std::mem::take(&mut self.command);
        if self.fails() && self.fault == Fault::Unplugged {
            return;
        }
        self.last_command_s = self.now_s;
        if self.fails() && self.fault == Fault::Echo {
            self.send(&command);
        }
        if self.fails() && self.fault == Fault::Refuses {
            match self.protocol {
                "generic" => self.send("ERR"),
                "shvps" | "hvps-x" => self.send("Err"),
                "technix-sr" => self.send("?"),
                // It keeps its errors to itself, and answers what is asked.
                _ if command.ends_with('?') => {
                    let reply = self.reply(&command, self.voltage_v);
                    self.send(&reply.unwrap_or_default());
                }
                _ => {}
            }
            return;
        }
        let lie = if let (Fault::Lie(share), true) = (self.fault, self.fails()) { share } else { 1.0 };
        if let Some(reply) = self.reply(&command, lie * self.voltage_v) {
            self.send(&reply);
        }
    }

    /// Keeps the voltage of `digits`, which are a number `per_volt`.
    fn shown(&mut self, digits: String, per_volt: f64) -> String {
        self.sent_v = digits.parse::<f64>().expect("a number") / per_volt;
        digits
    }

    /// The reply to `command` of a supply that gives each set-point at once.
    pub fn at_once(&mut self, command: &str) -> Option<String> {
        let set_v = self.set_v;
        self.reply(command, set_v)
    }

    /// Obeys `command` as the protocol says, with `read_v` as the read-back.
    fn reply(&mut self, command: &str, read_v: f64) -> Option<String> {
        let number = |text: &str| text.parse::<f64>().expect("a number");
        let (verb, rest) = command.split_at(command.find([' ', ',']).map_or(command.len(), |at| at + 1));
        match (self.protocol, verb) {
            ("generic", "V ") | ("scpi", "SOUR:VOLT ") => self.set_v = number(rest),
            ("generic", "M?") => return Some(self.shown(format!("{read_v:.1}"), 1.0)),
            ("generic", "ID?") => return Some("springpot emulator".into()),
            ("generic", "ON" | "OFF") => {
                (self.is_on, self.started) = (verb == "ON", verb == "ON");
                return Some("OK".into());
            }
            // Its output is on from the first set-point, and off at 0 V.
            ("shvps" | "hvps-x", "SVset ") => {
                self.set_v = number(rest);
                (self.is_on, self.started) = (self.set_v > 0.0, true);
                return Some(rest.into());
            }
            ("shvps" | "hvps-x", "QVnow") => return Some(self.shown(format!("{read_v:.0}"), 1.0)),
            ("shvps" | "hvps-x", "QName") => return Some("HVPS".into()),
            ("scpi", "MEAS:VOLT?") => return Some(self.shown(format!("{read_v:.3E}"), 1.0)),
            ("scpi", "*IDN?") => return Some("ACME,HV1,0,1.0".into()),
            ("scpi", "OUTP ") => (self.is_on, self.started) = (rest == "ON", rest == "ON"),
            ("technix-sr", "d1,") => {
                self.set_v = number(rest) / COUNTS_PER_VOLT;
                return Some(command.into());
            }
            ("technix-sr", "a1") => {
                let counts = self.shown(format!("{:.0}", COUNTS_PER_VOLT * read_v), COUNTS_PER_VOLT);
                return Some(format!("a1{counts}"));
            }
            ("technix-sr", "a2") => return Some("a20".into()),
            ("technix-sr", "P5,") if rest == "1" => {
                (self.is_on, self.started) = (true, true);
                return Some(command.into());
            }
            ("technix-sr", "P6,") => {
                self.is_on = false;
                return Some(command.into());
            }
            ("technix-sr", "P5," | "P7," | "d2,") => return Some(command.into()),
            // What a set-point that was cut off leaves is refused.
            other => panic!("{other:?}: {command:?}"),
        }
        None
    }
}

/// Counts of the emulated Technix of 10 kV.
const COUNTS_PER_VOLT: f64 = 0.4095;

/// `reply` with a character changed, lost or doubled.
pub fn garbled(reply: &str, random: &mut Pcg64Mcg) -> String {
    let mut bytes = reply.as_bytes().to_vec();
    let at = random.random_range(0..bytes.len());
    match random.random_range(0..4) {
        0 => bytes[at] ^= 1 << random.random_range(0..7),
        1 => drop(bytes.remove(at)),
        2 => bytes.insert(at, bytes[at]),
        _ => bytes.truncate(at),
    }
    bytes.into_iter().map(|byte| if byte < 0x20 { '?' } else { char::from(byte) }).collect()
}

/// The host's end of a wire to the world: of the supply, or of the sensor.
pub struct Wire {
    pub world: Rc<RefCell<World>>,
    pub is_sensor: bool,
}

impl Line for Wire {
    fn name(&self) -> &str {
        "simulated"
    }

    fn now_s(&self) -> f64 {
        self.world.borrow().now_s
    }

    fn send(&mut self, bytes: &[u8]) -> Result<()> {
        let mut world = self.world.borrow_mut();
        for &byte in bytes {
            match byte {
                b'\r' | b'\n' => world.obey(),
                _ => world.command.push(char::from(byte)),
            }
        }
        Ok(())
    }

    fn receive(&mut self, until_s: f64) -> Result<Option<u8>> {
        let mut world = self.world.borrow_mut();
        let flood = if self.is_sensor { Fault::SensorFlood } else { Fault::Flood };
        if world.fault == flood && world.fails() {
            // Forty bytes in a millisecond, which are always there.
            world.flooded += 1;
            if world.flooded.is_multiple_of(40) {
                let until_s = world.now_s + STEP_S;
                world.advance(until_s);
            }
            return Ok(Some(b'7'));
        }
        // What the sensor has sent is read without waiting: two ports are read at the same time.
        if self.is_sensor {
            let now_s = world.now_s;
            let has_come = world.readings.front().is_some_and(|&(time_s, _)| time_s <= now_s);
            return Ok(has_come.then(|| world.readings.pop_front()).flatten().map(|(_, byte)| byte));
        }
        let next_s = world.replies.front().map(|&(time_s, _)| time_s);
        match next_s {
            Some(time_s) if time_s <= until_s => {
                world.advance(time_s);
                Ok(world.replies.pop_front().map(|(_, byte)| byte))
            }
            _ => {
                world.advance(until_s);
                Ok(None)
            }
        }
    }
}
