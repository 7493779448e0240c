//! Commissioning: from an unknown film to one that follows, with a record.
//!
//! [`commission`] runs the [`Step`]s on a [`Bench`], each of which reads what the steps before it left in a folder. It ends at the first step
//! that finds a fault, which it names ([`diagnosis`]).

pub mod bench;
pub mod diagnosis;
pub mod ramp;
pub mod simulated;
pub mod verification;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use host_io::choice;
use host_io::choice::Choice;
use indicatif::ProgressBar;
use serde::Serialize;
use springpot::{Actuator, Maxwell, Springpot, Topology};

use crate::error::{Error, Result};
use crate::excitation::profile::{PartShape, Profile, ProfileOptions};
use crate::files::output;
use crate::files::parameters::{Board, Parameters};
use crate::files::recording::{Direction, Recording};
use crate::fit::{self, FitOptions};
use crate::grid::Grid;
use crate::progress::Stage;
use crate::replay::expectation::Recorded;
use crate::replay::feedforward;
use crate::replay::memory::RunOptions;
pub use bench::{Bench, Check, Mode, Row};
pub use diagnosis::{Cause, Finding};
use ramp::{Limits, Ramp};
use verification::{MIN_SEGMENTS, Quality, Segments};

choice! {
    /// A step of commissioning.
    #[derive(PartialOrd, Ord)]
    pub enum Step {
        /// The self-test of the bench, and the gauge.
        SelfTest = "self-test",
        /// A ramp in small steps, each predicted before it is taken.
        Ramp = "ramp",
        /// The excitation within what the ramp found.
        Excite = "excite",
        /// The fit, with the prediction of its own error.
        Fit = "fit",
        /// Upload, read back, compared.
        Upload = "upload",
        /// Random segments that the fit has not seen.
        Verify = "verify",
    }
}

/// The work to do.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// The film.
    pub actuator: Actuator,
    /// Whether its sizes are assumed.
    pub assumed_sizes: bool,
    /// Its bench.
    pub board: Board,
    /// The first and the last step.
    pub steps: [Step; 2],
    /// Highest frequency of the use, Hz.
    pub band_hz: f64,
    /// Length of the hold in the excitation, s, and cycles of each sine.
    pub hold_s: f64,
    /// Cycles of each sine.
    pub cycles: u32,
    /// Rest before the verification, s.
    pub rest_s: f64,
    /// Segments of the verification.
    pub segments: usize,
    /// Largest error of a segment that passes, without and with the sensor, %.
    pub allowed_pct: [f64; 2],
    /// A gauge, and how the sensor reads it, m; none where the bench has its own or none is at hand.
    pub gauge_m: Option<[f64; 2]>,
    /// How the recording is fitted.
    pub fit: FitOptions,
    /// Whether the controller returns to its old parameters at the end.
    pub dry_run: bool,
    /// Seed of the segments.
    pub seed: u64,
}

impl Plan {
    /// All steps for `actuator` on `board`.
    pub fn new(actuator: Actuator, assumed_sizes: bool, board: Board) -> Self {
        Self {
            actuator,
            assumed_sizes,
            board,
            steps: [Step::SelfTest, Step::Verify],
            band_hz: 0.2,
            hold_s: 90.0,
            cycles: 5,
            rest_s: 60.0,
            segments: 60,
            allowed_pct: [10.0, 5.0],
            gauge_m: None,
            fit: FitOptions::default(),
            dry_run: false,
            seed: 1,
        }
    }

    /// Whether `step` is to be done.
    pub fn has(&self, step: Step) -> bool {
        (self.steps[0]..=self.steps[1]).contains(&step)
    }
}

/// The verdict.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Verdict {
    /// Whether the film follows, as far as all steps show.
    pub passed: bool,
    /// In one sentence.
    pub sentence: String,
    /// The next thing to do.
    pub next: String,
}

/// Creep with and without compensation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Creep {
    /// Growth of the stroke under a constant voltage, % of it.
    pub without_pct: f64,
    /// Growth of the error while tracking, from the first to the last third, % of the range.
    pub with_pct: f64,
}

