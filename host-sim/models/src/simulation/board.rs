//! A board that ticks in this process, at a port of this computer: the driver's own code around a simulated film.

use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use dea_driver::chips::Converters;
use dea_driver::server::{Board, FlightRecorder, FlightSlot, Session};
use dea_driver::wire::{FRAME_LEN, FlightRecord, Inspection, Message, Part, boards, encode};
use dea_driver::{Device, Drive, Inputs, RamFlash, Store};

use crate::error::{Error, Result};
use crate::simulation::film::{Film, Instruments, Plant as Kind, Readings};
use crate::simulation::plant::{NonlinearPlant, Plant};

/// A tick, and the substeps of the film in it.
const TICK: Duration = Duration::from_millis(1);
const SUBSTEPS: u32 = 2;
/// Ticks that are late are made up for if it is not by more than this.
const MAX_DELAY: Duration = Duration::from_millis(50);
/// Reading of an ADC without a signal, V.
const NO_SIGNAL_V: f32 = 0.0;

/// A running board; ends with this value.
#[derive(Debug)]
pub struct SimulatedBoard {
    /// Its port, as a [`Port`](host_io::link::Port) is named.
    pub port: String,
    ended: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl SimulatedBoard {
    /// Starts a board without parameters, at a film of this kind; noise of its instruments from `seed`.
    ///
    /// # Errors
    ///
    /// [`Error::Link`] where this computer has no port left.
    pub fn start(film: Kind, seed: u64) -> Result<Self> {
        let fault = |e: std::io::Error| Error::Link { port: "simulated film".into(), cause: e.to_string() };
        let listener = TcpListener::bind(("127.0.0.1", 0)).map_err(fault)?;
        listener.set_nonblocking(true).map_err(fault)?;
        let port = format!("tcp:{}", listener.local_addr().map_err(fault)?);
        let ended = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&ended);
        let thread = thread::spawn(move || run(&listener, film, seed, &flag));
        Ok(Self { port, ended, thread: Some(thread) })
    }
}

impl Drop for SimulatedBoard {
    fn drop(&mut self) {
        self.ended.store(true, Ordering::Relaxed);
        // A panic there has shown itself.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

struct Bench {
    device: Device,
    store: Store<RamFlash>,
    recorder: FlightRecorder<Vec<FlightSlot>>,
}

impl Board for Bench {
    type Flash = RamFlash;
    const ID: u16 = boards::STM32F405;

    fn with<R>(&mut self, work: impl FnOnce(&mut Device) -> R) -> (R, u32) {
        (work(&mut self.device), 1)
    }

    fn rates_hz(&self) -> (f32, f32) {
        (1000.0, 1000.0)
    }

    fn store(&mut self) -> &mut Store<RamFlash> {
        &mut self.store
    }

    fn set_rate(&mut self, _: f32) {}

    fn flight_record(&mut self, back: u32) -> Option<FlightRecord> {
        self.recorder.record(back)
    }
}

/// Film, amplifier and instruments, as calibrated as the controller's parameters say.
struct Around<'a> {
    plant: NonlinearPlant<'a>,
    readings: Readings,
    drive: Drive,
    film_v: f64,
}

impl Around<'_> {
    fn tick(&mut self, device: &mut Device) {
        let parameters = device.controller().map(|controller| controller.parameters());
        let commanded_v = parameters.map_or(0.0, |known| known.amplifier.apply(self.drive.dac_v));
        self.film_v = if self.drive.enable { f64::from(commanded_v) } else { 0.0 };
        (0..SUBSTEPS).for_each(|_| self.plant.advance(self.film_v));
        let (volts, metres) =
            (self.readings.voltage_v(self.film_v), self.readings.displacement_m(self.plant.displacement_m()));
        let of = |calibration: &dea_driver::chips::Calibration, value: f64| calibration.invert(value as f32);
        let monitor = parameters.map_or(NO_SIGNAL_V, |known| of(&known.monitor, volts));
        let sensor = parameters.map_or(NO_SIGNAL_V, |known| of(&known.sensor, metres));
        let enable_high = self.drive.enable;
        self.drive =
            device.tick(Inputs { interlock_closed: true, monitor_adc_v: Some(monitor), sensor_adc_v: Some(sensor) });
        let [dac, answers, seen] = [Part::Answers; 3];
        device.report(Inspection {
            interlock_closed: true,
            enable_high,
            dac,
            monitor: answers,
            sensor: seen,
            monitor_adc_v: monitor,
            sensor_adc_v: sensor,
        });
    }
}

fn run(listener: &TcpListener, film: Kind, seed: u64, ended: &AtomicBool) {
    let film = Film::new(film);
    let substep_s = TICK.as_secs_f64() / f64::from(SUBSTEPS);
    let readings = Readings::new(Instruments::default(), seed);
    let mut around =
        Around { plant: NonlinearPlant::at_rest(&film, substep_s), readings, drive: Drive::OFF, film_v: 0.0 };
    // Without a monitor of the current.
    let converters = Converters::AD5754_ADS868X;
    let Ok(store) = Store::with_converters(RamFlash::default(), boards::STM32F405, converters) else { return };
    let recorder = FlightRecorder::new(vec![[0; 10]; 2048]);
    let mut bench = Bench { device: Device::new(None), store, recorder };
    let mut session = Session::new("simulated");
    let mut line: Option<TcpStream> = None;
    let mut due = Instant::now();
    while !ended.load(Ordering::Relaxed) {
        let now = Instant::now();
        due = due.max(now.checked_sub(MAX_DELAY).unwrap_or(now));
        while due <= now {
            due += TICK;
            around.tick(&mut bench.device);
            if let Some(record) = bench.device.flight_record() {
                bench.recorder.push(&record, bench.device.rate_hz());
            }
        }
        if let Ok((connected, _)) = listener.accept() {
            let set = connected.set_nonblocking(false).and_then(|()| connected.set_nodelay(true));
            line = set.and_then(|()| connected.set_read_timeout(Some(TICK))).is_ok().then_some(connected);
        }
        let Some(connected) = &mut line else {
            thread::sleep(TICK);
            continue;
        };
        while let Some(record) = bench.device.telemetry() {
            send(connected, &Message::Telemetry(record));
        }
        let mut bytes = [0; 512];
        match connected.read(&mut bytes) {
            Err(e) if matches!(e.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Ok(0) | Err(_) => line = None,
            Ok(length) => {
                let mut waiting = bytes[..length].iter().copied();
                while session.turn(&mut waiting, &mut bench, |message| send(connected, message)) {}
            }
        }
    }
}

fn send(line: &mut TcpStream, message: &Message) {
    let mut frame = [0; FRAME_LEN + 1];
    if let Ok(length) = encode(message, &mut frame) {
        // A host that has gone away is no fault of the board's.
        let _ = line.write_all(&frame[..length]);
    }
}
