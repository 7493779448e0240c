//! Parameter files: an actuator and its model, as TOML in SI units.

mod board;
mod calibration;
mod curve;
mod film;
mod format;
pub mod plausibility;
mod spring;
mod temperature;

use std::ops::Range;
use std::path::Path;

use serde::de::DeserializeOwned;
use springpot::{Actuator, Discretisation, Maxwell, Preset, Spring, TemperatureDependence};
use toml::Spanned;

use crate::error::{Error, Result, short};
use crate::files::bounded;
pub use board::{Board, SelfSensing, as_written, below_resonance};
pub use curve::{ElasticCurve, Shape};
pub use film::{Film, controller_rate};
use format::{ActuatorFileTable, ActuatorTable, BoardFileTable, FileTable, SCHEMAS, SensorTable};

/// An actuator and the model of its film.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    /// Name of the set.
    pub name: String,
    /// The actuator.
    pub actuator: Actuator,
    /// Whether length, width and thickness are assumed, not the film's own: then nothing is known of the electric field.
    pub assumed_sizes: bool,
    /// The model of the film.
    pub model: Maxwell,
    /// The elastic curve of the film, if it has one.
    pub curve: Option<ElasticCurve>,
    /// The spring beside the film's memory, whose strain measure then is the curve; without a curve the spring is in series with the memory.
    pub spring: Option<Spring>,
    /// How the temperature changes it, if that was fitted: the numbers are those at its reference.
    pub temperature: Option<TemperatureDependence>,
    /// How s is discretised in their laws: not in the file, but chosen with the rate.
    pub method: Discretisation,
    /// Reading of the displacement sensor at x = 0, m; see [`sensor`](Self::sensor).
    pub sensor_offset_m: f64,
    /// Time by which its readings are late, s: 0 unless the file names one.
    pub sensor_delay_s: f64,
    /// The board that runs them, if the file names one.
    pub board: Option<Board>,
    /// Origin of the numbers, free text.
    pub provenance: Option<toml::Table>,
}

/// A displacement sensor as it is mounted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisplacementSensor {
    /// Reading of a film at x = 0, m.
    pub offset_m: f64,
    /// Time by which its readings are late, s.
    pub delay_s: f64,
}

impl DisplacementSensor {
    /// The reading (m) of a film at `displacement_m`.
    pub fn reading_m(&self, displacement_m: f64) -> f64 {
        displacement_m + self.offset_m
    }

    /// The displacement (m) of the film at a `reading_m`.
    pub fn film_displacement_m(&self, reading_m: f64) -> f64 {
        reading_m - self.offset_m
    }
}

/// Largest delay of a displacement sensor's readings, s.
pub const MAX_SENSOR_DELAY_S: f64 = 1.0;

