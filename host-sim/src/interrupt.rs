//! Ctrl-C: a search ends with the best so far, anything else at once; files that are half written are removed.

use std::fs;
use std::path::{Path, PathBuf};
use std::process;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

static SEARCHING: AtomicBool = AtomicBool::new(false);
static STOP: AtomicBool = AtomicBool::new(false);
static HALF_WRITTEN: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// Listens for Ctrl-C, and for the system's requests to end.
pub fn install() {
    // A handler that is there already is this one.
    let _ = ctrlc::set_handler(|| {
        if SEARCHING.load(Ordering::Relaxed) && !STOP.swap(true, Ordering::Relaxed) {
            eprintln!("host-sim: ends with the best so far; once more to end at once");
            return;
        }
        for path in HALF_WRITTEN.lock().unwrap_or_else(PoisonError::into_inner).iter() {
            let _ = fs::remove_file(path);
        }
        process::exit(130);
    });
}

/// A flag that Ctrl-C sets from now on, instead of ending the program.
pub fn stop_flag() -> &'static AtomicBool {
    SEARCHING.store(true, Ordering::Relaxed);
    &STOP
}

/// Whether a search was ended by Ctrl-C.
pub fn came() -> bool {
    STOP.load(Ordering::Relaxed)
}

/// A file that is removed if the program is ended while this stands.
#[derive(Debug)]
pub struct HalfWritten(PathBuf);

impl HalfWritten {
    /// Notes the file at `path`.
    pub fn new(path: &Path) -> Self {
        HALF_WRITTEN.lock().unwrap_or_else(PoisonError::into_inner).push(path.into());
        Self(path.into())
    }
}

impl Drop for HalfWritten {
    fn drop(&mut self) {
        HALF_WRITTEN.lock().unwrap_or_else(PoisonError::into_inner).retain(|path| *path != self.0);
    }
}
