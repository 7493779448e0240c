//! Chips on the board's SPI buses, wired to pins.

use std::cell::RefCell;
use std::rc::Rc;

use converter_chips::SerialChip;

use crate::chip::gpio::Pin;

/// Where a chip is connected.
#[derive(Clone, Copy, Debug)]
pub struct Wiring {
    pub select: Pin,
    pub sck: Pin,
    pub miso: Pin,
    pub mosi: Pin,
}

/// A chip with its wires. It acts while the firmware waits within one access: it must not touch the registers of the board's chip, and a
/// panic in it ends the process, since there is no way back through the access.
pub struct Wired {
    pub wiring: Wiring,
    pub chip: Rc<RefCell<dyn SerialChip>>,
    pub selected: bool,
    /// Level of MOSI so far.
    pub mosi: bool,
}

/// A pin, and what sees its level.
pub type Watch = (Pin, Box<dyn FnMut(bool, u64)>);
