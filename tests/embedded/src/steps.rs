//! Prints what laws and steps cost on this target, and checksums of all that they computed.
//!
//! Lines are `cost NAME INSTRUCTIONS` and `bits NAME CHECKSUM`; `cargo xtask embedded` holds the former against the
//! README's table and the latter against the host's.
#![no_std]
#![no_main]

use chip_program::{Checksum, FEW, FILMS, Name, Report};
use cortex_m::Peripherals;
use cortex_m_rt::entry;
use cortex_m_semihosting::debug::{self, EXIT_SUCCESS};
use cortex_m_semihosting::hprintln;
use panic_semihosting as _;

mod counter;

use counter::Counter;

struct Printer {
    counter: Counter,
}

impl Report for Printer {
    fn cost<R>(&mut self, name: Name, work: impl FnOnce() -> R) -> R {
        let (instructions, result) = self.counter.count(work);
        hprintln!("cost {} {}", name, instructions);
        result
    }

    fn cost_of_step(&mut self, name: Name, steps: u16, work: impl FnOnce(), idle: impl FnOnce()) {
        let (idle, ()) = self.counter.count(idle);
        let (instructions, ()) = self.counter.count(work);
        hprintln!("cost {} {}", name, (instructions - idle) / u64::from(steps));
    }

    fn bits(&mut self, name: Name, checksum: Checksum) {
        hprintln!("bits {} {:016x}", name, checksum.0);
    }
}

#[entry]
fn main() -> ! {
    let Some(peripherals) = Peripherals::take() else { panic!("peripherals are taken once") };
    let films = if cfg!(feature = "few-films") { &FEW[..] } else { &FILMS };
    chip_program::run(&mut Printer { counter: Counter::start(peripherals.SYST) }, films);
    loop {
        debug::exit(EXIT_SUCCESS);
    }
}
