//! Commissioning: from an unknown film to one that follows, with a record.
//!
//! [`commission`] runs the [`Step`]s on a [`Bench`], each of which reads what the steps before it left in a folder. It ends at the first step
//! that finds a fault, which it names ([`diagnosis`]).

pub mod bench;
pub mod diagnosis;
pub mod plan;
pub mod ramp;
pub mod report;
pub mod simulated;
pub mod verification;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use host_io::choice::Choice;
use indicatif::ProgressBar;

use crate::error::{Error, Result};
use crate::excitation::profile::PartShape;
use crate::files::journal::Journal;
use crate::files::output;
use crate::files::parameters::Parameters;
use crate::files::recording::{Direction, Input, Recording};
use crate::fit;
use crate::fit::capacitance::Prospect;
use crate::grid::{Grid, Samples};
use crate::progress::Stage;
use crate::replay::expectation::Recorded;
use crate::replay::feedforward;
use crate::replay::memory::RunOptions;
pub use bench::{Bench, Check, Mode, Row};
pub use diagnosis::{Cause, Finding};
pub use plan::{Plan, Step, provisional};
use ramp::{Limits, Ramp};
pub use report::{FitRow, Report, Verdict};
use verification::{Quality, Segments};

/// How often the segments that a plan cannot follow are shortened.
const MAX_SHORTENED: usize = 12;

/// Names of the files in the folder.
pub const RAMP: &str = "ramp.json";
/// The recording that is fitted.
pub const RECORDING: &str = "recording.csv";
/// The parameters.
pub const FILM: &str = "film.toml";
/// The runs of the verification.
pub const VERIFICATION: &str = "verification.csv";

/// Commissions the film on `bench` as planned; files are in `folder`. `progress` is called as each begins.
///
/// # Errors
///
/// [`Error`] where the bench does not answer, a file cannot be read or written, or `stop` ended it. What is wrong with the film or the bench is
/// in the report.
pub fn commission(
    bench: &mut dyn Bench,
    plan: &Plan,
    folder: &Path,
    stop: &AtomicBool,
    progress: &dyn Fn(&Stage),
) -> Result<Report> {
    let limits = Limits::new(&plan.actuator, &plan.board);
    let report = Report { bench: bench.name(), firmware: bench.firmware(), limits, ..Report::default() };
    let mut course = Course {
        bench,
        plan,
        folder,
        stop,
        progress,
        report,
        stage: Stage::default(),
        growing: None,
        rows: Vec::new(),
        parameters: None,
    };
    let ended = course.steps();
    if plan.dry_run || course.report.checksum.is_none() {
        // Without any of its own a controller has nothing to return to.
        let restored = course.bench.restore();
        ended?;
        if plan.dry_run {
            restored?;
        }
    } else {
        ended?;
    }
    course.report.judge(plan);
    Ok(course.report)
}

struct Course<'a> {
    bench: &'a mut dyn Bench,
    plan: &'a Plan,
    folder: &'a Path,
    stop: &'a AtomicBool,
    progress: &'a dyn Fn(&Stage),
    report: Report,
    /// The step that it is at, with the work of the sitting in s.
    stage: Stage,
    /// The file that what is measured goes to.
    growing: Option<Growing>,
    /// Everything that was measured, with the displacement as the controller of that time had it.
    rows: Vec<Row>,
    parameters: Option<Parameters>,
}

