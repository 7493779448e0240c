//! The controller's own code around a supply, at the supply's pace.

use std::sync::atomic::{AtomicBool, Ordering};

use dea_driver::chips::Calibration;
use dea_driver::{Blob, Controller, DriverState, Inputs, Mode, OnSensorFault, Parameters as BoardParameters};
use springpot::Discretisation;

use super::description::Supply;
use super::sensor::Sensor;
use super::session::Session;
use crate::error::{Error, Result, short};
use crate::files::parameters::{Parameters, as_written};

/// Full scale of the controller's converter for the sensor, V.
const FULL_SCALE_V: f32 = 10.24;
/// Time for which the read-back may contradict the command, s: with two read-backs it ends the run within half a second.
const LIE_S: f32 = 0.35;
/// A sensor without a reading for so many of its intervals is lost.
const LOST_INTERVALS: f64 = 5.0;

/// A reference to follow, and for how long.
pub struct Follow<'a> {
    /// Reference (m) over time (s).
    pub reference_m: &'a dyn Fn(f64) -> f64,
    /// Number of ticks.
    pub ticks: usize,
    /// Whether to end now, at 0 V.
    pub stop: &'a AtomicBool,
}

/// The values of a tick.
#[derive(Clone, Copy, Debug)]
pub struct Row {
    /// Time since the beginning, s.
    pub time_s: f64,
    /// Read-back, V; NaN before the first.
    pub voltage_v: f64,
    /// Sensor, m; NaN without one.
    pub displacement_m: f64,
    /// The command, V.
    pub command_v: f64,
    /// The reference, m.
    pub reference_m: f64,
    /// Displacement by the model, m.
    pub predicted_m: f64,
}

/// A run that has ended at 0 V.
#[derive(Clone, Copy, Debug, Default)]
pub struct Summary {
    /// Ticks.
    pub samples: usize,
    /// The slowest reply, s.
    pub slowest_reply_s: f64,
    /// Whether it ran to its end, or was stopped.
    pub is_complete: bool,
}

/// The controller of `parameters` behind `supply`, at the supply's rate and second-order, with limits of both; and the time that its film
/// takes to discharge, s.
///
/// # Errors
///
/// [`Error`] for what a controller would refuse.
pub fn controller(parameters: &Parameters, supply: &Supply, has_sensor: bool) -> Result<(Controller, f64)> {
    let rate_hz = supply.rate_hz;
    let parameters = parameters.clone().with_method(Discretisation::Bdf2);
    let mut board = match &parameters.board {
        Some(board) => board.clone().at_rate(rate_hz),
        None => parameters.board_or_bench(rate_hz),
    };
    let (limits, control) = (&mut board.limits, &mut board.control);
    limits.max_voltage_v = limits.max_voltage_v.min(supply.max_voltage_v as f32);
    // 10 V at a converter are twice the largest voltage, so that too large a read-back shows.
    let volts = Calibration::linear(limits.max_voltage_v / 5.0);
    (board.amplifier, board.monitor) = (volts.clone(), volts);
    // The converter's ends are a tenth beyond what is plausible.
    let span_m = limits.sensor.high - limits.sensor.low;
    let lowest_m = limits.sensor.low - 0.1 * span_m + parameters.sensor_offset_m as f32;
    board.sensor = Calibration::Parabola { offset: lowest_m, gain: 1.2 * span_m / FULL_SCALE_V, quadratic: 0.0 };
    // The session has compared the read-back with the commands: what is left is beyond its band already.
    limits.monitor.band_v = (supply.step_v as f32).max(1e-3 * limits.max_voltage_v);
    limits.monitor.band_share = 0.0;
    limits.monitor.settle_s = LIE_S;
    limits.monitor.slew_v_per_s = limits.monitor.slew_v_per_s.max(rate_hz as f32 * limits.max_voltage_v);
    limits.max_slew_v_per_s = limits.max_slew_v_per_s.min(rate_hz as f32 * limits.max_voltage_v);
    // A tick is longer than on a board.
    limits.sensor.jump = (limits.sensor.jump * (1000.0 / rate_hz as f32).max(1.0)).min(0.24 * span_m);
    limits.on_sensor_fault = if has_sensor { OnSensorFault::Trip } else { OnSensorFault::OpenLoop };
    // That of a board: here the session checks the supply.
    board.self_test_above_v = <BoardParameters>::NO_SELF_TEST_V;
    // A supply has no monitor of the current that is as fast as a tone.
    board.self_sensing = None;
    let tick_s = 1.0 / rate_hz as f32;
    control.sample_interval_s = control.sample_interval_s.max(tick_s);
    control.lost_after_s = control.lost_after_s.max(3.0 * control.sample_interval_s);
    let discharge_s = f64::from(limits.discharge_s);
    let bytes = parameters.to_blob(&board, rate_hz)?;
    let blob = Blob::decode(&bytes, board.id).map_err(|error| Error::Computation(short(&error)))?;
    Ok((Controller::new(blob), discharge_s))
}

