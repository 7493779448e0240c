//! The parameters of a board as bytes, as `springpot export` writes them and the `Store` keeps them. The crate's `doc/blob.md` describes
//! the format. No other file reads or writes a blob's header.

use springpot::{
    ActuatorError, Compressed, ControlError, Follower, Law, LawError, Learning, SelfSensingError, Tracking,
};

use crate::chips::{CalibrationError, Converters};
use crate::parameters::{ControllerMemory, Parameters};
use crate::safety::{LimitsError, Supervisor};

/// The newest version of the format, for laws with a spring in series with their memory. Blobs of other laws have an earlier version, which
/// older firmware reads as well.
pub const SCHEMA: u16 = 6;

/// The version of blobs without a spring.
const SCHEMA_WITHOUT_SPRING: u16 = 4;

/// Largest share of its displacement by which the coarser law that watches the stroke may be behind the film.
const MAX_MARGIN: f64 = 0.25;

/// Largest length of a blob, bytes.
pub const BLOB_LEN: usize = 1016;

/// Checked parameters, with the law, control and disarmed supervisor that are built from them.
///
/// ```
/// use dea_driver::{BLOB_LEN, Blob, BlobError, Parameters};
/// use springpot::{Actuator, Law, LawOptions, Preset};
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// const BOARD: u16 = 7;
/// let model = Preset::TABLE3_N2.model()?;
/// let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(1e-3))?;
/// let parameters = Parameters::bench(&law, Actuator::KARNER_2022);
///
/// // A host writes the bytes, a controller reads them.
/// let mut bytes = [0; BLOB_LEN];
/// let length = parameters.encode(BOARD, &mut bytes)?;
/// let blob = Blob::decode(&bytes[..length], BOARD)?;
/// assert_eq!(blob.parameters(), &parameters);
///
/// // Damage and blobs for other boards are refused.
/// assert_eq!(Blob::decode(&bytes[..length], 8).err(), Some(BlobError::Board { found: 7 }));
/// bytes[100] ^= 1;
/// assert_eq!(Blob::decode(&bytes[..length], BOARD).err(), Some(BlobError::Checksum));
/// # Ok(())
/// # }
/// ```
#[doc = include_str!("../../doc/blob.md")]
#[derive(Clone, Debug)]
pub struct Blob<M: ControllerMemory = Compressed<f32>> {
    parameters: Parameters<M>,
    follower: Follower<f32, Tracking<f32, M>>,
    supervisor: Supervisor,
    /// Share of its displacement by which the coarser law that watches the stroke may be behind the film.
    margin: f32,
    checksum: Option<u32>,
}

