//! Everything once: recordings fitted together, replayed through the controller's code, and a reference followed.

mod firmware;
mod page;
mod table;

use std::sync::atomic::Ordering;

use springpot::{Actuator, Topology};

use self::firmware::Firmware;
use super::fit::{Done, Job};
use super::following::{Followed, Following, REFITTED_FILM, SIMULATED_FILM, Sine};
use super::prelude::*;
use super::recordings::RecordingOptions;
use super::{bench, feedforward as feedforward_command, options, replay};
use crate::agreement::RecordingAgreement;
use crate::files::parameters::Parameters;
use crate::files::recording::{Direction, Recording};
use crate::fit::{FitReport, Settings, observation};
use crate::grid::Grid;
use crate::interrupt;
use crate::replay::comparison::Comparison;
use crate::replay::memory::RunOptions;
use crate::report::fit_page::FitPage;
use crate::report::numbers::{Document, Numbers};
use crate::report::page::Section;
use crate::simulation::film::{Film, Instruments, Plant, Waveform};
use crate::simulation::film_recording::FilmRecording;
use crate::simulation::plant::{NonlinearPlant, Plant as Moving};

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Folder for film.toml, film.bin, report.html, reference.csv, voltage.csv and, without --recordings, the simulated recordings.
    #[arg(long, value_name = "DIR", default_value = "demo")]
    out: PathBuf,
    /// Recordings of your own film; three simulated ones if left out.
    #[arg(long, value_name = "REC.csv", num_args = 1..)]
    recordings: Vec<PathBuf>,
    #[command(flatten)]
    reading: RecordingOptions,
    /// File with the table `[actuator]` of that film; the paper's if left out.
    #[arg(long, value_name = "F.toml", requires = "recordings")]
    actuator: Option<String>,
    /// At the end, open the page of a bench with the simulated film, which follows the sine there; Ctrl-C ends it.
    #[arg(long, conflicts_with = "recordings")]
    bench: bool,
}

/// The film of the simulated recordings, and of the closed loops after their fit.
const PLANT: Plant = Plant::Hossain;
/// Periods (s) of the simulated recordings, and the seeds of their noise.
const SIMULATED: [(f64, u64); 3] = [(5.0, 3), (7.0, 2), (13.0, 1)];
/// Length of the simulated recordings, s, and their samples per second: as in the paper.
const SIMULATED_S: f64 = 155.0;
const SIMULATED_HZ: f64 = 100.0;
const SIMULATED_PEAK_V: f64 = 6000.0;
/// The results of a demo, for people and machines.
#[derive(Serialize)]
struct Report<'a> {
    simulated: bool,
    fit: &'a FitReport,
    #[serde(flatten)]
    replay: replay::Report,
    #[serde(flatten)]
    following: Following,
    /// The firmware's image in QEMU, where a voltage was recorded.
    firmware: Option<Firmware>,
    files: Vec<String>,
    interrupted: bool,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let stop = interrupt::stop_flag();
    let (actuator, assumed_sizes) = match &arguments.actuator {
        Some(name) => options::load_actuator(name)?,
        // The simulated recordings are of the paper's sizes.
        None => (Actuator::KARNER_2022, !arguments.recordings.is_empty()),
    };
    let given = arguments.reading.read(&arguments.recordings)?;
    let simulated = given.is_empty();
    let files = OutputFiles::in_folder(&arguments.out, simulated);
    let inputs: Vec<&Path> =
        arguments.recordings.iter().map(PathBuf::as_path).chain(arguments.actuator.as_deref().map(Path::new)).collect();
    // Removed again if it stays empty.
    let _folder = files.check(&arguments.out, &inputs)?;
    let recordings = if simulated { files.simulated_recordings()? } else { given };

    let done = fitted(&recordings, actuator, assumed_sizes, &files)?;
    // The parameters as they were written: `replay` gives the same.
    let parameters = Parameters::read(&files.parameters)?;
    let replay = replayed(&recordings, &parameters)?;
    let mut staged = Vec::new();
    let mut followed = None;
    if let Some(sine) = Sine::followable(&parameters)? {
        staged.extend(files.stage_reference(&parameters, &sine)?);
        followed = Some(if simulated {
            let film = Film::new(PLANT);
            let plant = |substep_s, _| -> Result<Box<dyn Moving + '_>> {
                Ok(Box::new(NonlinearPlant::at_rest(&film, substep_s)))
            };
            sine.follow(&parameters, plant, stop)?
        } else {
            sine.follow_refit(&parameters, stop)
        });
    }
    let mut report = Report {
        simulated,
        fit: &done.report,
        replay,
        following: followed.as_ref().map(Followed::report).unwrap_or_default(),
        firmware: None,
        files: Vec::new(),
        interrupted: false,
    };
    if let Some(recording) = recordings.first().filter(|_| followed.is_some()) {
        let blob = firmware::blob(&parameters)?;
        staged.push(Staged::new(&files.blob, |file| file.write_all(&blob))?);
        if !stop.load(Ordering::Relaxed) {
            report.firmware = Some(firmware::run(&parameters, recording));
        }
    }
    report.interrupted = stop.load(Ordering::Relaxed);
    let written = files.recordings.iter().chain([&files.parameters, &files.page]).map(PathBuf::as_path);
    report.files = written.chain(staged.iter().map(Staged::path)).map(shown).collect();
    staged.push(stage_page(&files.page, &done, &report, followed.as_ref())?);
    staged.into_iter().try_for_each(Staged::commit)?;
    // The page shows them all. Of a user's own film they matter at once.
    terminal::warnings(json, report.fit.warnings.iter().filter(|_| !report.simulated));
    terminal::report(json, &report, || table::text(&report))?;
    if arguments.bench && !report.interrupted {
        return bench::run(&bench::simulated(PLANT, &files.parameters, &files.reference, &arguments.out), json);
    }
    Ok(())
}

