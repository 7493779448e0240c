//! `run`: a reference followed through a supply, by the controller's code on this host.

use std::time::Instant;

use super::options::AtTemperature;
use super::prelude::*;
use super::recordings::RecordingOptions;
use crate::files::journal::{Journal, Recovered};
use crate::grid::range;
use crate::interrupt;
use crate::supply::{self, Follow, Row, Sensor, SerialLine, Session, Supply};

/// Samples of the reference per second; between them it is a line.
const REFERENCE_HZ: f64 = 1000.0;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Supply: generic, hvps-x, scpi, shvps, technix-sr, or a description (TOML).
    #[arg(long, value_name = "SUPPLY")]
    supply: String,
    /// Its port: a serial port such as /dev/ttyUSB0 or COM3, or tcp:HOST:PORT.
    #[arg(long, value_name = "PORT")]
    port: String,
    /// Parameter file (TOML), or preset:NAME such as preset:table3-n2. The limits of its table board hold.
    #[arg(long, value_name = "P")]
    params: String,
    #[command(flatten)]
    temperature: AtTemperature,
    /// Reference to follow: time_s, displacement_m.
    #[arg(long, value_name = "REF.csv")]
    reference: PathBuf,
    /// Recording to write as it comes: time_s, voltage_v (read back), displacement_m (with a sensor), command_v, reference_m, predicted_m.
    #[arg(long, value_name = "OUT.csv")]
    log: PathBuf,
    /// Port of a displacement sensor that sends lines with a number; without one the model alone predicts the film.
    #[arg(long, value_name = "PORT")]
    sensor: Option<String>,
    /// Unit of its numbers.
    #[arg(long, value_name = "UNIT", default_value = "mm", value_parser = ["m", "mm", "um"])]
    sensor_unit: String,
    /// Bits per second of its port.
    #[arg(long, value_name = "BAUD", default_value_t = 115_200)]
    sensor_baud: u32,
    /// Accept that the voltage stays if this computer or the cable fails: for a supply that has no watchdog.
    #[arg(long)]
    without_watchdog: bool,
    #[command(flatten)]
    reading: RecordingOptions,
}

#[derive(Serialize)]
struct Report {
    log: String,
    supply: String,
    samples: usize,
    complete: bool,
    slowest_reply_s: f64,
    /// RMS error of the sensor's readings in % of the reference's peak to peak; null without a sensor.
    tracking_rms_pct: Option<f64>,
    without_watchdog: bool,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    // Everything that can be refused is refused before the port is opened.
    let supply = Supply::load(&arguments.supply)?;
    let parameters = arguments.temperature.load(&arguments.params)?;
    let (reference, grid) = arguments.reading.reference(&arguments.reference, REFERENCE_HZ)?;
    let inputs = [arguments.reference.as_path(), arguments.params.as_ref()];
    output::check(&arguments.log, &inputs, Folders::Exist)?;
    let has_sensor = arguments.sensor.is_some();
    let controller = supply::controller(&parameters, &supply, has_sensor)
        .map_err(|error| error.about(&arguments.params, &arguments.reference))?;
    let warning = warning(&supply, arguments.without_watchdog)?;
    if parameters.board.is_none() {
        let limits = &controller.0.parameters().limits;
        terminal::warnings(
            false,
            [format!(
                "{}: no [board] table: the limits are those of the paper's bench, {:.0} V and {:.1} mm",
                arguments.params,
                limits.max_voltage_v,
                1e3 * limits.max_displacement_m
            )],
        );
    }
    if !supply.names_its_device() {
        let text = format!(
            "{}: its description takes any device that answers, and sets its voltage: put the reply of yours into identify.reply",
            supply.name
        );
        terminal::warnings(false, [text]);
    }
    // Also with -q.
    warning.iter().for_each(terminal::message);

    let start = Instant::now();
    let line = SerialLine::open(&arguments.port, supply.baud, start)?;
    let sensor = arguments.sensor.as_deref().map(|port| sensor(arguments, port, start)).transpose()?;
    let columns = ["time_s", "voltage_v", "displacement_m", "command_v", "reference_m", "predicted_m"];
    let columns: Vec<&str> = columns.into_iter().filter(|name| has_sensor || *name != "displacement_m").collect();
    let (mut journal, recovered) = Journal::begin(&arguments.log, &columns)?;
    if let Some(Recovered { path, rows }) = recovered {
        terminal::message(format!("an earlier run was killed: its {rows} samples are kept in {}", shown(&path)));
    }

