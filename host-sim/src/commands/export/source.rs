//! A film as C, as a library for Arduino or as an FMU: files that are written together or not at all.

use std::fs;
use std::path::{Path, PathBuf};

use bench_emit::fmu::{Version, fmu};
use bench_emit::{Film, HEADER, arduino, film, symbol};
use dea_driver::Blob;

use crate::error::{Error, Result};
use crate::files::output::{self, Folder, Folders, Staged};

use super::fmu::{Library, archive};

/// What is written, checked before long work begins.
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
    /// An archive.
    Fmu(Version),
}

/// How a header of this tool begins.
const HEADER_BEGINS: &str = "/*\n * springpot.h:";

impl Source {
    /// NAME.c at `out`, with `springpot.h` beside it; nothing of `inputs` is overwritten.
    pub(super) fn c(out: &Path, inputs: &[&Path]) -> Result<Self> {
        if out.extension().is_none_or(|extension| extension != "c") {
            return Err(Error::option(
                "--out",
                "a C source ends in .c, such as film.c; springpot.h is written beside it",
            ));
        }
        output::check(out, inputs, Folders::Exist)?;
        own_header(&out.with_file_name("springpot.h"), inputs, Folders::Exist)?;
        Ok(Self { symbol: symbol(&stem(out)), out: out.into(), kind: Kind::C })
    }

    /// A library in the folder `out`.
    pub(super) fn arduino(out: &Path, inputs: &[&Path]) -> Result<Self> {
        if out.is_file() {
            return Err(Error::file(out, "is a file; --emit arduino writes a folder"));
        }
        let symbol = symbol(&stem(out));
        own_header(&out.join("src/springpot.h"), inputs, Folders::AreMade)?;
        Ok(Self { symbol, out: out.into(), kind: Kind::Arduino })
    }

    /// An FMU at `out`, a NAME.fmu.
    pub(super) fn fmu(out: &Path, inputs: &[&Path], version: Version) -> Result<Self> {
        if out.extension().is_none_or(|extension| extension != "fmu") {
            return Err(Error::option("--out", "an FMU ends in .fmu, such as film.fmu"));
        }
        output::check(out, inputs, Folders::Exist)?;
        Ok(Self { symbol: symbol(&stem(out)), out: out.into(), kind: Kind::Fmu(version) })
    }

    /// Writes the film of `blob`, which is called `name`. Returns the files, the film's own first; `library` tells what was compiled.
    pub(super) fn write(
        &self,
        name: &str,
        blob: &Blob,
        inputs: &[&Path],
        library: &mut Library,
    ) -> Result<Vec<(PathBuf, usize)>> {
        let symbol = self.symbol.as_str();
        let described = Film { symbol, name, tracking: blob.tracking(), learning: blob.learning() };
        let files: Vec<(PathBuf, Vec<u8>)> = match self.kind {
            Kind::C => vec![
                (self.out.clone(), film(&described).into_bytes()),
                (self.out.with_file_name("springpot.h"), HEADER.into()),
            ],
            Kind::Arduino => arduino::library(&described)
                .into_iter()
                .map(|(path, text)| (self.out.join(path), text.into_bytes()))
                .collect(),
            Kind::Fmu(version) => {
                let fmu = fmu(&described, version);
                *library = Library::of(&fmu, symbol, version)?;
                vec![(self.out.clone(), archive(&fmu, library, &self.out)?)]
            }
        };
        let is_folder = self.kind == Kind::Arduino;
        let made = if is_folder { Folders::AreMade } else { Folders::Exist };
        for (path, _) in &files {
            output::check(path, inputs, made)?;
        }
        // Removed again if they stay empty.
        let mut folders = Vec::new();
        for folder in files.iter().filter_map(|(path, _)| path.parent()).filter(|_| is_folder) {
            folders.push(Folder::at(folder)?);
        }
        let staged: Vec<Staged> = files
            .iter()
            .map(|(path, content)| Staged::new(path, |file| file.write_all(content)))
            .collect::<Result<_>>()?;
        staged.into_iter().try_for_each(Staged::commit)?;
        Ok(files.into_iter().map(|(path, content)| (path, content.len())).collect())
    }
}

/// Refuses a header at `path` that is not of this tool: somebody's own must not be lost.
fn own_header(path: &Path, inputs: &[&Path], made: Folders) -> Result<()> {
    output::check(path, inputs, made)?;
    match fs::read(path) {
        Ok(there) if !there.starts_with(HEADER_BEGINS.as_bytes()) => {
            Err(Error::file(path, "is there and not of this tool; export into another folder"))
        }
        _ => Ok(()),
    }
}

/// The name of a file or a folder without its ending.
fn stem(path: &Path) -> String {
    path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
}
