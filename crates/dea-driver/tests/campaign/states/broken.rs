//! Supervisors that are broken on purpose, each in one way: the search finds what is wrong with them.

use dea_driver::{Cause, DriverState, OnSensorFault, Readings, Refusal, Supervisor};

use super::{Machine, Node, Request, classes, limits, steps};
use crate::explore::explore;

/// A supervisor that is broken on purpose, in one way.
macro_rules! broken {
    ($name:ident, $request:expr, $tick:expr) => {
        #[derive(Clone)]
        struct $name(Supervisor);

        impl Machine for $name {
            fn with_supervisor(supervisor: Supervisor) -> Self {
                Self(supervisor)
            }

            fn supervisor(&self) -> &Supervisor {
                &self.0
            }

            fn request(&mut self, request: Request) -> Result<(), Refusal> {
                let done = self.0.request(request);
                let broken: fn(&mut Supervisor, Request) = $request;
                broken(&mut self.0, request);
                done
            }

            fn tick(&mut self, readings: Readings, wanted_v: f32) -> f32 {
                let broken: fn(&mut Supervisor, Readings, f32) -> f32 = $tick;
                broken(&mut self.0, readings, wanted_v)
            }
        }
    };
}

// A trip of the interlock is swallowed.
broken!(Swallows, |_, _| (), |supervisor, readings, wanted_v| {
    let before = *supervisor;
    supervisor.check(readings);
    if supervisor.state() == DriverState::Tripped(Cause::Interlock) {
        *supervisor = before;
    }
    supervisor.command(wanted_v, 1.0)
});
// Every tick is a heartbeat.
broken!(StaysAlive, |_, _| (), |supervisor, readings, wanted_v| {
    supervisor.heartbeat();
    supervisor.tick(readings, wanted_v)
});
// What is acknowledged is armed again.
broken!(
    ArmsAgain,
    |supervisor, request| {
        if request == Request::Acknowledge {
            let _ = supervisor.arm();
        }
    },
    |supervisor, readings, wanted_v| supervisor.tick(readings, wanted_v)
);
// A healthy tick ends a trip.
broken!(Forgets, |_, _| (), |supervisor, readings, wanted_v| {
    let command_v = supervisor.tick(readings, wanted_v);
    if readings.monitor_v == 0.0 && supervisor.state() == DriverState::Tripped(Cause::Heartbeat) {
        supervisor.acknowledge().expect("tripped");
    }
    command_v
});

#[test]
fn the_search_finds_what_is_broken() {
    fn violation<M: Machine>() -> String {
        let start = Node::<M>::new(&limits(OnSensorFault::Trip));
        let (violation, path) = explore(start, &steps(classes(1, 2)), |_| ()).expect_err("it is broken");
        println!("states, broken on purpose: {violation}, after {} steps", path.len());
        violation
    }
    assert_eq!(violation::<Swallows>(), "enabled although the interlock is open");
    assert_eq!(violation::<StaysAlive>(), "enabled although the host is silent");
    assert!(violation::<ArmsAgain>().starts_with("Acknowledge leads from"));
    assert!(violation::<Forgets>().starts_with("a tick leads from"));
}
