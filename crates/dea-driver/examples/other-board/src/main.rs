//! A whole firmware on a board that is not this repository's, to copy: `dea-driver` on converters behind embedded-hal, with
//! a plain loop as scheduler. It arms, follows a sine, loses its voltage monitor, and must end at 0 V.
//!
//! It runs in QEMU on a Cortex-M33 (`cargo run --release`) and on RISC-V (`--target riscv32imac-unknown-none-elf`), and as a
//! program of the host (`--target x86_64-unknown-linux-gnu`), with the same bits. On a real board, buses and pins of its HAL
//! take the place of [`Film`] and its timer that of [`Film::wait`]; `docs/own-board.md` describes what else it needs.
#![cfg_attr(target_os = "none", no_std, no_main)]

use core::{cell::Cell, cell::RefCell, convert::Infallible, f32::consts::PI, fmt::Display};
#[cfg(not(target_os = "none"))]
use std::process;

use dea_driver::chips::{Ceilings, Converters, Resolution};
use dea_driver::{Blob, Cause, Controller, DriverState, Inputs, Mode, Outputs, Parameters};
use embedded_hal::digital::{self, InputPin, OutputPin};
use embedded_hal::spi::{self, Operation, SpiDevice};
#[cfg(target_os = "none")]
use semihosting::{println, process};
use springpot::{Law, LawState, VoltageDrive};

/// `springpot export --params film.toml --out film.bin`: the film's law and its bench. A board of another number refuses it.
const FILM: &[u8] = include_bytes!("../film.bin");
const BOARD: u16 = 7;

/// Full scales of the converters, V. Both have 12 bits; an ADC ends one count below its full scale.
const DAC_V: f32 = 2.5;
const ADC_V: f32 = 3.3;
const MAX_ADC_V: f32 = ADC_V * (4095.0 / 4096.0);
const CONVERTERS: Converters = Converters {
    command_v: Some(DAC_V),
    monitor_v: MAX_ADC_V,
    sensor_v: MAX_ADC_V,
    current_v: None,
    resolution: Resolution::bits(12),
    ceilings: Ceilings { voltage_v: 6e3, field_v_per_m: 6e7, stroke_m: 8e-3 },
};
const MONITOR: u8 = 0; // channels of the ADC
const SENSOR: u8 = 1;

/// The hardware that the controller is connected to, on buses and pins of any HAL.
struct Board<Dac, Adc, Enable, Interlock> {
    dac: Dac,
    adc: Adc,
    enable: Enable,
    interlock: Interlock,
}

impl<Dac: SpiDevice, Adc: SpiDevice, Enable: OutputPin, Interlock: InputPin> Board<Dac, Adc, Enable, Interlock> {
    /// One tick: sample, check, estimate, command, put out. A pin that cannot be read is an open interlock.
    fn tick(&mut self, controller: &mut Controller) -> Outputs {
        let interlock_closed = self.interlock.is_high().unwrap_or(false);
        let (monitor_adc_v, sensor_adc_v) = (self.adc_v(MONITOR), self.adc_v(SENSOR));
        let outputs = controller.tick(Inputs { interlock_closed, monitor_adc_v, sensor_adc_v });
        if !self.put_out(outputs.enable, outputs.dac_v) {
            controller.trip(Cause::Bus);
            self.put_out(false, 0.0);
        }
        outputs
    }

    /// None if the converter does not answer.
    fn adc_v(&mut self, channel: u8) -> Option<f32> {
        let mut frame = [channel, 0];
        self.adc.transfer_in_place(&mut frame).ok()?;
        Some(f32::from(u16::from_be_bytes(frame)) * (ADC_V / 4096.0))
    }

    /// Whether it went well. The enable output comes first where it goes low, and last where it goes high.
    fn put_out(&mut self, enable: bool, dac_v: f32) -> bool {
        let disabled = enable || self.enable.set_low().is_ok();
        // The nearest code: saturates, and NaN is 0 V.
        let code = ((dac_v * (4096.0 / DAC_V) + 0.5) as u16).min(4095);
        let commanded = self.dac.write(&code.to_be_bytes()).is_ok();
        disabled && commanded && (!enable || self.enable.set_high().is_ok())
    }
}

/// The run, in ticks of a millisecond: a second up, then a sine, until the monitor falls silent.
const RISEN: u32 = 1000;
const SILENT: u32 = 7000;

/// Where the film should be, m.
fn reference_m(tick: u32) -> f32 {
    let time_s = 1e-3 * tick as f32;
    if tick < RISEN { 0.6e-3 * time_s } else { 0.6e-3 + 0.2e-3 * libm::sinf(PI * (time_s - 1.0)) }
}

