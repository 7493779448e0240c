//! The `[curve]` table: how a film stiffens and softens with stretch.

use std::fmt::Write;

use serde::Deserialize;
use springpot::{Actuator, Curve, CurveError, Knot, Measure, Rubber};
use toml::Spanned;

use crate::error::short;

/// An elastic curve as it is written, and as the pieces that a controller runs.
#[derive(Clone, Debug, PartialEq)]
pub struct ElasticCurve {
    shape: Shape,
    curve: Curve,
}

/// Source of an elastic curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A strip of rubber; Gent's limit is infinite for Mooney–Rivlin.
    Rubber(Rubber),
    /// A strain measure.
    Measure(Measure),
    /// Monotone cubic pieces.
    Free,
}

impl ElasticCurve {
    /// The curve of `rubber` over displacements from `low_m` to `high_m`.
    pub fn rubber(rubber: Rubber, low_m: f64, high_m: f64) -> Result<Self, CurveError> {
        Ok(Self { shape: Shape::Rubber(rubber), curve: rubber.curve(low_m, high_m)? })
    }

    /// The curve of `measure` over displacements from `low_m` to `high_m`.
    pub fn measure(measure: Measure, low_m: f64, high_m: f64) -> Result<Self, CurveError> {
        Ok(Self { shape: Shape::Measure(measure), curve: measure.curve(low_m, high_m)? })
    }

    /// A curve of pieces.
    pub fn free(curve: Curve) -> Self {
        Self { shape: Shape::Free, curve }
    }

    /// Its source.
    pub fn shape(&self) -> Shape {
        self.shape
    }

    /// Its pieces.
    pub fn pieces(&self) -> &Curve {
        &self.curve
    }

    /// Its name in a file.
    pub fn name(&self) -> &'static str {
        match self.shape {
            Shape::Rubber(rubber) if rubber.limit == f64::INFINITY => "mooney-rivlin",
            Shape::Rubber(_) => "gent",
            Shape::Measure(_) => "measure",
            Shape::Free => "free",
        }
    }

    /// The table as TOML text.
    pub(super) fn to_toml(&self) -> String {
        let mut text = format!("\n[curve]\nelastic = \"{}\"\n", self.name());
        // Writing to a string cannot fail.
        match self.shape {
            Shape::Rubber(Rubber { share, limit, rest_stretch, free_length_m }) => {
                let _ = writeln!(text, "share = {share:?}");
                if limit.is_finite() {
                    let _ = writeln!(text, "limit = {limit:?} # of I1 - 3, after Gent");
                }
                let _ = writeln!(text, "rest_stretch = {rest_stretch:?} # at x = 0");
                let _ = writeln!(text, "free_length_m = {free_length_m:?} # without any load");
                let (low_m, high_m) = self.curve.range();
                let _ = writeln!(text, "from_m = {low_m:?}\nto_m = {high_m:?}");
            }
            Shape::Measure(Measure { exponent, length_m }) => {
                let (low_m, high_m) = self.curve.range();
                let _ = writeln!(text, "exponent = {exponent:?} # 0 is Hencky's strain, 1 the displacement");
                let _ = writeln!(text, "length_m = {length_m:?} # at x = 0\nfrom_m = {low_m:?}\nto_m = {high_m:?}");
            }
            Shape::Free => text.push_str(&knots_to_toml(self.curve.knots(), "value_m", "slope")),
        }
        text
    }
}

/// The rows of `knots` as TOML text, those of their values and slopes by these names.
pub(super) fn knots_to_toml(knots: &[Knot<f64>], value: &str, slope: &str) -> String {
    let row = |name: &str, of: fn(&Knot<f64>) -> f64| {
        let numbers: Vec<f64> = knots.iter().map(of).collect();
        format!("{name} = {numbers:?}\n")
    };
    row("displacement_m", |knot| knot.displacement) + &row(value, |knot| knot.value) + &row(slope, |knot| knot.slope)
}

#[derive(Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum ElasticName {
    Linear,
    MooneyRivlin,
    Gent,
    Measure,
    Free,
}

/// The table as it is read.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CurveTable {
    elastic: ElasticName,
    share: Option<f64>,
    limit: Option<f64>,
    rest_stretch: Option<f64>,
    free_length_m: Option<f64>,
    exponent: Option<f64>,
    length_m: Option<f64>,
    from_m: Option<f64>,
    to_m: Option<f64>,
    displacement_m: Option<Spanned<Vec<f64>>>,
    value_m: Option<Vec<f64>>,
    slope: Option<Vec<f64>>,
}

