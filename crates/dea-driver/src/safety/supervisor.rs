//! The checks of every tick, and the limits of every command.

mod orders;

#[cfg(feature = "link")]
use serde::Serialize;
use springpot::AmplifierLag;

use crate::safety::limits::positive;
use crate::safety::monitor::bounded;
use crate::safety::{Cause, DriverState, Limits, LimitsError, Monitor, OnSensorFault, Plausibility, SensorFault};

/// The sensors' values in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Readings {
    /// Whether the interlock is closed.
    pub interlock_closed: bool,
    /// The voltage monitor, V.
    pub monitor_v: f32,
    /// The displacement sensor, m.
    pub displacement_m: f32,
    /// The estimate, which the sensor may have corrected, m.
    pub predicted_m: f32,
    /// The model's displacement under the commanded voltage alone, which no sensor corrects, m. Scaled for a film that is softer than its
    /// model ([`Motion`](crate::Motion)).
    pub open_loop_m: f32,
    /// Whether the model [moves](crate::Motion) and the displacement sensor does not.
    pub is_frozen: bool,
    /// The force that the model leaves unexplained, plus the learned correction of cycles, as a share of the force at the largest voltage,
    /// of either sign; 0 where no sensor acts on the voltage.
    pub disturbance_share: f32,
}

/// The result of the checks of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// The state from now on.
    pub state: DriverState,
    /// The displacement, m, if the sensor is plausible.
    pub displacement_m: Option<f32>,
}

/// Checks every tick and limits every command.
///
/// The [`Controller`](crate::Controller) owns one. Alone it serves a control loop that is written without the controller:
///
/// ```
/// use dea_driver::{Cause, DriverState, Limits, Readings, Supervisor};
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// let mut supervisor = Supervisor::new(&Limits::bench(160e-6), 1000.0)?;
/// let healthy = Readings {
///     interlock_closed: true,
///     monitor_v: 0.0,
///     displacement_m: 1e-6,
///     predicted_m: 0.0,
///     open_loop_m: 0.0,
///     is_frozen: false,
///     disturbance_share: 0.0,
/// };
///
/// // In every tick: check the readings, then ask for a voltage.
/// supervisor.check(healthy);
/// assert_eq!(supervisor.command(3000.0, 1.0), 0.0); // disarmed
/// supervisor.arm().expect("the readings are healthy");
/// supervisor.start().expect("it is armed");
/// supervisor.check(Readings { displacement_m: 2e-6, ..healthy });
/// assert_eq!(supervisor.command(3000.0, 1.0), 50.0); // 50 kV/s at 1 kHz
///
/// // A fault ends at 0 V within the tick.
/// supervisor.check(Readings { interlock_closed: false, ..healthy });
/// assert_eq!(supervisor.state(), DriverState::Tripped(Cause::Interlock));
/// assert_eq!(supervisor.command(3000.0, 1.0), 0.0);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Supervisor {
    state: DriverState,
    ticks: u32,
    tripped_at: u32,
    max_voltage_v: f32,
    monitored_v: f32,
    /// Voltage of the largest field at rest, V.
    field_v: f32,
    slew_v_per_tick: f32,
    max_displacement_m: f32,
    max_disturbance_share: f32,
    live_v: f32,
    /// [`OPENS_LOOP`], or it trips. A number, of which every bit counts: an enum with a value of no variant need not trip.
    on_sensor_fault: u32,
    heartbeat_ticks: u32,
    ticks_since_heartbeat: u32,
    discharge_ticks: u32,
    /// [`LIVE`] for every tick with the amplifier disabled and voltage at the monitor, less one for every tick at 0 V.
    live_ticks: u32,
    /// Ticks at 0 V that are still missing before it can be armed, or a live film acknowledged.
    missing_at_0_v: u32,
    command_v: f32,
    /// Largest voltage until it is armed again, V: less for a self-test.
    armed_for_v: f32,
    self_test: SelfTest,
    monitor: Monitor,
    sensor: Plausibility,
    /// State of the interlock in the last tick.
    interlock_closed: bool,
    monitor_v: f32,
    last_fault: Option<SensorFault>,
}

