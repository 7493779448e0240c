//! Ctrl-C ends long work with the best so far; a second one ends it at once.

use std::process;
use std::sync::atomic::{AtomicBool, Ordering};

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// A flag that Ctrl-C sets.
pub fn flag() -> &'static AtomicBool {
    // A handler that is there already is this one.
    let _ = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            process::exit(130);
        }
        eprintln!("host-sim: ends with the best so far; once more to end at once");
    });
    &INTERRUPTED
}
