//! The check that the memory of a controller is as it was.

use crate::control::Controller;
use crate::parameters::{ControllerMemory, digest, digest_of};

/// Parts of a check, one at a time: a tick that becomes due meanwhile waits for it.
const PARTS: usize = 7;

pub(super) type Digests = [u32; PARTS];

impl<M: ControllerMemory> Controller<M> {
    /// From now on the memory is checked.
    pub(crate) fn seal(&mut self) {
        self.digests = Some(self.digests());
    }

    /// Whether a part of the constants is as it was sealed, and the variables are within their bounds; `part` wraps.
    pub(crate) fn is_intact(&self, part: u8) -> bool {
        let part = usize::from(part) % PARTS;
        let sealed = self.digests.as_ref().and_then(|digests| digests.get(part));
        sealed.is_none_or(|&sealed| sealed == self.digest(part))
            && self.supervisor.is_sound()
            && self.motion.is_sound()
            && self.course.compensator().is_sound()
    }

    #[inline(never)] // so that copies of the laws do not stay on the stack of a small chip
    fn digests(&self) -> Digests {
        core::array::from_fn(|part| self.digest(part))
    }

    fn digest(&self, part: usize) -> u32 {
        let p = &self.parameters;
        match part {
            0 => digest(&p.law),
            1 => digest(&(
                &p.name,
                p.rate_hz,
                p.actuator,
                p.sensor_offset_m,
                p.command_range,
                p.amplifier_lag,
                p.control,
                &p.self_sensing,
            )),
            2 => digest(&(&p.amplifier, &p.monitor, &p.sensor)),
            3 => digest(&p.limits),
            4 => digest_of(|fold| M::numbers(&self.follower, fold)),
            5 => digest_of(|fold| {
                self.watched.numbers(fold);
                self.film_sensor.numbers(fold);
            }),
            _ => {
                let scales = [self.thinning_per_m, self.shares_per_n, self.shares_per_m, self.compliance_m_per_n];
                digest(&(self.supervisor.constants(), self.motion.constants(), scales, &self.sensor, self.lags))
            }
        }
    }
}

/// Within as many turns of the background as there are parts, whichever has changed.
#[test]
fn a_constant_that_changes_is_latched() {
    use crate::server::{Board, Session};
    use crate::{Blob, Cause, Device, DriverState, Parameters, RamFlash, Store};
    use springpot::{Actuator, Law, LawOptions, Preset};

    /// One whose image does not change.
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

    let controller = |preset: Preset, rate_hz: f64, change: fn(&mut Parameters)| {
        let law = Law::compressed(&preset.model().expect("valid"), LawOptions::at_step(1.0 / rate_hz)).expect("valid");
        let mut parameters = Parameters::bench(&law, Actuator::KARNER_2022);
        change(&mut parameters);
        Controller::new(Blob::new(parameters).expect("valid"))
    };
    let other = controller(Preset::TABLE3_N1, 500.0, |p| {
        p.amplifier_lag.fall_s = 0.1;
        (p.sensor, p.limits.max_voltage_v) = (p.sensor.less(1e-6), 5000.0);
    });
    let flips: [fn(&mut Controller, &Controller); PARTS] = [
        |flipped, other| flipped.parameters.law = other.parameters.law.clone(),
        |flipped, other| flipped.parameters.rate_hz = other.parameters.rate_hz,
        |flipped, other| flipped.parameters.sensor = other.parameters.sensor.clone(),
        |flipped, other| flipped.parameters.limits = other.parameters.limits,
        |flipped, other| flipped.follower = other.follower.clone(),
        |flipped, other| flipped.watched = other.watched.clone(),
        |flipped, other| flipped.lags = other.lags,
    ];
    for (part, flip) in flips.into_iter().enumerate() {
        let mut bench = Bench(Device::new(None), Store::new(RamFlash::default(), Bench::ID).expect("two slots"));
        bench.0.install(controller(Preset::TABLE3_N2, 1000.0, |_| ())).expect("nothing is enabled");
        let mut session = Session::new("");
        let mut checked = |bench: &mut Bench| {
            (0..PARTS).for_each(|_| assert!(!session.turn(core::iter::empty(), bench, |_| ())));
            bench.0.state()
        };
        assert_eq!(checked(&mut bench), DriverState::Disarmed);
        bench.0.flip(|controller| flip(controller, &other));
        assert_eq!(checked(&mut bench), DriverState::Tripped(Cause::Memory), "part {part}");
    }
}

/// An estimate or a model that is not a number, as bits that flip make it, trips, and is at rest once that is acknowledged.
#[test]
fn a_film_that_is_not_a_number_trips_and_starts_again() {
    use crate::control::Inputs;
    use crate::{Blob, Cause, DriverState, Parameters};
    use springpot::{Actuator, Law, LawOptions, Preset};

    let law = Law::compressed(&Preset::TABLE3_N2.model().expect("valid"), LawOptions::at_step(1e-3)).expect("valid");
    let blob = Blob::new(Parameters::bench(&law, Actuator::KARNER_2022)).expect("valid");
    let flips: [fn(&mut Controller); 2] = [
        |controller| controller.open_loop.move_origin(f32::NAN),
        |controller| {
            let mut film = controller.follower.compensator().observer().law().state();
            film.move_origin(f32::NAN);
            controller.course = controller.follower.state(film);
        },
    ];
    for flip in flips {
        let mut controller = Controller::from(&blob);
        let tick = |controller: &mut Controller| {
            let inputs = Inputs { interlock_closed: true, monitor_adc_v: Some(0.0), sensor_adc_v: Some(1.0) };
            let telemetry = controller.tick(inputs).telemetry;
            (controller.supervisor.state(), telemetry.predicted_m, controller.open_loop.position())
        };
        assert_eq!(tick(&mut controller).0, DriverState::Disarmed);
        flip(&mut controller);
        assert_eq!(tick(&mut controller).0, DriverState::Tripped(Cause::Law));
        controller.acknowledge().expect("tripped");
        let (state, predicted_m, model_m) = tick(&mut controller);
        assert!(state == DriverState::Disarmed && predicted_m.is_finite() && model_m.is_finite());
    }
}
