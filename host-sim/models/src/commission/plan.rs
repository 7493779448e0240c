//! The plan of a sitting: its steps, the film and its bench, and what passes.

use host_io::choice;
use springpot::{Actuator, Maxwell, Springpot, Topology};

use super::verification::{RATE_HZ, Segments};
use crate::error::Result;
use crate::excitation::profile::{Profile, ProfileOptions};
use crate::files::parameters::{Board, Parameters, below_resonance};
use crate::fit::FitOptions;

choice! {
    /// A step of commissioning.
    #[derive(PartialOrd, Ord)]
    pub enum Step {
        /// The self-test of the bench, and the gauge.
        SelfTest = "self-test",
        /// A ramp in small steps, each predicted before it is taken.
        Ramp = "ramp",
        /// The excitation within what the ramp found.
        Excite = "excite",
        /// The fit, with the prediction of its own error.
        Fit = "fit",
        /// Upload, read back, compared.
        Upload = "upload",
        /// Random segments that the fit has not seen.
        Verify = "verify",
    }
}

/// The work to do.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The film.
    pub actuator: Actuator,
    /// Whether its sizes are assumed.
    pub assumed_sizes: bool,
    /// Its bench.
    pub board: Board,
    /// The first and the last step.
    pub steps: [Step; 2],
    /// Highest frequency of the use, Hz.
    pub band_hz: f64,
    /// Length of the hold in the excitation, s, and cycles of each sine.
    pub hold_s: f64,
    /// Cycles of each sine.
    pub cycles: u32,
    /// Rest before the verification, s.
    pub rest_s: f64,
    /// Segments of the verification.
    pub segments: usize,
    /// Largest error of a segment that passes, without and with the sensor, %.
    pub allowed_pct: [f64; 2],
    /// A gauge, and how the sensor reads it, m; none where the bench has its own or none is at hand.
    pub gauge_m: Option<[f64; 2]>,
    /// How the recording is fitted.
    pub fit: FitOptions,
    /// Whether the controller returns to its old parameters at the end.
    pub dry_run: bool,
    /// Seed of the segments.
    pub seed: u64,
}

impl Plan {
    /// All steps for `actuator` on `board`.
    pub fn new(actuator: Actuator, assumed_sizes: bool, board: Board) -> Self {
        Self {
            actuator,
            assumed_sizes,
            board,
            steps: [Step::SelfTest, Step::Verify],
            band_hz: 0.2,
            hold_s: 90.0,
            cycles: 5,
            rest_s: 60.0,
            segments: 60,
            allowed_pct: [10.0, 5.0],
            gauge_m: None,
            fit: FitOptions::default(),
            dry_run: false,
            seed: 1,
        }
    }

    /// Whether `step` is to be done.
    pub fn has(&self, step: Step) -> bool {
        (self.steps[0]..=self.steps[1]).contains(&step)
    }

    pub(super) fn excitation(&self, peak_v: f64) -> Result<Profile> {
        let options = ProfileOptions {
            peak_v,
            frequencies_hz: [1.0, 0.7, 0.385].map(|share| share * self.band_hz).to_vec(),
            cycles: self.cycles,
            hold_s: self.hold_s,
            rest_s: 5.0,
        };
        Profile::new(&options, &self.board.command_limits(), self.board.limits.thickness_m.into())
    }

    pub(super) fn expected_s(&self, step: Step) -> u64 {
        let seconds = match step {
            Step::SelfTest | Step::Upload => 2.0,
            Step::Ramp => 80.0,
            Step::Excite => self.excitation(1000.0).map_or(300.0, |profile| profile.duration_s()),
            Step::Fit => 10.0,
            Step::Verify => {
                let segments = Segments::random(0.0, 1.0, self.band_hz, self.segments, self.seed);
                1.5 * self.rest_s + 2.0 * segments.duration_s()
            }
        };
        seconds as u64
    }
}

/// A film stiffer than any that the limits allow, with which a controller plays voltages to a film that is not known yet.
///
/// # Errors
///
/// [`Error`](crate::error::Error) for an actuator or limits that no model has.
pub fn provisional(plan: &Plan) -> Result<Parameters> {
    let limits = &plan.board.limits;
    let largest_n = plan.actuator.electrostatic_force(limits.max_voltage_v.into());
    let stiffness = 20.0 * largest_n / f64::from(limits.max_displacement_m);
    let mut parameters = Parameters::preset("table3-n2")?;
    parameters.name = "not known yet".into();
    parameters.actuator = Actuator { stretch_coupling: 0.0, saturation_v: None, ..plan.actuator };
    parameters.model = Maxwell::new(Springpot::new(stiffness, 0.02), &[], Topology::Parallel, plan.actuator.mass_kg)?;
    parameters.assumed_sizes = plan.assumed_sizes;
    parameters.board = Some(plan.board.clone());
    Ok(parameters)
}

/// `parameters` on `board`, with the bandwidth that is stated there or, where a controller refuses the model with it, the largest accepted one that is not
/// below the band.
///
/// # Errors
///
/// [`Error`](crate::error::Error) where a controller refuses it with every bandwidth.
pub fn with_accepted_bandwidth(parameters: Parameters, board: &Board, band_hz: f64) -> Result<Parameters> {
    let slower = below_resonance(board.control, &parameters.film().compressed_law(RATE_HZ)?);
    let control = if f64::from(slower.bandwidth_hz) < band_hz { board.control } else { slower };
    let parameters = Parameters { board: Some(board.clone().with_control(control)), ..parameters };
    parameters.checked_blob(RATE_HZ).map(|_| parameters)
}
