//! The thread that alone talks to the board: it keeps its heartbeat and its recording, and obeys what [`Control`](super::control::Control) permits.

use std::sync::atomic::Ordering;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use dea_driver::wire::{Answer, Command, Identity, Mode, Reject, Telemetry};
use dea_driver::{Cause, DriverState};
use springpot::Limited;
use tokio::sync::oneshot;

use super::control::{Denied, Permit, Token};
use super::reference::{refused, set};
use super::shared::{Live, Order, PUBLISH, Place, Play, SENT_HZ, Shared, Sitting, Watched, Wish, finite, locked};
use crate::error::{Error, Result, shown};
use crate::files::parameters::as_written;
use crate::link::{Client, Log, Port, named};

const TURN: Duration = Duration::from_millis(10);
/// Turns from one heartbeat to the next, and from one look at the board's state to the next.
const HEARTBEAT_EVERY: u64 = 2;
const STATUS_EVERY: u64 = 10;
/// So many values in a row may get lost on the line.
const MAX_LOST: u32 = 2;
/// It waits for so long for a film that was live before it is armed again; one that takes longer to discharge is not armed.
const MAX_WAIT: Duration = Duration::from_secs(2);
/// A board that has sent no sample for so long does not tick.
const SILENT: Duration = Duration::from_secs(2);
/// Change of a tuned scale per value: all of it in two seconds.
const TUNED: f64 = 1.0 / (2.0 * SENT_HZ);

/// A reference on its way.
struct Run {
    play: Play,
    /// Tick of the first sample of the run.
    first: Option<u32>,
    at_s: f64,
    /// Scale and offset: in use, wanted, and the last that the board took.
    tuned: [[f64; 2]; 3],
}

/// A board that answers: what its thread knows of it.
pub(super) struct Board<'a> {
    shared: &'a Shared,
    place: &'a Place,
    client: Client,
    identity: Identity,
    pub(super) live: Live,
    pub(super) log: Option<Log>,
    run: Option<Run>,
    rate_hz: f64,
    /// When the last sample came, and the last state was published.
    sampled: Instant,
    published: Instant,
    turns: u64,
    lost: u32,
}

impl<'a> Board<'a> {
    pub(super) fn new(shared: &'a Shared, place: &'a Place, live: Live) -> Result<Self> {
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

    pub(super) fn talk(&mut self, orders: &Receiver<Order>) -> Result<()> {
        let mut due = Instant::now();
        while !self.shared.over.load(Ordering::SeqCst) {
            self.stop_if_asked()?;
            for order in orders.try_iter() {
                self.obey(order)?;
                self.stop_if_asked()?;
            }
            due = (due + TURN).max(Instant::now());
            while let Some(sample) = self.client.sample(due)? {
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
        self.sampled = Instant::now();
        if let Some(log) = &mut self.log {
            log.push(sample)?;
        }
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

    /// Shows the samples that came before the last answer.
    fn show_waiting(&mut self) -> Result<()> {
        self.client.waiting_samples().iter().try_for_each(|sample| self.show(sample))
    }

    /// Looks at the board's state, and at the voltages of the same moment: a stop is not seen beside those of before.
    fn look(&mut self) -> Result<()> {
        let status = self.client.status()?;
        self.show_waiting()?;
        self.live.command_v = value(status.command_v);
        self.live.monitor_v = value(status.monitor_v);
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
        // A stop meanwhile makes the permit invalid.
        let until = Instant::now() + MAX_WAIT;
        while Instant::now() < until && self.client.waits_at_0_v()? {
            std::thread::sleep(TURN);
        }
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
        if self.run.is_some() {
            return Err(Error::Computation("a reference is played already".into()));
        }
        if let Some((_, error)) = refused(&mut self.client, play.mode, &play.values)? {
            return Err(error);
        }
        self.client.order(Command::Start(play.mode))?;
        self.show_waiting()?;
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
        let watched = Watched::new(self.shared, live);
        let ended = sitting(&mut self.client, &self.identity, &watched);
        locked(&self.shared.control).end();
        // The samples of the session were off.
        self.sampled = Instant::now();
        self.bring_to_0_v()?;
        self.client.order(Command::Stream { every: self.place.every })?;
        self.live.playing.clear();
        self.name_parameters()?;
        self.live.message = ended.unwrap_or_else(|error| error.to_string());
        Ok(())
    }
}

/// A number of the link as it is shown.
fn value(number: f32) -> Option<f64> {
    finite(as_written(number))
}
