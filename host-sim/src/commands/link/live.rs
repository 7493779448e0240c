//! Verbs that keep talking to a controller: streams and playback.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use dea_driver::wire::{Answer, Command, LearningOrder, Telemetry};
use dea_driver::{Cause, DriverState, Refusal};

use super::adaptation::Film;
use super::asking::{DISCHARGE, until_discharged};
use super::board_time::BoardTime;
use super::status::falls_text;
use super::{Source, digits, parameters_of};
use crate::bench::reference::{self, What};
use crate::bench::shared::SENT_HZ;
use crate::commands::prelude::*;
use crate::commands::recordings::{self, RecordingOptions};
use crate::files::parameters::as_written;
use crate::files::recording::{Input, Recording};
use crate::interrupt;
use crate::link::{Client, Log, named};

/// Every so many of them the state is asked for.
const STATUS_EVERY: u32 = 10;
/// A monitor that has not answered for so long will not.
const SILENT_MONITOR: Duration = Duration::from_secs(2);
/// So many looks in a row find the film at 0 V.
const LOOKS: u32 = 3;
/// A board that has sent no sample for so long does not tick.
const SILENT_STREAM_S: f64 = 2.0;
/// Largest number of values in a row that are sent to a board whose time does not change, beyond those that fit between two samples.
const MAX_STALLED_ROUNDS: f64 = 200.0;
/// So many frames in a row may be lost.
const MAX_DAMAGED: u32 = 2;

#[derive(Debug, Args)]
pub(super) struct Stream {
    /// Recording to write: time_s, voltage_v (the monitor) and displacement_m.
    #[arg(long, value_name = "CSV")]
    out: PathBuf,
    /// Ticks per sample.
    #[arg(long, value_name = "TICKS", default_value_t = 10)]
    every: u16,
    /// End after so many seconds of the board's time instead of at Ctrl-C.
    #[arg(long, value_name = "SECONDS", value_parser = quantity::seconds)]
    duration: Option<f64>,
}

#[derive(Debug, Args)]
pub(super) struct Play {
    /// Recording whose voltage (its magnitude), or whose displacement, is played.
    #[arg(value_name = "REC.csv")]
    recording: PathBuf,
    /// Quantity that the controller follows.
    #[arg(long, value_enum, default_value_t = What::Voltage)]
    mode: What,
    /// Begin with what the run before has learned of the same periodic reference.
    #[arg(long)]
    carry_over: bool,
    /// With --params or --blob: plays only if the board runs these parameters.
    #[command(flatten)]
    parameters: Source,
    #[command(flatten)]
    stream: Stream,
    #[command(flatten)]
    reading: RecordingOptions,
}

#[derive(Serialize)]
struct Report {
    out: String,
    samples: usize,
    /// Lost because the link was busy, or damaged.
    dropped: u64,
    state: String,
    /// Which parameters the board ran.
    parameters: Option<String>,
    checksum: Option<String>,
    /// How often the monitor's reading fell since the board was armed last.
    falls: u16,
    /// How far the film has moved from them, where the law follows it.
    adaptation: Option<Film>,
}

impl Stream {
    pub(super) fn check(&self) -> Result<()> {
        if self.every == 0 {
            return Err(Error::field("every", "must be at least 1 tick"));
        }
        if self.duration.is_some_and(|seconds| seconds <= 0.0) {
            return Err(Error::field("duration", "must be greater than 0 s"));
        }
        output::check(&self.out, &[], Folders::Exist)
    }

    pub(super) fn run(&self, mut client: Client, json: bool) -> Result<()> {
        let stop = interrupt::stop_flag();
        let mut log = Log::begin(&mut client, &self.out, self.every)?;
        // It only listens: the host that armed keeps the amplifier enabled.
        let ended = self.begin(&mut client).and_then(|()| self.talk(&mut client, &mut log, stop, |_, _| Ok(true)));
        self.finish(client, log, true, ended, json)
    }

    /// Lets the board stream.
    fn begin(&self, client: &mut Client) -> Result<()> {
        client.order(Command::Stream { every: self.every })
    }

