//! How a controller is tuned: what is asked for, or else what the parameters' board or the paper's bench has.

use dea_driver::Control;
use springpot::{CommandLimits, HARMONICS, LearningOptions, ObserverOptions};

use crate::error::{Error, Result};
use crate::files::parameters::{Parameters, as_written};
use crate::quantity::{at_most, positive};
use crate::simulation::controllers::{ControllerKind, ControllerSettings, PI_HZ};

/// The requested tuning of a controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControllerTuning {
    /// Steps per second.
    pub rate_hz: f64,
    /// Bandwidth of `Tracking` or `Pi`, Hz.
    pub bandwidth_hz: Option<f64>,
    /// Time over which a disturbance that swings with the load becomes a change of the force scale, s; 0 for never.
    pub adaptation_s: Option<f64>,
    /// Samples of the displacement sensor per second.
    pub sensor_rate_hz: f64,
    /// Time until a sample arrives, s.
    pub sensor_delay_s: f64,
    /// Harmonics that are learned; none for no learning.
    pub harmonics: Option<usize>,
    /// Their period, s; found in the reference if left out.
    pub period_s: Option<f64>,
}

impl ControllerTuning {
    /// The settings of a controller of `kind` for `parameters` within `limits`, for a reference whose peak is 0.
    ///
    /// # Errors
    ///
    /// [`Error::Field`] naming what cannot be used.
    pub fn settings(
        &self,
        kind: ControllerKind,
        parameters: &Parameters,
        limits: CommandLimits,
    ) -> Result<ControllerSettings> {
        let control = parameters.board.as_ref().map_or(Control::BENCH, |board| board.control);
        let bandwidth_hz = self.bandwidth_hz.unwrap_or(match kind {
            ControllerKind::Pi => PI_HZ,
            _ => as_written(control.bandwidth_hz),
        });
        positive("bandwidth_hz", bandwidth_hz)?;
        let adaptation_s = self.adaptation_s.unwrap_or(as_written(control.adaptation_s));
        at_most("adaptation_s", adaptation_s, 1e9)?;
        positive("sensor_rate_hz", self.sensor_rate_hz)?;
        at_most("sensor_delay_s", self.sensor_delay_s, 10.0)?;
        let interval_s = (1.0 / self.sensor_rate_hz).max(1.0 / self.rate_hz);
        let observer = ObserverOptions {
            bandwidth_hz,
            sample_interval_s: interval_s,
            delay_s: self.sensor_delay_s,
            lost_after_s: 5.0 * interval_s,
            adaptation_s,
        };
        let learning = self.learning(kind, interval_s)?;
        Ok(ControllerSettings { rate_hz: self.rate_hz, limits, observer, learning, peak_m: 0.0 })
    }

    fn learning(&self, kind: ControllerKind, sample_interval_s: f64) -> Result<Option<LearningOptions>> {
        let Some(harmonics) = self.harmonics.filter(|harmonics| *harmonics > 0) else { return Ok(None) };
        if harmonics > HARMONICS {
            return Err(Error::field("harmonics", format!("{harmonics}: at most {HARMONICS} are learned")));
        }
        if !matches!(kind, ControllerKind::Feedforward | ControllerKind::Tracking) {
            let cause = format!("{} does not learn; use feedforward or tracking", kind.name());
            return Err(Error::field("harmonics", cause));
        }
        if let Some(period) = self.period_s {
            positive("period_s", period)?;
        }
        Ok(Some(LearningOptions { harmonics, period_s: self.period_s, sample_interval_s }))
    }
}
