//! The session with a board: one thread alone talks to it, keeps its heartbeat and its recording, and obeys what [`Control`] permits; another
//! watches over the page in control.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant, SystemTime};

use dea_driver::wire::{Answer, Command, Identity, Mode, Reject, Telemetry};
use dea_driver::{Cause, DriverState};
use serde::{Deserialize, Serialize};
use springpot::Limited;
use tokio::sync::{oneshot, watch};

use super::control::{Control, Denied, Moment, Permit, Token};
use crate::commission::Row;
use crate::error::{Error, Result, shown};
use crate::files::parameters::as_written;
use crate::link::{Client, Log, Port, Stopper, named};

/// Values of a reference per second that are sent, as many as turns of the loop: five for every heartbeat that the shortest sensible limit
/// asks for.
pub const SENT_HZ: f64 = 100.0;
const TURN: Duration = Duration::from_millis(10);
/// Turns from one heartbeat to the next, and from one look at the board's state to the next.
const HEARTBEAT_EVERY: u64 = 2;
const STATUS_EVERY: u64 = 10;
/// From one published state to the next: 20 a second.
const PUBLISH: Duration = Duration::from_millis(50);
/// So many values in a row may get lost on the line.
const MAX_LOST: u32 = 2;
/// A board that has sent no sample for so long does not tick.
const SILENT: Duration = Duration::from_secs(2);
/// How often the clocks are looked at, and how soon a lost board is looked for again.
const LOOK: Duration = Duration::from_millis(50);
const AGAIN: Duration = Duration::from_secs(1);
/// Change of a tuned scale per value: all of it in two seconds.
const TUNED: f64 = 1.0 / (2.0 * SENT_HZ);

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

