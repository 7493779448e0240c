//! The loop through a supply at a serial port, on a simulated film behind an emulated supply, with the faults that ports and supplies have.
//! The clock is simulated: a run of 20 s takes a part of a second.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::f64::consts::TAU;
use std::path::Path;
use std::rc::Rc;
use std::sync::atomic::AtomicBool;

use host_io::error::{Error, Result};
use host_io::files::parameters::Parameters;
use host_io::supply::{Follow, Line, Row, Sensor, Session, Summary, Supply, Template, controller, follow, shipped};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use springpot::{Compressed, Law, LawState, VoltageDrive};

/// Step of the world, s.
const STEP_S: f64 = 1e-3;

/// A fault, from 4 s on.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    Nothing,
    /// Every reply is replaced by another device's text.
    AnotherDevice,
    /// A share of the replies has a byte changed.
    Garbled(f64),
    /// Replies lose their ends.
    Truncated,
    /// Two replies run into one.
    Merged,
    /// Every reply comes twice.
    Repeated,
    /// Commands come back before the replies.
    Echo,
    /// The supply restarts: output off, its name is sent.
    Reset,
    /// No reply any more.
    Silent,
    /// No reply and no command any more.
    Unplugged,
    /// The read-back is another share of the voltage.
    Lie(f64),
    /// The supply gives another share of the voltage than it reads back correctly.
    Sags(f64),
    /// The sensor sends nothing any more.
    SensorLost,
    /// Commands are refused.
    Refuses,
    /// The supply, or the sensor, sends bytes without a pause and without a line end.
    Flood,
    SensorFlood,
}

/// The film, the supply and the bytes between it and the host.
struct World {
    now_s: f64,
    film: Law<f64>,
    state: LawState<f64, Compressed<f64>>,
    drive: VoltageDrive<f64>,
    displacement_m: f64,
    voltage_v: f64,
    set_v: f64,
    is_on: bool,
    started: bool,
    last_command_s: f64,
    watchdog_s: Option<f64>,
    fault: Fault,
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
    zero_since_s: f64,
    largest_v: f64,
}

