//! The emitted C on chips in QEMU: Rust's bits, and what a step costs beside Rust's.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;

use chip_program::{Checksum, FILMS, Name, Report};
use documents::{Documents, Tolerance};
use host_emit::{Film, HEADER, film};

use crate::bits::{all_kinds, compare_all, jobs, recorded};
use crate::films::{self, Case};
use crate::job::Kind;
use crate::program::{STRICT, Sources, source, succeeds};
use crate::recordings::recordings;

/// A chip and its board in QEMU.
struct Chip {
    /// As the title of its column in docs/c.md names it.
    name: &'static str,
    /// The column of docs/results.md that states what Rust takes, where there is one to compare with.
    rust: Option<&'static str>,
    compiler: &'static str,
    /// Processor, optimisation, and what the board needs.
    options: &'static [&'static str],
    /// Begin and length of flash and RAM, in the linker's words.
    flash: &'static str,
    ram: &'static str,
    qemu: &'static [&'static str],
}

/// Soft float, as most microcontrollers with this instruction set.
const RISCV: Chip = Chip {
    name: "riscv32imac",
    rust: None,
    compiler: "riscv64-unknown-elf-gcc",
    options: &["-march=rv32imac", "-mabi=ilp32", "-mcmodel=medany", "-msmall-data-limit=0", "--specs=picolibc.specs"],
    flash: "ORIGIN = 0x80000000, LENGTH = 1M",
    ram: "ORIGIN = 0x80100000, LENGTH = 128K",
    qemu: &["qemu-system-riscv32", "-M", "virt", "-bios", "none"],
};

const CORTEX_M4F: Chip = Chip {
    name: "M4F",
    rust: Some("Cortex-M4F"),
    compiler: "arm-none-eabi-gcc",
    options: &["-mthumb", "-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard", "-DCHIP_MHZ=168U"],
    flash: "ORIGIN = 0x08000000, LENGTH = 1M",
    ram: "ORIGIN = 0x20000000, LENGTH = 128K",
    qemu: &["qemu-system-arm", "-M", "olimex-stm32-h405"],
};

/// Without an FPU, in 16 KiB.
const CORTEX_M0: Chip = Chip {
    name: "M0",
    rust: None,
    options: &["-mthumb", "-mcpu=cortex-m0", "-mfloat-abi=soft", "-DCHIP_MHZ=16U"],
    flash: "ORIGIN = 0x00000000, LENGTH = 256K",
    ram: "ORIGIN = 0x20000000, LENGTH = 16K",
    qemu: &["qemu-system-arm", "-M", "microbit"],
    ..CORTEX_M4F
};

const CORTEX_M33: Chip = Chip {
    name: "M33",
    rust: None,
    options: &["-mthumb", "-mcpu=cortex-m33", "-mfpu=fpv5-sp-d16", "-mfloat-abi=hard", "-DCHIP_MHZ=20U"],
    flash: "ORIGIN = 0x10000000, LENGTH = 4M",
    ram: "ORIGIN = 0x38000000, LENGTH = 128K",
    qemu: &["qemu-system-arm", "-M", "mps2-an505"],
    ..CORTEX_M4F
};

/// How the C is compiled where speed counts; what the documents state of the chip.
const FAST: [&str; 2] = ["-O2", "-fno-math-errno"];

impl Chip {
    /// Compiles `main` with the films of `sources`.
    fn image(&self, sources: &Sources, main: &str, optimised: &[&str]) {
        let script = include_str!("../c/chip.ld").replace("@FLASH@", self.flash).replace("@RAM@", self.ram);
        let folder = sources.folder.path();
        fs::write(folder.join("chip.ld"), script).expect("written");
        let mut command = Command::new(self.compiler);
        command.current_dir(folder).args(self.options).args(STRICT).args(optimised);
        let entry = if self.name == RISCV.name { "-Wl,-e,_start" } else { "-Wl,-e,chip_reset" };
        command.args(["-ffunction-sections", "-nostartfiles", "-Tchip.ld", entry, "-o", "image", main]);
        succeeds(command.args(sources.film_files()).arg("-lm"));
    }

    /// The rows of a job.
    fn job(&self, sources: &Sources, job: &[u8]) -> Vec<u8> {
        sources.run(&mut self.run(sources.folder.path(), &[]), job);
        fs::read(sources.folder.path().join("output")).expect("the image has written it")
    }

    /// Starts the image, which reads `input` and writes `output` in the folder.
    fn run(&self, folder: &Path, options: &[&str]) -> Command {
        let mut command = Command::new(self.qemu[0]);
        command.current_dir(folder).args(&self.qemu[1..]);
        command.args(["-nographic", "-monitor", "none", "-serial", "none"]).args(options);
        command.args(["-semihosting-config", "enable=on,target=native", "-kernel", "image"]);
        command
    }
}