impl Watched<'_> {
    /// The flag that ends it.
    #[must_use]
    pub fn stop(&self) -> &AtomicBool {
        &self.shared.stop
    }

    /// Shows the step that it is at.
    pub fn step(&self, name: &str) {
        let mut live = locked(&self.live);
        live.playing = name.into();
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

struct Order {
    wish: Wish,
    permit: Permit,
    reply: oneshot::Sender<std::result::Result<(), String>>,
}

struct Shared {
    started: (Instant, SystemTime),
    control: Mutex<Control>,
    /// The film is to go to 0 V.
    stop: AtomicBool,
    why: Mutex<String>,
    stopper: Mutex<Option<Stopper>>,
    live: watch::Sender<Live>,
    /// The session is to end.
    over: AtomicBool,
}

impl Shared {
    fn now(&self) -> Moment {
        let wall = SystemTime::now().duration_since(self.started.1).unwrap_or_default();
        Moment { awake: self.started.0.elapsed(), wall }
    }

    fn stop(&self, why: &str) {
        locked(&self.control).end();
        *locked(&self.why) = why.into();
        self.stop.store(true, Ordering::SeqCst);
        // Past whatever the other thread waits for. Where it fails that one notices as well, and the board its silence.
        if let Some(stopper) = locked(&self.stopper).as_mut() {
            let _ = stopper.disarm();
        }
    }

    fn publish(&self, live: &mut Live) {
        live.at_ms = u64::try_from(self.started.0.elapsed().as_millis()).unwrap_or(u64::MAX);
        live.in_control = locked(&self.control).place();
        self.live.send_replace(live.clone());
    }
}

/// A session with a board, for any number of pages. It ends, at 0 V, with this value.
pub struct Session {
    shared: Arc<Shared>,
    orders: Mutex<Sender<Order>>,
    threads: Mutex<Vec<JoinHandle<()>>>,
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

impl Session {
    /// Begins a session; a board that does not answer is looked for every second.
    #[must_use]
    pub fn begin(place: Place) -> Self {
        let (orders, waiting) = channel();
        let live = Live { port: place.port.clone(), state: "disconnected".into(), ..Live::default() };
        let shared = Arc::new(Shared {
            started: (Instant::now(), SystemTime::now()),
            control: Mutex::default(),
            stop: AtomicBool::new(false),
            why: Mutex::default(),
            stopper: Mutex::new(None),
            live: watch::Sender::new(live.clone()),
            over: AtomicBool::new(false),
        });
        let (owner, watcher) = (Arc::clone(&shared), Arc::clone(&shared));
        let own = thread::spawn(move || own(&owner, &place, &waiting, live));
        let watch = thread::spawn(move || {
            while !watcher.over.load(Ordering::Relaxed) {
                let ended = locked(&watcher.control).look(watcher.now());
                if let Some(ended) = ended {
                    watcher.stop(&ended.to_string());
                }
                thread::sleep(LOOK);
            }
        });
        Self { shared, orders: Mutex::new(orders), threads: Mutex::new(vec![own, watch]) }
    }

    /// The states as they come.
    #[must_use]
    pub fn live(&self) -> watch::Receiver<Live> {
        self.shared.live.subscribe()
    }

    /// Time since its start, by both clocks.
    #[must_use]
    pub fn now(&self) -> Moment {
        self.shared.now()
    }

    /// The rules.
    pub fn control(&self) -> MutexGuard<'_, Control> {
        locked(&self.shared.control)
    }

    /// Brings the film to 0 V and disarms; anyone may ask for it.
    pub fn stop(&self, why: &str) {
        self.shared.stop(why);
    }

    /// Ends it: 0 V, disarmed, the recording closed.
    pub fn end(&self) {
        self.shared.stop("springpot has ended");
        self.shared.over.store(true, Ordering::SeqCst);
        for thread in locked(&self.threads).drain(..) {
            // A panic there has shown itself.
            let _ = thread.join();
        }
    }

    /// Has a wish done that was permitted; the receiver gets the outcome.
    pub fn ask(&self, wish: Wish, permit: Permit) -> oneshot::Receiver<std::result::Result<(), String>> {
        let (reply, outcome) = oneshot::channel();
        // Without the other thread the reply is dropped, which its receiver sees.
        let _ = locked(&self.orders).send(Order { wish, permit, reply });
        outcome
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        self.end();
    }
}

/// Talks to the board, and looks for it again whenever it is lost.
fn own(shared: &Shared, place: &Place, orders: &Receiver<Order>, mut live: Live) {
    while !shared.over.load(Ordering::SeqCst) {
        let ended = match Board::new(shared, place, live.clone()) {
            Ok(mut board) => {
                let ended = board.talk(orders);
                let kept = board.log.take().map_or(Ok(()), |log| log.end(true));
                live = board.live;
                ended.and(kept)
            }
            Err(error) => Err(error),
        };
        *locked(&shared.stopper) = None;
        locked(&shared.control).end();
        let Err(error) = ended else { return };
        live = Live { port: live.port, state: "disconnected".into(), message: error.to_string(), ..Live::default() };
        let lost = Instant::now();
        while lost.elapsed() < AGAIN && !shared.over.load(Ordering::SeqCst) {
            shared.publish(&mut live);
            orders
                .try_iter()
                .for_each(|order| drop(order.reply.send(Err("there is no connection to the board".into()))));
            thread::sleep(PUBLISH);
        }
    }
}

/// A reference on its way.
struct Run {
    play: Play,
    /// Tick of the first sample of the run.
    first: Option<u32>,
    at_s: f64,
    /// Scale and offset: in use, wanted, and the last that the board took.
    tuned: [[f64; 2]; 3],
}

struct Board<'a> {
    shared: &'a Shared,
    place: &'a Place,
    client: Client,
    identity: Identity,
    live: Live,
    log: Option<Log>,
    run: Option<Run>,
    rate_hz: f64,
    /// When the last sample came, and the last state was published.
    sampled: Instant,
    published: Instant,
    turns: u64,
    lost: u32,
}

