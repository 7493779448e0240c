//! Images in QEMU: the host's bits on the chips, and what a step costs there.

use std::collections::BTreeMap;
use std::path::Path;

use chip_program::{Checksum, FEW, FILMS, Film, Name, Report};
use documents::{Documents, Tolerance};

use crate::cycles;
use crate::process::{Result, cargo, output, root, run as run_command};
use crate::setup::{OTHER_TARGETS, TARGETS, Toolchain};

/// What an image printed: lines of `cost NAME INSTRUCTIONS` and `bits NAME CHECKSUM`.
#[derive(Default)]
struct Printed {
    costs: BTreeMap<String, u64>,
    bits: BTreeMap<String, String>,
}

/// Checks the libraries with all features for both chips.
pub fn libraries(toolchain: &Toolchain) -> Result<()> {
    for target in TARGETS {
        for library in ["crates/springpot", "crates/dea-driver"] {
            run_command(toolchain.cargo(&root().join(library), target, &["check", "--quiet", "--all-features"]))?;
        }
    }
    Ok(())
}

/// Which films are stepped. A chip without an FPU needs long for all of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Films {
    /// Those of each kind, in a minute.
    Few,
    /// All of them, in three.
    All,
}

/// Builds images of the libraries, runs them and compares them with the host and with what the documents state.
pub fn run(toolchain: &Toolchain, of_small_chip: Films) -> Result<()> {
    let mut format = cargo(&["fmt", "--check"]);
    format.current_dir(root().join("tests/embedded"));
    run_command(format)?;
    let costs = steps(toolchain, TARGETS[0], Films::All)?;
    within_bars(&costs)?;
    let documents = Documents::read()?;
    let mut off = compare(&documents, "Cortex-M4F", &costs);
    off.extend(compare(&documents, "Cortex-M0", &steps(toolchain, TARGETS[1], of_small_chip)?));
    let cycles = cycles::modelled(toolchain)?;
    let cycles: BTreeMap<String, u64> =
        cycles.into_iter().map(|(row, cycles)| (row.to_owned(), cycles as u64)).collect();
    off.extend(compare(&documents, "cycles", &cycles));
    judge(&off)
}

/// The same for cores of other boards: a Cortex-M33 with all films, and RISC-V, which has no FPU either, with those of each kind.
pub fn other_cores(toolchain: &Toolchain) -> Result<()> {
    let [cortex_m33, risc_v] = OTHER_TARGETS;
    let documents = Documents::read()?;
    let mut off = compare(&documents, "Cortex-M33", &steps(toolchain, cortex_m33, Films::All)?);
    off.extend(compare(&documents, "riscv32imac", &steps(toolchain, risc_v, Films::Few)?));
    judge(&off)
}

/// Fails with what the documents do not state, if there is any.
fn judge(off: &[String]) -> Result<()> {
    if off.is_empty() {
        println!("the costs that the documents state hold within 2 %");
        Ok(())
    } else {
        Err(format!("docs/results.md, costs:\n  {}", off.join("\n  ")))
    }
}

/// Builds the images for `target`, runs them, compares the bits with the host's, and gives the costs.
fn steps(toolchain: &Toolchain, target: &str, films: Films) -> Result<BTreeMap<String, u64>> {
    let folder = root().join("tests/embedded");
    if matches!(toolchain, Toolchain::Rustup) {
        run_command(toolchain.cargo(&folder, target, &["clippy", "--quiet", "--", "-D", "warnings"]))?;
    }
    panic_free(toolchain, target, &folder)?;
    let (films, features): (&[Film], &[&str]) = match films {
        Films::Few => (&FEW, &["--features", "few-films"]),
        Films::All => (&FILMS, &[]),
    };
    let image = [&["--quiet", "--release", "--bin", "steps"], features].concat();
    run_command(toolchain.cargo(&folder, target, &[&["build"], image.as_slice()].concat()))?;
    let text = output(toolchain.cargo(&folder, target, &[&["run"], image.as_slice()].concat()))?;
    let printed = parse(&text)?;
    let mut host = Host::default();
    chip_program::run(&mut host, films);
    compare_bits(target, &host.0, &printed.bits)?;
    println!("{target}: {} checksums of laws, steps and both directions are the host's", printed.bits.len());
    Ok(printed.costs)
}

