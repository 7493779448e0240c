//! What keeps talking to a controller: streams and playback.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use dea_driver::State;
use dea_driver::link::{Command, Sample};
use serde::Serialize;

use super::What;
use crate::error::{Error, Result, shown};
use crate::interrupt;
use crate::link::{Client, named};
use crate::output::{self, Folders};
use crate::recording::{Input, Recording};
use crate::series::Grid;
use crate::terminal;

/// Values per second that are sent while playing: five for every heartbeat that the shortest sensible limit asks for.
const SENT_HZ: f64 = 100.0;

#[derive(Debug, Args)]
pub(super) struct Stream {
    /// Where the samples go: a recording, with time_s, voltage_v (the monitor) and displacement_m.
    #[arg(long, value_name = "CSV")]
    out: PathBuf,
    /// Ticks per sample.
    #[arg(long, value_name = "TICKS", default_value_t = 10)]
    every: u16,
    /// End after so many seconds instead of at Ctrl-C.
    #[arg(long, value_name = "SECONDS")]
    duration: Option<f64>,
}

#[derive(Debug, Args)]
pub(super) struct Play {
    /// Recording whose voltage, or displacement, is played.
    #[arg(value_name = "REC.csv")]
    recording: PathBuf,
    /// What the controller follows.
    #[arg(long, value_enum, default_value_t = What::Voltage)]
    mode: What,
    #[command(flatten)]
    stream: Stream,
}

#[derive(Serialize)]
struct Report {
    out: String,
    samples: usize,
    /// Lost because the link was busy.
    dropped: u64,
    state: String,
}

impl Stream {
    pub(super) fn check(&self) -> Result<()> {
        if self.every == 0 {
            return Err(Error::option("--every", "must be at least 1 tick"));
        }
        if self.duration.is_some_and(|seconds| !(seconds.is_finite() && seconds > 0.0)) {
            return Err(Error::option("--duration", "must be finite and greater than 0 s"));
        }
        output::check(&self.out, &[], Folders::Exist)
    }

    pub(super) fn run(&self, mut client: Client, json: bool) -> Result<()> {
        let mut log = Log::default();
        let ended = self.talk(&mut client, &mut log, |_, _| Ok(Some(Command::Heartbeat)));
        self.finish(client, log, ended, json)
    }

    /// Streams, saying what `say` gives for the time (s) a hundred times a second, until it gives nothing, time is up or Ctrl-C
    /// comes.
    fn talk(
        &self,
        client: &mut Client,
        log: &mut Log,
        mut say: impl FnMut(f64, &mut Client) -> Result<Option<Command>>,
    ) -> Result<()> {
        let stop = interrupt::stop_flag();
        client.order(Command::Stream { every: self.every })?;
        let bar = terminal::spinner();
        let start = Instant::now();
        let mut next = Duration::ZERO;
        while !stop.load(std::sync::atomic::Ordering::Relaxed) {
            let now = start.elapsed();
            if self.duration.is_some_and(|seconds| now.as_secs_f64() >= seconds) {
                break;
            }
            if now >= next {
                next = now + Duration::from_secs_f64(1.0 / SENT_HZ);
                match say(now.as_secs_f64(), client)? {
                    Some(command) => client.order(command)?,
                    None => break,
                }
            }
            if let Some(sample) = client.sample()? {
                log.samples.push(sample);
                let Sample { command_v, monitor_v, displacement_m, predicted_m, .. } = sample;
                bar.set_message(format!(
                    "{command_v:.0} V, monitor {monitor_v:.0} V; {:.4} mm, model {:.4} mm",
                    1e3 * displacement_m,
                    1e3 * predicted_m
                ));
            }
        }
        bar.finish_and_clear();
        Ok(())
    }