impl<'a> Board<'a> {
    fn new(shared: &'a Shared, place: &'a Place, live: Live) -> Result<Self> {
        let (mut client, identity) = Client::new(Port::open(&place.port)?)?;
        *locked(&shared.stopper) = Some(client.stopper()?);
        if let Some(blob) = &place.blob
            && !client.status()?.state.is_live()
        {
            client.upload(blob, false)?;
        }
        client.order(Command::Stream { every: place.every })?;
        let now = Instant::now();
        let message = format!("connected to {}", place.port);
        let live = Live { firmware: identity.firmware.to_string(), message, tuned: [1.0, 0.0], ..live };
        let mut board = Self {
            shared,
            place,
            client,
            identity,
            live,
            log: None,
            run: None,
            rate_hz: 1000.0,
            sampled: now,
            published: now,
            turns: 0,
            lost: 0,
        };
        board.name_parameters()?;
        Ok(board)
    }

    fn name_parameters(&mut self) -> Result<()> {
        self.live.parameters = match self.client.ask(Command::Query)? {
            Answer::Parameters { name, .. } => name.to_string(),
            _ => String::new(),
        };
        Ok(())
    }

    fn talk(&mut self, orders: &Receiver<Order>) -> Result<()> {
        let mut due = Instant::now();
        while !self.shared.over.load(Ordering::SeqCst) {
            self.stop_if_asked()?;
            for order in orders.try_iter() {
                self.obey(order)?;
                self.stop_if_asked()?;
            }
            due = (due + TURN).max(Instant::now());
            while let Some(sample) = self.client.sample(due)? {
                self.sampled = Instant::now();
                self.show(&sample)?;
                if self.shared.stop.load(Ordering::SeqCst) {
                    break;
                }
            }
            self.stop_if_asked()?;
            self.drive()?;
            if self.turns.is_multiple_of(STATUS_EVERY) {
                self.look()?;
            }
            self.turns += 1;
            if let Some(log) = &mut self.log {
                log.flush_if_due()?;
                self.live.samples = [log.samples as u64, log.dropped];
            }
            if self.published.elapsed() >= PUBLISH {
                self.published = Instant::now();
                self.shared.publish(&mut self.live);
                self.live.limited.clear();
            }
        }
        self.bring_to_0_v()?;
        self.client.order(Command::Stream { every: 0 })
    }

    fn stop_if_asked(&mut self) -> Result<()> {
        if self.shared.stop.swap(false, Ordering::SeqCst) {
            self.bring_to_0_v()?;
            // A trip says more.
            if self.live.cause.is_empty() {
                self.live.message = format!("0 V and disarmed: {}", locked(&self.shared.why));
            }
        }
        Ok(())
    }

    /// Disarms, also after a request past this thread, and looks whether it is so.
    fn bring_to_0_v(&mut self) -> Result<()> {
        self.run = None;
        // A trip refuses it, and is at 0 V.
        self.client.ask(Command::Disarm)?;
        self.look()
    }

    fn show(&mut self, sample: &Telemetry) -> Result<()> {
        if let Some(log) = &mut self.log {
            log.push(sample)?;
        }
        let value = |number: f32| finite(as_written(number));
        self.live.command_v = value(sample.command_v);
        self.live.monitor_v = value(sample.monitor_v);
        self.live.displacement_m = value(sample.displacement_m);
        let follows = self.run.as_ref().is_some_and(|run| run.play.mode != Mode::Voltage);
        self.live.reference_m = value(sample.reference_m).filter(|_| follows);
        for (limit, name) in Limited::ALL {
            if sample.limited & limit.bits() != 0 && !self.live.limited.iter().any(|known| known == name) {
                self.live.limited.push(name.into());
            }
        }
        if let Some(run) = &mut self.run {
            let first = *run.first.get_or_insert(sample.tick);
            run.at_s = f64::from(sample.tick.wrapping_sub(first)) / self.rate_hz;
            self.live.played_s[0] = run.at_s;
        }
        Ok(())
    }

