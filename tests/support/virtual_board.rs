//! A board that ticks in a thread of this process, linked by TCP: the driver's own code around a simulated bench.

use std::io::{ErrorKind, Read, Write};
use std::net::TcpListener;
#[cfg(target_os = "linux")]
use std::os::fd::AsRawFd;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use dea_driver::chips::{AdcCode, AdcRange, DacCode};
use dea_driver::server::{Board, FlightRecorder, FlightSlot, Session};
use dea_driver::wire::{FRAME_LEN, FlightRecord, Inspection, Message, Part, boards, encode};
use dea_driver::{Cause, Device, Drive, Inputs, RamFlash, Store};
#[cfg(target_os = "linux")]
use serial2::SerialPort;
use springpot::{Actuator, Law, LawState, VoltageDrive};

use crate::bench::law;

/// Ticks that are late are made up for if it is not by more than this.
const MAX_DELAY: Duration = Duration::from_millis(50);

/// A test that waits for longer than this has failed.
const DEADLINE: Duration = Duration::from_secs(120);

/// Events and parts of the bench.
#[derive(Clone, Copy, Debug)]
pub struct Scene {
    /// Whether the interlock is closed.
    pub interlock_closed: bool,
    /// Opens it once the film is above this voltage (V).
    pub opens_above_v: Option<f32>,
    /// Whether the amplifier goes on with its last voltage when it is disabled: its enable input is welded.
    pub enable_welded: bool,
    /// Whether the film keeps its voltage when the amplifier is disabled, although the enable output is low: no bleeder, or an amplifier
    /// that does not look at its input.
    pub stays_up: bool,
    /// Whether the enable output is held down, so that the amplifier gives nothing.
    pub enable_held_down: bool,
    /// Codes of the monitor's ADC per code that it should show.
    pub monitor_gain: f32,
    /// Answers of the parts of the board.
    pub parts: [Part; 3],
    /// Whether there is a watchdog.
    pub watchdog: bool,
    /// Message of the panic before this start.
    pub panic_message: &'static str,
    /// Stack that was used, bytes.
    pub stack_peak: u32,
    /// How long a tick takes by the host's clock; a millisecond by the board's own.
    pub tick: Duration,
    /// Whether its samples get lost.
    pub mute: bool,
}

impl Scene {
    /// All is well.
    pub const CALM: Self = Self {
        interlock_closed: true,
        opens_above_v: None,
        enable_welded: false,
        stays_up: false,
        enable_held_down: false,
        monitor_gain: 1.0,
        parts: [Part::Answers; 3],
        watchdog: true,
        panic_message: "",
        stack_peak: 1234,
        tick: Duration::from_millis(1),
        mute: false,
    };
}

