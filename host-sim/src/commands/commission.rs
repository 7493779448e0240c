//! `commission`: from an unknown film to one that follows, with a record; and `verify`, which checks a record.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fmt::Write;
use std::sync::atomic::AtomicBool;

use clap::Parser;
use dea_driver::wire::Identity;

use super::Verdict;
use super::link::LinkedBench;
use super::prelude::*;
use crate::bench::shared::Watched;
use crate::bench::web::Sittings;
use crate::choice::Choice;
use crate::commission::simulated::{Fault, FaultKind, SimulatedBench};
use crate::commission::{self, Bench, Finding, Plan, Report, Step};
use crate::files::parameters::{Parameters, as_written};
use crate::files::seal;
use crate::fit::report::Origin;
use crate::interrupt;
use crate::link::{Client, Port};
use crate::progress::Stage;
use crate::quantity::{at_most, positive};
use crate::report::numbers::Document;
use crate::report::{origin, record_page};
use crate::simulation::film::{self, Film, Instruments};
use crate::simulation::plant::NonlinearPlant;

/// The record, and its page.
const RECORD: &str = "record.json";
const PAGE: &str = "record.html";

/// Thickest gauge, in largest strokes: plain numbers are metres.
const MAX_GAUGE: f64 = 20.0;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// File with the tables `[actuator]` and `[board]`; a model need not be there.
    #[arg(long, value_name = "B.toml")]
    board: String,
    #[command(flatten)]
    bench: BenchOptions,
    /// Folder for the record, its page, the recordings and film.toml.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Begin with this step, on what the steps before it left in the folder.
    #[arg(long, value_name = "STEP", value_parser = named::<Step>())]
    from: Option<Step>,
    /// Do this step alone.
    #[arg(long, value_name = "STEP", value_parser = named::<Step>(), conflicts_with = "from")]
    only: Option<Step>,
    /// Return the controller to its old parameters at the end.
    #[arg(long)]
    dry_run: bool,
    /// Entry of the operator, such as serial="A 17" or humidity=40%; more than one is possible.
    #[arg(long, value_name = "NAME=TEXT", value_parser = entry)]
    entry: Vec<(String, String)>,
    /// Thickness of a gauge under the sensor's target, and how far the reading rose: 2mm:2.01mm.
    #[arg(long, value_name = "TRUE:READ", value_parser = gauge)]
    gauge: Option<[f64; 2]>,
    /// Highest frequency of the film's use.
    #[arg(long, value_name = "HZ", value_parser = quantity::hertz, default_value_t = 0.2)]
    band: f64,
    /// Cycles of each sine of the excitation.
    #[arg(long, value_name = "N", default_value_t = 5)]
    cycles: u32,
    /// Length of the hold in the excitation.
    #[arg(long, value_name = "S", value_parser = quantity::seconds, default_value_t = 90.0)]
    hold: f64,
    /// Rest before the verification.
    #[arg(long, value_name = "S", value_parser = quantity::seconds, default_value_t = 60.0)]
    rest: f64,
    /// Segments of the verification; a record with fewer than 59 does not pass.
    #[arg(long, value_name = "N", default_value_t = 60)]
    segments: usize,
    /// Largest error of a segment that passes, % of the range, with the sensor; twice as much without it.
    #[arg(long, value_name = "PCT", value_parser = quantity::number, default_value_t = 5.0)]
    max_error: f64,
    /// Seed of the segments, and of the simulated bench.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// The bench.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct BenchOptions {
    /// Port of a controller: a serial port such as /dev/ttyUSB0, or tcp:HOST:PORT.
    #[arg(long, value_name = "PORT")]
    port: Option<String>,
    /// A simulated bench with this film.
    #[arg(long, value_name = "FILM", value_parser = named::<film::Plant>())]
    plant: Option<film::Plant>,
    /// A simulated bench with the film hossain and this fault, such as leak=0.1.
    #[arg(long, value_name = "FAULT=STRENGTH", value_parser = fault)]
    fault: Option<Fault>,
}

