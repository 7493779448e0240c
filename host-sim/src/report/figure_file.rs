//! Figures as files: a page, SVG or PNG by the ending (`--plot`).

use std::path::{Path, PathBuf};

use clap::Args;
use maud::{Markup, html};
use serde::Serialize;

use super::figure::Figure;
use super::numbers::{Document, Numbers};
use super::page::{Page, Section, table};
use super::{chart, drawing, origin};
use crate::error::{Error, Result, shown};
use crate::files::digest;
use crate::files::output::{self, Folders, Staged};
use crate::fit::report::Origin;

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

    /// The figure to draw. Refuses, before long work begins, an unknown file extension, a file that could not be written, one of
    /// `inputs`, and one of the command's own `outputs`.
    pub fn check(&self, inputs: &[&Path], outputs: &[&Path]) -> Result<Plot> {
        let Some(path) = self.path() else { return Ok(Plot { path: None, inputs: Vec::new() }) };
        let same =
            |other: &&Path| std::path::absolute(other).is_ok_and(|other| Some(other) == std::path::absolute(path).ok());
        if outputs.iter().any(same) {
            return Err(Error::field("plot", format!("{} is written by --out; name another file", shown(path))));
        }
        output::check(path, inputs, Folders::Exist)?;
        format(path)?;
        let inputs = inputs.iter().map(|input| input.to_path_buf()).collect();
        Ok(Plot { path: Some(path.into()), inputs })
    }

    /// The same of a command that writes `out`, which is checked as well.
    pub fn check_beside(&self, inputs: &[&Path], out: Option<&Path>) -> Result<Plot> {
        out.map_or(Ok(()), |out| output::check(out, inputs, Folders::Exist))?;
        self.check(inputs, out.as_slice())
    }
}

/// A figure to draw, if one was asked for, of what a command makes of its inputs.
#[derive(Clone, Debug)]
#[must_use]
pub struct Plot {
    path: Option<PathBuf>,
    /// Files that are read, and presets, which are not files.
    inputs: Vec<PathBuf>,
}

impl Plot {
    /// Whether there is one to draw.
    pub fn is_wanted(&self) -> bool {
        self.path.is_some()
    }

    /// Writes `files`, which are staged, and what `figure` makes beside the `document` that `--json` prints: all of them or none.
    pub fn write<D: Serialize>(
        &self,
        document: &D,
        files: impl IntoIterator<Item = Staged>,
        figure: impl FnOnce() -> Figure,
    ) -> Result<()> {
        let drawn = self.stage(document, |_| Vec::new(), figure)?;
        files.into_iter().chain(drawn).try_for_each(Staged::commit)
    }

    /// The file of the figure, staged; a page has the `sections` of the document's numbers as well.
    pub fn stage<D: Serialize>(
        &self,
        document: &D,
        sections: impl FnOnce(&Numbers<'_>) -> Vec<Section>,
        figure: impl FnOnce() -> Figure,
    ) -> Result<Option<Staged>> {
        let Some(path) = self.path.as_deref() else { return Ok(None) };
        let figure = figure();
        if !matches!(format(path)?, Format::Html) {
            return stage_image(path, &figure).map(Some);
        }
        let document = Document::from_report(document)?;
        let mut all = vec![Section::new("plots", "Plots", chart::figure(&figure))];
        all.extend(sections(&Numbers::from_document(&document)));
        all.push(Section::new("origin", "Where this comes from", self.origin()?));
        let page = Page { title: &figure.title, lead: html! {}, sections: all, document: Some(&document) };
        Staged::new(path, |file| file.write_all(page.html().as_bytes())).map(Some)
    }

    /// Date, version and command, and the files that were read with their digests.
    fn origin(&self) -> Result<Markup> {
        let Origin { date, tool, command } = origin::now();
        let files = self.inputs.iter().filter(|input| input.is_file());
        let files: Vec<(String, String)> =
            files.map(|input| Ok((shown(input), digest::sha256(input)?))).collect::<Result<_>>()?;
        Ok(html! {
            @if !files.is_empty() {
                (origin::files_table("Files that were read", files.iter().map(|(file, sha256)| (file.as_str(), sha256.as_str()))))
            }
            (table("This page", &["", ""], &origin::rows([&date, &tool, &command])))
        })
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

/// `figure` for `path`, staged as SVG or PNG.
pub fn stage_image(path: &Path, figure: &Figure) -> Result<Staged> {
    let bytes = match format(path)? {
        Format::Html => return Err(Error::file(path, "a picture ends in .svg or .png")),
        Format::Svg => drawing::svg(figure).into_bytes(),
        Format::Png => drawing::png(figure).map_err(|cause| Error::file(path, cause))?,
    };
    Staged::new(path, |file| file.write_all(&bytes))
}
