//! The tables of a parameter file, as they are written.

use std::fmt::Write;
use std::ops::Range;

use serde::Deserialize;
use springpot::{Actuator, Maxwell, ModelElement, ModelError, Preload, Springpot, TemperatureDependence, Topology};
use toml::Spanned;

use super::Parameters;
use super::board::BoardTable;
use super::curve::CurveTable;
use super::spring::{self, SpringTable};
use super::temperature;
use crate::choice::Choice;

/// The versions of the format: the second has elastic curves, saturation, and couplings of either sign, the third a spring and strain measures, the
/// fourth a spring in series, the fifth a dependence on the temperature.
pub(super) const SCHEMAS: [u32; 5] = [1, 2, 3, 4, 5];

/// A parameter file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FileTable {
    pub(super) schema: Spanned<u32>,
    pub(super) name: String,
    pub(super) actuator: ActuatorTable,
    pub(super) model: ModelTable,
    pub(super) curve: Option<Spanned<CurveTable>>,
    pub(super) spring: Option<Spanned<SpringTable>>,
    pub(super) temperature: Option<Spanned<TemperatureDependence>>,
    pub(super) sensor: Option<SensorTable>,
    pub(super) board: Option<Spanned<BoardTable>>,
    /// Origin of the numbers, free text.
    pub(super) provenance: Option<toml::Table>,
}

/// A parameter file of which only the actuator is wanted; it may lack the rest.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[expect(dead_code, reason = "fields without a use are keys that are no fault")]
pub(super) struct ActuatorFileTable {
    pub(super) schema: Spanned<u32>,
    name: Option<String>,
    pub(super) actuator: ActuatorTable,
    model: Option<toml::Value>,
    curve: Option<toml::Value>,
    spring: Option<toml::Value>,
    temperature: Option<toml::Value>,
    sensor: Option<toml::Value>,
    board: Option<toml::Value>,
    provenance: Option<toml::Value>,
}