impl CurveTable {
    /// The curve for a film on `actuator`, none for a linear one; or what is wrong.
    pub(super) fn curve(&self, actuator: &Actuator) -> Result<Option<ElasticCurve>, String> {
        let rubber = matches!(self.elastic, ElasticName::MooneyRivlin | ElasticName::Gent);
        let measure = self.elastic == ElasticName::Measure;
        for (name, there, wanted) in [
            ("share", self.share.is_some(), rubber),
            ("limit", self.limit.is_some(), self.elastic == ElasticName::Gent),
            ("rest_stretch", self.rest_stretch.is_some(), rubber),
            ("free_length_m", self.free_length_m.is_some(), rubber),
            ("exponent", self.exponent.is_some(), measure),
            ("length_m", self.length_m.is_some(), measure),
            ("from_m", self.from_m.is_some(), rubber || measure),
            ("to_m", self.to_m.is_some(), rubber || measure),
            ("displacement_m", self.displacement_m.is_some(), self.elastic == ElasticName::Free),
            ("value_m", self.value_m.is_some(), self.elastic == ElasticName::Free),
            ("slope", self.slope.is_some(), self.elastic == ElasticName::Free),
        ] {
            if there && !wanted {
                return Err(format!(
                    "{name} does not belong to this kind of curve; see docs/formats.md, \"Elastic curve\""
                ));
            }
        }
        let needed = |name: &str, value: Option<f64>| value.ok_or_else(|| format!("the curve needs {name}"));
        match self.elastic {
            ElasticName::Linear => Ok(None),
            ElasticName::MooneyRivlin | ElasticName::Gent => {
                let limit =
                    if self.elastic == ElasticName::Gent { needed("limit", self.limit)? } else { f64::INFINITY };
                if self.elastic == ElasticName::Gent && !limit.is_finite() {
                    return Err("limit must be finite; without one the curve is mooney-rivlin".into());
                }
                // The active area has its length at rest: the free length follows from the rest stretch, and the other way.
                let length_m = actuator.length_m;
                let (rest_stretch, free_length_m) = match (self.rest_stretch, self.free_length_m) {
                    (Some(rest), Some(free)) => (rest, free),
                    (Some(rest), None) => (rest, length_m / rest),
                    (None, Some(free)) => (length_m / free, free),
                    (None, None) => (1.0, length_m),
                };
                let rubber = Rubber { share: needed("share", self.share)?, limit, rest_stretch, free_length_m };
                let range = (needed("from_m", self.from_m)?, needed("to_m", self.to_m)?);
                ElasticCurve::rubber(rubber, range.0, range.1).map(Some).map_err(|e| short(&e))
            }
            ElasticName::Measure => {
                let exponent = needed("exponent", self.exponent)?;
                let measure = Measure { exponent, length_m: self.length_m.unwrap_or(actuator.length_m) };
                let range = (needed("from_m", self.from_m)?, needed("to_m", self.to_m)?);
                ElasticCurve::measure(measure, range.0, range.1).map(Some).map_err(|e| short(&e))
            }
            ElasticName::Free => self.free().map(Some),
        }
    }

    fn free(&self) -> Result<ElasticCurve, String> {
        let displacement =
            self.displacement_m.as_ref().map(Spanned::get_ref).ok_or("the curve needs displacement_m")?;
        let value = self.value_m.as_ref().ok_or("the curve needs value_m")?;
        if value.len() != displacement.len() {
            return Err(format!("{} displacements and {} values", displacement.len(), value.len()));
        }
        let points: Vec<(f64, f64)> = displacement.iter().copied().zip(value.iter().copied()).collect();
        let curve = match &self.slope {
            None => Curve::through(&points),
            Some(slopes) if slopes.len() != points.len() => {
                return Err(format!("{} displacements and {} slopes", points.len(), slopes.len()));
            }
            Some(slopes) => {
                let knot = |(&(displacement, value), &slope): (&(f64, f64), &f64)| Knot { displacement, value, slope };
                let knots: Vec<Knot<f64>> = points.iter().zip(slopes).map(knot).collect();
                // What was written is read unchanged.
                Curve::new(&knots).or_else(|_| Curve::scaled(&knots))
            }
        };
        curve.map(ElasticCurve::free).map_err(|e| short(&e))
    }
}
