//! The `[board]` table: converters, limits and control, and the blob that a controller reads.

use dea_driver::chips::{Calibration, CommandRange};
use dea_driver::wire::boards;
use dea_driver::{BLOB_LEN, Blob, BlobError, Control, Limits, Parameters as BoardParameters, SelfSensor};
use heapless::String;
use serde::{Deserialize, Serialize, de};
use springpot::{
    Actuator, AmplifierLag, CapacitanceRelation, CommandLimits, ControlError, Law, SelfSensingError, SelfSensingOptions,
};
use toml::Spanned;

use super::calibration::AmplifierTable;
use super::{Parameters, calibration, controller_rate};
use crate::error::{Error, Result, short};

/// Phase by which a sensor may be late at the observer's bandwidth, rad: a little less than the observer allows.
const MAX_SENSOR_PHASE: f32 = 0.34;

/// The settings of control, which a board may leave out.
const CONTROL: &str = "control";

/// The board of a parameter file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Board {
    /// The board a blob is for.
    pub id: u16,
    /// Range of the amplifier's command, at the DAC.
    pub command_range: CommandRange,
    /// Command (V) → high voltage (V).
    #[serde(with = "calibration")]
    pub amplifier: Calibration,
    /// How fast the amplifier follows: in the table of the amplifier.
    #[serde(skip)]
    pub amplifier_lag: AmplifierLag,
    /// Monitor (V) → high voltage (V).
    #[serde(with = "calibration")]
    pub monitor: Calibration,
    /// Displacement sensor (V) → displacement (m).
    #[serde(with = "calibration")]
    pub sensor: Calibration,
    /// Limits of film and bench.
    pub limits: Limits,
    /// Settings of reference, feedforward, observer and learning.
    pub control: Control,
    /// Voltage above which it is armed only after a self-test, V.
    #[serde(skip_serializing_if = "needs_no_self_test")]
    pub self_test_above_v: f32,
    /// The film as its own sensor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub self_sensing: Option<SelfSensing>,
    /// Keys of [`Board::KEYS`] that the file leaves to the paper's bench; of `amplifier`, the calibration.
    #[serde(skip)]
    pub missing: Vec<&'static str>,
}

/// The `[board]` table as it is written. What is left out is that of the paper's bench.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BoardTable {
    id: Option<u16>,
    command_range: Option<CommandRange>,
    #[serde(default, deserialize_with = "amplifier")]
    amplifier: Option<(Option<Calibration>, AmplifierLag)>,
    #[serde(default, deserialize_with = "some_calibration")]
    monitor: Option<Calibration>,
    #[serde(default, deserialize_with = "some_calibration")]
    sensor: Option<Calibration>,
    limits: Option<Limits>,
    control: Option<Control>,
    self_test_above_v: Option<f32>,
    pub(super) self_sensing: Option<Spanned<SelfSensing>>,
}

/// The film as its own sensor: what `self-sensing` writes, and the monitor of its current.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SelfSensing {
    /// Current monitor (V) → current (A).
    #[serde(with = "calibration")]
    pub current: Calibration,
    /// The film.
    pub relation: CapacitanceRelation,
    /// Tone and monitors.
    pub options: SelfSensingOptions,
}

impl SelfSensing {
    pub(super) fn sensor(&self) -> std::result::Result<SelfSensor, SelfSensingError> {
        SelfSensor::new(&self.relation, self.options, self.current.clone())
    }
}

fn needs_no_self_test(above_v: &f32) -> bool {
    *above_v == <BoardParameters>::NO_SELF_TEST_V
}

fn amplifier<'de, D: de::Deserializer<'de>>(
    deserializer: D,
) -> std::result::Result<Option<(Option<Calibration>, AmplifierLag)>, D::Error> {
    AmplifierTable::deserialize(deserializer)?.parts().map(Some)
}

fn some_calibration<'de, D: de::Deserializer<'de>>(
    deserializer: D,
) -> std::result::Result<Option<Calibration>, D::Error> {
    calibration::deserialize(deserializer).map(Some)
}