/// Three recordings of 155 s, forwards, backwards and under each law of control.
fn recordings_have_the_bits(chip: &Chip) {
    let cases = [films::plain(), films::rich()];
    let sources = Sources::new(&cases);
    chip.image(&sources, "chip_jobs.c", &FAST);
    for path in recordings("hossain") {
        let recorded = recorded(&path, 155);
        for (index, case) in cases.iter().enumerate() {
            all_kinds(|job| chip.job(&sources, job), (index, case), &recorded);
        }
    }
}

#[test]
#[ignore = "needs arm-none-eabi-gcc and QEMU: cargo xtask faces"]
fn three_recordings_have_the_bits_of_rust_on_the_cortex_m4f() {
    recordings_have_the_bits(&CORTEX_M4F);
}

/// The films of the chip program that are stepped every millisecond.
fn program_films() -> Vec<(chip_program::Film, Case)> {
    let all = FILMS.into_iter().filter(|film| film.step_s == 1e-3);
    all.map(|film| (film, films::of_program(film))).collect()
}

/// The output of the C program: `bits` and `cost` by the names that the Rust program gives them.
fn measured(chip: &Chip, films: &[(chip_program::Film, Case)], sources: &Sources) -> [BTreeMap<String, u64>; 2] {
    let output = sources.folder.path().join("output");
    let _ = fs::remove_file(&output);
    succeeds(&mut chip.run(sources.folder.path(), &["-icount", "shift=0"]));
    let text = fs::read_to_string(output).expect("the image has written it");
    ["bits", "cost"].map(|kind| {
        let lines = text.lines().filter_map(|line| line.strip_prefix(kind));
        lines
            .map(|line| {
                let words: Vec<&str> = line.split_whitespace().collect();
                let [what, number, value] = words.as_slice() else { panic!("the image wrote {line}") };
                let (film, _) = &films[number.parse::<usize>().expect("a number")];
                let what = WHAT.into_iter().find(|name| name == what).expect("a known one");
                let name = Name { film: *film, size: "12+36", what };
                (name.to_string(), u64::from_str_radix(value, 16).expect("hexadecimal"))
            })
            .collect()
    })
}

const WHAT: [&str; 10] = [
    "creep",
    "relaxation",
    "voltage",
    "feedforward",
    "observer",
    "tracking",
    "adaptive",
    "learning",
    "self-sensing",
    "self-sensing-longest",
];

/// Checksums of the Rust program on this host.
#[derive(Default)]
struct Host(BTreeMap<String, u64>);

impl Report for Host {
    fn cost<R>(&mut self, _: Name, work: impl FnOnce() -> R) -> R {
        work()
    }

    fn cost_of_step(&mut self, _: Name, _: u16, _: impl FnOnce(), _: impl FnOnce()) {}

    fn bits(&mut self, name: Name, checksum: Checksum) {
        if name.size == "12+36" && WHAT.contains(&name.what) {
            self.0.insert(name.to_string(), checksum.0);
        }
    }
}

/// In gcc's default mode, which fuses multiplication and addition where it may: the checksums of the Rust program, and instructions of each
/// step within 10 % of Rust's or below, as docs/results.md states them, which `cargo xtask embedded` holds.
fn steps_have_the_bits(chip: &Chip) {
    let films = program_films();
    let cases: Vec<Case> = films.iter().map(|(film, _)| films::of_program(*film)).collect();
    let sources = Sources::new(&cases);
    chip.image(&sources, "chip_costs.c", &[FAST[0], FAST[1], "-std=gnu99"]);
    let [bits, costs] = measured(chip, &films, &sources);
    let mut host = Host::default();
    chip_program::run(&mut host, &films.iter().map(|(film, _)| *film).collect::<Vec<_>>());
    assert_eq!(bits, host.0, "{}", chip.name);
    let documents = Documents::read().expect("readable");
    let mut off = Vec::new();
    // A voltage from a force is an instruction more or less than 27, as its numbers have it.
    for (name, &cost) in costs.iter().filter(|(name, _)| !name.starts_with("voltage")) {
        println!("{}: {name} {cost}", chip.name);
        // A row is about all presets, that of self-sensing about all laws.
        let row = name.split("/table").next().unwrap_or_default();
        let row = if row.starts_with("self-sensing") { row.trim_end_matches("/12+36") } else { row };
        if let Some(column) = chip.rust {
            let rust = documents.number(&[row], column).expect("docs/results.md states what Rust takes");
            if cost as f64 > 1.10 * rust {
                off.push(format!("{name}: {cost} instructions, Rust {rust}"));
            }
        }
        match documents.number(&[row], &format!("C on the {}", chip.name)) {
            Some(stated) if Tolerance::COUNT.holds(cost as f64, stated) => {}
            stated => off.push(format!("{name}: {cost} instructions, docs/c.md states {stated:?}")),
        }
    }
    assert!(off.is_empty(), "{}", off.join("\n"));
}