#[cfg_attr(all(target_arch = "arm", target_os = "none"), cortex_m_rt::entry)]
#[cfg_attr(all(target_arch = "riscv32", target_os = "none"), riscv_rt::entry)]
fn main() -> ! {
    let blob: Blob = accepted(Blob::decode_for(FILM, BOARD, &CONVERTERS));
    let film = Film::new(blob.parameters());
    let mut board = Board { dac: &film, adc: &film, enable: &film, interlock: &film };
    board.put_out(false, 0.0); // a real board can do so before it reads the blob, and does
    let mut controller = Controller::new(blob);
    // Nothing can be armed before the first tick has seen the sensors.
    board.tick(&mut controller);
    accepted(controller.arm());
    accepted(controller.start(Mode::Tracking));

    let (mut furthest_m, mut tripped, mut bits) = (0.0f32, None, 0xcbf2_9ce4_8422_2325u64);
    for tick in 0..SILENT + 500 {
        film.wait();
        film.monitor_answers.set(tick < SILENT);
        if tick > 2 * RISEN && tick <= SILENT {
            furthest_m = furthest_m.max((film.state.borrow().position() - reference_m(tick - 1)).abs());
        }
        // This board commands itself: to set a reference is its heartbeat. A trip ends that.
        if controller.set_reference(reference_m(tick)).is_ok() {
            controller.heartbeat();
        }
        let outputs = board.tick(&mut controller);
        if let DriverState::Tripped(cause) = controller.supervisor().state() {
            tripped.get_or_insert((tick, cause, film.enabled.get(), film.dac.get()));
        }
        // FNV-1a, word by word, over what was put out and estimated.
        for word in [u32::from(film.dac.get()), outputs.telemetry.predicted_m.to_bits()] {
            bits = (bits ^ u64::from(word)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    println!("furthest from the sine: {:.2} um", 1e6 * furthest_m);
    println!("tick, cause, enable and code of the trip: {tripped:?}");
    println!("at the end: enable {}, code {}, {:.1} V", film.enabled.get(), film.dac.get(), film.voltage_v.get());
    println!("bits: {bits:016x}");
    process::exit(0)
}

/// Or says why not, and stops: the amplifier has not been enabled yet.
fn accepted<T, E: Display>(result: Result<T, E>) -> T {
    result.unwrap_or_else(|error| {
        println!("refused: {error}");
        process::exit(1)
    })
}

/// Simulated from here on: amplifier, film, monitor, sensor, and the converters and pins that lead there.
struct Film {
    enabled: Cell<bool>,
    dac: Cell<u16>,
    monitor_answers: Cell<bool>,
    voltage_v: Cell<f32>,
    bench: Parameters,
    law: Law<f32>,
    drive: VoltageDrive<f32>,
    state: RefCell<LawState<f32>>,
}

impl Film {
    fn new(bench: &Parameters) -> Self {
        let law = accepted(Law::from_coefficients(&bench.law, 1e-3, bench.actuator.mass_kg));
        let drive = accepted(VoltageDrive::new(&bench.actuator, 6500.0, law.stiffness()));
        let (state, bench, monitor_answers) = (RefCell::new(law.state()), bench.clone(), Cell::new(true));
        let (enabled, dac, voltage_v) = Default::default();
        Self { enabled, dac, monitor_answers, voltage_v, bench, law, drive, state }
    }

    /// Until the timer's next tick the film moves: it pulls 3 % harder than its model, and a bleeder discharges it.
    fn wait(&self) {
        let commanded_v = self.bench.amplifier.apply(f32::from(self.dac.get()) * (DAC_V / 4096.0));
        self.voltage_v.set(if self.enabled.get() { commanded_v } else { 0.95 * self.voltage_v.get() });
        let load = self.drive.load(1.015 * self.voltage_v.get());
        self.law.displacement_under(&mut self.state.borrow_mut(), load);
    }
}

impl spi::ErrorType for &Film {
    type Error = spi::ErrorKind;
}

impl SpiDevice for &Film {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), spi::ErrorKind> {
        match operations {
            [Operation::Write([high, low])] => self.dac.set(u16::from_be_bytes([*high, *low])),
            [Operation::TransferInPlace([channel, low])] if *channel == SENSOR || self.monitor_answers.get() => {
                let monitor_v = self.bench.monitor.invert(self.voltage_v.get());
                let sensor_v = self.bench.sensor.invert(self.state.borrow().position());
                let volts = if *channel == SENSOR { sensor_v } else { monitor_v };
                [*channel, *low] = ((volts * (4096.0 / ADC_V)) as u16).to_be_bytes();
            }
            _ => return Err(spi::ErrorKind::Other),
        }
        Ok(())
    }
}

impl digital::ErrorType for &Film {
    type Error = Infallible;
}

impl OutputPin for &Film {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.enabled.set(false);
        Ok(())
    }
    fn set_high(&mut self) -> Result<(), Infallible> {
        self.enabled.set(true);
        Ok(())
    }
}

impl InputPin for &Film {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        Ok(true)
    }
    fn is_low(&mut self) -> Result<bool, Infallible> {
        Ok(false)
    }
}
