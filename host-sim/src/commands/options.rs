//! Options that several commands have.

use springpot::{Actuator, CommandLimits, Discretisation};

use super::prelude::*;
use crate::files::parameters::{Board, Parameters, plausibility};
use crate::files::recording::Recording;
use crate::fit::check_recorded;
use crate::replay::limits::command_limits;
use crate::replay::memory::{MemoryChoice, Precision, RunOptions};

/// The parameters named on the command line; doubts about their sizes are warnings.
pub(super) fn load(name: &str) -> Result<Parameters> {
    let parameters = Parameters::load(name)?;
    check_recorded(&parameters).map_err(|cause| Error::file(name.as_ref(), cause))?;
    doubt(name, &parameters.doubts());
    Ok(parameters)
}

/// A film at another temperature than that of its parameters.
#[derive(Clone, Copy, Debug, Default, Args)]
pub(super) struct AtTemperature {
    /// Temperature of the film, °C, where it was fitted at several; that of its parameters if left out.
    #[arg(long, value_name = "C", allow_negative_numbers = true, value_parser = quantity::celsius)]
    pub(super) temperature: Option<f64>,
}

impl AtTemperature {
    /// The parameters named on the command line, at this temperature.
    pub(super) fn load(self, name: &str) -> Result<Parameters> {
        load_at(name, "temperature", self.temperature)
    }
}

/// The parameters named on the command line, at the temperature (°C) of the option `field`.
pub(super) fn load_at(name: &str, field: &'static str, temperature_c: Option<f64>) -> Result<Parameters> {
    let parameters = load(name)?;
    match temperature_c {
        Some(temperature_c) => parameters.at(temperature_c).map_err(|cause| Error::field(field, cause)),
        None => Ok(parameters),
    }
}

/// The blob of the `parameters` named on the command line, for a board at `rate_hz` that drives a film; with `bench` what they lack is that of the paper's
/// bench.
pub(super) fn blob_to_drive(name: &str, parameters: &Parameters, rate_hz: f64, bench: bool) -> Result<Vec<u8>> {
    parameters.blob_to_drive(super::board_rate(rate_hz)?, bench).map_err(|e| e.about(name, name.as_ref()))
}

/// The actuator of the file `name`, and whether its sizes are assumed; doubts about them are warnings.
pub(super) fn load_actuator(name: &str) -> Result<(Actuator, bool)> {
    let (actuator, assumed) = Parameters::load_sized_actuator(name)?;
    doubt(name, &plausibility::doubts(&actuator, assumed));
    Ok((actuator, assumed))
}

/// The note that no field is known of a film whose sizes are assumed.
pub(super) fn field_note(parameters: &Parameters) -> Option<String> {
    parameters.field_note().map(|note| with_flags(&note))
}

/// Warns of `doubts` about the sizes in the file `name`.
pub(super) fn doubt(name: &str, doubts: &[String]) {
    terminal::warnings(false, doubts.iter().map(|doubt| format!("{name}: {doubt}")));
}

/// A film, and how its law is made.
#[derive(Clone, Debug, Args)]
pub(super) struct LawOptions {
    /// Parameter file (TOML), or preset:NAME such as preset:table3-n2.
    #[arg(long, value_name = "P")]
    pub(super) params: String,
    #[command(flatten)]
    temperature: AtTemperature,
    /// Steps per second.
    #[arg(long, value_name = "HZ", value_parser = quantity::hertz, default_value_t = 1000.0)]
    pub(super) rate: f64,
    /// How a derivative in time becomes a difference of samples: Grünwald–Letnikov as in the paper, or second order.
    #[arg(long, value_parser = named::<Discretisation>(), default_value = "gl")]
    method: Discretisation,
}

impl LawOptions {
    /// The parameters, stepped by the method.
    pub(super) fn parameters(&self) -> Result<Parameters> {
        Ok(self.temperature.load(&self.params)?.with_method(self.method))
    }

    /// Refuses a temperature for `recordings` that have their own.
    pub(super) fn check_temperature(&self, recordings: &[Recording]) -> Result<()> {
        let own = recordings.iter().find(|recording| recording.temperature_c().is_some());
        match (self.temperature.temperature, own) {
            (Some(_), Some(recording)) => {
                let cause = format!(
                    "{} has a column temperature_c, at which its film is: leave the option out",
                    shown(recording.path())
                );
                Err(Error::field("temperature", cause))
            }
            _ => Ok(()),
        }
    }
}

/// A run of such a law.
#[derive(Clone, Debug, Args)]
pub(super) struct RunArguments {
    #[command(flatten)]
    pub(super) law: LawOptions,
    /// How much of the past the model remembers: compressed (as on the controller), full, or window:SECONDS.
    #[arg(long, value_name = "MEMORY", default_value = "compressed")]
    memory: MemoryChoice,
    /// Arithmetic of a step; full memory is computed in f64 and rounded at the end.
    #[arg(long, value_parser = named::<Precision>(), default_value = "f32")]
    precision: Precision,
}

impl RunArguments {
    pub(super) fn run_options(&self) -> RunOptions {
        RunOptions { rate_hz: self.law.rate, memory: self.memory, precision: self.precision }
    }
}

/// Limits of the command. Defaults are those of the board, or without one those of the paper's bench.
#[derive(Clone, Debug, Args)]
pub(super) struct LimitOptions {
    /// Largest voltage; the parameters' or 6000 if left out.
    #[arg(long, value_name = "V", value_parser = quantity::volts)]
    max_voltage: Option<f64>,
    /// Largest electric field in the film as it thins, V/m; the parameters' or 4.2e7 if left out.
    #[arg(long, value_name = "V/M", value_parser = quantity::volts_per_metre)]
    max_field: Option<f64>,
    /// Largest change of voltage, V/s; the parameters' or 50e3 if left out.
    #[arg(long, value_name = "V/S", value_parser = quantity::volts_per_second)]
    max_slew: Option<f64>,
    /// Largest speed of the shaped reference, m/s; the parameters' or 0.05 if left out.
    #[arg(long, value_name = "M/S", value_parser = quantity::metres_per_second)]
    max_velocity: Option<f64>,
    /// Largest acceleration of the shaped reference, m/s²; the parameters' or 0.5 if left out.
    #[arg(long, value_name = "M/S2", value_parser = quantity::metres_per_second_squared)]
    max_acceleration: Option<f64>,
}

impl LimitOptions {
    /// The limits on `board`.
    pub(super) fn limits(&self, board: Option<&Board>) -> Result<CommandLimits> {
        let given = [
            ("max_voltage_v", self.max_voltage),
            ("max_field_v_per_m", self.max_field),
            ("max_slew_v_per_s", self.max_slew),
            ("max_velocity_m_per_s", self.max_velocity),
            ("max_acceleration_m_per_s2", self.max_acceleration),
        ];
        command_limits(board, given.into_iter().filter_map(|(name, value)| Some((name, value?))))
    }
}
