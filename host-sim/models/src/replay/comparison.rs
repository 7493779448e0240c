//! A model beside a recording: what is compared, and how well it agrees.

use crate::agreement::Agreement;
use crate::error::{Error, Result};
use crate::files::parameters::Parameters;
use crate::files::recording::{Direction, Input, Recording};
use crate::grid::{Grid, Samples};
use crate::progress::Watch;
use crate::replay::memory::RunOptions;
use crate::replay::simulate::{self, Response};

/// The input of a recording on the grid of a run, and the output that was measured.
pub struct Comparison<'a> {
    recording: &'a Recording,
    direction: Direction,
    /// Grid of the run.
    pub grid: Grid,
    /// Input of the run.
    pub input: Input,
    /// Readings of the displacement sensor in m, or forces in N where displacement is the input.
    pub measured: Samples,
}

impl<'a> Comparison<'a> {
    /// Takes input and output of `recording` in `direction` for a run of `parameters` at `rate_hz`.
    ///
    /// # Errors
    ///
    /// [`Error`] naming the recording where a column is missing or too short.
    pub fn new(recording: &'a Recording, direction: Direction, parameters: &Parameters, rate_hz: f64) -> Result<Self> {
        let (input, measured) = match direction {
            Direction::Force => (recording.drive()?, recording.displacement()?),
            Direction::Displacement => (recording.displacement_drive()?, total_force(parameters, recording)?),
        };
        if measured.value.len() < 2 {
            return Err(Error::file(recording.path(), "one measured value; a comparison needs at least 2"));
        }
        Ok(Self { recording, direction, grid: recording.grid(rate_hz)?, input, measured })
    }

    /// The recording.
    pub fn recording(&self) -> &Recording {
        self.recording
    }

    /// Runs `parameters` and compares the output, as its sensor reads it, at the measured times.
    pub fn run(
        &self,
        parameters: &Parameters,
        options: &RunOptions,
        progress: &dyn Watch,
    ) -> Result<(Response, Agreement)> {
        let parameters = parameters.along(self.recording)?;
        let response = simulate::response(&parameters, &self.input, self.grid, options, progress)?;
        let agreement = Agreement::new(&self.measured.value, &self.readings(&parameters, &response));
        Ok((response, agreement))
    }

    /// The output of `response`, as its sensor reads it, at the measured times.
    pub fn readings(&self, parameters: &Parameters, response: &Response) -> Vec<f64> {
        let times = &self.measured.time_s;
        match self.direction {
            Direction::Force => {
                let sensor = parameters.sensor();
                let displacement = if sensor.delay_s == 0.0 {
                    self.grid.at(&response.displacement_m, times)
                } else {
                    // Before the first sample the film is at rest.
                    let before: Vec<f64> = times.iter().map(|t| t - sensor.delay_s).collect();
                    let at = self.grid.at(&response.displacement_m, &before).into_iter().zip(&before);
                    at.map(|(x, t)| if *t < 0.0 { 0.0 } else { x }).collect()
                };
                let read: Vec<f64> = displacement.into_iter().map(|x| sensor.reading_m(x)).collect();
                // At another temperature a film rests elsewhere, as a fit to several has it.
                let zero_m = match parameters.temperature {
                    Some(_) => {
                        let open = self.measured.value.iter().zip(&read).map(|(measured, read)| measured - read);
                        open.sum::<f64>() / read.len() as f64
                    }
                    None => 0.0,
                };
                read.into_iter().map(|reading| reading + zero_m).collect()
            }
            Direction::Displacement => self.grid.at(&response.force_n, times),
        }
    }
}

/// The force on the film as it was measured, or as Eq. 1 gives it from voltage and displacement.
fn total_force(parameters: &Parameters, recording: &Recording) -> Result<Samples> {
    if let Some(force) = recording.force() {
        return Ok(force);
    }
    let Input::Voltage(voltage) = recording.drive()? else {
        return Err(Error::file(recording.path(), "neither force_n nor voltage_v has a value"));
    };
    let displacement = recording.displacement_drive()?;
    let pairs = voltage.value.iter().zip(&displacement.samples().value);
    let value = pairs.map(|(&v, &x)| parameters.actuator.force(v, x)).collect();
    Ok(Samples { time_s: voltage.time_s, value })
}
