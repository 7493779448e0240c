//! A controller once there are parameters, and the data that outlive it.

use heapless::{Deque, String, Vec};
use springpot::Compressed;

use crate::chips::Drive;
use crate::control::{
    AdaptationOrder, AdaptationStatus, Controller, FlightRecord, Inputs, LearningOrder, Mode, SetpointError, Telemetry,
};
use crate::parameters::{ControllerMemory, Parameters};
use crate::safety::{Cause, DriverState, Refusal, Supervisor};
use crate::wire::{Answer, Inspection, REFUSALS, Reject, Status};

/// Records that wait for the link.
const WAITING: usize = 16;
/// Longest time of a turn of the background's loop, s: it waits for the line, and steps the loop test.
const BACKGROUND_S: f32 = 0.5;
/// Ticks per second until there are parameters.
const RATE_HZ: f32 = 1000.0;

/// A controller, once there are parameters, and the data that outlive it: the cause that ended the last run, and the stream of records to
/// the host.
///
/// Shared by the tick, which must not wait, and the [`Session`](crate::server::Session) with the host.
///
/// ```
/// use dea_driver::{Blob, Cause, Controller, Device, Drive, DriverState, Inputs, Parameters};
/// use springpot::{Actuator, Law, LawOptions, Preset};
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// // The watchdog has reset the board: the cause stays until a host acknowledges it.
/// let mut device = Device::new(Some(Cause::Watchdog));
/// let inputs = Inputs { interlock_closed: true, monitor_adc_v: Some(0.0), sensor_adc_v: Some(1.0) };
/// assert_eq!(device.tick(inputs), Drive::OFF);
///
/// let law: Law<f32> = Law::compressed(&Preset::TABLE3_N2.model()?, LawOptions::at_step(1e-3))?;
/// let blob = Blob::new(Parameters::bench(&law, Actuator::KARNER_2022))?;
/// device.install(Controller::new(blob)).expect("the amplifier is disabled");
/// assert_eq!(device.state(), DriverState::Tripped(Cause::Watchdog));
/// assert!(!device.tick(inputs).enable);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct Device<M: ControllerMemory = Compressed<f32>> {
    controller: Option<Controller<M>>,
    /// Why the last run ended, until it is acknowledged.
    latched: Option<Cause>,
    /// Whether older parameters are in use than were saved last, and no host has acknowledged that.
    parameters_lost: bool,
    /// The next part of the controller whose memory is checked.
    checked: u8,
    /// Ticks since the background's last sign of life.
    ticks_alone: u32,
    /// Whether the last tick enabled the amplifier, and the one before.
    enabled: bool,
    enabled_before: bool,
    /// State of the board's parts, as last reported.
    inspection: Option<Inspection>,
    /// Ticks since a self-test has passed.
    since_test: Option<u32>,
    /// Record of the last tick.
    last: Option<Telemetry>,
    stream: Stream,
    /// The controller of whole ticks of the loop test.
    #[cfg(feature = "loop-test")]
    pub(super) test: Option<Controller<M>>,
}

/// Why a device did not do as asked: as its controller refuses it, or [`Reject::NoParameters`] without one.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Denial {
    /// Not in this state.
    Refused(Refusal),
    /// Not with this value, or not on this board.
    Rejected(Reject),
}

impl From<Refusal> for Denial {
    fn from(refusal: Refusal) -> Self {
        Self::Refused(refusal)
    }
}

impl From<SetpointError> for Denial {
    fn from(error: SetpointError) -> Self {
        match error {
            SetpointError::OutOfRange => Self::Rejected(Reject::Value),
            SetpointError::NotLive(state) => Self::Refused(Refusal::State(state)),
        }
    }
}

impl From<Denial> for Answer {
    fn from(denial: Denial) -> Self {
        match denial {
            Denial::Refused(refusal) => Self::Refused(refusal),
            Denial::Rejected(reject) => Self::Rejected(reject),
        }
    }
}

impl Device {
    /// A device without parameters. `latched` is why the run before ended, unless it was switched off.
    #[must_use]
    pub const fn new(latched: Option<Cause>) -> Self {
        Self::with_memory(latched)
    }
}

#[allow(clippy::missing_errors_doc)] // of requests: see [`Denial`]
impl<M: ControllerMemory> Device<M> {
    /// As [`new`](Device::new), for controllers whose law has the memory `M`.
    #[must_use]
    pub const fn with_memory(latched: Option<Cause>) -> Self {
        Self {
            controller: None,
            latched,
            parameters_lost: false,
            checked: 0,
            ticks_alone: 0,
            enabled: false,
            enabled_before: false,
            inspection: None,
            since_test: None,
            last: None,
            stream: Stream::new(),
            #[cfg(feature = "loop-test")]
            test: None,
        }
    }

