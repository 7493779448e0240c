//! What keeps the film and its user safe: states, limits and trips.

use core::fmt;

use serde::{Deserialize, Serialize};

use crate::safety::monitor::bounded;
use crate::safety::{Monitor, MonitorLimits};
use crate::safety::{Plausibility, PlausibilityLimits, SensorFault};

/// Where the driver stands.
///
/// ```text
/// Disarmed ──arm──▶ Armed ──start──▶ Running        Armed, Running ──disarm──▶ Disarmed
///     ▲                ◀────stop─────               Armed, Running ──a fault──▶ Tripped
///     └──────────── acknowledge ─────────────────── Tripped
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum State {
    /// 0 V, amplifier disabled.
    Disarmed,
    /// 0 V, amplifier enabled.
    Armed,
    /// The law commands the voltage.
    Running,
    /// 0 V, amplifier disabled, until the cause is acknowledged.
    Tripped(Cause),
}

impl State {
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
    /// The displacement sensor cannot be believed.
    Sensor(SensorFault),
    /// The film moved beyond its limit.
    Displacement,
    /// The host was silent.
    Heartbeat,
    /// A tick did not end in time.
    Overrun,
    /// A converter did not answer.
    Bus,
    /// The law's answer is not a number.
    Law,
    /// The watchdog reset the controller.
    Watchdog,
    /// The firmware panicked.
    Panic,
}

/// What is done when the displacement sensor cannot be believed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum OnSensorFault {
    /// Trip.
    Trip,
    /// Go on without it: the law predicts the displacement.
    OpenLoop,
}

/// What the film and the bench allow.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Limits {
    /// Largest voltage, V.
    pub max_voltage_v: f32,
    /// Largest field across the film, V/m; VHB 4910 breaks down near 1e8 V/m, sooner where it is thin.
    pub max_field_v_per_m: f32,
    /// Thickness of the film, m.
    pub thickness_m: f32,
    /// Largest change of the command, V/s.
    pub max_slew_v_per_s: f32,
    /// Largest displacement to either side, m.
    pub max_displacement_m: f32,
    /// How far the voltage monitor may be from the command.
    pub monitor: MonitorLimits,
    /// What the displacement sensor may read, m.
    pub sensor: PlausibilityLimits,
    /// What is done when it reads something else.
    pub on_sensor_fault: OnSensorFault,
    /// For so long the host may be silent, s.
    pub heartbeat_s: f32,
}

impl Limits {
    /// What the voltage monitor may show at the most, V.
    #[must_use]
    pub fn monitored_v(&self) -> f32 {
        self.max_voltage_v * (1.0 + self.monitor.band_share) + self.monitor.band_v
    }
}

/// Why limits were refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum LimitsError {
    /// A quantity that is not finite or not greater than nought; the name carries its unit.
    NotPositive(&'static str),
    /// Monitor limits that cannot be kept.
    Monitor,
    /// Sensor limits that cannot be kept.
    Sensor,
    /// More than makes sense of a limit: it would protect nothing.
    TooLarge(&'static str),
}

impl fmt::Display for LimitsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotPositive(quantity) => write!(f, "{quantity} must be finite and greater than 0"),
            Self::Monitor => {
                f.write_str("monitor: slew and band must be greater than 0, share and settle time not negative")
            }
            Self::TooLarge(quantity) => write!(f, "{quantity} is so large that it protects nothing"),
            Self::Sensor => f.write_str("sensor: low must be below high, and the jump greater than 0"),
        }
    }
}

impl core::error::Error for LimitsError {}

/// Why a request was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum Refusal {
    /// Not from this state.
    State(State),
    /// The interlock is open.
    InterlockOpen,
    /// There is voltage on the film while there should be none.
    LiveVoltage,
    /// The displacement sensor cannot be believed.
    Sensor(SensorFault),
}

/// What the sensors say in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Readings {
    /// Whether the interlock is closed.
    pub interlock_closed: bool,
    /// The voltage monitor, V.
    pub monitor_v: f32,
    /// The displacement sensor, m.
    pub displacement_m: f32,
    /// Where the model takes the film to be, m.
    pub predicted_m: f32,
}

/// What a tick may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// The state from now on.
    pub state: State,
    /// The displacement, m, where the sensor can be believed.
    pub displacement_m: Option<f32>,
}

