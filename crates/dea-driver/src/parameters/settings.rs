//! The parameters of a board as values.

use heapless::String;
use serde::{Deserialize, Serialize};
use springpot::{Actuator, Adapted, AmplifierLag, CommandLimits, Compressed, Law, LearningOptions, ObserverOptions};

use crate::chips::{Calibration, Ceilings, CommandRange};
use crate::parameters::{ControllerMemory, SelfSensor};
use crate::safety::Limits;

/// Calibrations, limits and law of a board and its film, in SI units.
///
/// `M` is the memory of the law, as of every type that depends on it: see [`ControllerMemory`].
///
/// [`bench`](Self::bench) gives a set to start from; replace what differs. [`Blob`](crate::Blob) checks them.
///
/// ```
/// use dea_driver::chips::Calibration;
/// use dea_driver::{Blob, BlobError, Limits, Parameters};
/// use springpot::{Actuator, Law, LawOptions, Preset};
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// let model = Preset::TABLE3_N2.model()?;
/// let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(1e-3))?;
/// let parameters = Parameters {
///     amplifier: Calibration::linear(1200.0),
///     monitor: Calibration::linear(1200.0),
///     ..Parameters::bench(&law, Actuator::KARNER_2022)
/// };
/// let blob = Blob::new(parameters.clone())?;
///
/// // Limits that a controller cannot keep are refused.
/// let limits = Limits { max_voltage_v: 50e3, ..parameters.limits };
/// let refused = Blob::new(Parameters { limits, ..parameters });
/// assert!(matches!(refused.err(), Some(BlobError::Reach { instrument: "monitor", .. })));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(bound = "")]
pub struct Parameters<M: ControllerMemory = Compressed<f32>> {
    /// Name of the set.
    pub name: String<32>,
    /// Ticks per second.
    pub rate_hz: f32,
    /// The film's law at that rate, as a host computed it.
    pub law: M::Coefficients,
    /// The actuator, whose mass is the law's.
    pub actuator: Actuator,
    /// Value of the displacement sensor for a film at rest, m.
    pub sensor_offset_m: f32,
    /// Range of an AD5754 that makes the amplifier's command. A board with another DAC ignores it.
    pub command_range: CommandRange,
    /// Command (V) → high voltage (V).
    pub amplifier: Calibration,
    /// How fast the amplifier follows.
    pub amplifier_lag: AmplifierLag,
    /// Monitor (V) → high voltage (V).
    pub monitor: Calibration,
    /// Displacement sensor (V) → displacement (m).
    pub sensor: Calibration,
    /// The limits of film and bench.
    pub limits: Limits,
    /// How references are followed and the film is observed.
    pub control: Control,
    /// Voltage (V) above which [`max_voltage_v`](Limits::max_voltage_v) requires a self-test of the bench since the start before arming:
    /// [`NO_SELF_TEST_V`](Self::NO_SELF_TEST_V) for never, also in blobs that do not state it; 0 for always.
    #[serde(skip, default = "no_self_test_v")]
    pub self_test_above_v: f32,
    /// Learned changes of the film that were [kept](crate::AdaptationOrder::Keep): in use from the start, and held. `None`: the law as it
    /// was fitted.
    #[serde(skip)]
    pub adapted: Option<Adapted<f32>>,
    /// The film as its own sensor, on a board with a monitor of the current. `None`: no self-sensing.
    #[serde(skip)]
    pub self_sensing: Option<SelfSensor>,
}

fn no_self_test_v() -> f32 {
    Parameters::<Compressed<f32>>::NO_SELF_TEST_V
}

impl<M: ControllerMemory> Parameters<M> {
    /// The largest voltage that any limits may allow, V.
    pub const NO_SELF_TEST_V: f32 = Ceilings::NONE.voltage_v;