impl BoardTable {
    /// The board, with what it leaves out from `bench`.
    pub(super) fn board(&self, bench: Board) -> Board {
        let given = [
            self.id.is_some(),
            self.command_range.is_some(),
            self.amplifier.as_ref().is_some_and(|(calibration, _)| calibration.is_some()),
            self.monitor.is_some(),
            self.sensor.is_some(),
            self.limits.is_some(),
            self.control.is_some(),
        ];
        let missing = Board::KEYS.into_iter().zip(given).filter(|(_, given)| !given).map(|(key, _)| key).collect();
        let (amplifier, amplifier_lag) = self.amplifier.clone().unwrap_or((None, bench.amplifier_lag));
        Board {
            id: self.id.unwrap_or(bench.id),
            command_range: self.command_range.unwrap_or(bench.command_range),
            amplifier: amplifier.unwrap_or(bench.amplifier),
            amplifier_lag,
            monitor: self.monitor.clone().unwrap_or(bench.monitor),
            sensor: self.sensor.clone().unwrap_or(bench.sensor),
            limits: self.limits.unwrap_or(bench.limits),
            control: self.control.unwrap_or(bench.control),
            self_test_above_v: self.self_test_above_v.unwrap_or(bench.self_test_above_v),
            self_sensing: self.self_sensing.as_ref().map(|table| table.get_ref().clone()).or(bench.self_sensing),
            missing,
        }
    }
}

impl Board {
    /// The keys of a `[board]` table.
    pub const KEYS: [&str; 7] = ["id", "command_range", "amplifier", "monitor", "sensor", "limits", CONTROL];

    /// Values that this board lacks to drive a film: calibrations or limits that are those of the paper's bench, with which no film is driven by
    /// default. The settings of control may be left out.
    pub fn lacks(&self) -> Vec<&'static str> {
        self.missing.iter().copied().filter(|key| *key != CONTROL).collect()
    }

    /// The same with settings of control that are stated.
    #[must_use]
    pub fn with_control(mut self, control: Control) -> Self {
        self.missing.retain(|key| *key != CONTROL);
        Self { control, ..self }
    }

    /// Whether its settings of control are stated; otherwise they are those of the paper's bench, with a bandwidth that suits the film.
    pub fn states_control(&self) -> bool {
        !self.missing.contains(&CONTROL)
    }

    /// A bench like the paper's around `actuator`: 6 kV from an amplifier and a monitor of 1000:1 on 0…10 V, a sensor of
    /// 1 mm/V, and limits on the safe side of them.
    pub fn bench(actuator: &Actuator) -> Self {
        Self {
            id: boards::STM32F405,
            command_range: CommandRange::TenVolts,
            amplifier: Calibration::linear(1000.0),
            amplifier_lag: AmplifierLag::NONE,
            monitor: Calibration::linear(1000.0),
            // 1 V at rest: an unplugged one reads −1 mm, which is out of its range.
            sensor: Calibration::Parabola { offset: -1e-3, gain: 1e-3, quadratic: 0.0 },
            limits: Limits::bench(actuator.thickness_m as f32),
            control: Control::BENCH,
            self_test_above_v: <BoardParameters>::NO_SELF_TEST_V,
            self_sensing: None,
            missing: Vec::new(),
        }
    }

    /// The rate of the ticks, Hz: that of the tone, or that of the paper's bench.
    pub fn rate_hz(&self) -> f64 {
        self.self_sensing.as_ref().map_or(1000.0, |sensing| 1.0 / sensing.options.step_s)
    }

    /// The same at `rate_hz`: a sensor is stuck after as many seconds as at 1 kHz.
    #[must_use]
    pub fn at_rate(mut self, rate_hz: f64) -> Self {
        let ticks_at_1_khz = f64::from(self.limits.sensor.stuck_ticks);
        // Fewer cannot be distinguished from a late sensor.
        self.limits.sensor.stuck_ticks = (ticks_at_1_khz * rate_hz / 1000.0).ceil().max(5.0) as u32;
        self
    }

    /// Its limits for the laws of control, as the controller converts them.
    pub fn command_limits(&self) -> CommandLimits {
        self.control.command_limits(&self.limits, self.amplifier_lag)
    }

    /// Its settings of control along `law`: those that are stated, or [below its resonance](below_resonance).
    fn control_along(&self, law: &Law<f32>) -> Control {
        if self.states_control() { self.control } else { below_resonance(self.control, law) }
    }

    /// The table as TOML, numbers as short as they were written, without what is [`missing`](Self::missing).
    pub(super) fn to_toml(&self) -> toml::Table {
        let mut table = toml::Table::try_from(self).unwrap_or_default();
        table.iter_mut().for_each(|(_, value)| shorten(value));
        self.missing.iter().for_each(|key| drop(table.remove(*key)));
        // Its times are the file's, also where its calibration is the bench's.
        let AmplifierLag { rise_s, fall_s } = self.amplifier_lag;
        if self.amplifier_lag != AmplifierLag::NONE
            && let toml::Value::Table(amplifier) = table.entry("amplifier").or_insert_with(|| toml::Table::new().into())
        {
            amplifier.insert("rise_s".into(), rise_s.into());
            amplifier.insert("fall_s".into(), fall_s.into());
        }
        table
    }
}