impl Course<'_> {
    fn steps(&mut self) -> Result<()> {
        if self.plan.steps[0] <= Step::Excite {
            self.bench.install(&provisional(self.plan)?, false)?;
        }
        let planned = |step| if self.plan.has(step) { self.plan.expected_s(step) } else { 0 };
        let expected_s: Vec<u64> = Step::CHOICES.iter().map(|(step, ..)| planned(*step)).collect();
        for (number, (step, name, help)) in Step::CHOICES.iter().enumerate() {
            if !self.plan.has(*step) {
                continue;
            }
            self.stage = Stage {
                what: format!("{name}: {}", help.trim()),
                count: Some((number + 1, Step::CHOICES.len())),
                work: (expected_s[..number].iter().sum(), expected_s.iter().sum()),
            };
            (self.progress)(&self.stage);
            self.report.steps.push(name);
            match step {
                Step::SelfTest => self.self_test()?,
                Step::Ramp => self.ramp()?,
                Step::Excite => self.excite()?,
                Step::Fit => self.fit()?,
                Step::Upload => self.upload()?,
                Step::Verify => self.verify()?,
            }
            if !self.report.findings.is_empty() {
                break;
            }
        }
        Ok(())
    }

    fn file(&mut self, name: &str) -> PathBuf {
        let path = self.folder.join(name);
        self.report.files.push(path.clone());
        path
    }

    /// Runs, keeps the rows, and writes them as they come; a trip is a finding.
    fn run(&mut self, mode: Mode, pilot: &mut dyn FnMut(&Row) -> Option<f64>) -> Result<Vec<Row>> {
        let mut rows = Vec::new();
        let mut written = Ok(());
        let Self { bench, growing, stage, stop, progress, .. } = self;
        let (before_s, all_s) = stage.work;
        let tripped = bench.run(mode, &mut |row| {
            rows.push(*row);
            if let Some(growing) = growing
                && let Err(error) = growing.push(row)
            {
                written = Err(error);
                return None;
            }
            if rows.len().is_multiple_of(bench::ROWS_HZ as usize) {
                stage.work.0 = (before_s + rows.len() as u64 / bench::ROWS_HZ as u64).min(all_s);
                progress(stage);
            }
            if stop.load(Ordering::Relaxed) { None } else { pilot(row) }
        })?;
        written?;
        if self.stop.load(Ordering::Relaxed) {
            return Err(Error::Interrupted);
        }
        let trip = tripped.map(|trip| diagnosis::of_trip(&trip, &rows));
        let (Some(first), Some(last)) = (rows.first(), rows.last()) else {
            self.report.findings.extend(trip);
            return Ok(rows);
        };
        self.report.film_s = last.time_s - self.rows.first().map_or(first.time_s, |row| row.time_s);
        self.report.findings.extend(diagnosis::of_rows(&rows));
        self.report.findings.extend(diagnosis::of_clock(last.time_s - first.time_s, last.host_s - first.host_s));
        self.rows.extend(&rows);
        // What the rows show is nearer to the cause.
        self.report.findings.extend(trip);
        Ok(rows)
    }

    fn self_test(&mut self) -> Result<()> {
        self.report.self_test = self.bench.self_test()?;
        for check in self.report.self_test.iter().filter(|check| !check.passed) {
            let measured = format!("{}: {}, wanted {}", check.what, check.found, check.wanted);
            let cause = match check.what.as_str() {
                "monitor" => Cause::MonitorGain,
                _ if check.found.starts_with("tripped") => diagnosis::of_trip(&check.found, &[]).cause,
                _ => Cause::SelfTest,
            };
            self.report.findings.push(Finding::new(cause, measured));
        }
        let true_m = 0.25 * self.report.limits.stroke_m;
        self.report.gauge_m = self.plan.gauge_m.or_else(|| Some([true_m, self.bench.gauge(true_m)?]));
        self.report.findings.extend(self.report.gauge_m.and_then(diagnosis::of_gauge));
        Ok(())
    }

    fn ramp(&mut self) -> Result<()> {
        let mut ramp = Ramp::new(self.report.limits);
        let rows = self.run(Mode::Voltage, &mut |row| ramp.next(row))?;
        let report = ramp.report();
        // What an arc or a lost sensor leaves looks like other causes.
        let is_first = |finding: &Finding| matches!(finding.cause, Cause::Arc | Cause::DropOuts);
        let (mut found, rest): (Vec<_>, Vec<_>) = self.report.findings.drain(..).partition(is_first);
        found.extend(diagnosis::of_ramp(&rows, &report, self.plan.band_hz));
        let is_alone = found.is_empty();
        // A trip follows from what was found.
        found.extend(rest.into_iter().filter(|finding| finding.cause == Cause::Clock || is_alone));
        self.report.findings = found;
        let path = self.file(RAMP);
        let text = serde_json::to_string(&report).map_err(|e| Error::file(&path, e))?;
        output::write_whole(&path, |file| file.write_all(text.as_bytes()))?;
        self.report.ramp = Some(report);
        Ok(())
    }

    /// The ramp of this run, or of an earlier one.
    fn ramped(&mut self) -> Result<ramp::Report> {
        if let Some(ramp) = &self.report.ramp {
            return Ok(ramp.clone());
        }
        let path = self.file(RAMP);
        let text = std::fs::read_to_string(&path).map_err(|e| Error::file(&path, e))?;
        let ramp: ramp::Report = serde_json::from_str(&text).map_err(|e| Error::file(&path, e))?;
        self.report.ramp = Some(ramp.clone());
        Ok(ramp)
    }

    fn excite(&mut self) -> Result<()> {
        let ramp = self.ramped()?;
        let profile = self.plan.excitation(ramp.peak_v.floor())?;
        let grid = Grid::covering(profile.duration_s(), bench::ROWS_HZ)?;
        let voltage_v = profile.on(grid);
        let (mut k, mut scale) = (0, 1.0);
        let largest_m = 0.95 * self.report.limits.stroke_m;
        let path = self.file(RECORDING);
        let mut growing = Growing::begin(&path, false)?;
        self.rows.iter().try_for_each(|row| growing.push(row))?;
        self.growing = Some(growing);
        let rows = self.run(Mode::Voltage, &mut |row| {
            // More creep than was predicted: with less voltage from here on.
            if row.displacement_m.abs() > largest_m {
                scale *= 0.998;
            }
            k += 1;
            voltage_v.get(k).map(|volts| scale * volts)
        })?;
        self.grown()?;
        if self.report.findings.is_empty() {
            self.report.findings.extend(diagnosis::of_jumps(&rows, ramp.noise_m));
            self.report.findings.extend(diagnosis::of_recording(Recording::read(&path)?));
        }
        let hold = profile.parts.iter().find(|part| matches!(part.shape, PartShape::Hold { .. }));
        if let (Some(part), Some(first)) = (hold, rows.first())
            && let PartShape::Hold { ramp_s, .. } = part.shape
        {
            let held = (part.from_s + ramp_s + 1.0)..(part.to_s - ramp_s - 0.5);
            let rows = rows.iter().filter(|row| held.contains(&(row.time_s - first.time_s)));
            self.report.picture[0] =
                rows.map(|row| [row.time_s - first.time_s - held.start, row.displacement_m, f64::NAN]).collect();
        }
        Ok(())
    }

    /// Gives the file that grows its name.
    fn grown(&mut self) -> Result<()> {
        self.growing.take().map_or(Ok(()), |growing| growing.journal.finish())
    }

    fn fit(&mut self) -> Result<()> {
        let path = if self.plan.has(Step::Excite) { self.folder.join(RECORDING) } else { self.file(RECORDING) };
        let recording = Recording::read(&path)?;
        let options = &self.plan.fit;
        let settings = options.settings(None, Some((self.plan.actuator, self.plan.assumed_sizes)))?;
        let (observations, _): (Vec<_>, Vec<_>) = options.observations(&[&recording])?.into_iter().unzip();
        let furthest_s = AtomicU64::new(0);
        let fit = fit::fit(&observations, &settings, self.stop, &|part| {
            let (done, all) = part.work;
            let done_s = self.plan.expected_s(Step::Fit) * done.min(all) / all.max(1);
            // Parts of a part begin anew.
            let done_s = furthest_s.fetch_max(done_s, Ordering::Relaxed).max(done_s);
            let work = (self.stage.work.0 + done_s, self.stage.work.1);
            (self.progress)(&Stage { what: format!("fit: {}", part.what), work, ..self.stage.clone() });
        })?;
        if self.stop.load(Ordering::Relaxed) {
            return Err(Error::Interrupted);
        }
        let mut parameters = fit.parameters(&settings, Direction::Force, &[&recording])?;
        parameters.name = "commissioned".into();
        let recorded = Recorded::from_parameters(&parameters);
        let stroke_m = recorded.as_ref().map_or(f64::NAN, |recorded| recorded.stroke_m[1] - recorded.stroke_m[0]);
        let board = &self.plan.board;
        if let Ok(Input::Voltage(monitor)) = recording.drive() {
            let (step_s, monitor_v) = (1.0 / verification::RATE_HZ, &monitor.value);
            self.report.self_sensing = Prospect::new(&self.plan.actuator, board, stroke_m, step_s, monitor_v);
        }
        self.report.fit = Some(FitRow {
            branches: fit.candidate.branches(),
            r2: fit.r2_mean,
            misfit_pct: recorded.map_or(f64::NAN, |recorded| 100.0 * recorded.misfit_m / stroke_m),
            bandwidth_hz: board.control.bandwidth_hz,
            warnings: fit.warnings.clone(),
        });
        let late_s = parameters.sensor_delay_s - f64::from(board.control.delay_s);
        if late_s > diagnosis::MAX_LAG_S {
            let measured = format!("the sensor is {:.0} ms later than stated, by the fit", 1e3 * late_s);
            self.report.findings.push(Finding::new(Cause::Lag, measured));
        }
        let parameters = match plan::with_accepted_bandwidth(parameters, board, self.plan.band_hz) {
            Ok(parameters) => parameters,
            Err(refused) => {
                let measured = format!("a controller refuses the model: {refused}");
                self.report.findings.push(Finding::new(Cause::Limits, measured));
                return Ok(());
            }
        };
        if let (Some(fit), Some(board)) = (&mut self.report.fit, &parameters.board) {
            fit.bandwidth_hz = board.control.bandwidth_hz;
        }
        let path = self.file(FILM);
        output::write_whole(&path, |file| file.write_all(parameters.to_toml().as_bytes()))
    }

    /// The parameters as they were written.
    fn parameters(&mut self) -> Result<Parameters> {
        if self.parameters.is_none() {
            let path = if self.plan.has(Step::Fit) { self.folder.join(FILM) } else { self.file(FILM) };
            self.parameters = Some(Parameters::read(&path)?);
        }
        self.parameters.clone().ok_or(Error::Interrupted)
    }

    fn upload(&mut self) -> Result<()> {
        let parameters = self.parameters()?;
        self.report.checksum = Some(self.bench.install(&parameters, !self.plan.dry_run)?);
        Ok(())
    }

    fn verify(&mut self) -> Result<()> {
        let parameters = self.parameters()?;
        let ramp = self.ramped()?;
        if !self.plan.has(Step::Upload) {
            self.report.checksum = Some(self.bench.install(&parameters, false)?);
        }
        let recorded = Recorded::from_parameters(&parameters)
            .ok_or_else(|| Error::Computation("the parameters have no record of their fit; fit again".into()))?;
        let top_m = recorded.stroke_m[1].min(0.9 * self.report.limits.stroke_m);
        self.rest(self.plan.rest_s)?;
        let limits = self.plan.board.command_limits();
        let options = RunOptions::default();
        let (history_v, hidden) = (self.history(), ProgressBar::hidden());
        let Plan { band_hz, segments, seed, .. } = *self.plan;
        let mut segments = Segments::random(0.25 * top_m, 0.8 * top_m, band_hz, segments, seed);
        let grid = Grid { rate_hz: verification::RATE_HZ, samples: segments.reference_m.len() };
        let plan = |segments: &Segments| {
            feedforward::plan_after(&parameters, &history_v, &segments.reference_m, grid, &options, limits, &hidden)
        };
        let mut planned = plan(&segments)?;
        // A film that still creeps does not come down to all of them.
        for _ in 0..MAX_SHORTENED {
            let Some(shorter) = segments.shortened(|k| !planned.limited[k].is_none()) else { break };
            planned = plan(&shorter)?;
            segments = shorter;
        }
        let planned_v = planned.voltage_v;
        // The way back to 0 V is in no segment.
        let samples = (segments.times_s[segments.times_s.len() - 1].end * verification::RATE_HZ) as usize;
        let (within, grid) = (&segments.reference_m[..samples], Grid { samples, ..grid });
        let all_v = [&history_v, &planned_v[..samples]].concat();
        let expected = recorded.expectation(&parameters, within, grid, segments.range_m, all_v);

        let path = self.file(VERIFICATION);
        self.growing = Some(Growing::begin(&path, true)?);
        let mut from_s = None;
        let end_s = segments.duration_s();
        let feedforward = self.run(Mode::Voltage, &mut |row| {
            let t = row.time_s - *from_s.get_or_insert(row.time_s) + 1.0 / bench::ROWS_HZ;
            (t < end_s).then(|| planned_v[((t * verification::RATE_HZ) as usize).min(planned_v.len() - 1)])
        })?;
        self.rest(0.5 * self.plan.rest_s)?;
        if !self.report.findings.is_empty() {
            return self.grown();
        }
        let mut from_s = None;
        let tracking = self.run(Mode::Tracking, &mut |row| {
            let t = row.time_s - *from_s.get_or_insert(row.time_s) + 1.0 / bench::ROWS_HZ;
            (t < end_s).then(|| segments.at(t))
        })?;
        self.grown()?;
        let sum = |value: fn(&Row) -> f64| feedforward.iter().map(value).sum::<f64>();
        self.report.monitor_error = Some(sum(|row| row.monitor_v) / sum(|row| row.command_v) - 1.0);
        let quality = |rows: &[Row], predicted| Quality::new(segments.errors_pct(rows, ramp.noise_m), predicted);
        // Noise hides a part of all errors, and moves a film that is tracked.
        let [low, high] = expected.feedforward_error_pct;
        let noise_pct = 100.0 * ramp.noise_m / segments.range_m;
        self.report.feedforward = Some(quality(&feedforward, [low, high.hypot(verification::HIDDEN * noise_pct)]));
        // A run that was ended has no quality.
        let has_ended = !self.report.findings.is_empty();
        self.report.tracking = (!has_ended).then(|| quality(&tracking, [0.0, high.hypot(noise_pct)]));
        if let (Some(first), [begin, .., end]) = (tracking.first(), segments.times_s.as_slice()) {
            let row = |row: &Row| {
                let t = row.time_s - first.time_s;
                (begin.start..end.end).contains(&t).then(|| [t, row.displacement_m, segments.at(t)])
            };
            self.report.picture[1] = tracking.iter().filter_map(row).collect();
        }
        Ok(())
    }

    /// The voltage so far, a thousand values a second.
    fn history(&self) -> Vec<f64> {
        let (mut samples, mut last_s) = (Samples::default(), None);
        let first_s = self.rows.first().map_or(0.0, |row| row.time_s);
        for row in &self.rows {
            let t = row.time_s - first_s;
            samples.time_s.extend(missing(last_s, t));
            samples.value.resize(samples.time_s.len(), 0.0);
            samples.time_s.push(t);
            samples.value.push(row.monitor_v);
            last_s = Some(t);
        }
        let until_s = last_s.unwrap_or(0.0);
        samples.at((0..(until_s * verification::RATE_HZ) as usize).map(|k| k as f64 / verification::RATE_HZ))
    }

    fn rest(&mut self, length_s: f64) -> Result<()> {
        let mut from_s = None;
        self.run(Mode::Voltage, &mut |row| (row.time_s - *from_s.get_or_insert(row.time_s) < length_s).then_some(0.0))?;
        Ok(())
    }
}

