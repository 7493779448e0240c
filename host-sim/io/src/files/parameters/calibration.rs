//! A calibration as a table: a parabola's coefficients, or measured points.

use dea_driver::chips::{Calibration, CalibrationError, MAX_POINTS};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use springpot::AmplifierLag;

/// `{ offset, gain, quadratic }` or `{ points }`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    offset: Option<f32>,
    gain: Option<f32>,
    quadratic: Option<f32>,
    points: Option<Vec<[f32; 2]>>,
}

/// An amplifier: its calibration, 1000:1 if it has none, and how it follows.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AmplifierTable {
    offset: Option<f32>,
    gain: Option<f32>,
    quadratic: Option<f32>,
    points: Option<Vec<[f32; 2]>>,
    #[serde(default)]
    rise_s: f64,
    /// As `rise_s`, if it is left out.
    fall_s: Option<f64>,
}

impl AmplifierTable {
    /// Its parts.
    pub(super) fn parts<E: de::Error>(self) -> Result<(Option<Calibration>, AmplifierLag), E> {
        let Self { offset, gain, quadratic, points, rise_s, fall_s } = self;
        let lag = AmplifierLag { rise_s, fall_s: fall_s.unwrap_or(rise_s) };
        let calibration = Table { offset, gain, quadratic, points };
        Ok((if calibration.is_empty() { None } else { Some(calibration.calibration()?) }, lag))
    }
}

impl Table {
    fn is_empty(&self) -> bool {
        matches!(self, Self { offset: None, gain: None, quadratic: None, points: None })
    }

    fn calibration<E: de::Error>(self) -> Result<Calibration, E> {
        match self {
            Self { offset: Some(offset), gain: Some(gain), quadratic: Some(quadratic), points: None } => {
                Ok(Calibration::Parabola { offset, gain, quadratic })
            }
            Self { offset: None, gain: None, quadratic: None, points: Some(points) } => {
                let points = points.as_slice().try_into();
                points.map(Calibration::Points).map_err(|_| E::custom(CalibrationError::Number))
            }
            _ => Err(E::custom(format!(
                "a calibration is {{ offset, gain, quadratic }}, or {{ points = [[volts, value], …] }} with 2 to {MAX_POINTS} points"
            ))),
        }
    }
}

/// For `#[serde(with)]`.
pub fn serialize<S: Serializer>(calibration: &Calibration, serializer: S) -> Result<S::Ok, S::Error> {
    let table = match calibration {
        &Calibration::Parabola { offset, gain, quadratic } => {
            Table { offset: Some(offset), gain: Some(gain), quadratic: Some(quadratic), points: None }
        }
        Calibration::Points(points) => {
            Table { offset: None, gain: None, quadratic: None, points: Some(points.to_vec()) }
        }
    };
    table.serialize(serializer)
}

/// For `#[serde(with)]`. Values that a controller would refuse are found when the blob is made.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Calibration, D::Error> {
    Table::deserialize(deserializer)?.calibration()
}
