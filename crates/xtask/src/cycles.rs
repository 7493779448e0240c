//! Cycles of the Cortex-M4F, modelled from a trace of instructions, since QEMU has no clock of its own.
//!
//! Each instruction takes what the core's technical reference manual states (Arm 100166, tables 3-1 and 7-1), from memory
//! without wait states. A load right after a load or store overlaps it, a taken branch refills the pipeline in two cycles, and
//! a result of the floating-point unit that the very next instruction of that unit takes costs one more. An estimate: on a
//! board, `host-sim pil --port` counts.

use std::collections::HashMap;
use std::fs;
use std::process::Command;

use crate::process::{Result, output, root};
use crate::setup::{TARGETS, Toolchain};

/// Functions of `tests/embedded/src/cycles.rs`, and the rows of the README that they stand for.
const KERNELS: [(&str, &str); 11] = [
    ("creep_12_36", "creep/12+36"),
    ("relaxation_12_36", "relaxation/12+36"),
    ("creep_8_18", "creep/8+18"),
    ("relaxation_8_18", "relaxation/8+18"),
    ("creep_8_16", "creep/8+16"),
    ("relaxation_8_16", "relaxation/8+16"),
    ("voltage", "voltage"),
    ("feedforward", "feedforward"),
    ("observer", "observer"),
    ("tracking", "tracking"),
    ("tick", "tick"),
];

/// Cycles by the README's rows.
pub fn modelled(toolchain: &Toolchain) -> Result<Vec<(&'static str, f64)>> {
    let folder = root().join("tests/embedded");
    let build = ["build", "--quiet", "--release", "--bin", "cycles"];
    output(toolchain.cargo(&folder, TARGETS[0], &build))?;
    let log = folder.join("target/cycles.log");
    let mut qemu = Command::new("qemu-system-arm");
    qemu.args(["-M", "olimex-stm32-h405", "-nographic", "-monitor", "none", "-serial", "none"])
        .args(["-semihosting-config", "enable=on,target=native", "-accel", "tcg,one-insn-per-tb=on"])
        .args(["-d", "in_asm,exec,nochain", "-D"])
        .arg(&log)
        .arg("-kernel")
        .arg(folder.join("target").join(TARGETS[0]).join("release/cycles"));
    output(qemu)?;
    let text = fs::read_to_string(&log).map_err(|error| format!("{}: {error}", log.display()))?;
    let trace = Trace::read(&text);
    KERNELS.iter().map(|&(kernel, row)| Ok((row, trace.cycles_of(kernel)?))).collect()
}

/// An instruction: its address, its mnemonic, its operands.
struct Instruction<'a> {
    size: u64,
    mnemonic: &'a str,
    operands: &'a str,
}

/// What was executed, in order: address and function.
struct Trace<'a> {
    instructions: HashMap<u64, Instruction<'a>>,
    executed: Vec<(u64, &'a str)>,
}

impl<'a> Trace<'a> {
    fn read(text: &'a str) -> Self {
        let mut trace = Self { instructions: HashMap::new(), executed: Vec::new() };
        for line in text.lines() {
            if let Some(executed) = line.strip_prefix("Trace ") {
                // Trace 0: 0x7f… [00800400/000000000800c06c/00000010/ff020201] function
                let address = executed.split('/').nth(1).and_then(|hex| u64::from_str_radix(hex, 16).ok());
                let function = executed.rsplit("] ").next().unwrap_or_default().trim();
                trace.executed.extend(address.map(|address| (address, function)));
            } else if let Some((address, code)) =
                line.split_once(":  ").filter(|(address, _)| address.starts_with("0x"))
            {
                // 0x0800c070:  ed2d 8b10  vpush    {d8, d9}
                let Ok(address) = u64::from_str_radix(&address[2..], 16) else { continue };
                let words = code.split_whitespace().take_while(|word| word.len() == 4 && is_hex(word)).count();
                let mut rest = code.split_whitespace().skip(words);
                let mnemonic = rest.next().unwrap_or_default();
                let operands = code.split_once(mnemonic).map_or("", |(_, operands)| operands.trim());
                trace.instructions.insert(address, Instruction { size: 2 * words as u64, mnemonic, operands });
            }
        }
        trace
    }

