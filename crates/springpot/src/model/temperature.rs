//! How the temperature changes a film (time–temperature superposition; Ferry 1980).

use crate::error::ModelError;
use crate::model::{Maxwell, Springpot};
use crate::numbers::Numbers;

/// The gas constant, kJ/(mol K).
const GAS_CONSTANT: f64 = 8.314_462_618e-3;
/// 0 °C in K.
const ZERO_C: f64 = 273.15;
/// Temperatures of films, °C.
const TEMPERATURES_C: [f64; 2] = [-100.0, 250.0];
/// Largest slope, 1/K, and activation energy, kJ/mol.
const MAX_SLOPE: f64 = 0.1;
const MAX_ACTIVATION: f64 = 1000.0;
/// Smallest and largest factor of stiffness for which a straight line is believed, and the largest logarithm of the factor of times.
const STIFFNESS: [f64; 2] = [0.1, 10.0];
const MAX_LN_TIME: f64 = 12.0;

/// How the temperature changes a film that was fitted at another one: the stiffness along a straight line, and all times by one factor
/// (time–temperature superposition), after Arrhenius.
///
/// At the temperature T with the reference T₀, both in K where they are divided by, the film has
///
/// ```text
/// k = 1 + stiffness_per_k (T − T₀)                      times its stiffness,
/// a = exp(activation_kj_per_mol / R · (1/T − 1/T₀))     times its relaxation and creep times.
/// ```
///
/// A springpot `c D^α` becomes `k a^α c D^α`: [`Maxwell::at_temperature`]. A spring becomes k times as stiff, curves and strain measures stay.
/// Under a voltage a permittivity that changes is seen as a stiffness.
///
/// ```
/// use springpot::{Preset, TemperatureDependence};
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// let film = Preset::TABLE3_N2.model()?; // at 20 °C
/// let dependence = TemperatureDependence { reference_c: 20.0, stiffness_per_k: -0.005, activation_kj_per_mol: 60.0 };
/// let warm = film.at_temperature(&dependence, 40.0)?;
///
/// // At 40 °C it is a tenth softer, and creeps within a fifth of the time.
/// let (stiffness, time) = (dependence.stiffness_factor(40.0), dependence.time_factor(40.0));
/// assert!((stiffness - 0.9).abs() < 1e-12 && (time - 0.207).abs() < 1e-3);
/// assert!((warm.creep_compliance(time * 60.0) * stiffness / film.creep_compliance(60.0) - 1.0).abs() < 1e-5);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct TemperatureDependence {
    /// The temperature of the parameters, °C.
    pub reference_c: f64,
    /// Change of the stiffness with each K, as a share of the stiffness at the reference.
    pub stiffness_per_k: f64,
    /// Activation energy of relaxation and creep, kJ/mol: above 0 they are faster in a warmer film.
    pub activation_kj_per_mol: f64,
}

impl TemperatureDependence {
    /// A film that is the same at all temperatures.
    #[must_use]
    pub const fn none(reference_c: f64) -> Self {
        Self { reference_c, stiffness_per_k: 0.0, activation_kj_per_mol: 0.0 }
    }

    /// Factor of the stiffness at a temperature (°C).
    #[must_use]
    pub fn stiffness_factor(&self, temperature_c: f64) -> f64 {
        1.0 + self.stiffness_per_k * (temperature_c - self.reference_c)
    }

    /// Factor of all relaxation and creep times at a temperature (°C).
    #[must_use]
    pub fn time_factor(&self, temperature_c: f64) -> f64 {
        libm::exp(self.ln_time_factor(temperature_c))
    }

    /// ln of the [`time_factor`](Self::time_factor).
    #[must_use]
    pub fn ln_time_factor(&self, temperature_c: f64) -> f64 {
        self.activation_kj_per_mol * self.ln_time_per_activation(temperature_c)
    }

    /// ln of the [`time_factor`](Self::time_factor) of an activation energy of 1 kJ/mol.
    #[must_use]
    pub fn ln_time_per_activation(&self, temperature_c: f64) -> f64 {
        (1.0 / (temperature_c + ZERO_C) - 1.0 / (self.reference_c + ZERO_C)) / GAS_CONSTANT
    }

