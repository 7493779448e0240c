//! The link: bytes from the line and whole requests, to a board that ticks.

use dea_driver::server::{Board, Session};
use dea_driver::wire::{Answer, Message, Reject, encode};
use dea_driver::{Cause, Device, Drive, DriverState, Inputs, Mode, RamFlash, Store};

use crate::line::{Heading, Received, Rx, seal};
use crate::{BOARD, GOOD_BLOB};

/// Most ticks of an input, so that none takes long.
const MAX_TICKS: u32 = 5000;

/// Longer than there is room for in a message, and its last character is not cut in half.
const PANIC: &str = "ü panicked at a file whose name is long, so long that it does not fit in the two hundred characters that there \
    are for it, and goes on beyond them with letters of two bytes: üüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüüü";

/// Runs a conversation. The first byte states how the board starts; then come records of a kind, a length and as many bytes:
///
/// | kind, modulo 4 | bytes |
/// | --- | --- |
/// | 0 | from the line, as they are |
/// | 1 | a request, which gets version, checksum and stuffing: sequence number, token and command in postcard |
/// | 2 | likewise, the next from the host that armed: the command alone |
/// | 3 | faults of the bench, and a number of ticks |
///
/// Returns whether there was a command above 0 V.
pub fn run(data: &[u8]) -> bool {
    let Some((&start, mut rest)) = data.split_first() else { return false };
    let mut trial = Trial::new(start);
    while let Some((&[kind, length], behind)) = rest.split_first_chunk() {
        let (bytes, later) = behind.split_at(behind.len().min(usize::from(length)));
        match kind % 4 {
            0 => trial.send(bytes),
            1 => trial.send(&seal(bytes)),
            2 => {
                trial.newest = trial.newest.wrapping_add(1);
                trial.send(&seal(
                    &[varint::<5>(trial.newest).as_slice(), &varint::<3>(trial.token.into()), bytes].concat(),
                ));
            }
            _ => {
                if let &[faults, ticks, ..] = bytes {
                    (0..ticks).for_each(|_| trial.tick(faults));
                }
            }
        }
        rest = later;
    }
    trial.driven
}

/// In so many bytes.
fn varint<const N: usize>(value: u32) -> [u8; N] {
    std::array::from_fn(|k| (value >> (7 * k) & 0x7f) as u8 | if k + 1 < N { 0x80 } else { 0 })
}

/// A bench whose amplifier follows at once, and whose film does not move.
struct Bench {
    device: Device,
    store: Store<RamFlash>,
}

impl Board for Bench {
    type Flash = RamFlash;
    const ID: u16 = BOARD;

    fn with<R>(&mut self, work: impl FnOnce(&mut Device) -> R) -> (R, u32) {
        (work(&mut self.device), 1)
    }

    fn rates_hz(&self) -> (f32, f32) {
        (100.0, 2000.0)
    }

    fn store(&mut self) -> &mut Store<RamFlash> {
        &mut self.store
    }

    fn set_rate(&mut self, rate_hz: f32) {
        assert!((100.0..=2000.0).contains(&rate_hz), "{rate_hz} Hz");
    }

    fn panic_message(&self) -> &str {
        PANIC
    }
}

/// The board, and what dea-driver/doc/link.md lets it do.
struct Trial {
    session: Session,
    bench: Bench,
    rx: Rx,
    drive: Drive,
    ticks: u32,
    /// Token of the host that armed last; 0 before.
    token: u16,
    /// Number of its newest request.
    newest: u32,
    /// Ticks since a request kept the amplifier enabled.
    idle: u32,
    /// The mode of the run, from the host's request.
    mode: Mode,
    /// Whether a target of that mode was taken in this run.
    led: bool,
    /// Whether there was a command above 0 V.
    driven: bool,
}

impl Trial {
    fn new(start: u8) -> Self {
        let mut flash = RamFlash::default();
        let latched = (start & 2 != 0).then_some(Cause::Watchdog);
        let kept = start & 1 == 0;
        if kept {
            let mut store = Store::new(flash, BOARD).expect("two sectors");
            store.save(&GOOD_BLOB).expect("valid");
            flash = store.destroy();
        }
        let store = Store::new(flash, BOARD).expect("two sectors");
        let mut bench = Bench { device: Device::new(latched), store };
        let mut session = Session::new("0.1.0");
        assert_eq!(session.begin(&mut bench).is_ok(), kept);
        Self {
            session,
            bench,
            rx: Rx::default(),
            drive: Drive::OFF,
            ticks: 0,
            token: 0,
            newest: 0,
            idle: 0,
            mode: Mode::Voltage,
            led: false,
            driven: false,
        }
    }