    /// Listens, letting `say` talk for the board's time (s) a hundred times a second, until it is done, time is up or Ctrl-C comes.
    fn talk(
        &self,
        client: &mut Client,
        log: &mut Log,
        stop: &AtomicBool,
        mut say: impl FnMut(f64, &mut Client) -> Result<bool>,
    ) -> Result<()> {
        let bar = Progress::unknown("no samples yet");
        let start = Instant::now();
        let mut time = BoardTime::new(log.rate_hz, self.every);
        let mut next = Duration::ZERO;
        while !stop.load(Ordering::Relaxed) {
            log.flush_if_due()?;
            // What has come, until the next value is due.
            let mut newest = None;
            while let Some(sample) = client.sample(start + next)? {
                log.push(&sample)?;
                newest = Some(sample.tick);
                let Telemetry { command_v, monitor_v, displacement_m, predicted_m, .. } = sample;
                bar.set_message(format!(
                    "{command_v:.0} V, monitor {monitor_v:.0} V; {:.4} mm, model {:.4} mm",
                    1e3 * displacement_m,
                    1e3 * predicted_m
                ));
            }
            let host_s = start.elapsed().as_secs_f64();
            time.update(newest, host_s);
            let now_s = time.now_s(host_s);
            // A board that does not tick has no time of its own.
            let is_silent = time.silent_s() > SILENT_STREAM_S;
            let is_over = |seconds| now_s >= seconds || (is_silent && host_s >= seconds);
            if self.duration.is_some_and(is_over) {
                break;
            }
            next = start.elapsed() + Duration::from_secs_f64(1.0 / SENT_HZ);
            if !say(now_s, client)? {
                break;
            }
        }
        bar.finish_and_clear();
        Ok(())
    }

    /// Ends the stream and keeps what came, whatever ended it; the reason of the end is reported first. A run that has not `begun` leaves
    /// the file as it is.
    fn finish(&self, mut client: Client, mut log: Log, begun: bool, ended: Result<()>, json: bool) -> Result<()> {
        let state = client.order(Command::Stream { every: 0 }).and_then(|()| client.status());
        let parameters = parameters_of(&mut client);
        let film = Film::from_board(&mut client);
        // What came while something else was waited for.
        let rest = client.waiting_samples().iter().try_for_each(|sample| log.push(sample));
        let (samples, dropped) = (log.samples, log.dropped);
        let written = rest.and(log.end(begun));
        ended?;
        written?;
        let (parameters, checksum) = parameters?.unzip();
        let state = state?;
        let report = Report {
            parameters,
            checksum: digits(checksum.flatten()),
            out: shown(&self.out),
            samples,
            dropped,
            state: named(state.state),
            falls: state.falls,
            adaptation: film.ok().filter(Film::is_followed),
        };
        terminal::report(json, &report, || {
            let parameters = report.parameters.as_deref().unwrap_or("none");
            let checksum = report.checksum.as_deref().unwrap_or("unknown");
            let change =
                report.adaptation.as_ref().and_then(Film::change).map_or(String::new(), |change| format!("\n{change}"));
            let falls = falls_text(report.falls).map_or(String::new(), |falls| format!("\n{falls}"));
            format!(
                "{}: {} samples, {} dropped; {}; parameters {parameters}, checksum {checksum}{change}{falls}",
                report.out, report.samples, report.dropped, report.state
            )
        })
    }
}

/// Whether a voltage goes below 0 by more than a monitor's noise, a hundredth of its peak.
fn has_both_signs(recording: &Recording) -> bool {
    let Ok(Input::Voltage(voltage)) = recording.drive() else { return false };
    let (low, high) = voltage.value.iter().fold((0.0_f64, 0.0_f64), |(l, h), v| (l.min(*v), h.max(*v)));
    -low > 0.01 * high && high > -0.01 * low
}

impl Play {
    /// Checks what is wrong without a board, and returns the parameters that it should run.
    pub(super) fn check(&self) -> Result<Option<Vec<u8>>> {
        let recording = self.read()?;
        recordings::report(&recording);
        reference::values(self.mode.into(), &recording)?;
        if self.mode == What::Voltage && has_both_signs(&recording) {
            terminal::information(format!(
                "{}: the voltage has both signs; its magnitude is played",
                shown(&self.recording)
            ));
        }
        self.stream.check()?;
        output::check(&self.stream.out, &[&self.recording], Folders::Exist)?;
        self.parameters.blob()
    }

    fn read(&self) -> Result<Recording> {
        reference::read(self.mode.into(), &self.recording, &self.reading.hints())
    }