    /// Cycles of the last call of `kernel`, its return included.
    fn cycles_of(&self, kernel: &str) -> Result<f64> {
        let missing = || format!("{kernel} is not in the trace");
        let entry = self.executed.iter().find(|(_, function)| *function == kernel).ok_or_else(missing)?.0;
        let start = self.executed.iter().rposition(|(address, _)| *address == entry).ok_or_else(missing)?;
        let caller = self.executed[start.checked_sub(1).ok_or_else(missing)?].1;
        let mut cycles = 0;
        let mut before: Option<&Instruction<'_>> = None;
        for pair in self.executed[start..].windows(2) {
            let [(address, function), (next, _)] = pair else { continue };
            if *function == caller {
                break;
            }
            let instruction =
                self.instructions.get(address).ok_or_else(|| format!("{address:#x} was not disassembled"))?;
            cycles += instruction.cycles(*next != address + instruction.size, before);
            before = Some(instruction);
        }
        Ok(f64::from(cycles))
    }
}

fn is_hex(word: &str) -> bool {
    word.bytes().all(|byte| byte.is_ascii_hexdigit())
}

impl Instruction<'_> {
    fn cycles(&self, jumps: bool, before: Option<&Self>) -> u32 {
        let name = self.mnemonic.split('.').next().unwrap_or_default();
        let registers = || self.operands.split_once('{').map_or(1, |(_, list)| count(list));
        let own = match name {
            "vdiv" | "vsqrt" => 14,
            "vmla" | "vmls" | "vnmla" | "vnmls" | "vfma" | "vfms" => 3,
            "vpush" | "vpop" | "vldm" | "vstm" | "vldmia" | "vstmia" | "vldmdb" | "vstmdb" => {
                1 + registers() * self.words()
            }
            "push" | "pop" | "ldm" | "stm" | "ldmia" | "stmia" | "ldmdb" | "stmdb" => 1 + registers(),
            "ldrd" | "strd" => {
                if before.is_some_and(Self::accesses_memory) {
                    2
                } else {
                    3
                }
            }
            "udiv" | "sdiv" => 7,
            "umull" | "smull" | "umlal" | "smlal" | "mla" | "mls" => 1,
            _ if name.starts_with("ldr") || name.starts_with("vldr") => {
                1 + u32::from(!before.is_some_and(Self::accesses_memory)) + (self.words() - 1)
            }
            _ if name.starts_with("vstr") => self.words(),
            _ => 1,
        };
        let waits = u32::from(before.is_some_and(|before| self.waits_for(before)));
        own + waits + if jumps { 2 } else { 0 }
    }

    fn accesses_memory(&self) -> bool {
        ["ldr", "str", "vldr", "vstr"].iter().any(|kind| self.mnemonic.starts_with(kind))
    }

    /// Words that a register of this instruction holds.
    fn words(&self) -> u32 {
        if self.operands.trim_start_matches('{').starts_with('d') { 2 } else { 1 }
    }

    /// Whether this is arithmetic of the floating-point unit on the result of the instruction before, which was as well.
    fn waits_for(&self, before: &Self) -> bool {
        let computes = |instruction: &Self| {
            ["vadd", "vsub", "vmul", "vmla", "vmls", "vdiv", "vsqrt", "vneg", "vnmul", "vcmp", "vcvt"]
                .iter()
                .any(|kind| instruction.mnemonic.starts_with(kind))
        };
        let result = before.operands.split(',').next().unwrap_or_default().trim();
        let taken = self.operands.split(',').map(str::trim).skip(usize::from(!self.mnemonic.starts_with("vcmp")));
        computes(self) && computes(before) && taken.into_iter().any(|operand| operand == result)
    }
}

/// Registers in a list such as `d8, d9} ` or `r4-r7, lr}`.
fn count(list: &str) -> u32 {
    let number = |register: &str| register.trim_matches(|c: char| !c.is_ascii_digit()).parse::<u32>();
    list.trim_end_matches([' ', '}'])
        .split(',')
        .map(|register| match register.split_once('-') {
            Some((first, last)) => match (number(first), number(last)) {
                (Ok(first), Ok(last)) => last.saturating_sub(first) + 1,
                _ => 1,
            },
            None => 1,
        })
        .sum()
}
