//! Benches on which a film is commissioned.

use serde::Serialize;

use crate::error::Result;
use crate::files::parameters::Parameters;
pub use dea_driver::Mode;

/// Rows of a run per second.
pub const ROWS_HZ: f64 = 100.0;

/// Readings of a bench at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Time by the bench's clock, which goes on between runs, s.
    pub time_s: f64,
    /// Time by the clock of this host, s.
    pub host_s: f64,
    /// The voltage that is commanded, V.
    pub command_v: f64,
    /// The voltage monitor, V.
    pub monitor_v: f64,
    /// The displacement sensor, m; NaN without a reading.
    pub displacement_m: f64,
    /// The reference that the controller follows, m.
    pub reference_m: f64,
}

/// A line of a self-test.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// The part.
    pub what: String,
    /// The finding.
    pub found: String,
    /// The expected value.
    pub wanted: String,
    /// Whether it is.
    pub passed: bool,
}

/// Returns the target for the end of this row, a row later (V or m, as the mode is); none to end the run.
pub type Pilot<'a> = dyn FnMut(&Row) -> Option<f64> + 'a;

/// A bench: a film with its amplifier, monitor and sensor, behind a controller.
pub trait Bench {
    /// Where it is, such as its port.
    fn name(&self) -> String;
    /// Firmware of its controller.
    fn firmware(&self) -> String;
    /// Runs the self-test of the bench, at a voltage too low to move a film.
    ///
    /// # Errors
    ///
    /// [`Error`](crate::error::Error) where it does not answer.
    fn self_test(&mut self) -> Result<Vec<Check>>;
    /// Gives `parameters` to the controller, `keep` them over a reset, reads back what it runs, and returns the checksum.
    ///
    /// # Errors
    ///
    /// [`Error`](crate::error::Error) where they are refused, or others are read back.
    fn install(&mut self, parameters: &Parameters, keep: bool) -> Result<u32>;
    /// Returns to the parameters that the controller keeps.
    ///
    /// # Errors
    ///
    /// [`Error`](crate::error::Error) where it does not answer.
    fn restore(&mut self) -> Result<()>;
    /// Runs in `mode`, [`ROWS_HZ`] rows a second, until the `pilot` or a trip ends it, which is returned in words. The film is at 0 V with
    /// the amplifier disabled when this returns, whatever happened.
    ///
    /// # Errors
    ///
    /// [`Error`](crate::error::Error) where the bench does not answer.
    fn run(&mut self, mode: Mode, pilot: &mut Pilot<'_>) -> Result<Option<String>>;
    /// Reading of the sensor for a gauge of `displacement_m` (m) under its target, less that without the gauge; none where no gauge is at hand.
    fn gauge(&mut self, displacement_m: f64) -> Option<f64>;
}
