//! Flash interface of an STM32G4, and the pages that a program may change: RM0440 section 3. Each double word is written once after its page was
//! erased.

use crate::chip::registers::{Peripheral, Registers};
use crate::chip::time::{MICROSECOND, Picoseconds};
use crate::chip::violation::Violation;

/// The pages that are modelled, the last four of the second bank.
pub const START: u32 = 0x0807_e000;
pub const LENGTH: u32 = 0x2000;
const PAGE: u32 = 2048;
const BANK_2: u32 = 0x0804_0000;

const KEYR: u32 = 0x08;
const SR: u32 = 0x10;
const CR: u32 = 0x14;
const ECCR: u32 = 0x18;
const BUSY: u32 = 1 << 16;
/// Errors in SR: of programming, and of its order.
const PROGERR: u32 = 1 << 3;
const PGSERR: u32 = 1 << 7;
/// Bits of CR.
const PG: u32 = 1 << 0;
const PER: u32 = 1 << 1;
const BKER: u32 = 1 << 11;
const STRT: u32 = 1 << 16;
const LOCK: u32 = 1 << 31;
/// Times: data sheet, flash memory characteristics.
const ERASES: Picoseconds = 22_000 * MICROSECOND;
const WRITES: Picoseconds = 85 * MICROSECOND;

pub struct Flash {
    pub registers: Registers,
    keys: [u32; 2],
    busy_until: Picoseconds,
    cells: Vec<u8>,
    /// The first half of a double word, with its address.
    half: Option<(u32, u32)>,
    /// Writing does nothing from now on.
    pub is_worn: bool,
}

impl Default for Flash {
    /// Locked, with the option bytes as delivered: watchdog by software, brown-out reset at its lowest level, two banks.
    fn default() -> Self {
        let registers = Registers::new(&[(0x00, 0x0004_0600), (CR, 0xc000_0000), (Self::OPTR, 0xffef_f8aa)]);
        let cells = vec![0xff; LENGTH as usize];
        Self { registers, keys: [0; 2], busy_until: 0, cells, half: None, is_worn: false }
    }
}

impl Flash {
    /// The register of option bytes, and fields of it.
    pub const OPTR: u32 = 0x20;
    pub const WATCHDOG_BY_SOFTWARE: u32 = 1 << 16;
    pub const BROWN_OUT: u32 = 0b111 << 8;
    pub const TWO_BANKS: u32 = 1 << 22;

    pub fn wait_states(&self) -> u32 {
        self.registers[0x00] & 0xf
    }

    /// A word of the pages.
    pub fn word(&self, address: u32) -> u32 {
        let at = (address - START) as usize;
        u32::from_le_bytes([self.cells[at], self.cells[at + 1], self.cells[at + 2], self.cells[at + 3]])
    }

    /// The program writes a word of the pages.
    pub fn program(&mut self, address: u32, value: u32, now: Picoseconds) -> Option<Violation> {
        let is_ready = self.registers[CR] & (LOCK | PG) == PG && now >= self.busy_until;
        if !is_ready {
            self.registers[SR] |= PGSERR;
            return Some(Violation::FlashOrder { address });
        }
        match self.half.take() {
            None if address.is_multiple_of(8) => self.half = Some((address, value)),
            Some((first, low)) if address == first + 4 => {
                let at = (first - START) as usize;
                if self.cells[at..at + 8].iter().any(|&cell| cell != 0xff) {
                    self.registers[SR] |= PROGERR;
                } else if !self.is_worn {
                    self.cells[at..at + 4].copy_from_slice(&low.to_le_bytes());
                    self.cells[at + 4..at + 8].copy_from_slice(&value.to_le_bytes());
                }
                self.busy_until = now + WRITES;
            }
            _ => {
                self.registers[SR] |= PGSERR;
                return Some(Violation::FlashOrder { address });
            }
        }
        None
    }

    fn erase(&mut self, control: u32, now: Picoseconds) -> Option<Violation> {
        let page = control >> 3 & 0x7f;
        let start = if control & BKER == 0 { 0x0800_0000 } else { BANK_2 } + page * PAGE;
        if control & PER == 0 || !(START..START + LENGTH).contains(&start) || now < self.busy_until {
            return Some(Violation::FlashOrder { address: start });
        }
        let at = (start - START) as usize;
        self.cells[at..at + PAGE as usize].fill(0xff);
        self.busy_until = now + ERASES;
        None
    }
}

impl Peripheral for Flash {
    fn value(&self, offset: u32, now: Picoseconds) -> u32 {
        let busy = if offset == SR && now < self.busy_until { BUSY } else { 0 };
        self.registers[offset] | busy
    }

    fn write(&mut self, offset: u32, value: u32, now: Picoseconds) -> Option<Violation> {
        match offset {
            KEYR => {
                self.keys = [self.keys[1], value];
                if self.keys == [0x4567_0123, 0xcdef_89ab] {
                    self.registers[CR] &= !LOCK;
                }
            }
            // Writing ones clears flags.
            SR => self.registers[SR] &= !value,
            ECCR => self.registers[ECCR] &= !(value & 0b1111 << 28),
            CR if self.registers[CR] & LOCK != 0 => return Some(Violation::FlashOrder { address: 0x4002_2014 }),
            CR => {
                self.registers[CR] = value & !STRT;
                if value & STRT != 0 {
                    return self.erase(value, now);
                }
            }
            Self::OPTR => {}
            _ => self.registers[offset] = value,
        }
        None
    }

    fn reset(&mut self) {
        let cells = std::mem::take(&mut self.cells);
        *self = Self { cells, is_worn: self.is_worn, ..Self::default() };
    }
}
