//! How a controller is tuned: what is asked for, or else what the parameters' board or the paper's bench has.

use dea_driver::Control;
use springpot::{CommandLimits, HARMONICS};

use crate::error::{Error, Result};
use crate::files::parameters::{Parameters, as_written, below_resonance};
use crate::quantity::{at_most, positive};
use crate::references::Periods;
use crate::simulation::controllers::{ControllerKind, ControllerSettings, PI_HZ};
use host_io::choice::Choice;
use host_io::terminal::rounded;

/// The requested tuning of a controller.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ControllerTuning {
    /// Steps per second.
    pub rate_hz: f64,
    /// Bandwidth of `Tracking` or `Pi`, Hz.
    pub bandwidth_hz: Option<f64>,
    /// Time over which a disturbance that swings with the load becomes a change of the force scale, s; 0 for never.
    pub adaptation_s: Option<f64>,
    /// Samples of the displacement sensor per second.
    pub sensor_rate_hz: Option<f64>,
    /// Time until a sample arrives, s.
    pub sensor_delay_s: Option<f64>,
    /// Harmonics that are learned; none for no learning.
    pub harmonics: Option<usize>,
    /// Their period, s; found in the reference if left out.
    pub period_s: Option<f64>,
}

impl ControllerTuning {
    /// A tuning at `rate_hz` that requests nothing: no learning.
    #[must_use]
    pub fn at_rate(rate_hz: f64) -> Self {
        Self { rate_hz, ..Self::default() }
    }

    /// The displacement sensor: samples per second, and the time until one arrives, s.
    pub fn sensor(&self, parameters: &Parameters) -> (f64, f64) {
        let control = parameters.board_or_bench(self.rate_hz).control;
        let rate_hz = self.sensor_rate_hz.unwrap_or_else(|| 1.0 / as_written(control.sample_interval_s));
        (rate_hz, self.sensor_delay_s.unwrap_or_else(|| as_written(control.delay_s)))
    }

    /// The settings of a controller of `kind` for `parameters` within `limits`, for a reference whose peak is 0.
    pub fn settings(
        &self,
        kind: ControllerKind,
        parameters: &Parameters,
        limits: CommandLimits,
    ) -> Result<ControllerSettings> {
        let board = parameters.board_or_bench(self.rate_hz);
        let control = board.control;
        let default_hz = if kind == ControllerKind::Pi { PI_HZ } else { f64::from(control.bandwidth_hz) };
        let is_stated = self.bandwidth_hz.is_some() || kind != ControllerKind::Pi && board.states_control();
        let bandwidth_hz = self.bandwidth_hz.unwrap_or(default_hz);
        positive("bandwidth_hz", bandwidth_hz)?;
        let adaptation_s = self.adaptation_s.unwrap_or(f64::from(control.adaptation_s));
        at_most("adaptation_s", adaptation_s, 1e9)?;
        let (sensor_rate_hz, sensor_delay_s) = self.sensor(parameters);
        positive("sensor_rate_hz", sensor_rate_hz)?;
        at_most("sensor_delay_s", sensor_delay_s, 10.0)?;
        let interval_s = (1.0 / sensor_rate_hz).max(1.0 / self.rate_hz);
        let lost_after_s = match self.sensor_rate_hz {
            None if interval_s * self.rate_hz > 1.0 => control.lost_after_s,
            _ => (5.0 * interval_s) as f32,
        };
        // In the controller's single precision, so that the law is the controller's to the bit.
        let mut control = Control {
            bandwidth_hz: bandwidth_hz as f32,
            sample_interval_s: interval_s as f32,
            delay_s: sensor_delay_s as f32,
            lost_after_s,
            adaptation_s: adaptation_s as f32,
            harmonics: self.checked_harmonics(kind)?,
            period_s: self.period_s.unwrap_or_default() as f32,
            ..control
        };
        if !is_stated && kind.has_observer() {
            control = below_resonance(control, &parameters.film().compressed_law(self.rate_hz)?);
        }
        let (observer, learning) = (control.observer_options(), control.learning_options());
        Ok(ControllerSettings { rate_hz: self.rate_hz, limits, observer, learning, peak_m: 0.0 })
    }

    /// Why the cycles of `reference` (m, one value a step) are not those that are to be learned, if they are not.
    #[must_use]
    pub fn cycles_note(&self, reference: &[f64]) -> Option<String> {
        let harmonics = self.harmonics.filter(|harmonics| *harmonics > 0)?;
        let Some(found) = Periods::from_series(reference) else {
            return Some("no period was found in the reference: its cycles may not be learned".into());
        };
        let found_s = found.length as f64 / self.rate_hz;
        let asked_s = self.period_s.unwrap_or(found_s);
        let cycles = (asked_s / found_s).round();
        let is_multiple = cycles >= 1.0 && (asked_s / found_s / cycles - 1.0).abs() < 0.02;
        (!is_multiple || cycles > harmonics as f64).then(|| {
            format!(
                "the reference repeats every {} s, a period that harmonics 1 to {harmonics} of {asked_s} s do not contain: leave the period out",
                rounded(found_s)
            )
        })
    }

    fn checked_harmonics(&self, kind: ControllerKind) -> Result<u8> {
        let Some(harmonics) = self.harmonics.filter(|harmonics| *harmonics > 0) else { return Ok(0) };
        if harmonics > HARMONICS {
            return Err(Error::field("harmonics", format!("{harmonics}: at most {HARMONICS} are learned")));
        }
        use ControllerKind::{Adaptive, Feedforward, Tracking};
        if !matches!(kind, Feedforward | Tracking | Adaptive) {
            let cause = format!("{} does not learn; use feedforward, tracking or adaptive", kind.name());
            return Err(Error::field("harmonics", cause));
        }
        if let Some(period) = self.period_s {
            positive("period_s", period)?;
        }
        Ok(harmonics as u8)
    }
}
