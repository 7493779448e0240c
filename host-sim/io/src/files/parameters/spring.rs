//! The `[spring]` table: the elastic force beside the film's memory, or in series with it.

use serde::Deserialize;
use springpot::{Knot, Spring};

use super::curve::knots_to_toml;
use crate::error::short;

/// The table as it is read: a stiffness, or points.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SpringTable {
    /// Whether the spring is in series with the memory, not beside it.
    #[serde(default)]
    in_series: bool,
    stiffness_n_per_m: Option<f64>,
    displacement_m: Option<Vec<f64>>,
    force_n: Option<Vec<f64>>,
    slope_n_per_m: Option<Vec<f64>>,
}

impl SpringTable {
    /// The spring of a film in a file of this `schema`, which `has_curve` or not; or what is wrong.
    pub(super) fn spring(&self, schema: u32, has_curve: bool) -> Result<Spring, String> {
        match (self.in_series, has_curve) {
            (true, _) if schema < 4 => return Err("in_series needs schema = 4".into()),
            (false, _) if schema < 3 => return Err("needs schema = 3".into()),
            (true, true) => return Err("in_series excludes [curve]: leave out one of them".into()),
            (false, false) => return Err("needs [curve], the strain measure of the memory, or in_series = true".into()),
            _ => {}
        }
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

/// The table of a `spring`, in series or beside the memory, as TOML text.
pub(super) fn to_toml(spring: &Spring, in_series: bool) -> String {
    let place = match in_series {
        true => "in_series = true # with the memory: displacement_m is what the spring alone is stretched by",
        false => "# beside the memory, whose strain measure is [curve]",
    };
    let rows = knots_to_toml(spring.knots(), "force_n", "slope_n_per_m");
    format!("\n[spring]{}{place}\n{rows}", if in_series { '\n' } else { ' ' })
}
