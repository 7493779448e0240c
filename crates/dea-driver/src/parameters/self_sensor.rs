//! The film as its own displacement sensor, as parameters have it.

#[cfg(feature = "self-sensing")]
pub use with_current::SelfSensor;

/// Self-sensing of a film, which does not exist without the feature `self-sensing`.
#[cfg(not(feature = "self-sensing"))]
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub enum SelfSensor {}

#[cfg(feature = "self-sensing")]
mod with_current {
    use heapless::Vec;
    use serde::{Deserialize, Serialize};
    use springpot::{
        CapacitanceRelation, Coefficients, Discretisation, SelfSensing, SelfSensingError, SelfSensingOptions,
    };

    use crate::chips::Calibration;

    /// Self-sensing of a film: its relation of capacitance and displacement, tone and monitors as [`SelfSensing`] has them, and the monitor of the
    /// current. In single precision, with the springpot of the relation in numbers.
    ///
    /// While a run is tracking, the controller adds the tone to the voltage of its law. The film's displacement takes the place of a displacement
    /// sensor that is out of its range, where the limits let [a run go on without one](crate::OnSensorFault::OpenLoop); one that is plausible corrects it.
    ///
    /// ```
    /// use dea_driver::chips::Calibration;
    /// use dea_driver::SelfSensor;
    /// use springpot::{CapacitanceRelation, SelfSensingOptions};
    ///
    /// let relation = CapacitanceRelation::of_geometry(700e-12, 0.04, 2.0, 800e-12);
    /// // 0 to 10 V for -0.25 to 0.25 mA.
    /// let current = Calibration::Parabola { offset: -0.25e-3, gain: 50e-6, quadratic: 0.0 };
    /// let sensor = SelfSensor::new(&relation, SelfSensingOptions::BENCH, current)?;
    /// assert_eq!(sensor.options().tone_v, 50.0);
    /// # Ok::<(), springpot::SelfSensingError>(())
    /// ```
    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    pub struct SelfSensor {
        /// As [`CapacitanceRelation`].
        relation: [f32; 8],
        /// As [`SelfSensingOptions`], but the periods.
        options: [f32; 7],
        periods: u16,
        /// g_0, the head and the modes of the springpot.
        instant: f32,
        head: [f32; 4],
        fast: [(f32, f32); 11],
        /// Current monitor (V) → current (A).
        current: Calibration,
    }

    impl SelfSensor {
        /// Self-sensing by `relation` with these `options`, and a `current` monitor (V) → (A). Build it on a host: it takes a controller as
        /// long as building a law.
        ///
        /// # Errors
        ///
        /// As [`SelfSensing::new`].
        #[allow(clippy::cast_possible_truncation)] // the parameters are in single precision
        pub fn new(
            relation: &CapacitanceRelation,
            options: SelfSensingOptions,
            current: Calibration,
        ) -> Result<Self, SelfSensingError> {
            let creep = SelfSensing::<f32>::new(relation, options)?.creep();
            let CapacitanceRelation { rest_f, max_f, stroke_m: [a, b, c], creep: share, alpha, uncertainty_m } =
                *relation;
            let o = options;
            let monitors = [o.voltage_noise_v, o.current_noise_a, o.max_current_a, o.cable_f, o.drift_s];
            let [voltage_noise_v, current_noise_a, max_current_a, cable_f, drift_s] = monitors;
            Ok(Self {
                relation: [rest_f, max_f, a, b, c, share, alpha, uncertainty_m].map(|value| value as f32),
                options: [o.step_s, o.tone_v, voltage_noise_v, current_noise_a, max_current_a, cable_f, drift_s]
                    .map(|value| value as f32),
                periods: o.periods,
                instant: creep.instant as f32,
                head: creep.head,
                fast: creep.fast,
                current,
            })
        }

        /// The relation of capacitance and displacement.
        #[must_use]
        pub fn relation(&self) -> CapacitanceRelation {
            let [rest_f, max_f, a, b, c, creep, alpha, uncertainty_m] = self.relation.map(f64::from);
            CapacitanceRelation { rest_f, max_f, stroke_m: [a, b, c], creep, alpha, uncertainty_m }
        }

        /// Tone and monitors.
        #[must_use]
        pub fn options(&self) -> SelfSensingOptions {
            let [step_s, tone_v, voltage_noise_v, current_noise_a, max_current_a, cable_f, drift_s] =
                self.options.map(f64::from);
            let periods = self.periods;
            SelfSensingOptions {
                step_s,
                tone_v,
                periods,
                voltage_noise_v,
                current_noise_a,
                max_current_a,
                cable_f,
                drift_s,
            }
        }

        /// Amplitude of the tone, V.
        #[must_use]
        pub fn tone_v(&self) -> f32 {
            let [_, tone_v, ..] = self.options;
            tone_v
        }

        /// The current monitor (V) → current (A).
        #[must_use]
        pub fn current(&self) -> &Calibration {
            &self.current
        }

        /// Self-sensing as ticks compute it.
        ///
        /// # Errors
        ///
        /// As [`SelfSensing::with_creep`].
        #[inline(never)] // a small chip has no room for it beside a controller
        pub fn sensing(&self) -> Result<SelfSensing<f32>, SelfSensingError> {
            let creep = Coefficients {
                method: Discretisation::Gl,
                instant: f64::from(self.instant),
                tail_error: 0.0,
                reserved: [0; 20],
                head: self.head,
                fast: self.fast,
                slow: [],
                curve: Vec::new(),
            };
            SelfSensing::with_creep(&self.relation(), self.options(), &creep)
        }
    }
}
