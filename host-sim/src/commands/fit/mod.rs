mod options;
pub(super) mod page;
pub(super) mod result;

use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Instant;

use clap::Args;

use crate::error::{Error, Result};
use crate::files::output::{self, Folders};
use crate::files::recording::Recording;
use crate::fit;
use crate::fit::objective::Observation;
use crate::interrupt;
use crate::terminal;
pub(super) use options::FitOptions;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Where the parameters go.
    #[arg(long, value_name = "P.toml")]
    out: PathBuf,
    #[command(flatten)]
    options: FitOptions,
    /// Fit each recording alone; writes one file per recording beside --out.
    #[arg(long)]
    each: bool,
    /// Where a page with tables and figures goes.
    #[arg(long, value_name = "R.html")]
    report: Option<PathBuf>,
    /// Recordings to fit.
    #[arg(value_name = "REC.csv", required = true)]
    recordings: Vec<PathBuf>,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let settings = arguments.options.settings()?;
    let recordings = arguments.recordings.iter().map(|path| Recording::read(path)).collect::<Result<Vec<_>>>()?;
    let (observations, warnings) = arguments.options.observations(&recordings)?;
    let stop = interrupt::stop_flag();
    let jobs: Vec<Job> = if arguments.each {
        let outputs = recordings.iter().map(|recording| beside(&arguments.out, recording.path())).collect::<Vec<_>>();
        if let Some(twice) = outputs.iter().enumerate().find(|(k, path)| outputs[..*k].contains(path)) {
            return Err(Error::option("--each", format!("two recordings would be written to {}", twice.1.display())));
        }
        outputs
            .into_iter()
            .enumerate()
            .map(|(index, out)| {
                let page = arguments.report.as_deref().map(|page| beside(page, recordings[index].path()));
                Job { out, page, indices: vec![index] }
            })
            .collect()
    } else {
        vec![Job {
            out: arguments.out.clone(),
            page: arguments.report.clone(),
            indices: (0..recordings.len()).collect(),
        }]
    };
    let inputs: Vec<&Path> =
        recordings.iter().map(Recording::path).chain(arguments.options.parameter_files()).collect();
    for path in jobs.iter().flat_map(|job| [Some(&job.out), job.page.as_ref()]).flatten() {
        output::check(path, &inputs, Folders::Exist)?;
    }
    if arguments.report.as_ref() == Some(&arguments.out) {
        return Err(Error::option("--report", "is the file of the parameters; name another"));
    }

    let mut reports = Vec::new();
    let all = jobs.len();
    for Job { out, page, indices } in jobs {
        // What was not begun is not written.
        if stop.load(Ordering::Relaxed) && !reports.is_empty() {
            eprintln!("host-sim: interrupted: {} of {all} recordings are fitted", reports.len());
            break;
        }
        let chosen: Vec<Observation> = indices.iter().map(|&index| observations[index].clone()).collect();
        let files: Vec<&Path> = indices.iter().map(|&index| recordings[index].path()).collect();
        let started = Instant::now();
        let bar = terminal::spinner();
        let mut fit = fit::fit(&chosen, &settings, stop, &|message| bar.set_message(message.to_owned()))?;
        bar.finish_and_clear();
        fit.warnings.splice(0..0, indices.iter().flat_map(|&index| warnings[index].clone()));
        let seconds = started.elapsed().as_secs_f64();
        let parameters = result::parameters_of(&fit, &settings, arguments.options.direction(), &files)?;
        let report = result::report_of(&fit, arguments.options.direction(), &files, &out, seconds);
        let mut written = vec![output::Staged::new(&out, |file| file.write_all(parameters.to_toml().as_bytes()))?];
        if let Some(path) = &page {
            let page = page::page(&report, &fit, &chosen, arguments.options.direction());
            written.push(output::Staged::new(path, |file| file.write_all(page.as_bytes()))?);
        }
        written.into_iter().try_for_each(output::Staged::commit)?;
        reports.push(report);
    }
    match reports.as_slice() {
        [report] if !arguments.each => terminal::report(json, report, || result::text(report)),
        _ => terminal::report(json, &reports, || reports.iter().map(result::text).collect::<Vec<_>>().join("\n\n")),
    }
}

/// What one fit reads and writes.
struct Job {
    out: PathBuf,
    page: Option<PathBuf>,
    indices: Vec<usize>,
}

/// The file beside `out` that belongs to `recording`.
fn beside(out: &Path, recording: &Path) -> PathBuf {
    let stem = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let ending = out.extension().map_or_else(String::new, |ending| format!(".{}", ending.to_string_lossy()));
    out.with_file_name(format!("{}-{}{ending}", stem(out), stem(recording)))
}