/// A running board; ends with this value.
#[derive(Debug)]
pub struct VirtualBoard {
    /// Its port, as `--port` takes it.
    pub port: String,
    shown: Arc<Shown>,
    /// Whether a hand has opened the interlock.
    opened: Arc<AtomicBool>,
    ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl VirtualBoard {
    /// Starts a board without parameters.
    pub fn start(scene: Scene) -> Self {
        let listener = TcpListener::bind(("127.0.0.1", 0)).expect("a port");
        let port = format!("tcp:{}", listener.local_addr().expect("bound"));
        listener.set_nonblocking(true).expect("can be polled");
        Self::at(port, scene, move || {
            let (line, _) = listener.accept().ok()?;
            line.set_nonblocking(false).expect("can be set");
            line.set_read_timeout(Some(Duration::from_millis(1))).expect("can be set");
            line.set_nodelay(true).expect("can be set");
            Some(Box::new(line) as Box<dyn Line>)
        })
    }

    /// The same at a pseudo-terminal, which springpot opens as any serial port.
    #[cfg(target_os = "linux")]
    pub fn at_a_serial_port(scene: Scene) -> Self {
        let (mut near, far) = SerialPort::pair().expect("a pseudo-terminal");
        near.set_read_timeout(Duration::from_millis(1)).expect("can be set");
        let link = format!("/proc/self/fd/{}", far.as_raw_fd());
        let port = std::fs::read_link(link).expect("a path").to_string_lossy().into_owned();
        let mut near = Some(near);
        Self::at(port, scene, move || {
            // As long as this end is open, the port does not hang up when springpot closes it.
            let _ = &far;
            near.take().map(|line| Box::new(line) as Box<dyn Line>)
        })
    }

    fn at(port: String, scene: Scene, accept: impl FnMut() -> Option<Box<dyn Line>> + Send + 'static) -> Self {
        let ended = Arc::new(AtomicBool::new(false));
        let (shown, opened) = (Arc::new(Shown::default()), Arc::new(AtomicBool::new(false)));
        let (flag, board, hand) = (Arc::clone(&ended), Arc::clone(&shown), Arc::clone(&opened));
        let thread = Some(thread::spawn(move || run(accept, scene, &flag, &board, &hand)));
        Self { port, shown, opened, ended, thread }
    }

    /// Opens the interlock by hand, or closes it.
    pub fn open_interlock(&self, open: bool) {
        self.opened.store(open, Ordering::Relaxed);
    }

    /// Largest voltage command so far, and the present one, V.
    pub fn voltage(&self) -> (f32, f32) {
        // What was asked for last shows in the next tick.
        let ticks = self.shown.now().ticks + 2;
        self.wait_for(|shown| shown.ticks >= ticks)
    }

    /// Waits until the largest voltage command so far and the present one (V) are as they should be, and returns both.
    pub fn wait_for_voltage(&self, is_reached: impl Fn((f32, f32)) -> bool) -> (f32, f32) {
        self.wait_for(|shown| is_reached(shown.voltage))
    }

    /// Waits until the enable output is low, and returns when it fell.
    pub fn wait_for_disabled(&self) -> Option<Instant> {
        self.wait_for(|shown| !shown.enabled);
        self.shown.now().fell
    }

    /// Waits until it is high.
    pub fn wait_for_enabled(&self) {
        self.wait_for(|shown| shown.enabled);
    }

    fn wait_for(&self, is_there: impl Fn(&Ticks) -> bool) -> (f32, f32) {
        let changed = self.shown.changed.wait_timeout_while(self.shown.now(), DEADLINE, |shown| !is_there(shown));
        let (shown, timeout) = changed.expect("not poisoned");
        assert!(!timeout.timed_out(), "still {shown:?}");
        shown.voltage
    }
}

/// State of the board for the test.
#[derive(Clone, Copy, Debug, Default)]
struct Ticks {
    ticks: u32,
    /// Largest voltage command so far, and the present one, V.
    voltage: (f32, f32),
    /// Whether the enable output is high, and when it fell last.
    enabled: bool,
    fell: Option<Instant>,
}

/// The same for other threads, which wait for a change.
#[derive(Debug, Default)]
struct Shown {
    ticks: Mutex<Ticks>,
    changed: Condvar,
}

impl Shown {
    fn now(&self) -> MutexGuard<'_, Ticks> {
        self.ticks.lock().expect("not poisoned")
    }
}

impl Drop for VirtualBoard {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            assert!(thread.join().is_ok() || thread::panicking(), "the board panicked");
        }
    }
}

/// The board's end of a connection.
trait Line: Read + Write {}

impl<T: Read + Write> Line for T {}

struct Bench {
    device: Device,
    store: Store<RamFlash>,
    scene: Scene,
    /// Whether the watchdog is fed no more.
    starved: bool,
    /// Outlives a reset.
    recorder: FlightRecorder<Vec<FlightSlot>>,
}

impl Board for Bench {
    type Flash = RamFlash;
    const ID: u16 = boards::STM32F405;

    fn with<R>(&mut self, work: impl FnOnce(&mut Device) -> R) -> (R, u32) {
        (work(&mut self.device), 1)
    }

    fn rates_hz(&self) -> (f32, f32) {
        (100.0, 5000.0)
    }

    fn store(&mut self) -> &mut Store<RamFlash> {
        &mut self.store
    }

    fn set_rate(&mut self, _: f32) {}

    fn flight_record(&mut self, back: u32) -> Option<FlightRecord> {
        self.recorder.record(back)
    }

    fn stack_peak(&self) -> u32 {
        self.scene.stack_peak
    }

    fn panic_message(&self) -> &str {
        self.scene.panic_message
    }

    fn stop_feeding_watchdog(&mut self) -> bool {
        self.starved = self.scene.watchdog;
        true
    }
}