/// Largest size of a parameter file, bytes.
const MAX_FILE: u64 = 1 << 20;

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

    /// A published set of parameters.
    ///
    /// # Errors
    ///
    /// [`Error::Field`] for a name that is not among the presets.
    pub fn preset(name: &str) -> Result<Self> {
        let preset = Preset::named(name).ok_or_else(|| {
            let names: Vec<&str> = Preset::ALL.iter().map(Preset::name).collect();
            Error::Usage(format!("preset:{name}: unknown preset; the presets are {}", names.join(", ")))
        })?;
        Ok(Self::new(format!("karner-2022-{}", preset.name()), Actuator::KARNER_2022, preset.model()?))
    }

    /// A linear film with its own sizes.
    pub fn new(name: String, actuator: Actuator, model: Maxwell) -> Self {
        Self {
            name,
            actuator,
            assumed_sizes: false,
            model,
            curve: None,
            spring: None,
            temperature: None,
            method: Discretisation::Gl,
            sensor_offset_m: 0.0,
            sensor_delay_s: 0.0,
            board: None,
            provenance: None,
        }
    }

    /// Reads a parameter file.
    ///
    /// # Errors
    ///
    /// [`Error`] naming the file, the line and the value that cannot be used.
    pub fn read(path: &Path) -> Result<Self> {
        Self::from_toml(path, &text_of(path)?)
    }

    /// The actuator named on a command line, of a file that may hold nothing else, or of `preset:NAME`; and whether its sizes are assumed.
    pub fn load_sized_actuator(name: &str) -> Result<(Actuator, bool)> {
        if name.starts_with("preset:") {
            return Ok((Self::load(name)?.actuator, false));
        }
        let path = Path::new(name);
        let text = text_of(path)?;
        let place = Place { path, text: &text };
        let file: ActuatorFileTable = place.parse()?;
        place.check_schema(&file.schema)?;
        Ok((place.actuator(&file.actuator, *file.schema.get_ref())?, file.actuator.sizes_are_assumed()))
    }

    /// Loads the actuator and the board of a parameter file, which may lack the model; the board of the paper's bench if the
    /// file has no board. The last is whether the film's sizes are assumed.
    pub fn load_board(name: &str) -> Result<(Actuator, Board, bool)> {
        let (actuator, assumed_sizes) = Self::load_sized_actuator(name)?;
        let bench = Board { missing: Board::KEYS.into(), ..Board::bench(&actuator) };
        if name.starts_with("preset:") {
            return Ok((actuator, bench, assumed_sizes));
        }
        let path = Path::new(name);
        let text = text_of(path)?;
        let file: BoardFileTable = Place { path, text: &text }.parse()?;
        let board = file.board.map_or(bench.clone(), |table| table.board(bench));
        plausibility::check_board(&board).map_err(|cause| Error::file(path, cause))?;
        Ok((actuator, board, assumed_sizes))
    }

    /// Statement about the electric field if the film's sizes are assumed.
    pub fn field_note(&self) -> Option<String> {
        self.assumed_sizes.then(|| {
            format!(
                "the film's sizes are assumed ({:.0} µm thick): whether the field stays within its limit is not known; fit with \
                 `actuator` and the film's own sizes",
                1e6 * self.actuator.thickness_m
            )
        })
    }

    /// Reads parameters from TOML text; `path` is what errors name.
    pub fn from_toml(path: &Path, text: &str) -> Result<Self> {
        let place = Place { path, text };
        let file: FileTable = place.parse()?;
        place.check_schema(&file.schema)?;
        let schema = *file.schema.get_ref();
        let actuator = place.actuator(&file.actuator, schema)?;
        if let Some(branch) = file.model.branches.iter().find(|branch| branch.get_ref().len() != 2) {
            let cause = format!("a branch of {} springpots; it has exactly two", branch.get_ref().len());
            return Err(place.error(branch.span(), cause));
        }
        let model = file
            .model
            .model(actuator.mass_kg)
            .map_err(|e| place.error(file.model.place_of(&e).unwrap_or(0..0), short(&e)))?;
        let SensorTable { offset_m, delay_s } = file.sensor.unwrap_or_default();
        let [sensor_offset_m, sensor_delay_s] = [*offset_m.get_ref(), *delay_s.get_ref()];
        plausibility::check_offset(sensor_offset_m).map_err(|cause| place.error(offset_m.span(), cause))?;
        if sensor_delay_s.is_nan() || sensor_delay_s.abs() > MAX_SENSOR_DELAY_S {
            let cause =
                format!("delay_s = {sensor_delay_s} must be from -{MAX_SENSOR_DELAY_S} to {MAX_SENSOR_DELAY_S} s");
            return Err(place.error(delay_s.span(), cause));
        }
        let mut curve = None;
        if let Some(table) = &file.curve {
            if schema == 1 {
                return Err(place.error(table.span(), needs_schema_2("[curve]")));
            }
            let refused = |cause: String| place.error(table.span(), format!("[curve] {cause}"));
            curve = table.get_ref().curve(&actuator).map_err(refused)?;
        }
        let mut parameters = Self {
            assumed_sizes: file.actuator.sizes_are_assumed(),
            curve,
            sensor_offset_m,
            sensor_delay_s,
            provenance: file.provenance,
            ..Self::new(file.name, actuator, model)
        };
        if let Some(table) = &file.spring {
            let refused = |cause: String| place.error(table.span(), format!("[spring] {cause}"));
            let has_curve = parameters.curve.is_some();
            parameters.spring = Some(table.get_ref().spring(schema, has_curve).map_err(refused)?);
            // What a law refuses of the curves is refused here, where their line is known: at the rate of a controller.
            parameters.film().compressed_law::<f64>(1000.0).map_err(|e| refused(short(&e)))?;
        } else if schema < parameters.schema() {
            return Err(place.error(file.schema.span(), "a curve of elastic = \"measure\" needs schema = 3".into()));
        }
        if let Some(table) = &file.temperature {
            let refused = |cause: String| place.error(table.span(), format!("[temperature] {cause}"));
            if schema < 5 {
                return Err(refused("needs schema = 5".into()));
            }
            table.get_ref().check().map_err(|error| refused(short(&error)))?;
            parameters.temperature = Some(*table.get_ref());
        }
        if let Some(table) = &file.board {
            let board = table.get_ref().board(parameters.bench(1000.0));
            if let Some(sensing) = &table.get_ref().self_sensing {
                let at = |cause| place.error(sensing.span(), cause);
                let SelfSensing { relation, options, .. } = sensing.get_ref();
                plausibility::check_self_sensing(relation, options).map_err(at)?;
                sensing.get_ref().sensor().map_err(|error| at(format!("self-sensing: {error}")))?;
            }
            plausibility::check_board(&board).map_err(|cause| place.error(table.span(), cause))?;
            // What a controller would refuse of the board is refused here, where its line is known. The rate matters to a tone alone.
            let checked = parameters.to_blob(&board, board.rate_hz());
            checked.map_err(|e| place.error(table.span(), short(&e)))?;
            parameters.board = Some(board);
        }
        Ok(parameters)
    }

    /// The displacement sensor: the one conversion between its readings and the displacement of the film.
    pub fn sensor(&self) -> DisplacementSensor {
        DisplacementSensor { offset_m: self.sensor_offset_m, delay_s: self.sensor_delay_s }
    }

    /// The model behind its elastic curve.
    pub fn film(&self) -> Film<'_> {
        let curve = self.curve.as_ref().map(ElasticCurve::pieces);
        Film { model: &self.model, curve, spring: self.spring.as_ref(), method: self.method }
    }

    /// The first schema that has all of these parameters.
    fn schema(&self) -> u32 {
        let has_new = self.actuator.saturation_v.is_some() || self.actuator.stretch_coupling < 0.0;
        match (self.curve.as_ref().map(ElasticCurve::shape), &self.spring) {
            _ if self.temperature.is_some() => 5,
            (None, Some(_)) => 4,
            (Some(_), Some(_)) | (Some(Shape::Measure(_)), None) => 3,
            (Some(_), None) => 2,
            (None, None) => 1 + u32::from(has_new),
        }
    }

    /// The same, stepped by `method`.
    #[must_use]
    pub fn with_method(mut self, method: Discretisation) -> Self {
        self.method = method;
        self
    }

    /// The parameters as TOML text.
    pub fn to_toml(&self) -> String {
        format::write(self)
    }
}

