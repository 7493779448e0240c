//! Effect of the host's instruction that accessed a register of the chip.
//!
//! A volatile access of a register is one instruction on x86-64 as well. Plain loads and stores and the test of a mask, which loops
//! that wait are made of, are carried out by the models themselves. Every other one is left to the processor, one step at a time.

use libc::greg_t;

/// Access of an instruction at the address where it faulted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Loads 32 bits into a register of the host, given by its place in the signal's context.
    Load(usize),
    /// Sets the flags for 32 bits under a mask.
    Test(u32),
    /// Stores the lowest bytes of `value`.
    Store { value: u32, bytes: u32 },
    /// Reads in another way.
    Read,
    /// Reads, and writes what it has made of it.
    Modify,
}

/// An instruction that was understood.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Instruction {
    pub action: Action,
    /// Bytes of the instruction; of no use where the processor carries it out.
    pub length: usize,
}

/// Registers by their number in an instruction, as places in the signal's context.
const REGISTERS: [i32; 16] = [
    libc::REG_RAX,
    libc::REG_RCX,
    libc::REG_RDX,
    libc::REG_RBX,
    libc::REG_RSP,
    libc::REG_RBP,
    libc::REG_RSI,
    libc::REG_RDI,
    libc::REG_R8,
    libc::REG_R9,
    libc::REG_R10,
    libc::REG_R11,
    libc::REG_R12,
    libc::REG_R13,
    libc::REG_R14,
    libc::REG_R15,
];

/// REX.W: the operand has 64 bits.
const WIDE: u8 = 0b1000;
/// REX.R: eight is added to the register's number.
const HIGH_REGISTER: u8 = 0b0100;

/// Understands the instruction that begins with `code` and faulted by writing, if it `writes`. None: an instruction that no
/// access of a register is made of.
pub fn decode(code: &[u8], context: &[greg_t], writes: bool) -> Option<Instruction> {
    let mut at = 0;
    // Operands of 16 bits, and the lock of an exchange.
    let mut half = false;
    while let Some(0x66 | 0xf0) = code.get(at) {
        half |= code[at] == 0x66;
        at += 1;
    }
    let rex = code.get(at).copied().filter(|byte| byte & 0xf0 == 0x40);
    at += usize::from(rex.is_some());
    let wide = rex.unwrap_or(0) & WIDE != 0;
    let opcode = *code.get(at)?;
    at += 1;
    let operand = Operand::decode(code.get(at..)?, rex)?;
    let end = at + operand.length;
    let word = !half && !wide;
    let (action, length) = match (opcode, writes) {
        (0x8b, false) if word => (Action::Load(REGISTERS[operand.register] as usize), end),
        (0xf7, false) if word && operand.extension() == 0 => (Action::Test(immediate(code, end, 4)?), end + 4),
        (0x88, true) => (Action::Store { value: operand.byte(context, rex), bytes: 1 }, end),
        (0x89, true) if !wide => {
            let value = context[REGISTERS[operand.register] as usize] as u32;
            (Action::Store { value, bytes: if half { 2 } else { 4 } }, end)
        }
        (0xc6, true) => (Action::Store { value: immediate(code, end, 1)?, bytes: 1 }, end + 1),
        (0xc7, true) if !wide => {
            let bytes = if half { 2 } else { 4 };
            (Action::Store { value: immediate(code, end, bytes)?, bytes: bytes as u32 }, end + bytes)
        }
        // Loads of 64 bits would take two registers at once.
        (_, false) if !wide => (Action::Read, 0),
        // add, or, and, sub, xor with a register or with an immediate; not, neg, inc, dec; exchange; shifts
        (0x01 | 0x09 | 0x21 | 0x29 | 0x31 | 0x81 | 0x83 | 0xf7 | 0xff | 0x87 | 0xc1 | 0xd1 | 0xd3, true) if !wide => {
            (Action::Modify, 0)
        }
        // bts, btr, btc, exchange and add, with two bytes
        (0x0f, true) if matches!(code[at], 0xab | 0xb3 | 0xbb | 0xba | 0xc1) && !wide => (Action::Modify, 0),
        _ => return None,
    };
    Some(Instruction { action, length })
}

/// The flags after an instruction that tested `result`.
pub fn flags_after_test(flags: greg_t, result: u32) -> greg_t {
    let (carry, parity, zero, sign, overflow) = (1 << 0, 1 << 2, 1 << 6, 1 << 7, 1 << 11);
    let mut flags = flags & !(carry | parity | zero | sign | overflow);
    if (result as u8).count_ones().is_multiple_of(2) {
        flags |= parity;
    }
    if result == 0 {
        flags |= zero;
    }
    if result >> 31 != 0 {
        flags |= sign;
    }
    flags
}

/// The operand in memory and the register beside it.
struct Operand {
    /// Number of the register, or the extension of the opcode.
    register: usize,
    length: usize,
}

impl Operand {
    fn decode(code: &[u8], rex: Option<u8>) -> Option<Self> {
        let modrm = *code.first()?;
        let (mode, base) = (modrm >> 6, modrm & 0b111);
        let with_index = base == 0b100;
        let base = if with_index { code.get(1)? & 0b111 } else { base };
        let displacement = match mode {
            0 if base == 0b101 => 4,
            0 => 0,
            1 => 1,
            2 => 4,
            // Not in memory: it cannot have faulted.
            _ => return None,
        };
        let register = usize::from(modrm >> 3 & 0b111) + if rex.unwrap_or(0) & HIGH_REGISTER != 0 { 8 } else { 0 };
        Some(Self { register, length: 1 + usize::from(with_index) + displacement })
    }

    fn extension(&self) -> usize {
        self.register & 0b111
    }

    /// The register of 8 bits. Without a prefix the numbers 4 to 7 are the second bytes of the first four.
    fn byte(&self, context: &[greg_t], rex: Option<u8>) -> u32 {
        let (register, shift) =
            if rex.is_none() && self.register >= 4 { (self.register - 4, 8) } else { (self.register, 0) };
        u32::from((context[REGISTERS[register] as usize] >> shift) as u8)
    }
}

fn immediate(code: &[u8], at: usize, bytes: usize) -> Option<u32> {
    let bytes = code.get(at..at + bytes)?;
    Some(bytes.iter().rev().fold(0, |value, &byte| value << 8 | u32::from(byte)))
}
