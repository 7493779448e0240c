//! Ctrl-C: a search ends with the best result so far, a film is brought to 0 V, anything else ends at once. Incomplete files
//! are removed, and child processes end as well.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{self, ChildStderr};
use std::sync::atomic::{AtomicBool, AtomicU8, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

static SEARCHING: AtomicBool = AtomicBool::new(false);
static STOP: AtomicBool = AtomicBool::new(false);
static FILM_IS_LIVE: AtomicBool = AtomicBool::new(false);
/// How often Ctrl-C has come while a film was live.
static CAME: AtomicU8 = AtomicU8::new(0);
static HALF_WRITTEN: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());
static CHILDREN: Mutex<Vec<Arc<Mutex<process::Child>>>> = Mutex::new(Vec::new());

/// Installs the handler of Ctrl-C and of the system's termination signals.
pub fn install() {
    // An error means that this handler is already installed.
    let _ = ctrlc::set_handler(|| {
        if FILM_IS_LIVE.load(Ordering::Relaxed) && goes_on_to_0_v() {
            STOP.store(true, Ordering::Relaxed);
            return;
        }
        if SEARCHING.load(Ordering::Relaxed) && !STOP.swap(true, Ordering::Relaxed) {
            eprintln!("host-sim: comes to an end; once more to end at once");
            return;
        }
        for path in locked(&HALF_WRITTEN).iter() {
            let _ = fs::remove_file(path);
        }
        for child in locked(&CHILDREN).iter() {
            let _ = locked(child).kill();
        }
        process::exit(130);
    });
}

/// Says what becomes of a film that this program keeps live. Only the third Ctrl-C ends the program, and leaves the film to its board.
fn goes_on_to_0_v() -> bool {
    let times = CAME.fetch_add(1, Ordering::Relaxed);
    eprintln!(
        "host-sim: {}",
        match times {
            0 => "brings the film to 0 V and ends",
            1 => "still brings the film to 0 V, and tells if it stays live; once more leaves it as it is",
            _ =>
                "leaves a film that may be live: its board disables the amplifier once it has heard nothing for heartbeat_s. \
                 Measure before you touch it",
        }
    );
    times < 2
}

/// As [`stop_flag`], of who keeps a film live: a second Ctrl-C does not keep it from bringing the film to 0 V.
pub fn live_film() -> &'static AtomicBool {
    FILM_IS_LIVE.store(true, Ordering::Relaxed);
    &STOP
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
    /// Registers the file at `path`.
    pub fn new(path: &Path) -> Self {
        locked(&HALF_WRITTEN).push(path.into());
        Self(path.into())
    }
}

impl Drop for HalfWritten {
    fn drop(&mut self) {
        locked(&HALF_WRITTEN).retain(|path| *path != self.0);
    }
}

/// A child process; it ends with this program, or when this is dropped.
#[derive(Debug)]
pub struct Child(Arc<Mutex<process::Child>>);

impl Child {
    /// Registers the process.
    pub fn new(child: process::Child) -> Self {
        let child = Arc::new(Mutex::new(child));
        locked(&CHILDREN).push(Arc::clone(&child));
        Self(child)
    }

    /// Whether it has ended by itself.
    pub fn has_ended(&self) -> bool {
        !matches!(locked(&self.0).try_wait(), Ok(None))
    }

    /// Ends it, and gives its standard error, if that is a pipe.
    pub fn end(&self) -> Option<ChildStderr> {
        let mut child = locked(&self.0);
        // One that has ended already is no error.
        let _ = child.kill();
        let _ = child.wait();
        child.stderr.take()
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        self.end();
        locked(&CHILDREN).retain(|other| !Arc::ptr_eq(other, &self.0));
    }
}

/// Locks `mutex`. A panic elsewhere leaves the lists valid.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
