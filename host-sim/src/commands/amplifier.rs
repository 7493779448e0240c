//! `amplifier`: how fast an amplifier follows, from a log of command and monitor.

use super::options;
use super::prelude::*;
use super::recordings::{self, RecordingOptions};
use crate::amplifier::{self, Identification, Interval, Time};
use crate::files::amplifier_log::AmplifierLog;
use crate::files::parameters::Parameters;
use crate::report::figure::{Colour, Figure, Line, Panel};
use crate::report::figure_file::{Plot, PlotOption};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Log of the amplifier: time_s, command_v, and monitor_v (or voltage_v, as `link … stream` and `play` write it); or a laboratory's own
    /// file of these. Best are steps up and
    /// down to 0 V, at every tick.
    #[arg(value_name = "LOG.csv")]
    log: PathBuf,
    #[command(flatten)]
    reading: RecordingOptions,
    #[command(flatten)]
    plot: PlotOption,
    /// Parameter file (TOML), or preset:NAME, that gets rise_s and fall_s.
    #[arg(long, value_name = "P", requires = "out")]
    params: Option<String>,
    /// Parameter file to write, with rise_s and fall_s in their [board.amplifier].
    #[arg(long, value_name = "P.toml", requires = "params")]
    out: Option<PathBuf>,
}

#[derive(Serialize)]
struct Report {
    log: String,
    /// Null where the log does not determine it.
    rise_s: Option<f64>,
    fall_s: Option<f64>,
    intervals_95_pct: Intervals,
    gain: f64,
    offset_v: f64,
    residual_v: f64,
    noise_v: f64,
    samples: usize,
    interval_s: f64,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    not_determined: Vec<String>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    warnings: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    plot: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    out: Option<String>,
}

/// 95 % intervals; of a time that is not determined, what fits as well.
#[derive(Serialize)]
struct Intervals {
    rise_s: Interval,
    fall_s: Interval,
    gain: Interval,
    offset_v: Interval,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let log = AmplifierLog::read(&arguments.log, &arguments.reading.hints())?;
    recordings::report_understood(&log.understood);
    let parameters = arguments.params.as_deref().map(options::load).transpose()?;
    let plot = arguments.check_outputs()?;
    let bar = Progress::unknown("identify the amplifier");
    let identified = amplifier::identify(&log)?;
    bar.finish_and_clear();

    let report = Report::new(arguments, &identified);
    let times = report.rise_s.zip(report.fall_s);
    if arguments.out.is_some() && times.is_none() {
        return Err(Error::file(&arguments.log, report.not_determined.join("; ")));
    }
    let figure = || Figure::new("How fast the amplifier follows", panels(&log, &identified));
    let written = match (parameters, &arguments.out, times) {
        (Some(parameters), Some(out), Some(times)) => Some(stage(out, parameters, times)?),
        _ => None,
    };
    plot.write(&report, written, figure)?;
    terminal::warnings(json, &report.warnings);
    terminal::report(json, &report, || text(&report))
}

impl Arguments {
    /// Refuses outputs that could not be written; the figure to draw.
    fn check_outputs(&self) -> Result<Plot> {
        let read: Vec<&Path> =
            [Some(self.log.as_path()), self.params.as_deref().map(Path::new)].into_iter().flatten().collect();
        self.plot.check_beside(&read, self.out.as_deref())
    }
}

/// The file `out` with `parameters` and the times (s).
fn stage(out: &Path, mut parameters: Parameters, (rise_s, fall_s): (f64, f64)) -> Result<Staged> {
    let mut board = parameters.board_or_bench(1000.0);
    (board.amplifier_lag.rise_s, board.amplifier_lag.fall_s) = (written(rise_s), written(fall_s));
    parameters.board = Some(board);
    Staged::new(out, |file| file.write_all(parameters.to_toml().as_bytes()))
}

impl Report {
    fn new(arguments: &Arguments, identified: &Identification) -> Self {
        let (rise_s, rise_interval) = known(identified.rise);
        let (fall_s, fall_interval) = known(identified.fall);
        let open =
            [(identified.rise, "rise_s", "record a step up"), (identified.fall, "fall_s", "record a step down to 0 V")];
        Self {
            log: shown(&arguments.log),
            rise_s,
            fall_s,
            intervals_95_pct: Intervals {
                rise_s: rise_interval,
                fall_s: fall_interval,
                gain: identified.gain.1,
                offset_v: identified.offset_v.1,
            },
            gain: identified.gain.0,
            offset_v: identified.offset_v.0,
            residual_v: identified.residual_v,
            noise_v: identified.noise_v,
            samples: identified.samples,
            interval_s: identified.interval_s,
            not_determined: open.into_iter().filter_map(|(time, name, remedy)| missing(time, name, remedy)).collect(),
            warnings: identified.warnings.clone(),
            plot: arguments.plot.path().map(shown),
            out: arguments.out.as_deref().map(shown),
        }
    }
}

