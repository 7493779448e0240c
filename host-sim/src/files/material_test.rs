//! Material tests: stretch and nominal stress over time, and the body that shows them (Eqs. 12–13).

use std::path::Path;

use crate::error::{Error, Result};
use crate::files::csv::{Names, Table};
use crate::grid::Samples;

const STRETCH: &Names = &[("stretch", 1.0)];
const STRESS: &Names = &[("nominal_stress_pa", 1.0), ("nominal_stress_kpa", 1e3)];

/// A material test in SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialTest {
    /// Times in s, increasing from 0.
    pub time_s: Vec<f64>,
    /// Length over original length.
    pub stretch: Vec<f64>,
    /// Force over original cross-section, Pa.
    pub nominal_stress_pa: Vec<f64>,
}

impl MaterialTest {
    /// Reads the test at `path`.
    ///
    /// # Errors
    ///
    /// [`Error`] naming the file and line of the first value that cannot be used.
    pub fn read(path: &Path) -> Result<Self> {
        let table = Table::read(path, [STRETCH, STRESS], &[&[0], &[1]])?;
        let complete = |index: usize| -> Result<Samples> {
            let column = table.columns[index].as_ref();
            let column = column.ok_or_else(|| Error::file(path, "stretch or nominal stress has no value"))?;
            column.complete(path, &table.time_s, "a material test needs both in every row")
        };
        let stretch = complete(0)?.value;
        if let Some(k) = stretch.iter().position(|&stretch| stretch <= 0.0) {
            let cause =
                format!("stretch is {} at {} s; it is length over original length", stretch[k], table.time_s[k]);
            return Err(Error::file(path, cause));
        }
        let nominal_stress_pa = complete(1)?.value;
        Ok(Self { time_s: table.time_s, stretch, nominal_stress_pa })
    }

    /// Displacement (m) of a body of `length_m`, unstretched, along the load.
    pub fn displacement_m(&self, length_m: f64) -> Vec<f64> {
        self.stretch.iter().map(|stretch| (stretch - 1.0) * length_m).collect()
    }

    /// Force (N) on a body of the cross-section `area_m2`, unstretched, across the load.
    pub fn force_n(&self, area_m2: f64) -> Vec<f64> {
        self.nominal_stress_pa.iter().map(|stress| stress * area_m2).collect()
    }
}