#[test]
#[ignore = "needs arm-none-eabi-gcc and QEMU: cargo xtask faces"]
fn steps_have_the_bits_of_rust_on_the_cortex_m4f() {
    steps_have_the_bits(&CORTEX_M4F);
}

#[test]
#[ignore = "needs arm-none-eabi-gcc and QEMU: cargo xtask faces"]
fn steps_have_the_bits_of_rust_on_the_cortex_m0() {
    steps_have_the_bits(&CORTEX_M0);
}

#[test]
#[ignore = "needs arm-none-eabi-gcc and QEMU: cargo xtask faces"]
fn steps_have_the_bits_of_rust_on_the_cortex_m33() {
    steps_have_the_bits(&CORTEX_M33);
}

#[test]
#[ignore = "needs riscv64-unknown-elf-gcc and QEMU: cargo xtask faces"]
fn steps_have_the_bits_of_rust_on_riscv32imac() {
    steps_have_the_bits(&RISCV);
}

/// The random laws of the host's test, a quarter of a second of every kind.
#[test]
#[ignore = "needs arm-none-eabi-gcc and QEMU: cargo xtask faces"]
fn two_hundred_random_laws_have_the_bits_of_rust_on_the_cortex_m4f() {
    let cases = films::random(200);
    let sources = Sources::new(&cases);
    CORTEX_M4F.image(&sources, "chip_jobs.c", &FAST);
    let [fast, ..] = recordings("wang");
    let recorded = recorded(&fast, 2);
    for kind in Kind::ALL {
        let (inputs, jobs) = jobs(kind, &cases, &recorded[1000..1250]);
        compare_all(kind, &cases, &inputs, &CORTEX_M4F.job(&sources, &jobs));
    }
}

/// Bytes of code and of constants, as docs/c.md states them.
#[test]
#[ignore = "needs arm-none-eabi-gcc: cargo xtask faces"]
fn sizes_are_those_of_the_page() {
    let [plain, rich] = [films::plain(), films::rich()];
    let folder = tempfile::TempDir::new().expect("a folder");
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).expect("written");
    write("springpot.h", HEADER);
    let sensed = plain.film("film_plain");
    write("sensed.c", &film(&sensed));
    write("plain.c", &film(&Film { self_sensing: None, ..sensed }));
    write("rich.c", &film(&Film { self_sensing: None, ..rich.film("film_rich") }));
    for name in ["tick.c", "sense.c"] {
        fs::copy(source(name), folder.path().join(name)).expect("copied");
    }
    let documents = Documents::read().expect("readable");
    let mut off = Vec::new();
    for (row, file, level) in [
        ("a tick of tracking, -O2", "tick.c", "-O2"),
        ("a tick of tracking, -Os", "tick.c", "-Os"),
        ("a tick of self-sensing, -O2", "sense.c", "-O2"),
        ("a tick of self-sensing, -Os", "sense.c", "-Os"),
        ("a film", "plain.c", "-O2"),
        ("a film that is its own sensor", "sensed.c", "-O2"),
        ("a film with curve, amplifier and learning", "rich.c", "-O2"),
    ] {
        let mut gcc = Command::new(CORTEX_M4F.compiler);
        gcc.current_dir(folder.path()).args(CORTEX_M4F.options).args(["-std=c99", level, FAST[1], "-c", file]);
        succeeds(gcc.args(["-o", "sized.o"]));
        let mut size = Command::new("arm-none-eabi-size");
        let text = String::from_utf8(succeeds(size.current_dir(folder.path()).arg("sized.o"))).expect("text");
        // Code and constants: the first column of the second line.
        let bytes = text.lines().nth(1).and_then(|line| line.split_whitespace().next()?.parse::<f64>().ok());
        let bytes = bytes.unwrap_or_else(|| panic!("arm-none-eabi-size printed {text}"));
        println!("{row}: {bytes}");
        let stated = documents.number(&[row], "bytes");
        if !stated.is_some_and(|stated| Tolerance::COUNT.holds(bytes, stated)) {
            off.push(format!("{row}: {bytes} bytes, docs/c.md states {stated:?}"));
        }
    }
    assert!(off.is_empty(), "{}", off.join("\n"));
}