impl World {
    fn new(fault: Fault, jitter_s: f64, watchdog_s: Option<f64>, softer: f64) -> Rc<RefCell<Self>> {
        let parameters = Parameters::load("preset:table3-n2").expect("known");
        let film: Law<f64> = parameters.film().compressed_law(1.0 / STEP_S).expect("a law");
        let drive = VoltageDrive::new(&parameters.actuator, 6000.0 * softer, film.stiffness()).expect("a drive");
        Rc::new(RefCell::new(Self {
            now_s: 0.0,
            state: film.state(),
            film,
            drive,
            displacement_m: 0.0,
            voltage_v: 0.0,
            set_v: 0.0,
            is_on: false,
            started: false,
            last_command_s: 0.0,
            watchdog_s,
            fault,
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

    fn advance(&mut self, until_s: f64) {
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
            self.send("ERR");
            return;
        }
        let lie = if let (Fault::Lie(share), true) = (self.fault, self.fails()) { share } else { 1.0 };
        let read = format!("{:.1}", lie * self.voltage_v);
        match command.split_once(' ').unwrap_or((command.as_str(), "")) {
            ("V", volts) => self.set_v = volts.parse().expect("a number"),
            ("SVset", volts) => {
                self.set_v = volts.parse().expect("a number");
                self.is_on = true;
                self.send(volts);
            }
            ("M?" | "QVnow", _) => self.send(&read),
            ("ID?" | "QName", _) => self.send("springpot emulator"),
            ("ON", _) => {
                (self.is_on, self.started) = (true, true);
                self.send("OK");
            }
            ("OFF", _) => {
                self.is_on = false;
                self.send("OK");
            }
            other => panic!("{other:?}"),
        }
    }
}

/// `reply` with a character changed, lost or doubled.
fn garbled(reply: &str, random: &mut Pcg64Mcg) -> String {
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
struct Wire {
    world: Rc<RefCell<World>>,
    is_sensor: bool,
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

fn reference_m(time_s: f64) -> f64 {
    0.8e-3 - 0.2e-3 * (TAU * time_s / 10.0).cos()
}

fn supply(name: &str, rate_hz: f64, step_v: f64) -> Supply {
    Supply { rate_hz, step_v, ..Supply::load(name).expect("shipped") }
}

/// Follows the sine for `seconds` and returns how it ended, with the film's errors (m) in every millisecond of the rows.
fn runs(world: &Rc<RefCell<World>>, supply: Supply, with_sensor: bool, seconds: f64) -> (Result<Summary>, Vec<Row>) {
    let wire = |is_sensor| Box::new(Wire { world: Rc::clone(world), is_sensor });
    let parameters = Parameters::load("preset:table3-n2").expect("known");
    let made = controller(&parameters, &supply, with_sensor).expect("a controller");
    let mut rows = Vec::new();
    let ticks = (seconds * supply.rate_hz) as usize;
    let stop = AtomicBool::new(false);
    let what = Follow { reference_m: &reference_m, ticks, stop: &stop };
    let ended = Session::begin(supply, wire(false)).and_then(|session| {
        let sensor = with_sensor.then(|| Sensor::new(wire(true), "mm").expect("a unit"));
        follow(session, made, sensor, &what, |row| {
            // The film as it is, not as it was read.
            rows.push(Row { displacement_m: world.borrow().displacement_m, ..row });
            Ok(())
        })
    });
    (ended, rows)
}

/// RMS error from 10 s on, in % of peak to peak: the film against the reference of the same time.
fn error_pct(rows: &[Row]) -> f64 {
    let late: Vec<f64> =
        rows.iter().filter(|row| row.time_s > 10.0).map(|row| row.displacement_m - row.reference_m).collect();
    100.0 * (late.iter().map(|e| e * e).sum::<f64>() / late.len() as f64).sqrt() / 0.4e-3
}

/// A supply with steps of 5 V whose replies come up to 50 ms late: the film of the model follows a sine without a sensor, and one that is
/// softer than its model does with one.
#[test]
fn a_sine_is_followed_through_steps_and_jitter() {
    let world = World::new(Fault::Nothing, 0.05, Some(0.5), 1.0);
    let (ended, rows) = runs(&world, supply("generic", 100.0, 5.0), false, 30.0);
    assert!(ended.expect("to its end").is_complete);
    let open_pct = error_pct(&rows);
    let world = World::new(Fault::Nothing, 0.05, Some(0.5), 1.0);
    let (ended, rows) = runs(&world, supply("generic", 100.0, 5.0), true, 30.0);
    assert!(ended.expect("to its end").is_complete);
    let closed_pct = error_pct(&rows);
    let volts = rows.iter().map(|row| row.command_v);
    println!("{:.0} to {:.0} V", volts.clone().skip(1000).fold(f64::MAX, f64::min), volts.fold(0.0, f64::max));
    println!("{open_pct:.3} % without a sensor, {closed_pct:.3} % with one");
    assert!(open_pct < 0.3 && closed_pct < 0.15, "{open_pct} %, {closed_pct} %");
    assert!(!world.borrow().is_on && world.borrow().voltage_v == 0.0);
}

/// Every fault ends the run with an error that names it, and at 0 V with the output off: by the host, or by the watchdog where the line is cut.
#[test]
fn every_fault_ends_at_0_v() {
    // Fault, words of its error, and the time in which 0 V must be reached, s.
    let faults = [
        (Fault::AnotherDevice, "not as described", 0.3),
        (Fault::Garbled(1.0), "not as described", 0.5),
        (Fault::Truncated, "", 1.2),
        (Fault::Merged, "", 0.6),
        (Fault::Echo, "not as described", 0.3),
        (Fault::Reset, "", 0.6),
        (Fault::Silent, "no reply within 0.25 s", 0.6),
        (Fault::Unplugged, "no reply within 0.25 s", 1.2),
        (Fault::Lie(0.95), "Monitor", 0.7),
        (Fault::Lie(1.05), "Monitor", 0.7),
        (Fault::Sags(0.9), "Monitor", 0.7),
        (Fault::Sags(1.2), "Monitor", 0.7),
        (Fault::SensorLost, "Sensor", 0.3),
        (Fault::Refuses, "refuses", 1.6),
        (Fault::Flood, "no reply within 0.25 s", 1.2),
        (Fault::SensorFlood, "Sensor", 0.6),
    ];
    for (fault, words, within_s) in faults {
        let world = World::new(fault, 0.02, Some(0.5), 1.0);
        let (ended, rows) = runs(&world, supply("generic", 50.0, 5.0), true, 20.0);
        let now_s = world.borrow().now_s;
        world.borrow_mut().advance(now_s + 1.0);
        let world = world.borrow();
        let error = ended.expect_err("a fault").to_string();
        println!("{fault:?}: {error}; 0 V {:.2} s after it", world.zero_since_s - 4.0);
        assert!(error.contains(words), "{fault:?}: {error}");
        assert!(world.largest_v > 1500.0 && !rows.is_empty(), "{fault:?}: nothing was played");
        assert!(!world.is_on && world.voltage_v == 0.0, "{fault:?}");
        assert!(world.zero_since_s < 4.0 + within_s, "{fault:?}: {:.2} s", world.zero_since_s - 4.0);
    }
}

/// A few garbled replies, and replies that come twice, do not end a run.
#[test]
fn single_garbled_replies_are_ridden_through() {
    for fault in [Fault::Garbled(0.02), Fault::Repeated] {
        let world = World::new(fault, 0.005, Some(0.5), 1.0);
        let (ended, _) = runs(&world, supply("generic", 50.0, 5.0), false, 8.0);
        println!("{fault:?}: {ended:?}");
        assert!(!world.borrow().is_on && world.borrow().voltage_v == 0.0);
        assert!(ended.expect("to its end").is_complete);
    }
}

/// Another device at the port is sent its identification and nothing else; a supply with voltage on it is not started.
#[test]
fn another_device_is_refused_before_anything_is_set() {
    struct Other(Vec<u8>, VecDeque<u8>, f64);
    impl Line for Other {
        fn name(&self) -> &str {
            "other"
        }
        fn now_s(&self) -> f64 {
            self.2
        }
        fn send(&mut self, bytes: &[u8]) -> Result<()> {
            self.0.extend(bytes);
            assert_eq!(self.0, b"ID?\n", "something was sent to an unknown device");
            self.1.extend(b"ok T:21.3 /0.0\n");
            Ok(())
        }
        fn receive(&mut self, until_s: f64) -> Result<Option<u8>> {
            let byte = self.1.pop_front();
            self.2 = if byte.is_none() { until_s.max(self.2) } else { self.2 };
            Ok(byte)
        }
    }
    let refused = Session::begin(supply("generic", 50.0, 5.0), Box::new(Other(Vec::new(), VecDeque::new(), 0.0)));
    let error = refused.err().expect("refused").to_string();
    assert!(error.contains("no generic at this port"), "{error}");
}

/// A garbled reply is refused, or is a number that the read-back's check decides on: none is taken for another voltage. 1e6 of them, and as
/// many as `SPRINGPOT_SWEEP` asks for.
#[test]
fn no_garbled_reply_is_misread() {
    let mut random = Pcg64Mcg::seed_from_u64(1);
    let replies = ["a1{}", "{}", "d1,{=}", "OK"].map(|text| Template::try_from(text.to_owned()).expect("a template"));
    let (mut refused, mut plausible) = (0, 0);
    for k in 0..1_000_000_u32 {
        let (template, volts) = (&replies[k as usize % 4], f64::from(random.random_range(0..4096_u32)));
        let sound = match k % 4 {
            0 => format!("a1{volts}"),
            1 => format!("{volts}"),
            2 => format!("d1,{volts}"),
            _ => "OK".into(),
        };
        assert!(template.read(&sound, volts).is_some());
        let bad = garbled(&sound, &mut random);
        match template.read(&bad, volts) {
            // What was sent back, and words, are right or refused: changed text may still be the same number.
            Some(value) if k % 4 >= 2 => {
                assert!(value.is_nan() || (value - volts).abs() <= 1e-3 * volts.max(1.0), "{bad}")
            }
            // A digit more or less is another number, and no text shows that: the session compares it with the commands.
            Some(value) => {
                let shown: f64 = bad.trim_start_matches("a1").parse().expect("a number");
                assert_eq!(value, shown, "{bad} is read as {value}");
                plausible += 1;
            }
            None => refused += 1,
        }
    }
    println!("{refused} refused, {plausible} left to the comparison with the commands");
    assert!(refused > 500_000, "{refused}");
}

/// Shipped descriptions can be read, name their source, and state that they were not tried.
#[test]
fn shipped_descriptions_are_whole() {
    for name in shipped() {
        let supply = Supply::load(name).expect(name);
        assert!(supply.source.contains("ot tried on"), "{name}: {}", supply.source);
        let parameters = Parameters::load("preset:table3-n2").expect("known");
        assert!(controller(&parameters, &supply, true).is_ok(), "{name}");
    }
    let refused = |text: &str| Supply::from_toml(Path::new("s.toml"), text).expect_err("refused").to_string();
    assert!(refused("name = 1").starts_with("s.toml:1: "));
    assert!(matches!(Supply::load("unknown"), Err(Error::Field { field: "supply", .. })));
}
