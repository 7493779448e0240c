//! Figures as files: a page, SVG or PNG by the ending (`--plot`).

use std::path::{Path, PathBuf};

use clap::Args;
use maud::html;
use serde::Serialize;

use super::figure::Figure;
use super::numbers::Document;
use super::page::{Page, Section};
use super::{chart, drawing};
use crate::error::{Error, Result};
use crate::files::output::{self, Folders, Staged};

/// The option of commands that draw what they computed.
#[derive(Clone, Debug, Args)]
pub struct PlotOption {
    /// Figure of the result: .html (zoom, pan, hover; opens offline), .svg or .png by its ending.
    #[arg(long, value_name = "FIGURE")]
    plot: Option<PathBuf>,
}

impl PlotOption {
    /// The file, if there is to be one.
    pub fn path(&self) -> Option<&Path> {
        self.plot.as_deref()
    }

    /// Refuses, before long work begins, an ending that is none, a file that could not be written, one of `inputs`, and one of the
    /// command's own `outputs`.
    ///
    /// # Errors
    ///
    /// [`Error`] naming the file.
    pub fn check(&self, inputs: &[&Path], outputs: &[&Path]) -> Result<()> {
        let Some(path) = self.path() else { return Ok(()) };
        let same =
            |other: &&Path| std::path::absolute(other).is_ok_and(|other| Some(other) == std::path::absolute(path).ok());
        if outputs.iter().any(same) {
            return Err(Error::option("--plot", format!("{} is written by --out; name another file", path.display())));
        }
        output::check(path, inputs, Folders::Exist)?;
        format(path).map(drop)
    }

    /// The file, staged, of what `figure` makes, beside the `document` that `--json` prints.
    ///
    /// # Errors
    ///
    /// [`Error::File`] where it cannot be written.
    pub fn stage<D: Serialize>(&self, document: &D, figure: impl FnOnce() -> Figure) -> Result<Option<Staged>> {
        self.path().map(|path| stage(path, &figure(), document)).transpose()
    }
}

#[derive(Clone, Copy)]
enum Format {
    Html,
    Svg,
    Png,
}

fn format(path: &Path) -> Result<Format> {
    match path.extension().and_then(|ending| ending.to_str()) {
        Some("html") => Ok(Format::Html),
        Some("svg") => Ok(Format::Svg),
        Some("png") => Ok(Format::Png),
        _ => Err(Error::file(path, "a figure ends in .html, .svg or .png")),
    }
}

/// `figure` for `path`, staged; a page holds `document` as well.
///
/// # Errors
///
/// [`Error::File`] for another ending or where it cannot be written.
pub fn stage<D: Serialize>(path: &Path, figure: &Figure, document: &D) -> Result<Staged> {
    let bytes = match format(path)? {
        Format::Html => page(figure, &Document::of(document)?).into_bytes(),
        Format::Svg => drawing::svg(figure).into_bytes(),
        Format::Png => drawing::png(figure).map_err(|cause| Error::file(path, cause))?,
    };
    Staged::new(path, |file| file.write_all(&bytes))
}

/// `figure` written to `path`.
///
/// # Errors
///
/// As [`stage`].
pub fn write(path: &Path, figure: &Figure) -> Result<()> {
    stage(path, figure, &())?.commit()
}

fn page(figure: &Figure, document: &Document) -> String {
    Page {
        title: &figure.title,
        lead: html! {},
        sections: vec![Section::new("plots", "Plots", chart::figure(figure))],
        document: Some(document),
    }
    .html()
}