fn pair(text: &str, between: char) -> std::result::Result<(&str, &str), String> {
    text.split_once(between).ok_or_else(|| format!("two parts with {between:?} between them are needed"))
}

fn entry(text: &str) -> std::result::Result<(String, String), String> {
    let (name, value) = pair(text, '=')?;
    match name.trim() {
        "" => Err("the entry has no name".into()),
        name => Ok((name.to_owned(), value.trim().to_owned())),
    }
}

fn gauge(text: &str) -> std::result::Result<[f64; 2], String> {
    let (wanted, read) = pair(text, ':')?;
    Ok([quantity::metres(wanted)?, quantity::metres(read)?])
}

fn fault(text: &str) -> std::result::Result<Fault, String> {
    let (name, strength) = pair(text, '=')?;
    let names: Vec<&str> = FaultKind::CHOICES.iter().map(|(_, name, _)| *name).collect();
    let kind =
        FaultKind::from_name(name).ok_or_else(|| format!("no fault {name:?}; there are {}", names.join(", ")))?;
    Ok(Fault { kind, strength: quantity::number(strength)? })
}

/// A record of commissioning.
#[derive(Serialize)]
struct Record<'a> {
    /// Its kind.
    record: &'static str,
    made: Origin,
    /// Statements of the operator; nothing checks them.
    entries: BTreeMap<&'a str, &'a str>,
    #[serde(flatten)]
    report: &'a Report,
}

impl Arguments {
    fn plan(&self) -> Result<Plan> {
        let (actuator, board, assumed_sizes) = Parameters::load_board(&self.board)?;
        let lacks = board.lacks();
        if !lacks.is_empty() && self.bench.port.is_some() {
            let cause = format!("the [board] table has no {}: those of your bench are needed", lacks.join(", "));
            return Err(Error::file(Path::new(&self.board), cause));
        }
        positive("band", self.band)?;
        at_most("band", self.band, 5.0)?;
        at_most("hold", self.hold, 1e4)?;
        at_most("rest", self.rest, 1e4)?;
        positive("max_error", self.max_error)?;
        if !(1..=1000).contains(&self.segments) {
            return Err(Error::field("segments", "must be from 1 to 1000"));
        }
        if !(1..=100).contains(&self.cycles) {
            return Err(Error::field("cycles", "must be from 1 to 100"));
        }
        if let Some([wanted, _]) = self.gauge {
            positive("gauge", wanted)?;
            let stroke_m = as_written(board.limits.max_displacement_m);
            if wanted > MAX_GAUGE * stroke_m {
                let cause =
                    format!("{wanted} m where the stroke is {stroke_m} m at most: state its unit, as in 2mm:2.01mm");
                return Err(Error::field("gauge", cause));
            }
        }
        let mut names: Vec<&str> = self.entry.iter().map(|(name, _)| name.as_str()).collect();
        names.sort_unstable();
        if let Some(twice) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(Error::field("entry", format!("{:?} is stated twice", twice[0])));
        }
        let steps = match (self.from, self.only) {
            (_, Some(only)) => [only, only],
            (from, None) => [from.unwrap_or(Step::SelfTest), Step::Verify],
        };
        Ok(Plan {
            steps,
            band_hz: self.band,
            hold_s: self.hold,
            cycles: self.cycles,
            rest_s: self.rest,
            segments: self.segments,
            allowed_pct: [2.0 * self.max_error, self.max_error],
            gauge_m: self.gauge,
            dry_run: self.dry_run,
            seed: self.seed,
            ..Plan::new(actuator, assumed_sizes, board)
        })
    }
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<Verdict> {
    let plan = arguments.plan()?;
    let _folder = arguments.check(&plan)?;
    let film = Film::new(arguments.bench.plant.unwrap_or(film::Plant::Hossain));
    // From here on Ctrl-C comes to an end at 0 V.
    let stop = interrupt::live_film();
    let mut connected = arguments.bench.port.as_ref().map(|port| Client::new(Port::open(port)?)).transpose()?;
    let mut bench: Box<dyn Bench + '_> = match &mut connected {
        Some((client, identity)) => Box::new(LinkedBench::new(client, identity, stop)),
        None => {
            const SUBSTEP_S: f64 = 5e-4;
            let plant = Box::new(NonlinearPlant::at_rest(&film, SUBSTEP_S));
            let faults = arguments.bench.fault.into_iter().collect();
            Box::new(SimulatedBench::new(
                plant,
                SUBSTEP_S,
                &commission::provisional(&plan)?,
                Instruments::default(),
                faults,
                arguments.seed,
            )?)
        }
    };
    let bar = Progress::unknown("commission");
    let made = arguments.sitting(&plan, bench.as_mut(), stop, &|stage| bar.enter(stage));
    bar.finish_and_clear();
    let report = made?;
    let record = arguments.out.join(RECORD);
    terminal::report(json, &arguments.record(&report), || text(&report, &record))?;
    Ok(if report.verdict.passed { Verdict::Yes } else { Verdict::No })
}