/// State of the self-test that has to pass before it is armed without limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SelfTest {
    /// It has passed, or is not required.
    NotNeeded,
    Missing,
}

/// The loop is opened on a fault of the sensor.
const OPENS_LOOP: u32 = 0x5a;

/// Ticks at 0 V that make up for one with voltage while the amplifier is disabled: a film that is live for more than a fifth of the time is
/// reported.
const LIVE: u32 = 4;

/// Bound of the search for the time that a film takes to 0 V: e^16 is nine million.
const MAX_TIME_CONSTANTS: u8 = 16;

impl Supervisor {
    /// A disarmed supervisor of a loop at `rate_hz`.
    ///
    /// # Errors
    ///
    /// [`LimitsError`] for a rate or limits that are refused.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
    pub fn new(limits: &Limits, rate_hz: f32) -> Result<Self, LimitsError> {
        if !positive(rate_hz) {
            return Err(LimitsError::NotPositive { quantity: "rate_hz", value: rate_hz });
        }
        limits.check()?;
        limits.sensor.check_rate(rate_hz)?;
        Ok(Self {
            state: DriverState::Disarmed,
            ticks: 0,
            tripped_at: 0,
            max_voltage_v: limits.max_voltage_v,
            monitored_v: limits.monitored_v(),
            field_v: limits.max_field_v_per_m * limits.thickness_m,
            slew_v_per_tick: limits.max_slew_v_per_s / rate_hz,
            max_displacement_m: limits.max_displacement_m,
            max_disturbance_share: limits.max_disturbance_share,
            live_v: limits.monitor.band_v,
            on_sensor_fault: if limits.on_sensor_fault == OnSensorFault::OpenLoop { OPENS_LOOP } else { !OPENS_LOOP },
            heartbeat_ticks: (limits.heartbeat_s * rate_hz + 0.5) as u32,
            ticks_since_heartbeat: 0,
            discharge_ticks: (limits.discharge_s * rate_hz + 0.5) as u32,
            live_ticks: 0,
            missing_at_0_v: 0,
            command_v: 0.0,
            armed_for_v: limits.max_voltage_v,
            self_test: SelfTest::NotNeeded,
            monitor: Monitor::new(limits.monitor, rate_hz),
            sensor: Plausibility::new(limits.sensor),
            // There are no readings yet, so arming is refused.
            interlock_closed: false,
            monitor_v: f32::NAN,
            last_fault: None,
        })
    }

    /// The same supervisor for an amplifier with this `lag`, at `rate_hz` ticks a second: its monitor expects the lag, and a disabled film
    /// has the time that `fall_s` takes to 0 V.
    ///
    /// # Errors
    ///
    /// As [`Monitor::behind`].
    #[allow(clippy::cast_possible_truncation, clippy::cast_precision_loss, clippy::cast_sign_loss)] // saturates
    pub fn behind(self, lag: AmplifierLag, rate_hz: f32) -> Result<Self, LimitsError> {
        let monitor = self.monitor.behind(lag, rate_hz)?;
        // From the largest voltage into the monitor's band, and one more for a bleeder that is slower than it says.
        let time_constants = (0..MAX_TIME_CONSTANTS).scan(self.monitored_v, |voltage_v, _| {
            *voltage_v *= core::f32::consts::E.recip();
            (*voltage_v > self.live_v).then_some(())
        });
        let time_constants = (time_constants.count() + 2) as f32;
        let falls_ticks = (lag.fall_s as f32 * rate_hz * time_constants) as u32;
        Ok(Self { monitor, discharge_ticks: self.discharge_ticks.max(falls_ticks), ..self })
    }

    /// The same supervisor, which refuses to be [armed](Self::arm) before a self-test has passed if its limits allow more than `above_v`
    /// (V).
    #[must_use]
    pub fn with_self_test_above(self, above_v: f32) -> Self {
        let self_test = if self.max_voltage_v <= above_v { SelfTest::NotNeeded } else { SelfTest::Missing };
        Self { self_test, ..self }
    }

