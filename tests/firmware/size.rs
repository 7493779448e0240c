//! Flash and RAM of the images.

use std::ops::Range;

use documents::Tolerance;

use crate::{image, stated};

/// Flash and RAM in docs/results.md are those of the images within 2 %: the one for a board, those for ST's STM32F4DISCOVERY and NUCLEO-G474RE, and the one for QEMU,
/// which has the loop test as well. The linker holds the budget of both.
#[test]
fn the_images_take_what_is_stated() {
    for (program, rows) in [
        ("qemu", ["flash/qemu", "ram/qemu"]),
        ("firmware", ["flash", "ram"]),
        ("stm32f407-discovery", ["flash/discovery", "ram/discovery"]),
        ("nucleo-g474re", ["flash/nucleo", "ram/nucleo"]),
    ] {
        let elf = std::fs::read(image(program)).expect("built");
        // Where the statics are: an STM32G4 has its stack below them.
        let statics = if program == "nucleo-g474re" { 0x2001_0000..0x2001_5000 } else { 0x2000_0000..0x2000_bc00 };
        let (flash, ram) = taken(&elf, &statics);
        println!("{program}: {flash} bytes of flash, {ram} of RAM");
        assert!(flash <= 262_144.0 && ram <= 20_480.0);
        for (row, taken) in rows.into_iter().zip([flash, ram]) {
            let stated = stated(row, "bytes");
            assert!(
                Tolerance::COUNT.holds(taken, stated),
                "{stated} bytes of {row} are stated, {program} takes {taken}"
            );
        }
    }
}

/// README has the sizes of results.md, in kB.
#[test]
fn the_readme_states_the_same_sizes() {
    let readme = include_str!("../../README.md");
    let row = readme.lines().find(|line| line.starts_with("| flash, RAM of the firmware |")).expect("a row");
    let numbers: Vec<f64> = row.split([' ', '|']).filter_map(|word| word.parse().ok()).collect();
    assert_eq!(numbers.len(), 3, "{row}");
    for (number, size) in numbers.into_iter().zip(["flash", "ram", "stack"]) {
        assert!(Tolerance::COUNT.holds(1e3 * number, stated(size, "bytes")), "{row}: {size}");
    }
}

/// Bytes of flash and of RAM in an image: 32-bit ELF, little-endian, its section headers.
fn taken(elf: &[u8], statics: &Range<u32>) -> (f64, f64) {
    let word = |at: usize| u32::from_le_bytes([elf[at], elf[at + 1], elf[at + 2], elf[at + 3]]);
    let half = |at: usize| usize::from(u16::from_le_bytes([elf[at], elf[at + 1]]));
    let (start, size, count) = (word(0x20) as usize, half(0x2e), half(0x30));
    let (mut flash, mut ram) = (0, 0);
    for section in (0..count).map(|index| start + index * size) {
        let (kind, flags, address, bytes) =
            (word(section + 4), word(section + 8), word(section + 12), word(section + 20));
        // What is loaded is allocated and has contents; statics are allocated in the SRAM.
        let allocated = flags & 2 != 0;
        if allocated && kind == 1 {
            flash += bytes;
        }
        if allocated && statics.contains(&address) {
            ram += bytes;
        }
    }
    (f64::from(flash), f64::from(ram))
}
