//! Ctrl-C and the system's signals to end: a search ends with the best result so far, a film is brought to 0 V, anything else ends at once. Incomplete files
//! are removed, and child processes end as well.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{self, ChildStderr};
use std::sync::atomic::{AtomicBool, AtomicI32, AtomicU8, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::terminal;

static SEARCHING: AtomicBool = AtomicBool::new(false);
static STOP: AtomicBool = AtomicBool::new(false);
static FILM_IS_LIVE: AtomicBool = AtomicBool::new(false);
/// How often Ctrl-C has come while a film was live.
static CAME: AtomicU8 = AtomicU8::new(0);
/// The signal that set [`STOP`].
static SIGNAL: AtomicI32 = AtomicI32::new(0);
static HALF_WRITTEN: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());
static CHILDREN: Mutex<Vec<Arc<Mutex<process::Child>>>> = Mutex::new(Vec::new());

/// Installs the handler of Ctrl-C and of the system's termination signals. A hang-up that is ignored, as under `nohup`, stays ignored.
pub fn install() {
    #[cfg(unix)]
    {
        use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
        let signals = [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|&signal| signal != SIGHUP || !is_ignored(signal));
        // An error means that the system has no such signals.
        if let Ok(mut signals) = signal_hook::iterator::Signals::new(signals) {
            std::thread::spawn(move || signals.forever().for_each(handle));
        }
    }
    #[cfg(not(unix))]
    {
        /// The number of SIGINT on Unix: the exit status is the same on every system.
        const INTERRUPT: i32 = 2;
        // An error means that this handler is already installed.
        let _ = ctrlc::set_handler(|| handle(INTERRUPT));
    }
}

/// Whether this program was started with `signal` ignored, where the system reports it.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask >> (signal - 1) & 1 == 1
}

/// Lets a search come to an end at the first `signal`, and ends the program at the second, or where nothing is searched.
fn handle(signal: i32) {
    if FILM_IS_LIVE.load(Ordering::Relaxed) && goes_on_to_0_v() {
        SIGNAL.store(signal, Ordering::Relaxed);
        STOP.store(true, Ordering::Relaxed);
        return;
    }
    if SEARCHING.load(Ordering::Relaxed) && !STOP.swap(true, Ordering::Relaxed) {
        SIGNAL.store(signal, Ordering::Relaxed);
        terminal::message("stopping with the best result so far; press Ctrl-C again to stop at once");
        return;
    }
    for path in locked(&HALF_WRITTEN).iter().rev() {
        // What has come into a folder meanwhile stays.
        let _ = if path.is_dir() { fs::remove_dir(path) } else { fs::remove_file(path) };
    }
    for child in locked(&CHILDREN).iter() {
        let _ = locked(child).kill();
    }
    process::exit(exit_status(signal).into());
}

/// Exit status of a program that `signal` ended: 130 for Ctrl-C, 143 for TERM, 129 for HUP.
fn exit_status(signal: i32) -> u8 {
    128_u8.saturating_add(u8::try_from(signal).unwrap_or(u8::MAX))
}

/// Says what becomes of a film that this program keeps live. Only the third Ctrl-C ends the program, and leaves the film to its board.
fn goes_on_to_0_v() -> bool {
    let times = CAME.fetch_add(1, Ordering::Relaxed);
    terminal::message(match times {
        0 => "bringing the film to 0 V, then exiting",
        1 => "still bringing the film to 0 V; press Ctrl-C again to leave it as it is",
        _ => {
            "leaving a film that may be live: its board disables the amplifier after heartbeat_s without a message. \
                 Measure before you touch it"
        }
    });
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

/// The exit status where a signal ended a search.
pub fn came() -> Option<u8> {
    STOP.load(Ordering::Relaxed).then(|| exit_status(SIGNAL.load(Ordering::Relaxed)))
}

/// A file, or an empty folder, that is removed if the program is ended while this exists.
#[derive(Debug)]
pub struct HalfWritten(PathBuf);

impl HalfWritten {
    /// Registers the file or the folder at `path`.
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
