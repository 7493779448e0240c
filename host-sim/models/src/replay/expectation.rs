//! The error to expect of feedforward, from what was recorded of the film.
//!
//! A film is fitted again to parts of its recordings, and by other structures that the comparison leaves open. Along a reference these fits
//! answer the planned voltage differently, because the recordings do not determine the film; what the model does not describe is left in
//! the recordings themselves. Both together are about the error of feedforward.

use indicatif::ProgressBar;
use serde::{Deserialize, Serialize};
use springpot::{Curve, Knot, Maxwell, Spring, Springpot, TemperatureDependence};
use toml::Value;

use crate::files::parameters::{ElasticCurve, Parameters};
use crate::files::recording::Input;
use crate::grid::{Grid, Samples};
use crate::replay::memory::{MemoryChoice, Precision, RunOptions};
use crate::replay::simulate;
use crate::statistics::{differences, mean, median, percentile_range};

/// Key of the table in a parameter file's provenance.
const KEY: &str = "recorded";
/// The smallest error over its estimate, and the largest over the difference of the fits and over the misfit, of which weak faults of recordings leave
/// little. Calibrated on random films that stiffen in series with creep, and on films with such faults.
const MIN_RATIO: f64 = 0.05;
const MAX_OVER_DIFFERENCE: f64 = 1.45;
const MAX_OVER_MISFIT: f64 = 5.0;
/// The largest over that on what was left out, where there are no fits to parts: calibrated on some of these films.
const MAX_OVER_LEFT_OUT: f64 = 5.0;
/// Growth of the largest for films of several temperatures: calibrated on 40 of these.
const SEVERAL_TEMPERATURES: f64 = 1.1;
/// Growth of the error with each share by which a reference exceeds what was recorded.
const GROWTH: f64 = 5.0;
/// Share by which a reference may exceed it, which changes nothing.
const SLACK: f64 = 0.02;
/// Largest error over a fault's size, and over that by a lag: calibrated on films of other kinds with such faults.
const MAX_FAULT: f64 = 3.0;
const MAX_LAG: f64 = 1.5;
/// Growth of the largest where time stamps are off: calibrated on 15 films of these kinds.
const JITTERS: f64 = 3.0;
/// Temperatures, K, that are as good as the same.
const SAME_K: f64 = 2.0;
/// Time after which the error of a reference counts, s.
const RISE_S: f64 = 2.0;

/// The sample from which it counts.
fn rise(grid: Grid, samples: usize) -> usize {
    ((RISE_S * grid.rate_hz) as usize).min(samples - 1)
}

/// How often a `reference` goes through its median after the rise, by more than a twentieth of its range to both sides, in periods a second
/// between the first and the last time.
fn mean_frequency_hz(reference: &[f64], grid: Grid) -> f64 {
    let later = &reference[rise(grid, reference.len())..];
    let middle = median(later);
    let margin = 0.05 * percentile_range(later.iter().copied());
    let (mut side, mut crossings) = (0.0, Vec::new());
    for (k, value) in later.iter().map(|value| value - middle).enumerate().filter(|(_, value)| value.abs() > margin) {
        if side * value < 0.0 {
            crossings.push(k);
        }
        side = value;
    }
    match crossings.as_slice() {
        [first, .., last] => 0.5 * (crossings.len() - 1) as f64 * grid.rate_hz / (last - first) as f64,
        _ => 0.0,
    }
}

/// The range of what was recorded of a film.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Recorded {
    /// Smallest and largest displacement, m.
    pub stroke_m: [f64; 2],
    /// Largest voltage, V.
    pub voltage_v: f64,
    /// Largest speed, m/s.
    pub speed_m_per_s: f64,
    /// Largest frequency of a sine that has the stroke and the largest speed of a recording, Hz; 0 if it is not known.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub frequency_hz: f64,
    /// Duration of the longest recording, s.
    pub time_s: f64,
    /// RMS error on what was left out, without noise, m.
    pub left_out_m: f64,
    /// RMS error of the fit, without noise, m.
    #[serde(default)]
    pub misfit_m: f64,
    /// RMS size of the recordings' faults that were not estimated, m.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub fault_m: f64,
    /// Time by which the stroke may lag the drive by such faults, s.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub lag_s: f64,
    /// About the RMS of what their time stamps are off by, s.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub jitter_s: f64,
    /// Lowest and highest temperature, °C.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature_c: Option<[f64; 2]>,
    /// The film as it is fitted to parts of the recordings, and by structures that describe them as well.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub refits: Vec<Refit>,
}

