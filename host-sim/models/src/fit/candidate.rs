//! The candidate that a fit changes: the elements of the model, its elastic curve, and quantities of the actuator and the sensor.

use std::fmt;

use springpot::{Actuator, Curve, CurveError, Knot, Maxwell, ModelError, Rubber, Springpot, Topology};

use crate::files::parameters::{DisplacementSensor, ElasticCurve, MAX_SENSOR_DELAY_S, Shape};

/// A model with its actuator and sensor offset, as a fit changes them.
#[derive(Clone, Debug, PartialEq)]
pub struct Candidate {
    /// Eq. 1 and the weight.
    pub actuator: Actuator,
    /// The main springpot, then both of every branch.
    pub elements: Vec<Springpot>,
    /// How the branches are connected.
    pub topology: Topology,
    /// Reading of the displacement sensor at x = 0, m.
    pub offset_m: f64,
    /// Time by which the sensor's readings are late, s.
    pub delay_s: f64,
    /// The elastic curve.
    pub bend: Bend,
}

impl Candidate {
    /// Number of branches, of two springpots each.
    pub fn branches(&self) -> usize {
        (self.elements.len() - 1) / 2
    }

    /// The springpots of `model` in the order of [`elements`](Self::elements).
    pub fn elements_of(model: &Maxwell) -> Vec<Springpot> {
        model.chains().flat_map(|chain| chain.elements).copied().collect()
    }

    /// The variables of its elastic curve.
    pub fn curve_variables(&self) -> Vec<Variable> {
        match &self.bend {
            Bend::Straight | Bend::Held(_) => Vec::new(),
            Bend::Rubber { ln_limit, .. } => {
                let limit = ln_limit.is_some().then_some(Variable::Limit);
                [Variable::Share, Variable::FreeLength].into_iter().chain(limit).collect()
            }
            Bend::Free { .. } => self.bend.free_slopes().into_iter().map(Variable::Slope).collect(),
        }
    }

    /// The displacement sensor.
    pub fn sensor(&self) -> DisplacementSensor {
        DisplacementSensor { offset_m: self.offset_m, delay_s: self.delay_s }
    }

    /// The model.
    ///
    /// # Errors
    ///
    /// [`ModelError`] for elements out of range.
    pub fn model(&self) -> Result<Maxwell, ModelError> {
        let (branches, _) = self.elements[1..].as_chunks::<2>();
        Maxwell::new(self.elements[0], branches, self.topology, self.actuator.mass_kg)
    }
}

/// Largest coupling beside a curve or a saturation, in shares of the film's length: a film of constant volume has 1, one that gets
/// wider as well up to 2.
const MAX_THINNING: f64 = 3.0;
/// The same beside both. A spring that stiffens in series with linear creep leaves the creep a share of the compliance that grows with
/// the load. A curve and a saturation scale both alike; the coupling feeds the slow displacement back into the force and raises that
/// share. Five times the thinning brings such films within 1.5 % of peak to peak and stays away from pull-in.
const MAX_GROWTH: f64 = 15.0;
/// 1/kV² in 1/V².
const PER_KILOVOLT2: f64 = 1e6;

/// A quantity that a fit may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Variable {
    /// ln c of an element.
    Coefficient(usize),
    /// α of an element.
    Order(usize),
    /// κ in 1/m.
    StretchCoupling,
    /// 1/V_s² in 1/kV².
    Saturation,
    /// β of a rubber's curve.
    Share,
    /// ln of Gent's limit.
    Limit,
    /// ln of the free length of a rubber (m).
    FreeLength,
    /// ln of the slope of a free curve at a knot.
    Slope(usize),
    /// The sensor's offset, m.
    Offset,
    /// The sensor's delay, s.
    Delay,
    /// ln ε_r.
    Permittivity,
    /// ln of the active area's length l₁ (m).
    Length,
    /// ln of the active area's width l₂ (m).
    Width,
    /// ln of the film's thickness l₃ (m).
    Thickness,
    /// ln of the mass (kg), weight and inertia.
    Mass,
}

impl Variable {
    /// The variables of the elements of a model with `branches` branches.
    pub fn of_model(branches: usize) -> Vec<Self> {
        (0..=2 * branches).flat_map(|element| [Self::Coefficient(element), Self::Order(element)]).collect()
    }

