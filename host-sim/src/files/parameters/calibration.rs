//! A calibration as a table: a parabola's coefficients, or measured points.

use dea_driver::chips::{Calibration, CalibrationError, MAX_POINTS};
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// `{ offset, gain, quadratic }` or `{ points }`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    offset: Option<f32>,
    gain: Option<f32>,
    quadratic: Option<f32>,
    points: Option<Vec<[f32; 2]>>,
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
    match Table::deserialize(deserializer)? {
        Table { offset: Some(offset), gain: Some(gain), quadratic: Some(quadratic), points: None } => {
            Ok(Calibration::Parabola { offset, gain, quadratic })
        }
        Table { offset: None, gain: None, quadratic: None, points: Some(points) } => {
            let points = points.as_slice().try_into();
            points.map(Calibration::Points).map_err(|_| de::Error::custom(CalibrationError::Number))
        }
        _ => Err(de::Error::custom(format!(
            "a calibration is {{ offset, gain, quadratic }}, or {{ points = [[volts, value], …] }} with 2 to {MAX_POINTS} points"
        ))),
    }
}
