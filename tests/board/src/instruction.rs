//! The host's instructions that registers are mostly accessed with.

/// A `mov` of 32 bits between memory and a register, or of a constant to memory.
pub struct Move {
    /// Bytes of the instruction.
    pub length: i64,
    pub operand: Operand,
}

/// The other side of a move.
pub enum Operand {
    /// An index into the registers of a signal's context.
    Register(usize),
    Constant(u32),
}

/// The registers in the order of their codes.
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

impl Move {
    /// The move at `code`; none for any other instruction.
    ///
    /// # Safety
    ///
    /// `code` points to an instruction that accesses memory.
    pub unsafe fn at(code: *const u8) -> Option<Self> {
        // SAFETY: none is read beyond the instruction: each follows from those before it.
        let byte = |index: usize| unsafe { code.add(index).read() };
        // A prefix of REX that leaves the operands at 32 bits.
        let (prefix, opcode_at) = if byte(0) & 0xf8 == 0x40 { (byte(0), 1) } else { (0, 0) };
        let opcode = byte(opcode_at);
        if !matches!(opcode, 0x89 | 0x8b | 0xc7) {
            return None;
        }
        let mode = byte(opcode_at + 1);
        let mut end = opcode_at + 2;
        let mut base = mode & 7;
        if base == 4 {
            // The base beside an index.
            base = byte(end) & 7;
            end += 1;
        }
        end += match mode >> 6 {
            0 if base == 5 => 4,
            0 => 0,
            1 => 1,
            _ => 4,
        };
        let operand = if opcode == 0xc7 {
            end += 4;
            Operand::Constant(u32::from_le_bytes([4, 3, 2, 1].map(|back| byte(end - back))))
        } else {
            let index = (mode >> 3 & 7) | (prefix & 4) << 1;
            Operand::Register(REGISTERS[usize::from(index)] as usize)
        };
        Some(Self { length: end as i64, operand })
    }
}