    /// The controller, once there are parameters.
    #[must_use]
    pub fn controller(&self) -> Option<&Controller<M>> {
        self.controller.as_ref()
    }

    /// Checks that the amplifier is disabled, so that parameters may change.
    ///
    /// # Errors
    ///
    /// [`Refusal::State`] while it is enabled.
    pub fn is_off(&self) -> Result<(), Refusal> {
        match self.state() {
            state if state.is_live() => Err(Refusal::State(state)),
            _ => Ok(()),
        }
    }

    /// Ticks with `controller` from now on. A trip stays until it is acknowledged, and the state of the film is that of the old controller.
    ///
    /// # Errors
    ///
    /// [`Refusal::State`] while the amplifier is enabled; the old controller stays.
    pub fn install(&mut self, mut controller: Controller<M>) -> Result<(), Refusal> {
        self.is_off()?;
        if let DriverState::Tripped(cause) = self.state() {
            controller.trip(cause);
        }
        if let Some(before) = &self.controller {
            controller.take_film_of(before);
        }
        if self.since_test.is_some() {
            controller.note_self_test();
        }
        // Moved once: a copy is several kilobytes of a chip's stack. Sealed where it stays.
        self.controller.insert(controller).seal();
        #[cfg(feature = "loop-test")]
        {
            self.test = None;
        }
        Ok(())
    }

    /// The state; without a controller, disarmed, or tripped by the cause that ended the last run.
    #[must_use]
    pub fn state(&self) -> DriverState {
        let before = self.latched.map_or(DriverState::Disarmed, DriverState::Tripped);
        self.controller.as_ref().map_or(before, |controller| controller.supervisor().state())
    }

    /// Trips if armed or running.
    pub fn trip(&mut self, cause: Cause) {
        if let Some(controller) = self.controller.as_mut().filter(|controller| controller.supervisor().enables()) {
            controller.trip(cause);
        }
    }

    /// Trips and latches a fault of the board itself, in every state, also without parameters. To be called for as long as the fault lasts;
    /// after the outputs of a tick it acts in the next one.
    pub fn latch(&mut self, cause: Cause) {
        match &mut self.controller {
            Some(controller) => controller.trip(cause),
            None => self.latched = self.latched.or(Some(cause)),
        }
    }

    /// Reports that the background, which serves the host, is alive: to be called once in every turn of its loop.
    pub fn background_is_running(&mut self) {
        self.ticks_alone = 0;
    }

    /// Checks a part of the constants in memory, and latches [`Cause::Memory`] if it has changed. To be called in every turn of the
    /// background, as [`Session::turn`](crate::server::Session::turn) does.
    pub fn check_memory(&mut self) {
        self.checked = self.checked.wrapping_add(1);
        if self.controller.as_ref().is_some_and(|controller| !controller.is_intact(self.checked)) {
            self.latch(Cause::Memory);
        }
    }

    /// Changes the controller in memory, as bits that flip do.
    #[cfg(test)]
    pub(crate) fn flip(&mut self, change: impl FnOnce(&mut Controller<M>)) {
        self.controller.as_mut().map(change);
    }

    /// Whether the background has been alive within half a second. Otherwise the tick must not feed the watchdog: a host could not stop the
    /// board.
    #[must_use]
    pub fn background_is_alive(&self) -> bool {
        #[allow(clippy::cast_precision_loss)] // compared, not counted
        let alone = self.ticks_alone as f32;
        alone <= BACKGROUND_S * self.rate_hz()
    }

    /// Ticks per second; 1000 until there are parameters.
    #[must_use]
    pub fn rate_hz(&self) -> f32 {
        self.controller.as_ref().map_or(RATE_HZ, |controller| controller.parameters().rate_hz)
    }

    /// [`Controller::note_current`]: before each tick of a board with a monitor of the current.
    #[cfg(feature = "self-sensing")]
    pub fn note_current(&mut self, adc_v: Option<f32>) {
        if let Some(controller) = &mut self.controller {
            controller.note_current(adc_v);
        }
    }

    /// One tick.
    pub fn tick(&mut self, inputs: Inputs) -> Drive {
        self.ticks_alone = self.ticks_alone.saturating_add(1);
        self.enabled_before = self.enabled;
        self.since_test = self.since_test.map(|ticks| ticks.saturating_add(1));
        self.enabled = false;
        let Some(controller) = &mut self.controller else {
            return Drive::OFF;
        };
        let outputs = controller.tick(inputs);
        self.enabled = outputs.enable;
        self.last = Some(outputs.telemetry);
        self.stream.push(outputs.telemetry);
        Drive { enable: outputs.enable, dac_v: outputs.dac_v, range: controller.parameters().command_range }
    }