    /// Its value in `candidate`: the logarithm of a quantity that must stay positive.
    pub fn get(self, candidate: &Candidate) -> f64 {
        let actuator = &candidate.actuator;
        match self {
            Self::Coefficient(element) => candidate.elements[element].c.ln(),
            Self::Order(element) => candidate.elements[element].alpha,
            Self::StretchCoupling => actuator.stretch_coupling,
            Self::Saturation => actuator.saturation() * PER_KILOVOLT2,
            Self::Share | Self::Limit | Self::FreeLength | Self::Slope(_) => self.of_bend(&candidate.bend),
            Self::Offset => candidate.offset_m,
            Self::Delay => candidate.delay_s,
            Self::Permittivity => actuator.relative_permittivity.ln(),
            Self::Length => actuator.length_m.ln(),
            Self::Width => actuator.width_m.ln(),
            Self::Thickness => actuator.thickness_m.ln(),
            Self::Mass => actuator.mass_kg.ln(),
        }
    }

    /// Sets it in `candidate`.
    pub fn set(self, candidate: &mut Candidate, value: f64) {
        let actuator = &mut candidate.actuator;
        match self {
            Self::Coefficient(element) => candidate.elements[element].c = value.exp(),
            Self::Order(element) => candidate.elements[element].alpha = value,
            Self::StretchCoupling => actuator.stretch_coupling = value,
            Self::Saturation => {
                actuator.saturation_v = (value > 0.0).then(|| (PER_KILOVOLT2 / value).sqrt());
            }
            Self::Share | Self::Limit | Self::FreeLength | Self::Slope(_) => self.set_bend(&mut candidate.bend, value),
            Self::Offset => candidate.offset_m = value,
            Self::Delay => candidate.delay_s = value,
            Self::Permittivity => actuator.relative_permittivity = value.exp(),
            Self::Length => actuator.length_m = value.exp(),
            Self::Width => actuator.width_m = value.exp(),
            Self::Thickness => actuator.thickness_m = value.exp(),
            Self::Mass => actuator.mass_kg = value.exp(),
        }
    }

    /// Whether it is of the elastic curve.
    pub fn is_of_curve(self) -> bool {
        matches!(self, Self::Share | Self::Limit | Self::FreeLength | Self::Slope(_))
    }

    fn of_bend(self, bend: &Bend) -> f64 {
        match (self, bend) {
            (Self::Share, &Bend::Rubber { share, .. }) => share,
            (Self::Limit, &Bend::Rubber { ln_limit, .. }) => ln_limit.unwrap_or(f64::INFINITY),
            (Self::FreeLength, &Bend::Rubber { ln_length, .. }) => ln_length,
            (Self::Slope(knot), Bend::Free { ln_slopes, .. }) => ln_slopes[knot],
            _ => 0.0,
        }
    }

    fn set_bend(self, bend: &mut Bend, value: f64) {
        match (self, bend) {
            (Self::Share, Bend::Rubber { share, .. }) => *share = value,
            (Self::Limit, Bend::Rubber { ln_limit, .. }) => *ln_limit = Some(value),
            (Self::FreeLength, Bend::Rubber { ln_length, .. }) => *ln_length = value,
            (Self::Slope(knot), Bend::Free { ln_slopes, .. }) => ln_slopes[knot] = value,
            _ => {}
        }
    }

    /// The quantity itself, in SI units.
    pub fn natural(self, candidate: &Candidate) -> f64 {
        let value = self.get(candidate);
        match self {
            Self::Order(_) | Self::StretchCoupling | Self::Offset | Self::Delay | Self::Share => value,
            Self::Saturation => candidate.actuator.saturation_v.unwrap_or(f64::INFINITY),
            _ => value.exp(),
        }
    }