/// A value, if the log determines it, and its interval, s.
fn known(time: Time) -> (Option<f64>, Interval) {
    match time {
        Time::Known(value, interval) => (Some(value), interval),
        Time::Open(interval) => (None, interval),
    }
}

/// A value as it goes into a parameter file: with four digits, more than an amplifier keeps.
fn written(value: f64) -> f64 {
    format!("{value:.3e}").parse().unwrap_or(value)
}

fn missing(time: Time, name: &str, remedy: &str) -> Option<String> {
    match time {
        Time::Known(..) => None,
        Time::Open([low, high]) => Some(format!(
            "{name} is not determined by this log: anything from {low:.3} to {high:.3} s fits as well; {remedy}"
        )),
    }
}

fn text(report: &Report) -> String {
    let Report { rise_s, fall_s, intervals_95_pct: Intervals { rise_s: rise, fall_s: fall, .. }, .. } = report;
    let mut lines = Vec::new();
    for (name, value, [low, high]) in [("rise_s", rise_s, rise), ("fall_s", fall_s, fall)] {
        lines.extend(value.map(|value| {
            if value == 0.0 {
                format!("{name} 0: none that rows {:.1} ms apart would show", 1e3 * report.interval_s)
            } else {
                format!("{name} {} s, 95 % interval {low:.5} to {high:.5} s", written(value))
            }
        }));
    }
    lines.extend(report.not_determined.iter().cloned());
    lines.push(format!(
        "monitor: gain {:.4}, offset {:.1} V; residual {:.2} V RMS, noise {:.2} V, {} samples",
        report.gain, report.offset_v, report.residual_v, report.noise_v, report.samples
    ));
    lines.extend(report.plot.iter().map(|plot| format!("{plot}: command, monitor, model and residual")));
    match &report.out {
        Some(out) => lines.push(format!("{out}: the parameters with these times")),
        None => {
            lines.push("[board.amplifier]".into());
            lines.extend(rise_s.map(|value| format!("rise_s = {:?}", written(value))));
            lines.extend(fall_s.map(|value| format!("fall_s = {:?}", written(value))));
        }
    }
    lines.join("\n")
}

/// The whole log, its largest change, and what the model leaves.
fn panels(log: &AmplifierLog, identified: &Identification) -> Vec<Panel> {
    let rows = 0..log.time_s.len();
    let around = around_the_largest_change(log, identified);
    let residual: Vec<f64> = log.monitor_v.iter().zip(&identified.shown_v).map(|(read, shown)| read - shown).collect();
    let (time, residual): (Vec<f64>, Vec<f64>) =
        log.time_s.iter().zip(residual).filter(|(_, residual)| !residual.is_nan()).unzip();
    vec![
        voltages("Command and monitor", log, identified, rows),
        voltages("Around the largest change", log, identified, around),
        Panel::new("Residual", "time (s)", "monitor − model (V)")
            .with(Line::new("monitor − model", &time, &residual).coloured(Colour::BLUE)),
    ]
}

fn voltages(title: &str, log: &AmplifierLog, identified: &Identification, rows: std::ops::Range<usize>) -> Panel {
    let line = |label: &str, volts: &[f64]| {
        let points = rows.clone().map(|k| (log.time_s[k], 1e-3 * volts[k])).filter(|(_, kv)| !kv.is_nan());
        let (time, kv): (Vec<f64>, Vec<f64>) = points.unzip();
        Line::new(label, &time, &kv)
    };
    Panel::new(title, "time (s)", "voltage (kV)")
        .with(line("monitor", &log.monitor_v).beneath())
        .with(line("command", &log.command_v).coloured(Colour::VERMILION))
        .with(line("model of the monitor", &identified.shown_v).coloured(Colour::BLUE))
}

/// The rows around the largest change of the command within the time that the amplifier takes.
fn around_the_largest_change(log: &AmplifierLog, identified: &Identification) -> std::ops::Range<usize> {
    let longest =
        [identified.rise, identified.fall].map(|time| known(time).0.unwrap_or(0.0)).into_iter().fold(0.0, f64::max);
    let longest = longest.max(10.0 * identified.interval_s);
    let row_at = |time_s: f64| log.time_s.partition_point(|t| *t < time_s);
    let change = |k: usize| {
        let before = row_at(log.time_s[k] - longest).min(k);
        (log.command_v[k] - log.command_v[before]).abs()
    };
    let row = (0..log.time_s.len()).max_by(|&a, &b| change(a).total_cmp(&change(b)).then(b.cmp(&a))).unwrap_or(0);
    row_at(log.time_s[row] - 2.0 * longest)..row_at(log.time_s[row] + 6.0 * longest)
}
