//! The candidate that a fit changes: the elements of the model, its elastic curve, and quantities of the actuator and the sensor.

use std::borrow::Cow;
use std::f64::consts::LN_10;
use std::fmt;

use springpot::{Actuator, Curve, CurveError, Maxwell, ModelError, Spring, Springpot, TemperatureDependence, Topology};

use super::bend::{Bend, Elastic};
use crate::files::parameters::{DisplacementSensor, MAX_SENSOR_DELAY_S};

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
    /// The elastic curve; beside a spring the strain measure of the memory.
    pub bend: Bend,
    /// The spring beside the memory; without a curve it is in series.
    pub spring: Option<Elastic>,
    /// How the temperature changes it, if that is known or fitted.
    pub temperature: Option<TemperatureDependence>,
}

/// The curves of a film.
#[derive(Clone, Debug)]
pub struct Curves {
    /// T.
    pub curve: Curve,
    /// E beside the memory, if there is one.
    pub spring: Option<Spring>,
}

impl Candidate {
    /// A linear film whose sensor has neither offset nor delay.
    pub fn linear(actuator: Actuator, elements: Vec<Springpot>, topology: Topology) -> Self {
        Self {
            actuator,
            elements,
            topology,
            offset_m: 0.0,
            delay_s: 0.0,
            bend: Bend::Straight,
            spring: None,
            temperature: None,
        }
    }

    /// The film at a temperature, °C: as it is where none is given, or nothing is known of it; none where its dependence does not reach so far.
    pub fn at(&self, temperature_c: Option<f64>) -> Option<Cow<'_, Self>> {
        let (Some(dependence), Some(temperature_c)) = (self.temperature, temperature_c) else {
            return Some(Cow::Borrowed(self));
        };
        dependence.check_at(temperature_c).ok()?;
        let stiffness = dependence.stiffness_factor(temperature_c);
        Some(Cow::Owned(Self {
            elements: self.elements.iter().map(|&element| dependence.springpot_at(element, temperature_c)).collect(),
            spring: self.spring.as_ref().map(|spring| spring.scaled(stiffness)).transpose().ok()?,
            ..self.clone()
        }))
    }

    /// Number of branches, of two springpots each.
    pub fn branches(&self) -> usize {
        (self.elements.len() - 1) / 2
    }

    /// The springpots of `model` in the order of [`elements`](Self::elements).
    pub fn elements_of(model: &Maxwell) -> Vec<Springpot> {
        model.chains().flat_map(|chain| chain.elements).copied().collect()
    }

    /// Its spring, if it has one.
    pub fn elastic_spring(&self) -> Result<Option<Spring>, CurveError> {
        self.spring.as_ref().map(Elastic::spring).transpose()
    }

    /// Its curves; none for a linear film.
    pub fn curves(&self) -> Result<Option<Curves>, CurveError> {
        let spring = self.elastic_spring()?;
        Ok(self.bend.curve()?.map(|curve| Curves { curve, spring }))
    }

    /// Whether it has a spring in series with its memory.
    pub fn is_in_series(&self) -> bool {
        self.bend == Bend::Straight && self.spring.is_some()
    }

    /// The spring in series with its memory.
    pub fn in_series(&self) -> Result<Option<Spring>, CurveError> {
        if self.is_in_series() { self.elastic_spring() } else { Ok(None) }
    }

    /// The name of its curves in tables.
    pub fn curve_name(&self) -> String {
        match self.spring.as_ref().map(Elastic::pieces) {
            None => self.bend.name(),
            Some(_) if self.is_in_series() => "spring in series".into(),
            Some(pieces) => {
                let measure = if self.is_hencky() { ", Hencky" } else { "" };
                let spring = if pieces > 0 { format!(", spring {pieces}") } else { String::new() };
                format!("two curves{measure}{spring}")
            }
        }
    }

    /// Whether it is linear but for what saturates.
    pub fn is_straight(&self) -> bool {
        self.bend == Bend::Straight && self.spring.is_none()
    }

    /// The variables of its curves.
    pub fn curve_variables(&self) -> Vec<Variable> {
        if let Some(Elastic::Rising(_)) = self.spring {
            return vec![Variable::SeriesStiffness, Variable::SeriesBend];
        }
        let steepness = (0..self.spring.as_ref().map_or(0, Elastic::slopes)).map(Variable::Steepness);
        self.bend_variables().into_iter().chain(steepness).collect()
    }

    fn bend_variables(&self) -> Vec<Variable> {
        match &self.bend {
            &Bend::Measure { fitted, .. } => {
                [Variable::Exponent, Variable::MeasureLength].into_iter().take(fitted).collect()
            }
            Bend::Straight | Bend::Held(_) => Vec::new(),
            Bend::Rubber { ln_limit, .. } => {
                let limit = ln_limit.is_some().then_some(Variable::Limit);
                [Variable::Share, Variable::FreeLength].into_iter().chain(limit).collect()
            }
            Bend::Free { .. } => self.bend.free_slopes().into_iter().map(Variable::Slope).collect(),
        }
    }

    /// Whether its memory is in Hencky's strain, in which a film of constant volume couples its stroke to the force by 1 / length.
    pub fn is_hencky(&self) -> bool {
        matches!(self.bend, Bend::Measure { fitted: 0, .. })
    }

    /// The same film of constant volume with its memory in Hencky's strain.
    pub(super) fn to_hencky(&self) -> Self {
        let mut hencky = Self { bend: self.bend.to_hencky(self.actuator.length_m), ..self.clone() };
        hencky.actuator.stretch_coupling = 1.0 / self.actuator.length_m;
        hencky
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
    /// The exponent of a strain measure.
    Exponent,
    /// ln of the length of a strain measure (m).
    MeasureLength,
    /// Slope at a knot of the spring beside the memory, in shares of a stiffness.
    Steepness(usize),
    /// ln of the stiffness at rest of the spring in series (N/m).
    SeriesStiffness,
    /// b of the spring in series.
    SeriesBend,
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
    /// Change of the stiffness with each K, as a share.
    StiffnessSlope,
    /// Activation energy of relaxation and creep, kJ/mol.
    Activation,
}

