//! Reset and clock control, RM0090 section 7, RM0440 section 7: oscillators that take their time, the loop, the switch, flags and resets.

use crate::chip::Block;
use crate::chip::clocks::{Clocks, Source};
use crate::chip::family::{Family, Layout};
use crate::chip::registers::{Peripheral, Registers};
use crate::chip::time::{MICROSECOND, Picoseconds};
use crate::chip::violation::Violation;

const CR: u32 = 0x00;
const CFGR: u32 = 0x08;

/// Bits of CR.
pub const HSEON: u32 = 1 << 16;
const HSERDY: u32 = 1 << 17;
pub const CSSON: u32 = 1 << 19;
pub const PLLON: u32 = 1 << 24;
const PLLRDY: u32 = 1 << 25;
/// SWS in CFGR.
const SWS: u32 = 0b11 << 2;
/// Bits of CSR.
const LSION: u32 = 1 << 0;
const LSIRDY: u32 = 1 << 1;

/// Flags of the last reset, in CSR of an STM32F4. An STM32G4 has one flag for power-up and brown-out, in the place of power-up, and that of the
/// option bytes in the place of the brown-out.
pub mod reset_flag {
    pub const BROWN_OUT: u32 = 1 << 25;
    pub const PIN: u32 = 1 << 26;
    pub const POWER: u32 = 1 << 27;
    pub const SOFTWARE: u32 = 1 << 28;
    pub const INDEPENDENT_WATCHDOG: u32 = 1 << 29;
    pub const WINDOW_WATCHDOG: u32 = 1 << 30;
    pub const LOW_POWER: u32 = 1 << 31;
    pub const ALL: u32 = 0x7f << 25;
}

/// From being switched on to ready, typically: the data sheet's tables of the crystal oscillator, the loop and the slow oscillator.
const CRYSTAL_STARTS: Picoseconds = 2000 * MICROSECOND;
const LOOP_LOCKS: Picoseconds = 200 * MICROSECOND;
const SLOW_STARTS: Picoseconds = 40 * MICROSECOND;

/// Locking of the phase-locked loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Loop {
    /// Whatever it is set to, beyond its limits too.
    Locks,
    /// Where its input and its oscillator are within their limits.
    LocksWithinLimits,
    Dead,
}

#[derive(Clone, Copy, Debug)]
pub struct Oscillators {
    /// Crystal, Hz; none: it does not start.
    pub crystal_hz: Option<u32>,
    /// High-speed internal oscillator, Hz.
    pub internal_hz: u32,
    /// Low-speed internal oscillator, Hz; none: it is dead. The data sheet has 17 to 47 kHz.
    pub slow_hz: Option<u32>,
    pub pll: Loop,
}

impl Default for Oscillators {
    fn default() -> Self {
        Self { crystal_hz: Some(8_000_000), internal_hz: 16_000_000, slow_hz: Some(32_000), pll: Loop::Locks }
    }
}

pub struct Rcc {
    family: Family,
    registers: Registers,
    pub oscillators: Oscillators,
    /// When they are ready, if they are on.
    crystal_at: Picoseconds,
    loop_at: Picoseconds,
    slow_at: Picoseconds,
    source: Source,
}

impl Rcc {
    pub fn new(family: Family, oscillators: Oscillators) -> Self {
        let registers = Registers::new(family.layout().reset_values);
        Self { family, registers, oscillators, crystal_at: 0, loop_at: 0, slow_at: 0, source: Source::Internal }
    }

