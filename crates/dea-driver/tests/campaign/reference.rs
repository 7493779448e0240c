//! A reference machine of the driver's states, written from the documentation: the diagram at `DriverState`, the comments of `Cause`,
//! `Refusal`, `Limits`, `Monitor` and `Plausibility`, doc/link.md. It knows nothing of the supervisor's fields.
//!
//! The documentation does not say which of several faults in one tick becomes the cause. The reference names all of them; the driver
//! must take one.

use std::collections::VecDeque;

use dea_driver::{Cause, DriverState, Limits, OnSensorFault, Readings, Refusal, SensorFault};

/// Good values in a row after which an implausible sensor counts as plausible again.
const RETURN_TICKS: u32 = 10;
/// A tick of the monitor outside its band is made up for by this many inside.
const MADE_UP_BY: f64 = 16.0;

/// An arc falls below this share of the lowest voltage that agrees.
const ARC_SHARE: f64 = 0.75;
/// Time after the settling time of an arc in which there must be no other, s.
const QUIET_S: f32 = 0.5;

#[derive(Clone, Debug)]
pub struct Reference {
    limits: Limits,
    rate_hz: f64,
    heartbeat_ticks: u64,
    discharge_ticks: i64,
    pub state: DriverState,
    pub ticks: u64,
    pub tripped_at: u64,
    pub command_v: f64,
    /// Ticks since the last request of the host that armed.
    pub silent_ticks: u64,
    /// Readings of the last tick.
    pub readings: Option<Readings>,
    pub sensor_faults: Vec<SensorFault>,
    /// Time with the amplifier disabled and voltage at the monitor, in ticks, less a quarter of that at 0 V.
    live_ticks: f64,
    /// For how many ticks it has been at 0 V since it was live, if it was.
    quiet_ticks: Option<i64>,
    monitor: MonitorReference,
    sensor: SensorReference,
}

#[derive(Clone, Debug, Default)]
struct MonitorReference {
    /// The voltages where an amplifier may be that has its slew or more, V.
    possible_v: [f64; 2],
    /// Ticks outside the band that have not been made up for.
    outside: f64,
    /// The last reading, V.
    shown_v: f64,
    /// Ticks since an arc began.
    since_arc: Option<u64>,
    arced_again: bool,
    /// Ticks of the falls of this run that did not belong to the one before.
    falls: Vec<u64>,
    ticks: u64,
    fallen_often: bool,
}

#[derive(Clone, Debug, Default)]
struct SensorReference {
    shown: Option<f32>,
    repeats: u32,
    /// Good values in a row since the last fault; none without a fault.
    returning: Option<(SensorFault, u32)>,
}

fn ticks(seconds: f32, rate_hz: f64) -> u64 {
    (f64::from(seconds) * rate_hz).round() as u64
}

impl Reference {
    pub fn new(limits: &Limits, rate_hz: f32) -> Self {
        let rate_hz = f64::from(rate_hz);
        Self {
            limits: *limits,
            rate_hz,
            heartbeat_ticks: ticks(limits.heartbeat_s, rate_hz),
            discharge_ticks: ticks(limits.discharge_s, rate_hz) as i64,
            state: DriverState::Disarmed,
            ticks: 0,
            tripped_at: 0,
            command_v: 0.0,
            silent_ticks: 0,
            readings: None,
            sensor_faults: Vec::new(),
            live_ticks: 0.0,
            quiet_ticks: None,
            monitor: MonitorReference::default(),
            sensor: SensorReference::default(),
        }
    }

    /// That of other parameters with the same limits, on the amplifier that was driven `before`.
    pub fn after(before: &Self, rate_hz: f32) -> Self {
        let is_missing = before.quiet_ticks.is_some_and(|ticks| ticks < before.discharge_ticks);
        Self {
            live_ticks: before.live_ticks,
            quiet_ticks: is_missing.then_some(0),
            ..Self::new(&before.limits, rate_hz)
        }
    }

    fn at_0_v(&self) -> bool {
        self.readings.is_some_and(|readings| readings.monitor_v.abs() <= self.limits.monitor.band_v)
    }

    /// At 0 V, and for as long as a discharge takes since it was last live without reason.
    fn is_quiet(&self) -> bool {
        self.at_0_v() && self.quiet_ticks.is_none_or(|ticks| ticks >= self.discharge_ticks)
    }

