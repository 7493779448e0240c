//! `export`: writes the parameter blob for the firmware, or the law of a film in another language.

use host_emit::output::{Emit, Output};

use super::options::{self, LawOptions};
use super::prelude::*;
use crate::compression::Compression;
use crate::terminal::rounded;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    law: LawOptions,
    /// Format; that of the ending of --out if left out, or else the blob.
    #[arg(long, value_parser = named::<Emit>())]
    emit: Option<Emit>,
    /// Output: a file whose ending chooses the format (.bin, .rs, .c, .fmu), or of --emit arduino a folder.
    #[arg(long, value_name = "P.bin")]
    out: PathBuf,
}

#[derive(Serialize)]
struct Report {
    out: String,
    bytes: usize,
    rate_hz: f64,
    board: u16,
    /// Cost of the compression of its law.
    compression: Compression,
    /// Whether the file has a board; otherwise that of the paper's bench is used.
    own_board: bool,
    /// The film's name in C.
    #[serde(skip_serializing_if = "Option::is_none")]
    symbol: Option<String>,
    /// The platform that an FMU has a library for.
    #[serde(skip_serializing_if = "Option::is_none")]
    platform: Option<&'static str>,
    /// Why it has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    platform_note: Option<String>,
    /// All files.
    written: Vec<String>,
    /// Note on the electric field, if the film's sizes are assumed.
    #[serde(skip_serializing_if = "Option::is_none")]
    field_note: Option<String>,
    /// Note on the observer's bandwidth, if it is lower than the default.
    #[serde(skip_serializing_if = "Option::is_none")]
    bandwidth_note: Option<String>,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let parameters = arguments.law.parameters()?;
    let output = Output::new(arguments.emit, &arguments.out, &[arguments.law.params.as_ref()])?;
    let rate_hz = super::board_rate(arguments.law.rate)?;
    let refused = |error: Error| error.about(&arguments.law.params, arguments.law.params.as_ref());
    let compression = Compression::new(parameters.film(), rate_hz)?;
    let written = output.write(&parameters, rate_hz).map_err(refused)?;
    let report = Report {
        out: shown(&arguments.out),
        bytes: written.files.iter().map(|(_, bytes)| bytes).sum(),
        rate_hz,
        board: written.board,
        compression,
        symbol: written.symbol,
        platform: written.platform,
        platform_note: written.platform_note,
        written: written.files.iter().map(|(path, _)| shown(path)).collect(),
        own_board: parameters.board.as_ref().is_some_and(|board| board.lacks().is_empty()),
        field_note: options::field_note(&parameters),
        bandwidth_note: parameters.bandwidth_note(rate_hz, parameters.control(rate_hz)?.bandwidth_hz.into()),
    };
    let notes = [&report.field_note, &report.platform_note, &report.bandwidth_note];
    terminal::warnings(json, notes.into_iter().flatten());
    terminal::note(report.compression.text());
    terminal::report(json, &report, || text(&report))
}

fn text(report: &Report) -> String {
    let bench =
        if report.own_board { "" } else { "; without a whole [board] table: what is missing is the paper's bench's" };
    let rate_hz = rounded(report.rate_hz);
    match &report.symbol {
        Some(symbol) => {
            let library =
                report.platform.map(|platform| format!(", with a library for {platform}")).unwrap_or_default();
            format!("{}: the film {symbol} at {rate_hz} Hz{library}{bench}", report.written.join(", "))
        }
        None => {
            format!("{}: {} bytes for board {:#06x} at {rate_hz} Hz{bench}", report.out, report.bytes, report.board)
        }
    }
}