#[allow(clippy::trivially_copy_pass_by_ref)] // serde's signature
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// A film as it is fitted to a part of the recordings, or by another structure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Refit {
    /// c (N·s^α/m) and α of every springpot, the main one first.
    elements: Vec<[f64; 2]>,
    /// kg.
    mass_kg: f64,
    /// N/V².
    force_per_square_volt: f64,
    /// 1/m.
    stretch_coupling: f64,
    /// V.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    saturation_v: Option<f64>,
    /// Displacement (m), value (m) and slope of the elastic curve's knots.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    curve: Vec<[f64; 3]>,
    /// Displacement (m), force (N) and slope (N/m) of the knots of the spring beside the memory; without a curve it is in series.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    spring: Vec<[f64; 3]>,
    /// How the temperature changes it: the numbers above are those at its reference.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    temperature: Option<TemperatureDependence>,
}

/// A quantity of a reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quantity {
    /// Displacement, m.
    Stroke,
    /// Voltage, V.
    Voltage,
    /// Speed, m/s.
    Speed,
    /// Mean frequency, Hz.
    Frequency,
    /// Duration, s.
    Time,
    /// Temperature, °C.
    Temperature,
}

/// A quantity in which a reference exceeds all recordings.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Beyond {
    /// Which one.
    pub quantity: Quantity,
    /// The value that the reference needs.
    pub needed: f64,
    /// The recorded value.
    pub recorded: f64,
}

/// The error to expect along a reference.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Expectation {
    /// Interval of the RMS error, calibrated on simulated films (docs/commands.md), in % of the reference's peak to peak after 2 s, or of its
    /// displacement where it is held.
    pub feedforward_error_pct: [f64; 2],
    /// Whether the reference is held.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub is_held: bool,
    /// The quantities in which the reference exceeds all recordings, for which the error grows.
    pub beyond: Vec<Beyond>,
}

impl Expectation {
    /// The quantities that exceed the recordings, each with what to record, and the error to expect.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        let line = |Beyond { quantity, needed, recorded }: &Beyond| match quantity {
            Quantity::Stroke => {
                format!("reaches {:.3} mm, recorded was {:.3} mm: record that stroke", 1e3 * needed, 1e3 * recorded)
            }
            Quantity::Voltage => format!("needs {needed:.0} V, recorded were {recorded:.0} V: record that voltage"),
            Quantity::Speed => format!(
                "moves at {:.2} mm/s, recorded were {:.2} mm/s: record faster cycles",
                1e3 * needed,
                1e3 * recorded
            ),
            Quantity::Frequency => {
                format!("oscillates at {needed:.2} Hz, recorded were {recorded:.2} Hz: record faster cycles")
            }
            Quantity::Time => format!("lasts {needed:.0} s, recorded were {recorded:.0} s: record for as long"),
            Quantity::Temperature => {
                format!("is at {needed:.1} °C, recorded was {recorded:.1} °C: record at that temperature")
            }
        };
        let [low, high] = self.feedforward_error_pct;
        let of = if self.is_held { "the displacement" } else { "peak to peak" };
        let error = format!("expected error {low:.2} to {high:.2} % of {of} RMS");
        self.beyond.iter().map(line).chain([error]).collect()
    }
}

impl Recorded {
    /// The ranges of the recordings behind `parameters`, if their file has them.
    #[must_use]
    pub fn from_parameters(parameters: &Parameters) -> Option<Self> {
        parameters.provenance.as_ref()?.get(KEY)?.clone().try_into().ok()
    }

    /// The entry of a parameter file's provenance.
    #[must_use]
    pub fn entry(&self) -> Option<(&'static str, Value)> {
        Some((KEY, Value::try_from(self).ok()?))
    }

