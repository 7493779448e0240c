//! Parameter files: an actuator and its model, as TOML in SI units.

mod format;

use std::fs::File;
use std::io::Read;
use std::ops::Range;
use std::path::Path;

use springpot::{Actuator, Maxwell, Preset};

use crate::error::{Error, Result};
use format::{FileTable, SCHEMA};

/// An actuator and the model of its film.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    /// What the set is called.
    pub name: String,
    /// The actuator.
    pub actuator: Actuator,
    /// The model of the film.
    pub model: Maxwell,
    /// What the displacement sensor reads of a film at x = 0, m.
    pub sensor_offset_m: f64,
    /// Where the numbers come from, for people.
    pub provenance: Option<toml::Table>,
}

/// No parameter file is longer.
const LONGEST: u64 = 1 << 20;

impl Parameters {
    /// The parameters named on a command line: a path, or `preset:NAME`.
    ///
    /// # Errors
    ///
    /// [`Error`] naming the file and line, or the presets there are.
    pub fn load(name: &str) -> Result<Self> {
        match name.strip_prefix("preset:") {
            Some(preset) => Self::preset(preset),
            None => Self::read(Path::new(name)),
        }
    }

    /// A published set.
    ///
    /// # Errors
    ///
    /// [`Error::Option`] for a name that is not among the presets.
    pub fn preset(name: &str) -> Result<Self> {
        let preset = Preset::named(name).ok_or_else(|| {
            let names: Vec<&str> = Preset::ALL.iter().map(Preset::name).collect();
            Error::option("--params", format!("no preset {name:?}; there are {}", names.join(", ")))
        })?;
        Ok(Self {
            name: format!("karner-2022-{}", preset.name()),
            actuator: Actuator::KARNER_2022,
            model: preset.model()?,
            sensor_offset_m: 0.0,
            provenance: None,
        })
    }

    /// Reads a parameter file.
    ///
    /// # Errors
    ///
    /// [`Error`] naming the file, the line and the value that cannot be used.
    pub fn read(path: &Path) -> Result<Self> {
        if path.is_dir() {
            return Err(Error::file(path, "is a directory; name a parameter file (TOML) or preset:NAME"));
        }
        let mut bytes = Vec::new();
        let file = File::open(path).map_err(|e| Error::file(path, e))?;
        // A pipe has no length beforehand.
        file.take(LONGEST + 1).read_to_end(&mut bytes).map_err(|e| Error::file(path, e))?;
        if bytes.len() as u64 > LONGEST {
            return Err(Error::file(path, format!("more than {LONGEST} bytes; this is not a parameter file")));
        }
        let text = String::from_utf8(bytes).map_err(|e| {
            let line = 1 + e.as_bytes()[..e.utf8_error().valid_up_to()].iter().filter(|&&b| b == b'\n').count();
            Error::line(path, line as u64, "not UTF-8 text; this is not a TOML parameter file")
        })?;
        Self::from_toml(path, &text)
    }

    /// Reads parameters from TOML text; `path` is what errors name.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read).
    pub fn from_toml(path: &Path, text: &str) -> Result<Self> {
        let at = |span: Range<usize>, cause: String| {
            let line = 1 + text.as_bytes()[..span.start.min(text.len())].iter().filter(|&&b| b == b'\n').count();
            Error::line(path, line as u64, cause)
        };
        let file: FileTable = toml::from_str(text).map_err(|e| {
            let cause = e.message().trim().replace('\n', "; ");
            match e.span() {
                Some(span) => at(span, cause),
                None => Error::file(path, cause),
            }
        })?;
        if *file.schema.get_ref() != SCHEMA {
            let cause = format!("schema = {}; this version reads schema = {SCHEMA}", file.schema.get_ref());
            return Err(at(file.schema.span(), cause));
        }
        let actuator = file.actuator.actuator();
        actuator.check().map_err(|e| at(file.actuator.place_of(&e).unwrap_or(0..0), e.to_string()))?;
        if let Some(branch) = file.model.branches.iter().find(|branch| branch.get_ref().len() != 2) {
            let cause = format!("a branch of {} springpots; it has exactly two", branch.get_ref().len());
            return Err(at(branch.span(), cause));
        }
        let model = file
            .model
            .model(actuator.mass_kg)
            .map_err(|e| at(file.model.place_of(&e).unwrap_or(0..0), e.to_string()))?;
        let offset = file.sensor.as_ref().map(|sensor| &sensor.offset_m);
        let sensor_offset_m = offset.map_or(0.0, |offset| *offset.get_ref());
        if !sensor_offset_m.is_finite() {
            let cause = format!("offset_m = {sensor_offset_m} must be finite");
            return Err(at(offset.map_or(0..0, toml::Spanned::span), cause));
        }
        Ok(Self { name: file.name, actuator, model, sensor_offset_m, provenance: file.provenance })
    }

    /// The parameters as TOML text.
    pub fn to_toml(&self) -> String {
        format::write(self)
    }
}
