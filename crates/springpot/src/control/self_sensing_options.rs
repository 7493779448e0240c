//! Tone, monitors and wiring of self-sensing.

use crate::error::{SelfSensingError, first_not_positive};

/// Tone, monitors and wiring of [`SelfSensing`](crate::SelfSensing). SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct SelfSensingOptions {
    /// Time between two ticks, s; the tone's period is four of them.
    pub step_s: f64,
    /// Amplitude of the tone, V.
    pub tone_v: f64,
    /// Periods of the tone in a block, 2 to 64: each gives one sample.
    pub periods: u16,
    /// Standard deviation of a reading of the voltage monitor, V, its resolution included.
    pub voltage_noise_v: f64,
    /// Standard deviation of a reading of the current, A, its resolution included.
    pub current_noise_a: f64,
    /// Mean current above which the film counts as shorted, A: above what it leaks and what charges it.
    pub max_current_a: f64,
    /// Capacitance that is left without the film, of the cable, F. 0: not known; then a film that is off looks like a current monitor without
    /// a signal.
    pub cable_f: f64,
    /// Time over which the difference from a second sensor is forgotten, s.
    pub drift_s: f64,
}

impl SelfSensingOptions {
    /// Fewest periods of the tone in a block.
    pub const MIN_PERIODS: u16 = 2;

    /// A tone of 50 V at 1 kHz in blocks of 20 ms. Monitors of 16 bits over 6 kV and 0.5 mA with noise of 2 bits, a short above 0.2 mA, 100 pF of cable.
    pub const BENCH: Self = Self {
        step_s: 1e-3,
        tone_v: 50.0,
        periods: 5,
        voltage_noise_v: 2.0 * 6000.0 / 65536.0,
        current_noise_a: 2.0 * 0.5e-3 / 65536.0,
        max_current_a: 0.2e-3,
        cable_f: 100e-12,
        drift_s: 600.0,
    };

    /// Largest slope of the tone as a sine, V/s, of an amplifier that rounds its steps; the command changes by `tone_v` a tick.
    #[must_use]
    pub fn tone_slew_v_per_s(&self) -> f64 {
        core::f64::consts::FRAC_PI_2 * self.tone_v / self.step_s
    }

    /// Time between two samples, s.
    #[must_use]
    pub fn sample_interval_s(&self) -> f64 {
        f64::from(4 * self.periods) * self.step_s
    }

    /// Age of a sample when it is returned, ticks: half of a block, three ticks of its filter, and one in which it is computed.
    #[must_use]
    pub fn age_ticks(&self) -> usize {
        2 * usize::from(self.periods) + 4
    }

    pub(crate) fn check(&self) -> Result<(), SelfSensingError> {
        let values = [
            ("step_s", self.step_s),
            ("tone_v", self.tone_v),
            ("voltage_noise_v", self.voltage_noise_v),
            ("current_noise_a", self.current_noise_a),
            ("max_current_a", self.max_current_a),
            ("drift_s", self.drift_s),
        ];
        if let Some((quantity, value)) = first_not_positive(&values) {
            return Err(SelfSensingError::NotPositive { quantity, value });
        }
        if !(Self::MIN_PERIODS..=64).contains(&self.periods) {
            return Err(SelfSensingError::Periods(self.periods));
        }
        Ok(())
    }
}