    /// Notes that a self-test of the bench has passed, until the next reset.
    pub fn note_self_test(&mut self) {
        self.self_test = SelfTest::NotNeeded;
    }

    /// Takes over how long the film of `before` was live, and its time at 0 V, which restarts.
    #[cfg(feature = "link")]
    pub(crate) fn take_discharge_of(&mut self, before: &Self) {
        self.missing_at_0_v = if before.missing_at_0_v > 0 { self.discharge_ticks } else { 0 };
        // As long a share of its time, which may have another number of ticks.
        let live_ticks =
            u64::from(before.live_ticks) * u64::from(self.discharge_ticks) / u64::from(before.discharge_ticks.max(1));
        self.live_ticks = u32::try_from(live_ticks).unwrap_or(u32::MAX);
    }

    /// The constants, for a check of the memory.
    #[cfg(feature = "link")]
    pub(crate) fn constants(&self) -> impl Serialize + use<> {
        let limits = [
            self.max_voltage_v,
            self.monitored_v,
            self.field_v,
            self.slew_v_per_tick,
            self.max_displacement_m,
            self.max_disturbance_share,
            self.live_v,
        ];
        let ticks = (self.heartbeat_ticks, self.discharge_ticks);
        (limits, ticks, self.on_sensor_fault, self.monitor.constants(), self.sensor.limits())
    }

    /// Whether values that would hide a fault are within their bounds.
    #[cfg(feature = "link")]
    pub(crate) fn is_sound(&self) -> bool {
        self.monitor.is_sound(self.max_voltage_v)
            && [self.max_voltage_v, self.self_test_v()].contains(&self.armed_for_v)
    }