/// The files of a demo.
struct OutputFiles {
    /// Recordings of the simulated film, if they are made.
    recordings: Vec<PathBuf>,
    parameters: PathBuf,
    page: PathBuf,
    reference: PathBuf,
    voltage: PathBuf,
    blob: PathBuf,
}

impl OutputFiles {
    fn in_folder(folder: &Path, simulated: bool) -> Self {
        let file = |name| folder.join(name);
        let periods = SIMULATED.iter().filter(|_| simulated);
        Self {
            recordings: periods.map(|(period_s, _)| folder.join(format!("recording-{period_s}s.csv"))).collect(),
            parameters: file("film.toml"),
            page: file("report.html"),
            reference: file("reference.csv"),
            voltage: file("voltage.csv"),
            blob: file("film.bin"),
        }
    }

    /// Refuses a folder in which they cannot be written, or `inputs` among them; makes the folder.
    fn check(&self, folder: &Path, inputs: &[&Path]) -> Result<Folder> {
        if folder.is_file() {
            return Err(Error::file(folder, "is a file; name a folder"));
        }
        let all = [&self.parameters, &self.page, &self.reference, &self.voltage, &self.blob];
        self.recordings.iter().chain(all).try_for_each(|path| output::check(path, inputs, Folders::AreMade))?;
        Folder::at(folder)
    }

    /// Records the simulated film under sines of three frequencies, and reads the recordings as any others.
    fn simulated_recordings(&self) -> Result<Vec<Recording>> {
        let film = Film::new(PLANT);
        let grid = Grid::covering(SIMULATED_S, SIMULATED_HZ)?;
        let mut recordings = Vec::new();
        for ((period_s, seed), path) in SIMULATED.into_iter().zip(&self.recordings) {
            let waveform = Waveform { peak_v: SIMULATED_PEAK_V, frequencies_hz: vec![1.0 / period_s] };
            FilmRecording::new(&film, &waveform, grid, Instruments::default(), seed)?.write(path)?;
            recordings.push(Recording::read(path)?);
        }
        Ok(recordings)
    }

    /// The reference, and the voltage that makes the model follow it.
    fn stage_reference(&self, parameters: &Parameters, sine: &Sine) -> Result<[Staged; 2]> {
        let Sine { grid, values, .. } = sine;
        let plan = sine.plan(parameters)?;
        let time = grid.times_s();
        let columns: [(&str, Option<&[f64]>); 2] = [("time_s", Some(&time)), ("displacement_m", Some(values))];
        Ok([
            output::stage_columns(&self.reference, &columns)?,
            feedforward_command::stage(&self.voltage, *grid, &plan)?,
        ])
    }
}

/// Fits `recordings` together; writes the parameters.
fn fitted(recordings: &[Recording], actuator: Actuator, assumed_sizes: bool, files: &OutputFiles) -> Result<Done> {
    // One structure. The search over all of them takes twenty times as long and finds little more on these recordings.
    let settings = Settings {
        branches: vec![2],
        topologies: vec![Topology::Parallel],
        actuator,
        assumed_sizes,
        ..Settings::default()
    };
    let observed =
        recordings.iter().map(|r| observation::observe(r, Direction::Force, 1.0)).collect::<Result<Vec<_>>>()?;
    let (observations, warnings): (Vec<_>, Vec<_>) = observed.into_iter().unzip();
    let job = Job {
        out: files.parameters.clone(),
        page: None,
        recordings: recordings.iter().collect(),
        observations,
        warnings: warnings.concat(),
    };
    let done = job.fit(&settings, Direction::Force)?;
    done.stage_parameters(&files.parameters)?.commit()?;
    Ok(done)
}

/// The page: the fit, what the controller's code makes of the recordings, and the runs along the sine.
fn stage_page(path: &Path, done: &Done, report: &Report<'_>, followed: Option<&Followed>) -> Result<Staged> {
    let document = Document::from_report(report)?;
    let numbers = Numbers::from_document(&document);
    let replay = Section::new("replay", "Replay on the controller", page::replay(&numbers));
    let film = if report.simulated { SIMULATED_FILM } else { REFITTED_FILM };
    let followed = followed.map(|followed| followed.picture(&report.following, &numbers, film));
    let title =
        if report.simulated { "Demo on simulated recordings of a nonlinear film" } else { "Demo on recordings" };
    let html = FitPage { followed, ..done.page(report.fit) }.html(title, &document, "/fit", vec![replay]);
    Staged::new(path, |file| file.write_all(html.as_bytes()))
}

/// The recordings through the controller's code.
fn replayed(recordings: &[Recording], parameters: &Parameters) -> Result<replay::Report> {
    let options = RunOptions::default();
    let mut rows = Vec::new();
    for recording in recordings {
        let comparison = Comparison::new(recording, Direction::Force, parameters, options.rate_hz)?;
        let bar = Progress::over(comparison.grid.samples as u64, "replay");
        let about = |error: Error| error.about(&parameters.name, recording.path());
        let (_, agreement) = comparison.run(parameters, &options, &bar).map_err(about)?;
        bar.finish_and_clear();
        rows.push(RecordingAgreement::new(recording.path(), Direction::Force, &agreement));
    }
    Ok(replay::Report::new(rows))
}
