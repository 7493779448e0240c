//! Prints what laws and steps cost on this target, and checksums of all that they computed.
//!
//! Lines are `cost NAME INSTRUCTIONS` and `bits NAME CHECKSUM`; `cargo xtask embedded` holds the former against the
//! tables of docs/results.md and the latter against the host's.
#![no_std]
#![no_main]

use chip_program::{Checksum, FEW, FEW_WITH_FPU, FILMS, Name, Report, SMALL};
use semihosting::{println, process};

#[cfg_attr(target_arch = "riscv32", path = "minstret.rs")]
mod counter;

use counter::Counter;

struct Printer {
    counter: Counter,
}

impl Report for Printer {
    fn cost<R>(&mut self, name: Name, work: impl FnOnce() -> R) -> R {
        let (instructions, result) = self.counter.count(work);
        println!("cost {} {}", name, instructions);
        result
    }

    fn cost_of_step(&mut self, name: Name, steps: u16, work: impl FnOnce(), idle: impl FnOnce()) {
        let (idle, ()) = self.counter.count(idle);
        let (instructions, ()) = self.counter.count(work);
        println!("cost {} {}", name, (instructions - idle) / u64::from(steps));
    }

    fn bits(&mut self, name: Name, checksum: Checksum) {
        println!("bits {} {:016x}", name, checksum.0);
    }
}

#[cfg_attr(target_arch = "arm", cortex_m_rt::entry)]
#[cfg_attr(target_arch = "riscv32", riscv_rt::entry)]
fn main() -> ! {
    // The Cortex-M0 alone has no atomic exchange.
    let is_small = cfg!(all(target_arch = "arm", not(target_has_atomic = "32")));
    let films = match (cfg!(feature = "few-films"), is_small) {
        (true, _) if cfg!(target_abi = "eabihf") => &FEW_WITH_FPU[..],
        (true, _) => &FEW,
        (false, true) => &SMALL,
        (false, false) => &FILMS,
    };
    chip_program::run(&mut Printer { counter: Counter::start() }, films);
    process::exit(0)
}
