//! Cycles of the Cortex-M4F, modelled from a trace of instructions, since QEMU has no clock of its own.
//!
//! Each instruction takes what the core's technical reference manual states (Arm 100166, tables 3-1 and 7-1), from memory
//! without wait states, with these choices where the manual leaves a range:
//! - a load directly after a load or store overlaps it (section 3.3.2) and takes one cycle less;
//! - a store takes one cycle per word, because the write buffer completes it beside the next instruction;
//! - a taken branch refills the pipeline in two cycles (P = 1 to 3);
//! - a division of integers takes 7 cycles (2 to 12);
//! - a result of the floating-point unit that the next instruction of that unit uses costs one cycle more (section 7.2.3).
//!
//! This is an estimate: on a board, `springpot pil --port` counts.

use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::io::{self, BufRead, BufReader, Write};
use std::process::{Command, Stdio};

use crate::process::{Result, line, output, read, root};
use crate::setup::{TARGETS, Toolchain, built};

/// Functions of `tests/embedded/src/cycles.rs`.
const KERNELS: &str = "creep_12_36 relaxation_12_36 creep_12_36_curve relaxation_12_36_curve creep_12_36_curves \
    relaxation_12_36_curves creep_12_36_series relaxation_12_36_series creep_8_18 relaxation_8_18 creep_8_16 relaxation_8_16 \
    voltage feedforward observer tracking tick tick_curve tick_curves tick_series";

/// The row of docs/results.md that a function is for: of `creep_8_16` creep/8+16, of `tick_curve`, which names no size, tick/12+36+curve.
fn row(kernel: &str) -> String {
    let (law, rest) = kernel.split_once('_').unwrap_or((kernel, ""));
    let size = if rest.starts_with(|c: char| c.is_ascii_digit()) { "" } else { "12_36_" };
    format!("{law}/{}", format!("{size}{rest}").trim_end_matches('_').replace('_', "+"))
}

/// Cycles by the rows of docs/results.md.
pub fn modelled(toolchain: &Toolchain) -> Result<BTreeMap<String, u64>> {
    let folder = root().join("tests/embedded");
    output(toolchain.cargo(&folder, TARGETS[0], "build --quiet --release --bin cycles"))?;
    let log = built().join("cycles.log");
    // Of a run that was interrupted.
    for left in [&log, &built().join(GO)] {
        let _ = fs::remove_file(left);
    }
    let mut qemu = Command::new("qemu-system-arm");
    qemu.args(["-M", "olimex-stm32-h405", "-nographic", "-monitor", "stdio", "-serial", "none"])
        .args(["-semihosting-config", "enable=on,target=native", "-D"])
        .arg(&log)
        .arg("-kernel")
        .arg(built().join(TARGETS[0]).join("release/cycles"))
        .current_dir(built());
    traced(qemu)?;
    let text = read(&log)?;
    let trace = Trace::read(&text);
    KERNELS.split(' ').map(|kernel| Ok((row(kernel), trace.cycles_of(kernel)? as u64))).collect()
}

/// File that the program waits for before each kernel.
const GO: &str = "go";

/// Runs the program in `qemu`, whose monitor is its input and output, and traces what it does between `begin` and `end`: what it builds before
/// takes a thousand times as many instructions.
fn traced(mut qemu: Command) -> Result<()> {
    let begin = format!("one-insn-per-tb on\nlog in_asm,exec,nochain\npmemsave 0 1 {GO}\n");
    let command = line(&qemu);
    let failed = |error: io::Error| format!("{command}: {error}");
    let mut child = qemu.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().map_err(failed)?;
    let (mut monitor, printed) = (child.stdin.take(), child.stdout.take());
    let order = |line: io::Result<String>| {
        let orders = match line?.split_whitespace().last() {
            Some("begin") => &begin,
            Some("end") => "log none\none-insn-per-tb off\n",
            _ => "",
        };
        monitor.as_mut().map_or(Ok(()), |monitor| monitor.write_all(orders.as_bytes()))
    };
    let ordered = printed.into_iter().flat_map(|printed| BufReader::new(printed).lines()).try_for_each(order);
    if ordered.is_err() {
        let _ = child.kill();
    }
    let status = child.wait().map_err(failed)?;
    ordered.map_err(failed)?;
    if status.success() { Ok(()) } else { Err(format!("{status}: {command}")) }
}