    /// Stores the state of the board's parts for [`Command::Inspect`](crate::wire::Command::Inspect): to be called after every tick, with
    /// the state when its inputs were sampled. An enable output that differs from the one set by the tick before trips, in every state.
    pub fn report(&mut self, inspection: Inspection) {
        self.inspection = Some(inspection);
        if inspection.enable_high != self.enabled_before {
            self.latch(Cause::Enable);
        }
    }

    /// Last reported state of the board's parts.
    #[must_use]
    pub fn inspection(&self) -> Option<Inspection> {
        self.inspection
    }

    /// Notes that a self-test has passed.
    pub(crate) fn note_self_test(&mut self) -> Result<(), Denial> {
        self.is_off()?;
        self.since_test = Some(0);
        if let Some(controller) = &mut self.controller {
            controller.note_self_test();
        }
        Ok(())
    }

    /// All reasons for which [`arm`](Self::arm) would be refused now, and the time since a self-test has passed, s.
    pub fn preflight(&self) -> Result<(Vec<Refusal, REFUSALS>, Option<u32>), Denial> {
        let controller = self.controller.as_ref().ok_or(Denial::Rejected(Reject::NoParameters))?;
        #[allow(clippy::cast_precision_loss, clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let self_test_s = self.since_test.map(|ticks| (ticks as f32 / self.rate_hz()) as u32); // whole seconds
        Ok((controller.supervisor().refusals().collect(), self_test_s))
    }

    /// The record of the last tick for a flight recorder, with a trip in it; `None` if the amplifier was disabled before and after it.
    #[must_use]
    pub fn flight_record(&self) -> Option<FlightRecord> {
        let telemetry = self.last.as_ref().filter(|_| self.enabled || self.enabled_before)?;
        Some(FlightRecord::new(telemetry, self.state()))
    }

    /// The next record of the stream for the host.
    pub fn telemetry(&mut self) -> Option<Telemetry> {
        self.stream.waiting.pop_front()
    }

    /// The state for the host; the link adds its own counts.
    #[must_use]
    pub fn status(&self) -> Status {
        let supervisor = self.controller.as_ref().map(Controller::supervisor);
        Status {
            state: self.state(),
            rate_hz: self.controller.as_ref().map_or(0.0, |controller| controller.parameters().rate_hz),
            ticks: supervisor.map_or(0, Supervisor::ticks),
            tripped_at: supervisor.map_or(0, Supervisor::tripped_at),
            command_v: supervisor.map_or(0.0, Supervisor::command_v),
            monitor_v: supervisor.map_or(f32::NAN, Supervisor::monitor_v),
            live: supervisor.is_some_and(Supervisor::is_film_live),
            damaged_frames: 0,
            unknown_frames: 0,
            stack_peak: 0,
            lost_bytes: 0,
            falls: supervisor.map_or(0, Supervisor::falls),
        }
    }

    /// The host that armed is alive.
    pub fn heartbeat(&mut self) {
        if let Some(controller) = &mut self.controller {
            controller.heartbeat();
        }
    }

    /// Records every `every`-th tick from now on; 0 ends it.
    pub fn stream(&mut self, every: u16) {
        self.stream = Stream { every, ..Stream::new() };
    }

    /// Older parameters are in use than were saved last. Trips if disarmed; another cause is acknowledged first.
    pub(crate) fn lose_parameters(&mut self) {
        self.parameters_lost = true;
        if let Some(controller) = &mut self.controller {
            controller.trip(Cause::Parameters);
        }
    }

    /// Name and checksum of the parameters.
    pub fn parameters(&self) -> Result<(String<32>, Option<u32>), Denial> {
        let controller = self.controller.as_ref().ok_or(Denial::Rejected(Reject::NoParameters))?;
        Ok((controller.parameters().name.clone(), controller.checksum()))
    }

    /// [`Controller::arm`].
    pub fn arm(&mut self) -> Result<(), Denial> {
        Ok(self.installed()?.arm()?)
    }

    /// [`Controller::arm_for_self_test`].
    pub fn arm_for_self_test(&mut self) -> Result<(), Denial> {
        Ok(self.installed()?.arm_for_self_test()?)
    }

    /// [`Controller::start`].
    pub fn start(&mut self, mode: Mode) -> Result<(), Denial> {
        Ok(self.installed()?.start(mode)?)
    }

