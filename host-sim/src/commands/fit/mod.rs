//! `fit`: parameters of the model from recordings.

mod options;

use std::sync::atomic::Ordering;
use std::time::Instant;

use springpot::CommandLimits;

use self::options::FitArguments;
use super::following::{Followed, Following, REFITTED_FILM, Sine};
use super::recordings::RecordingOptions;
use crate::commands::prelude::*;
use crate::files::parameters::Parameters;
use crate::files::recording::{Direction, Recording};
use crate::fit::observation::{self, Observation};
use crate::fit::{self, Fit, FitReport, Settings, Warning};
use crate::grid::Grid;
use crate::interrupt;
use crate::replay::feasibility;
use crate::replay::memory::RunOptions;
use crate::report::fit_page::FitPage;
use crate::report::numbers::{Document, Numbers};
use crate::report::origin;

const PAGE_TITLE: &str = "Fit of the fully fractional generalised Maxwell model";

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Parameter file to write.
    #[arg(long, value_name = "P.toml")]
    out: PathBuf,
    #[command(flatten)]
    options: FitArguments,
    /// Fit each recording alone; writes one file per recording beside --out.
    #[arg(long)]
    each: bool,
    /// Reference to follow later (`time_s`, `displacement_m`): reports the error of feedforward to expect along it.
    #[arg(long, value_name = "REF.csv")]
    reference: Option<PathBuf>,
    /// Page to write, with results, tables and plots; it opens in any browser, offline.
    #[arg(long, value_name = "R.html")]
    report: Option<PathBuf>,
    #[command(flatten)]
    reading: RecordingOptions,
    /// Recordings to fit.
    #[arg(value_name = "REC.csv", required = true)]
    recordings: Vec<PathBuf>,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let options = arguments.options.options();
    let settings = arguments.options.settings(&options)?;
    let direction = options.drive;
    let recordings = arguments.reading.read(&arguments.recordings)?;
    let observed = options.observations(&recordings.iter().collect::<Vec<_>>())?;
    let rate_hz = RunOptions::default().rate_hz;
    let reference =
        arguments.reference.as_deref().map(|path| arguments.reading.reference(path, rate_hz)).transpose()?;
    let jobs = arguments.jobs(&recordings, &observed)?;
    let all = jobs.len();
    let stop = interrupt::stop_flag();
    let mut reports = Vec::new();
    for job in jobs {
        // A fit that was not begun is not written.
        if stop.load(Ordering::Relaxed) && !reports.is_empty() {
            terminal::message(format!("interrupted: {} of {all} recordings are fitted", reports.len()));
            break;
        }
        reports.push(job.run(&settings, direction, reference.as_ref())?);
    }
    // Those are shown as the recordings are read.
    let remarks = recordings.iter().flat_map(observation::remarks);
    let remarks: Vec<String> = remarks.map(|warning| with_flags(&warning.text)).collect();
    for report in &reports {
        let file = report.fit.parameters_file.as_ref().filter(|_| arguments.each);
        let of = file.map_or_else(String::new, |file| format!("{file}: "));
        let later = report.fit.warnings.iter().filter(|warning| !remarks.contains(&warning.text));
        terminal::warnings(json, later.map(|warning| format!("{of}{warning}")));
    }
    for compression in reports.iter().filter_map(|report| report.fit.compression.as_ref()) {
        terminal::note(compression.text());
    }
    match reports.as_slice() {
        [report] if !arguments.each => terminal::report(json, report, || report.fit.text()),
        _ => terminal::report(json, &reports, || {
            reports.iter().map(|report| report.fit.text()).collect::<Vec<_>>().join("\n\n")
        }),
    }
}

/// One fit: its input and its output files.
pub(super) struct Job<'a> {
    pub(super) out: PathBuf,
    pub(super) page: Option<PathBuf>,
    pub(super) recordings: Vec<&'a Recording>,
    pub(super) observations: Vec<Observation>,
    /// Warnings about the recordings.
    pub(super) warnings: Vec<Warning>,
}

impl Arguments {
    /// The fits that are asked for: one, or with `--each` one per recording. Their outputs are checked.
    fn jobs<'a>(&self, recordings: &'a [Recording], observed: &[(Observation, Vec<Warning>)]) -> Result<Vec<Job<'a>>> {
        let job = |out: PathBuf, page: Option<PathBuf>, recordings: &'a [Recording], observed: &[_]| Job {
            out,
            page,
            recordings: recordings.iter().collect(),
            observations: observed.iter().map(|(observation, _): &(Observation, _)| observation.clone()).collect(),
            warnings: observed.iter().flat_map(|(_, warnings): &(_, Vec<Warning>)| warnings.clone()).collect(),
        };
        let mut jobs = Vec::new();
        if self.each {
            for (recording, observed) in recordings.iter().zip(observed) {
                let out = beside(&self.out, recording.path());
                if jobs.iter().any(|job: &Job<'_>| job.out == out) {
                    let cause = format!("two recordings would be written to {}", out.display());
                    return Err(Error::field("each", cause));
                }
                let page = self.report.as_deref().map(|page| beside(page, recording.path()));
                jobs.push(job(out, page, std::slice::from_ref(recording), std::slice::from_ref(observed)));
            }
        } else {
            jobs.push(job(self.out.clone(), self.report.clone(), recordings, observed));
        }
        let inputs: Vec<&Path> = recordings
            .iter()
            .map(Recording::path)
            .chain(self.options.parameter_files())
            .chain(self.reference.as_deref())
            .collect();
        for path in jobs.iter().flat_map(|job| [Some(&job.out), job.page.as_ref()]).flatten() {
            output::check(path, &inputs, Folders::Exist)?;
        }
        if self.report.as_ref() == Some(&self.out) {
            return Err(Error::field("report", "is the file of the parameters; name another"));
        }
        Ok(jobs)
    }
}