    /// A bench like the paper's around `actuator`, whose film steps `law`: an amplifier and a monitor of 1000:1 on 0 to 10 V,
    /// a sensor of 1 mm/V that reads 1 V at rest, [`Limits::bench`], [`Control::BENCH`], no name.
    /// The coefficients carry the law's [`Discretisation`](springpot::Discretisation), so that a controller steps a law of either.
    #[must_use]
    #[allow(clippy::cast_possible_truncation)] // the parameters are in single precision
    pub fn bench(law: &Law<f32, M>, actuator: Actuator) -> Self {
        Self {
            name: String::new(),
            rate_hz: (1.0 / law.step_s()) as f32,
            law: M::coefficients(law),
            actuator,
            sensor_offset_m: 0.0,
            command_range: CommandRange::TenVolts,
            amplifier: Calibration::linear(1000.0),
            amplifier_lag: AmplifierLag::NONE,
            monitor: Calibration::linear(1000.0),
            // An unplugged sensor reads −1 mm, which is out of its range.
            sensor: Calibration::Parabola { offset: -1e-3, gain: 1e-3, quadratic: 0.0 },
            limits: Limits::bench(actuator.thickness_m as f32),
            control: Control::BENCH,
            self_test_above_v: Self::NO_SELF_TEST_V,
            adapted: None,
            self_sensing: None,
        }
    }
}

/// How references are followed and the film is observed: [`CommandLimits`] and [`ObserverOptions`], apart from values in the [`Limits`],
/// and [`LearningOptions`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Control {
    /// Largest speed of a reference, m/s.
    pub max_velocity_m_per_s: f32,
    /// Largest acceleration of a reference, m/s².
    pub max_acceleration_m_per_s2: f32,
    /// Two poles of the return to the reference after a limit, Hz.
    pub return_hz: f32,
    /// Below it the estimate follows the sensor, above it the model, Hz.
    pub bandwidth_hz: f32,
    /// Time from one used sample to the next, s: a tick, or longer for a slower sensor.
    pub sample_interval_s: f32,
    /// Age of a sample when it is read, s.
    pub delay_s: f32,
    /// Time without a sample after which the sensor counts as lost, s.
    pub lost_after_s: f32,
    /// Time over which the force scale adapts, s; 0: never.
    pub adaptation_s: f32,
    /// Harmonics of a periodic reference that are learned, at most [`springpot::HARMONICS`]; 0: nothing is.
    #[serde(default)]
    pub harmonics: u8,
    /// Period of that reference, s; 0: it is taken from the reference.
    #[serde(default)]
    pub period_s: f32,
}

impl Control {
    /// For a sensor of 100 Hz whose samples come 10 ms late, on a film whose resonance is at 3 Hz or above.
    pub const BENCH: Self = Self {
        max_velocity_m_per_s: 0.05,
        max_acceleration_m_per_s2: 0.5,
        return_hz: 5.0,
        bandwidth_hz: 0.6,
        sample_interval_s: 0.01,
        delay_s: 0.01,
        lost_after_s: 0.05,
        adaptation_s: 30.0,
        harmonics: 0,
        period_s: 0.0,
    };

    /// The limits of the law of control on a bench with these `limits` and this `amplifier`.
    ///
    /// This and [`observer_options`](Self::observer_options) are the only conversion from a board's numbers, in single precision, to the
    /// law's options. A host that uses them builds the controller's law to the bit.
    #[must_use]
    pub fn command_limits(&self, limits: &Limits, amplifier: AmplifierLag) -> CommandLimits {
        CommandLimits {
            max_voltage_v: f64::from(limits.max_voltage_v),
            max_field_v_per_m: f64::from(limits.max_field_v_per_m),
            max_slew_v_per_s: f64::from(limits.max_slew_v_per_s),
            max_velocity_m_per_s: f64::from(self.max_velocity_m_per_s),
            max_acceleration_m_per_s2: f64::from(self.max_acceleration_m_per_s2),
            return_hz: f64::from(self.return_hz),
            amplifier,
        }
    }

    /// The options of the observer.
    #[must_use]
    pub fn observer_options(&self) -> ObserverOptions {
        ObserverOptions {
            bandwidth_hz: f64::from(self.bandwidth_hz),
            sample_interval_s: f64::from(self.sample_interval_s),
            delay_s: f64::from(self.delay_s),
            lost_after_s: f64::from(self.lost_after_s),
            adaptation_s: f64::from(self.adaptation_s),
        }
    }

    /// The options of learning periodic references; `None` if nothing is learned.
    #[must_use]
    pub fn learning_options(&self) -> Option<LearningOptions> {
        (self.harmonics > 0).then(|| LearningOptions {
            harmonics: usize::from(self.harmonics),
            period_s: (self.period_s != 0.0).then(|| f64::from(self.period_s)),
            sample_interval_s: f64::from(self.sample_interval_s),
        })
    }
}
