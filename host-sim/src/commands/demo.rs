//! Everything once: recordings fitted together, replayed through the controller's code, and a reference followed.

mod firmware;
mod page;
mod table;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;
use dea_driver::Control;
use serde::Serialize;
use springpot::{Actuator, CommandLimits, Topology};

use self::firmware::Firmware;
use super::fit::{Done, Job};
use super::recordings::RecordingOptions;
use super::{bench, feedforward as feedforward_command, options, replay};
use crate::choice::Choice;
use crate::error::{Error, Result, shown};
use crate::files::output::{self, Folder, Folders, Staged};
use crate::files::parameters::{Parameters, below_resonance};
use crate::files::recording::{Direction, Input, Recording};
use crate::fit::{FitReport, Settings, observation};
use crate::grid::Grid;
use crate::progress::Progress;
use crate::references::{Reference, Shape};
use crate::replay::comparison::Comparison;
use crate::replay::feasibility::{self, Feasibility};
use crate::replay::feedforward;
use crate::replay::limits::command_limits;
use crate::replay::memory::{Precision, RunOptions};
use crate::report::fit_page::{FitPage, Followed as Pictures};
use crate::report::numbers::{Document, Numbers};
use crate::report::page::Section;
use crate::simulation::closed_loop::{self, BenchModel, LoopRun, TrackingQuality};
use crate::simulation::controllers::{self, ControllerKind, ControllerSettings};
use crate::simulation::film::{Film, Instruments, Plant, Waveform};
use crate::simulation::film_recording::FilmRecording;
use crate::{interrupt, terminal};

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
/// The controllers that are compared.
const CONTROLLERS: [ControllerKind; 3] = [ControllerKind::None, ControllerKind::Feedforward, ControllerKind::Tracking];

/// The results of a demo, for people and machines.
#[derive(Serialize)]
struct Report<'a> {
    simulated: bool,
    /// How the simulated film follows, in a sentence.
    verdict: Option<String>,
    fit: &'a FitReport,
    #[serde(flatten)]
    replay: replay::Report,
    /// The sine; none where no voltage was recorded or the film can follow none.
    reference: Option<ReferenceRow>,
    closed_loop: Vec<LoopRow>,
    /// The firmware's image in QEMU, where a voltage was recorded.
    firmware: Option<Firmware>,
    files: Vec<String>,
    interrupted: bool,
}

#[derive(Serialize)]
struct ReferenceRow {
    low_m: f64,
    high_m: f64,
    period_s: f64,
    duration_s: f64,
    check: Feasibility,
}