/// An instruction: its address, its mnemonic, its operands.
struct Instruction<'a> {
    size: u64,
    mnemonic: &'a str,
    operands: &'a str,
}

/// The executed instructions, in order: address and function.
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
        // A loop may lead back to the entry: a call comes from another function.
        let is_call = |pair: &[(u64, &str)]| pair[1].0 == entry && pair[0].1 != kernel;
        let before_call = self.executed.windows(2).rposition(is_call).ok_or_else(missing)?;
        let (start, caller) = (before_call + 1, self.executed[before_call].1);
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
        let list = self.operands.split_once('{').map_or("", |(_, list)| list);
        let own = match name {
            "vdiv" | "vsqrt" => 14,
            "vmla" | "vmls" | "vnmla" | "vnmls" | "vfma" | "vfms" => 3,
            "vpush" | "vpop" | "vldm" | "vstm" | "vldmia" | "vstmia" | "vldmdb" | "vstmdb" => {
                1 + count(list) * words(list)
            }
            "push" | "pop" | "ldm" | "stm" | "ldmia" | "stmia" | "ldmdb" | "stmdb" => 1 + count(list),
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
                1 + u32::from(!before.is_some_and(Self::accesses_memory)) + (words(self.operands) - 1)
            }
            _ if name.starts_with("vstr") => words(self.operands),
            _ => 1,
        };
        let waits = u32::from(before.is_some_and(|before| self.waits_for(before)));
        own + waits + if jumps { 2 } else { 0 }
    }

    fn accesses_memory(&self) -> bool {
        ["ldr", "str", "vldr", "vstr"].iter().any(|kind| self.mnemonic.starts_with(kind))
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

/// Words that the first of these registers holds.
fn words(registers: &str) -> u32 {
    if registers.starts_with('d') { 2 } else { 1 }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Instructions: address, code, text.
    type Listing = [(&'static str, &'static str, &'static str)];

    /// Parses the output of QEMU: the disassembly, then the address and the function of every executed instruction.
    fn trace(listing: &Listing, executed: &[(&str, &str)]) -> String {
        let line = |(address, code, text): &(&str, &str, &str)| format!("0x0000{address}:  {code}  {text}\n");
        let disassembly: String = listing.iter().map(line).collect();
        let line = |(address, function): &(&str, &str)| {
            format!("Trace 0: 0x7f1200000000 [00800400/000000000000{address}/00000010/ff020201] {function}\n")
        };
        format!("IN: kernel\n{disassembly}") + &executed.iter().map(line).collect::<String>()
    }

    fn cycles(listing: &Listing, executed: &[(&str, &str)]) -> f64 {
        Trace::read(&trace(listing, executed)).cycles_of("kernel").expect("in the trace")
    }

    #[test]
    fn rows_are_named_after_functions() {
        let rows = ["creep_12_36", "relaxation_8_18", "creep_12_36_series", "voltage", "tick_curves"].map(row);
        assert_eq!(
            rows,
            ["creep/12+36", "relaxation/8+18", "creep/12+36+series", "voltage/12+36", "tick/12+36+curves"]
        );
    }

    /// Straight code, counted by hand from tables 3-1 and 7-1 of Arm 100166.
    #[test]
    fn loads_arithmetic_and_return() {
        let listing = [
            ("0100", "b510     ", "push     {r4, lr}"),     // 1 + 2
            ("0102", "ed90 0a00", "vldr     s0, [r0]"),     // 2
            ("0106", "edd0 0a01", "vldr     s1, [r0, #4]"), // 2, 1 less after a load
            ("010a", "ee20 0a20", "vmul.f32 s0, s0, s1"),   // 1
            ("010e", "ee30 0a20", "vadd.f32 s0, s0, s1"),   // 1, 1 more for the product
            ("0112", "ed80 0a00", "vstr     s0, [r0]"),     // 1
            ("0116", "eeb1 1ac1", "vsqrt.f32 s2, s2"),      // 14
            ("011a", "bd10     ", "pop      {r4, pc}"),     // 1 + 2, and 2 for the jump
        ];
        let inside: Vec<(&str, &str)> = listing.iter().map(|(address, ..)| (*address, "kernel")).collect();
        let executed = [&[("0090", "main")], inside.as_slice(), &[("0094", "main")]].concat();
        assert_eq!(cycles(&listing, &executed), 3.0 + 2.0 + 1.0 + 1.0 + 2.0 + 1.0 + 14.0 + 5.0);
    }

    /// A loop of three turns: a taken branch takes 1 + 2, one that is not taken 1.
    #[test]
    fn taken_branches() {
        let listing = [("0100", "3801", "subs r0, #1"), ("0102", "d1fd", "bne #0x100"), ("0104", "4770", "bx lr")];
        let turn = [("0100", "kernel"), ("0102", "kernel")];
        let executed =
            [&[("0090", "main")], turn.as_slice(), &turn, &turn, &[("0104", "kernel"), ("0094", "main")]].concat();
        assert_eq!(cycles(&listing, &executed), (1.0 + 3.0) + (1.0 + 3.0) + (1.0 + 1.0) + 3.0);
    }

    /// Functions that a kernel calls are part of it, and its last call counts: the first ones warm up.
    #[test]
    fn calls_and_the_last_of_several_runs() {
        let listing = [
            ("0100", "f000 f802", "bl #0x200"),       // 1 + 2
            ("0104", "4770     ", "bx lr"),           // 1 + 2
            ("0200", "fb90 f0f1", "sdiv r0, r0, r1"), // 7 of 2 to 12
            ("0204", "4770     ", "bx lr"),           // 1 + 2
        ];
        let short = [("0100", "kernel"), ("0104", "kernel")];
        let long = [("0100", "kernel"), ("0200", "callee"), ("0204", "callee"), ("0104", "kernel")];
        let main = [("0090", "main")];
        let executed = [main.as_slice(), &short, &main, &long, &main].concat();
        assert_eq!(cycles(&listing, &executed), 3.0 + 7.0 + 3.0 + 3.0);
        let other = Trace::read(&trace(&listing, &executed)).cycles_of("another");
        assert!(other.is_err_and(|error| error.contains("another is not in the trace")));
    }

    /// Instructions alone, without those before them, against tables 3-1 and 7-1 of Arm 100166.
    #[test]
    fn single_instructions() {
        for (mnemonic, operands, expected) in [
            ("adds", "r0, r0, r1", 1),
            ("mul", "r0, r1, r2", 1),
            ("smlal", "r0, r1, r2, r3", 1),
            ("ldr", "r0, [r1]", 2),
            ("str", "r0, [r1]", 1),
            ("ldrd", "r0, r1, [r2]", 1 + 2),
            ("ldm.w", "r0!, {r4, r5, r6, r7}", 1 + 4),
            ("push.w", "{r4-r11, lr}", 1 + 9),
            ("vadd.f32", "s0, s1, s2", 1),
            ("vmul.f32", "s0, s1, s2", 1),
            ("vmla.f32", "s0, s1, s2", 3),
            ("vdiv.f32", "s0, s1, s2", 14),
            ("vldr", "s0, [r0]", 2),
            ("vldr", "d0, [r0]", 3),
            ("vpush", "{d8, d9}", 1 + 2 * 2),
            ("vpop", "{d8-d15}", 1 + 2 * 8),
            ("vldmia", "r0!, {s0-s7}", 1 + 8),
            ("vstmia", "r0!, {d0-d3}", 1 + 2 * 4),
        ] {
            let instruction = Instruction { size: 4, mnemonic, operands };
            assert_eq!(instruction.cycles(false, None), expected, "{mnemonic} {operands}");
        }
    }

    /// Section 7.2.3: only arithmetic on the result of the arithmetic directly before waits.
    #[test]
    fn results_that_are_used_at_once() {
        let of = |mnemonic, operands| Instruction { size: 4, mnemonic, operands };
        let product = of("vmul.f32", "s0, s1, s2");
        for (mnemonic, operands, expected) in [
            ("vadd.f32", "s3, s0, s4", 2),
            ("vadd.f32", "s3, s4, s5", 1),
            ("vadd.f32", "s0, s4, s5", 1),
            ("vcmp.f32", "s0, s4", 2),
            ("vmov", "r0, s0", 1),
        ] {
            assert_eq!(of(mnemonic, operands).cycles(false, Some(&product)), expected, "{mnemonic} {operands}");
        }
        let load = of("vldr", "s0, [r0]");
        assert_eq!(of("vadd.f32", "s3, s0, s4").cycles(false, Some(&load)), 1);
    }
}