    pub fn arm(&mut self) -> Result<(), Refusal> {
        if self.state != DriverState::Disarmed {
            return Err(Refusal::State(self.state));
        }
        if !self.readings.is_some_and(|readings| readings.interlock_closed) {
            return Err(Refusal::InterlockOpen);
        }
        if !self.is_quiet() {
            return Err(Refusal::LiveVoltage);
        }
        if self.limits.on_sensor_fault == OnSensorFault::Trip
            && let Some(&fault) = self.sensor_faults.first()
        {
            return Err(Refusal::Sensor(fault));
        }
        self.state = DriverState::Armed;
        (self.live_ticks, self.quiet_ticks) = (0.0, None);
        self.silent_ticks = 0;
        self.monitor = MonitorReference::default();
        Ok(())
    }

    pub fn start(&mut self) -> Result<(), Refusal> {
        self.leave(DriverState::Armed, DriverState::Running)
    }

    pub fn stop(&mut self) -> Result<(), Refusal> {
        self.leave(DriverState::Running, DriverState::Armed)?;
        // A run that is started before the next tick begins at 0 V as well.
        self.command_v = 0.0;
        Ok(())
    }

    fn leave(&mut self, from: DriverState, to: DriverState) -> Result<(), Refusal> {
        if self.state != from {
            return Err(Refusal::State(self.state));
        }
        self.state = to;
        Ok(())
    }

    pub fn disarm(&mut self) -> Result<(), Refusal> {
        if let DriverState::Tripped(_) = self.state {
            return Err(Refusal::State(self.state));
        }
        self.state = DriverState::Disarmed;
        self.command_v = 0.0;
        Ok(())
    }

    pub fn acknowledge(&mut self) -> Result<(), Refusal> {
        match self.state {
            DriverState::Tripped(Cause::LiveFilm) if !self.is_quiet() => Err(Refusal::LiveVoltage),
            DriverState::Tripped(cause) => {
                self.state = DriverState::Disarmed;
                if cause == Cause::LiveFilm {
                    self.live_ticks = 0.0;
                }
                self.sensor = SensorReference::default();
                Ok(())
            }
            other => Err(Refusal::State(other)),
        }
    }

    pub fn heartbeat(&mut self) {
        self.silent_ticks = 0;
    }

    pub fn trip(&mut self, cause: Cause) {
        self.command_v = 0.0;
        if !matches!(self.state, DriverState::Tripped(_)) {
            self.state = DriverState::Tripped(cause);
            self.tripped_at = self.ticks;
        }
    }

    /// A tick. `taken` is the driver's state after it, to which the machine goes if that is one of those it can go to.
    ///
    /// # Errors
    ///
    /// The states to which it can go, none of which is `taken`.
    pub fn check(&mut self, readings: Readings, taken: DriverState) -> Result<(), Vec<DriverState>> {
        self.ticks += 1;
        self.silent_ticks += 1;
        self.readings = Some(readings);
        self.sensor_faults = self.sensor.check(&self.limits, &readings);
        let agrees = self.monitor.agrees(&self.limits, self.rate_hz, self.command_v, readings.monitor_v);
        let mut possible = vec![self.state];
        if self.state.is_live() {
            let causes = self.causes(&readings, agrees);
            if !causes.is_empty() {
                possible = causes.into_iter().map(DriverState::Tripped).collect();
            }
        }
        if !possible[0].is_live() {
            let allowed = self.discharge_ticks as f64;
            if readings.monitor_v.abs() > self.limits.monitor.band_v {
                // What counts is whether the film has been live for longer than it may be, not for how much longer.
                if self.live_ticks <= allowed {
                    self.live_ticks += 1.0;
                }
                self.quiet_ticks = Some(0);
            } else if self.at_0_v() {
                self.live_ticks = (self.live_ticks - 0.25).max(0.0);
                self.quiet_ticks = self.quiet_ticks.map(|ticks| ticks + 1);
            }
            if self.live_ticks > allowed {
                possible = vec![DriverState::Tripped(Cause::LiveFilm)];
                if self.state != possible[0] {
                    self.quiet_ticks = Some(0);
                }
            }
        }
        if !possible.contains(&taken) {
            return Err(possible);
        }
        if taken != self.state {
            self.tripped_at = self.ticks;
            self.command_v = 0.0;
        }
        self.state = taken;
        Ok(())
    }

