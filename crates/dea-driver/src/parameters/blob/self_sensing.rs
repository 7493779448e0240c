//! Self-sensing in a blob: its bytes, its checks beside the other parameters, and the limits that it leaves to the law.

#[cfg(feature = "self-sensing")]
mod with_current {
    use springpot::{AmplifierLag, CommandLimits, ObserverOptions};

    use crate::parameters::blob::BlobError;
    use crate::parameters::{ControllerMemory, Parameters, SelfSensor};

    /// Ticks that an observer remembers: an older sample would be ignored.
    const REMEMBERED: u16 = 64;
    /// Blocks until the next sample at the latest, where the drive jumps.
    const MAX_BLOCKS: f32 = 5.0;
    /// Blocks within which a fault is found, and the time that they and a tick may take, s.
    const FINDS_BLOCKS: f64 = 3.0;
    const MAX_FAULT_S: f64 = 0.1;
    /// Relative rounding of numbers that are as large as they may be.
    const ROUNDED: f64 = 1e-4;
    /// Amplitudes of the tone in the range of the voltage: one at each end, and as much for the drive.
    const AMPLITUDES: f32 = 4.0;

    impl SelfSensor {
        /// Most periods of a block at ticks of `step_s` (s), with which a fault of the film or its monitors ends at 0 V within 100 ms; fewer than
        /// [`MIN_PERIODS`](springpot::SelfSensingOptions::MIN_PERIODS) where the ticks are too slow for the film to be its own sensor.
        #[must_use]
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // a negative time has no periods
        pub fn max_periods(step_s: f64) -> u16 {
            let ticks = (1.0 + ROUNDED) * MAX_FAULT_S / step_s - 1.0;
            ((ticks / (4.0 * FINDS_BLOCKS)) as u16).min((REMEMBERED - 5) / 2)
        }

        /// Checks it beside the rest of `parameters`, of a board whose monitor of the current shows up to `current_v` (V).
        #[inline(never)] // as `Parameters::margin`
        #[allow(clippy::cast_possible_truncation, clippy::cast_precision_loss)] // as the limits have it; at most 132
        pub(in crate::parameters) fn check<M: ControllerMemory>(
            &self,
            parameters: &Parameters<M>,
            current_v: Option<f32>,
        ) -> Result<(), BlobError> {
            let current_v = current_v.ok_or(BlobError::NoCurrent)?;
            self.current().check(current_v).map_err(|error| BlobError::Calibration("current monitor", error))?;
            self.sensing().map_err(BlobError::SelfSensing)?;
            let (limits, control, rate_hz) = (&parameters.limits, &parameters.control, parameters.rate_hz);
            let (options, tone_v) = (self.options(), self.tone_v());
            let (step_s, max_current_a) = (options.step_s as f32, options.max_current_a as f32);
            let (interval_s, age_ticks) = (options.sample_interval_s() as f32, options.age_ticks());
            let sensor = ObserverOptions {
                sample_interval_s: options.sample_interval_s(),
                delay_s: options.step_s * age_ticks as f64,
                ..ObserverOptions::at_bandwidth(1.0)
            };
            let AmplifierLag { rise_s, fall_s } = parameters.amplifier_lag;
            let rounded = 1.0 - ROUNDED as f32;
            let slew_v_per_s = options.tone_slew_v_per_s() as f32;
            let field_v_per_m = AMPLITUDES * tone_v * parameters.thinnest() as f32 / limits.thickness_m;
            for (quantity, value, least) in [
                ("rate_hz", rate_hz, 1.0 / step_s),
                ("limits.max_slew_v_per_s", limits.max_slew_v_per_s, slew_v_per_s),
                ("limits.monitor.slew_v_per_s", limits.monitor.slew_v_per_s, slew_v_per_s),
                ("limits.max_voltage_v", limits.max_voltage_v, AMPLITUDES * tone_v),
                ("limits.max_field_v_per_m", limits.max_field_v_per_m, field_v_per_m),
                ("limits.sensor.jump", limits.sensor.jump, control.max_velocity_m_per_s * interval_s),
                ("control.sample_interval_s", control.sample_interval_s, interval_s),
                ("control.lost_after_s", control.lost_after_s, MAX_BLOCKS * interval_s),
            ] {
                if value < rounded * least {
                    return Err(BlobError::SelfSensingNeeds { quantity, value, bound: "at least", limit: least });
                }
            }
            for (quantity, value, most) in [
                ("rate_hz", rate_hz, 1.0 / step_s),
                ("amplifier_lag", rise_s.max(fall_s) as f32, 0.0),
                ("control.bandwidth_hz", control.bandwidth_hz, sensor.max_bandwidth_hz() as f32),
                // The tone swings about the mean, which the monitor must still show.
                (
                    "its max_current_a",
                    max_current_a,
                    0.5 * self.current().apply(current_v).min(-self.current().apply(0.0)),
                ),
                ("its periods", f32::from(options.periods), f32::from((REMEMBERED - 5) / 2)),
            ] {
                if rounded * value > most {
                    return Err(BlobError::SelfSensingNeeds { quantity, value, bound: "at most", limit: most });
                }
            }
            if options.periods > Self::max_periods(options.step_s) {
                return Err(BlobError::SlowSelfSensing {
                    periods: options.periods,
                    rate_hz,
                    taken_s: FINDS_BLOCKS as f32 * interval_s + step_s,
                    limit_s: MAX_FAULT_S as f32,
                });
            }
            Ok(())
        }