    /// Bounds of the value: orders 0…1, saturation at least 0, all others some decades around 1 in SI units.
    pub fn bounds(self) -> (f64, f64) {
        let decades =
            |low: i32, high: i32| (f64::from(low) * std::f64::consts::LN_10, f64::from(high) * std::f64::consts::LN_10);
        match self {
            Self::Coefficient(_) => decades(-3, 12),
            Self::Order(_) => (0.0, 1.0),
            Self::StretchCoupling => (-1e4, 1e4),
            Self::Saturation => (0.0, 100.0),
            Self::Share => (-0.5, 1.5),
            Self::Limit => decades(-1, 5),
            Self::FreeLength => decades(-5, 2),
            Self::Slope(_) => decades(-2, 2),
            Self::Offset => (-1.0, 1.0),
            Self::Delay => (-MAX_SENSOR_DELAY_S, MAX_SENSOR_DELAY_S),
            Self::Permittivity => decades(-6, 6),
            Self::Length | Self::Width | Self::Thickness => decades(-9, 3),
            Self::Mass => decades(-6, 6),
        }
    }

    /// The same in a search from `candidate`. Beside a curve or a saturation the coupling stays what the geometry allows: without
    /// that bound one compensates for the other.
    pub fn bounds_in(self, candidate: &Candidate) -> (f64, f64) {
        let (low, high) = self.bounds();
        if self != Self::StretchCoupling {
            return (low, high);
        }
        let most = MAX_THINNING / candidate.actuator.length_m;
        let high = match (candidate.bend != Bend::Straight, candidate.actuator.saturation_v.is_some()) {
            (false, false) => high,
            (true, true) => MAX_GROWTH / candidate.actuator.length_m,
            _ => most,
        };
        (-most, high)
    }

    /// ∂ ln F / ∂ value of a quantity that only scales the electrostatic force F (Eq. 1).
    pub fn force_exponent(self) -> Option<f64> {
        match self {
            Self::Permittivity | Self::Length | Self::Width => Some(1.0),
            Self::Thickness => Some(-2.0),
            _ => None,
        }
    }
}

impl fmt::Display for Variable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let element = |f: &mut fmt::Formatter<'_>, symbol: &str, element: usize| match element {
            0 => write!(f, "main.{symbol}"),
            _ => write!(f, "branches[{}][{}].{symbol}", (element - 1) / 2, (element - 1) % 2),
        };
        match *self {
            Self::Coefficient(index) => element(f, "c", index),
            Self::Order(index) => element(f, "alpha", index),
            Self::StretchCoupling => f.write_str("stretch_coupling"),
            Self::Saturation => f.write_str("saturation_v"),
            Self::Share => f.write_str("curve.share"),
            Self::Limit => f.write_str("curve.limit"),
            Self::FreeLength => f.write_str("curve.free_length_m"),
            Self::Slope(knot) => write!(f, "curve.slope[{knot}]"),
            Self::Offset => f.write_str("offset_m"),
            Self::Delay => f.write_str("delay_s"),
            Self::Permittivity => f.write_str("relative_permittivity"),
            Self::Length => f.write_str("length_m"),
            Self::Width => f.write_str("width_m"),
            Self::Thickness => f.write_str("thickness_m"),
            Self::Mass => f.write_str("mass_kg"),
        }
    }
}

/// The elastic curve of a candidate.
#[derive(Clone, Debug, PartialEq)]
pub enum Bend {
    /// None: T(x) = x.
    Straight,
    /// A curve that a fit keeps.
    Held(Box<ElasticCurve>),
    /// A strip of rubber.
    Rubber {
        /// β.
        share: f64,
        /// ln of Gent's limit J; none for Mooney–Rivlin.
        ln_limit: Option<f64>,
        /// ln of the free length (m).
        ln_length: f64,
        /// Stretch at x = 0, which a fit keeps.
        rest_stretch: f64,
        /// The measured stroke, m.
        range_m: (f64, f64),
    },
    /// Pieces whose slope changes linearly from knot to knot.
    Free {
        /// Displacements of the knots, increasing, 0 among them, m.
        knots_m: Vec<f64>,
        /// ln of the slope at every knot; 0 at the displacement 0.
        ln_slopes: Vec<f64>,
    },
}

