//! The time constants of an amplifier from command and monitor.
//!
//! The model is the controller's own, [`springpot::AmplifierModel`]. Beside `rise_s` and `fall_s` the fit frees what a monitor and a log add:
//! gain and offset of the monitor, the voltage at the first row, and when between two rows the command jumps.

mod response;
mod search;

use nalgebra::DMatrix;

use crate::error::{Error, Result};
use crate::files::amplifier_log::AmplifierLog;
use crate::fit::residuals::effective_samples;
use crate::fit::uncertainty::{CHI_SQUARE, NORMAL};
use crate::least_squares::{inverse, unit_diagonal};
use crate::statistics::{differences, mean, median, rms};
use response::Fall;
use search::{FALL, Found, GAIN, MAX_S, OFFSET, RISE, Search};

/// An amplifier as a log shows it.
#[derive(Clone, Debug, PartialEq)]
pub struct Identification {
    /// Time constant of rises.
    pub rise: Time,
    /// Time constant of falls.
    pub fall: Time,
    /// Gain of the monitor, V/V, and its 95 % interval.
    pub gain: (f64, Interval),
    /// Reading of the monitor at 0 V, V, and its 95 % interval.
    pub offset_v: (f64, Interval),
    /// RMS of monitor minus model, V.
    pub residual_v: f64,
    /// RMS noise of the monitor from row to row, V.
    pub noise_v: f64,
    /// The readings that were fitted.
    pub samples: usize,
    /// Median of the row intervals, s.
    pub interval_s: f64,
    /// Modelled reading of the monitor, V, row by row.
    pub shown_v: Vec<f64>,
    /// Contradictions to the model, one sentence each.
    pub warnings: Vec<String>,
}

/// Ends of a 95 % interval.
pub type Interval = [f64; 2];

/// A time constant, as far as a log determines it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Time {
    /// Its value (s) and 95 % interval. 0: none that the row interval, the upper end, would show.
    Known(f64, Interval),
    /// All of these (s) fit as well.
    Open(Interval),
}

/// A time constant is known where the log distinguishes it from one that differs by this factor.
const TOLD_APART: f64 = 1.15;
/// There is no time constant where the log distinguishes it from this many row intervals.
const NONE_BELOW: f64 = 1.5;
/// The ends of what fits as well are found to the 2 to the power of this part of that factor.
const HALVINGS: u32 = 4;
/// Share of the monitor's variance that the model must explain at the least.
const MIN_EXPLAINED: f64 = 0.9;

/// Identifies the amplifier of `log`.
///
/// # Errors
///
/// [`Error`] naming the log where command and monitor do not belong together, or where nothing in it is faster than the amplifier.
pub fn identify(log: &AmplifierLog) -> Result<Identification> {
    let fault = |cause: String| Error::file(log.path(), cause);
    let unrelated = || fault("the monitor does not follow command_v; both must be the high voltage, in V".into());
    let own = Fitted::new(log, Fall::Bleeder).ok_or_else(unrelated)?;
    let other = Fitted::new(log, Fall::TowardsCommand);
    let better = other.filter(|other| other.is_clearly_better_than(&own));
    let first_order = better.as_ref().map(|other| falls_towards_the_command(other, &own));
    let Fitted { search, found, residuals } = better.unwrap_or(own);
    let shown_v = search.shown(&found.values).ok_or_else(unrelated)?;
    let noise_v = noise(&residuals).max(quantisation(log));
    let residual_v = rms(&residuals);
    if residual_v.powi(2) > (1.0 - MIN_EXPLAINED) * variance(log) {
        return Err(unrelated());
    }

    let spread = Spread::new(&found, &residuals, log.span_v());
    let (rise, fall) = (spread.time(&search, &found, RISE), spread.time(&search, &found, FALL));
    if let (Time::Open([_, rise_s]), Time::Open([_, fall_s])) = (rise, fall) {
        return Err(fault(format!(
            "nothing in this log is faster than the amplifier: rise_s up to {rise_s:.3} s and fall_s up to {fall_s:.3} s fit as well; record \
             steps up and down to 0 V"
        )));
    }
    let mut identified = Identification {
        rise,
        fall,
        gain: (found.values[GAIN], spread.interval(&found, GAIN)),
        offset_v: (found.values[OFFSET], spread.interval(&found, OFFSET)),
        residual_v,
        noise_v,
        samples: residuals.len(),
        interval_s: search.command.interval_s,
        shown_v,
        warnings: Vec::new(),
    };
    identified.warnings.extend(wrong_gain(identified.gain.0));
    identified.warnings.extend(first_order);
    identified.warnings.extend(unexplained(&identified, log.span_v()));
    Ok(identified)
}

/// A log as one law of falling explains it.
struct Fitted<'a> {
    search: Search<'a>,
    found: Found,
    residuals: Vec<f64>,
}

impl<'a> Fitted<'a> {
    fn new(log: &'a AmplifierLog, fall: Fall) -> Option<Self> {
        let search = Search::new(log, fall);
        let found = search.best()?;
        let residuals = search.residuals(&found.values)?;
        Some(Self { search, found, residuals })
    }

    /// Whether its residual is smaller by a tenth and beyond chance, and its falls are slower than its rises: otherwise both laws agree.
    fn is_clearly_better_than(&self, own: &Self) -> bool {
        let variance = rms(&self.residuals).powi(2) * self.residuals.len() as f64 / effective_samples(&self.residuals);
        rms(&self.residuals) < 0.9 * rms(&own.residuals)
            && 2.0 * (own.found.minimum.cost - self.found.minimum.cost) > 10.0 * CHI_SQUARE * variance
            && self.found.values[FALL] > self.found.values[RISE]
    }
}

