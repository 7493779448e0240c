//! `profile`: a voltage over time that identifies a film, within a board's limits.

use std::fmt::Write;

use super::options;
use super::prelude::*;
use crate::excitation::profile::{self, Part, PartShape, Profile, ProfileOptions, USUAL_SHARE};
use crate::files::parameters::{Parameters, plausibility};
use crate::grid::Grid;
use crate::quantity::{at_most, positive};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// File with the tables `[actuator]` and `[board]`; a model need not be there. Without `[board]` the paper's bench is assumed.
    #[arg(long, value_name = "B.toml")]
    board: String,
    /// Largest voltage; 0.9 of what the limits of voltage and field allow if left out.
    #[arg(long, value_name = "V", value_parser = quantity::volts)]
    peak: Option<f64>,
    /// Frequencies of the sines, in the band that the film will be used in.
    #[arg(long, value_name = "HZ,HZ,…", value_parser = quantity::hertz, value_delimiter = ',', default_values_t = [0.2, 0.14, 0.077])]
    frequencies: Vec<f64>,
    /// Cycles of each.
    #[arg(long, value_name = "N", default_value_t = 4)]
    cycles: u32,
    /// Length of the hold that shows the creep; 0 for none.
    #[arg(long, value_name = "S", value_parser = quantity::seconds, default_value_t = 60.0)]
    hold: f64,
    /// Length of the rest at the start.
    #[arg(long, value_name = "S", value_parser = quantity::seconds, default_value_t = 5.0)]
    rest: f64,
    /// Samples per second.
    #[arg(long, value_name = "HZ", value_parser = quantity::hertz, default_value_t = 100.0)]
    rate: f64,
    /// Profile to write: time_s, voltage_v.
    #[arg(long, value_name = "P.csv")]
    out: PathBuf,
}

#[derive(Serialize)]
struct Report {
    out: String,
    samples: usize,
    rate_hz: f64,
    duration_s: f64,
    peak_v: f64,
    /// Largest voltage that the limits allow on the undeformed film, V, and the limit that sets it.
    largest_v: f64,
    limit: &'static str,
    largest_slew_v_per_s: f64,
    parts: Vec<Part>,
    /// Assumptions.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    notes: Vec<String>,
}

/// Longest profile, s.
const MAX_S: f64 = 1e5;

impl Arguments {
    fn check(&self) -> Result<()> {
        positive("rate", self.rate)?;
        at_most("hold", self.hold, MAX_S)?;
        at_most("rest", self.rest, MAX_S)?;
        for frequency_hz in &self.frequencies {
            positive("frequencies", *frequency_hz)?;
            let least = 20.0 * frequency_hz;
            if least > self.rate {
                let cause = format!(
                    "{} Hz are fewer than 20 samples per cycle of {frequency_hz} Hz; use at least {least} Hz",
                    self.rate
                );
                return Err(Error::field("rate", cause));
            }
        }
        if self.cycles == 0 {
            return Err(Error::field("cycles", "at least 1 is needed"));
        }
        self.peak.map_or(Ok(()), |peak| positive("peak", peak))
    }
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    arguments.check()?;
    let (actuator, board, assumed_sizes) = Parameters::load_board(&arguments.board)?;
    options::doubt(&arguments.board, &plausibility::doubts(&actuator, assumed_sizes));
    let limits = board.command_limits();
    let (largest_v, limit) = profile::largest_voltage(&limits, actuator.thickness_m);
    let options = ProfileOptions {
        // Whole volts: they are read by people.
        peak_v: arguments.peak.unwrap_or((USUAL_SHARE * largest_v).floor()),
        frequencies_hz: arguments.frequencies.clone(),
        cycles: arguments.cycles,
        hold_s: arguments.hold,
        rest_s: arguments.rest,
    };
    let made = Profile::new(&options, &limits, actuator.thickness_m)?;
    let duration_s = made.duration_s();
    if duration_s > MAX_S {
        let cause = format!(
            "the profile lasts {duration_s:.0} s, at most {MAX_S:.0} s are possible; use fewer, or higher --frequencies"
        );
        return Err(Error::field("cycles", cause));
    }
    let grid = Grid::covering(made.duration_s(), arguments.rate)?;
    let voltage = made.on(grid);
    output::check(&arguments.out, &[Path::new(&arguments.board)], Folders::Exist)?;
    let time = grid.times_s();
    output::write_columns(
        &arguments.out,
        &[("time_s", Some(time.as_slice())), ("voltage_v", Some(voltage.as_slice()))],
    )?;
    let slew = voltage.windows(2).map(|pair| (pair[1] - pair[0]).abs() * arguments.rate).fold(0.0, f64::max);
    let sizes = assumed_sizes.then(|| {
        format!(
            "the film's sizes are assumed ({:.0} µm thick): whether the field stays within its limit is not known",
            1e6 * actuator.thickness_m
        )
    });
    let bench = board.lacks().contains(&"limits").then(|| {
        format!(
            "{} has no [board.limits]: the limits are those of the paper's bench, {largest_v:.0} V",
            arguments.board
        )
    });
    let report = Report {
        out: shown(&arguments.out),
        samples: grid.samples,
        rate_hz: arguments.rate,
        duration_s: made.duration_s(),
        peak_v: options.peak_v,
        largest_v,
        limit,
        largest_slew_v_per_s: slew,
        parts: made.parts,
        notes: sizes.into_iter().chain(bench).collect(),
    };
    terminal::warnings(json, &report.notes);
    terminal::report(json, &report, || text(&report))
}

fn described(part: &Part) -> String {
    let what = match part.shape {
        PartShape::Rest => "rest at 0 V".into(),
        PartShape::Sine { frequency_hz, peak_v } => format!("sine of {frequency_hz:.4} Hz up to {peak_v:.0} V"),
        PartShape::Hold { peak_v, ramp_s } => format!("hold of {peak_v:.0} V, ramps of {ramp_s:.2} s"),
    };
    format!("{:.1} to {:.1} s: {what}", part.from_s, part.to_s)
}

fn text(report: &Report) -> String {
    let mut text = format!(
        "{}: {} samples at {} Hz, {:.1} s, up to {} V ({} allows {:.0} V) and {:.0} V/s",
        report.out,
        report.samples,
        report.rate_hz,
        report.duration_s,
        report.peak_v,
        report.limit,
        report.largest_v,
        report.largest_slew_v_per_s
    );
    for part in &report.parts {
        let _ = write!(text, "\n  {}", described(part));
    }
    text
}