    pub(super) fn run(&self, mut client: Client, expected: Option<&[u8]>, json: bool) -> Result<()> {
        if let Some(expected) = expected.and_then(<[u8]>::last_chunk) {
            client.expect_parameters(u32::from_le_bytes(*expected))?;
        }
        // Before anything is enabled: from here on Ctrl-C comes to an end at 0 V.
        let stop = interrupt::live_film();
        let values = reference::values(self.mode.into(), &self.read()?)?;
        let mut log = Log::begin(&mut client, &self.stream.out, self.stream.every)?;
        let armed = self.arm(&mut client, &values, stop);
        if armed.is_err() {
            // What another host has armed is its own.
            return self.stream.finish(client, log, false, armed, json);
        }
        let started = self.start(&mut client);
        let begun = started.is_ok();
        let played = started.and_then(|()| self.play(&mut client, &mut log, &values, stop));
        // 0 V before anything else, whatever has happened. After a trip it is there already.
        let disarmed = disarm(&mut client);
        let live = client.status().is_ok_and(|status| status.state == DriverState::Tripped(Cause::LiveFilm));
        // A live film is reported before its cause.
        let ended = if live { disarmed.and(played) } else { played.and(disarmed) };
        self.stream.finish(client, log, begun, ended, json)
    }

    /// Arms, with values that the board accepts.
    fn arm(&self, client: &mut Client, values: &[f32], stop: &AtomicBool) -> Result<()> {
        if let Some((value, error)) = reference::refused(client, self.mode.into(), values)? {
            return Err(error.about_value(&self.recording, as_written(value)));
        }
        until_discharged(client, stop)?;
        self.stream.begin(client)?;
        client.arm().map(drop)
    }

    /// Begins the run.
    fn start(&self, client: &mut Client) -> Result<()> {
        if self.carry_over {
            client.order(Command::Learning(LearningOrder::CarryOver))?;
        }
        client.order(Command::Start(self.mode.into()))
    }

    fn play(&self, client: &mut Client, log: &mut Log, values: &[f32], stop: &AtomicBool) -> Result<()> {
        let mut damaged = 0;
        let mut rounds = 0;
        let max_stalled = MAX_STALLED_ROUNDS + SENT_HZ * f64::from(self.stream.every) / log.rate_hz;
        let (mut before_s, mut stalled) = (f64::NAN, 0.0);
        self.stream.talk(client, log, stop, |now_s, client| {
            stalled = if now_s == before_s { stalled + 1.0 } else { 0.0 };
            before_s = now_s;
            if stalled > max_stalled {
                return Err(client.silent_stream());
            }
            let Some(&value) = values.get((now_s * SENT_HZ) as usize) else { return Ok(false) };
            // A frame that is lost on the way is made up for by the next; many in a row are a broken line.
            match client.order(reference::set(self.mode.into(), value)) {
                Ok(()) => damaged = 0,
                Err(error) if damaged >= MAX_DAMAGED => return Err(error),
                Err(_) => damaged += 1,
            }
            rounds += 1;
            if rounds % STATUS_EVERY == 0
                && let Ok(status) = client.status()
                && status.state != DriverState::Running
            {
                return Err(client.unexpected(&Answer::Refused(Refusal::State(status.state))));
            }
            Ok(true)
        })?;
        // It may have tripped since it was asked last.
        match client.status()?.state {
            DriverState::Running => Ok(()),
            state => Err(client.unexpected(&Answer::Refused(Refusal::State(state)))),
        }
    }
}

/// Disarms, and waits until the monitor shows that the film is at 0 V. It fails where the film is live although the amplifier is
/// disabled, which the board detects, and where the monitor does not answer.
pub(super) fn disarm(client: &mut Client) -> Result<()> {
    let mut done = client.order(Command::Disarm);
    let start = Instant::now();
    let bar = Progress::unknown("waits until the film is at 0 V");
    let mut at_0_v = 0;
    loop {
        let status = client.status()?;
        // Without parameters nothing ticks, and nothing was ever enabled.
        let unknown = status.monitor_v.is_nan() && status.rate_hz > 0.0;
        if status.state.is_live() {
            done = client.order(Command::Disarm);
        }
        at_0_v = if status.live || unknown || status.state.is_live() { 0 } else { at_0_v + 1 };
        if status.state == DriverState::Tripped(Cause::LiveFilm) || (status.live && start.elapsed() >= DISCHARGE) {
            return Err(client.film_is_live(&status));
        }
        if unknown && start.elapsed() >= SILENT_MONITOR {
            return Err(client.film_is_unknown());
        }
        // A film that arcs is at 0 V now and then.
        if at_0_v == LOOKS {
            bar.finish_and_clear();
            return done;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}
