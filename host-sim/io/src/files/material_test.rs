//! Material tests: deformation and load over time, and the body that shows them (Eqs. 12–13).

use std::path::Path;

use crate::choice;
use crate::error::{Error, Result};
use crate::files::import::{Hints, Names, Quantity, Understood};
use crate::files::layout::Layout;
use crate::files::parameters::plausibility::implausible_stretch;
use crate::terminal::rounded;

const STRESS: &Names = &[("nominal_stress_pa", "Pa"), ("nominal_stress_kpa", "kPa"), ("nominal_stress_mpa", "MPa")];
/// As testing machines name them.
const DISPLACEMENT: &Names = &[
    ("displacement_m", "m"),
    ("displacement_mm", "mm"),
    ("extension_mm", "mm"),
    ("Extension (mm)", "mm"),
    ("Displacement (mm)", "mm"),
];
const FORCE: &Names = &[
    ("force_n", "N"),
    ("force_kn", "kN"),
    ("load_n", "N"),
    ("Load (N)", "N"),
    ("Force (N)", "N"),
    ("Load (kN)", "kN"),
];

const TEST: Layout<4> = Layout {
    what: "a CSV table of a material test",
    columns: [
        (Quantity::Stretch, &[("stretch", "")]),
        (Quantity::Stress, STRESS),
        (Quantity::Displacement, DISPLACEMENT),
        (Quantity::Force, FORCE),
    ],
    needed: &[&[Quantity::Stretch, Quantity::Displacement], &[Quantity::Stress, Quantity::Force]],
};

choice! {
    /// How a stretch λ is written as a strain. All agree for small strains, so that coefficients keep their meaning there.
    #[derive(Default)]
    pub enum Strain {
        /// λ − 1.
        #[default]
        Engineering = "engineering",
        /// (λ − λ⁻²) / 3: to it the nominal stress of a neo-Hookean body in uniaxial tension is proportional.
        NeoHookean = "neo-hookean",
        /// ln λ, the logarithmic strain.
        Hencky = "hencky",
    }
}

impl Strain {
    /// The strain of a `stretch`.
    pub fn measure(self, stretch: f64) -> f64 {
        match self {
            Self::Engineering => stretch - 1.0,
            Self::NeoHookean => (stretch - stretch.powi(-2)) / 3.0,
            Self::Hencky => stretch.ln(),
        }
    }
}

/// Strain of the first row without doubt.
const MAX_FIRST_STRAIN: f64 = 0.5;

/// A material test in SI units.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialTest {
    /// Times in s, increasing from 0.
    pub time_s: Vec<f64>,
    /// Interpretation of the file.
    pub understood: Understood,
    deformation: Deformation,
    load: Load,
}

#[derive(Clone, Debug, PartialEq)]
enum Deformation {
    /// Length over original length.
    Stretch(Vec<f64>),
    /// Length of a specimen, m.
    Displacement(Vec<f64>),
}

#[derive(Clone, Debug, PartialEq)]
enum Load {
    /// Force over original cross-section, Pa.
    NominalStress(Vec<f64>),
    /// On a specimen, N.
    Force(Vec<f64>),
}

/// Number of the column of stretches, from one; 0 without one.
fn column_number(understood: &Understood) -> usize {
    understood.column(Quantity::Stretch).map_or(0, |column| column.column)
}

