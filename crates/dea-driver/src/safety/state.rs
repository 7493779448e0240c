//! The states of the driver, why it tripped, and why it refuses a request.

use serde::{Deserialize, Serialize};

use crate::safety::SensorFault;

/// State of the driver.
///
/// ```text
/// Disarmed ──arm──▶ Armed ──start──▶ Running        Armed, Running ──disarm──▶ Disarmed
///     ▲                ◀────stop─────               Armed, Running ──a fault──▶ Tripped
///     └──────────── acknowledge ─────────────────── Tripped
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DriverState {
    /// 0 V, amplifier disabled.
    Disarmed,
    /// 0 V, amplifier enabled.
    Armed,
    /// The law commands the voltage.
    Running,
    /// 0 V, amplifier disabled, until the cause is acknowledged.
    Tripped(Cause),
}

impl DriverState {
    /// Whether the amplifier is enabled.
    #[must_use]
    pub fn is_live(self) -> bool {
        matches!(self, Self::Armed | Self::Running)
    }
}

/// Why the driver tripped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Cause {
    /// The interlock opened.
    Interlock,
    /// The voltage monitor does not follow the command.
    Monitor,
    /// The voltage monitor shows more than the limit.
    Voltage,
    /// The displacement sensor is implausible.
    Sensor(SensorFault),
    /// The film moved beyond its limit, by the sensor, or by the estimate without one.
    Displacement,
    /// The host that armed has sent no set-point or heartbeat for too long.
    Heartbeat,
    /// A tick did not end in time.
    Overrun,
    /// A converter did not answer.
    Bus,
    /// The law's prediction is not finite.
    Law,
    /// The watchdog reset the controller.
    Watchdog,
    /// The firmware panicked.
    Panic,
    /// By the model, the commanded voltage moves the film beyond its limit, even if the sensor does not show it.
    ModelDisplacement,
    /// While tracking, the model leaves more force unexplained than allowed, or more than a quarter of the stroke is learned of cycles, or as much of both
    /// together: the sensor drifts, has slipped or lost gain, or the film has changed.
    Disturbance,
    /// The monitor shows voltage although the amplifier is disabled: do not touch the film. It replaces any other cause.
    LiveFilm,
    /// The newest parameters are damaged, or were cut off while they were saved: older ones are in use.
    Parameters,
    /// The supply of the controller failed and returned.
    BrownOut,
    /// The controller was reset by its pin, by a debugger or by its firmware.
    Reset,
    /// The film has arced too often within a minute or in this run.
    Arcs,
    /// The pin of the enable output was not as it was set, high or low.
    Enable,
    /// A clock of the controller is wrong: it runs on another one, or without a watchdog.
    Clock,
    /// The option bytes of the controller lack a protection.
    OptionBytes,
    /// Parameters, limits or the film's laws in RAM, or the program in the flash, have changed: a bit has flipped. Loading parameters, or a
    /// reset, ends it.
    Memory,
    /// The law adapts, and the film has changed more than the host allows: it has aged, or the sensor has lost gain.
    Ageing,
    /// The amplifier does not pass the tone that senses the film, or is off.
    NoTone,
    /// The film conducts.
    FilmShorted,
    /// The monitor of the current shows no tone.
    CurrentMonitor,
    /// An electrode of the film, or its lead, is lost: it has too little capacitance, or too much resistance.
    Electrode,
}

/// Reasons to refuse a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Refusal {
    /// Not from this state.
    #[error("not in the state {0:?}")]
    State(DriverState),
    /// The interlock is open.
    #[error("the interlock is open")]
    InterlockOpen,
    /// There is voltage on the film while it should be at 0 V, or was less than the time of a discharge ago.
    #[error("there is voltage on the film or was just before, or the monitor does not answer")]
    LiveVoltage,
    /// The displacement sensor is implausible.
    #[error("the displacement sensor is implausible: {0:?}")]
    Sensor(SensorFault),
    /// The parameters ask for a self-test of the bench at this largest voltage, and none has passed since the start.
    #[error("no self-test of the bench has passed since the start, which the parameters ask for at this voltage")]
    SelfTest,
}
