//! `link flight-recorder`: how the last run ended.

use dea_driver::wire::{Answer, Command, FlightRecord};

use crate::commands::prelude::*;
use crate::link::{Client, named};

/// Newest records among which the last one with voltage is of the same run.
const LAST: usize = 16;

#[derive(Debug, Args)]
pub(super) struct FlightRecorder {
    /// Table to write, oldest tick first: tick, voltages, displacements, limits that the command met (bits), and the state after the tick.
    #[arg(long, value_name = "CSV")]
    out: Option<PathBuf>,
}

#[derive(Serialize)]
struct Report {
    port: String,
    out: Option<String>,
    records: usize,
    /// Null without records.
    newest: Option<Newest>,
}

/// The end of the last run.
#[derive(Serialize)]
struct Newest {
    tick: u32,
    state: String,
    /// Before it, of the last record with voltage if it is one of the newest.
    command_v: f32,
    monitor_v: Option<f32>,
    displacement_m: Option<f32>,
}

impl FlightRecorder {
    pub(super) fn check(&self) -> Result<()> {
        self.out.as_ref().map_or(Ok(()), |out| output::check(out, &[], Folders::Exist))
    }

    pub(super) fn run(&self, mut client: Client, port: String, json: bool) -> Result<()> {
        let records = read(&mut client)?;
        if let Some(out) = &self.out {
            output::write_whole(out, |file| {
                writeln!(file, "tick,command_v,monitor_v,displacement_m,predicted_m,reference_m,limited,state")?;
                records.iter().rev().try_for_each(|record| writeln!(file, "{}", row(record)))
            })?;
        }
        let shown_if_finite = |value: f32| Some(value).filter(|value| value.is_finite());
        let newest = records.first().map(|last| {
            let before = records.iter().take(LAST).find(|record| record.command_v != 0.0).unwrap_or(last);
            Newest {
                tick: last.tick,
                state: named(last.state),
                command_v: before.command_v,
                monitor_v: shown_if_finite(before.monitor_v),
                displacement_m: shown_if_finite(before.displacement_m),
            }
        });
        let report = Report { port, out: self.out.as_ref().map(|out| shown(out)), records: records.len(), newest };
        terminal::report(json, &report, || {
            let Some(newest) = &report.newest else {
                return format!("{}: nothing is recorded since the power came on", report.port);
            };
            let or_none = |value: Option<f32>, scale: f32, unit| {
                value.map_or("none".to_owned(), |value| format!("{:.4} {unit}", scale * value))
            };
            let out = match &report.out {
                Some(out) => format!("; {} ticks in {out}", report.records),
                None => format!("; {} ticks, which --out writes", report.records),
            };
            format!(
                "{}: the last run ended in tick {}, {}; before: {:.0} V commanded, monitor {}, sensor {}{out}",
                report.port,
                newest.tick,
                newest.state,
                newest.command_v,
                or_none(newest.monitor_v, 1.0, "V"),
                or_none(newest.displacement_m, 1e3, "mm"),
            )
        })
    }
}

/// A row of the table.
fn row(record: &FlightRecord) -> String {
    let FlightRecord { tick, command_v, monitor_v, displacement_m, predicted_m, reference_m, limited, state } = record;
    let state = named(*state);
    format!("{tick},{command_v},{monitor_v},{displacement_m},{predicted_m},{reference_m},{limited},{state}")
}

/// All records, the newest first. A run that went on meanwhile would move them.
fn read(client: &mut Client) -> Result<Vec<FlightRecord>> {
    let state = client.status()?.state;
    if state.is_live() {
        let cause = format!(
            "the controller is {}: read its flight recorder after the run (`link disarm` ends it)",
            named(state)
        );
        return Err(Error::Computation(cause));
    }
    let mut records: Vec<FlightRecord> = Vec::new();
    while let Ok(back) = u16::try_from(records.len()) {
        match client.ask(Command::FlightRecords { back })? {
            Answer::FlightRecords(older) if older.is_empty() => break,
            Answer::FlightRecords(older) => records.extend(older),
            other => return Err(client.unexpected(&other)),
        }
    }
    Ok(records)
}