    /// The error to expect along `reference` (m, on `grid`), which goes over `range_m` after its rise, of feedforward with `parameters`, which
    /// plays `voltage_v`. A film that does not begin at rest has its voltages so far in front of these.
    #[must_use]
    pub fn expectation(
        &self,
        parameters: &Parameters,
        reference: &[f64],
        grid: Grid,
        range_m: f64,
        voltage_v: Vec<f64>,
    ) -> Expectation {
        let largest_v = voltage_v.iter().copied().fold(0.0, f64::max);
        let temperature_c = parameters.temperature.map(|dependence| dependence.reference_c);
        let (mut growth, beyond) = self.beyond(reference, grid, largest_v, temperature_c);
        // Slow memory that the recordings do not show moves the film the further the longer it was loaded before.
        let before_s = grid.step_s() * (voltage_v.len() - reference.len()) as f64;
        let all_s = grid.step_s() * (voltage_v.len() - 1) as f64;
        if before_s > 0.0 {
            growth += before_s.min(all_s - self.time_s).max(0.0) / self.time_s;
        }
        let from = rise(grid, reference.len());
        let squares = differences(reference).skip(from.saturating_sub(1)).map(|step| step.powi(2));
        let speed_m_per_s = (squares.sum::<f64>() / (reference.len() - from) as f64).sqrt() * grid.rate_hz;
        let [low, high] = self.error_m(self.difference_m(parameters, reference, grid, voltage_v), speed_m_per_s);
        let share = |error_m: f64| 100.0 * error_m / range_m.max(f64::MIN_POSITIVE);
        Expectation { feedforward_error_pct: [share(low), share(growth * high)], is_held: false, beyond }
    }

    /// Interval of the error (m, RMS) along a path of an RMS speed on which the fits to parts differ by `difference_m`, if they are known.
    #[must_use]
    pub fn error_m(&self, difference_m: Option<f64>, speed_m_per_s: f64) -> [f64; 2] {
        let estimated = |difference_m: f64| {
            let high = (MAX_OVER_DIFFERENCE * difference_m).hypot(MAX_OVER_MISFIT * self.misfit_m);
            [MIN_RATIO * difference_m.hypot(self.misfit_m), high]
        };
        let [low, high] = difference_m.map_or([0.0, MAX_OVER_LEFT_OUT * self.left_out_m], estimated);
        let by_faults = MAX_FAULT * self.fault_m + MAX_LAG * self.lag_s * speed_m_per_s;
        let growth = if self.jitter_s > 0.0 { JITTERS } else { 1.0 };
        // The film may be found all the same.
        if by_faults > 0.0 || growth > 1.0 { [0.0, growth * high + by_faults] } else { [low, high] }
    }

    /// The quantities in which `reference` (m, on `grid`), which needs `voltage_v` at the most, exceeds the recordings, and by how much the
    /// error grows with them, of a film at a temperature (°C).
    fn beyond(&self, reference: &[f64], grid: Grid, voltage_v: f64, temperature_c: Option<f64>) -> (f64, Vec<Beyond>) {
        let [low, high] = self.stroke_m;
        let end = |of: fn(f64, f64) -> f64, from: f64| reference.iter().copied().fold(from, of);
        let speed = differences(reference).map(f64::abs).fold(0.0, f64::max) * grid.rate_hz;
        let stroke = high - low;
        // Faster cycles of a large stroke exceed both: one line for one cause.
        let frequency_hz = mean_frequency_hz(reference, grid);
        let is_fast = frequency_hz * self.speed_m_per_s > speed * self.frequency_hz && self.frequency_hz > 0.0;
        let fast = if is_fast {
            (Quantity::Frequency, frequency_hz, self.frequency_hz, self.frequency_hz)
        } else {
            (Quantity::Speed, speed, self.speed_m_per_s, self.speed_m_per_s)
        };
        let quantities = [
            (Quantity::Stroke, end(f64::max, high), high, stroke),
            (Quantity::Stroke, end(f64::min, low), low, stroke),
            (Quantity::Voltage, voltage_v, self.voltage_v, self.voltage_v),
            fast,
            (Quantity::Time, grid.step_s() * (reference.len() - 1) as f64, self.time_s, self.time_s),
        ];
        let temperature = self.temperature_c.zip(temperature_c).map(|([low, high], needed)| {
            (Quantity::Temperature, needed, needed.clamp(low, high), (high - low).max(SAME_K))
        });
        let mut growth = if temperature.is_some() { SEVERAL_TEMPERATURES } else { 1.0 };
        let mut beyond = Vec::new();
        for (quantity, needed, recorded, size) in quantities.into_iter().chain(temperature) {
            let share = match quantity {
                Quantity::Stroke | Quantity::Temperature => (needed - recorded).abs(),
                _ => needed - recorded,
            } / size;
            if share > SLACK {
                growth += GROWTH * share;
                beyond.push(Beyond { quantity, needed, recorded });
            }
        }
        (growth, beyond)
    }