impl Variable {
    /// The variables of the elements of a model with `branches` branches.
    pub fn of_model(branches: usize) -> Vec<Self> {
        (0..=2 * branches).flat_map(|element| [Self::Coefficient(element), Self::Order(element)]).collect()
    }

    /// The number of `candidate` that it changes, or its logarithm; none where the candidate has none.
    fn place(self, candidate: &mut Candidate) -> Option<&mut f64> {
        let Candidate { actuator, elements, offset_m, delay_s, bend, spring, temperature, .. } = candidate;
        Some(match (self, bend, spring) {
            (Self::Coefficient(element), ..) => &mut elements[element].c,
            (Self::Order(element), ..) => &mut elements[element].alpha,
            (Self::StretchCoupling, ..) => &mut actuator.stretch_coupling,
            (Self::Share, Bend::Rubber { share, .. }, _) => share,
            (Self::Limit, Bend::Rubber { ln_limit, .. }, _) => ln_limit.get_or_insert(f64::INFINITY),
            (Self::FreeLength, Bend::Rubber { ln_length, .. }, _) => ln_length,
            (Self::Slope(knot), Bend::Free { ln_slopes, .. }, _) => &mut ln_slopes[knot],
            (Self::Exponent, Bend::Measure { exponent, .. }, _) => exponent,
            (Self::MeasureLength, Bend::Measure { ln_length, .. }, _) => ln_length,
            (Self::Steepness(knot), _, Some(Elastic::Free { shares, .. })) => &mut shares[knot],
            (Self::SeriesStiffness, _, Some(Elastic::Rising(rising))) => &mut rising.ln_stiffness,
            (Self::SeriesBend, _, Some(Elastic::Rising(rising))) => &mut rising.bend,
            (Self::Offset, ..) => offset_m,
            (Self::Delay, ..) => delay_s,
            (Self::Permittivity, ..) => &mut actuator.relative_permittivity,
            (Self::Length, ..) => &mut actuator.length_m,
            (Self::Width, ..) => &mut actuator.width_m,
            (Self::Thickness, ..) => &mut actuator.thickness_m,
            (Self::Mass, ..) => &mut actuator.mass_kg,
            (Self::StiffnessSlope, ..) => &mut temperature.as_mut()?.stiffness_per_k,
            (Self::Activation, ..) => &mut temperature.as_mut()?.activation_kj_per_mol,
            _ => return None,
        })
    }

    /// Whether a candidate has the quantity itself, which must stay positive, and a fit changes its logarithm.
    fn is_logarithm(self) -> bool {
        matches!(
            self,
            Self::Coefficient(_) | Self::Permittivity | Self::Length | Self::Width | Self::Thickness | Self::Mass
        )
    }

    /// Its value in `candidate`: the logarithm of a quantity that must stay positive. 0 where the candidate has none.
    pub fn get(self, candidate: &Candidate) -> f64 {
        if self == Self::Saturation {
            return candidate.actuator.saturation() * PER_KILOVOLT2;
        }
        let value = self.place(&mut candidate.clone()).map_or(0.0, |value| *value);
        if self.is_logarithm() { value.ln() } else { value }
    }

    /// Sets it in `candidate`.
    pub fn set(self, candidate: &mut Candidate, value: f64) {
        if self == Self::Saturation {
            candidate.actuator.saturation_v = (value > 0.0).then(|| (PER_KILOVOLT2 / value).sqrt());
        } else if let Some(place) = self.place(candidate) {
            *place = if self.is_logarithm() { value.exp() } else { value };
        }
    }

    /// Whether it is of an element.
    pub fn is_of_memory(self) -> bool {
        matches!(self, Self::Coefficient(_) | Self::Order(_))
    }

