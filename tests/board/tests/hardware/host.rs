//! Basis of the models: instructions of the host on addresses that trap, and the versions of the libraries.

use std::arch::asm;
use std::fs;

use board_on_host::board::Board;
use board_on_host::chip::rcc::Oscillators;

/// A word that holds whatever is written: RCC_SSCGR, which the models have no use for.
const WORD: usize = 0x4002_3880;
/// The program's flags that tests and arithmetic set.
const FLAGS: u64 = 0x8c5 & !(1 << 4);

/// Runs an instruction on a word of memory and returns rax, r9 and the flags after it.
macro_rules! execute {
    ($instruction:literal, $base:expr) => {{
        let (mut rax, mut r9, flags): (u64, u64, u64) = (0x1122_3344_5566_7788, 0x99aa_bbcc_ddee_ff00, 0);
        let _: u64 = flags;
        let flags: u64;
        // SAFETY: the instruction touches the word at `base` alone. Four registers address it in different ways.
        unsafe {
            asm!(
                // The flags are the same before.
                "cmp rcx, rcx",
                $instruction,
                "pushfq", "pop {flags}",
                flags = lateout(reg) flags, inout("rax") rax, inout("r9") r9,
                in("rdi") $base, in("rsi") $base - 0x20, in("r8") $base - 0x1230, in("rcx") 0x8cusize, out("r10") _,
            );
        }
        (rax, r9, flags & FLAGS)
    }};
}

/// Compares an instruction on a register of the chip with the same one on memory.
macro_rules! compare {
    ($board:expr, $($instruction:literal)*) => {$(
        for start in [0u32, 1, 0x10, 0x7fff_ffff, 0x8000_0000, 0xdead_beef, u32::MAX] {
            let memory = Box::into_raw(Box::new(start));
            let expected = execute!($instruction, memory as usize);
            // SAFETY: it came out of a box.
            let in_memory = *unsafe { Box::from_raw(memory) };
            $board.chip(|chip| chip.write(WORD as u32, start));
            let found = execute!($instruction, WORD);
            let in_register = $board.chip(|chip| chip.read(WORD as u32));
            assert_eq!((found, in_register), (expected, in_memory), "{} on {start:#x}", $instruction);
        }
    )*};
}

#[test]
fn instructions_do_to_registers_what_they_do_to_memory() {
    let board = Board::new(Oscillators::default());
    compare!(board,
        "mov eax, [rdi]" "mov r9d, [rsi + 0x20]" "mov eax, [r8 + 0x1230]" "mov r9d, [rsi + rcx * 8 - 0x440]"
        "mov [rdi], r9d" "mov [rsi + 0x20], eax" "mov dword ptr [rdi], 0xc0ffee" "mov dword ptr [r8 + rcx * 4 + 0x1000], -2"
        "mov [r8 + rcx * 4 + 0x1000], r9d" "mov [rdi + 2], r9w" "mov [rdi + 1], ah"
        "mov byte ptr [r8 + 0x1231], 0xde" "test dword ptr [rdi], 0x80000001" "cmp eax, [rsi + 0x20]" "movzx eax, byte ptr [rdi + 1]"
        "or dword ptr [rdi], 0x1000000" "and [rdi], r9d" "bts dword ptr [rdi], 7" "xchg [rdi], eax" "lock or dword ptr [rdi], 2"
    );
}

#[test]
fn the_libraries_are_those_of_the_firmware() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let version = |lock: &str, package: &str| {
        let text = fs::read_to_string(format!("{root}/{lock}")).expect("the lock file");
        let at = text.find(&format!("name = \"{package}\"\n")).expect("the package");
        text[at..].lines().nth(1).expect("its version").to_owned()
    };
    for package in ["stm32f4xx-hal", "stm32f4", "stm32-metapac", "embedded-hal-bus"] {
        assert_eq!(version("Cargo.lock", package), version("firmware/Cargo.lock", package), "{package}");
    }
}
