//! `export`: writes the parameter blob for the firmware, or the law of a film in another language.

mod description;
mod fmu;
mod source;

use std::fmt::Write;
use std::path::PathBuf;

use clap::{Args, ValueEnum};
use dea_driver::Blob;
use serde::Serialize;

use super::options::LawOptions;
use crate::compression::Compression;
use crate::error::{Error, Result, short, shown};
use crate::files::output::{self, Folders};
use crate::terminal::{self, rounded};

use fmu::Library;
use host_emit::fmu::Version;
use source::Source;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    #[command(flatten)]
    law: LawOptions,
    /// Output: the blob itself, a constant for a program, or the law in another language.
    #[arg(long, value_enum, default_value_t = Emit::Blob)]
    emit: Emit,
    /// Where it goes: a file, of --emit c and sfunction a NAME.c, of --emit fmu and fmu2 a NAME.fmu, of --emit arduino a folder.
    #[arg(long, value_name = "P.bin")]
    out: PathBuf,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Emit {
    /// Bytes, for the link or the flash.
    Blob,
    /// Rust source: `pub const BLOB: [u8; N]`.
    Rust,
    /// C99 and C++11 source: the numbers of the film, with springpot.h and NAME.json beside it.
    C,
    /// A library for Arduino and `PlatformIO`, with an example: both in a folder.
    Arduino,
    /// That C with `NAME_mex.c`, a function for MATLAB and Octave, and `NAME_sfun.c`, a block for Simulink.
    Sfunction,
    /// An FMU of FMI 3.0 for co-simulation: the film, or its control.
    Fmu,
    /// The same of FMI 2.0.
    Fmu2,
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
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let parameters = arguments.law.parameters()?;
    let inputs = [arguments.law.params.as_ref()];
    let source = match arguments.emit {
        Emit::C => Some(Source::c(&arguments.out, &inputs)?),
        Emit::Arduino => Some(Source::arduino(&arguments.out, &inputs)?),
        Emit::Sfunction => Some(Source::sfunction(&arguments.out, &inputs)?),
        Emit::Fmu => Some(Source::fmu(&arguments.out, &inputs, Version::Fmi3)?),
        Emit::Fmu2 => Some(Source::fmu(&arguments.out, &inputs, Version::Fmi2)?),
        Emit::Blob | Emit::Rust => {
            output::check(&arguments.out, &inputs, Folders::Exist)?;
            None
        }
    };
    super::board_rate(arguments.law.rate)?;
    let refused = |error: Error| error.about(&arguments.law.params, arguments.law.params.as_ref());
    let (blob, board) = parameters.checked_blob(arguments.law.rate).map_err(refused)?;

    let compression = Compression::new(parameters.film(), arguments.law.rate)?;

    let mut library = Library::default();
    let files = match &source {
        Some(source) => {
            // What the controller runs, from the bytes that it would get.
            let blob = Blob::decode(&blob, board.id).map_err(|e| Error::Computation(short(&e)))?;
            source.write(&parameters, arguments.law.rate, &blob, &inputs, &mut library)?
        }
        None => {
            let content = match arguments.emit {
                Emit::Rust => rust_constant(&parameters.name, &blob).into_bytes(),
                _ => blob.clone(),
            };
            output::write_whole(&arguments.out, |file| file.write_all(&content))?;
            vec![(arguments.out.clone(), blob.len())]
        }
    };
    let report = Report {
        out: shown(&arguments.out),
        bytes: files.iter().map(|(_, bytes)| bytes).sum(),
        rate_hz: arguments.law.rate,
        board: board.id,
        compression,
        symbol: source.map(|source| source.symbol),
        platform: library.platform,
        platform_note: library.note,
        written: files.iter().map(|(path, _)| shown(path)).collect(),
        own_board: parameters.board.as_ref().is_some_and(|board| board.lacks().is_empty()),
        field_note: parameters.field_note(),
    };
    terminal::warnings(json, report.field_note.iter().chain(&report.platform_note));
    terminal::report(json, &report, || {
        let bench = if report.own_board {
            ""
        } else {
            "; without a whole [board] table: what is missing is the paper's bench's"
        };
        let rate_hz = rounded(report.rate_hz);
        let what = match &report.symbol {
            Some(symbol) => {
                let library = report.platform.map(|platform| format!(", with a library for {platform}"));
                let library = library.unwrap_or_default();
                format!("{}: the film {symbol} at {rate_hz} Hz{library}", report.written.join(", "))
            }
            None => format!("{}: {} bytes for board {:#06x} at {rate_hz} Hz", report.out, report.bytes, report.board),
        };
        format!("{what}{bench}\n{}", report.compression.text())
    })
}

/// A blob as Rust source.
fn rust_constant(name: &str, blob: &[u8]) -> String {
    let name: String = name.chars().filter(|letter| !letter.is_control()).collect();
    let mut text = format!("/// The parameter blob of {name}.\npub const BLOB: [u8; {}] = [", blob.len());
    for (index, byte) in blob.iter().enumerate() {
        // Writing to a string cannot fail.
        let _ = write!(text, "{}0x{byte:02x},", if index % 16 == 0 { "\n    " } else { " " });
    }
    text.push_str("\n];\n");
    text
}
