//! Orders, and the transitions between states.

use super::{OPENS_LOOP, SelfTest, Supervisor};
use crate::safety::{Cause, DriverState, Refusal};

impl Supervisor {
    /// Enables the amplifier at 0 V.
    ///
    /// # Errors
    ///
    /// [`Refusal`] from another state than disarmed, before the first tick, while the readings of the last tick are not safe, until the
    /// disabled film, if it was live, has been at 0 V for the time of a discharge in one piece, and without a self-test that is
    /// [required](Self::with_self_test_above).
    pub fn arm(&mut self) -> Result<(), Refusal> {
        self.refusals().next().map_or(Ok(()), Err)?;
        self.enable(self.max_voltage_v);
        Ok(())
    }

    /// The same for a self-test, which need not have passed before: the largest voltage is [`SELF_TEST_V`](Self::SELF_TEST_V) until it is
    /// armed again.
    ///
    /// # Errors
    ///
    /// As [`arm`](Self::arm), without that of the self-test.
    pub fn arm_for_self_test(&mut self) -> Result<(), Refusal> {
        self.refusals().find(|&refusal| refusal != Refusal::SelfTest).map_or(Ok(()), Err)?;
        self.enable(self.self_test_v());
        Ok(())
    }

    /// Largest voltage of a self-test, V: enough to be seen at the monitor, too little to move a film.
    pub const SELF_TEST_V: f32 = 500.0;

    pub(super) fn self_test_v(&self) -> f32 {
        self.max_voltage_v.min(Self::SELF_TEST_V)
    }

    fn enable(&mut self, armed_for_v: f32) {
        self.armed_for_v = armed_for_v;
        self.state = DriverState::Armed;
        self.live_ticks = 0;
        self.ticks_since_heartbeat = 0;
        self.monitor.reset();
    }

    /// All reasons for which [`arm`](Self::arm) would be refused now.
    pub fn refusals(&self) -> impl Iterator<Item = Refusal> + use<> {
        let is_live = !self.is_at_0_v() || self.missing_at_0_v > 0;
        let fault = self.last_fault.filter(|_| self.on_sensor_fault != OPENS_LOOP);
        [
            (self.state != DriverState::Disarmed).then_some(Refusal::State(self.state)),
            (!self.interlock_closed).then_some(Refusal::InterlockOpen),
            is_live.then_some(Refusal::LiveVoltage),
            fault.map(Refusal::Sensor),
            (self.self_test == SelfTest::Missing).then_some(Refusal::SelfTest),
        ]
        .into_iter()
        .flatten()
    }

    /// Lets the law command the voltage.
    ///
    /// # Errors
    ///
    /// [`Refusal`] from another state than armed.
    pub fn start(&mut self) -> Result<(), Refusal> {
        self.change(DriverState::Armed, DriverState::Running)
    }

    /// Back to 0 V, amplifier enabled.
    ///
    /// # Errors
    ///
    /// [`Refusal`] from another state than running.
    pub fn stop(&mut self) -> Result<(), Refusal> {
        self.change(DriverState::Running, DriverState::Armed)?;
        // Not only with the next tick: a run may be started before it, and begins at 0 V.
        self.command_v = 0.0;
        Ok(())
    }

    /// Back to 0 V, amplifier disabled. Not an error if disarmed already; a trip stays.
    ///
    /// # Errors
    ///
    /// [`Refusal`] when tripped: acknowledge first.
    pub fn disarm(&mut self) -> Result<(), Refusal> {
        if let DriverState::Tripped(_) = self.state {
            return Err(Refusal::State(self.state));
        }
        self.state = DriverState::Disarmed;
        self.command_v = 0.0;
        Ok(())
    }

    /// Acknowledges a trip: disarmed from now on. The check of the sensor starts again, as if no value had been seen.
    ///
    /// # Errors
    ///
    /// [`Refusal`] if it is not tripped, and for [`Cause::LiveFilm`] until the monitor has shown 0 V for the time of a discharge.
    pub fn acknowledge(&mut self) -> Result<(), Refusal> {
        match self.state {
            DriverState::Tripped(Cause::LiveFilm) if !self.is_at_0_v() || self.missing_at_0_v > 0 => {
                Err(Refusal::LiveVoltage)
            }
            DriverState::Tripped(cause) => {
                self.state = DriverState::Disarmed;
                if cause == Cause::LiveFilm {
                    self.live_ticks = 0;
                }
                self.sensor.reset();
                Ok(())
            }
            other => Err(Refusal::State(other)),
        }
    }

    fn change(&mut self, from: DriverState, to: DriverState) -> Result<(), Refusal> {
        if self.state == from {
            self.state = to;
            Ok(())
        } else {
            Err(Refusal::State(self.state))
        }
    }

    /// The host that armed is alive: its timeout starts again.
    pub fn heartbeat(&mut self) {
        self.ticks_since_heartbeat = 0;
    }

    /// Trips in every state: 0 V, amplifier disabled. The first cause stays.
    pub fn trip(&mut self, cause: Cause) {
        self.command_v = 0.0;
        if !matches!(self.state, DriverState::Tripped(_)) {
            self.state = DriverState::Tripped(cause);
            self.tripped_at = self.ticks;
        }
    }
}