    /// Looks at the board's state.
    fn look(&mut self) -> Result<()> {
        let status = self.client.status()?;
        if status.rate_hz > 0.0 {
            self.rate_hz = f64::from(status.rate_hz);
            if self.sampled.elapsed() > SILENT {
                return Err(self.client.silent_stream());
            }
        }
        let was = std::mem::take(&mut self.live.state);
        self.live.state = named(status.state).split(':').next().unwrap_or_default().into();
        self.live.live = status.live || status.state.is_live();
        self.live.cause.clear();
        if let DriverState::Tripped(cause) = status.state {
            self.live.cause = format!("{cause:?}");
            if was != self.live.state {
                self.live.message = if cause == Cause::LiveFilm {
                    "tripped: the film is live although the amplifier is disabled; switch the supply off, wait, measure"
                        .into()
                } else {
                    format!("tripped: {cause:?}; find out why, then acknowledge")
                };
            }
        }
        if !status.state.is_live() && (self.log.is_some() || locked(&self.shared.control).is_armed()) {
            self.end_arming()?;
        }
        Ok(())
    }

    /// Ends everything that belongs to an arming.
    fn end_arming(&mut self) -> Result<()> {
        locked(&self.shared.control).end();
        self.run = None;
        self.live.playing.clear();
        self.live.reference_m = None;
        let Some(log) = self.log.take() else { return Ok(()) };
        self.live.samples = [log.samples as u64, log.dropped];
        log.end(true)
    }

