//! The state of a session: what pages see of it, what they want of it, and what its threads share.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime};

use dea_driver::wire::{Identity, Mode};
use serde::{Deserialize, Serialize};
use tokio::sync::{oneshot, watch};

use super::control::{Control, Moment, Permit, Token};
use crate::commission::Row;
use crate::error::Result;
use crate::link::{Client, Stopper};
use crate::progress::Stage;

/// Values of a reference per second that are sent, as many as turns of the loop: five for every heartbeat that the shortest sensible limit
/// asks for.
pub const SENT_HZ: f64 = 100.0;
/// Age of a sitting's state from which it is sent again, ms.
const RENEWED_MS: u64 = 250;
/// From one published state to the next: 20 a second.
pub(super) const PUBLISH: Duration = Duration::from_millis(50);

/// The state that a page or a terminal shows, 20 times a second. The recording has every sample.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Live {
    /// Time since the tool's start, ms: the page in control says which one it has drawn.
    pub at_ms: u64,
    /// Port, firmware and parameters.
    pub port: String,
    /// Version of the firmware; empty without a connection.
    pub firmware: String,
    /// Name of the parameters; empty without.
    pub parameters: String,
    /// State, in a word: disconnected, disarmed, armed, running, tripped, commissioning.
    pub state: String,
    /// Cause of a trip.
    pub cause: String,
    /// Whether the film may be live: enabled, or its monitor shows voltage.
    pub live: bool,
    /// Commanded voltage, V.
    pub command_v: Option<f64>,
    /// The monitor, V.
    pub monitor_v: Option<f64>,
    /// The sensor, m.
    pub displacement_m: Option<f64>,
    /// The reference, m; none where none is followed.
    pub reference_m: Option<f64>,
    /// Limits that the command has met.
    pub limited: Vec<String>,
    /// Recording of this arming, or the last one.
    pub recording: String,
    /// Its samples, and those that were lost.
    pub samples: [u64; 2],
    /// Name of the reference that is played, or step of commissioning.
    pub playing: String,
    /// How far it is, and how long it takes, s.
    pub played_s: [f64; 2],
    /// Scale and offset (m or V) of what is played.
    pub tuned: [f64; 2],
    /// Last event, for people.
    pub message: String,
    /// Place of the page in control.
    pub in_control: u32,
}

/// A reference, `SENT_HZ` values a second.
#[derive(Clone, Debug, PartialEq)]
pub struct Play {
    /// Its name.
    pub name: String,
    /// Quantity that follows it.
    pub mode: Mode,
    /// V or m.
    pub values: Vec<f32>,
}

/// A sitting of commissioning; returns a sentence for people.
pub type Sitting = Box<dyn FnOnce(&mut Client, &Identity, &Watched<'_>) -> Result<String> + Send>;

/// A sitting as others see it.
pub struct Watched<'a> {
    shared: &'a Shared,
    live: Mutex<Live>,
    published: Mutex<Instant>,
}

impl<'a> Watched<'a> {
    /// A sitting that has just begun, of a board in this state.
    pub(super) fn new(shared: &'a Shared, live: Live) -> Self {
        Self { shared, live: Mutex::new(live), published: Mutex::new(Instant::now()) }
    }

    /// The flag that ends it.
    pub fn stop(&self) -> &AtomicBool {
        &self.shared.stop
    }

    /// Shows the step that it is at, and how far the sitting is.
    pub fn step(&self, stage: &Stage) {
        let mut live = locked(&self.live);
        live.playing.clone_from(&stage.what);
        live.played_s = [stage.work.0 as f64, stage.work.1 as f64];
        self.shared.publish(&mut live);
    }

    /// Shows a row.
    pub fn row(&self, row: &Row) {
        let mut live = locked(&self.live);
        live.command_v = finite(row.command_v);
        live.monitor_v = finite(row.monitor_v);
        live.displacement_m = finite(row.displacement_m);
        live.reference_m = finite(row.reference_m);
        let mut published = locked(&self.published);
        if published.elapsed() >= PUBLISH {
            *published = Instant::now();
            self.shared.publish(&mut live);
        }
    }
}

/// Something that a page wants done.
pub enum Wish {
    /// Enable the amplifier at 0 V, for an arming of this token.
    Arm(Token),
    /// Follow a reference.
    Play(Play),
    /// Scale and offset (m or V) of what is played.
    Tune([f64; 2]),
    /// Acknowledge a trip.
    Acknowledge,
    /// Commission the film.
    Commission(Sitting),
}

/// A wish, what permitted it, and who waits for the outcome.
pub(super) struct Order {
    pub(super) wish: Wish,
    pub(super) permit: Permit,
    pub(super) reply: oneshot::Sender<std::result::Result<(), String>>,
}

/// Where a session's board is, and its recordings go.
#[derive(Clone, Debug)]
pub struct Place {
    /// Port of the board.
    pub port: String,
    /// Folder of the recordings.
    pub folder: PathBuf,
    /// Ticks from one sample to the next.
    pub every: u16,
    /// Parameters that are tried, if the board is to have others than its own.
    pub blob: Option<Vec<u8>>,
}

/// State that the threads of a session and its pages share.
pub(super) struct Shared {
    pub(super) started: (Instant, SystemTime),
    pub(super) control: Mutex<Control>,
    /// The film is to go to 0 V.
    pub(super) stop: AtomicBool,
    pub(super) why: Mutex<String>,
    pub(super) stopper: Mutex<Option<Stopper>>,
    pub(super) live: watch::Sender<Live>,
    /// The session is to end.
    pub(super) over: AtomicBool,
}

impl Shared {
    pub(super) fn now(&self) -> Moment {
        let wall = SystemTime::now().duration_since(self.started.1).unwrap_or_default();
        Moment { awake: self.started.0.elapsed(), wall }
    }

    pub(super) fn stop(&self, why: &str) {
        locked(&self.control).end();
        *locked(&self.why) = why.into();
        self.stop.store(true, Ordering::SeqCst);
        // Past whatever the other thread waits for. Where it fails that one notices as well, and the board its silence.
        if let Some(stopper) = locked(&self.stopper).as_mut() {
            let _ = stopper.disarm();
        }
    }

    pub(super) fn publish(&self, live: &mut Live) {
        live.at_ms = self.at_ms();
        live.in_control = locked(&self.control).place();
        self.live.send_replace(live.clone());
    }

    /// Sends the state of a sitting that computes again: it has no rows then, and a page in sight has something to draw.
    pub(super) fn renew(&self) {
        let now_ms = self.at_ms();
        self.live.send_if_modified(|live| {
            let is_old = live.state == "commissioning" && live.at_ms + RENEWED_MS < now_ms;
            if is_old {
                live.at_ms = now_ms;
            }
            is_old
        });
    }

    fn at_ms(&self) -> u64 {
        u64::try_from(self.started.0.elapsed().as_millis()).unwrap_or(u64::MAX)
    }
}

/// The value as a page shows it; none where it is not finite.
pub(super) fn finite(value: f64) -> Option<f64> {
    Some(value).filter(|value| value.is_finite())
}

/// Locks `mutex`. A panic elsewhere leaves what it holds valid.
pub(super) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