    /// [`Controller::stop`].
    pub fn stop(&mut self) -> Result<(), Denial> {
        Ok(self.installed()?.stop()?)
    }

    /// [`Controller::disarm`]; without parameters there is nothing to disarm, and a latched cause refuses it as a trip does.
    pub fn disarm(&mut self) -> Result<(), Denial> {
        match (&mut self.controller, self.latched) {
            (Some(controller), _) => Ok(controller.disarm()?),
            (None, Some(cause)) => Err(Refusal::State(DriverState::Tripped(cause)).into()),
            (None, None) => Ok(()),
        }
    }

    /// [`Controller::acknowledge`]; without parameters, clears the cause that ended the last run. [`Cause::Parameters`] must be
    /// acknowledged by itself.
    pub fn acknowledge(&mut self) -> Result<(), Denial> {
        let acknowledged = self.state();
        match &mut self.controller {
            Some(controller) => {
                controller.acknowledge()?;
                self.parameters_lost &= acknowledged != DriverState::Tripped(Cause::Parameters);
                if self.parameters_lost {
                    controller.trip(Cause::Parameters);
                }
            }
            None if self.latched.is_some() => {}
            None => return Err(Denial::Rejected(Reject::NoParameters)),
        }
        self.latched = None;
        Ok(())
    }

    /// [`Controller::set_voltage`].
    pub fn set_voltage(&mut self, volts: f32) -> Result<(), Denial> {
        Ok(self.installed()?.set_voltage(volts)?)
    }

    /// [`Controller::set_reference`].
    pub fn set_reference(&mut self, metres: f32) -> Result<(), Denial> {
        Ok(self.installed()?.set_reference(metres)?)
    }

    /// [`Controller::order_learning`].
    ///
    /// # Errors
    ///
    /// [`Reject::NoParameters`], and [`Reject::Value`] for parameters without learning.
    pub fn order_learning(&mut self, order: LearningOrder) -> Result<(), Denial> {
        let controller = self.installed()?;
        if controller.parameters().control.harmonics == 0 {
            return Err(Denial::Rejected(Reject::Value));
        }
        controller.order_learning(order);
        Ok(())
    }

    /// [`Controller::order_adaptation`].
    ///
    /// # Errors
    ///
    /// [`Reject::NoParameters`]; [`Reject::Value`] for a level that is not above 0, for parameters without adaptation, and for a
    /// temperature out of range.
    pub fn order_adaptation(&mut self, order: AdaptationOrder) -> Result<(), Denial> {
        let controller = self.installed()?;
        if let AdaptationOrder::Learn { trip_at } = order
            && (trip_at.is_nan() || trip_at <= 0.0 || controller.parameters().control.adaptation_s == 0.0)
        {
            return Err(Denial::Rejected(Reject::Value));
        }
        controller.order_adaptation(order).map_err(|_| Denial::Rejected(Reject::Value))
    }

    /// The parameters in use, with the learned changes of the film.
    ///
    /// # Errors
    ///
    /// [`Reject::NoParameters`]; while the amplifier may be enabled.
    pub fn adapted_parameters(&mut self) -> Result<Parameters<M>, Denial> {
        self.is_off()?;
        self.order_adaptation(AdaptationOrder::Keep)?;
        Ok(self.installed()?.parameters().clone())
    }

    /// [`Controller::adaptation`].
    pub fn adaptation(&self) -> Result<AdaptationStatus, Denial> {
        Ok(self.controller.as_ref().ok_or(Denial::Rejected(Reject::NoParameters))?.adaptation())
    }

    pub(super) fn installed(&mut self) -> Result<&mut Controller<M>, Denial> {
        self.controller.as_mut().ok_or(Denial::Rejected(Reject::NoParameters))
    }
}

/// The record of every n-th tick, as long as there is room.
#[derive(Clone, Debug, Default)]
struct Stream {
    every: u16,
    since: u16,
    dropped: u32,
    waiting: Deque<Telemetry, WAITING>,
}

impl Stream {
    const fn new() -> Self {
        Self { every: 0, since: 0, dropped: 0, waiting: Deque::new() }
    }

    fn push(&mut self, record: Telemetry) {
        if self.every == 0 {
            return;
        }
        self.since += 1;
        if self.since < self.every {
            return;
        }
        self.since = 0;
        let record = Telemetry { dropped: self.dropped, ..record };
        if self.waiting.push_back(record).is_ok() {
            self.dropped = 0;
        } else {
            self.dropped = self.dropped.saturating_add(1);
        }
    }
}