    /// Whether it is of how the temperature changes the film.
    pub fn is_of_temperature(self) -> bool {
        matches!(self, Self::StiffnessSlope | Self::Activation)
    }

    /// Whether it is of a curve.
    pub fn is_of_curve(self) -> bool {
        self.is_of_bend() || self.is_of_series() || matches!(self, Self::Steepness(_))
    }

    /// Whether it is of the spring in series.
    pub fn is_of_series(self) -> bool {
        matches!(self, Self::SeriesStiffness | Self::SeriesBend)
    }

    /// Whether it is of the curve that force follows, the spring aside.
    pub fn is_of_bend(self) -> bool {
        matches!(
            self,
            Self::Share | Self::Limit | Self::FreeLength | Self::Slope(_) | Self::Exponent | Self::MeasureLength
        )
    }

    /// The quantity itself, in SI units.
    pub fn natural(self, candidate: &Candidate) -> f64 {
        let value = self.get(candidate);
        match (self, &candidate.spring) {
            (Self::Steepness(_), Some(Elastic::Free { stiffness_n_per_m, .. })) => value * stiffness_n_per_m,
            // 1/m².
            (Self::SeriesBend, Some(Elastic::Rising(rising))) => value / (rising.length_m * rising.length_m),
            (Self::Saturation, _) => candidate.actuator.saturation_v.unwrap_or(f64::INFINITY),
            (Self::Limit | Self::FreeLength | Self::Slope(_) | Self::MeasureLength | Self::SeriesStiffness, _) => {
                value.exp()
            }
            _ if self.is_logarithm() => value.exp(),
            _ => value,
        }
    }

    /// Its name, as a parameter file has it, and the bounds of its value: orders 0…1, saturation at least 0, all others some decades around 1
    /// in SI units.
    fn row(self) -> (&'static str, (f64, f64)) {
        let decades = |low: f64, high: f64| (low * LN_10, high * LN_10);
        match self {
            Self::Coefficient(_) => ("c", decades(-3.0, 12.0)),
            Self::Order(_) => ("alpha", (0.0, 1.0)),
            Self::StretchCoupling => ("stretch_coupling", (-1e4, 1e4)),
            Self::Saturation => ("saturation_v", (0.0, 100.0)),
            Self::Share => ("curve.share", (-0.5, 1.5)),
            Self::Limit => ("curve.limit", decades(-1.0, 5.0)),
            Self::FreeLength => ("curve.free_length_m", decades(-5.0, 2.0)),
            Self::Slope(_) => ("curve.slope", decades(-2.0, 2.0)),
            Self::Exponent => ("curve.exponent", (-10.0, 10.0)),
            Self::MeasureLength => ("curve.length_m", decades(-5.0, 2.0)),
            Self::Steepness(_) => ("spring.slope_n_per_m", (-1e3, 1e3)),
            Self::SeriesStiffness => ("spring.stiffness_n_per_m", decades(-3.0, 12.0)),
            Self::SeriesBend => ("spring.bend_per_m2", (-10.0, 100.0)),
            Self::Offset => ("offset_m", (-1.0, 1.0)),
            Self::Delay => ("delay_s", (-MAX_SENSOR_DELAY_S, MAX_SENSOR_DELAY_S)),
            Self::Permittivity => ("relative_permittivity", decades(-6.0, 6.0)),
            Self::Length => ("length_m", decades(-9.0, 3.0)),
            Self::Width => ("width_m", decades(-9.0, 3.0)),
            Self::Thickness => ("thickness_m", decades(-9.0, 3.0)),
            Self::Mass => ("mass_kg", decades(-6.0, 6.0)),
            Self::StiffnessSlope => ("stiffness_per_k", (-0.1, 0.1)),
            Self::Activation => ("activation_kj_per_mol", (-1000.0, 1000.0)),
        }
    }

    /// Bounds of the value.
    pub fn bounds(self) -> (f64, f64) {
        self.row().1
    }

    /// The same in a search from `candidate`. Beside a curve or a saturation the coupling stays what the geometry allows: without
    /// that bound one compensates for the other.
    pub fn bounds_in(self, candidate: &Candidate) -> (f64, f64) {
        let (low, high) = self.bounds();
        if self != Self::StretchCoupling {
            return (low, high);
        }
        let most = MAX_THINNING / candidate.actuator.length_m;
        let high = match (!candidate.is_straight(), candidate.actuator.saturation_v.is_some()) {
            (false, false) => high,
            (true, true) if !candidate.is_in_series() => MAX_GROWTH / candidate.actuator.length_m,
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
        let (name, _) = self.row();
        match *self {
            Self::Coefficient(0) | Self::Order(0) => write!(f, "main.{name}"),
            Self::Coefficient(element) | Self::Order(element) => {
                write!(f, "branches[{}][{}].{name}", (element - 1) / 2, (element - 1) % 2)
            }
            Self::Slope(knot) | Self::Steepness(knot) => write!(f, "{name}[{knot}]"),
            _ => f.write_str(name),
        }
    }
}