/// The result.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// The verdict.
    pub verdict: Verdict,
    /// Faults, that of most weight first.
    pub findings: Vec<Finding>,
    /// Where the bench is, and its firmware.
    pub bench: String,
    /// Firmware of its controller.
    pub firmware: String,
    /// Limits of film and bench.
    pub limits: Limits,
    /// Steps that were done.
    pub steps: Vec<&'static str>,
    /// The self-test.
    pub self_test: Vec<Check>,
    /// A gauge, and how the sensor read it, m.
    pub gauge_m: Option<[f64; 2]>,
    /// The ramp.
    pub ramp: Option<ramp::Report>,
    /// Largest error of feedforward along the excitation and R², by the fit.
    pub fit: Option<FitRow>,
    /// Checksum of the parameters that were read back.
    pub checksum: Option<u32>,
    /// The film without the sensor.
    pub feedforward: Option<Quality>,
    /// The film with it.
    pub tracking: Option<Quality>,
    /// Creep.
    pub creep: Option<Creep>,
    /// Time of the film, s.
    pub film_s: f64,
    /// Files that were read or written, in their order.
    #[serde(skip)]
    pub files: Vec<PathBuf>,
    /// Rows of the hold and of the tracking, for the picture: time (s), displacement and reference (m).
    #[serde(skip)]
    pub picture: [Vec<[f64; 3]>; 2],
}

/// A fit in the record.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FitRow {
    /// Name of its topology, and number of branches.
    pub branches: usize,
    /// R².
    pub r2: f64,
    /// Part of the stroke that it leaves, without noise, %.
    pub misfit_pct: f64,
    /// Its warnings.
    pub warnings: Vec<String>,
}

/// Names of the files in the folder.
pub const RAMP: &str = "ramp.json";
/// The recording that is fitted.
pub const RECORDING: &str = "recording.csv";
/// The parameters.
pub const FILM: &str = "film.toml";
/// The runs of the verification.
pub const VERIFICATION: &str = "verification.csv";

/// A film stiffer than any that the limits allow, with which a controller plays voltages to a film that is not known yet.
///
/// # Errors
///
/// [`Error`] for an actuator or limits that no model has.
pub fn provisional(plan: &Plan) -> Result<Parameters> {
    let limits = &plan.board.limits;
    let largest_n = plan.actuator.electrostatic_force(limits.max_voltage_v.into());
    let stiffness = 20.0 * largest_n / f64::from(limits.max_displacement_m);
    let mut parameters = Parameters::preset("table3-n2")?;
    parameters.name = "not known yet".into();
    parameters.actuator = Actuator { stretch_coupling: 0.0, saturation_v: None, ..plan.actuator };
    parameters.model = Maxwell::new(Springpot::new(stiffness, 0.02), &[], Topology::Parallel, plan.actuator.mass_kg)?;
    parameters.assumed_sizes = plan.assumed_sizes;
    parameters.board = Some(plan.board.clone());
    Ok(parameters)
}

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
    let report = Report {
        verdict: Verdict { passed: false, sentence: String::new(), next: String::new() },
        findings: Vec::new(),
        bench: bench.name(),
        firmware: bench.firmware(),
        limits,
        steps: Vec::new(),
        self_test: Vec::new(),
        gauge_m: None,
        ramp: None,
        fit: None,
        checksum: None,
        feedforward: None,
        tracking: None,
        creep: None,
        film_s: 0.0,
        files: Vec::new(),
        picture: [Vec::new(), Vec::new()],
    };
    let mut course = Course { bench, plan, folder, stop, progress, report, rows: Vec::new(), parameters: None };
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
    course.judge();
    Ok(course.report)
}

/// Commissioning on its way.
struct Course<'a> {
    bench: &'a mut dyn Bench,
    plan: &'a Plan,
    folder: &'a Path,
    stop: &'a AtomicBool,
    progress: &'a dyn Fn(&Stage),
    report: Report,
    /// Everything that was measured, with the displacement as the controller of that time had it.
    rows: Vec<Row>,
    parameters: Option<Parameters>,
}