fn run(
    mut accept: impl FnMut() -> Option<Box<dyn Line>>,
    scene: Scene,
    ended: &AtomicBool,
    shown: &Shown,
    opened: &AtomicBool,
) {
    let latched = if scene.panic_message.is_empty() { None } else { Some(Cause::Panic) };
    let store = Store::new(RamFlash::default(), boards::STM32F405).expect("two sectors");
    let recorder = FlightRecorder::new(vec![[0; 10]; 64]);
    let mut bench = Bench { device: Device::new(latched), store, scene, starved: false, recorder };
    let mut session = Session::new("virtual");
    let mut stream: Option<Box<dyn Line>> = None;
    let mut drive = Drive::OFF;
    let mut film = Film::new();
    let mut due = Instant::now();
    let mut ticks: u32 = 0;
    while !ended.load(Ordering::Relaxed) {
        // A tick per millisecond, or as slow as the scene has it. Those that this machine is late with are made up for as long as they are few; more of them
        // in a row, while what the host has sent waits, would look like a host that is silent.
        let now = Instant::now();
        due = due.max(now.checked_sub(MAX_DELAY).unwrap_or(now));
        while due <= now {
            due += scene.tick;
            ticks += 1;
            let closed = scene.interlock_closed && !opened.load(Ordering::Relaxed);
            let scene = Scene { interlock_closed: closed, ..scene };
            let (inputs, found) = film.inputs(&scene, drive, ticks);
            drive = bench.device.tick(inputs);
            bench.device.report(found);
            if let Some(record) = bench.device.flight_record() {
                bench.recorder.push(&record, bench.device.rate_hz());
            }
            let command_v = bench.device.status().command_v;
            let mut now = shown.now();
            let fell = if now.enabled && !drive.enable { Some(Instant::now()) } else { now.fell };
            *now = Ticks { ticks, voltage: (now.voltage.0.max(command_v), command_v), enabled: drive.enable, fell };
            shown.changed.notify_all();
        }
        if bench.starved {
            // The chip starts again, with what its flash keeps.
            bench = Bench { device: Device::new(Some(Cause::Watchdog)), starved: false, ..bench };
            session = Session::new("virtual");
            let _ = session.begin(&mut bench);
        }
        if let Some(connected) = accept() {
            stream = Some(connected);
        }
        let Some(line) = &mut stream else {
            thread::sleep(Duration::from_millis(1));
            continue;
        };
        while let Some(record) = bench.device.telemetry() {
            if !scene.mute {
                send(line.as_mut(), &Message::Telemetry(record));
            }
        }
        let mut bytes = [0; 512];
        match line.read(&mut bytes) {
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Ok(0) | Err(_) => stream = None,
            Ok(length) => {
                let mut waiting = bytes[..length].iter().copied();
                while session.turn(&mut waiting, &mut bench, |message| send(line.as_mut(), message)) {}
            }
        }
    }
}

fn send(line: &mut dyn Line, message: &Message) {
    let mut frame = [0; FRAME_LEN + 1];
    let length = encode(message, &mut frame).expect("every message fits");
    // A host that has gone away is no fault of the board's.
    let _ = line.write_all(&frame[..length]);
}

/// The film of the preset `table3-n2`.
struct Film {
    law: Law<f32>,
    drive: VoltageDrive<f32>,
    state: LawState<f32>,
    /// The amplifier's command, V at the DAC.
    volts: f32,
    /// The same a tick ago, when the ADCs sampled.
    sampled: f32,
}

impl Film {
    fn new() -> Self {
        let law: Law<f32> = law();
        let drive = VoltageDrive::new(&Actuator::KARNER_2022, 10e3, law.stiffness()).expect("valid");
        Self { state: law.state(), law, drive, volts: 0.0, sampled: 0.0 }
    }

    /// A monitor that shows the voltage of a tick ago, a sensor of 1 mm/V at 1 V with some noise.
    fn inputs(&mut self, scene: &Scene, drive: Drive, tick: u32) -> (Inputs, Inspection) {
        self.sampled = self.volts;
        let code = if drive.enable { DacCode::from_volts(drive.dac_v, drive.range) } else { DacCode::ZERO };
        let falls = code.volts(drive.range) < self.volts;
        let stays = if drive.enable { scene.stays_up && falls } else { scene.stays_up || scene.enable_welded };
        if !stays {
            self.volts = if scene.enable_held_down { 0.0 } else { code.volts(drive.range) };
        }
        let volts = self.volts;
        let displacement_m = self.law.displacement_under(&mut self.state, self.drive.load(1000.0 * volts));
        let range = AdcRange::UpTo10V24;
        let opened = scene.opens_above_v.is_some_and(|limit| 1000.0 * volts > limit);
        let code_of = |volts: f32| (volts / range.full_scale_v() * 65_536.0) as u16;
        let [dac, monitor, sensor] = scene.parts;
        let interlock_closed = scene.interlock_closed && !opened;
        let shown = |part, code| Some(AdcCode(code).volts(range)).filter(|_| part == Part::Answers);
        let monitor_adc_v = shown(monitor, code_of(scene.monitor_gain * self.sampled));
        let sensor_adc_v = shown(sensor, code_of(1.0 + displacement_m / 1e-3) + 16 * (tick % 4) as u16);
        let found = Inspection {
            interlock_closed,
            enable_high: (drive.enable && !scene.enable_held_down) || scene.enable_welded,
            dac,
            monitor,
            sensor,
            monitor_adc_v: monitor_adc_v.unwrap_or(f32::NAN),
            sensor_adc_v: sensor_adc_v.unwrap_or(f32::NAN),
        };
        (Inputs { interlock_closed, monitor_adc_v, sensor_adc_v }, found)
    }
}