    /// The same; goes there.
    pub fn follow(&mut self, readings: Readings, taken: DriverState) {
        let before = self.state;
        if let Err(possible) = self.check(readings, taken) {
            panic!("tick {}: {before:?} leads to {taken:?} instead of {possible:?}: {readings:?}", self.ticks);
        }
    }

    /// Checks that an answer is as expected; of several faults of the sensor any.
    pub fn same(&self, done: Result<(), Refusal>, expected: Result<(), Refusal>) {
        match (done, expected) {
            (Err(Refusal::Sensor(found)), Err(Refusal::Sensor(_))) => {
                assert!(self.sensor_faults.contains(&found), "{found:?}");
            }
            (done, expected) => assert_eq!(done, expected),
        }
    }

    fn causes(&self, readings: &Readings, agrees: bool) -> Vec<Cause> {
        let limits = &self.limits;
        let mut causes = Vec::new();
        let mut fault = |is: bool, cause| {
            if is {
                causes.push(cause);
            }
        };
        let beyond = |value: f32, limit: f32| value.is_nan() || value.abs() > limit;
        fault(!readings.interlock_closed, Cause::Interlock);
        fault(readings.monitor_v > limits.monitored_v(), Cause::Voltage);
        fault(!agrees, if self.monitor.fallen_often { Cause::Arcs } else { Cause::Monitor });
        fault(self.silent_ticks > self.heartbeat_ticks, Cause::Heartbeat);
        fault(beyond(readings.open_loop_m, limits.max_displacement_m), Cause::ModelDisplacement);
        fault(beyond(readings.disturbance_share, limits.max_disturbance_share), Cause::Disturbance);
        let plausible = self.sensor_faults.is_empty();
        let displacement_m = if plausible { readings.displacement_m } else { readings.predicted_m };
        // In its range, a sensor keeps the stroke whether it is plausible or not.
        let shown_m = readings.displacement_m;
        let shows =
            (limits.sensor.low..=limits.sensor.high).contains(&shown_m) && shown_m.abs() > limits.max_displacement_m;
        fault(shows || beyond(displacement_m, limits.max_displacement_m), Cause::Displacement);
        if limits.on_sensor_fault == OnSensorFault::Trip {
            self.sensor_faults.iter().for_each(|&kind| fault(true, Cause::Sensor(kind)));
        }
        causes
    }

    /// The command of a tick, V.
    pub fn command(&mut self, wanted_v: f32, thinning: f32) -> f64 {
        self.command_v = if self.state == DriverState::Running {
            let limits = &self.limits;
            let field_v = f64::from(limits.max_field_v_per_m) * f64::from(limits.thickness_m);
            let most = f64::from(limits.max_voltage_v).min(field_v / f64::from(thinning).max(1.0));
            let slew = f64::from(limits.max_slew_v_per_s) / self.rate_hz;
            let wanted = f64::from(wanted_v).max(0.0);
            wanted.clamp(self.command_v - slew, self.command_v + slew).min(most)
        } else {
            0.0
        };
        self.command_v
    }
}

impl MonitorReference {
    fn agrees(&mut self, limits: &Limits, rate_hz: f64, command_v: f64, monitor_v: f32) -> bool {
        let monitor_v = f64::from(monitor_v);
        let agreed = self.agreed(limits, rate_hz, command_v);
        self.possible_v = self.next_possible_v(limits, rate_hz, command_v);
        self.outside =
            if agreed.contains(monitor_v) { (self.outside - 1.0 / MADE_UP_BY).max(0.0) } else { self.outside + 1.0 };
        let settle_ticks = ticks(limits.monitor.settle_s, rate_hz);
        self.since_arc = self.since_arc.map(|since| since + 1);
        if agreed.is_arc(monitor_v) {
            match self.since_arc {
                // It belongs to the arc before.
                Some(since) if since <= settle_ticks => {}
                since => {
                    let quiet_ticks = settle_ticks + ticks(QUIET_S, rate_hz);
                    self.arced_again |= since.is_some_and(|since| since <= quiet_ticks);
                    self.since_arc = Some(0);
                }
            }
        }
        self.ticks += 1;
        let is_next = self.falls.last().is_none_or(|&last| self.ticks - last > settle_ticks);
        if agreed.is_fall(monitor_v) && is_next {
            self.falls.push(self.ticks);
            // Each is made up for by ten seconds.
            let (level, _) = self.falls.iter().fold((0.0f64, 0), |(level, before), &at| {
                ((level - (at - before) as f64).max(0.0) + 10.0 * rate_hz, at)
            });
            self.fallen_often |= level > 60.0 * rate_hz || self.falls.len() > 30;
        }
        self.shown_v = monitor_v;
        self.outside <= settle_ticks as f64 && !self.arced_again && !self.fallen_often
    }