impl Course<'_> {
    fn steps(&mut self) -> Result<()> {
        if self.plan.steps[0] <= Step::Excite {
            self.bench.install(&provisional(self.plan)?, false)?;
        }
        for (number, (step, name, help)) in Step::CHOICES.iter().enumerate() {
            if !self.plan.has(*step) {
                continue;
            }
            (self.progress)(&Stage::numbered(format!("{name}: {}", help.trim()), number + 1, Step::CHOICES.len()));
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

    /// Runs, and keeps the rows; a trip is a finding.
    fn run(&mut self, mode: Mode, pilot: &mut dyn FnMut(&Row) -> Option<f64>) -> Result<Vec<Row>> {
        let mut rows = Vec::new();
        let tripped = self.bench.run(mode, &mut |row| {
            rows.push(*row);
            if self.stop.load(Ordering::Relaxed) { None } else { pilot(row) }
        })?;
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
        let board_limits = self.plan.board.command_limits();
        let options = ProfileOptions {
            peak_v: ramp.peak_v.floor(),
            frequencies_hz: [1.0, 0.7, 0.385].map(|share| share * self.plan.band_hz).to_vec(),
            cycles: self.plan.cycles,
            hold_s: self.plan.hold_s,
            rest_s: 5.0,
        };
        let profile = Profile::new(&options, &board_limits, self.report.limits.thickness_m)?;
        let grid = Grid::covering(profile.duration_s(), bench::ROWS_HZ)?;
        let voltage_v = profile.on(grid);
        let (mut k, mut scale) = (0, 1.0);
        let largest_m = 0.95 * self.report.limits.stroke_m;
        let rows = self.run(Mode::Voltage, &mut |row| {
            // More creep than was predicted: with less voltage from here on.
            if row.displacement_m.abs() > largest_m {
                scale *= 0.998;
            }
            k += 1;
            voltage_v.get(k).map(|volts| scale * volts)
        })?;
        let path = self.file(RECORDING);
        let first_s = self.rows.first().map_or(0.0, |row| row.time_s);
        let (time_s, voltage_v) = self.driven();
        let mut measured = self.rows.iter().peekable();
        let mut reading_m = |t: &f64| {
            let row = measured.next_if(|row| row.time_s - first_s <= t + 1e-6);
            row.map_or(f64::NAN, |row| row.displacement_m)
        };
        let displacement_m: Vec<f64> = time_s.iter().map(&mut reading_m).collect();
        output::write_columns(
            &path,
            &[
                ("time_s", Some(time_s.as_slice())),
                ("voltage_v", Some(&voltage_v)),
                ("displacement_m", Some(&displacement_m)),
            ],
        )?;
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

    /// Times from the first row on, and the voltages there: 0 V between two runs.
    fn driven(&self) -> (Vec<f64>, Vec<f64>) {
        let first_s = self.rows.first().map_or(0.0, |row| row.time_s);
        let (mut time_s, mut voltage_v): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
        for row in &self.rows {
            let t = row.time_s - first_s;
            let last = time_s.last().copied().filter(|last| t - last > 5.0 / bench::ROWS_HZ);
            let rows = last.map_or(0, |last| ((t - last) * bench::ROWS_HZ) as usize);
            time_s.extend((1..rows).map(|k| last.unwrap_or(0.0) + k as f64 / bench::ROWS_HZ));
            voltage_v.resize(time_s.len(), 0.0);
            time_s.push(t);
            voltage_v.push(row.monitor_v);
        }
        (time_s, voltage_v)
    }

    fn fit(&mut self) -> Result<()> {
        let path = if self.plan.has(Step::Excite) { self.folder.join(RECORDING) } else { self.file(RECORDING) };
        let recording = Recording::read(&path)?;
        let options = &self.plan.fit;
        let settings = options.settings(None, Some((self.plan.actuator, self.plan.assumed_sizes)))?;
        let (observations, _): (Vec<_>, Vec<_>) = options.observations(&[&recording])?.into_iter().unzip();
        let fit = fit::fit(&observations, &settings, self.stop, self.progress)?;
        if self.stop.load(Ordering::Relaxed) {
            return Err(Error::Interrupted);
        }
        let mut parameters = fit.parameters(&settings, Direction::Force, &[&recording])?;
        parameters.name = "commissioned".into();
        let recorded = Recorded::from_parameters(&parameters);
        let stroke_m = recorded.as_ref().map_or(f64::NAN, |recorded| recorded.stroke_m[1] - recorded.stroke_m[0]);
        self.report.fit = Some(FitRow {
            branches: fit.candidate.branches(),
            r2: fit.r2_mean,
            misfit_pct: recorded.map_or(f64::NAN, |recorded| 100.0 * recorded.misfit_m / stroke_m),
            warnings: fit.warnings.iter().map(ToString::to_string).collect(),
        });
        let board = &mut self.plan.board.clone();
        let late_s = parameters.sensor_delay_s - f64::from(board.control.delay_s);
        if late_s > diagnosis::MAX_LAG_S {
            let measured = format!("the sensor is {:.0} ms later than stated, by the fit", 1e3 * late_s);
            self.report.findings.push(Finding::new(Cause::Lag, measured));
        }
        parameters.board = Some(board.clone());
        if let Err(refused) = parameters.checked_blob(verification::RATE_HZ) {
            self.report
                .findings
                .push(Finding::new(Cause::Limits, format!("a controller refuses the model: {refused}")));
            return Ok(());
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
        // As low as the creep of the higher ones allows.
        let mut found = None;
        for low in [0.25, 0.35, 0.45, 0.55, 0.65] {
            let Plan { band_hz, segments, seed, .. } = *self.plan;
            let segments = Segments::random(low * top_m, 0.8 * top_m, band_hz, segments, seed);
            let grid = Grid { rate_hz: verification::RATE_HZ, samples: segments.reference_m.len() };
            let plan_after = |history: &[f64]| {
                feedforward::plan_after(&parameters, history, &segments.reference_m, grid, &options, limits, &hidden)
            };
            let (from_rest, planned) = (plan_after(&[])?, plan_after(&history_v)?);
            let tick = |time_s: f64| (time_s * verification::RATE_HZ) as usize;
            let within = tick(segments.times_s[0].start)..tick(segments.times_s[segments.times_s.len() - 1].end);
            let is_free = planned.limited[within].iter().all(|limited| limited.is_none());
            found = Some((segments, grid, from_rest.voltage_v, planned.voltage_v));
            if is_free {
                break;
            }
        }
        let Some((segments, grid, from_rest_v, planned_v)) = found else { return Ok(()) };
        // The way back to 0 V is in no segment.
        let samples = (segments.times_s[segments.times_s.len() - 1].end * verification::RATE_HZ) as usize;
        let (within, grid) = (&segments.reference_m[..samples], Grid { samples, ..grid });
        let from_rest_v = from_rest_v[..samples].to_vec();
        let expected = recorded.expectation(&parameters, within, grid, segments.range_m, from_rest_v);
        let predicted_pct = expected.feedforward_error_pct;

        let mut from_s = None;
        let end_s = segments.duration_s();
        let feedforward = self.run(Mode::Voltage, &mut |row| {
            let t = row.time_s - *from_s.get_or_insert(row.time_s) + 1.0 / bench::ROWS_HZ;
            (t < end_s).then(|| planned_v[((t * verification::RATE_HZ) as usize).min(planned_v.len() - 1)])
        })?;
        self.rest(0.5 * self.plan.rest_s)?;
        if !self.report.findings.is_empty() {
            return Ok(());
        }
        let mut from_s = None;
        let tracking = self.run(Mode::Tracking, &mut |row| {
            let t = row.time_s - *from_s.get_or_insert(row.time_s) + 1.0 / bench::ROWS_HZ;
            (t < end_s).then(|| segments.at(t))
        })?;
        let path = self.file(VERIFICATION);
        let all: Vec<Row> = feedforward.iter().chain(&tracking).copied().collect();
        let column = |value: &dyn Fn(&Row) -> f64| all.iter().map(value).collect::<Vec<f64>>();
        output::write_columns(
            &path,
            &[
                ("time_s", Some(&column(&|row| row.time_s))),
                ("voltage_v", Some(&column(&|row| row.monitor_v))),
                ("displacement_m", Some(&column(&|row| row.displacement_m))),
                ("reference_m", Some(&column(&|row| row.reference_m))),
            ],
        )?;
        let quality = |rows: &[Row], predicted| Quality::new(segments.errors_pct(rows, ramp.noise_m), predicted);
        self.report.feedforward = Some(quality(&feedforward, predicted_pct));
        self.report.tracking = Some(quality(&tracking, [0.0, predicted_pct[1]]));
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
        let (time_s, value) = self.driven();
        let until_s = time_s.last().copied().unwrap_or(0.0);
        let samples = crate::grid::Samples { time_s, value };
        samples.at((0..(until_s * verification::RATE_HZ) as usize).map(|k| k as f64 / verification::RATE_HZ))
    }

    fn rest(&mut self, length_s: f64) -> Result<()> {
        let mut from_s = None;
        self.run(Mode::Voltage, &mut |row| (row.time_s - *from_s.get_or_insert(row.time_s) < length_s).then_some(0.0))?;
        Ok(())
    }

    /// The verdict on what was found.
    fn judge(&mut self) {
        let report = &mut self.report;
        if let [hold, tracked] = &report.picture
            && let (Some(first), Some(last)) = (hold.first(), hold.last())
            && tracked.len() > 300
        {
            let error = |rows: &[[f64; 3]]| rows.iter().map(|row| row[1] - row[2]).sum::<f64>() / rows.len() as f64;
            let third = tracked.len() / 3;
            let range = tracked.iter().fold((f64::MAX, f64::MIN), |(l, h), row| (l.min(row[2]), h.max(row[2])));
            let drift = error(&tracked[2 * third..]) - error(&tracked[..third]);
            report.creep = Some(Creep {
                without_pct: 100.0 * (last[1] - first[1]) / first[1],
                with_pct: 100.0 * drift.abs() / (range.1 - range.0),
            });
        }
        for (quality, allowed_pct, how) in [
            (&report.feedforward, self.plan.allowed_pct[0], "without the sensor"),
            (&report.tracking, self.plan.allowed_pct[1], "with the sensor"),
        ] {
            let Some(quality) = quality else { continue };
            if quality.largest_pct > allowed_pct {
                let measured =
                    format!("{:.1} % RMS in the worst segment {how}, {allowed_pct} % are allowed", quality.largest_pct);
                report.findings.push(Finding::new(Cause::Error, measured));
            } else if quality.rms_pct > quality.predicted_pct[1].max(0.3) {
                let measured = format!(
                    "{:.2} % RMS {how}, predicted were at most {:.2} %: the film or the bench is not what was fitted",
                    quality.rms_pct, quality.predicted_pct[1]
                );
                report.findings.push(Finding::new(Cause::Unexplained, measured));
            }
        }
        let (passed, sentence, next) = match (report.findings.first(), &report.feedforward, &report.tracking) {
            (Some(finding), ..) => (
                false,
                format!("not commissioned: {} ({})", finding.cause.name(), finding.measured),
                finding.advice.into(),
            ),
            (None, Some(open), Some(closed)) => {
                let creep = report.creep.map_or_else(String::new, |creep| {
                    format!("; creep removed: {:.1} → {:.1} %", creep.without_pct, creep.with_pct)
                });
                let sentence = format!(
                    "follows within {:.1} % RMS, {:.1} % without the sensor{creep}",
                    closed.largest_pct, open.largest_pct
                );
                let missing = [
                    (report.steps.len() < Step::CHOICES.len(), "run all steps at once for a record that passes"),
                    (
                        open.segments.min(closed.segments) < MIN_SEGMENTS,
                        "verify with at least 59 segments for a record that passes",
                    ),
                    (report.gauge_m.is_none(), "check the sensor with a gauge for a record that passes"),
                ];
                match missing.iter().find(|(is_missing, _)| *is_missing) {
                    Some((_, what)) => (false, sentence, (*what).into()),
                    None => (true, sentence, "play references within the stroke and the band of this record".into()),
                }
            }
            (None, ..) => (false, format!("done: {}", report.steps.join(", ")), "go on with the next step".into()),
        };
        report.verdict = Verdict { passed, sentence, next };
    }
}