impl Bend {
    /// A straight curve of `pieces` even pieces over `range_m` (m), whose slopes a fit then changes.
    pub fn free(pieces: usize, (low_m, high_m): (f64, f64)) -> Self {
        // Evenly between 0 and the farther end; a short end on the other side of 0 is a piece of its own.
        let (near, far) = if high_m.abs() >= low_m.abs() { (low_m, high_m) } else { (high_m, low_m) };
        let mut knots_m: Vec<f64> = (0..=pieces).map(|k| far * k as f64 / pieces as f64).collect();
        if near.abs() > 0.1 * far.abs() {
            knots_m.push(near);
        }
        knots_m.sort_by(f64::total_cmp);
        let ln_slopes = vec![0.0; knots_m.len()];
        Self::Free { knots_m, ln_slopes }
    }

    /// The curve of a parameter file, to be changed where a fit can.
    pub fn from_curve(curve: &ElasticCurve) -> Self {
        let pieces = curve.pieces();
        match curve.shape() {
            Shape::Rubber(Rubber { share, limit, rest_stretch, free_length_m }) => Self::Rubber {
                share,
                ln_limit: limit.is_finite().then(|| limit.ln()),
                ln_length: free_length_m.ln(),
                rest_stretch,
                range_m: pieces.range(),
            },
            // No fit changes it.
            Shape::Measure(_) => Self::Held(Box::new(curve.clone())),
            Shape::Free => {
                let knots = pieces.knots();
                let bend = Self::Free {
                    knots_m: knots.iter().map(|knot| knot.displacement).collect(),
                    ln_slopes: knots.iter().map(|knot| knot.slope.ln()).collect(),
                };
                // Pieces of another kind are kept as they are.
                let (low_m, high_m) = pieces.range();
                let same = bend.curve().ok().flatten().is_some_and(|again| {
                    knots.iter().any(|knot| knot.displacement == 0.0)
                        && knots.iter().all(|k| (again.value(k.displacement) - k.value).abs() < 1e-6 * (high_m - low_m))
                });
                if same { bend } else { Self::Held(Box::new(curve.clone())) }
            }
        }
    }

    /// The number of slopes that may be changed, with the index of each.
    pub fn free_slopes(&self) -> Vec<usize> {
        match self {
            Self::Free { knots_m, .. } => (0..knots_m.len()).filter(|&k| knots_m[k] != 0.0).collect(),
            _ => Vec::new(),
        }
    }

    /// The curve; none for a straight one.
    ///
    /// # Errors
    ///
    /// [`CurveError`] for values that no film has.
    pub fn curve(&self) -> Result<Option<Curve>, CurveError> {
        Ok(self.elastic()?.map(|elastic| elastic.pieces().clone()))
    }

    /// The curve as a parameter file has it.
    ///
    /// # Errors
    ///
    /// As [`curve`](Self::curve).
    pub fn elastic(&self) -> Result<Option<ElasticCurve>, CurveError> {
        match self {
            Self::Straight => Ok(None),
            Self::Held(curve) => Ok(Some(curve.as_ref().clone())),
            &Self::Rubber { share, ln_limit, ln_length, rest_stretch, range_m: (low_m, high_m) } => {
                let rubber = Rubber {
                    share,
                    limit: ln_limit.map_or(f64::INFINITY, f64::exp),
                    rest_stretch,
                    free_length_m: ln_length.exp(),
                };
                ElasticCurve::rubber(rubber, low_m.min(0.0), high_m.max(0.0)).map(Some)
            }
            Self::Free { knots_m, ln_slopes } => {
                let mut knots: Vec<Knot<f64>> = Vec::with_capacity(knots_m.len());
                for (&displacement, ln_slope) in knots_m.iter().zip(ln_slopes) {
                    let slope = ln_slope.exp();
                    let value = knots.last().map_or(0.0, |before| {
                        before.value + 0.5 * (before.slope + slope) * (displacement - before.displacement)
                    });
                    knots.push(Knot { displacement, value, slope });
                }
                Curve::scaled(&knots).map(|curve| Some(ElasticCurve::free(curve)))
            }
        }
    }

    /// Its name in tables.
    pub fn name(&self) -> String {
        match self {
            Self::Straight => "linear".into(),
            Self::Held(curve) => curve.name().into(),
            Self::Rubber { ln_limit: None, .. } => "mooney-rivlin".into(),
            Self::Rubber { .. } => "gent".into(),
            Self::Free { .. } => format!("free {}", self.free_slopes().len()),
        }
    }
}
