//! The serial port of the link.

use dea_driver::wire::BAUD;
use stm32f4xx_hal::gpio::{PA2, PA3};
use stm32f4xx_hal::hal_02::serial::Write;
use stm32f4xx_hal::pac::USART2;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;
use stm32f4xx_hal::serial::config::InvalidConfig;
use stm32f4xx_hal::serial::{Config, Event, Serial};

/// The port.
pub type Port = Serial<USART2>;
/// Its pins: out, in.
pub type Pins = (PA2, PA3);

/// Opens the port, listening. The line is pulled up, so that one which is not connected is quiet.
pub fn open(usart: USART2, (tx, rx): Pins, rcc: &mut Rcc) -> Result<Port, InvalidConfig> {
    let rx = rx.into_alternate().internal_pull_up(true);
    let mut serial = Serial::new(usart, (tx, rx), Config::default().baudrate(BAUD.bps()), rcc)?;
    serial.listen(Event::RxNotEmpty);
    Ok(serial)
}

/// The received byte, if there is one, also with a line error: noise on one of three samples of a bit need not have changed it, and the
/// checksum of its frame shows it.
pub fn received(_owner: &mut Port) -> Option<u8> {
    // SAFETY: the port is the caller's alone. Reading its data register after its status clears the flags of the status.
    let usart = unsafe { &*USART2::PTR };
    let status = usart.sr().read();
    let came = status.rxne().bit_is_set();
    let complains = status.ore().bit_is_set() || status.nf().bit_is_set() || status.fe().bit_is_set();
    if !came && !complains {
        return None;
    }
    let byte = usart.dr().read().dr().bits() as u8;
    came.then_some(byte)
}

/// Sends the `next` byte if the port is free; without one it disables the interrupt of a free port.
pub fn send(port: &mut Port, next: impl FnOnce() -> Option<u8>) {
    if port.is_tx_empty() {
        match next() {
            Some(byte) => {
                // It is empty, so this does not wait.
                let _ = Write::write(port, byte);
                port.listen(Event::TxEmpty);
            }
            None => port.unlisten(Event::TxEmpty),
        }
    }
}