    /// Visits its numbers.
    #[doc(hidden)]
    #[allow(clippy::cast_possible_truncation)] // as all numbers of a film
    pub fn numbers(&self, take: &mut impl Numbers<f32>) {
        take.structure("temperature", "How the film changes with its temperature: springpot_temperature_factors.");
        take.number("reference", self.reference_c as f32, "at which it is its law, degrees C");
        take.number("stiffness", self.stiffness_per_k as f32, "change of the stiffness, 1/K");
        take.number("activation", self.activation_kj_per_mol as f32, "energy of relaxation and creep, kJ/mol");
    }

    /// The same film with another reference.
    ///
    /// # Errors
    ///
    /// As [`check_at`](Self::check_at).
    pub fn with_reference(&self, reference_c: f64) -> Result<Self, ModelError> {
        self.check_at(reference_c)?;
        let stiffness_per_k = self.stiffness_per_k / self.stiffness_factor(reference_c);
        Ok(Self { reference_c, stiffness_per_k, ..*self })
    }

    /// Checks the numbers.
    ///
    /// # Errors
    ///
    /// [`ModelError::Temperature`] or [`ModelError::TemperatureDependence`] for a temperature, a slope or an activation energy out of
    /// range.
    pub fn check(&self) -> Result<(), ModelError> {
        let Self { reference_c, stiffness_per_k, activation_kj_per_mol } = *self;
        is_of_a_film(reference_c)?;
        for (quantity, value, most) in [
            ("stiffness_per_k", stiffness_per_k, MAX_SLOPE),
            ("activation_kj_per_mol", activation_kj_per_mol, MAX_ACTIVATION),
        ] {
            let within = value.abs() <= most;
            if !within {
                return Err(ModelError::TemperatureDependence { quantity, value, most });
            }
        }
        Ok(())
    }

    /// Checks the values, and that they are valid at a temperature (°C).
    ///
    /// # Errors
    ///
    /// As [`check`](Self::check), and [`ModelError::BeyondTemperature`] where the stiffness would be less than a tenth or more than ten times that at the
    /// reference, or a time more than some 10⁵ times another.
    pub fn check_at(&self, temperature_c: f64) -> Result<(), ModelError> {
        self.check()?;
        is_of_a_film(temperature_c)?;
        let (stiffness, ln_time) = (self.stiffness_factor(temperature_c), self.ln_time_factor(temperature_c));
        let [least, most] = STIFFNESS;
        if (least..=most).contains(&stiffness) && ln_time.abs() <= MAX_LN_TIME {
            return Ok(());
        }
        Err(ModelError::BeyondTemperature { temperature_c, stiffness, time: libm::exp(ln_time) })
    }

    /// `element` at a temperature.
    #[must_use]
    pub fn springpot_at(&self, element: Springpot, temperature_c: f64) -> Springpot {
        let factor =
            self.stiffness_factor(temperature_c) * libm::exp(element.alpha * self.ln_time_factor(temperature_c));
        Springpot { c: element.c * factor, ..element }
    }
}

impl Maxwell {
    /// The model at a temperature: k a^α times the coefficient of every springpot ([`TemperatureDependence`]). The mass stays.
    ///
    /// # Errors
    ///
    /// As [`TemperatureDependence::check_at`].
    pub fn at_temperature(&self, dependence: &TemperatureDependence, temperature_c: f64) -> Result<Self, ModelError> {
        dependence.check_at(temperature_c)?;
        let at = |element: Springpot| dependence.springpot_at(element, temperature_c);
        let mut branches: heapless::Vec<[Springpot; 2], { crate::MAX_BRANCHES }> = heapless::Vec::new();
        branches.extend(self.branches().iter().map(|pair| pair.map(at)));
        Self::new(at(self.main()), &branches, self.topology(), self.mass_kg())
    }
}

fn is_of_a_film(temperature_c: f64) -> Result<(), ModelError> {
    let [least, most] = TEMPERATURES_C;
    if (least..=most).contains(&temperature_c) { Ok(()) } else { Err(ModelError::Temperature(temperature_c)) }
}