fn needs_schema_2(name: &str) -> String {
    format!("{name} needs schema = 2")
}

/// The text of a parameter file.
fn text_of(path: &Path) -> Result<String> {
    if path.is_dir() {
        return Err(Error::file(path, "is a directory; name a parameter file (TOML) or preset:NAME"));
    }
    bounded::read_text(path, MAX_FILE, "a parameter file (TOML)")
}

/// A text whose errors name its lines.
struct Place<'a> {
    path: &'a Path,
    text: &'a str,
}

impl Place<'_> {
    fn error(&self, span: Range<usize>, cause: String) -> Error {
        let before = &self.text.as_bytes()[..span.start.min(self.text.len())];
        let line = 1 + before.iter().filter(|&&b| b == b'\n').count();
        Error::line(self.path, line as u64, cause)
    }

    fn parse<T: DeserializeOwned>(&self) -> Result<T> {
        toml::from_str(self.text).map_err(|e| {
            // Not in backticks, which name fields of options: "length_m" of a file is no --length.
            let mut cause = e.message().trim().replace('\n', "; ").replace('`', "\"");
            // Of the whole file, not of a table.
            let key = cause.strip_prefix("unknown field \"").filter(|rest| rest.contains("expected one of \"schema\""));
            let key = key.and_then(|rest| rest.split('"').next());
            if let Some(key) = key.filter(|key| ActuatorTable::KEYS.contains(key)) {
                cause = format!("{key} is not below a line [actuator]; put that line above the sizes of the film");
            }
            if ["name", "model"].iter().any(|key| cause == format!("missing field \"{key}\"")) && self.lacks_model() {
                cause = "has no [model], only sizes or a board; name a file that the command fit wrote".into();
            }
            match e.span() {
                Some(span) => self.error(span, cause),
                None => Error::file(self.path, cause),
            }
        })
    }

    /// Whether the whole file, which is TOML, has no model, as one for `--actuator` or `--board`.
    fn lacks_model(&self) -> bool {
        toml::from_str::<toml::Table>(self.text).is_ok_and(|table| !table.contains_key("model"))
    }

    fn check_schema(&self, schema: &Spanned<u32>) -> Result<()> {
        if SCHEMAS.contains(schema.get_ref()) {
            return Ok(());
        }
        let [first, .., last] = SCHEMAS;
        let cause = format!("schema = {}; this version reads schema = {first} to {last}", schema.get_ref());
        Err(self.error(schema.span(), cause))
    }

    fn actuator(&self, table: &ActuatorTable, schema: u32) -> Result<Actuator> {
        let actuator = table.actuator();
        if let (1, Some((span, name))) = (schema, table.place_of_new()) {
            return Err(self.error(span, needs_schema_2(name)));
        }
        // Of assumed sizes no field is claimed, and a fit may have found any.
        let checked = match table.sizes_are_assumed() {
            true => plausibility::check_numbers(&actuator),
            false => plausibility::check(&actuator),
        };
        checked.map_err(|(name, cause)| self.error(table.place_of(name).unwrap_or(0..0), cause))?;
        Ok(actuator)
    }
}
