//! Options of learning.

use crate::control::harmonic::HARMONICS;
use crate::error::{ControlError, first_not_positive};

/// How a [`Learning`](crate::Learning) learns. Times in s.
///
/// ```
/// use springpot::{Actuator, ControlError, Law, Learning, LearningOptions, LawOptions, Preset};
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// let model = Preset::TABLE3_N2.model()?;
/// let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(1e-3))?;
/// let wings = LearningOptions { period_s: Some(0.2), harmonics: 3, ..LearningOptions::BENCH };
/// let learning = Learning::new(&law, &Actuator::KARNER_2022, 6000.0, wings)?;
/// assert_eq!(learning.state(0.0).period_ticks().map(|ticks| ticks.round()), Some(200.0));
///
/// let wrong = LearningOptions { period_s: Some(-1.0), ..wings };
/// let refused = Learning::new(&law, &Actuator::KARNER_2022, 6000.0, wrong);
/// assert_eq!(refused, Err(ControlError::NotPositive { quantity: "period_s", value: -1.0 }));
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct LearningOptions {
    /// Number of harmonics that are learned, beside the mean: 1 to [`HARMONICS`].
    pub harmonics: usize,
    /// Period of the reference, s. `None`: measured, within three or four cycles; the reference must cross its middle upwards once a cycle.
    pub period_s: Option<f64>,
    /// Time from one sample of the sensor to the next, s.
    pub sample_interval_s: f64,
}

impl LearningOptions {
    /// All harmonics, a period that is taken from the reference, and a sensor of 100 Hz.
    pub const BENCH: Self = Self { harmonics: HARMONICS, period_s: None, sample_interval_s: 0.01 };

    pub(super) fn check(&self) -> Result<(), ControlError> {
        if !(1..=HARMONICS).contains(&self.harmonics) {
            return Err(ControlError::Harmonics { harmonics: self.harmonics });
        }
        let values = [("period_s", self.period_s.unwrap_or(1.0)), ("sample_interval_s", self.sample_interval_s)];
        let wrong = first_not_positive(&values);
        wrong.map_or(Ok(()), |(quantity, value)| Err(ControlError::NotPositive { quantity, value }))
    }
}