impl Arguments {
    /// Checks that the record of `plan` can be written, before anything is driven; makes its folder, which is removed again if it stays empty.
    fn check(&self, plan: &Plan) -> Result<Folder> {
        commission::provisional(plan)?;
        let record = self.out.join(RECORD);
        for file in [&record, &self.out.join(PAGE)] {
            output::check(file, &[Path::new(&self.board)], Folders::AreMade)?;
        }
        if record.exists() && plan.steps == [Step::SelfTest, Step::Verify] {
            let cause = "the record of another sitting; begin in another folder, or go on in this one with a later step (`from`)";
            return Err(Error::file(&record, cause));
        }
        Folder::at(&self.out)
    }

    fn record<'a>(&'a self, report: &'a Report) -> Record<'a> {
        Record {
            record: "commissioning",
            made: origin::now(),
            entries: self.entry.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect(),
            report,
        }
    }

    /// Commissions the film on `bench`, and writes its record.
    fn sitting(
        &self,
        plan: &Plan,
        bench: &mut dyn Bench,
        stop: &AtomicBool,
        progress: &dyn Fn(&Stage),
    ) -> Result<Report> {
        let (record, page) = (self.out.join(RECORD), self.out.join(PAGE));
        // Steps that do not end leave no record, not even that of the steps before them.
        for old in [&record, &page].into_iter().filter(|old| old.exists()) {
            std::fs::remove_file(old).map_err(|e| Error::file(old, e))?;
        }
        let mut report = commission::commission(bench, plan, &self.out, stop, progress)?;
        for finding in &mut report.findings {
            finding.measured = with_flags(&finding.measured);
        }
        for warning in report.fit.iter_mut().flat_map(|fit| &mut fit.warnings) {
            warning.text = with_flags(&warning.text);
        }
        let made = self.record(&report);
        let document = Document::from_report(&made)?;
        let html = record_page::html(&report, &made.entries, &made.made, &document);
        output::write_whole(&page, |file| file.write_all(html.as_bytes()))?;
        let mut files = report.files.clone();
        files.push(page);
        files.dedup();
        seal::write(&record, &made, &files)?;
        Ok(report)
    }
}

/// The command as a page has it, with its defaults.
#[derive(Debug, Parser)]
struct OfAPage {
    #[command(flatten)]
    arguments: Arguments,
}

