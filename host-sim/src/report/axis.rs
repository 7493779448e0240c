//! Quantities on axes.

/// A quantity on an axis: its name, its unit, and how many of that unit an SI unit is.
#[derive(Clone, Copy, Debug)]
pub struct Axis {
    pub name: &'static str,
    pub unit: &'static str,
    pub per_si: f64,
}

impl Axis {
    pub fn label(self) -> String {
        format!("{} ({})", self.name, self.unit)
    }

    /// `values` in SI units on this axis.
    pub fn transform(self, values: &[f64]) -> Vec<f64> {
        values.iter().map(|value| self.per_si * value).collect()
    }
}

pub const DISPLACEMENT: Axis = Axis { name: "displacement", unit: "mm", per_si: 1e3 };
/// Differences of displacement.
pub const MICROMETRES: Axis = Axis { name: "displacement", unit: "µm", per_si: 1e6 };
pub const FORCE: Axis = Axis { name: "force", unit: "N", per_si: 1.0 };
/// Differences of force.
pub const MILLINEWTONS: Axis = Axis { name: "force", unit: "mN", per_si: 1e3 };
pub const VOLTAGE: Axis = Axis { name: "voltage", unit: "kV", per_si: 1e-3 };
