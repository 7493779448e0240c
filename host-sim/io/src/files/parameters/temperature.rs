//! The `[temperature]` table: how the temperature changes the film, and the film at another temperature.

use std::borrow::Cow;
use std::fmt::Write;

use springpot::{ModelError, TemperatureDependence};

use super::Parameters;
use crate::error::{Error, Result, short};
use crate::files::recording::Recording;

/// The table of a `dependence` as TOML text.
pub(super) fn to_toml(dependence: &TemperatureDependence) -> String {
    let TemperatureDependence { reference_c, stiffness_per_k, activation_kj_per_mol } = dependence;
    let mut text = "\n[temperature]\n".to_owned();
    // Writing to a string cannot fail.
    let _ = writeln!(text, "reference_c = {reference_c:?} # the temperature of [model], °C");
    let _ = writeln!(text, "stiffness_per_k = {stiffness_per_k:?} # change of the stiffness with each K, as a share");
    let _ = writeln!(text, "activation_kj_per_mol = {activation_kj_per_mol:?} # of relaxation and creep");
    text
}

impl Parameters {
    /// The film along `recording`: at its mean temperature, if it has one and the film a dependence on it.
    ///
    /// # Errors
    ///
    /// [`Error::File`] for a temperature of no film, [`Error::Computation`] for one that its dependence does not reach.
    pub fn along(&self, recording: &Recording) -> Result<Cow<'_, Self>> {
        match self.temperature.and(recording.mean_temperature_c()?) {
            Some(temperature_c) => {
                let there = self.at(temperature_c).map_err(Error::Computation)?;
                Ok(Cow::Owned(there))
            }
            None => Ok(Cow::Borrowed(self)),
        }
    }

    /// The film at a temperature, which becomes the reference.
    ///
    /// # Errors
    ///
    /// [`Error::Field`] for a film that was not fitted at several temperatures, and a temperature that its dependence does not reach.
    pub fn at_temperature(&self, temperature_c: f64) -> Result<Self> {
        self.at(temperature_c).map_err(|cause| Error::field("temperature_c", cause))
    }

    /// Factors of the film's stiffness and of its relaxation times at a temperature, for a law that runs
    /// ([`springpot::TrackingState::set_temperature_factors`]); or the cause of a refusal.
    pub fn temperature_factors(&self, temperature_c: f64) -> std::result::Result<[f64; 2], String> {
        self.at(temperature_c)?;
        let factors = |dependence: &TemperatureDependence| {
            [dependence.stiffness_factor(temperature_c), dependence.time_factor(temperature_c)]
        };
        let [stiffness, time] = self.temperature.as_ref().map_or([1.0; 2], factors);
        if (0.25..=4.0).contains(&stiffness) && (1.0 / 3.0..=3.0).contains(&time) {
            return Ok([stiffness, time]);
        }
        Err(format!(
            "the film has {stiffness:.3} times its stiffness and {time:.3} times its relaxation times there; a running law follows 0.25 to 4 times and a \
             third to three times: run its parameters at that temperature instead"
        ))
    }

    /// [`at_temperature`](Self::at_temperature), or the cause of a refusal.
    pub fn at(&self, temperature_c: f64) -> std::result::Result<Self, String> {
        let Some(dependence) = &self.temperature else {
            return Err("the film has no [temperature] table: fit it to recordings with a column temperature_c, at two temperatures or more".into());
        };
        let refused = |error: ModelError| short(&error);
        let stiffness = dependence.stiffness_factor(temperature_c);
        let spring = self.spring.as_ref().map(|spring| spring.scaled(stiffness)).transpose();
        Ok(Self {
            model: self.model.at_temperature(dependence, temperature_c).map_err(refused)?,
            temperature: Some(dependence.with_reference(temperature_c).map_err(refused)?),
            spring: spring.map_err(|error| short(&error))?,
            ..self.clone()
        })
    }
}