/// A single-precision number of a controller in f64 as it was written in decimal, without the digits of its binary fraction:
/// 0.1 instead of 0.10000000149011612.
pub fn as_written(number: f32) -> f64 {
    number.to_string().parse().unwrap_or(f64::from(number))
}

fn shorten(value: &mut toml::Value) {
    match value {
        toml::Value::Float(number) => *number = as_written(*number as f32),
        toml::Value::Table(table) => table.iter_mut().for_each(|(_, value)| shorten(value)),
        toml::Value::Array(values) => values.iter_mut().for_each(shorten),
        _ => {}
    }
}

impl Parameters {
    /// The board of these parameters, or else that of the paper's bench at `rate_hz`, which lacks all of its own.
    pub fn board_or_bench(&self, rate_hz: f64) -> Board {
        self.board.clone().unwrap_or_else(|| Board { missing: Board::KEYS.into(), ..self.bench(rate_hz) })
    }

    /// The paper's bench around these parameters' actuator, at `rate_hz`: at rest its sensor gives 1 V, which it reads as
    /// `sensor_offset_m`.
    pub fn bench(&self, rate_hz: f64) -> Board {
        // 1 V at rest, as Board::bench has it.
        let sensor = Calibration::Parabola { offset: -1e-3 + self.sensor_offset_m as f32, gain: 1e-3, quadratic: 0.0 };
        let mut board = Board { sensor, ..Board::bench(&self.actuator).at_rate(rate_hz) };
        if self.sensor_delay_s > 0.0 {
            // As late as the sensor that the film was fitted with, and as fast as that lets the observer be.
            let control = &mut board.control;
            control.delay_s = self.sensor_delay_s as f32;
            let age_s = control.delay_s + control.sample_interval_s;
            control.bandwidth_hz = control.bandwidth_hz.min(MAX_SENSOR_PHASE / (std::f32::consts::TAU * age_s));
            let min_ticks = (5.0 * age_s * rate_hz as f32).ceil() as u32 + 1;
            board.limits.sensor.stuck_ticks = board.limits.sensor.stuck_ticks.max(min_ticks);
        }
        board
    }

    /// The settings of control of a controller that ticks at `rate_hz`, on [`board_or_bench`](Self::board_or_bench).
    ///
    /// # Errors
    ///
    /// [`Error::Law`] for a model that has no law at this rate.
    pub fn control(&self, rate_hz: f64) -> Result<Control> {
        let board = self.board_or_bench(rate_hz);
        Ok(board.control_along(&self.film().compressed_law(rate_hz)?))
    }

    /// Statement about the observer's bandwidth, if `used_hz` is less than that of [`board_or_bench`](Self::board_or_bench).
    pub fn bandwidth_note(&self, rate_hz: f64, used_hz: f64) -> Option<std::string::String> {
        let control = self.board_or_bench(rate_hz).control;
        (used_hz < f64::from(control.bandwidth_hz)).then(|| {
            format!(
                "the observer has a bandwidth of {used_hz:.2} Hz instead of {:.2}, as much as the model's resonance and the sensor's delay allow",
                control.bandwidth_hz
            )
        })
    }

