//! What a fit changes: the elements of the model, and quantities of the actuator and the sensor.

use std::fmt;

use springpot::{Actuator, Maxwell, ModelError, Springpot, Topology};

use crate::files::parameters::DisplacementSensor;

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

    /// The displacement sensor.
    pub fn sensor(&self) -> DisplacementSensor {
        DisplacementSensor { offset_m: self.offset_m }
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

/// A quantity that a fit may change.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Variable {
    /// ln c of an element.
    Coefficient(usize),
    /// α of an element.
    Order(usize),
    /// κ in 1/m.
    StretchCoupling,
    /// The sensor's offset, m.
    Offset,
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
            Self::Offset => candidate.offset_m,
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
            Self::Offset => candidate.offset_m = value,
            Self::Permittivity => actuator.relative_permittivity = value.exp(),
            Self::Length => actuator.length_m = value.exp(),
            Self::Width => actuator.width_m = value.exp(),
            Self::Thickness => actuator.thickness_m = value.exp(),
            Self::Mass => actuator.mass_kg = value.exp(),
        }
    }

    /// The quantity itself, in SI units.
    pub fn natural(self, candidate: &Candidate) -> f64 {
        let value = self.get(candidate);
        match self {
            Self::Order(_) | Self::StretchCoupling | Self::Offset => value,
            _ => value.exp(),
        }
    }

    /// Bounds of the value: orders 0…1, coupling at least 0, all others some decades around 1 in SI units.
    pub fn bounds(self) -> (f64, f64) {
        let decades =
            |low: i32, high: i32| (f64::from(low) * std::f64::consts::LN_10, f64::from(high) * std::f64::consts::LN_10);
        match self {
            Self::Coefficient(_) => decades(-3, 12),
            Self::Order(_) => (0.0, 1.0),
            Self::StretchCoupling => (0.0, 1e4),
            Self::Offset => (-1.0, 1.0),
            Self::Permittivity => decades(-6, 6),
            Self::Length | Self::Width | Self::Thickness => decades(-9, 3),
            Self::Mass => decades(-6, 6),
        }
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
            Self::Offset => f.write_str("offset_m"),
            Self::Permittivity => f.write_str("relative_permittivity"),
            Self::Length => f.write_str("length_m"),
            Self::Width => f.write_str("width_m"),
            Self::Thickness => f.write_str("thickness_m"),
            Self::Mass => f.write_str("mass_kg"),
        }
    }
}
