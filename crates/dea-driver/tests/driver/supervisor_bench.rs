//! A supervisor around a simulated bench, without a controller.

use dea_driver::{Cause, DriverState, Limits, Readings, Refusal, Supervisor};

use crate::bench::readings;

pub const RATE_HZ: f32 = 1000.0;

/// Effect of a fault on the readings of a tick.
pub type Spoil = fn(&mut Readings);

/// A film on a bench: the amplifier follows its command within a tick, the film stretches with V².
pub struct Bench {
    pub supervisor: Supervisor,
    /// The wanted voltage in every tick, V.
    pub wanted_v: f32,
    noise: u32,
}

impl Bench {
    /// Before its first tick, with 4 kV to be asked for.
    pub fn new(limits: &Limits) -> Self {
        let supervisor = Supervisor::new(limits, RATE_HZ).expect("valid");
        Self { supervisor, wanted_v: 4000.0, noise: 1 }
    }

    /// Readings without a fault: the sensor has a few micrometres of noise.
    pub fn healthy(&mut self) -> Readings {
        self.noise = self.noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = (self.noise >> 16) as f32 / 65_536.0 * 5e-6;
        let volts = self.supervisor.command_v();
        let predicted_m = 2e-3 * (volts / 6000.0).powi(2);
        readings(volts, predicted_m + noise, predicted_m)
    }

    /// A tick whose readings `spoil` may alter.
    pub fn tick(&mut self, spoil: impl FnOnce(&mut Readings)) -> DriverState {
        let mut readings = self.healthy();
        spoil(&mut readings);
        let state = self.supervisor.check(readings).state;
        self.supervisor.command(self.wanted_v, 1.0);
        state
    }

    /// Ticks, whose readings `spoil` may alter.
    pub fn ticks(&mut self, count: u32, spoil: impl Fn(&mut Readings)) {
        for _ in 0..count {
            self.tick(&spoil);
        }
    }

    /// Running, at 0 V.
    pub fn started(limits: &Limits) -> Self {
        let mut bench = Self::new(limits);
        bench.tick(|_| ());
        bench.supervisor.arm().expect("healthy");
        bench.supervisor.start().expect("armed");
        bench
    }

    /// Running, at 4 kV.
    pub fn run(limits: &Limits) -> Self {
        let mut bench = Self::started(limits);
        for _ in 0..200 {
            bench.supervisor.heartbeat();
            bench.tick(|_| ());
        }
        assert_eq!(bench.supervisor.state(), DriverState::Running);
        assert_eq!(bench.supervisor.command_v(), 4000.0);
        bench
    }

    /// Spoils every tick until it trips; returns the ticks that took.
    pub fn spoil_until_tripped(&mut self, spoil: impl Fn(&mut Readings), heartbeat: bool) -> u32 {
        for ticks in 1..10_000 {
            if heartbeat {
                self.supervisor.heartbeat();
            }
            if let DriverState::Tripped(_) = self.tick(&spoil) {
                return ticks;
            }
        }
        panic!("never trips");
    }

    /// Asserts that it is at 0 V with this cause, and stays so until it is acknowledged.
    pub fn is_safe(&mut self, cause: Cause) {
        let tripped = DriverState::Tripped(cause);
        let shown = |supervisor: &Supervisor| (supervisor.state(), supervisor.enables(), supervisor.command_v());
        assert_eq!(shown(&self.supervisor), (tripped, false, 0.0));
        // It stays so, whatever is asked for, and whatever happens next.
        self.wanted_v = 6000.0;
        self.tick(|readings| readings.interlock_closed = false);
        assert_eq!(shown(&self.supervisor), (tripped, false, 0.0));
        for request in [Supervisor::arm, Supervisor::start, Supervisor::disarm] {
            assert_eq!(request(&mut self.supervisor), Err(Refusal::State(tripped)));
        }
        // Until it is acknowledged, and even then it has to be armed again.
        self.supervisor.acknowledge().expect("tripped");
        assert_eq!(self.supervisor.state(), DriverState::Disarmed);
        assert_eq!(self.supervisor.command(6000.0, 1.0), 0.0);
    }
}
