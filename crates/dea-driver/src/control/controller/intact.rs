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

    /// Takes constants of a part over from another controller, as if bits had flipped.
    #[cfg(test)]
    pub(crate) fn flip_to(&mut self, other: &Self, part: usize) {
        match part {
            0 => self.parameters.law = other.parameters.law.clone(),
            1 => self.parameters.rate_hz = other.parameters.rate_hz,
            2 => self.parameters.sensor = other.parameters.sensor.clone(),
            3 => self.parameters.limits = other.parameters.limits,
            4 => self.follower = other.follower.clone(),
            5 => self.watched = other.watched.clone(),
            _ => self.lags = other.lags,
        }
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