/// Reasons to refuse a blob.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum BlobError {
    /// Fewer bytes than its header states, or than a header has.
    #[error("the parameter blob is truncated")]
    Truncated,
    /// Not a blob.
    #[error("not a parameter blob")]
    Magic,
    /// Another version of the format.
    #[error("the blob has schema {found}; this firmware reads {SCHEMA_WITHOUT_SPRING} to {SCHEMA}")]
    Schema {
        /// The version found.
        found: u16,
    },
    /// Made for another board.
    #[error("the blob is for board {found}")]
    Board {
        /// The board it is for.
        found: u16,
    },
    /// Longer than a blob can be.
    #[error("longer than {BLOB_LEN} bytes")]
    TooLong,
    /// Damaged: the checksum does not match.
    #[error("the blob is damaged: its checksum does not hold")]
    Checksum,
    /// The checksum holds, but the contents are not parameters.
    #[error("the blob does not hold parameters")]
    Contents,
    /// For a law of another memory.
    #[error(
        "the law in the blob has {} + {} + {} weights, the controller's {} + {} + {}",
        found[0], found[1], found[2], expected[0], expected[1], expected[2]
    )]
    LawSizes {
        /// Head, fast and slow weights of the law in the blob.
        found: [u8; 3],
        /// Those of the controller.
        expected: [u8; 3],
    },
    /// A rate that is not within 1 Hz…100 kHz.
    #[error("rate_hz is {rate_hz}; it must be from 1 to 100000")]
    Rate {
        /// The rate, Hz.
        rate_hz: f32,
    },
    /// An offset of the sensor that is not finite.
    #[error("sensor_offset_m is {offset_m}; it must be finite")]
    Offset {
        /// The offset, m.
        offset_m: f32,
    },
    /// A calibration that was refused, of this instrument.
    #[error("the calibration of the {0}: {1}")]
    Calibration(&'static str, CalibrationError),
    /// A law that was refused.
    #[error("law: {0}")]
    Law(LawError),
    /// An actuator that was refused, on its own or at the largest voltage.
    #[error("actuator: {0}")]
    Actuator(ActuatorError),
    /// Limits above a ceiling of the board, which no parameters raise.
    #[error(
        "limits.{quantity} is {value}, above {ceiling}, the ceiling of this board; lower it: ceilings are part of the board's program"
    )]
    Ceiling {
        /// Name of the limit.
        quantity: &'static str,
        /// The limit.
        value: f32,
        /// The ceiling.
        ceiling: f32,
    },
    /// A voltage above which a self-test is needed that is not finite or negative.
    #[error("self_test_above_v is {above_v}; it must be finite and not negative")]
    SelfTest {
        /// The voltage, V.
        above_v: f32,
    },
    /// Limits that were refused.
    #[error("limits: {0}")]
    Limits(LimitsError),
    /// Settings of the control that were refused.
    #[error("control: {0}")]
    Control(ControlError),
    /// An instrument that ends below the largest voltage of the limits; for the monitor, within its band.
    #[error(
        "the {instrument} reaches {reached_v} V at its full scale of {full_scale_v} V, and the limits need {needed_v} V; correct its \
         calibration or lower limits.max_voltage_v"
    )]
    Reach {
        /// The instrument.
        instrument: &'static str,
        /// Its full scale, V.
        full_scale_v: f32,
        /// The voltage of the film at its full scale, V.
        reached_v: f32,
        /// The voltage of the film that it must reach, V.
        needed_v: f32,
    },
    /// An amplifier that is outside the monitor's band around 0 V at a command of 0 V.
    #[error(
        "the amplifier is at {amplifier_v} V at a command of 0 V, outside limits.monitor.band_v ({band_v} V); correct its calibration \
         or widen the band"
    )]
    Rest {
        /// Its voltage at a command of 0 V, V.
        amplifier_v: f32,
        /// The band, V.
        band_v: f32,
    },
    /// An amplifier so steep that a step of the DAC exceeds the monitor's band.
    #[error(
        "the amplifier: a step of the DAC is {step_v} V at the film, more than limits.monitor.band_v ({band_v} V); correct its \
         calibration or widen the band"
    )]
    Coarse {
        /// Largest step at the film, V.
        step_v: f32,
        /// The band, V.
        band_v: f32,
    },
    /// A limit that is finer than the resolution of the board's converters.
    #[error(
        "limits.{quantity} is {value}, and the converters of this board do not distinguish less than {min} with these calibrations; widen \
         the limit, or spread the instrument's range over that of its converter"
    )]
    Resolution {
        /// Name of the limit.
        quantity: &'static str,
        /// The limit.
        value: f32,
        /// The smallest limit that can be kept.
        min: f32,
    },
    /// Limits for a film of another thickness than the actuator's.
    #[error("limits.thickness_m is {limits_m}, the actuator's thickness_m {actuator_m}; they must agree within 1 %")]
    Thickness {
        /// The thickness of the limits, m.
        limits_m: f32,
        /// The actuator's, m.
        actuator_m: f64,
    },
    /// A film whose stroke the model cannot keep: near pull-in, or behind a curve that is flat there.
    #[error(
        "limits.max_displacement_m is {max_displacement_m} m, where the film is so close to pull-in that its model may be behind it by \
         {margin:.2} of the displacement, more than {MAX_MARGIN}; lower max_displacement_m"
    )]
    Margin {
        /// The largest displacement, m.
        max_displacement_m: f32,
        /// The share.
        margin: f64,
    },
    /// A sensor whose plausible range contains its reading when it is unplugged, 0 V, or saturated.
    #[error(
        "limits.sensor: low to high ({low_m} m to {high_m} m) contains the reading of an unplugged sensor ({unplugged_m} m at 0 V) or \
         of a saturated one ({saturated_m} m at full scale); narrow the range, or correct the calibration or sensor_offset_m"
    )]
    Unplugged {
        /// Its reading when it is unplugged, m.
        unplugged_m: f32,
        /// Its reading when it is saturated, m.
        saturated_m: f32,
        /// Lowest plausible value, m.
        low_m: f32,
        /// Highest plausible value, m.
        high_m: f32,
    },
    /// A sensor that would count as stuck before its samples can show that the film moves.
    #[error(
        "limits.sensor.stuck_ticks is {stuck_ticks}; it must be at least {min_ticks:.1}, which is five times control.delay_s + \
         sample_interval_s"
    )]
    Stuck {
        /// The ticks after which it counts as stuck.
        stuck_ticks: u32,
        /// Fewest ticks in which its samples show that the film moves.
        min_ticks: f32,
    },
    /// Self-sensing on a board without a monitor of the current, or whose program does not have it.
    #[error("self-sensing needs a monitor of the current, which this board has not; leave it out of the parameters")]
    NoCurrent,
    /// Self-sensing that was refused.
    #[error("self-sensing: {0}")]
    SelfSensing(SelfSensingError),
    /// Self-sensing whose blocks are too long for the time within which a fault ends at 0 V.
    #[error(
        "three blocks of self-sensing and a tick take {taken_s:.3} s with {periods} periods at {rate_hz} Hz, {limit_s} s at the most: use fewer periods, or a \
         higher rate_hz"
    )]
    SlowSelfSensing {
        /// Periods of the tone in a block.
        periods: u16,
        /// Ticks per second.
        rate_hz: f32,
        /// Time in which a fault is found, s.
        taken_s: f32,
        /// Longest time, s.
        limit_s: f32,
    },
    /// A value that leaves no room for the tone of self-sensing, or for which the film as a sensor is too slow.
    #[error("{quantity} is {value}; with this self-sensing it must be {bound} {limit}")]
    SelfSensingNeeds {
        /// Name of the value.
        quantity: &'static str,
        /// The value.
        value: f32,
        /// At least or at most.
        bound: &'static str,
        /// The bound.
        limit: f32,
    },
}