/// Links a program that cannot be linked if a step or a tick can panic, and sees that it does not link with one that can.
fn panic_free(toolchain: &Toolchain, target: &str, folder: &Path) -> Result<()> {
    let image = ["build", "--quiet", "--release", "--bin", "panic-free"];
    run_command(toolchain.cargo(folder, target, &image))?;
    let spoiled = toolchain.cargo(folder, target, &[image.as_slice(), &["--features", "can-panic"]].concat());
    match output(spoiled) {
        Err(error) if error.contains("a_step_or_a_tick_can_panic") => {
            println!("{target}: neither a step nor a tick can panic");
            Ok(())
        }
        Err(error) => Err(error),
        Ok(_) => Err(format!("{target}: panic-free links although it panics: it proves nothing")),
    }
}

/// The same program on the host.
#[derive(Default)]
struct Host(BTreeMap<String, String>);

impl Report for Host {
    fn cost<R>(&mut self, _: Name, work: impl FnOnce() -> R) -> R {
        work()
    }

    fn cost_of_step(&mut self, _: Name, _: u16, _: impl FnOnce(), _: impl FnOnce()) {}

    fn bits(&mut self, name: Name, checksum: Checksum) {
        self.0.insert(name.to_string(), format!("{:016x}", checksum.0));
    }
}

fn parse(text: &str) -> Result<Printed> {
    let mut printed = Printed::default();
    for line in text.lines() {
        match line.split_whitespace().collect::<Vec<_>>().as_slice() {
            ["cost", name, count] => {
                let count = count.parse().map_err(|_| format!("not a count: {line}"))?;
                printed.costs.insert((*name).into(), count);
            }
            ["bits", name, checksum] => {
                printed.bits.insert((*name).into(), (*checksum).into());
            }
            _ => return Err(format!("the image printed: {text}")),
        }
    }
    Ok(printed)
}

fn compare_bits(target: &str, host: &BTreeMap<String, String>, chip: &BTreeMap<String, String>) -> Result<()> {
    for (name, checksum) in host {
        match chip.get(name) {
            Some(same) if same == checksum => {}
            Some(other) => return Err(format!("{target}: {name} is {other}, on the host {checksum}")),
            None => return Err(format!("{target}: {name} was not reported")),
        }
    }
    if chip.len() == host.len() { Ok(()) } else { Err(format!("{target}: more was reported than on the host")) }
}

/// Whether the row `name` is about `full_name`: its name, or the beginning of it up to a slash.
fn is_of(full_name: &str, name: &str) -> bool {
    full_name.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
}

/// What a step and a tick may cost on the Cortex-M4F, independent of what the documents state.
fn within_bars(counted: &BTreeMap<String, u64>) -> Result<()> {
    let bars = [
        ("creep/12+36", 550),
        ("relaxation/12+36", 550),
        ("creep/12+36+curve", 620),
        ("relaxation/12+36+curve", 620),
        ("creep/8+16", 220),
        ("relaxation/8+16", 220),
        ("tick/12+36", 2000),
        ("tick/12+36+curve", 2000),
    ];
    for (name, bar) in bars {
        let counts: Vec<_> = counted.iter().filter(|(full_name, _)| is_of(full_name, name)).collect();
        if counts.is_empty() {
            return Err(format!("{name} was not counted"));
        }
        if let Some((full_name, count)) = counts.into_iter().find(|(_, count)| **count > bar) {
            return Err(format!("{full_name} takes {count} instructions; {bar} at the most"));
        }
    }
    Ok(())
}

/// What of `counted` is not stated within 2 % in the column whose title begins with `column`; a row's name is the beginning of
/// theirs.
fn compare(documents: &Documents, column: &str, counted: &BTreeMap<String, u64>) -> Vec<String> {
    let mut unmentioned: Vec<&String> = counted.keys().collect();
    let mut off = Vec::new();
    for (name, stated) in documents.column(column) {
        for (full_name, &counted) in counted.iter().filter(|(full_name, _)| is_of(full_name, name)) {
            unmentioned.retain(|other| *other != full_name);
            if !Tolerance::COUNT.holds(counted as f64, stated) {
                off.push(format!("{full_name}, {column}: {counted} counted, {stated} stated"));
            }
        }
    }
    off.extend(
        unmentioned.into_iter().map(|name| format!("{name}, {column}: {} counted, not in the table", counted[name])),
    );
    off
}
