//! From a film's capacitance to its displacement.

use crate::control::path::clamp;
use crate::error::{SelfSensingError, first_not_positive};
use crate::law::{Coefficients, Compressed, DECAY, Decay, Law, LawOptions, LawState};
use crate::model::{Maxwell, Springpot, Topology};
use crate::numbers::Numbers;
use crate::scalar::Real;

/// How a film's displacement x follows from its capacitance C, as calibrated with a displacement sensor.
///
/// ```text
/// q = C / C_rest − 1,    u = a₁ q + a₂ q² + a₃ q³,    x = u + k D^α u
/// ```
///
/// The polynomial is the film's geometry: of a film of constant volume under electrodes of constant width C grows as the square of its
/// stretch, of one that is stretched alike in both directions as the fourth power. The permittivity of stretched acrylic films changes for
/// minutes after a change of stretch, so a constant capacitance is not a constant displacement (Rosset, O'Brien, Gisby, Xu, Shea and
/// Anderson 2013, "Self-sensing dielectric elastomer actuators in closed-loop operation"): the springpot k D^α describes that.
///
/// ```
/// use springpot::CapacitanceRelation;
///
/// // A film of 60 mm whose capacitance grows as the square of its stretch.
/// let relation = CapacitanceRelation::of_geometry(600e-12, 0.06, 2.0, 800e-12);
/// let change: f64 = 1.1 * 1.1 - 1.0; // of a film that is a tenth longer
/// let displacement_m = relation.displacement_of_change(change);
/// assert!((displacement_m - 6e-3).abs() < 0.02e-3);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct CapacitanceRelation {
    /// Capacitance at x = 0 after a long rest, F; with the cable.
    pub rest_f: f64,
    /// Largest capacitance of the calibration, F. The polynomial is used up to a quarter of the range beyond it.
    pub max_f: f64,
    /// a₁, a₂ and a₃, m.
    pub stroke_m: [f64; 3],
    /// k, s^α; may be negative. 0: capacitance and displacement change together.
    pub creep: f64,
    /// α of that springpot, between 0 and 1.
    pub alpha: f64,
    /// Standard deviation of x by this relation where nothing else corrects it, m.
    pub uncertainty_m: f64,
}

/// Share of the range of calibration beyond its ends, in which the polynomial must rise.
const BEYOND: f64 = 0.25;
/// Memory of the springpot, and the error of its modulus within it: it describes a few percent of the displacement.
const HORIZON_S: f64 = 3600.0;
const TOLERANCE: f64 = 1e-2;
/// Places at which the slope of the polynomial is checked.
const PLACES: u8 = 64;

impl CapacitanceRelation {
    /// The relation of a film of `length_m` (m) at x = 0 whose capacitance grows with its stretch to the power `exponent`, up to `max_f`
    /// (F): 2 for electrodes of constant width, 4 for a film that is stretched equally in both directions, 1 for one that is free to become
    /// narrower. It does not creep; its uncertainty is a hundredth of the stroke at `max_f`.
    #[must_use]
    pub fn of_geometry(rest_f: f64, length_m: f64, exponent: f64, max_f: f64) -> Self {
        // (1 + q)^p to third order.
        let p = 1.0 / exponent;
        let stroke_m = [p, p * (p - 1.0) / 2.0, p * (p - 1.0) * (p - 2.0) / 6.0].map(|a| length_m * a);
        let relation = Self { rest_f, max_f, stroke_m, creep: 0.0, alpha: 0.2, uncertainty_m: 0.0 };
        Self { uncertainty_m: 0.01 * relation.displacement_of_change(max_f / rest_f - 1.0), ..relation }
    }

    /// u of a relative `change` q of the capacitance, m.
    #[must_use]
    pub fn displacement_of_change(&self, change: f64) -> f64 {
        let [a, b, c] = self.stroke_m;
        change * (a + change * (b + change * c))
    }

    /// The least and the largest relative change that the polynomial describes.
    fn changes(&self) -> [f64; 2] {
        let range = self.max_f / self.rest_f - 1.0;
        [-BEYOND * range, (1.0 + BEYOND) * range]
    }

    fn check(&self) -> Result<(), SelfSensingError> {
        let values = [("rest_f", self.rest_f), ("max_f", self.max_f), ("uncertainty_m", self.uncertainty_m)];
        if let Some((quantity, value)) = first_not_positive(&values) {
            return Err(SelfSensingError::NotPositive { quantity, value });
        }
        if self.max_f <= self.rest_f {
            return Err(SelfSensingError::Range { rest_f: self.rest_f, max_f: self.max_f });
        }
        // Of order 0 and 1 it would be part of the polynomial, or a derivative of noise.
        if !(self.alpha > 0.0 && self.alpha < 1.0 && self.creep.is_finite()) {
            return Err(SelfSensingError::Creep { creep: self.creep, alpha: self.alpha });
        }
        let [a, b, c] = self.stroke_m;
        let [low, high] = self.changes();
        for place in 0..=PLACES {
            let change = low + (high - low) * f64::from(place) / f64::from(PLACES);
            let slope = a + change * (2.0 * b + 3.0 * c * change);
            if !(slope.is_finite() && slope > 0.0) {
                return Err(SelfSensingError::NotMonotone { capacitance_f: self.rest_f * (1.0 + change) });
            }
        }
        Ok(())
    }
}