/// Follows a reference through `session` with `controller`; `seen` is given every tick. The supply is at 0 V and off when it returns,
/// whatever happened.
///
/// # Errors
///
/// [`Error`] for what ended the run, and for a film that may be live after it.
pub fn follow(
    mut session: Session,
    controller: (Controller, f64),
    mut sensor: Option<Sensor>,
    follow: &Follow<'_>,
    seen: impl FnMut(Row) -> Result<()>,
) -> Result<Summary> {
    let (mut controller, discharge_s) = controller;
    let mut summary = Summary::default();
    let followed = run(&mut session, &mut controller, sensor.as_mut(), follow, seen, &mut summary);
    summary.slowest_reply_s = session.slowest_reply_s;
    // A live film is reported before its cause.
    match (session.end(discharge_s + 1.0), followed) {
        (Err(live), Err(cause)) => Err(Error::Computation(format!("{live}; before that {cause}"))),
        (ended, followed) => ended.and(followed).map(|()| summary),
    }
}

/// The voltage at the converter at which `sensor` reads `metres`.
fn converter_v(sensor: &Calibration, metres: f64) -> f32 {
    let (lowest_m, highest_m) = (f64::from(sensor.apply(0.0)), f64::from(sensor.apply(FULL_SCALE_V)));
    (f64::from(FULL_SCALE_V) * (metres - lowest_m) / (highest_m - lowest_m)) as f32
}

fn run(
    session: &mut Session,
    controller: &mut Controller,
    mut sensor: Option<&mut Sensor>,
    follow: &Follow<'_>,
    mut seen: impl FnMut(Row) -> Result<()>,
    summary: &mut Summary,
) -> Result<()> {
    let parameters = controller.parameters().clone();
    let (late_s, latency_s) = (session.supply.late_s, session.supply.latency_s);
    let step_s = 1.0 / f64::from(parameters.rate_hz);
    let lost_s = LOST_INTERVALS * f64::from(parameters.control.sample_interval_s);
    let max_v = f64::from(parameters.limits.max_voltage_v);
    let volts = f64::from(parameters.limits.max_voltage_v / 5.0);
    let mode = if sensor.is_some() { Mode::Tracking } else { Mode::Feedforward };
    // A film at rest first: arming needs a sensor that has been seen for some ticks.
    const SETTLING: usize = 12;
    let start_s = session.now_s();
    for k in 0..SETTLING + follow.ticks {
        let due_s = start_s + k as f64 * step_s;
        session.listen(due_s)?;
        if follow.stop.load(Ordering::Relaxed) {
            return Ok(());
        }
        let behind_s = session.now_s() - due_s;
        if behind_s > late_s {
            return Err(session.fault(&format!("this computer was busy for {behind_s:.2} s, longer than late_s")));
        }
        let newest = sensor.as_mut().map(|sensor| sensor.newest()).transpose()?.flatten();
        let displacement_m = newest.filter(|&(_, time_s)| session.now_s() - time_s <= lost_s).map(|(metres, _)| metres);

        let command_v = f64::from(controller.supervisor().command_v());
        // What the commands of the time do not explain of the read-back, at the command of now.
        let monitor_v = command_v + session.deviation_v();
        let above_v = session.reading_v().filter(|&v| v > max_v + session.read_error_v(max_v));
        let inputs = Inputs {
            interlock_closed: true,
            monitor_adc_v: Some((above_v.unwrap_or(monitor_v) / volts) as f32),
            sensor_adc_v: displacement_m.map(|metres| converter_v(&parameters.sensor, metres)),
        };
        controller.heartbeat();
        let time_s = (k as f64 - SETTLING as f64) * step_s;
        // The film holds a voltage for a tick: on the mean it is where the middle of the tick asks for.
        let target_m = (follow.reference_m)((time_s + 0.5 * step_s + latency_s).max(0.0));
        if k == SETTLING {
            controller
                .arm()
                .and_then(|()| controller.start(mode))
                .map_err(|refusal| session.fault(&refusal.to_string()))?;
        }
        if k >= SETTLING {
            let set = controller.set_reference(target_m as f32);
            set.map_err(|error| session.fault(&format!("{error} ({target_m} m at {time_s:.3} s)")))?;
        }
        let outputs = controller.tick(inputs);
        if let DriverState::Tripped(cause) = controller.supervisor().state() {
            let seen_v = session.reading_v().map_or("nothing".into(), |v| format!("{v:.0} V"));
            let read = format!("{command_v:.0} V commanded, {seen_v} read back");
            return Err(session.fault(&format!("tripped: {cause:?} at {time_s:.2} s; {read}")));
        }
        let command_v = session.set(volts * f64::from(outputs.dac_v))?;
        if !session.is_reading() {
            session.query()?;
        }
        if k >= SETTLING {
            summary.samples += 1;
            seen(Row {
                time_s,
                voltage_v: session.reading_v().unwrap_or(f64::NAN),
                displacement_m: displacement_m.unwrap_or(f64::NAN),
                command_v,
                reference_m: (follow.reference_m)(time_s),
                predicted_m: as_written(outputs.telemetry.predicted_m),
            })?;
        }
    }
    summary.is_complete = true;
    Ok(())
}