    /// Ends the stream and writes what came, whatever ended it.
    fn finish(&self, mut client: Client, log: Log, ended: Result<()>, json: bool) -> Result<()> {
        let state = client.order(Command::Stream { every: 0 }).and_then(|()| client.status());
        // Without parameters there are no ticks, so no samples either.
        let rate_hz = state.as_ref().map_or(1.0, |status| f64::from(status.rate_hz.max(1.0)));
        log.write(&self.out, rate_hz)?;
        ended?;
        let report = Report {
            out: shown(&self.out),
            samples: log.samples.len(),
            dropped: log.samples.iter().map(|sample| u64::from(sample.dropped)).sum(),
            state: named(state?.state),
        };
        terminal::report(json, &report, || {
            format!("{}: {} samples, {} dropped; {}", report.out, report.samples, report.dropped, report.state)
        })
    }
}

impl Play {
    pub(super) fn check(&self) -> Result<()> {
        self.values()?;
        self.stream.check()?;
        output::check(&self.stream.out, &[&self.recording], Folders::Exist)
    }

    /// What is played, `SENT_HZ` times a second.
    fn values(&self) -> Result<Vec<f32>> {
        let recording = Recording::read(&self.recording)?;
        let samples = match (self.mode, recording.drive()) {
            (What::Voltage, Ok(Input::Voltage(samples))) => samples,
            (What::Voltage, _) => {
                return Err(Error::file(&self.recording, "a column voltage_v or voltage_kv is needed"));
            }
            (What::Feedforward | What::Tracking, _) => recording.displacement_drive()?.samples().clone(),
        };
        let grid = Grid::covering(recording.duration_s(), SENT_HZ)?;
        Ok(grid.resample(&samples).into_iter().map(|value| value as f32).collect())
    }

    pub(super) fn run(&self, mut client: Client, json: bool) -> Result<()> {
        let values = self.values()?;
        let value = |value: f32| match self.mode {
            What::Voltage => Command::SetVoltage(value),
            What::Feedforward | What::Tracking => Command::SetReference(value),
        };
        client.order(value(values[0]))?;
        client.order(Command::Arm)?;
        let mut log = Log::default();
        let played = client.order(Command::Start(self.mode.into())).and_then(|()| {
            self.stream.talk(&mut client, &mut log, |now_s, client| {
                let state = client.status()?.state;
                if state != State::Running {
                    return Err(
                        client.unexpected(&dea_driver::link::Answer::Refused(dea_driver::Refusal::State(state)))
                    );
                }
                Ok(values.get((now_s * SENT_HZ) as usize).map(|&next| value(next)))
            })
        });
        // 0 V before anything else, whatever has happened. After a trip it is there already.
        let disarmed = client.order(Command::Disarm);
        let ended = played.and(disarmed);
        self.stream.finish(client, log, ended, json)
    }
}

/// What came.
#[derive(Default)]
struct Log {
    samples: Vec<Sample>,
}

impl Log {
    fn write(&self, path: &Path, rate_hz: f64) -> Result<()> {
        let column = |value: fn(&Sample) -> f64| self.samples.iter().map(value).collect::<Vec<f64>>();
        let first = self.samples.first().map_or(0, |sample| sample.tick);
        let time_s = self.samples.iter().map(|sample| f64::from(sample.tick.wrapping_sub(first)) / rate_hz).collect();
        let columns = [
            ("time_s", time_s),
            ("tick", column(|sample| f64::from(sample.tick))),
            ("command_v", column(|sample| f64::from(sample.command_v))),
            ("voltage_v", column(|sample| f64::from(sample.monitor_v))),
            ("displacement_m", column(|sample| f64::from(sample.displacement_m))),
            ("predicted_m", column(|sample| f64::from(sample.predicted_m))),
            ("reference_m", column(|sample| f64::from(sample.reference_m))),
            ("disturbance_n", column(|sample| f64::from(sample.disturbance_n))),
            ("force_scale", column(|sample| f64::from(sample.force_scale))),
            ("innovation_m", column(|sample| f64::from(sample.innovation_m))),
            ("limited", column(|sample| f64::from(sample.limited))),
        ];
        let columns: Vec<(&str, Option<&[f64]>)> =
            columns.iter().map(|(name, values)| (*name, Some(values.as_slice()))).collect();
        output::write_columns(path, &[], &columns)
    }
}