    /// The blob of these parameters for a controller that ticks at `rate_hz`, on [`board_or_bench`](Self::board_or_bench),
    /// decoded once as the controller will: what it would refuse is refused here.
    pub fn checked_blob(&self, rate_hz: f64) -> Result<(Vec<u8>, Board)> {
        let board = self.board_or_bench(rate_hz);
        let blob = self.to_blob(&board, rate_hz)?;
        Blob::decode(&blob, board.id).map_err(|error| refused(&error, rate_hz))?;
        Ok((blob, board))
    }

    /// The blob for a controller that drives a film: calibrations and limits must be in the parameters, or `bench` allows those of the paper's.
    ///
    /// # Errors
    ///
    /// [`Error::Computation`] naming what is missing, and as [`to_blob`](Self::to_blob).
    pub fn blob_to_drive(&self, rate_hz: f64, bench: bool) -> Result<Vec<u8>> {
        let lacks = self.board.as_ref().map(Board::lacks);
        match lacks {
            lacks if bench || lacks.as_ref().is_some_and(Vec::is_empty) => {
                self.to_blob(&self.board_or_bench(rate_hz), rate_hz)
            }
            lacks => {
                let what = lacks.map_or("no [board] table".to_owned(), |keys| {
                    format!("the [board] table has no {}", keys.join(", "))
                });
                Err(Error::Computation(format!(
                    "{what}: calibrations and limits of your bench are needed (docs/formats.md), or `bench`"
                )))
            }
        }
    }

    /// The blob of these parameters for a controller that ticks at `rate_hz`, on `board`.
    ///
    /// # Errors
    ///
    /// [`Error::Law`] for a model that has no law at this rate, [`Error::Computation`] for what a controller would refuse.
    pub fn to_blob(&self, board: &Board, rate_hz: f64) -> Result<Vec<u8>> {
        let law: Law<f32> = self.film().compressed_law(rate_hz)?;
        let sensor = board.self_sensing.as_ref().map(SelfSensing::sensor).transpose();
        let self_sensing = sensor.map_err(|error| Error::Computation(format!("self-sensing: {error}")))?;
        let parameters = BoardParameters {
            name: shortened(&self.name),
            rate_hz: controller_rate(rate_hz) as f32,
            sensor_offset_m: self.sensor_offset_m as f32,
            command_range: board.command_range,
            amplifier: board.amplifier.clone(),
            amplifier_lag: board.amplifier_lag,
            monitor: board.monitor.clone(),
            sensor: board.sensor.clone(),
            limits: board.limits,
            control: board.control_along(&law),
            self_test_above_v: board.self_test_above_v,
            self_sensing,
            ..BoardParameters::bench(&law, self.actuator)
        };
        let mut bytes = vec![0; BLOB_LEN];
        let length = parameters.encode(board.id, &mut bytes).map_err(|error| refused(&error, rate_hz))?;
        bytes.truncate(length);
        Ok(bytes)
    }
}

/// `control` with a bandwidth that its sensor and the resonance of `law` [allow](springpot::ObserverOptions::below_resonance).
pub fn below_resonance(control: Control, law: &Law<f32>) -> Control {
    Control { bandwidth_hz: control.observer_options().below_resonance(law).bandwidth_hz as f32, ..control }
}

/// A controller's refusal of parameters at `rate_hz`.
fn refused(error: &BlobError, rate_hz: f64) -> Error {
    let BlobError::Control(ControlError::SensorTooLate { ticks, most }) = *error else {
        return Error::Computation(short(error));
    };
    let (delay_ms, largest_hz) = (1e3 * ticks as f64 / rate_hz, (rate_hz * most as f64 / ticks as f64).floor());
    Error::Computation(format!(
        "the sensor is {delay_ms:.0} ms late, {ticks} ticks at {rate_hz} Hz, and the observer remembers {most}: use a rate of at most {largest_hz} Hz \
         or a faster sensor"
    ))
}

/// The first letters of a name, as many as a blob has room for.
fn shortened(name: &str) -> String<32> {
    let mut short = String::new();
    for letter in name.chars() {
        if short.push(letter).is_err() {
            break;
        }
    }
    short
}