    /// The state.
    #[must_use]
    pub fn state(&self) -> DriverState {
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

    /// Voltage at the film by the monitor, V; NaN before the first tick and from a monitor that does not answer.
    #[must_use]
    pub fn monitor_v(&self) -> f32 {
        self.monitor_v
    }

    /// Whether the monitor shows more voltage than its band around 0 V.
    #[must_use]
    pub fn is_film_live(&self) -> bool {
        self.monitor_v.abs() > self.live_v
    }

    /// Number of [falls](Monitor::falls) of the monitor's reading, such as arcs, since it was armed.
    #[must_use]
    pub fn falls(&self) -> u16 {
        self.monitor.falls()
    }

    /// Whether the monitor answers, and shows no more than its band around 0 V.
    fn is_at_0_v(&self) -> bool {
        self.monitor_v.abs() <= self.live_v
    }

    /// Whether the amplifier is to be enabled.
    #[must_use]
    pub fn enables(&self) -> bool {
        self.state.is_live()
    }

    /// Whether the law commands the voltage.
    #[must_use]
    pub fn runs(&self) -> bool {
        self.state == DriverState::Running
    }

    /// Checks the readings of a tick. Sensors are checked in every state; a fault trips if armed or running.
    pub fn check(&mut self, readings: Readings) -> Tick {
        self.ticks = self.ticks.wrapping_add(1);
        self.ticks_since_heartbeat = self.ticks_since_heartbeat.saturating_add(1);
        self.interlock_closed = readings.interlock_closed;
        self.monitor_v = readings.monitor_v;
        self.last_fault = self.sensor.check(readings.displacement_m, readings.predicted_m, readings.is_frozen);
        // Without a plausible sensor the estimate is checked against the limit. A sensor that seems plausible may still be
        // wrong, and tracking would follow it: the model alone keeps the limit as well.
        let displacement_m = if self.last_fault.is_none() { readings.displacement_m } else { readings.predicted_m };
        let shown_m = readings.displacement_m;
        let agrees = self.monitor.agrees(self.command_v, readings.monitor_v);
        let trips = self.on_sensor_fault != OPENS_LOOP;
        let cause = match self.last_fault {
            _ if !readings.interlock_closed => Some(Cause::Interlock),
            _ if readings.monitor_v > self.monitored_v => Some(Cause::Voltage),
            _ if !agrees && self.monitor.falls_too_often() => Some(Cause::Arcs),
            _ if !agrees => Some(Cause::Monitor),
            Some(fault) if trips => Some(Cause::Sensor(fault)),
            _ if beyond(displacement_m, self.max_displacement_m) => Some(Cause::Displacement),
            // The estimate continues without such a sensor, but its reading may still be the film's.
            Some(_) if self.sensor.is_in_range(shown_m) && beyond(shown_m, self.max_displacement_m) => {
                Some(Cause::Displacement)
            }
            _ if beyond(readings.open_loop_m, self.max_displacement_m) => Some(Cause::ModelDisplacement),
            _ if beyond(readings.disturbance_share, self.max_disturbance_share) => Some(Cause::Disturbance),
            _ if self.ticks_since_heartbeat > self.heartbeat_ticks => Some(Cause::Heartbeat),
            _ => None,
        };
        if let (true, Some(cause)) = (self.enables(), cause) {
            self.trip(cause);
        }
        self.check_film_at_0_v();
        let displacement_m = if self.last_fault.is_none() { Some(readings.displacement_m) } else { None };
        Tick { state: self.state, displacement_m }
    }

    /// Only the monitor shows that a disabled amplifier is really off: an enable input that is welded, or wired to
    /// nothing, shows here alone. This outranks the cause that disabled it.
    fn check_film_at_0_v(&mut self) {
        if self.enables() {
            return;
        }
        let max_live_ticks = self.discharge_ticks.saturating_mul(LIVE);
        if self.is_film_live() {
            // No more than it takes to trip.
            if self.live_ticks <= max_live_ticks {
                self.live_ticks = self.live_ticks.saturating_add(LIVE);
            }
            self.missing_at_0_v = self.discharge_ticks;
        } else if self.is_at_0_v() {
            self.live_ticks = self.live_ticks.saturating_sub(1);
            self.missing_at_0_v = self.missing_at_0_v.saturating_sub(1);
        }
        // Unknown otherwise: a monitor that does not answer proves nothing.
        if self.live_ticks > max_live_ticks && self.state != DriverState::Tripped(Cause::LiveFilm) {
            self.state = DriverState::Disarmed;
            self.trip(Cause::LiveFilm);
            self.missing_at_0_v = self.discharge_ticks;
        }
    }

    /// The largest voltage that bench, field and the way of arming allow, V.
    #[inline]
    pub(crate) fn most_v(&self, thinning: f32) -> f32 {
        let by_field = if thinning > 1.0 { self.field_v / thinning } else { self.field_v };
        if by_field < self.armed_for_v { by_field } else { self.armed_for_v }
    }

    /// The command (V) of this tick for `wanted_v`: 0 V unless running, towards 0 V for NaN; between 0 V and the largest voltage that
    /// bench, field and the way of [arming](Self::arm_for_self_test) allow; no faster than the slew, except where the field limit requires
    /// it. `thinning` is the film's thickness at rest over its present one.
    ///
    /// The field limit of a thinned film is computed here on purpose, independently of the control law's own copy of that rule
    /// (`springpot`): an error there must not raise the limit here.
    pub fn command(&mut self, wanted_v: f32, thinning: f32) -> f32 {
        self.command_v = if matches!(self.state, DriverState::Running) {
            let most = self.most_v(thinning);
            let wanted = if wanted_v > 0.0 { wanted_v } else { 0.0 };
            let slewed = self.command_v + bounded(wanted - self.command_v, self.slew_v_per_tick);
            if slewed < most { slewed } else { most }
        } else {
            0.0
        };
        self.command_v
    }
}

/// Whether `value` is beyond `limit` to either side, or NaN.
fn beyond(value: f32, limit: f32) -> bool {
    let within = value.abs() <= limit;
    !within
}