    /// Each voltage has moved towards the command, by the slew or by more.
    fn next_possible_v(&self, limits: &Limits, rate_hz: f64, command_v: f64) -> [f64; 2] {
        let slew = f64::from(limits.monitor.slew_v_per_s) / rate_hz;
        let slowest = self.possible_v.map(|volts| volts + (command_v - volts).clamp(-slew, slew));
        [slowest[0].min(command_v), slowest[1].max(command_v)]
    }

    /// The voltages that are possible in the next tick, or were when a converter sampled a tick ago, and the band around them, V.
    fn agreed(&self, limits: &Limits, rate_hz: f64, command_v: f64) -> Agreed {
        let ([low, high], [low_before, high_before]) =
            (self.next_possible_v(limits, rate_hz, command_v), self.possible_v);
        let (low_v, high_v) = (low.min(low_before), high.max(high_before));
        let band_v = f64::from(limits.monitor.band_v) + f64::from(limits.monitor.band_share) * high_v;
        Agreed { low_v, high_v, band_v, fallen_v: self.shown_v - band_v }
    }
}

/// Voltages that agree in a tick, V.
struct Agreed {
    low_v: f64,
    high_v: f64,
    band_v: f64,
    /// A reading below has fallen.
    fallen_v: f64,
}

impl Agreed {
    fn contains(&self, monitor_v: f64) -> bool {
        (self.low_v - self.band_v..=self.high_v + self.band_v).contains(&monitor_v)
    }

    fn deep_v(&self) -> f64 {
        ARC_SHARE * self.low_v - self.band_v
    }

    fn is_arc(&self, monitor_v: f64) -> bool {
        self.is_fall(monitor_v) && monitor_v < self.deep_v()
    }

    fn is_fall(&self, monitor_v: f64) -> bool {
        (monitor_v < self.fallen_v || self.fallen_v.is_nan()) && monitor_v < self.low_v - self.band_v
    }
}

impl Reference {
    /// Whether single precision may decide otherwise about this voltage of the monitor.
    pub fn is_on_the_edge(&self, monitor_v: f32) -> bool {
        let agreed = self.monitor.agreed(&self.limits, self.rate_hz, self.command_v);
        let edges = [agreed.low_v - agreed.band_v, agreed.high_v + agreed.band_v, agreed.deep_v(), agreed.fallen_v];
        edges.iter().any(|edge| (f64::from(monitor_v) - edge).abs() < 0.1)
    }
}

impl SensorReference {
    /// Every reason why the sensor is implausible in this tick.
    fn check(&mut self, limits: &Limits, readings: &Readings) -> Vec<SensorFault> {
        let sensor = &limits.sensor;
        let value = readings.displacement_m;
        let before = self.shown.replace(value);
        let near = |other: f32| (value - other).abs() <= sensor.jump;
        let mut faults = VecDeque::new();
        if !(sensor.low..=sensor.high).contains(&value) {
            faults.push_back(SensorFault::Range);
        }
        if before.is_some_and(|before| !near(before)) {
            faults.push_back(SensorFault::Jump);
        }
        self.repeats =
            if before.is_some_and(|before| before.to_bits() == value.to_bits()) { self.repeats + 1 } else { 0 };
        if self.repeats >= sensor.stuck_ticks || readings.is_frozen {
            faults.push_back(SensorFault::Stuck);
        }
        if let Some(&fault) = faults.front() {
            self.returning = Some((fault, 0));
            return faults.into();
        }
        if let Some((fault, good)) = self.returning {
            let good = if near(readings.predicted_m) { good + 1 } else { 0 };
            self.returning = (good < RETURN_TICKS).then_some((fault, good));
        }
        self.returning.iter().map(|&(fault, _)| fault).collect()
    }
}
