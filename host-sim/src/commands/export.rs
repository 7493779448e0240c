//! `export`: writes the parameter blob for the firmware, or the law of a film in another language.

mod description;
mod fmu;
mod source;

use std::fmt::Write;
use std::path::PathBuf;

use clap::Args;
use dea_driver::Blob;
use serde::Serialize;

use super::choice::named;
use super::options::{self, LawOptions};
use crate::choice;
use crate::choice::Choice;
use crate::compression::Compression;
use crate::error::{Error, Result, short, shown};
use crate::files::output::{self, Folders};
use crate::terminal::{self, rounded};

use fmu::Library;
use source::Source;

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

choice! {
    /// Format of an export.
    pub enum Emit {
        /// Bytes, for the link or the flash: P.bin.
        Blob = "blob",
        /// Rust source, P.rs: `pub const BLOB: [u8; N]`.
        Rust = "rust",
        /// C99 and C++11 source, P.c: the numbers of the film, with springpot.h and P.json beside it.
        C = "c",
        /// A library for Arduino and PlatformIO, with an example: both in a folder.
        Arduino = "arduino",
        /// That C with P_mex.c, a function for MATLAB and Octave, and P_sfun.c, a block for Simulink.
        Sfunction = "sfunction",
        /// An FMU of FMI 3.0 for co-simulation, P.fmu: the film, or its control.
        Fmu = "fmu",
        /// The same of FMI 2.0.
        Fmu2 = "fmu2",
    }
}

impl Emit {
    /// The ending of its file; a folder has none.
    fn ending(self) -> Option<&'static str> {
        match self {
            Self::Blob => Some("bin"),
            Self::Rust => Some("rs"),
            Self::C | Self::Sfunction => Some("c"),
            Self::Fmu | Self::Fmu2 => Some("fmu"),
            Self::Arduino => None,
        }
    }
}

/// Endings of files that are no format of an export, but could be taken for one.
const OTHER_ENDINGS: [&str; 25] = [
    "h", "hpp", "cpp", "cc", "cxx", "s", "asm", "ino", "zip", "json", "toml", "csv", "txt", "m", "mat", "slx", "mdl",
    "py", "so", "dll", "o", "a", "elf", "hex", "uf2",
];

impl Arguments {
    /// The format that is asked for, by name or by the ending of `out`.
    fn format(&self) -> Result<Emit> {
        let ending = self.out.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_lowercase();
        let ending = ending.as_str();
        let by_ending = Emit::CHOICES.iter().map(|(emit, ..)| *emit).find(|emit| emit.ending() == Some(ending));
        let is_free = by_ending.is_none() && !OTHER_ENDINGS.contains(&ending);
        let emit = self.emit.or(by_ending).unwrap_or(Emit::Blob);
        let own = emit.ending();
        if own == Some(ending) || (is_free && matches!(emit, Emit::Blob | Emit::Rust | Emit::Arduino)) {
            return Ok(emit);
        }
        let advice = match own {
            _ if self.emit.is_none() => {
                ".bin is a blob, .rs Rust, .c C, .fmu an FMU, and --emit arduino writes a folder".to_owned()
            }
            Some(own) => format!("--emit {} writes a file that ends in .{own}, such as film.{own}", emit.name()),
            None => "--emit arduino writes a folder, which has no such ending".to_owned(),
        };
        Err(Error::field("out", format!("{}: {advice}", shown(&self.out))))
    }
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
    if arguments.out.is_file() {
        output::check(&arguments.out, &inputs, Folders::AreMade)?;
    }
    let emit = arguments.format()?;
    let source = Source::new(emit, &arguments.out, &inputs)?;
    if source.is_none() {
        output::check(&arguments.out, &inputs, Folders::Exist)?;
    }
    let rate_hz = super::board_rate(arguments.law.rate)?;
    let refused = |error: Error| error.about(&arguments.law.params, arguments.law.params.as_ref());
    let (blob, board) = parameters.checked_blob(rate_hz).map_err(refused)?;

    let compression = Compression::new(parameters.film(), rate_hz)?;

    let mut library = Library::default();
    let files = match &source {
        Some(source) => {
            // What the controller runs, from the bytes that it would get.
            let blob = Blob::decode(&blob, board.id).map_err(|e| Error::Computation(short(&e)))?;
            source.write(&parameters, rate_hz, &blob, &inputs, &mut library)?
        }
        None => {
            let content = match emit {
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
        rate_hz,
        board: board.id,
        compression,
        symbol: source.map(|source| source.symbol),
        platform: library.platform,
        platform_note: library.note,
        written: files.iter().map(|(path, _)| shown(path)).collect(),
        own_board: parameters.board.as_ref().is_some_and(|board| board.lacks().is_empty()),
        field_note: options::field_note(&parameters),
    };
    terminal::warnings(json, report.field_note.iter().chain(&report.platform_note));
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