/// Watches every tick and limits every command.
#[derive(Clone, Copy, Debug)]
pub struct Supervisor {
    state: State,
    ticks: u32,
    tripped_at: u32,
    max_voltage_v: f32,
    monitored_v: f32,
    /// Voltage of the largest field at rest, V.
    field_v: f32,
    slew_v_per_tick: f32,
    max_displacement_m: f32,
    live_v: f32,
    on_sensor_fault: OnSensorFault,
    heartbeat_ticks: u32,
    silent_ticks: u32,
    command_v: f32,
    monitor_limits: MonitorLimits,
    monitor: Monitor,
    sensor: Plausibility,
    rate_hz: f32,
    last: Readings,
    last_fault: Option<SensorFault>,
}

impl Supervisor {
    /// A disarmed supervisor of a loop at `rate_hz`.
    ///
    /// # Errors
    ///
    /// [`LimitsError`] for limits that make no sense.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
    pub fn new(limits: &Limits, rate_hz: f32) -> Result<Self, LimitsError> {
        for (name, value) in [
            ("rate_hz", rate_hz),
            ("max_voltage_v", limits.max_voltage_v),
            ("max_field_v_per_m", limits.max_field_v_per_m),
            ("thickness_m", limits.thickness_m),
            ("max_slew_v_per_s", limits.max_slew_v_per_s),
            ("max_displacement_m", limits.max_displacement_m),
            ("heartbeat_s", limits.heartbeat_s),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(LimitsError::NotPositive(name));
            }
        }
        for (name, value, most) in [
            ("heartbeat_s", limits.heartbeat_s, 60.0),
            ("monitor.band_share", limits.monitor.band_share, 0.5),
            ("monitor.settle_s", limits.monitor.settle_s, 1.0),
        ] {
            if value > most {
                return Err(LimitsError::TooLarge(name));
            }
        }
        if !limits.monitor.are_valid() {
            return Err(LimitsError::Monitor);
        }
        if !limits.sensor.are_valid() {
            return Err(LimitsError::Sensor);
        }
        Ok(Self {
            state: State::Disarmed,
            ticks: 0,
            tripped_at: 0,
            max_voltage_v: limits.max_voltage_v,
            monitored_v: limits.monitored_v(),
            field_v: limits.max_field_v_per_m * limits.thickness_m,
            slew_v_per_tick: limits.max_slew_v_per_s / rate_hz,
            max_displacement_m: limits.max_displacement_m,
            live_v: limits.monitor.band_v,
            on_sensor_fault: limits.on_sensor_fault,
            heartbeat_ticks: (limits.heartbeat_s * rate_hz + 0.5) as u32,
            silent_ticks: 0,
            command_v: 0.0,
            monitor_limits: limits.monitor,
            monitor: Monitor::new(limits.monitor, rate_hz),
            sensor: Plausibility::new(limits.sensor),
            rate_hz,
            // Nothing is known yet, so nothing can be armed.
            last: Readings { interlock_closed: false, monitor_v: f32::NAN, displacement_m: f32::NAN, predicted_m: 0.0 },
            last_fault: None,
        })
    }

    /// The state.
    #[must_use]
    pub fn state(&self) -> State {
        self.state
    }

    /// Ticks since the start, wrapping.
    #[must_use]
    pub fn ticks(&self) -> u32 {
        self.ticks
    }

    /// The tick of the last trip.
    #[must_use]
    pub fn tripped_at(&self) -> u32 {
        self.tripped_at
    }

    /// The command of the last tick, V at the film.
    #[must_use]
    pub fn command_v(&self) -> f32 {
        self.command_v
    }

    /// Whether the amplifier is to be enabled.
    #[must_use]
    pub fn enables(&self) -> bool {
        self.state.is_live()
    }

    /// Whether the law commands the voltage.
    #[must_use]
    pub fn runs(&self) -> bool {
        self.state == State::Running
    }

    /// Enables the amplifier at 0 V.
    ///
    /// # Errors
    ///
    /// [`Refusal`] from another state than disarmed, and while the readings of the last tick are not safe.
    pub fn arm(&mut self) -> Result<(), Refusal> {
        if self.state != State::Disarmed {
            return Err(Refusal::State(self.state));
        }
        if !self.last.interlock_closed {
            return Err(Refusal::InterlockOpen);
        }
        if !(-self.live_v..=self.live_v).contains(&self.last.monitor_v) {
            return Err(Refusal::LiveVoltage);
        }
        if let (Some(fault), OnSensorFault::Trip) = (self.last_fault, self.on_sensor_fault) {
            return Err(Refusal::Sensor(fault));
        }
        self.state = State::Armed;
        self.silent_ticks = 0;
        self.monitor = Monitor::new(self.monitor_limits, self.rate_hz);
        Ok(())
    }

    /// Lets the law command the voltage.
    ///
    /// # Errors
    ///
    /// [`Refusal`] from another state than armed.
    pub fn start(&mut self) -> Result<(), Refusal> {
        self.change(State::Armed, State::Running)
    }

    /// Back to 0 V, amplifier enabled.
    ///
    /// # Errors
    ///
    /// [`Refusal`] from another state than running.
    pub fn stop(&mut self) -> Result<(), Refusal> {
        self.change(State::Running, State::Armed)
    }

    /// Back to 0 V, amplifier disabled. Disarming what is disarmed is no error; a trip stays.
    ///
    /// # Errors
    ///
    /// [`Refusal`] when tripped: acknowledge first.
    pub fn disarm(&mut self) -> Result<(), Refusal> {
        if let State::Tripped(_) = self.state {
            return Err(Refusal::State(self.state));
        }
        self.state = State::Disarmed;
        self.command_v = 0.0;
        Ok(())
    }

    /// Takes note of a trip.
    ///
    /// # Errors
    ///
    /// [`Refusal`] where there is none.
    pub fn acknowledge(&mut self) -> Result<(), Refusal> {
        match self.state {
            State::Tripped(_) => {
                self.state = State::Disarmed;
                self.sensor.reset();
                Ok(())
            }
            other => Err(Refusal::State(other)),
        }
    }

    fn change(&mut self, from: State, to: State) -> Result<(), Refusal> {
        if self.state == from {
            self.state = to;
            Ok(())
        } else {
            Err(Refusal::State(self.state))
        }
    }

    /// The host is alive.
    pub fn heartbeat(&mut self) {
        self.silent_ticks = 0;
    }

    /// Trips, whatever the state: 0 V, amplifier disabled. The first cause stays.
    pub fn trip(&mut self, cause: Cause) {
        self.command_v = 0.0;
        if !matches!(self.state, State::Tripped(_)) {
            self.state = State::Tripped(cause);
            self.tripped_at = self.ticks;
        }
    }

    /// Takes in the readings of a tick and tells what it may do. Sensors are watched in every state, and trip what is armed
    /// or running.
    pub fn check(&mut self, readings: Readings) -> Tick {
        self.ticks = self.ticks.wrapping_add(1);
        self.silent_ticks = self.silent_ticks.saturating_add(1);
        self.last = readings;
        self.last_fault = self.sensor.check(readings.displacement_m, readings.predicted_m);
        // Without a sensor to believe, the model says where the film is.
        let displacement_m = if self.last_fault.is_none() { readings.displacement_m } else { readings.predicted_m };
        let agrees = self.monitor.agrees(self.command_v, readings.monitor_v);
        let trips = matches!(self.on_sensor_fault, OnSensorFault::Trip);
        let cause = match self.last_fault {
            _ if !readings.interlock_closed => Some(Cause::Interlock),
            _ if readings.monitor_v > self.monitored_v => Some(Cause::Voltage),
            _ if !agrees => Some(Cause::Monitor),
            Some(fault) if trips => Some(Cause::Sensor(fault)),
            _ if displacement_m.abs() > self.max_displacement_m => Some(Cause::Displacement),
            _ if self.silent_ticks > self.heartbeat_ticks => Some(Cause::Heartbeat),
            _ => None,
        };
        if let (true, Some(cause)) = (self.enables(), cause) {
            self.trip(cause);
        }
        let displacement_m = if self.last_fault.is_none() { Some(readings.displacement_m) } else { None };
        Tick { state: self.state, displacement_m }
    }

    /// The command (V) that may follow the last one when `wanted_v` is asked for: 0 V unless running, and for what is not a
    /// number; between 0 and the largest voltage that bench and field allow; no faster than the slew, but for the field, which
    /// outranks it. `thinning` is how many times thinner than at rest the film is.
    pub fn command(&mut self, wanted_v: f32, thinning: f32) -> f32 {
        self.command_v = if matches!(self.state, State::Running) {
            let by_field = if thinning > 1.0 { self.field_v / thinning } else { self.field_v };
            let most = if by_field < self.max_voltage_v { by_field } else { self.max_voltage_v };
            let wanted = if wanted_v > 0.0 { wanted_v } else { 0.0 };
            let slewed = self.command_v + bounded(wanted - self.command_v, self.slew_v_per_tick);
            if slewed < most { slewed } else { most }
        } else {
            0.0
        };
        self.command_v
    }
}
