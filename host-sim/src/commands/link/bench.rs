//! A controller at a port as a bench that is commissioned.

use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use dea_driver::wire::{Command, Identity, Telemetry};
use dea_driver::{Blob, Cause, DriverState};

use super::asking::{some_ticks, until_discharged};
use super::live;
use super::self_test::SelfTest;
use crate::bench::reference::set;
use crate::bench::shared::Watched;
use crate::commission::bench::{Bench, Check, Mode, Pilot, ROWS_HZ, Row};
use crate::error::{Error, Result, short};
use crate::files::parameters::{Parameters, as_written};
use crate::link::{Client, named};

/// Ticks per second.
const RATE_HZ: f64 = 1000.0;
/// A board that has sent no sample for so long does not tick.
const SILENT: Duration = Duration::from_secs(2);

/// A controller at a port.
pub(in crate::commands) struct LinkedBench<'a> {
    client: &'a mut Client,
    identity: &'a Identity,
    stop: &'a AtomicBool,
    begun: Instant,
    /// A page that shows the rows.
    page: Option<&'a Watched<'a>>,
}

impl<'a> LinkedBench<'a> {
    /// The controller of a `client`, whose self-test ends once `stop` is set.
    pub(in crate::commands) fn new(client: &'a mut Client, identity: &'a Identity, stop: &'a AtomicBool) -> Self {
        Self { client, identity, stop, begun: Instant::now(), page: None }
    }

    /// The same, whose rows a page shows.
    pub(in crate::commands) fn shown_by(self, page: &'a Watched<'a>) -> Self {
        Self { page: Some(page), ..self }
    }

    /// Samples to the `pilot`, and its targets to the controller, until one of them ends it.
    fn talk(&mut self, mode: Mode, pilot: &mut Pilot<'_>) -> Result<()> {
        let mut first = None;
        let mut row_of = |sample: &Telemetry, host_s: f64| {
            let (tick, from_s) = *first.get_or_insert((sample.tick, host_s));
            Row {
                time_s: from_s + f64::from(sample.tick.wrapping_sub(tick)) / RATE_HZ,
                host_s,
                command_v: as_written(sample.command_v),
                monitor_v: as_written(sample.monitor_v),
                displacement_m: as_written(sample.displacement_m),
                reference_m: as_written(sample.reference_m),
            }
        };
        loop {
            let Some(sample) = self.client.sample(Instant::now() + SILENT)? else {
                return Err(self.client.silent_stream());
            };
            let Some(mut target) = pilot(&row_of(&sample, self.begun.elapsed().as_secs_f64())) else { return Ok(()) };
            // Of those that have come together the last counts.
            for sample in self.client.waiting_samples() {
                let Some(next) = pilot(&row_of(&sample, self.begun.elapsed().as_secs_f64())) else { return Ok(()) };
                target = next;
            }
            self.client.order(set(mode, target as f32))?;
        }
    }
}

impl Bench for LinkedBench<'_> {
    fn name(&self) -> String {
        self.client.port_name().into()
    }

    fn firmware(&self) -> String {
        format!("{} on board {:#06x}", self.identity.firmware, self.identity.board)
    }

    fn self_test(&mut self) -> Result<Vec<Check>> {
        SelfTest::USUAL.checks(self.client, self.identity, self.stop)
    }

    fn install(&mut self, parameters: &Parameters, keep: bool) -> Result<u32> {
        let blob = parameters.to_blob(&parameters.board_or_bench(RATE_HZ), RATE_HZ)?;
        let decoded: Blob =
            Blob::decode(&blob, self.identity.board).map_err(|error| Error::Computation(short(&error)))?;
        let checksum = decoded.checksum().unwrap_or_default();
        self.client.upload(&blob, keep)?;
        self.client.expect_parameters(checksum)?;
        // It is armed once it has seen its instruments for some ticks.
        some_ticks(self.client, &AtomicBool::new(false))?;
        Ok(checksum)
    }

    fn restore(&mut self) -> Result<()> {
        self.client.order(Command::Reload)
    }

    fn run(&mut self, mode: Mode, pilot: &mut Pilot<'_>) -> Result<Option<String>> {
        self.client.waiting_samples();
        until_discharged(self.client, self.stop)?;
        self.client.arm()?;
        let (every, page) = ((RATE_HZ / ROWS_HZ) as u16, self.page);
        let started = self
            .client
            .order(Command::Stream { every })
            .and_then(|()| self.client.order(Command::Start(mode)))
            .and_then(|()| {
                self.talk(mode, &mut |row| {
                    page.iter().for_each(|page| page.row(row));
                    pilot(row)
                })
            });
        // Before it is disarmed: a trip is a finding, and any other error ends the sitting.
        let state = self.client.status().map(|status| status.state);
        let ended = live::disarm(self.client);
        let quiet = self.client.order(Command::Stream { every: 0 });
        match state? {
            DriverState::Tripped(Cause::LiveFilm) => ended.and(started).map(|()| None),
            state @ DriverState::Tripped(_) => {
                ended.or_else(|_| self.client.order(Command::Acknowledge))?;
                Ok(Some(named(state)))
            }
            _ => started.and(ended).and(quiet).map(|()| None),
        }
    }

    fn gauge(&mut self, _: f64) -> Option<f64> {
        None
    }
}
