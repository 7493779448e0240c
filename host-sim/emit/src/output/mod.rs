//! A film in files: the blob for a controller, or its law in another language.

mod archive;
mod description;
mod source;

use std::fmt::Write;
use std::path::{Path, PathBuf};

use dea_driver::Blob;
use host_io::choice;
use host_io::choice::Choice;
use host_io::error::{short, shown};
use host_io::files::output::{self, Folders};
use host_io::files::parameters::Parameters;
use host_io::{Error, Result};

use archive::Library;
use source::Source;

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

/// An output that can be written.
pub struct Output {
    emit: Emit,
    out: PathBuf,
    inputs: Vec<PathBuf>,
    source: Option<Source>,
}

/// Files that were written.
pub struct Written {
    /// All of them, and their bytes; of Rust source those of the blob in it.
    pub files: Vec<(PathBuf, usize)>,
    /// Number of the board that the parameters are for.
    pub board: u16,
    /// The film's name in C.
    pub symbol: Option<String>,
    /// The platform that an FMU has a library for.
    pub platform: Option<&'static str>,
    /// Why it has none.
    pub platform_note: Option<String>,
}

impl Output {
    /// Checks what can be checked before long work begins: `out`, whose ending chooses the format if `emit` does not, is not one of `inputs`.
    ///
    /// # Errors
    ///
    /// [`Error`] for an ending that contradicts the format, and for a file that could not be written.
    pub fn new(emit: Option<Emit>, out: &Path, inputs: &[&Path]) -> Result<Self> {
        if out.is_file() {
            output::check(out, inputs, Folders::AreMade)?;
        }
        let emit = format(emit, out)?;
        let source = Source::new(emit, out, inputs)?;
        if source.is_none() {
            output::check(out, inputs, Folders::Exist)?;
        }
        Ok(Self { emit, out: out.into(), inputs: inputs.iter().map(|path| path.to_path_buf()).collect(), source })
    }

    /// Writes `parameters` at `rate_hz`.
    ///
    /// # Errors
    ///
    /// [`Error`] for a film or a board that a controller would refuse, and for a file that cannot be written.
    pub fn write(&self, parameters: &Parameters, rate_hz: f64) -> Result<Written> {
        let (blob, board) = parameters.checked_blob(rate_hz)?;
        let mut library = Library::default();
        let files = match &self.source {
            Some(source) => {
                // What the controller runs, from the bytes that it would get.
                let blob = Blob::decode(&blob, board.id).map_err(|e| Error::Computation(short(&e)))?;
                let inputs: Vec<&Path> = self.inputs.iter().map(PathBuf::as_path).collect();
                source.write(parameters, rate_hz, &blob, &inputs, &mut library)?
            }
            None => {
                let length = blob.len();
                let content =
                    if self.emit == Emit::Rust { rust_constant(&parameters.name, &blob).into_bytes() } else { blob };
                output::write_whole(&self.out, |file| file.write_all(&content))?;
                vec![(self.out.clone(), length)]
            }
        };
        Ok(Written {
            files,
            board: board.id,
            symbol: self.source.as_ref().map(|source| source.symbol.clone()),
            platform: library.platform,
            platform_note: library.note,
        })
    }
}

/// The format that is `asked` for, by name or by the ending of `out`.
fn format(asked: Option<Emit>, out: &Path) -> Result<Emit> {
    let ending = out.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_lowercase();
    let ending = ending.as_str();
    let by_ending = Emit::CHOICES.iter().map(|(emit, ..)| *emit).find(|emit| emit.ending() == Some(ending));
    let is_free = by_ending.is_none() && !OTHER_ENDINGS.contains(&ending);
    let emit = asked.or(by_ending).unwrap_or(Emit::Blob);
    let own = emit.ending();
    if own == Some(ending) || (is_free && matches!(emit, Emit::Blob | Emit::Rust | Emit::Arduino)) {
        return Ok(emit);
    }
    let advice = match own {
        _ if asked.is_none() => {
            ".bin is a blob, .rs Rust, .c C, .fmu an FMU, and `emit` arduino writes a folder".to_owned()
        }
        Some(own) => format!("`emit` {} writes a file that ends in .{own}, such as film.{own}", emit.name()),
        None => "`emit` arduino writes a folder, which has no such ending".to_owned(),
    };
    Err(Error::field("out", format!("{}: {advice}", shown(out))))
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
