//! A board without hardware.

use dea_driver::server::{Board, FlightRecorder, FlightSlot, Image, Session};
use dea_driver::wire::{
    Answer, Command, FRAME_LEN, FlightRecord, InjectedFault, Inspection, Message, Part, Request, encode,
};
use dea_driver::{Cause, Device, Drive, Inputs, RamFlash, Store};
use serde::Serialize;

pub const BOARD: u16 = 7;
/// Bytes of an erasable part of its flash.
pub const SECTOR: usize = 1024;

/// A board whose amplifier and monitor follow at once, and whose film does not move.
#[derive(Clone)]
pub struct Bench {
    pub device: Device,
    pub store: Store<RamFlash>,
    /// Outputs of the last tick.
    pub drive: Drive,
    ticks: u16,
    /// Rate of the parameters in force, Hz; 0 before there are any.
    pub rate_hz: f32,
    /// Survives a reset.
    pub trial: bool,
    /// Faults that were injected; `None` where none can be.
    pub injected: Option<Vec<InjectedFault>>,
    /// Whether its watchdog is not fed any more.
    pub watchdog_expires: bool,
    pub recorder: FlightRecorder<Vec<FlightSlot>>,
    /// Its program, where that is checked.
    pub program: Option<Program>,
}

#[derive(Clone)]
pub struct Program {
    pub image: Image,
    pub words: Vec<u32>,
}

impl Bench {
    /// After a reset with this cause latched, before its session begins.
    pub fn new(flash: RamFlash, latched: Option<Cause>) -> Self {
        let store = Store::new(flash, BOARD).expect("two sectors");
        let device = Device::new(latched);
        Self {
            device,
            store,
            drive: Drive::OFF,
            ticks: 0,
            rate_hz: 0.0,
            trial: false,
            injected: None,
            watchdog_expires: false,
            recorder: FlightRecorder::new(vec![[0; 10]; 64]),
            program: None,
        }
    }

    /// Readings of the next tick, without a fault. The sensor has some noise.
    pub fn inputs(&mut self) -> Inputs {
        self.ticks = self.ticks.wrapping_add(1);
        let sensor_adc_v = Some(1.0 + 2e-3 * f32::from(self.ticks % 3));
        Inputs { interlock_closed: true, monitor_adc_v: Some(self.drive.dac_v), sensor_adc_v }
    }

    pub fn tick(&mut self, inputs: Inputs) {
        self.drive = self.device.tick(inputs);
        if let Some(record) = self.device.flight_record() {
            self.recorder.push(&record, self.device.rate_hz());
        }
    }
}

impl Board for Bench {
    type Flash = RamFlash;
    const ID: u16 = BOARD;

    fn with<R>(&mut self, work: impl FnOnce(&mut Device) -> R) -> (R, u32) {
        (work(&mut self.device), 42)
    }

    fn rates_hz(&self) -> (f32, f32) {
        (100.0, 2000.0)
    }

    fn store(&mut self) -> &mut Store<RamFlash> {
        &mut self.store
    }

    fn set_rate(&mut self, rate_hz: f32) {
        // All parameters that it is given are for 1 kHz.
        assert_eq!(rate_hz, 1000.0);
        self.rate_hz = rate_hz;
    }

    fn flight_record(&mut self, back: u32) -> Option<FlightRecord> {
        self.recorder.record(back)
    }

    fn stack_peak(&self) -> u32 {
        99
    }

    fn panic_message(&self) -> &str {
        "a panic"
    }

    fn remember_trial(&mut self, on_trial: bool) {
        self.trial = on_trial;
    }

    fn remembers_trial(&self) -> bool {
        self.trial
    }

    fn image_is_intact(&mut self) -> bool {
        self.program.as_mut().is_none_or(|Program { image, words }| image.is_intact(words))
    }

    fn stop_feeding_watchdog(&mut self) -> bool {
        self.watchdog_expires = true;
        true
    }

    fn inject_fault(&mut self, fault: InjectedFault) -> bool {
        self.injected.as_mut().map(|faults| faults.push(fault)).is_some()
    }
}

/// A slot of the store as doc/blob.md describes it.
pub fn slot(sequence: u32, blob: &[u8]) -> Vec<u8> {
    let mut bytes = [&sequence.to_le_bytes()[..], &(!sequence).to_le_bytes(), blob].concat();
    bytes.resize(SECTOR, 0xff);
    bytes
}

/// Bytes of a blob with their checksum behind them.
pub fn sealed(bytes: &[u8]) -> Vec<u8> {
    let checksum = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(bytes);
    [bytes, &checksum.to_le_bytes()].concat()
}

/// The state of a board whose converters answer.
pub fn inspection(interlock_closed: bool, enable_high: bool) -> Inspection {
    let (dac, monitor, sensor) = (Part::Answers, Part::Answers, Part::Answers);
    Inspection { interlock_closed, enable_high, dac, monitor, sensor, monitor_adc_v: 0.0, sensor_adc_v: 1.0 }
}

/// The bytes of a message on the line.
pub fn frame(message: &impl Serialize) -> Vec<u8> {
    let mut bytes = [0; FRAME_LEN + 1];
    let length = encode(message, &mut bytes).expect("fits");
    bytes[..length].to_vec()
}

/// Sends a command with this token and returns its answer, the only one.
pub fn ask(session: &mut Session, board: &mut impl Board, (sequence, token): (u32, u16), command: Command) -> Answer {
    let bytes = frame(&Request { sequence, token, command });
    let mut answers = bytes.iter().filter_map(|&byte| session.serve(byte, board));
    match (answers.next(), answers.next()) {
        (Some(Message::Answer { sequence: to, answer }), None) if to == sequence => answer,
        other => panic!("{other:?}"),
    }
}
