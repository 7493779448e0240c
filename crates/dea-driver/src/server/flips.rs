//! Tests of constants that change in memory.

use springpot::{Actuator, Law, LawOptions, Preset};

use crate::server::{Board, Device, Session};
use crate::{Blob, Cause, Controller, DriverState, Parameters, RamFlash, Store};

/// A board whose image does not change.
struct Bench(Device, Store<RamFlash>);

impl Board for Bench {
    type Flash = RamFlash;
    const ID: u16 = 7;

    fn with<R>(&mut self, work: impl FnOnce(&mut Device) -> R) -> (R, u32) {
        (work(&mut self.0), 0)
    }

    fn rates_hz(&self) -> (f32, f32) {
        (100.0, 2000.0)
    }

    fn store(&mut self) -> &mut Store<RamFlash> {
        &mut self.1
    }

    fn set_rate(&mut self, _: f32) {}
}

fn controller(preset: Preset, rate_hz: f64, change: fn(&mut Parameters)) -> Controller {
    let law = Law::compressed(&preset.model().expect("valid"), LawOptions::at_step(1.0 / rate_hz)).expect("valid");
    let mut parameters = Parameters::bench(&law, Actuator::KARNER_2022);
    change(&mut parameters);
    Controller::new(Blob::new(parameters).expect("valid"))
}

/// Within as many turns of the background as there are parts, whichever has changed.
#[test]
fn a_constant_that_changes_is_latched() {
    let other = controller(Preset::TABLE3_N1, 500.0, |p| {
        p.amplifier_lag.fall_s = 0.1;
        (p.sensor, p.limits.max_voltage_v) = (p.sensor.less(1e-6), 5000.0);
    });
    for part in 0..7 {
        let mut bench = Bench(Device::new(None), Store::new(RamFlash::default(), Bench::ID).expect("two slots"));
        bench.0.install(controller(Preset::TABLE3_N2, 1000.0, |_| ())).expect("nothing is enabled");
        let mut session = Session::new("");
        let mut checked = |bench: &mut Bench| {
            (0..7).for_each(|_| assert!(!session.turn(core::iter::empty(), bench, |_| ())));
            bench.0.state()
        };
        assert_eq!(checked(&mut bench), DriverState::Disarmed);
        bench.0.flip(|controller| controller.flip_to(&other, part));
        assert_eq!(checked(&mut bench), DriverState::Tripped(Cause::Memory), "part {part}");
    }
}
