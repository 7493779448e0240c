//! A board with power: one at a time, since the chip's addresses are there once.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::Ordering;
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use stm32f4xx_hal::pac::Peripherals;

use crate::chip::Chip;
use crate::chip::rcc::Oscillators;
use crate::chip::violation::Violation;
use crate::log::{self, Line};
use crate::trap::{self, Machine, STOPPED};

/// Accesses after which a program counts as one that never ends. Setting the clocks takes 60 000, and 110 000 at the most.
const ACCESSES: u64 = 200_000;

static ONE: Mutex<()> = Mutex::new(());

/// A board with power. A second one waits until this one is dropped.
pub struct Board {
    _only: MutexGuard<'static, ()>,
}

/// How a program ended.
#[derive(Debug, PartialEq, Eq)]
pub enum Outcome<T> {
    Returned(T),
    Panicked(String),
    /// It accessed registers without end.
    NeverReturned,
}

impl<T> Outcome<T> {
    /// Value that it returned.
    ///
    /// # Panics
    ///
    /// Where it did not.
    #[track_caller]
    pub fn returned(self) -> T {
        match self {
            Self::Returned(value) => value,
            Self::Panicked(message) => panic!("the firmware panicked: {message}"),
            Self::NeverReturned => panic!("the firmware did not return"),
        }
    }
}

impl Board {
    /// Switches a board on.
    #[must_use]
    pub fn new(oscillators: Oscillators) -> Self {
        let only = ONE.lock().unwrap_or_else(PoisonError::into_inner);
        trap::install();
        let mut machine = Machine::new(Chip::new(oscillators));
        machine.left = ACCESSES;
        *trap::machine() = Some(machine);
        log::take();
        Self { _only: only }
    }

    /// Looks at the chip, or changes what is around it. `look` must not touch the chip's registers through their addresses.
    pub fn chip<R>(&self, look: impl FnOnce(&mut Chip) -> R) -> R {
        match trap::machine().as_mut() {
            Some(machine) => look(&mut machine.chip),
            None => unreachable!("a board has a chip"),
        }
    }

    /// The chip's peripherals, as the firmware's start has them.
    #[must_use]
    pub fn peripherals(&self) -> Peripherals {
        // SAFETY: a second set of handles does no more harm than a second start of the firmware: their registers are models.
        unsafe { Peripherals::steal() }
    }

    /// Runs a part of the firmware that may panic, or never return. One that does not return is stopped where it is, for good: what it
    /// has borrowed stays borrowed.
    pub fn run<T: Send + 'static>(&self, program: impl FnOnce(Peripherals) -> T + Send + 'static) -> Outcome<T> {
        STOPPED.store(false, Ordering::SeqCst);
        self.limit(true);
        let peripherals = self.peripherals();
        let (sender, receiver) = sync_channel(1);
        thread::spawn(move || {
            let outcome = match catch_unwind(AssertUnwindSafe(|| program(peripherals))) {
                Ok(value) => Outcome::Returned(value),
                Err(payload) => Outcome::Panicked(message(payload.as_ref())),
            };
            // A stopped one has no listener any more.
            let _ = sender.send(outcome);
        });
        let outcome = loop {
            match receiver.recv_timeout(Duration::from_millis(1)) {
                Ok(outcome) => break outcome,
                Err(RecvTimeoutError::Timeout) if !STOPPED.load(Ordering::SeqCst) => {}
                Err(_) => break Outcome::NeverReturned,
            }
        };
        self.limit(false);
        outcome
    }

    fn limit(&self, stops: bool) {
        if let Some(machine) = trap::machine().as_mut() {
            (machine.left, machine.stops) = (ACCESSES, stops);
        }
    }

    /// Messages that the firmware has logged since the last call.
    pub fn log(&self) -> Vec<Line> {
        log::take()
    }

    /// Actions of the firmware that the chip's documents forbid.
    #[must_use]
    pub fn violations(&self) -> Vec<Violation> {
        self.chip(|chip| chip.violations().iter().map(|&(_, violation)| violation).collect())
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        *trap::machine() = None;
    }
}

fn message(payload: &(dyn Any + Send)) -> String {
    match (payload.downcast_ref::<&str>(), payload.downcast_ref::<String>()) {
        (Some(text), _) => (*text).to_owned(),
        (_, Some(text)) => text.clone(),
        _ => String::from("no text"),
    }
}