/// Times at which rows are missing before `t`, s, where the film is at 0 V between two runs.
fn missing(last_s: Option<f64>, t: f64) -> impl Iterator<Item = f64> {
    let last_s = last_s.filter(|last_s| t - last_s > 5.0 / bench::ROWS_HZ).unwrap_or(t);
    (1..((t - last_s) * bench::ROWS_HZ) as usize).map(move |k| last_s + k as f64 / bench::ROWS_HZ)
}

/// A file of what is measured, which is on the disk as it comes.
struct Growing {
    journal: Journal,
    has_reference: bool,
    first_s: Option<f64>,
    last_s: Option<f64>,
}

impl Growing {
    fn begin(path: &Path, has_reference: bool) -> Result<Self> {
        let columns = ["time_s", "voltage_v", "displacement_m", "reference_m"];
        let journal = Journal::begin_and_report(path, &columns[..3 + usize::from(has_reference)])?;
        Ok(Self { journal, has_reference, first_s: None, last_s: None })
    }

    fn push(&mut self, row: &Row) -> Result<()> {
        let t = row.time_s - *self.first_s.get_or_insert(row.time_s);
        let cells = 3 + usize::from(self.has_reference);
        for between_s in missing(self.last_s.replace(t), t) {
            self.journal.push(&[between_s, 0.0, f64::NAN, f64::NAN][..cells])?;
        }
        self.journal.push(&[t, row.monitor_v, row.displacement_m, row.reference_m][..cells])?;
        self.journal.flush_if_due()
    }
}