        /// Reads it from the begin of `bytes`, and returns the rest.
        #[cfg(feature = "store")]
        pub(in crate::parameters) fn take<'a>(
            place: &mut Option<Self>,
            bytes: &'a [u8],
        ) -> Result<&'a [u8], BlobError> {
            let (sensor, rest) = postcard::take_from_bytes(bytes).map_err(|_| BlobError::Contents)?;
            *place = Some(sensor);
            Ok(rest)
        }

        /// The part of `limits` that the tone leaves to the law: an amplitude less of voltage and field, and as much less of the slew as the tone takes.
        pub(in crate::parameters) fn left_of<M: ControllerMemory>(
            &self,
            limits: CommandLimits,
            parameters: &Parameters<M>,
        ) -> CommandLimits {
            let tone_v = self.options().tone_v;
            let field_v_per_m = tone_v * parameters.thinnest() / parameters.actuator.thickness_m;
            CommandLimits {
                max_voltage_v: limits.max_voltage_v - tone_v,
                max_field_v_per_m: limits.max_field_v_per_m - field_v_per_m,
                max_slew_v_per_s: limits.max_slew_v_per_s - tone_v * f64::from(parameters.rate_hz),
                ..limits
            }
        }
    }

    impl<M: ControllerMemory> Parameters<M> {
        /// How many times thinner than at rest the film is at the end of its stroke.
        fn thinnest(&self) -> f64 {
            let per_m = self.actuator.thinning_per_m().max(1.0 / self.actuator.length_m);
            1.0 + per_m * f64::from(self.limits.max_displacement_m)
        }
    }
}

#[cfg(not(feature = "self-sensing"))]
mod without_current {
    use springpot::CommandLimits;

    use crate::parameters::blob::BlobError;
    use crate::parameters::{ControllerMemory, Parameters, SelfSensor};

    impl SelfSensor {
        pub(in crate::parameters) fn check<M: ControllerMemory>(
            &self,
            _: &Parameters<M>,
            _: Option<f32>,
        ) -> Result<(), BlobError> {
            match *self {}
        }

        /// No bytes hold any.
        #[cfg(feature = "store")]
        pub(in crate::parameters) fn take<'a>(_: &mut Option<Self>, _: &'a [u8]) -> Result<&'a [u8], BlobError> {
            Err(BlobError::NoCurrent)
        }

        pub(in crate::parameters) fn left_of<M: ControllerMemory>(
            &self,
            _: CommandLimits,
            _: &Parameters<M>,
        ) -> CommandLimits {
            match *self {}
        }
    }
}