    /// The film of the fit to a part whose answer to `voltage_v`, which takes the film of `parameters` along `reference` (m, on `grid`), differs
    /// most; none where one of them does not follow.
    #[must_use]
    pub fn farthest(
        &self,
        parameters: &Parameters,
        reference: &[f64],
        grid: Grid,
        voltage_v: Vec<f64>,
    ) -> Option<Parameters> {
        let squares = self.squares(parameters, reference, grid, voltage_v)?;
        let (_, refit) = squares.iter().zip(&self.refits).max_by(|(a, _), (b, _)| a.total_cmp(b))?;
        refit.parameters(parameters)
    }

    /// RMS difference (m) of the fits to parts from the film of `parameters`, which the end of `voltage_v` takes along `reference` (m); none where
    /// one of them does not follow.
    fn difference_m(&self, parameters: &Parameters, reference: &[f64], grid: Grid, voltage_v: Vec<f64>) -> Option<f64> {
        let squares = self.squares(parameters, reference, grid, voltage_v)?;
        (!squares.is_empty()).then(|| mean(&squares).sqrt())
    }

    /// Mean squares (m²) of these differences, of each of the fits.
    fn squares(&self, parameters: &Parameters, reference: &[f64], grid: Grid, voltage_v: Vec<f64>) -> Option<Vec<f64>> {
        let before = voltage_v.len() - reference.len();
        let grid = Grid { samples: voltage_v.len(), ..grid };
        let input = Input::Voltage(Samples { time_s: grid.times_s(), value: voltage_v });
        let options = RunOptions { memory: MemoryChoice::Compressed, precision: Precision::F64, rate_hz: grid.rate_hz };
        let from = rise(grid, reference.len());
        let square = |refit: &Refit| {
            let film = refit.parameters(parameters)?;
            let moved = simulate::response(&film, &input, grid, &options, &ProgressBar::hidden()).ok()?;
            let off = moved.displacement_m.iter().skip(before).zip(reference).skip(from);
            Some(off.map(|(x, wanted)| (x - wanted).powi(2)).sum::<f64>() / (reference.len() - from) as f64)
        };
        self.refits.iter().map(square).collect()
    }
}

impl Refit {
    /// The film of `parameters`.
    #[must_use]
    pub fn new(parameters: &Parameters) -> Self {
        let Parameters { actuator, model, curve, spring, .. } = parameters;
        let elements = model.chains().flat_map(|chain| chain.elements).map(|element| [element.c, element.alpha]);
        let knot = |knot: &Knot<f64>| [knot.displacement, knot.value, knot.slope];
        Self {
            elements: elements.collect(),
            mass_kg: actuator.mass_kg,
            force_per_square_volt: actuator.force_per_square_volt(),
            stretch_coupling: actuator.stretch_coupling,
            saturation_v: actuator.saturation_v,
            curve: curve.iter().flat_map(|curve| curve.pieces().knots()).map(knot).collect(),
            spring: spring.iter().flat_map(Spring::knots).map(knot).collect(),
            temperature: parameters.temperature,
        }
    }

    /// This film instead of that of `parameters`; none where its numbers are of no film.
    fn parameters(&self, parameters: &Parameters) -> Option<Parameters> {
        let elements: Vec<Springpot> = self.elements.iter().map(|&[c, alpha]| Springpot::new(c, alpha)).collect();
        let (branches, _) = elements.get(1..)?.as_chunks::<2>();
        let mut film = parameters.clone();
        film.model = Maxwell::new(elements[0], branches, parameters.model.topology(), self.mass_kg).ok()?;
        film.actuator.relative_permittivity *= self.force_per_square_volt / film.actuator.force_per_square_volt();
        film.actuator.mass_kg = self.mass_kg;
        film.actuator.stretch_coupling = self.stretch_coupling;
        film.actuator.saturation_v = self.saturation_v;
        let knot = |&[displacement, value, slope]: &[f64; 3]| Knot { displacement, value, slope };
        let knots = |of: &[[f64; 3]]| (!of.is_empty()).then(|| of.iter().map(knot).collect::<Vec<Knot<f64>>>());
        let curve = knots(&self.curve).map(|knots| Curve::new(&knots)).transpose().ok()?;
        film.curve = curve.map(ElasticCurve::free);
        film.spring = knots(&self.spring).map(|knots| Spring::new(&knots)).transpose().ok()?;
        film.temperature = self.temperature.or(film.temperature);
        match parameters.temperature {
            Some(dependence) if self.temperature.is_some() => film.at_temperature(dependence.reference_c).ok(),
            _ => Some(film),
        }
    }
}