    /// The next value of the reference, or a heartbeat.
    fn drive(&mut self) -> Result<()> {
        if self.log.is_none() {
            return Ok(());
        }
        let Some(run) = &mut self.run else {
            return if self.turns.is_multiple_of(HEARTBEAT_EVERY) {
                self.send(Command::Heartbeat).map(drop)
            } else {
                Ok(())
            };
        };
        let Some(&value) = run.play.values.get((run.at_s * SENT_HZ) as usize) else {
            self.live.message = format!("{}: played to its end; 0 V, still armed", run.play.name);
            self.run = None;
            self.live.playing.clear();
            return self.send(Command::Stop).map(drop);
        };
        let [used, wanted, _] = &mut run.tuned;
        let step = run.play.values.iter().fold(0.0_f32, |most, value| most.max(value.abs()));
        for (k, most) in [TUNED, TUNED * f64::from(step)].into_iter().enumerate() {
            used[k] += (wanted[k] - used[k]).clamp(-most, most);
        }
        let [scale, offset] = *used;
        let set = set(run.play.mode, (scale * f64::from(value) + offset) as f32);
        match self.send(set)? {
            Some(Answer::Rejected(Reject::Value)) => {
                let Some(run) = &mut self.run else { return Ok(()) };
                run.tuned = [run.tuned[2]; 3];
                self.live.tuned = run.tuned[2];
                self.live.message = "beyond the limits of the parameters: the last scale and offset are back".into();
            }
            Some(Answer::Done) => {
                if let Some(run) = &mut self.run
                    && run.tuned[0] == run.tuned[1]
                {
                    run.tuned[2] = run.tuned[0];
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Sends a command whose loss the next one makes up for; many in a row are a broken line.
    fn send(&mut self, command: Command) -> Result<Option<Answer>> {
        match self.client.ask(command) {
            Ok(answer) => {
                self.lost = 0;
                Ok(Some(answer))
            }
            Err(error) if self.lost >= MAX_LOST => Err(error),
            Err(_) => {
                self.lost += 1;
                Ok(None)
            }
        }
    }

    fn obey(&mut self, order: Order) -> Result<()> {
        let Order { wish, permit, reply } = order;
        let valid = locked(&self.shared.control).is_valid(permit);
        let done = match wish {
            _ if !valid => Err(Error::Computation(Denied::Arming.to_string())),
            Wish::Arm(token) => self.arm(permit, token),
            Wish::Play(play) => self.play(play),
            Wish::Tune(tuned) => self.tune(tuned),
            Wish::Acknowledge => self.client.order(Command::Acknowledge).and_then(|()| self.look()),
            Wish::Commission(sitting) => return self.commission(permit, sitting, reply),
        };
        let done = done.map_err(|error| error.to_string());
        if let Err(error) = &done {
            self.live.message.clone_from(error);
        }
        // A page that is gone needs no reply.
        let _ = reply.send(done);
        Ok(())
    }

    fn arm(&mut self, permit: Permit, token: Token) -> Result<()> {
        let path = (1..).map(|k| self.place.folder.join(format!("run-{k:03}.csv"))).find(|path| !path.exists());
        let path = path.unwrap_or_default();
        let log = Log::begin(&mut self.client, &path, self.place.every)?;
        locked(&self.shared.control).arm(permit, token).map_err(|denied| Error::Computation(denied.to_string()))?;
        self.log = Some(log);
        if let Err(error) = self.client.arm() {
            // The answer may be lost; where the board has refused it was not enabled by this.
            self.bring_to_0_v()?;
            locked(&self.shared.control).end();
            self.log.take().map_or(Ok(()), |log| log.end(false))?;
            return Err(error);
        }
        self.live.recording = shown(&path);
        self.live.message = "armed at 0 V".into();
        self.look()
    }

    fn play(&mut self, play: Play) -> Result<()> {
        let largest = play.values.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs()));
        if self.run.is_some() {
            return Err(Error::Computation("a reference is played already".into()));
        }
        // What is beyond the limits shows before the run begins: a set-point within them is refused for the state alone.
        if let Some(value) = largest {
            let answer = self.client.ask(set(play.mode, value))?;
            if answer == Answer::Rejected(Reject::Value) {
                return Err(self.client.unexpected(&answer));
            }
        }
        self.client.order(Command::Start(play.mode))?;
        self.client.waiting_samples().iter().try_for_each(|sample| self.show(sample))?;
        self.live.playing.clone_from(&play.name);
        self.live.played_s = [0.0, play.values.len() as f64 / SENT_HZ];
        self.live.tuned = [1.0, 0.0];
        self.live.message = format!("plays {}", play.name);
        self.run = Some(Run { play, first: None, at_s: 0.0, tuned: [[1.0, 0.0]; 3] });
        self.look()
    }

    fn tune(&mut self, tuned: [f64; 2]) -> Result<()> {
        let Some(run) = &mut self.run else { return Err(Error::Computation("nothing is played".into())) };
        run.tuned[1] = tuned;
        self.live.tuned = tuned;
        Ok(())
    }

    /// Hands the board to a sitting until it ends.
    fn commission(
        &mut self,
        permit: Permit,
        sitting: Sitting,
        reply: oneshot::Sender<std::result::Result<(), String>>,
    ) -> Result<()> {
        let begun = locked(&self.shared.control).arm(permit, Token::random());
        let _ = reply.send(begun.map_err(|denied| denied.to_string()));
        if begun.is_err() {
            return Ok(());
        }
        self.client.order(Command::Stream { every: 0 })?;
        let live = Live { state: "commissioning".into(), live: true, playing: "begins".into(), ..self.live.clone() };
        let watched = Watched { shared: self.shared, live: Mutex::new(live), published: Mutex::new(Instant::now()) };
        let ended = sitting(&mut self.client, &self.identity, &watched);
        locked(&self.shared.control).end();
        self.bring_to_0_v()?;
        self.client.order(Command::Stream { every: self.place.every })?;
        self.sampled = Instant::now();
        self.live.playing.clear();
        self.name_parameters()?;
        self.live.message = ended.unwrap_or_else(|error| error.to_string());
        Ok(())
    }
}

fn set(mode: Mode, value: f32) -> Command {
    if mode == Mode::Voltage { Command::SetVoltage(value) } else { Command::SetReference(value) }
}

fn finite(value: f64) -> Option<f64> {
    Some(value).filter(|value| value.is_finite())
}

/// Locks `mutex`. A panic elsewhere leaves what it holds valid.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