/// The report of a fit, and of the sine that its page shows.
#[derive(Serialize)]
struct Reported<R> {
    #[serde(flatten)]
    fit: R,
    #[serde(flatten)]
    following: Option<Following>,
}

/// A fit that is done: its report and what its files are made of.
pub(super) struct Done {
    pub(super) report: FitReport,
    fit: Fit,
    observations: Vec<Observation>,
    parameters: Parameters,
    direction: Direction,
}

impl Job<'_> {
    /// Fits, and writes the parameters and the page; the report states the error to expect along a `reference`.
    fn run(
        self,
        settings: &Settings,
        direction: Direction,
        reference: Option<&(Vec<f64>, Grid)>,
    ) -> Result<Reported<FitReport>> {
        let (out, page) = (self.out.clone(), self.page.clone());
        let mut done = self.fit(settings, direction)?;
        if let Some((reference, grid)) = reference {
            let check = feasibility::check(&done.parameters, reference, *grid, &CommandLimits::BENCH)?;
            done.report.expectation = check.expectation;
        }
        let mut written = vec![done.stage_parameters(&out)?];
        let mut following = None;
        if let Some(page) = &page {
            let (html, report) = done.page_with_sine()?;
            following = report;
            written.push(Staged::new(page, |file| file.write_all(html.as_bytes()))?);
        }
        written.into_iter().try_for_each(Staged::commit)?;
        Ok(Reported { fit: done.report, following })
    }

    /// Fits.
    pub(super) fn fit(self, settings: &Settings, direction: Direction) -> Result<Done> {
        let started = Instant::now();
        let bar = Progress::unknown("fit");
        let mut fit = fit::fit(&self.observations, settings, interrupt::stop_flag(), &|stage| bar.enter(stage))?;
        bar.finish_and_clear();
        fit.warnings.splice(0..0, self.warnings);
        fit.warnings.sort_by_key(|warning| warning.severity);
        let seconds = started.elapsed().as_secs_f64();
        let parameters = fit.parameters(settings, direction, &self.recordings)?;
        fit.warnings.iter_mut().for_each(|warning| warning.text = with_flags(&warning.text));
        let files: Vec<&Path> = self.recordings.iter().map(|recording| recording.path()).collect();
        let mut report = FitReport::new(&fit, &parameters, direction, &files, seconds);
        report.parameters_file = Some(shown(&self.out));
        report.made = Some(origin::now());
        Ok(Done { report, fit, observations: self.observations, parameters, direction })
    }
}

impl Done {
    /// The parameters for `path`, staged.
    pub(super) fn stage_parameters(&self, path: &Path) -> Result<Staged> {
        let parameters = self.parameters.to_toml();
        Staged::new(path, |file| file.write_all(parameters.as_bytes()))
    }

    /// The page of the fit with this `report`.
    pub(super) fn page<'a>(&'a self, report: &'a FitReport) -> FitPage<'a> {
        let Self { fit, observations, parameters, direction, .. } = self;
        FitPage { report, fit, observations, parameters, direction: *direction, followed: None }
    }

    /// The page, which begins with a sine that the film can follow, and what the document has of that.
    fn page_with_sine(&self) -> Result<(String, Option<Following>)> {
        let stop = interrupt::stop_flag();
        // A film that no controller can step, or that follows no sine, has none.
        let sine = if self.report.interrupted { None } else { Sine::followable(&self.parameters).ok().flatten() };
        let followed = sine.map(|sine| sine.follow_refit(&self.parameters, stop));
        let reported = Reported { fit: &self.report, following: followed.as_ref().map(Followed::report) };
        let document = Document::from_report(&reported)?;
        let numbers = Numbers::from_document(&document);
        let picture = |(followed, report): (&Followed, &Following)| followed.picture(report, &numbers, REFITTED_FILM);
        let followed = followed.as_ref().zip(reported.following.as_ref()).map(picture);
        let html = FitPage { followed, ..self.page(&self.report) }.html(PAGE_TITLE, &document, "", Vec::new());
        Ok((html, reported.following))
    }
}

/// The file beside `out` that belongs to `recording`.
fn beside(out: &Path, recording: &Path) -> PathBuf {
    let stem = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let ending = out.extension().map_or_else(String::new, |ending| format!(".{}", ending.to_string_lossy()));
    out.with_file_name(format!("{}-{}{ending}", stem(out), stem(recording)))
}
