//! The serial port of the link.

use dea_driver::wire::BAUD;
use stm32_metapac::RCC;
use stm32_metapac::usart::Usart;
use stm32_metapac::usart::regs::Icr;

use super::{Rcc, pin};

/// The port.
pub struct Port(Usart);
/// Its pins are always PA2, out, and PA3, in.
pub struct Pins;

/// The alternate function of both pins.
const FUNCTION: u32 = 7;

/// Opens the port, listening. The line is pulled up, so that one which is not connected is quiet. The port of its pins has its clock. Fails where the
/// clock is too slow.
pub fn open(usart: Usart, _: Pins, rcc: &mut Rcc) -> Result<Port, u32> {
    let divider = (rcc.core_hz + BAUD / 2) / BAUD;
    if divider < 16 {
        return Err(rcc.core_hz);
    }
    RCC.apb1enr1().modify(|w| w.set_usart2en(true));
    usart.brr().write(|w| w.set_brr(divider as u16));
    usart.cr1().write(|w| {
        w.set_ue(true);
        w.set_te(true);
        w.set_re(true);
        w.set_rxneie(true);
    });
    pin('A', 2).alternate(FUNCTION, false);
    pin('A', 3).alternate(FUNCTION, true);
    Ok(Port(usart))
}

/// The received byte, if there is one, also with a line error: noise on one of three samples of a bit need not have changed it, and the
/// checksum of its frame shows it.
pub fn received(port: &mut Port) -> Option<u8> {
    let status = port.0.isr().read();
    let came = status.rxne();
    // Parity, framing, noise and overrun have the same places in both registers.
    let complaints = status.0 & 0b1111;
    if complaints != 0 {
        port.0.icr().write_value(Icr(complaints));
    }
    came.then(|| port.0.rdr().read().dr() as u8)
}

/// Sends the `next` byte if the port is free; without one it disables the interrupt of a free port.
pub fn send(port: &mut Port, next: impl FnOnce() -> Option<u8>) {
    if port.0.isr().read().txe() {
        let next = next();
        if let Some(byte) = next {
            port.0.tdr().write(|w| w.set_dr(byte.into()));
        }
        port.0.cr1().modify(|w| w.set_txeie(next.is_some()));
    }
}
