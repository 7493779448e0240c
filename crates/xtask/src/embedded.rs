//! Images in QEMU: the host's bits on the chips, and what a step costs there.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use chip_program::{Checksum, FEW, FEW_WITH_FPU, FILMS, Film, Name, Report, SMALL};
use documents::{Documents, Tolerance};

use crate::cycles;
use crate::packages::LIBRARIES;
use crate::process::{Result, output, root, run as run_command};
use crate::setup::{OTHER_TARGETS, TARGETS, Toolchain};

/// Output of an image: lines of `cost NAME INSTRUCTIONS` and `bits NAME CHECKSUM`.
#[derive(Default)]
struct Printed {
    costs: BTreeMap<String, u64>,
    bits: BTreeMap<String, String>,
}

/// Checks the libraries with all features for the smaller chip: the other one can all that it can, and the images are built for both.
pub fn libraries(toolchain: &Toolchain) -> Result<()> {
    let [springpot, driver] = LIBRARIES;
    let check = format!("check --quiet --release --all-features --package {springpot} --package {driver}");
    run_command(toolchain.cargo(&root(), TARGETS[1], &check))
}

/// Which films are stepped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Films {
    /// Those of each kind: on a core without an FPU half a minute.
    Few,
    /// All of them: on a core with an FPU most of a minute, on the other one two.
    All,
}

/// Builds images of the libraries for both chips, runs them and compares them with the host and with what the documents state.
pub fn run(toolchain: &Toolchain, films: Films) -> Result<()> {
    let [cortex_m4f, cortex_m0] = TARGETS;
    let costs = steps(toolchain, cortex_m4f, films)?;
    within_bars(&costs)?;
    let documents = Documents::read()?;
    let mut off = compare(&documents, "Cortex-M4F", &costs);
    off.extend(compare(&documents, "Cortex-M0", &steps(toolchain, cortex_m0, films)?));
    off.extend(compare(&documents, "cycles", &cycles::modelled(toolchain)?));
    judge(&off)
}

/// The same for the firmware's core and those of other boards: with an FPU all films, on RISC-V those of each kind.
pub fn all_cores(toolchain: &Toolchain) -> Result<()> {
    let [cortex_m33, risc_v] = OTHER_TARGETS;
    let documents = Documents::read()?;
    let mut off = Vec::new();
    for (column, target, films) in [
        ("Cortex-M4F", TARGETS[0], Films::All),
        ("Cortex-M33", cortex_m33, Films::All),
        ("riscv32imac", risc_v, Films::Few),
    ] {
        off.extend(compare(&documents, column, &steps(toolchain, target, films)?));
    }
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

/// Where the images are.
pub fn folder() -> PathBuf {
    root().join("tests/embedded")
}

/// Builds the images for `target`, runs them, compares the bits with the host's, and gives the costs.
fn steps(toolchain: &Toolchain, target: &str, films: Films) -> Result<BTreeMap<String, u64>> {
    let folder = folder();
    panic_free(toolchain, target, &folder)?;
    let (films, features): (&[Film], &str) = match films {
        Films::Few if target == TARGETS[0] => (&FEW_WITH_FPU, "--features few-films"),
        Films::Few => (&FEW, "--features few-films"),
        Films::All if target == TARGETS[1] => (&SMALL, ""),
        Films::All => (&FILMS, ""),
    };
    let cargo =
        |verb: &str| toolchain.cargo(&folder, target, &format!("{verb} --quiet --release --bin steps {features}"));
    run_command(cargo("build"))?;
    let text = output(cargo("run"))?;
    let printed = parse(&text)?;
    let mut host = Host::default();
    chip_program::run(&mut host, films);
    compare_bits(target, &host.0, &printed.bits)?;
    println!("{target}: {} checksums of laws, steps and both directions are the host's", printed.bits.len());
    Ok(printed.costs)
}

/// Links a program that cannot be linked if a step or a tick can panic, and sees that it does not link with one that can.
fn panic_free(toolchain: &Toolchain, target: &str, folder: &Path) -> Result<()> {
    let image = "build --quiet --release --bin panic-free";
    run_command(toolchain.cargo(folder, target, image))?;
    let spoiled = toolchain.cargo(folder, target, &format!("{image} --features can-panic"));
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

/// Checks what a step and a tick may cost on the Cortex-M4F, independent of what the documents state.
fn within_bars(counted: &BTreeMap<String, u64>) -> Result<()> {
    let bars = [
        ("creep/12+36", 550),
        ("relaxation/12+36", 550),
        ("creep/12+36+curve", 620),
        ("relaxation/12+36+curve", 620),
        ("creep/12+36+curves", 700),
        ("relaxation/12+36+curves", 700),
        ("creep/12+36+series", 700),
        ("relaxation/12+36+series", 700),
        ("creep/8+16", 220),
        ("relaxation/8+16", 220),
        ("self-sensing", 150),
        ("tick/12+36", 2000),
        ("tick/12+36+curve", 2000),
        ("tick/12+36+curves", 2250),
        ("tick/12+36+series", 2150),
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

/// Returns the parts of `counted` that are not stated within 2 % in the column whose title begins with `column`; a row's name is the beginning of
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
