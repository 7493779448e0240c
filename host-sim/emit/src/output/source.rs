//! A film as C, as a library for Arduino, for MATLAB and Simulink, or as an FMU: files that are written together or not at all.

use std::fs;
use std::path::{Path, PathBuf};

use dea_driver::{Blob, SelfSensor};
use host_io::files::output::{self, Folder, Folders, Staged};
use host_io::files::parameters::Parameters;
use host_io::{Error, Result};

use super::archive::{Library, archive};
use super::{Emit, description};
use crate::fmu::{Version, fmu};
use crate::{Film, HEADER, arduino, film, matlab, symbol};

/// Output of an export, checked before long work begins.
pub(super) struct Source {
    /// The film's name in C.
    pub(super) symbol: String,
    /// A file or a folder.
    out: PathBuf,
    kind: Kind,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// A C source with its header.
    C,
    /// A folder.
    Arduino,
    /// C sources, the film's among them.
    Matlab,
    /// An archive.
    Fmu(Version),
}

/// How files of this tool begin that are not named on the command line: only those are overwritten.
const BEGINS: [&str; 6] = [
    "/*\n * springpot.h:",
    "/*\n * springpot_tick.h:",
    "/*\n * The film ",
    "name=springpot_",
    "{\n  \"name\": \"springpot_",
    description::BEGIN,
];

impl Source {
    /// The source of that format at `out`, if it is one; nothing of `inputs` is overwritten.
    pub(super) fn new(emit: Emit, out: &Path, inputs: &[&Path]) -> Result<Option<Self>> {
        let name = stem(out);
        let (symbol, kind, beside) = match emit {
            Emit::Blob | Emit::Rust => return Ok(None),
            Emit::C => (symbol(&name), Kind::C, vec!["springpot.h".to_owned(), format!("{name}.json")]),
            Emit::Sfunction if !matlab::is_name(&name) => {
                let cause = format!(
                    "MATLAB cannot call {name:?}: a letter, then letters, digits and _, at most 58, such as film_5s.c"
                );
                return Err(Error::field("out", cause));
            }
            Emit::Sfunction => {
                let own = ["_mex.c", "_sfun.c", ".json"].map(|ending| format!("{name}{ending}"));
                let headers = ["springpot.h", "springpot_tick.h"].map(str::to_owned);
                (symbol(&name), Kind::Matlab, headers.into_iter().chain(own).collect())
            }
            Emit::Fmu => (symbol(&name), Kind::Fmu(Version::Fmi3), Vec::new()),
            Emit::Fmu2 => (symbol(&name), Kind::Fmu(Version::Fmi2), Vec::new()),
            Emit::Arduino => {
                // A folder has no ending.
                let name = out.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
                if out.is_file() {
                    return Err(Error::file(out, "is a file; `emit` arduino writes a folder"));
                }
                if name.is_empty() {
                    return Err(Error::field("out", "a library is a folder with a name, such as film_library"));
                }
                for file in ["src/springpot.h", "library.properties", "library.json"] {
                    own(&out.join(file), inputs, Folders::AreMade)?;
                }
                return Ok(Some(Self { symbol: symbol(&name), out: out.into(), kind: Kind::Arduino }));
            }
        };
        output::check(out, inputs, Folders::Exist)?;
        for file in beside {
            own(&out.with_file_name(file), inputs, Folders::Exist)?;
        }
        Ok(Some(Self { symbol, out: out.into(), kind }))
    }

    /// Writes the film of `parameters`, whose numbers at `rate_hz` are in `blob`. Returns the files, the film's own first, and in `library`
    /// what was compiled.
    pub(super) fn write(
        &self,
        parameters: &Parameters,
        rate_hz: f64,
        blob: &Blob,
        inputs: &[&Path],
        library: &mut Library,
    ) -> Result<Vec<(PathBuf, usize)>> {
        let symbol = self.symbol.as_str();
        let follower = blob.follower();
        let sensing = blob.parameters().self_sensing.as_ref().map(SelfSensor::sensing).transpose();
        let sensing = sensing.map_err(|error| Error::Computation(error.to_string()))?;
        let described = Film {
            symbol,
            name: &parameters.name,
            tracking: follower.compensator(),
            learning: follower.learning(),
            self_sensing: sensing.as_ref(),
            temperature: parameters.temperature.as_ref(),
        };
        let text = |(path, text): (PathBuf, String)| (path, text.into_bytes());
        let beside = |(name, content): (String, String)| text((self.out.with_file_name(name), content));
        let mut files: Vec<(PathBuf, Vec<u8>)> = match self.kind {
            Kind::C => {
                let header = beside(("springpot.h".to_owned(), HEADER.to_owned()));
                vec![(self.out.clone(), film(&described).into_bytes()), header]
            }
            Kind::Arduino => {
                let within = |(path, content)| text((self.out.join(path), content));
                let files = arduino::library(&described).into_iter().map(within);
                // A sketch that is there holds its user's pins and scales.
                files
                    .filter(|(path, _)| path.extension().is_none_or(|ending| ending != "ino") || !path.exists())
                    .collect()
            }
            Kind::Matlab => matlab::sources(&described, &stem(&self.out)).into_iter().map(beside).collect(),
            Kind::Fmu(version) => {
                let fmu = fmu(&described, version);
                *library = Library::new(&fmu, symbol, version)?;
                vec![(self.out.clone(), archive(&fmu, library, &self.out)?)]
            }
        };
        if matches!(self.kind, Kind::C | Kind::Matlab) {
            let json = description::json(parameters, rate_hz, follower.compensator())?;
            files.push((self.out.with_extension("json"), json.into_bytes()));
        }
        let is_folder = self.kind == Kind::Arduino;
        let made = if is_folder { Folders::AreMade } else { Folders::Exist };
        for (path, _) in &files {
            output::check(path, inputs, made)?;
        }
        // Removed again if they stay empty.
        let mut folders = Vec::new();
        for folder in files.iter().filter_map(|(path, _)| path.parent()).filter(|_| is_folder) {
            // The last that was made is the first to be removed: it may be in one before.
            folders.insert(0, Folder::at(folder)?);
        }
        let staged: Vec<Staged> = files
            .iter()
            .map(|(path, content)| Staged::new(path, |file| file.write_all(content)))
            .collect::<Result<_>>()?;
        staged.into_iter().try_for_each(Staged::commit)?;
        Ok(files.into_iter().map(|(path, content)| (path, content.len())).collect())
    }
}

/// Refuses to overwrite a file at `path` that another program has written.
fn own(path: &Path, inputs: &[&Path], made: Folders) -> Result<()> {
    output::check(path, inputs, made)?;
    match fs::read(path) {
        Ok(there) if !BEGINS.iter().any(|begin| there.starts_with(begin.as_bytes())) => {
            Err(Error::file(path, "exists and was not written by this tool; export into another folder"))
        }
        _ => Ok(()),
    }
}

/// The name of a file or a folder without its ending.
fn stem(path: &Path) -> String {
    path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
}