impl<M: ControllerMemory> Blob<M> {
    /// Checks `parameters` of a board with [`Converters::AD5754_ADS868X`] and builds law, control and supervisor.
    ///
    /// # Errors
    ///
    /// [`BlobError`] for the first value that is wrong.
    pub fn new(parameters: Parameters<M>) -> Result<Self, BlobError> {
        Self::with_converters(parameters, &Converters::AD5754_ADS868X)
    }

    /// The same for a board with other `converters`.
    #[allow(clippy::missing_errors_doc)] // as the one above
    pub fn with_converters(parameters: Parameters<M>, converters: &Converters) -> Result<Self, BlobError> {
        if !(1.0..=100_000.0).contains(&parameters.rate_hz) {
            return Err(BlobError::Rate { rate_hz: parameters.rate_hz });
        }
        if !parameters.sensor_offset_m.is_finite() {
            return Err(BlobError::Offset { offset_m: parameters.sensor_offset_m });
        }
        let command_v = converters.command_v.unwrap_or(parameters.command_range.full_scale_v());
        for (name, calibration, largest_v) in [
            ("amplifier", &parameters.amplifier, command_v),
            ("monitor", &parameters.monitor, converters.monitor_v),
            ("sensor", &parameters.sensor, converters.sensor_v),
        ] {
            calibration.check(largest_v).map_err(|error| BlobError::Calibration(name, error))?;
        }
        parameters.actuator.check().map_err(BlobError::Actuator)?;
        let step_s = 1.0 / f64::from(parameters.rate_hz);
        let law = M::law(&parameters.law, step_s, parameters.actuator.mass_kg);
        let law = law.map_err(BlobError::Law)?;
        let supervisor = Supervisor::new(&parameters.limits, parameters.rate_hz)
            .and_then(|supervisor| supervisor.behind(parameters.amplifier_lag, parameters.rate_hz))
            .map_err(BlobError::Limits)?
            .with_self_test_above(parameters.self_test_above_v);
        if let Some((quantity, value, ceiling)) =
            parameters.limits.exceeded(&converters.ceilings.within(converters.resolution.reference))
        {
            return Err(BlobError::Ceiling { quantity, value, ceiling });
        }
        let above_v = parameters.self_test_above_v;
        if !(0.0..f32::INFINITY).contains(&above_v) {
            return Err(BlobError::SelfTest { above_v });
        }
        let largest_n = parameters.actuator.electrostatic_force(f64::from(parameters.limits.max_voltage_v));
        let learned = parameters.adapted.map_or(Ok(()), |adapted| adapted.check(largest_n));
        learned.map_err(BlobError::Control)?;
        parameters.check_reach(command_v, converters)?;
        if let Some(sensor) = &parameters.self_sensing {
            sensor.check(&parameters, converters.current_v)?;
        }
        let sensor_m = |volts| parameters.sensor.apply(volts) - parameters.sensor_offset_m;
        let unplugged_v = converters.resolution.sensor * converters.sensor_v;
        let (unplugged_m, saturated_m) = (sensor_m(unplugged_v), sensor_m(converters.sensor_v));
        let (low_m, high_m) = (parameters.limits.sensor.low, parameters.limits.sensor.high);
        if (low_m..=high_m).contains(&unplugged_m) || (low_m..=high_m).contains(&saturated_m) {
            return Err(BlobError::Unplugged { unplugged_m, saturated_m, low_m, high_m });
        }
        let follower = parameters.follower(law)?;
        let margin = parameters.margin(follower.compensator().observer().law())?;
        Ok(Self { parameters, follower, supervisor, margin, checksum: None })
    }

