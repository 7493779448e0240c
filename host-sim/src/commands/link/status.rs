//! `link status`: how a controller and what is connected to it are.

use dea_driver::wire::{Answer, Command, Inspection, Reject, Status};

use super::asking::answer;
use crate::commands::prelude::*;
use crate::link::{Client, named};

#[derive(Serialize)]
struct How {
    port: String,
    state: String,
    /// Ticks per second; none without parameters.
    rate_hz: Option<f32>,
    ticks: u32,
    tripped_at: u32,
    command_v: f32,
    /// By the voltage monitor; none if it does not answer.
    monitor_v: Option<f32>,
    /// Whether the monitor shows voltage.
    live: bool,
    /// Null for a board that does not report its parts.
    parts: Option<Parts>,
    damaged_frames: u32,
    unknown_frames: u32,
    /// More than 0 on a line that is flooded.
    lost_bytes: u32,
    stack_peak_bytes: u32,
    /// How often the monitor's reading fell since it was armed last.
    falls: u16,
}

/// Parts as of the last tick, as `self-test` names them.
#[derive(Serialize)]
struct Parts {
    interlock_closed: bool,
    enable_high: bool,
    dac: String,
    monitor: String,
    sensor: String,
    /// At the ADC; none if it does not answer.
    monitor_adc_v: Option<f32>,
    sensor_adc_v: Option<f32>,
}

impl From<Inspection> for Parts {
    fn from(found: Inspection) -> Self {
        let shown = |volts: f32| Some(volts).filter(|volts| volts.is_finite());
        Self {
            interlock_closed: found.interlock_closed,
            enable_high: found.enable_high,
            dac: answer(found.dac),
            monitor: answer(found.monitor),
            sensor: answer(found.sensor),
            monitor_adc_v: shown(found.monitor_adc_v),
            sensor_adc_v: shown(found.sensor_adc_v),
        }
    }
}

impl Parts {
    fn line(&self) -> String {
        let interlock = if self.interlock_closed { "closed" } else { "open" };
        let enable = if self.enable_high { "high" } else { "low" };
        let adc = |part: &str, volts: Option<f32>| match volts {
            Some(volts) => format!("{volts:.3} V at its ADC"),
            None => part.to_owned(),
        };
        format!(
            "interlock {interlock}, enable output {enable}; sensor: {}; monitor: {}; DAC {}",
            adc(&self.sensor, self.sensor_adc_v),
            adc(&self.monitor, self.monitor_adc_v),
            self.dac
        )
    }
}

/// Falls of the monitor's reading in words, if there were any.
pub(super) fn falls_text(falls: u16) -> Option<String> {
    let times = if falls == 1 { "once".to_owned() } else { format!("{falls} times") };
    (falls > 0).then(|| {
        format!("since it was armed the monitor's reading fell {times}, as with an arc: look at film and leads")
    })
}

pub(super) fn report(mut client: Client, port: String, json: bool) -> Result<()> {
    let status = client.status()?;
    let parts = match client.ask(Command::Inspect)? {
        Answer::Inspection(found) => Some(Parts::from(found)),
        Answer::Rejected(Reject::Unknown) => None,
        other => return Err(client.unexpected(&other)),
    };
    let Status { state, rate_hz, ticks, tripped_at, command_v, damaged_frames, unknown_frames, lost_bytes, .. } =
        status;
    let how = How {
        port,
        state: named(state),
        rate_hz: Some(rate_hz).filter(|&rate_hz| rate_hz > 0.0),
        ticks,
        tripped_at,
        command_v,
        monitor_v: Some(status.monitor_v).filter(|volts| volts.is_finite()),
        live: status.live,
        parts,
        damaged_frames,
        unknown_frames,
        lost_bytes,
        stack_peak_bytes: status.stack_peak,
        falls: status.falls,
    };
    terminal::report(json, &how, || {
        let parameters = how.rate_hz.map_or("no parameters yet".into(), |rate_hz| format!("{rate_hz} Hz"));
        let trip = if tripped_at > 0 { format!(", last trip at tick {tripped_at}") } else { String::new() };
        let monitor = how.monitor_v.map_or("unknown".into(), |volts| format!("{volts:.0} V"));
        let live = if how.live { ", the film is live" } else { "" };
        let flood = match lost_bytes {
            0 => String::new(),
            lost => {
                format!("; {lost} bytes lost, the line brings more than is served: does another program write to it?")
            }
        };
        let falls = falls_text(how.falls).map_or(String::new(), |falls| format!("\n{falls}"));
        let parts = how.parts.as_ref().map_or("this board does not report its parts".into(), Parts::line);
        format!(
            "{}: {}, {parameters}, {command_v:.0} V commanded, monitor {monitor}{live}, tick {ticks}{trip}\n{parts}\n\
             frames: {damaged_frames} damaged, {unknown_frames} not understood{flood}; stack: {} bytes at the most{falls}",
            how.port, how.state, how.stack_peak_bytes
        )
    })
}