impl MaterialTest {
    /// Reads the test at `path`, of which a person says `hints`: stretch or displacement, and nominal stress or force.
    ///
    /// # Errors
    ///
    /// [`Error`] naming the file and line of the first value that cannot be used.
    pub fn read(path: &Path, hints: &Hints) -> Result<Self> {
        let (table, understood) = TEST.read(path, hints)?;
        let one_of = |first: usize, second: usize, what: &str| -> Result<(bool, Vec<f64>)> {
            let (index, column) = match (&table.columns[first], &table.columns[second]) {
                (Some(_), Some(_)) => {
                    return Err(Error::file(path, format!("both forms of {what}; leave one of them")));
                }
                (Some(column), None) => (first, column),
                (None, Some(column)) => (second, column),
                (None, None) => return Err(Error::file(path, format!("{what} has no value"))),
            };
            let values = column.complete(path, &table.time_s, "a material test needs it in every row")?.value;
            Ok((index == first, values))
        };
        let deformation = match one_of(0, 2, "stretch or displacement")? {
            (true, stretch) => {
                let refused = |k: usize, advice: &str| {
                    let (value, at) = (stretch[k], table.time_s[k]);
                    let cause = format!("stretch is {value} at {at} s; it is length over original length{advice}");
                    Err(Error::file(path, cause))
                };
                if let Some(k) = stretch.iter().position(|&stretch| stretch <= 0.0) {
                    return refused(k, "");
                }
                let implausible = |(k, stretch): (usize, &f64)| Some((k, implausible_stretch(*stretch)?));
                match stretch.iter().enumerate().find_map(implausible) {
                    Some((k, true)) => {
                        let column = column_number(&understood);
                        let advice = "in percent? Then name the column with its factor: `columns`";
                        return refused(k, &format!(": {advice} stretch={column}*0.01"));
                    }
                    Some((k, false)) => return refused(k, ": check its unit"),
                    None => {}
                }
                Deformation::Stretch(stretch)
            }
            (false, displacement) => Deformation::Displacement(displacement),
        };
        let load = match one_of(1, 3, "nominal stress or force")? {
            (true, stress) => Load::NominalStress(stress),
            (false, force) => Load::Force(force),
        };
        Ok(Self { time_s: table.time_s, understood, deformation, load })
    }

    /// The doubt about a test that does not begin near the unstretched length, from which displacements count, of a body of `length_m` where
    /// that is known.
    #[must_use]
    pub fn doubt(&self, length_m: Option<f64>) -> Option<String> {
        let stretch = match &self.deformation {
            Deformation::Stretch(stretch) => stretch,
            Deformation::Displacement(displacement) => {
                let first =
                    displacement.first().zip(length_m).filter(|(first, length)| **first > MAX_FIRST_STRAIN * length);
                return first.map(|(first, length)| {
                    format!(
                        "the first displacement is {first} m of a body of {length} m: the length of the body, or the separation of the grips? \
                         Displacements count from the unstretched length: subtract it"
                    )
                });
            }
        };
        let first = stretch.first().filter(|first| (*first - 1.0).abs() > MAX_FIRST_STRAIN)?;
        Some(format!(
            "the first stretch is {first}, where a body at rest has 1, from which the displacements count: of a prestretched film divide \
             the stretches by that at rest, as in `columns` stretch={}*{}",
            column_number(&self.understood),
            rounded(1.0 / first)
        ))
    }

    /// Displacement (m) of a body of `length_m`, unstretched, along the load: its `strain` times its length.
    ///
    /// # Errors
    ///
    /// [`Error::Field`] where a length is needed and missing, or too short for the displacement.
    pub fn displacement_m(&self, length_m: Option<f64>, strain: Strain) -> Result<Vec<f64>> {
        let needed = |why: &str| Error::field("length_m", format!("{why} needs the unstretched length of the body"));
        match &self.deformation {
            Deformation::Stretch(stretch) => {
                let length = length_m.ok_or_else(|| needed("a stretch"))?;
                Ok(stretch.iter().map(|&stretch| length * strain.measure(stretch)).collect())
            }
            Deformation::Displacement(displacement) if strain == Strain::Engineering => Ok(displacement.clone()),
            Deformation::Displacement(displacement) => {
                let length = length_m.ok_or_else(|| needed("this measure of strain"))?;
                if let Some(shortest) = displacement.iter().copied().find(|x| *x <= -length) {
                    let cause = format!("{length} m is shorter than the displacement of {shortest} m");
                    return Err(Error::field("length_m", cause));
                }
                Ok(displacement.iter().map(|x| length * strain.measure(1.0 + x / length)).collect())
            }
        }
    }

    /// Force (N) on a body of the cross-section `area_m2`, unstretched, across the load.
    ///
    /// # Errors
    ///
    /// [`Error::Field`] where an area is needed and missing.
    pub fn force_n(&self, area_m2: Option<f64>) -> Result<Vec<f64>> {
        match (&self.load, area_m2) {
            (Load::Force(force), _) => Ok(force.clone()),
            (Load::NominalStress(stress), Some(area)) => Ok(stress.iter().map(|stress| stress * area).collect()),
            (Load::NominalStress(_), None) => {
                Err(Error::field("area_m2", "a nominal stress needs the unstretched cross-section of the body"))
            }
        }
    }
}