/// Memory of the springpot.
type Memory<T> = Compressed<T, 4, 11, 0>;

/// The springpot of a [`CapacitanceRelation`] in numbers, for samples at a certain interval: [`SelfSensing::creep`](crate::SelfSensing::creep).
pub type CreepCoefficients<T> = Coefficients<T, 4, 11, 0>;

/// A [`CapacitanceRelation`] as it is stepped once a block.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Relation<T> {
    rest: T,
    per_rest: T,
    changes: [T; 2],
    stroke: [T; 3],
    slope: [T; 2],
    creep: T,
    /// The change of x at once over that of u.
    instant: T,
    law: Law<T, Memory<T>>,
}

/// Its state.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct RelationState<T: Real> {
    creep: LawState<T, Memory<T>>,
}

impl<T: Real> Relation<T> {
    /// `relation`, stepped every `step_s` (s).
    #[inline(never)] // a small chip has no room for it beside what is built next
    pub(crate) fn new(relation: &CapacitanceRelation, step_s: f64) -> Result<Self, SelfSensingError> {
        relation.check()?;
        let springpot = Springpot::new(1.0, relation.alpha);
        let Ok(model) = Maxwell::new(springpot, &[], Topology::Eq11, 0.0) else {
            return Err(SelfSensingError::Creep { creep: relation.creep, alpha: relation.alpha });
        };
        let options = LawOptions::at_step(step_s).with_horizon(HORIZON_S).with_tolerance(TOLERANCE);
        Ok(Self::from_law(relation, Law::compressed(&model, options)?))
    }

    /// The same with its springpot in numbers.
    pub(crate) fn with_creep(
        relation: &CapacitanceRelation,
        step_s: f64,
        creep: &CreepCoefficients<T>,
    ) -> Result<Self, SelfSensingError> {
        relation.check()?;
        Ok(Self::from_law(relation, Law::from_coefficients(creep, step_s, 0.0)?))
    }

    fn from_law(relation: &CapacitanceRelation, law: Law<T, Memory<T>>) -> Self {
        let [_, b, c] = relation.stroke_m;
        Self {
            rest: T::from_f64(relation.rest_f),
            per_rest: T::from_f64(1.0 / relation.rest_f),
            changes: relation.changes().map(T::from_f64),
            stroke: relation.stroke_m.map(T::from_f64),
            slope: [2.0 * b, 3.0 * c].map(T::from_f64),
            creep: T::from_f64(relation.creep),
            instant: T::from_f64(1.0 + relation.creep * law.stiffness().to_f64()),
            law,
        }
    }

    /// Its springpot in numbers.
    pub(crate) fn creep(&self) -> CreepCoefficients<T> {
        self.law.coefficients()
    }

    /// Visits the constants of a step.
    pub(crate) fn numbers(&self, take: &mut impl Numbers<T>) {
        take.number("rest", self.rest, "capacitance, F");
        take.number("per_rest", self.per_rest, "1/F");
        take.array("changes", self.changes, "least and largest of it, relative");
        take.array("stroke", self.stroke, "m");
        take.array("slope", self.slope, "m");
        take.number("creep", self.creep, "");
        take.number("instant", self.instant, "");
        let Compressed { head, fast, .. } = self.law.memory();
        take.number("creep_stiffness", self.law.stiffness(), "");
        take.array("creep_head", *head, "g_0 + g_1, g_2, ...");
        take.records("creep_modes", &DECAY, fast.map(Decay::numbers), "");
    }

    /// Capacitance at rest, F.
    pub(crate) fn rest(&self) -> T {
        self.rest
    }

    /// Change of x over a relative change of the capacitance at rest, m.
    pub(crate) fn slope_at_rest(&self) -> f64 {
        self.stroke[0].to_f64() * self.instant.to_f64()
    }

    pub(crate) fn state(&self) -> RelationState<T> {
        RelationState { creep: self.law.state() }
    }

    /// x (m) of a `capacitance` (F), and what a relative change of it changes (m).
    #[inline]
    pub(crate) fn displacement(&self, state: &mut RelationState<T>, capacitance: T) -> (T, T) {
        let one = T::from_f64(1.0);
        let [low, high] = self.changes;
        let change = clamp(capacitance * self.per_rest - one, low, high);
        let [a, b, c] = self.stroke;
        let straight = change * (a + change * (b + change * c));
        let slope = a + change * (self.slope[0] + self.slope[1] * change);
        let creep = self.law.force(&mut state.creep, straight);
        (straight + self.creep * creep, self.instant * slope * (one + change))
    }
}