    fn layout(&self) -> &'static Layout {
        self.family.layout()
    }

    fn is_from_crystal(&self) -> bool {
        let [mask, crystal] = self.layout().source;
        self.registers[self.layout().pllcfgr] & mask == crystal
    }

    pub fn set_reset_flags(&mut self, flags: u32) {
        let csr = &mut self.registers[self.family.layout().csr];
        *csr = *csr & !reset_flag::ALL | flags & reset_flag::ALL;
    }

    pub fn reset_flags(&self) -> u32 {
        self.registers[self.layout().csr] & reset_flag::ALL
    }

    pub fn cr(&self) -> u32 {
        self.registers[CR]
    }

    /// M and N of the loop, and its divider for the core.
    pub fn loop_factors(&self) -> (u32, u32, u32) {
        let pllcfgr = self.registers[self.layout().pllcfgr];
        match self.family {
            Family::F4 => (pllcfgr & 0x3f, pllcfgr >> 6 & 0x1ff, ((pllcfgr >> 16 & 0b11) + 1) * 2),
            Family::G4 => ((pllcfgr >> 4 & 0xf) + 1, pllcfgr >> 8 & 0x7f, ((pllcfgr >> 25 & 0b11) + 1) * 2),
        }
    }

    pub fn source(&self) -> Source {
        self.source
    }

    /// All frequencies that follow from the registers.
    pub fn clocks(&self) -> Clocks {
        let (m, n, p) = self.loop_factors();
        let on = self.cr() & PLLON != 0;
        let input = if self.is_from_crystal() {
            self.oscillators.crystal_hz.filter(|_| self.cr() & HSEON != 0)
        } else {
            Some(self.oscillators.internal_hz)
        };
        let pll = on.then(|| Clocks::pll(input.unwrap_or(0), m, n, p));
        let sysclk_hz = match self.source {
            Source::Internal => self.oscillators.internal_hz,
            Source::Crystal => self.oscillators.crystal_hz.unwrap_or(0),
            Source::Loop => pll.map_or(0, |pll| pll.output_hz),
        };
        Clocks::new(pll, sysclk_hz, self.registers[CFGR], self.layout())
    }

    /// The slow oscillator, Hz, and since when it runs.
    pub fn slow(&self, now: Picoseconds) -> Option<(u32, Picoseconds)> {
        let runs = self.registers[self.layout().csr] & LSION != 0 && now >= self.slow_at;
        self.oscillators.slow_hz.filter(|_| runs).map(|hz| (hz, self.slow_at))
    }

    /// The slow oscillator has another frequency from now on, Hz, or none.
    pub fn change_slow(&mut self, hz: Option<u32>, now: Picoseconds) {
        self.oscillators.slow_hz = hz;
        self.slow_at = now;
    }

    /// Whether the block's clock is on.
    pub fn enables(&self, block: Block) -> bool {
        block.gate(self.family).is_none_or(|gate| self.registers[gate.enable] & 1 << gate.bit != 0)
    }

    /// Whether the block is held in reset.
    pub fn resets(&self, block: Block) -> bool {
        block.gate(self.family).is_some_and(|gate| self.registers[gate.reset] & 1 << gate.reset_bit != 0)
    }

    /// Sets the ready bits of what is ready, and switches to a source that has become ready.
    pub fn advance(&mut self, now: Picoseconds) {
        let Oscillators { crystal_hz, slow_hz, pll, .. } = self.oscillators;
        let &Layout { hsion, hsirdy, csr, internal, .. } = self.layout();
        let mut cr = self.registers[CR] & !(hsirdy | HSERDY | PLLRDY);
        if cr & hsion != 0 {
            cr |= hsirdy;
        }
        if cr & HSEON != 0 && crystal_hz.is_some() && now >= self.crystal_at {
            cr |= HSERDY;
        }
        let locks = match pll {
            Loop::Locks => true,
            Loop::LocksWithinLimits => {
                self.clocks().pll.is_some_and(|pll| pll.violations(self.layout()).next().is_none())
            }
            Loop::Dead => false,
        };
        let has_input = !self.is_from_crystal() || cr & HSERDY != 0;
        if cr & PLLON != 0 && locks && has_input && now >= self.loop_at {
            cr |= PLLRDY;
        }
        self.registers[CR] = cr;
        let slow = self.registers[csr] & LSION != 0 && slow_hz.is_some() && now >= self.slow_at;
        let csr = &mut self.registers[csr];
        *csr = *csr & !LSIRDY | if slow { LSIRDY } else { 0 };

        let wanted = Source::from_bits(self.registers[CFGR], internal);
        let ready = match wanted {
            Some(Source::Internal) => hsirdy,
            Some(Source::Crystal) => HSERDY,
            Some(Source::Loop) => PLLRDY,
            None => 0,
        };
        if let Some(wanted) = wanted
            && cr & ready != 0
        {
            self.source = wanted;
        }
        let sws = (self.source as u32 + internal) << 2;
        let cfgr = &mut self.registers[CFGR];
        *cfgr = *cfgr & !SWS | sws;
    }

    fn write_cr(&mut self, value: u32, now: Picoseconds) -> Option<Violation> {
        let before = self.cr();
        let &Layout { hsion, cr_read_only, .. } = self.layout();
        let mut value = value & !cr_read_only | before & cr_read_only;
        let from_crystal = self.is_from_crystal();
        // What the core runs on cannot be switched off.
        value |= match self.source {
            Source::Internal => hsion,
            Source::Crystal => HSEON,
            Source::Loop => PLLON | if from_crystal { HSEON } else { hsion },
        };
        // The security system stays on once it is.
        value |= before & CSSON;
        let risen = value & !before;
        if risen & HSEON != 0 {
            self.crystal_at = now + CRYSTAL_STARTS;
        }
        if risen & PLLON != 0 {
            self.loop_at = now + LOOP_LOCKS;
        }
        self.registers[CR] = value;
        (risen & PLLON != 0 && from_crystal && before & HSERDY == 0).then_some(Violation::LoopWithoutInput)
    }
}

impl Peripheral for Rcc {
    fn value(&self, offset: u32, _: Picoseconds) -> u32 {
        self.registers[offset]
    }

    fn write(&mut self, offset: u32, value: u32, now: Picoseconds) -> Option<Violation> {
        let &Layout { pllcfgr, csr, rmvf, .. } = self.layout();
        match offset {
            CR => return self.write_cr(value, now),
            _ if offset == pllcfgr && self.cr() & PLLON != 0 => return Some(Violation::LoopSetWhileOn),
            CFGR => self.registers[CFGR] = value & !SWS,
            _ if offset == csr => {
                let before = self.registers[csr];
                if value & LSION != 0 && before & LSION == 0 {
                    self.slow_at = now + SLOW_STARTS;
                }
                let flags = if value & rmvf != 0 { 0 } else { before & reset_flag::ALL };
                self.registers[csr] = flags | value & LSION;
            }
            _ => self.registers[offset] = value,
        }
        None
    }

    fn reset(&mut self) {
        *self = Self::new(self.family, self.oscillators);
    }
}

/// Where a block's clock is switched on, and where it is reset.
pub struct Gate {
    pub enable: u32,
    pub reset: u32,
    pub bit: u32,
    pub reset_bit: u32,
}