/// A parameter file of which only the board is wanted.
#[derive(Deserialize)]
pub(super) struct BoardFileTable {
    pub(super) board: Option<BoardTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ActuatorTable {
    relative_permittivity: Spanned<f64>,
    length_m: Spanned<f64>,
    width_m: Spanned<f64>,
    thickness_m: Spanned<f64>,
    mass_kg: Spanned<f64>,
    #[serde(default)]
    preload: Preload,
    stretch_coupling: Option<Spanned<f64>>,
    saturation_v: Option<Spanned<f64>>,
    #[serde(default)]
    sizes: SizesName,
}

/// Where length, width and thickness come from.
#[derive(Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum SizesName {
    #[default]
    Given,
    Assumed,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ModelTable {
    topology: Topology,
    main: ElementTable,
    /// Branches of two springpots each.
    pub(super) branches: Vec<Spanned<Vec<ElementTable>>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct SensorTable {
    /// Reading of the displacement sensor for a film at x = 0, m.
    pub(super) offset_m: Spanned<f64>,
    /// Time by which its readings are late, s.
    pub(super) delay_s: Spanned<f64>,
}

impl Default for SensorTable {
    fn default() -> Self {
        let zero = Spanned::new(0..0, 0.0);
        Self { offset_m: zero.clone(), delay_s: zero }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ElementTable {
    c: Spanned<f64>,
    alpha: Spanned<f64>,
}

impl ActuatorTable {
    /// Names that are nowhere else in a file.
    pub(super) const KEYS: [&str; 5] = ["relative_permittivity", "length_m", "width_m", "thickness_m", "mass_kg"];

    pub(super) fn actuator(&self) -> Actuator {
        Actuator {
            relative_permittivity: *self.relative_permittivity.get_ref(),
            length_m: *self.length_m.get_ref(),
            width_m: *self.width_m.get_ref(),
            thickness_m: *self.thickness_m.get_ref(),
            mass_kg: *self.mass_kg.get_ref(),
            preload: self.preload,
            stretch_coupling: self.stretch_coupling.as_ref().map_or(0.0, |kappa| *kappa.get_ref()),
            saturation_v: self.saturation_v.as_ref().map(|volts| *volts.get_ref()),
        }
    }

    /// Place of a value that only the second version of the format has, and its name.
    pub(super) fn place_of_new(&self) -> Option<(Range<usize>, &'static str)> {
        if let Some(volts) = &self.saturation_v {
            return Some((volts.span(), "saturation_v"));
        }
        let coupling = self.stretch_coupling.as_ref().filter(|coupling| *coupling.get_ref() < 0.0)?;
        Some((coupling.span(), "a negative stretch_coupling"))
    }

    /// Whether the film's sizes are not its own.
    pub(super) fn sizes_are_assumed(&self) -> bool {
        self.sizes == SizesName::Assumed
    }

    /// Place of the value of that name.
    pub(super) fn place_of(&self, name: &str) -> Option<Range<usize>> {
        let value = match name {
            "relative_permittivity" => &self.relative_permittivity,
            "length_m" => &self.length_m,
            "width_m" => &self.width_m,
            "thickness_m" => &self.thickness_m,
            "mass_kg" => &self.mass_kg,
            "stretch_coupling" => self.stretch_coupling.as_ref()?,
            "saturation_v" => self.saturation_v.as_ref()?,
            _ => return None,
        };
        Some(value.span())
    }
}

impl ModelTable {
    pub(super) fn model(&self, mass_kg: f64) -> Result<Maxwell, ModelError> {
        let elements: Vec<Springpot> =
            self.branches.iter().flat_map(|branch| branch.get_ref()).map(ElementTable::element).collect();
        let (branches, _) = elements.as_chunks::<2>();
        Maxwell::new(self.main.element(), branches, self.topology, mass_kg)
    }

    /// Place of the value that an error is about.
    pub(super) fn place_of(&self, error: &ModelError) -> Option<Range<usize>> {
        let element = |element: &ModelElement| match *element {
            ModelElement::Main => Some(&self.main),
            ModelElement::Branch { branch, element } => self.branches.get(branch)?.get_ref().get(element),
            _ => None,
        };
        match error {
            ModelError::Coefficient { element: which, .. } => Some(element(which)?.c.span()),
            ModelError::Order { element: which, .. } => Some(element(which)?.alpha.span()),
            ModelError::Branches(_) => Some(self.branches.last()?.span()),
            _ => None,
        }
    }
}

impl ElementTable {
    fn element(&self) -> Springpot {
        Springpot::new(*self.c.get_ref(), *self.alpha.get_ref())
    }
}

/// The line of sizes that are not the film's own.
const ASSUMED: &str = "sizes = \"assumed\" # not this film's: fields are not known. Fit with an actuator file\n";

/// Parameters as TOML text.
pub(super) fn write(parameters: &Parameters) -> String {
    let Actuator { relative_permittivity, length_m, width_m, thickness_m, mass_kg, .. } = parameters.actuator;
    let Actuator { preload, stretch_coupling, saturation_v, .. } = parameters.actuator;
    // Files that do without what is new stay readable for earlier versions.
    let schema = parameters.schema();
    let saturation = saturation_v.map(|volts| format!("saturation_v = {volts:?}\n")).unwrap_or_default();
    let (preload, topology) = (preload.name(), parameters.model.topology().name());
    let element = |e: &Springpot| format!("{{ c = {:?}, alpha = {:?} }}", e.c, e.alpha);
    let mut text = format!(
        "schema = {schema}\n\
         name = {name}\n\n\
         [actuator]\n\
         relative_permittivity = {relative_permittivity:?}\n\
         length_m = {length_m:?}\n\
         width_m = {width_m:?}\n\
         thickness_m = {thickness_m:?}\n\
         mass_kg = {mass_kg:?}\n\
         preload = \"{preload}\"\n\
         stretch_coupling = {stretch_coupling:?} # 1/m\n{saturation}{sizes}\n\
         [model]\n\
         topology = \"{topology}\"\n\
         main = {main} # c in N·s^alpha/m\n",
        name = toml::Value::String(parameters.name.clone()),
        sizes = if parameters.assumed_sizes { ASSUMED } else { "" },
        main = element(&parameters.model.main()),
    );
    text.push_str("branches = [");
    for [first, second] in parameters.model.branches() {
        // Writing to a string cannot fail.
        let _ = write!(text, "\n  [{}, {}],", element(first), element(second));
    }
    text.push_str(if parameters.model.branches().is_empty() { "]\n" } else { "\n]\n" });
    if let Some(curve) = &parameters.curve {
        text.push_str(&curve.to_toml());
    }
    if let Some(spring) = &parameters.spring {
        text.push_str(&spring::to_toml(spring, parameters.curve.is_none()));
    }
    if let Some(dependence) = &parameters.temperature {
        text.push_str(&temperature::to_toml(dependence));
    }
    if (parameters.sensor_offset_m, parameters.sensor_delay_s) != (0.0, 0.0) {
        let _ =
            write!(text, "\n[sensor]\noffset_m = {:?} # what it reads of a film at rest\n", parameters.sensor_offset_m);
    }
    if parameters.sensor_delay_s != 0.0 {
        let _ = writeln!(text, "delay_s = {:?} # by which its readings are late", parameters.sensor_delay_s);
    }
    if let Some(board) = &parameters.board {
        let table = toml::Table::from_iter([("board".to_owned(), toml::Value::Table(board.to_toml()))]);
        let _ = write!(text, "\n{table}");
    }
    if let Some(provenance) = &parameters.provenance {
        // Nested under its own name, so that its tables are, too.
        let table = toml::Table::from_iter([("provenance".to_owned(), toml::Value::Table(provenance.clone()))]);
        let _ = write!(text, "\n{table}");
    }
    text
}
