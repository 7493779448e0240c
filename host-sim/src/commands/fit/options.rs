//! The options of `fit`.

use crate::commands::options;
use crate::commands::prelude::*;
use crate::files::recording::Direction;
use crate::fit::options::{AtGap, Branches, Sharing, TopologyChoice, Weight};
use crate::fit::settings::CurveChoice;
use crate::fit::{FitOptions, Loss, Method, Settings};

/// Options of a fit.
#[derive(Clone, Debug, Args)]
pub(super) struct FitArguments {
    /// Branches of two springpots, 0 to 5, or auto.
    #[arg(long, value_name = "N|auto", default_value = "auto")]
    branches: Branches,
    /// How branches are connected.
    #[arg(long, value_parser = named::<TopologyChoice>(), default_value = "auto")]
    topology: TopologyChoice,
    /// Extension of the linear film: an elastic curve, a drive that saturates, both, or what left-out recordings ask for.
    #[arg(long, value_parser = named::<CurveChoice>(), default_value = "auto")]
    curve: CurveChoice,
    /// How parameters are searched for.
    #[arg(long, value_parser = named::<Method>(), default_value = "lm")]
    method: Method,
    /// Input of the model.
    #[arg(long, value_parser = named::<Direction>(), default_value = "force")]
    drive: Direction,
    /// Fit this too: stretch_coupling and offset_m (freed by default), mass_kg, or one of relative_permittivity,
    /// length_m, width_m and thickness_m.
    #[arg(long, value_name = "NAME")]
    free: Vec<String>,
    /// Do not fit this: stretch_coupling, offset_m, or with --start an element as warnings name it, such as main.alpha.
    #[arg(long, value_name = "NAME")]
    hold: Vec<String>,
    /// File with the actuator table: geometry, permittivity, mass, preload, coupling. Without it the paper's sizes are assumed
    /// (40 mm x 60 mm x 160 um), and no field limit is claimed; without mass if displacement drives.
    #[arg(long, value_name = "P")]
    actuator: Option<String>,
    /// Start parameters, instead of random starts; they also give branches and topology.
    #[arg(long, value_name = "P", conflicts_with_all = ["actuator", "branches"])]
    start: Option<String>,
    /// Loss function of the residuals.
    #[arg(long, value_parser = named::<Loss>(), default_value = "square")]
    loss: Loss,
    /// Weight of each recording, in their order; or log-time: every decade of time since the recording's start counts the same.
    /// A column weight of a recording weighs its rows.
    #[arg(long, value_name = "W,W,…|log-time", value_delimiter = ',')]
    weights: Vec<Weight>,
    /// The sensor's offset: one for all recordings, or per-recording, where it was zeroed anew.
    #[arg(long, value_parser = named::<Sharing>(), default_value = "joint")]
    offset: Sharing,
    /// Time by which the displacement sensor is late, s. By default it is estimated where the recordings show one.
    #[arg(long, value_name = "S", value_parser = quantity::seconds, allow_negative_numbers = true)]
    sensor_delay: Option<f64>,
    /// The size of the readings: one for all recordings, or per-recording, for other specimens; relative to the first.
    #[arg(long, value_parser = named::<Sharing>(), default_value = "joint")]
    gain: Sharing,
    /// Time without rows, s, beyond which --at-gap applies. By default the input is interpolated.
    #[arg(long, value_name = "S", value_parser = quantity::seconds)]
    gap: Option<f64>,
    /// Action at a gap: end the recording there, or skip as much time after it as it lasted.
    #[arg(long, value_parser = named::<AtGap>(), default_value = "end", requires = "gap")]
    at_gap: AtGap,
    /// Turn the sign of what is measured.
    #[arg(long)]
    invert: bool,
    /// Fit what was measured from here on, s; the model still runs from the first row.
    #[arg(long, value_name = "S", value_parser = quantity::seconds, default_value_t = 0.0)]
    from: f64,
    /// Fit what was measured up to here, s. The default is the end.
    #[arg(long, value_name = "S", value_parser = quantity::seconds)]
    to: Option<f64>,
    /// Seed of the random starts.
    #[arg(long, value_name = "N", default_value_t = Settings::default().seed)]
    seed: u64,
    /// Random starts per structure.
    #[arg(long, value_name = "N", default_value_t = Settings::default().starts)]
    starts: usize,
}

impl FitArguments {
    /// The options of the library.
    pub(super) fn options(&self) -> FitOptions {
        FitOptions {
            branches: self.branches,
            topology: self.topology,
            curve: self.curve,
            method: self.method,
            drive: self.drive,
            free: self.free.clone(),
            hold: self.hold.clone(),
            loss: self.loss,
            weights: self.weights.clone(),
            offset: self.offset,
            sensor_delay_s: self.sensor_delay,
            gain: self.gain,
            gap_s: self.gap,
            at_gap: self.at_gap,
            invert: self.invert,
            from_s: self.from,
            to_s: self.to,
            seed: self.seed,
            starts: self.starts,
        }
    }

    /// The settings that the options of `fit` give with the files that are named.
    pub(super) fn settings(&self, fit: &FitOptions) -> Result<Settings> {
        let start = self.start.as_deref().map(options::load).transpose()?;
        let actuator = self.actuator.as_deref().map(options::load_actuator).transpose()?;
        fit.settings(start, actuator)
    }

    /// Parameter files that are read.
    pub(super) fn parameter_files(&self) -> impl Iterator<Item = &Path> {
        self.actuator.iter().chain(&self.start).map(Path::new)
    }
}
