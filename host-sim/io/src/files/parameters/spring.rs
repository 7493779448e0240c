//! The `[spring]` table: the elastic force beside the film's memory.

use std::fmt::Write;

use serde::Deserialize;
use springpot::{Knot, Spring};

use crate::error::short;

/// The table as it is read: a stiffness, or points.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SpringTable {
    stiffness_n_per_m: Option<f64>,
    displacement_m: Option<Vec<f64>>,
    force_n: Option<Vec<f64>>,
    slope_n_per_m: Option<Vec<f64>>,
}

impl SpringTable {
    /// The spring, or what is wrong.
    pub(super) fn spring(&self) -> Result<Spring, String> {
        let spring = match (self.stiffness_n_per_m, &self.displacement_m, &self.force_n) {
            (Some(stiffness), None, None) if self.slope_n_per_m.is_none() => Spring::linear(stiffness),
            (None, Some(displacement), Some(force)) => {
                let lengths = [force.len(), self.slope_n_per_m.as_ref().map_or(force.len(), Vec::len)];
                if lengths != [displacement.len(); 2] {
                    return Err("displacement_m, force_n and slope_n_per_m must have as many numbers".into());
                }
                let points = displacement.iter().copied().zip(force.iter().copied());
                match &self.slope_n_per_m {
                    None => Spring::through(&points.collect::<Vec<_>>()),
                    Some(slopes) => {
                        let knot = |((displacement, value), &slope)| Knot { displacement, value, slope };
                        Spring::new(&points.zip(slopes).map(knot).collect::<Vec<_>>())
                    }
                }
            }
            _ => return Err("it needs stiffness_n_per_m, or displacement_m and force_n; see docs/formats.md".into()),
        };
        spring.map_err(|e| short(&e))
    }
}

/// The table as TOML text.
pub(super) fn to_toml(spring: &Spring) -> String {
    let mut text = "\n[spring] # beside the memory, whose strain measure is [curve]\n".to_owned();
    let mut row = |name: &str, of: fn(&Knot<f64>) -> f64| {
        let numbers: Vec<String> = spring.knots().iter().map(|knot| format!("{:?}", of(knot))).collect();
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{name} = [{}]", numbers.join(", "));
    };
    row("displacement_m", |knot| knot.displacement);
    row("force_n", |knot| knot.value);
    row("slope_n_per_m", |knot| knot.slope);
    text
}