    /// The parameters.
    #[must_use]
    pub fn parameters(&self) -> &Parameters<M> {
        &self.parameters
    }

    /// The checksum of the bytes that it was read from, without [kept changes](Parameters::adapted) of the film; none if it was made of
    /// values.
    #[must_use]
    pub fn checksum(&self) -> Option<u32> {
        self.checksum
    }

    /// The parameters, to alter and check again.
    #[must_use]
    pub fn into_parameters(self) -> Parameters<M> {
        self.parameters
    }

    /// The control law along the law of the film, with learning of periodic references if the parameters ask for it.
    #[must_use]
    pub fn follower(&self) -> &Follower<f32, Tracking<f32, M>> {
        &self.follower
    }

    pub(crate) fn supervisor(&self) -> &Supervisor {
        &self.supervisor
    }

    pub(crate) fn margin(&self) -> f32 {
        self.margin
    }
}

impl<M: ControllerMemory> Parameters<M> {
    /// The control law along `law`.
    #[inline(never)] // as `margin`
    fn follower(&self, law: Law<f32, M>) -> Result<Follower<f32, Tracking<f32, M>>, BlobError> {
        let limits = self.control.command_limits(&self.limits, self.amplifier_lag);
        let limits = self.self_sensing.as_ref().map_or(limits, |sensor| sensor.left_of(limits, self));
        let refused = |error| match error {
            ControlError::Actuator(error) => BlobError::Actuator(error),
            error => BlobError::Control(error),
        };
        let learning = self
            .control
            .learning_options()
            .map(|options| Learning::new(&law, &self.actuator, limits.max_voltage_v, options).map_err(refused));
        let learning = learning.transpose()?;
        let tracking = Tracking::new(law, &self.actuator, limits, self.control.observer_options());
        let follower = Follower::new(tracking.map_err(refused)?);
        Ok(match learning {
            Some(learning) => follower.with_learning(learning),
            None => follower,
        })
    }