/// How far the residuals leave the variables open.
struct Spread {
    /// Variance of the residuals, over their independent samples, V².
    variance: f64,
    /// Covariance of the free variables per variance of the residuals.
    inverse: Option<DMatrix<f64>>,
}

impl Spread {
    fn new(found: &Found, residuals: &[f64], span_v: f64) -> Self {
        let count = found.free.len();
        let freedom = (effective_samples(residuals) - count as f64).max(1.0);
        // A log without noise is still written with so many digits.
        let variance = (2.0 * found.minimum.cost / freedom).max((1e-6 * span_v).powi(2));
        let (scaled, lengths) = unit_diagonal(&found.minimum.normal, &(0..count).collect::<Vec<_>>());
        Self { variance, inverse: inverse(scaled, &lengths) }
    }

    /// Half the width of the 95 % interval of variable `index`.
    fn half_width(&self, found: &Found, index: usize) -> f64 {
        let place = found.free.iter().position(|&i| i == index);
        match (&self.inverse, place) {
            (Some(inverse), Some(place)) => NORMAL * (self.variance * inverse[(place, place)]).sqrt(),
            _ => f64::INFINITY,
        }
    }

    fn interval(&self, found: &Found, index: usize) -> Interval {
        let (value, half) = (found.values[index], self.half_width(found, index));
        [value - half, value + half]
    }

    /// The time constant `index` as the log shows it: by the error that others leave, all else fitted again.
    fn time(&self, search: &Search<'_>, found: &Found, index: usize) -> Time {
        let best = found.values[index];
        let interval_s = search.command.interval_s;
        let told_apart = |value: f64| {
            let cost = search.cost_with(found, index, value);
            cost.is_none_or(|cost| 2.0 * (cost - found.minimum.cost) > CHI_SQUARE * self.variance)
        };
        if best < interval_s && told_apart(NONE_BELOW * interval_s) {
            return Time::Known(0.0, [0.0, interval_s]);
        }
        let end = |factor: f64| {
            let mut same = best.max(interval_s);
            while same >= interval_s && same < MAX_S && !told_apart((same * factor).min(MAX_S)) {
                same *= factor;
            }
            let mut other = same * factor;
            for _ in 0..HALVINGS {
                let middle = (same * other).sqrt();
                *(if told_apart(middle) { &mut other } else { &mut same }) = middle;
            }
            same
        };
        let beyond = [best / TOLD_APART, best * TOLD_APART];
        if best >= interval_s && beyond[1] < MAX_S && beyond.into_iter().all(told_apart) {
            // Falls that end shortly above 0 V leave a small range, from the lag to the slowest bleeder that is as fast. No covariance shows it.
            let half = self.half_width(found, index);
            let low = if told_apart(best - 2.0 * half) { best - half } else { end(1.0 / TOLD_APART) };
            let high = if told_apart(best + 2.0 * half) { best + half } else { end(TOLD_APART) };
            return Time::Known(best, [low.max(0.0), high]);
        }
        let least = end(1.0 / TOLD_APART);
        Time::Open([if least < interval_s { 0.0 } else { least }, end(TOLD_APART).min(MAX_S)])
    }
}

/// A gain that no monitor has.
fn wrong_gain(gain: f64) -> Option<String> {
    ((gain - 1.0).abs() > 0.1).then(|| {
        format!(
            "the monitor shows {gain:.3} times what was commanded: check the calibrations of amplifier and monitor in [board] first"
        )
    })
}

/// Another law of falling than the controller's that explains the log better.
fn falls_towards_the_command(other: &Fitted<'_>, own: &Fitted<'_>) -> String {
    format!(
        "falls go towards the command (residual {:.1} V), not towards 0 V as in the controller's model ({:.1} V); the times are those of the \
         former. The controller leads falls by rise_s alone: on this amplifier those that end above 0 V stay late, by up to fall_s",
        rms(&other.residuals),
        rms(&own.residuals)
    )
}

/// A residual far above the noise.
fn unexplained(identified: &Identification, span_v: f64) -> Option<String> {
    let Identification { residual_v, noise_v, .. } = *identified;
    (residual_v > 2.5 * noise_v && residual_v > 2e-3 * span_v).then(|| {
        format!(
            "the residual, {residual_v:.1} V RMS, is far above the monitor's noise, {noise_v:.1} V: an amplifier that is limited in slew or \
             current, a slow monitor, or a wrong calibration; look at the plot, the times are means"
        )
    })
}

/// RMS noise (V) of residuals, from their second differences: robust against what is slow or rare.
fn noise(residuals: &[f64]) -> f64 {
    let second: Vec<f64> = residuals.windows(3).map(|r| (r[0] - 2.0 * r[1] + r[2]).abs()).collect();
    // Median of |normal|, and the second difference of white noise.
    median(&second) / 0.6745 / 6.0_f64.sqrt()
}

/// RMS error (V) of a monitor's resolution: its smallest change.
fn quantisation(log: &AmplifierLog) -> f64 {
    let changes = differences(&log.monitor_v).map(f64::abs).filter(|change| *change > 0.0);
    let quantum = changes.fold(f64::INFINITY, f64::min);
    if quantum.is_finite() { quantum / 12.0_f64.sqrt() } else { 0.0 }
}

/// Variance of the monitor's readings, V².
fn variance(log: &AmplifierLog) -> f64 {
    let readings: Vec<f64> = log.monitor_v.iter().copied().filter(|volts| !volts.is_nan()).collect();
    let middle = mean(&readings);
    readings.iter().map(|volts| (volts - middle).powi(2)).sum::<f64>() / readings.len() as f64
}