#[derive(Serialize)]
struct LoopRow {
    controller: &'static str,
    #[serde(flatten)]
    quality: TrackingQuality,
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
    let (replay, peak_m) = replayed(&recordings, &parameters)?;
    let mut staged = Vec::new();
    let mut followed = None;
    let mut report = Report {
        simulated,
        verdict: None,
        fit: &done.report,
        replay,
        reference: None,
        closed_loop: Vec::new(),
        firmware: None,
        files: Vec::new(),
        interrupted: false,
    };
    if let Some(limits) = limits_of(&recordings, &parameters.actuator, peak_m)? {
        let duration_s = recordings.iter().map(Recording::duration_s).fold(0.0, f64::max);
        if let Some(sine) = Sine::followable(&parameters, peak_m, duration_s, &limits)? {
            staged.extend(files.stage_reference(&parameters, &sine, &limits)?);
            let runs = if simulated { closed_loops(&parameters, &sine, limits, stop)? } else { Vec::new() };
            report.closed_loop =
                runs.iter().map(|(controller, run)| LoopRow { controller, quality: run.quality() }).collect();
            report.verdict = verdict(&report.closed_loop);
            report.reference = Some(sine.row());
            followed = Some((sine, runs));
        }
    }
    if let Some(recording) = recordings.first().filter(|_| report.reference.is_some()) {
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

/// How a film follows with each of the [`CONTROLLERS`], in a sentence.
fn verdict(rows: &[LoopRow]) -> Option<String> {
    let [none, feedforward, tracking] = rows else { return None };
    let rms = |row: &LoopRow| row.quality.tracking_rms_pct.unwrap_or(f64::NAN);
    Some(format!(
        "follows within {:.2} % RMS, {:.2} % without the sensor, {:.1} % without compensation",
        rms(tracking),
        rms(feedforward),
        rms(none)
    ))
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
    fn stage_reference(&self, parameters: &Parameters, sine: &Sine, limits: &CommandLimits) -> Result<[Staged; 2]> {
        let Sine { grid, values, .. } = sine;
        let options = RunOptions::default();
        let bar = Progress::over(grid.samples as u64, "feedforward");
        let plan = feedforward::plan(parameters, values, *grid, &options, *limits, &bar)?;
        bar.finish_and_clear();
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
    let followed = followed.map(|(sine, runs)| Pictures {
        verdict: report.verdict.as_deref(),
        section: Section::new("following", "Following a reference", page::following(&numbers, sine, runs)),
    });
    let title =
        if report.simulated { "Demo on simulated recordings of a nonlinear film" } else { "Demo on recordings" };
    let html = FitPage { followed, ..done.page(report.fit) }.html(title, &document, "/fit", vec![replay]);
    Staged::new(path, |file| file.write_all(html.as_bytes()))
}

/// The recordings through the controller's code, and the largest displacement there, m.
fn replayed(recordings: &[Recording], parameters: &Parameters) -> Result<(replay::Report, f64)> {
    let options = RunOptions::default();
    let mut rows = Vec::new();
    let mut peak_m = 0.0_f64;
    for recording in recordings {
        let comparison = Comparison::new(recording, Direction::Force, parameters, options.rate_hz)?;
        let bar = Progress::over(comparison.grid.samples as u64, "replay");
        let about = |error: Error| error.about(&parameters.name, recording.path());
        let (response, agreement) = comparison.run(parameters, &options, &bar).map_err(about)?;
        bar.finish_and_clear();
        peak_m = response.displacement_m.iter().copied().fold(peak_m, f64::max);
        rows.push(replay::RecordingAgreement::new(recording, Direction::Force, &agreement));
    }
    Ok((replay::Report::new(rows), peak_m))
}

/// Limits that ask no more of the film than the recordings did; none where no voltage was recorded.
fn limits_of(recordings: &[Recording], actuator: &Actuator, peak_m: f64) -> Result<Option<CommandLimits>> {
    let mut largest_v = 0.0_f64;
    for recording in recordings {
        match recording.drive()? {
            Input::Voltage(samples) => {
                largest_v = samples.value.iter().fold(largest_v, |largest, v| largest.max(v.abs()))
            }
            Input::Force(_) | Input::Displacement(_) => return Ok(None),
        }
    }
    let max_field = largest_v * actuator.thinning(peak_m) / actuator.thickness_m;
    command_limits(None, [("max_voltage_v", largest_v), ("max_field_v_per_m", max_field)]).map(Some)
}

/// A sine, and the runs along it by their controllers.
type Followed = (Sine, Vec<(&'static str, LoopRun)>);

/// A sine that the film can follow.
struct Sine {
    reference: Reference,
    grid: Grid,
    values: Vec<f64>,
    check: Feasibility,
}

impl Sine {
    /// A sine of 45 %, or else of 25 or 10 % of the stroke `peak_m` (m), about its middle, moved by an offset where the check finds one.
    fn followable(
        parameters: &Parameters,
        peak_m: f64,
        duration_s: f64,
        limits: &CommandLimits,
    ) -> Result<Option<Self>> {
        // As long as the model was fitted for, with a rise of half a period and fifteen periods.
        let period_s = duration_s / 15.5;
        let grid = Grid::covering(duration_s, RunOptions::default().rate_hz)?;
        if !(peak_m > 0.0 && grid.samples > 100) {
            return Ok(None);
        }
        let on = |low_m: f64, high_m: f64| -> Result<Self> {
            let reference =
                Reference { rise_s: 0.5 * period_s, ..Reference::new(Shape::Sine, low_m, high_m, period_s) };
            let values = reference.on(grid)?;
            let check = feasibility::check(parameters, &values, grid, limits)?;
            Ok(Self { reference, grid, values, check })
        };
        for share in [0.45, 0.25, 0.1] {
            let (low_m, high_m) = (0.5 - 0.5 * share, 0.5 + 0.5 * share);
            let mut sine = on(low_m * peak_m, high_m * peak_m)?;
            if let (false, Some(least), Some(most)) =
                (sine.check.feasible, sine.check.least_offset_m, sine.check.most_offset_m)
            {
                let offset_m = 0.5 * (least + most);
                sine = on(low_m * peak_m + offset_m, high_m * peak_m + offset_m)?;
            }
            if sine.check.feasible {
                return Ok(Some(sine));
            }
        }
        Ok(None)
    }

    fn row(&self) -> ReferenceRow {
        let Reference { low_m, high_m, period_s, .. } = self.reference;
        ReferenceRow {
            low_m,
            high_m,
            period_s,
            duration_s: self.grid.time_s(self.grid.samples - 1),
            check: self.check.clone(),
        }
    }
}

/// The controllers on the simulated film, until `stop`.
fn closed_loops(
    parameters: &Parameters,
    sine: &Sine,
    limits: CommandLimits,
    stop: &AtomicBool,
) -> Result<Vec<(&'static str, LoopRun)>> {
    let film = Film::new(PLANT);
    let law = parameters.film().compressed_law(sine.grid.rate_hz)?;
    let settings = ControllerSettings {
        rate_hz: sine.grid.rate_hz,
        limits,
        observer: below_resonance(Control::BENCH, &law).observer_options(),
        learning: None,
        peak_m: sine.reference.high_m,
    };
    let mut runs = Vec::new();
    for kind in CONTROLLERS {
        if stop.load(Ordering::Relaxed) {
            break;
        }
        let mut controller = controllers::build(kind, parameters, &settings, Precision::F32)?;
        let bar = Progress::over(sine.grid.samples as u64, kind.name());
        let bench = BenchModel::default();
        let run = closed_loop::track(&film, &bench, controller.as_mut(), &sine.values, sine.grid, &bar)?;
        bar.finish_and_clear();
        runs.push((kind.name(), run));
    }
    Ok(runs)
}
