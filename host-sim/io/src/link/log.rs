//! Streams of a controller as recordings.

use std::path::Path;

use dea_driver::wire::Telemetry;

use super::Client;
use crate::error::Result;
use crate::files::journal::Journal;
use crate::files::parameters::as_written;

/// Samples, written as they arrive.
#[derive(Debug)]
pub struct Log {
    /// Ticks per second.
    pub rate_hz: f64,
    /// Ticks from one sample to the next.
    every: u32,
    first: Option<u32>,
    last: Option<u32>,
    /// Samples so far.
    pub samples: usize,
    /// Samples that the board had no room for, or that were damaged on the line.
    pub dropped: u64,
    journal: Journal,
}

impl Log {
    /// An empty log of the controller as it ticks now, in the recording `out`, of a sample `every` so many ticks.
    ///
    /// # Errors
    ///
    /// [`Error`](crate::Error) where it does not answer, or nothing can be written.
    pub fn begin(client: &mut Client, out: &Path, every: u16) -> Result<Self> {
        let names: Vec<&str> = COLUMNS.iter().map(|(name, _)| *name).collect();
        let columns = [&["time_s"], names.as_slice()].concat();
        let journal = Journal::begin_and_report(out, &columns)?;
        // Without parameters there are no ticks, so no samples either.
        let rate_hz = Some(f64::from(client.status()?.rate_hz)).filter(|&rate_hz| rate_hz > 0.0).unwrap_or(1000.0);
        Ok(Self { rate_hz, every: u32::from(every), first: None, last: None, samples: 0, dropped: 0, journal })
    }

    /// Adds a sample.
    pub fn push(&mut self, sample: &Telemetry) -> Result<()> {
        let first = *self.first.get_or_insert(sample.tick);
        let time_s = f64::from(sample.tick.wrapping_sub(first)) / self.rate_hz;
        let row: Vec<f64> = [time_s].into_iter().chain(COLUMNS.iter().map(|(_, value)| value(sample))).collect();
        self.samples += 1;
        if let Some(last) = self.last.replace(sample.tick) {
            self.dropped += u64::from((sample.tick.wrapping_sub(last) / self.every).saturating_sub(1));
        }
        self.journal.push(&row)
    }

    /// Flushes samples that have waited for long enough.
    pub fn flush_if_due(&mut self) -> Result<()> {
        self.journal.flush_if_due()
    }

    /// Gives the recording its name, or leaves the file as it was where there are no samples or none are `wanted`.
    pub fn end(self, wanted: bool) -> Result<()> {
        if wanted && self.samples > 0 { self.journal.finish() } else { self.journal.discard() }
    }
}

/// A column's name, and what a sample has in it.
type Column = (&'static str, fn(&Telemetry) -> f64);

/// Behind the time.
const COLUMNS: [Column; 11] = [
    ("tick", |sample| f64::from(sample.tick)),
    ("command_v", |sample| as_written(sample.command_v)),
    ("voltage_v", |sample| as_written(sample.monitor_v)),
    ("displacement_m", |sample| as_written(sample.displacement_m)),
    ("predicted_m", |sample| as_written(sample.predicted_m)),
    ("reference_m", |sample| as_written(sample.reference_m)),
    ("disturbance_n", |sample| as_written(sample.disturbance_n)),
    ("force_scale", |sample| as_written(sample.force_scale)),
    ("innovation_m", |sample| as_written(sample.innovation_m)),
    ("learned_m", |sample| as_written(sample.learned_m)),
    ("limited", |sample| f64::from(sample.limited)),
];
