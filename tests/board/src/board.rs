//! A board with power: one at a time, since the chip's addresses are there once.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, MutexGuard, PoisonError};

use stm32f4xx_hal::pac::Peripherals;

use crate::chip::Chip;
use crate::chip::family::Family;
use crate::chip::rcc::Oscillators;
use crate::chip::violation::Violation;
use crate::log::{self, Line};
use crate::trap::{self, Machine};

/// Accesses after which a program counts as one that never ends: it ends the process. Setting the clocks takes 60 000, and 110 000 at the most.
const ACCESSES: u64 = 200_000;

static ONE: Mutex<()> = Mutex::new(());

/// A board with power. A second one waits until this one is dropped.
pub struct Board {
    _only: MutexGuard<'static, ()>,
}

impl Board {
    /// Switches a board with an STM32F4 on.
    #[must_use]
    pub fn new(oscillators: Oscillators) -> Self {
        Self::with(Family::F4, oscillators)
    }

    /// Switches a board on.
    #[must_use]
    pub fn with(family: Family, oscillators: Oscillators) -> Self {
        let only = ONE.lock().unwrap_or_else(PoisonError::into_inner);
        trap::install();
        *trap::machine() = Some(Machine::new(Chip::new(family, oscillators), ACCESSES));
        log::take();
        Self { _only: only }
    }

    /// Looks at the chip, or changes what is around it. `look` must not touch the chip's registers through their addresses.
    pub fn chip<R>(&self, look: impl FnOnce(&mut Chip) -> R) -> R {
        match trap::machine().as_mut() {
            Some(machine) => {
                // A program that comes back to be looked at has an end.
                machine.allow(ACCESSES);
                look(&mut machine.chip)
            }
            None => unreachable!("a board has a chip"),
        }
    }

    /// The chip's peripherals, as the firmware's start has them.
    #[must_use]
    pub fn peripherals(&self) -> Peripherals {
        // SAFETY: a second set of handles does no more harm than a second start of the firmware: their registers are models.
        unsafe { Peripherals::steal() }
    }

    /// Runs a part of the firmware that may panic; the error is the message of its panic.
    ///
    /// # Errors
    ///
    /// The firmware panicked. Where it accesses registers without end, the process ends.
    pub fn run<T>(&self, program: impl FnOnce(Peripherals) -> T) -> Result<T, String> {
        let peripherals = self.peripherals();
        catch_unwind(AssertUnwindSafe(|| program(peripherals))).map_err(|payload| {
            let text = payload.downcast_ref::<&str>().map(|text| (*text).to_owned());
            text.or_else(|| payload.downcast_ref().cloned()).unwrap_or_default()
        })
    }

    /// Messages that the firmware has logged since the last call.
    pub fn log(&self) -> Vec<Line> {
        log::take()
    }

    /// Actions of the firmware that the chip's documents forbid.
    #[must_use]
    pub fn violations(&self) -> Vec<Violation> {
        self.chip(|chip| chip.violations().to_vec())
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        *trap::machine() = None;
    }
}