/// Makes sittings for a page, at the bench that the file `board` describes; their records are in folders of `out`.
pub(super) fn sittings(board: &str, out: &Path) -> Result<Sittings> {
    let board = board.to_owned();
    let line = move |out: &Path| {
        let fixed = ["commission", "--port", "the session's", "--board", &board, "--out"].map(OsString::from);
        fixed.into_iter().chain([out.as_os_str().to_owned()]).collect::<Vec<_>>()
    };
    let arguments = |line: Vec<OsString>| -> Result<Arguments> {
        let refused = |e: clap::Error| Error::Usage(e.to_string().lines().next().unwrap_or_default().into());
        Ok(OfAPage::try_parse_from(line).map_err(refused)?.arguments)
    };
    // What is wrong with the file shows before the page opens.
    arguments(line(out))?.plan()?;
    let out = out.to_owned();
    Ok(Box::new(move |folder, gauge, serial| {
        let out = out.join(folder);
        let mut line = line(&out);
        if !gauge.is_empty() {
            line.push(format!("--gauge={gauge}").into());
        }
        if !serial.is_empty() {
            line.push(format!("--entry=serial={serial}").into());
        }
        let arguments = arguments(line)?;
        let plan = arguments.plan()?;
        Ok(Box::new(move |client: &mut Client, identity: &Identity, watched: &Watched<'_>| {
            let folder = arguments.check(&plan)?;
            let mut bench = LinkedBench::new(client, identity, watched.stop()).shown_by(watched);
            let report = arguments.sitting(&plan, &mut bench, watched.stop(), &|stage| watched.step(stage))?;
            drop(folder);
            Ok(format!("{} {}", report.verdict.sentence, report.verdict.next))
        }))
    }))
}

fn text(report: &Report, record: &Path) -> String {
    let mut text = format!("{}\n{}", report.verdict.sentence, report.verdict.next);
    // One line for one cause; the record has all.
    let is_new = |(k, finding): &(usize, &Finding)| report.findings[..*k].iter().all(|f| f.cause != finding.cause);
    for (_, finding) in report.findings.iter().enumerate().skip(1).filter(is_new) {
        let _ = write!(text, "\nalso {}: {}; {}", finding.cause.name(), finding.measured, finding.advice);
    }
    if let Some(prospect) = report.self_sensing.as_ref().filter(|_| report.verdict.passed) {
        let _ = write!(text, "\nthe film as its own sensor: {}", prospect.sentence());
    }
    let passed = if report.verdict.passed { "passes" } else { "does not pass" };
    let _ = write!(text, "\n{}: the record {passed}; {PAGE} is its page", shown(record));
    text
}

#[derive(Debug, Args)]
pub(super) struct VerifyArguments {
    /// Record that `commission` wrote, beside its files; or the folder with both.
    #[arg(value_name = "RECORD")]
    record: PathBuf,
    /// Public key of minisign: the signature in RECORD.minisig must be by its owner.
    #[arg(long, value_name = "PUB")]
    key: Option<PathBuf>,
}

#[derive(Serialize)]
struct Verified<'a> {
    record: String,
    files: usize,
    passed: bool,
    sentence: &'a str,
    seal: &'a str,
    /// The signature's trusted comment, where a key was given.
    signed: Option<String>,
}

pub(super) fn verify(arguments: &VerifyArguments, json: bool) -> Result<Verdict> {
    let path = match arguments.record.is_dir() {
        true => arguments.record.join(RECORD),
        false => arguments.record.clone(),
    };
    let record = seal::verify(&path)?;
    let signed = arguments.key.as_ref().map(|key| seal::signed(&path, key)).transpose()?;
    let verdict = record.get("verdict");
    let verified = Verified {
        record: shown(&path),
        files: record.get("files").and_then(|files| files.as_array()).map_or(0, Vec::len),
        passed: verdict.and_then(|verdict| verdict.get("passed")?.as_bool()).unwrap_or(false),
        sentence: verdict.and_then(|verdict| verdict.get("sentence")?.as_str()).unwrap_or_default(),
        seal: record.get("seal").and_then(|seal| seal.as_str()).unwrap_or_default(),
        signed,
    };
    terminal::report(json, &verified, || {
        let passed = if verified.passed { "passes" } else { "does not pass" };
        let signed =
            verified.signed.as_ref().map_or_else(String::new, |states| format!("\nsigned by this key: {states}"));
        format!(
            "{}: unchanged since it was sealed, with {} files; it {passed}: {}\nseal {}{signed}",
            verified.record, verified.files, verified.sentence, verified.seal
        )
    })?;
    Ok(if verified.passed { Verdict::Yes } else { Verdict::No })
}