    /// The share of its displacement by which the coarser law that watches the stroke may be behind `law`.
    #[inline(never)] // so that the coarser law does not stay on the stack of a small chip
    #[allow(clippy::cast_possible_truncation)] // as the laws have it
    fn margin(&self, law: &Law<f32, M>) -> Result<f32, BlobError> {
        let max_displacement_m = self.limits.max_displacement_m;
        let coupling_per_m = self.actuator.stretch_coupling;
        let margin = law.margin_of(&M::watched(law), f64::from(max_displacement_m), coupling_per_m);
        if margin.is_nan() || margin > MAX_MARGIN {
            return Err(BlobError::Margin { max_displacement_m, margin });
        }
        Ok(margin as f32)
    }

    /// Checks that the instruments cover the range of the limits, and that the limits are for this film.
    fn check_reach(&self, command_v: f32, converters: &Converters) -> Result<(), BlobError> {
        let limits = &self.limits;
        let &Converters { monitor_v, sensor_v, resolution, .. } = converters;
        // A monitor that does not end above the limit could never show that it is exceeded.
        // The last code of the DAC is one step short of full scale.
        for (instrument, full_scale_v, reached_v, needed_v) in [
            ("monitor", monitor_v, self.monitor.apply(monitor_v), limits.monitored_v().next_up()),
            ("amplifier", command_v, self.amplifier.apply(command_v), limits.max_voltage_v),
        ] {
            if reached_v < needed_v {
                return Err(BlobError::Reach { instrument, full_scale_v, reached_v, needed_v });
            }
        }
        let (amplifier_v, band_v) = (self.amplifier.apply(0.0), limits.monitor.band_v);
        if amplifier_v.abs() > band_v {
            return Err(BlobError::Rest { amplifier_v, band_v });
        }
        let step_v = self.amplifier.steepest(command_v) * command_v * resolution.command;
        if step_v > band_v {
            return Err(BlobError::Coarse { step_v, band_v });
        }
        let shown_v = self.monitor.steepest(monitor_v) * monitor_v * resolution.monitor;
        let shown_m = self.sensor.steepest(sensor_v) * sensor_v * resolution.sensor;
        for (quantity, value, min) in [
            // A step of the command that the monitor reads a step beside it.
            ("monitor.band_v", band_v, if shown_v > 0.0 { step_v + shown_v } else { 0.0 }),
            ("sensor.stuck_band", limits.sensor.stuck_band, shown_m),
            // From one side of a step to the other.
            ("sensor.jump", limits.sensor.jump, 2.0 * shown_m),
        ] {
            if value < min {
                return Err(BlobError::Resolution { quantity, value, min });
            }
        }
        let (limits_m, actuator_m) = (limits.thickness_m, self.actuator.thickness_m);
        if !(0.99..=1.01).contains(&(f64::from(limits_m) / actuator_m)) {
            return Err(BlobError::Thickness { limits_m, actuator_m });
        }
        let stuck_ticks = limits.sensor.stuck_ticks;
        let min_ticks = 5.0 * (self.control.delay_s + self.control.sample_interval_s) * self.rate_hz;
        #[allow(clippy::cast_precision_loss)] // compared, not counted
        if (stuck_ticks as f32) < min_ticks {
            return Err(BlobError::Stuck { stuck_ticks, min_ticks });
        }
        Ok(())
    }
}

#[cfg(feature = "store")]
mod bytes;
mod self_sensing;

#[cfg(feature = "store")]
pub use bytes::BlobHeader;