    fn send(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            let before = self.bench.device.state();
            let answer = self.session.serve(byte, &mut self.bench);
            let after = self.bench.device.state();
            match (self.rx.receive(byte), answer) {
                (None, None) => assert_eq!(before, after, "no frame has ended"),
                (Some(received), Some(Message::Answer { sequence, answer })) => {
                    fits_in_a_frame(sequence, &answer);
                    self.check(&received, (sequence, &answer), before, after);
                }
                (received, answer) => panic!("{received:?}, answered {answer:?}"),
            }
        }
    }

    fn check(
        &mut self,
        received: &Received,
        (sequence, answer): (u32, &Answer),
        before: DriverState,
        after: DriverState,
    ) {
        match received {
            Received::Damaged | Received::Unknown => {
                let reject = if *received == Received::Damaged { Reject::Damaged } else { Reject::Unknown };
                assert_eq!((sequence, answer), (0, &Answer::Rejected(reject)));
                assert_eq!(before, after, "obeyed what is no request");
            }
            Received::Request(heading) => {
                assert_eq!(sequence, heading.sequence);
                self.check_request(*heading, answer, before, after);
            }
        }
    }

    fn check_request(&mut self, heading: Heading, answer: &Answer, before: DriverState, after: DriverState) {
        use DriverState::{Armed, Disarmed, Running, Tripped};
        let done = !matches!(answer, Answer::Refused(_) | Answer::Rejected(_) | Answer::Stale { .. });
        let marked = matches!(heading.command, 1 | 4 | 8 | 9 | 24);
        if marked && before.is_live() && (heading.token == 0 || heading.token != self.token) {
            assert_eq!(*answer, Answer::Rejected(Reject::Token), "{heading:?}");
        }
        let allowed = match heading.command {
            _ if !done => before == after,
            3 => (before, after) == (Disarmed, Armed),
            4 => (before, after) == (Armed, Running),
            5 => (before, after) == (Running, Armed),
            6 => !matches!(before, Tripped(_)) && after == Disarmed,
            // One that was hidden by another is reported next.
            7 => matches!(before, Tripped(_)) && matches!(after, Disarmed | Tripped(Cause::Parameters)),
            8 | 9 => before == after && before.is_live(),
            11 | 14 | 15 | 16 | 19 | 22 | 23 | 27 => before == after && !before.is_live(),
            20 => !before.is_live() && (after == before || after == Tripped(Cause::Parameters)),
            _ => before == after,
        };
        assert!(allowed, "{heading:?} in {before:?}: {answer:?}, {after:?}");
        match *answer {
            Answer::Armed { token } => {
                assert!(heading.command == 3 && token != 0 && token != self.token, "{token} after {}", self.token);
                (self.token, self.newest, self.idle) = (token, heading.sequence, 0);
            }
            _ => assert!(heading.command != 3 || !done),
        }
        if done && marked {
            self.idle = 0;
        }
        match heading.command {
            4 if done => {
                self.mode = [Mode::Voltage, Mode::Feedforward, Mode::Tracking][usize::from(heading.first)];
                self.led = false;
            }
            8 if done && after == Running => self.led |= self.mode == Mode::Voltage,
            9 if done && after == Running => self.led |= self.mode != Mode::Voltage,
            _ => {}
        }
    }

    /// A tick; the lower bits of `faults` open the interlock and silence the converters, the upper ones stop the monitor.
    fn tick(&mut self, faults: u8) {
        if self.ticks == MAX_TICKS {
            return;
        }
        self.ticks += 1;
        self.idle += 1;
        let before = self.bench.device.state();
        let last_v = self.commanded_v();
        let inputs = Inputs {
            interlock_closed: faults & 1 == 0,
            monitor_adc_v: (faults & 2 == 0).then_some(if faults & 8 == 0 { self.drive.dac_v } else { 0.0 }),
            sensor_adc_v: (faults & 4 == 0).then_some(1.0 + 2e-3 * (self.ticks % 3) as f32),
        };
        self.drive = self.bench.device.tick(inputs);
        let after = self.bench.device.state();
        let Drive { enable, dac_v, .. } = self.drive;
        self.driven |= dac_v > 0.0;
        assert_eq!(enable, after.is_live());
        // A tick trips; it arms and starts nothing.
        assert!(after == before || matches!(after, DriverState::Tripped(_)), "{before:?}, then {after:?}");
        if inputs.interlock_closed && inputs.monitor_adc_v.is_some() {
            assert!(dac_v == 0.0 || (after == DriverState::Running && self.led), "{dac_v} V in {after:?}");
        } else {
            assert!(!enable, "an open interlock, or no monitor");
        }
        assert!(enable || dac_v == 0.0);
        while self.bench.device.telemetry().is_some() {}
        self.keeps_its_limits(last_v, enable);
    }

    fn commanded_v(&self) -> f32 {
        self.bench.device.status().command_v
    }

    /// Limits of the parameters in force: voltage, slew, and the time that a silent host has.
    fn keeps_its_limits(&self, last_v: f32, enable: bool) {
        let Some(controller) = self.bench.device.controller() else {
            assert!(!enable, "enabled without parameters");
            return;
        };
        let limits = controller.parameters().limits;
        let command_v = self.commanded_v();
        assert!((0.0..=limits.max_voltage_v).contains(&command_v), "{command_v} V");
        let rate_hz = controller.parameters().rate_hz;
        let step_v = limits.max_slew_v_per_s / rate_hz;
        // At the end of a run it falls to 0 V at once. One part in ten thousand for rounding.
        let slewed = (command_v - last_v).abs() <= 1.0001 * step_v;
        assert!(
            !enable || slewed || (command_v == 0.0 && self.bench.device.state() == DriverState::Armed),
            "from {last_v} V to {command_v} V"
        );
        assert!(
            !enable || self.idle as f32 <= limits.heartbeat_s * rate_hz + 1.0,
            "{} ticks without a host",
            self.idle
        );
    }
}

fn fits_in_a_frame(sequence: u32, answer: &Answer) {
    let mut frame = [0; 400];
    let message = Message::Answer { sequence, answer: answer.clone() };
    let length = encode(&message, &mut frame).expect("every answer fits");
    assert!(length <= 361, "{length} bytes");
}
