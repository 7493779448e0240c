//! `study`: the paper's study, repeated on recordings.

use super::options;
use super::prelude::*;
use super::recordings::RecordingOptions;
use crate::files::recording::{Direction, Recording};
use crate::fit::observation::{Observation, observe_all};
use crate::fit::settings::assumed_actuator;
use crate::report::figure_file;
use crate::report::study_page::StudyPage;
use crate::studies::paper::{self, StudyFitRow, StudyOptions};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Folder for the page (study.html), the tables (study.md) and the figures (SVG and PNG).
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Input of the models: the recorded voltage or force, or the recorded displacement, from which the force is fitted.
    #[arg(long, value_parser = named::<Direction>(), default_value = "force")]
    drive: Direction,
    /// File with the actuator table: geometry, permittivity, mass, preload. The default is the paper's, without mass if
    /// displacement drives.
    #[arg(long, value_name = "P")]
    actuator: Option<String>,
    /// Seed of the random starts.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Let pattern search see thinned recordings only: some ten times faster, but not the paper's procedure.
    #[arg(long)]
    thinned: bool,
    #[command(flatten)]
    reading: RecordingOptions,
    /// Recordings, one per frequency.
    #[arg(value_name = "REC.csv", required = true)]
    recordings: Vec<PathBuf>,
}

/// Files that are written.
const FILES: [&str; 6] = ["figure-6.svg", "figure-6.png", "figure-7.svg", "figure-7.png", "study.html", "study.md"];

#[derive(Serialize)]
struct Report {
    recordings: Vec<String>,
    fits: Vec<StudyFitRow>,
    why_eq9_stops: String,
    files: Vec<String>,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let actuator = match &arguments.actuator {
        Some(name) => options::load_actuator(name)?.0,
        None => assumed_actuator(arguments.drive),
    };
    let recordings = arguments.reading.read(&arguments.recordings)?;
    let observations = observe_all(&recordings, arguments.drive)?;
    let inputs: Vec<&Path> = recordings.iter().map(Recording::path).collect();
    for name in FILES {
        output::check(&arguments.out.join(name), &inputs, Folders::AreMade)?;
    }

    let options = StudyOptions { actuator, seed: arguments.seed, thinned: arguments.thinned };
    let bar = Progress::over(1, "study");
    let fits = paper::study(&observations, &options, &|all| {
        bar.set_length(all as u64);
        bar.inc(1);
        bar.set_message(format!("study ({} of {all} fits)", bar.position()));
    })?;
    bar.finish_and_clear();

    let page = StudyPage::new(&fits, &observations, arguments.thinned);
    // Removed again if it stays empty.
    let _folder = Folder::at(&arguments.out)?;
    let staged = stage(&page, &arguments.out)?;
    let files = staged.iter().map(|file| shown(file.path())).collect();
    let names: Vec<String> = observations.iter().map(Observation::file_name).collect();
    let report = Report {
        fits: fits.iter().map(|fit| StudyFitRow::new(fit, &names)).collect(),
        recordings: names,
        why_eq9_stops: paper::why_eq9_stops(&fits),
        files,
    };
    staged.into_iter().try_for_each(Staged::commit)?;
    terminal::report(json, &report, || format!("{}\nwritten: {}", page.markdown(), report.files.join(", ")))
}

/// Figures and pages for `folder`: all of them are written before the first one appears there.
fn stage(page: &StudyPage, folder: &Path) -> Result<Vec<Staged>> {
    let texts = [("study.html", page.html()), ("study.md", page.markdown())];
    let mut files = Vec::new();
    for figure in &page.figures {
        for ending in ["svg", "png"] {
            let path = folder.join(format!("{}.{ending}", figure.name));
            files.push(figure_file::stage_image(&path, &figure.figure)?);
        }
    }
    for (name, text) in texts {
        files.push(Staged::new(&folder.join(name), |file| file.write_all(text.as_bytes()))?);
    }
    Ok(files)
}
