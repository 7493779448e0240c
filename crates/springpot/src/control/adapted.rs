//! Adaptation of a law to a film that changes: how, and the changes.

use crate::error::ControlError;
use crate::scalar::Real;

/// Bounds: a force scale of 0.25 to 4, half to twice the memory, a third to three times its rates, orders of 0.8 to 1.3 times; of the bias
/// in largest forces.
pub(crate) const BOUNDS: [f64; 5] = [1.386, 0.7, 1.1, 0.25, 1.0];

/// Single precision may be beyond a bound by its rounding: by this factor.
pub(crate) const ROUNDED: f64 = 1.0 + 1e-5;

/// How [`Tracking`](crate::Tracking) adapts to a film that has changed since its law was fitted: warmer, older, under another weight.
///
/// With [`Learn`](Self::Learn) the law adapts while a sensor shows the film; without the sensor feedforward continues with the adapted law.
/// In
///
/// ```text
/// κ F + d = m ẍ + E(x) + σ T'(x) M[T(x)],      M: the relaxing part of the memory, E: the elastic part
/// ```
///
/// these parameters are estimated, from forces that the state of the law contains:
///
/// | parameter | meaning | bounds |
/// | --- | --- | --- |
/// | κ | [force scale](crate::ObserverState::force_scale): below 1 for a stiffer film | 0.25 to 4 |
/// | σ | stiffness of the relaxing part, where at least a tenth of the stiffness does not relax: another weight, or another stiffness | 0.5 to 2 |
/// | φ | factor of all relaxation rates: temperature | 1/3 to 3 |
/// | η | a rate r becomes r^(1 + η) (1/s): the orders of springpots become α / (1 + η) | ±0.25 |
/// | d | a constant force, which remains of the disturbance without a sensor | |
///
/// # How
///
/// Modes of a [`Compressed`](crate::Compressed) memory are springs with dashpots. With changed rates the dashpots flow more, or less, in
/// addition; the springs keep their stiffness, and every rate stays positive. Modes faster than 2/s stay as fitted. For each mode a
/// derivative of its extension y by the logarithm of its rate r is carried along, dy'/dt = −r (y + y'). It is the regressor of φ and η, and
/// when they change it moves the extensions to where they would be if the rates had always been so. Once in some thirty ticks recursive
/// least squares, in Bierman's factors of the covariance, compare the regressors with the observer's disturbance. Learned values come into
/// use with a time constant of a second, without a step of the force.
///
/// Nothing is learned while the sensor is lost, while limits are met, and while a fast reference is left to learned cycles or to
/// feedforward. Outliers have little weight. Learned values lose weight only while the load moves.
///
/// **A sensor that reads with another gain shows a film of another stiffness**: nothing distinguishes them, and the adapted law is as wrong as the
/// sensor.
///
/// ```
/// use springpot::{
///     Actuator, Adapting, Applied, CommandLimits, Law, LawOptions, ObserverOptions, Preset, SensorSample, Tracking, VoltageDrive,
/// };
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// let law: Law<f32> = Law::compressed(&Preset::TABLE3_N2.model()?, LawOptions::at_step(1e-3))?;
/// let (actuator, limits) = (Actuator::KARNER_2022, CommandLimits::BENCH);
/// let tracking = Tracking::new(law.clone(), &actuator, limits, ObserverOptions::at_bandwidth(0.5))?;
/// let drive = VoltageDrive::new(&actuator, limits.max_voltage_v, law.stiffness())?;
///
/// // A film that has become 10 % softer, with a sensor for the first 30 s.
/// let (mut film, mut state, mut voltage_v) = (law.state(), tracking.state(law.state()), 0.0);
/// state.set_adapting(Adapting::Learn);
/// for tick in 0..60_000_u16 {
///     let mut load = drive.load(voltage_v);
///     load.force_n *= 1.1;
///     let displacement_m = law.displacement_under(&mut film, load);
///     let sample = (tick % 10 == 0 && tick < 30_000).then_some(SensorSample { displacement_m, age_ticks: 0 });
///     tracking.observe(&mut state, Applied::as_commanded(voltage_v), sample);
///     let reference_m = 1e-3 - 0.2e-3 * (core::f32::consts::TAU * f32::from(tick % 10_000) / 10_000.0).cos();
///     voltage_v = tracking.command(&mut state, reference_m).voltage_v;
///     assert!(tick < 30_000 || (displacement_m - reference_m).abs() < 2e-6);
/// }
/// assert!((state.adapted().force_scale / 1.1 - 1.0).abs() < 0.01);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Adapting {
    /// The law as it was fitted, apart from the observer's [force scale](crate::ObserverState::force_scale). Learned changes go out of use
    /// within some seconds.
    Off,
    /// Learned changes stay in use, and nothing is learned.
    Hold,
    /// The law adapts. Learned changes lose weight after two to four times [`adaptation_s`](crate::ObserverOptions::adaptation_s); nothing
    /// is learned where that is 0.
    Learn,
}

/// The changes of a film against its law that are in use.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Adapted<T> {
    /// Effect of the electrostatic force over the model's, κ: below 1 for a film that has become stiffer.
    pub force_scale: T,
    /// Relative standard deviation of the force scale, from how well the estimates explain the observed forces.
    pub uncertainty: T,
    /// ln σ: logarithm of the stiffness of the relaxing part over that of the law.
    pub memory: T,
    /// ln φ: logarithm of the factor of the relaxation rates.
    pub rate: T,
    /// η: orders of springpots are those of the law over 1 + η.
    pub stretch: T,
    /// The constant force d that is kept without a sensor, N.
    pub bias_n: T,
    /// Size of the changes: 1 for a tenth in the force scale, a quarter in the memory, a half in the rates, or a twentieth in the orders,
    /// the largest of these; 0 below three standard deviations. Fit again from 1 on.
    pub ageing: T,
}

impl<T: Real> Adapted<T> {
    /// Whether the film should be fitted again: [`ageing`](Self::ageing) of 1 and more.
    #[must_use]
    pub fn needs_fit(&self) -> bool {
        self.ageing >= T::from_f64(1.0)
    }

    /// Checks that the values are within the bounds of [`Adapting`], for a film with a force of up to `largest_n` (N).
    ///
    /// # Errors
    ///
    /// [`ControlError::OutOfRange`] for the first that is not; logarithms and the bias by their size.
    pub fn check(&self, largest_n: f64) -> Result<(), ControlError> {
        let [scale, memory, rate, stretch, _] = BOUNDS;
        let size = |value: T| value.abs().to_f64();
        for (quantity, value, most) in [
            ("force_scale, its logarithm", libm::fabs(libm::log(self.force_scale.to_f64())), scale),
            ("memory", size(self.memory), memory),
            ("rate", size(self.rate), rate),
            ("stretch", size(self.stretch), stretch),
            ("bias_n", size(self.bias_n), largest_n),
            ("uncertainty", size(self.uncertainty), f64::MAX),
            ("ageing", size(self.ageing), f64::MAX),
        ] {
            // NaN is out of range.
            let within = value.is_finite() && value <= most * ROUNDED;
            if !within {
                return Err(ControlError::OutOfRange { quantity, value, most });
            }
        }
        Ok(())
    }
}
