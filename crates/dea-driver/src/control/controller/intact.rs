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