    // From here on Ctrl-C comes to an end at 0 V.
    let stop = interrupt::live_film();
    let at = |time_s: f64| {
        let index = (time_s * grid.rate_hz).clamp(0.0, (reference.len() - 1) as f64);
        let (left, share) = (index as usize, index.fract());
        let right = (left + 1).min(reference.len() - 1);
        reference[left] + share * (reference[right] - reference[left])
    };
    let ticks = ((grid.samples - 1) as f64 / grid.rate_hz * supply.rate_hz) as usize + 1;
    let what = Follow { reference_m: &at, ticks, stop };
    let mark = if warning.is_some() { "NO WATCHDOG: " } else { "" };
    let bar = Progress::over(ticks as u64, &format!("{mark}identifies the supply"));
    let (mut samples, mut squares, mut readings) = (0, 0.0, 0);
    let name = supply.name.clone();
    let ended = Session::begin(supply, Box::new(line)).and_then(|session| {
        supply::follow(session, controller, sensor, &what, |row| {
            let Row { time_s, voltage_v, displacement_m, command_v, reference_m, predicted_m } = row;
            samples += 1;
            // Rows without a reading have no error.
            if displacement_m.is_finite() {
                squares += (displacement_m - reference_m).powi(2);
                readings += 1;
            }
            bar.inc(1);
            bar.set_message(format!("{mark}{command_v:.0} V, read back {voltage_v:.0} V; {:.4} mm", 1e3 * reference_m));
            let all = [time_s, voltage_v, displacement_m, command_v, reference_m, predicted_m];
            let measured: Vec<f64> = [&all[..2], if has_sensor { &all[2..] } else { &all[3..] }].concat();
            journal.push(&measured)?;
            journal.flush_if_due()
        })
    });
    bar.finish_and_clear();
    let written = if samples > 0 { journal.finish() } else { journal.discard() };
    warning.iter().for_each(terminal::message);
    let summary = ended?;
    written?;
    let (low, high) = range(&reference);
    let rms_pct = 100.0 * (squares / f64::from(readings)).sqrt() / (high - low);
    let report = Report {
        log: shown(&arguments.log),
        supply: name,
        samples: summary.samples,
        complete: summary.is_complete,
        slowest_reply_s: summary.slowest_reply_s,
        tracking_rms_pct: Some(rms_pct).filter(|pct| pct.is_finite()),
        without_watchdog: warning.is_some(),
    };
    terminal::report(json, &report, || {
        let tracking = report.tracking_rms_pct.map_or(String::new(), |pct| format!(", {pct:.3} % RMS of peak to peak"));
        let how = if report.complete { "to its end" } else { "stopped" };
        format!(
            "{}: {how}, {} samples{tracking}; {} at 0 V and off; slowest reply {:.0} ms",
            report.log,
            report.samples,
            report.supply,
            1e3 * report.slowest_reply_s
        )
    })
}

/// The warning of a supply without a watchdog, which must be accepted.
fn warning(supply: &Supply, accepted: bool) -> Result<Option<String>> {
    let name = &supply.name;
    match (supply.watchdog_s, accepted) {
        (Some(_), _) => Ok(None),
        (None, true) => Ok(Some(format!(
            "WARNING: {name} has no watchdog: if this program is killed or the cable comes off, the voltage stays until you switch it off by hand"
        ))),
        (None, false) => Err(Error::field(
            "without_watchdog",
            format!("needed: {name} has no watchdog, so the voltage stays if this computer or the cable fails"),
        )),
    }
}

fn sensor(arguments: &Arguments, port: &str, start: Instant) -> Result<Sensor> {
    let line = SerialLine::open(port, arguments.sensor_baud, start)?;
    Sensor::new(Box::new(line), &arguments.sensor_unit).ok_or_else(|| Error::field("sensor_unit", "m, mm or um"))
}
