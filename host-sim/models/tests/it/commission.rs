//! Commissioning on the simulated bench: random sound films pass, bad benches do not, and no limit is exceeded.
//!
//! The films are integrated by equations of their own, or step with full memory, around the driver's own controller. `cargo xtask campaign
//! commission` runs all cases, and prints each.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use host_io::choice::Choice;
use host_io::files::parameters::{Board, Parameters};
use host_models::commission::simulated::{Fault, FaultKind, SimulatedBench};
use host_models::commission::verification::{Quality, Segments};
use host_models::commission::{self, Cause, Plan, Report, Row, Step};
use host_models::fit::FitOptions;
use host_models::fit::options::Branches;
use host_models::fit::settings::CurveChoice;
use host_models::simulation::film::{Film, Instruments, Plant as Which};
use host_models::simulation::plant::{FullMemoryPlant, Mismatch, NonlinearPlant, Plant};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::{Actuator, Maxwell, Springpot, Topology};

use crate::sweep::{full_sweep, sample};

/// Most substeps of a film with full memory, of 2 ms: 26 minutes.
const SUBSTEPS: usize = 765_000;

/// A film on its bench, drawn at random.
struct Case {
    film: Film,
    preset: Option<(&'static str, Mismatch)>,
    instruments: Instruments,
    plan: Plan,
    seed: u64,
}

impl Case {
    fn random(seed: u64) -> Self {
        let mut random = Pcg64::seed_from_u64(seed);
        let mut range = |low: f64, high: f64| random.random_range(low..high);
        let which = if range(0.0, 1.0) < 0.5 { Which::Hossain } else { Which::Wang };
        let film = Film::new(which).stiffened(range(0.9, 1.8)).warmed(1.0, range(0.4, 2.5));
        let mismatch = Mismatch { stiffness: range(0.7, 1.6), alpha: range(0.7, 1.0) };
        let name = ["table3-n2", "table3-n1", "table3-n3"][range(0.0, 3.0) as usize];
        let preset = (range(0.0, 1.0) < 0.4).then_some((name, mismatch));
        let instruments = Instruments {
            displacement_noise_m: range(1e-6, 6e-6),
            displacement_quantum_m: 1e-6,
            monitor_noise_v: range(1.0, 4.0),
        };
        let mut board = Board::bench(&Actuator::KARNER_2022);
        board.limits.max_displacement_m = range(1.5e-3, 8e-3) as f32;
        board.limits.max_voltage_v = range(4500.0, 6000.0) as f32;
        let mut plan = Plan { seed: seed + 17, ..Plan::new(Actuator::KARNER_2022, false, board) };
        if !full_sweep() {
            // The search over all structures takes most of the time.
            plan.fit = FitOptions {
                branches: Branches::Number(2),
                curve: CurveChoice::None,
                starts: 2,
                ..FitOptions::default()
            };
        }
        Self { film, preset, instruments, plan, seed }
    }

    fn bench(&self, faults: Vec<Fault>) -> SimulatedBench<'_> {
        let (plant, step_s): (Box<dyn Plant + '_>, f64) = match self.preset {
            Some((name, mismatch)) => {
                let parameters = Parameters::preset(name).expect("a preset");
                let plant = FullMemoryPlant::at_rest(&parameters, mismatch, 2e-3, SUBSTEPS);
                (Box::new(plant.expect("a plant")), 2e-3)
            }
            None => (Box::new(NonlinearPlant::at_rest(&self.film, 5e-4)), 5e-4),
        };
        let parameters = commission::provisional(&self.plan).expect("valid");
        SimulatedBench::new(plant, step_s, &parameters, self.instruments, faults, self.seed).expect("a bench")
    }

    /// The report on a bench with `faults`.
    fn run(&self, faults: Vec<Fault>) -> Report {
        self.run_in(tempfile::tempdir().expect("a folder").path(), faults)
    }

    fn run_in(&self, folder: &Path, faults: Vec<Fault>) -> Report {
        let mut bench = self.bench(faults);
        let never = AtomicBool::new(false);
        let report = commission::commission(&mut bench, &self.plan, folder, &never, &|_| ());
        let report = report.unwrap_or_else(|error| panic!("{}: {error}", self.seed));
        let (furthest_m, _) = bench.film();
        let largest_m = f64::from(self.plan.board.limits.max_displacement_m);
        assert!(furthest_m < 1.01 * largest_m, "{}: {furthest_m} m of {largest_m} m", self.seed);
        report
    }
}

/// Share of the segments `again` that are within the bound that was `stated`.
fn within(stated: Option<&Quality>, again: Option<&Quality>) -> Option<f64> {
    let (bound, errors) = (stated?.largest_pct, &again?.errors_pct);
    Some(errors.iter().filter(|error| **error <= bound).count() as f64 / errors.len() as f64)
}

fn printed(report: &Report) -> String {
    let quality = |quality: &Option<Quality>| {
        quality.as_ref().map_or("–".into(), |quality| {
            let [low, high] = quality.predicted_pct;
            format!("{:.2} % (worst {:.2}, predicted {low:.2} to {high:.2})", quality.rms_pct, quality.largest_pct)
        })
    };
    let causes: Vec<String> =
        report.findings.iter().map(|finding| format!("{}: {}", finding.cause.name(), finding.measured)).collect();
    format!("{:.0} s, {}, {}, {causes:?}", report.film_s, quality(&report.feedforward), quality(&report.tracking))
}

#[test]
fn sound_films_pass_and_their_bounds_hold() {
    let seeds: Vec<u64> = if full_sweep() { (0..300).collect() } else { vec![5] };
    let (mut passed, mut held) = (0, [const { Vec::new() }; 2]);
    for &seed in &seeds {
        let mut case = Case::random(seed);
        let folder = tempfile::tempdir().expect("a folder");
        let report = case.run_in(folder.path(), Vec::new());
        // References that no record has seen, on the film at rest.
        case.plan = Plan { steps: [Step::Upload, Step::Verify], seed: seed + 1_000_017, ..case.plan };
        let again = report.feedforward.as_ref().map(|_| case.run_in(folder.path(), Vec::new()));
        let film = case.preset.map_or("film", |(name, _)| name);
        let qualities = |report: &Report| [report.feedforward.clone(), report.tracking.clone()];
        let [stated, again] = [Some(&report), again.as_ref()].map(|report| report.map(qualities).unwrap_or_default());
        let others = [0, 1].map(|k| within(stated[k].as_ref(), again[k].as_ref()));
        println!("{seed} {film} {} {others:?}: {}", report.verdict.passed, printed(&report));
        passed += usize::from(report.verdict.passed);
        held.iter_mut().zip(others).for_each(|(held, share)| held.extend(share));
        // The slew limit of the bench is below that of a tone.
        let prospect = report.self_sensing.as_ref().expect("a film that moves");
        assert!(prospect.refusals[0].contains("79 kV/s"), "{seed}: {prospect:?}");
        let share = prospect.voltage_noise_v / case.instruments.monitor_noise_v;
        assert!((share - 1.0).abs() < 0.1, "{seed}: {prospect:?}");
        // At most 20 minutes, and each step of the ramp as predicted.
        assert!(report.film_s < 1200.0, "{} s", report.film_s);
        for step in report.ramp.iter().flat_map(|ramp| &ramp.steps) {
            let off_m = step.predicted_m.map_or(0.0, |predicted_m| (predicted_m - step.measured_m).abs());
            assert!(off_m < 0.05 * step.measured_m + 20e-6, "{seed}: {step:?}");
        }
    }
    let within = held.map(|shares: Vec<f64>| shares.iter().sum::<f64>() / shares.len().max(1) as f64);
    println!(
        "{passed} of {} sound films pass; within their bounds without and with the sensor: {within:?}",
        seeds.len()
    );
    assert!(20 * passed >= 19 * seeds.len(), "{passed} of {}", seeds.len());
    assert!(within.iter().all(|share| *share >= 0.95), "{within:?}");
}

/// The ramp of a sound film ends without a finding; with friction of the sensor's target it ends with that.
#[test]
fn ramps_of_sound_films_have_no_findings() {
    for seed in sample((0..300).collect(), 8) {
        let mut case = Case::random(seed);
        case.plan.steps[1] = Step::Ramp;
        let sound = case.run(Vec::new());
        assert!(sound.findings.is_empty(), "{seed}: {}", printed(&sound));
        let ramp = sound.ramp.expect("a ramp");
        let strength = 0.03 * ramp.stroke_m;
        println!("{seed} {}", ramp.peak_v);
        let stuck = case.run(vec![Fault { kind: FaultKind::Friction, strength }]);
        assert!(stuck.findings.iter().any(|found| found.cause == Cause::Friction), "{seed}: {}", printed(&stuck));
    }
}

/// Errors of segments: an offset under noise is found, noise alone is not taken for none, and a segment that was not measured has no bound. Moves that a
/// plan cannot follow become shorter, others stay.
#[test]
fn segments_show_errors_and_become_shorter() {
    let (segments, mut random) = (Segments::random(1e-3, 3e-3, 0.2, 60, 7), Pcg64::seed_from_u64(7));
    let (noise_m, off_m) = (1e-5, 4e-5);
    let mut rows = |off_m: f64| -> Vec<Row> {
        let row = |k: u32| {
            let time_s = 0.01 * f64::from(k);
            // Of this RMS.
            let displacement_m = segments.at(time_s) + off_m + noise_m * random.random_range(-1.732..1.732);
            Row { time_s, host_s: time_s, command_v: 0.0, monitor_v: 0.0, displacement_m, reference_m: 0.0 }
        };
        (0..(100.0 * segments.duration_s()) as u32).map(row).collect()
    };
    let expected_pct = 100.0 * off_m / segments.range_m;
    let mut off = rows(off_m);
    assert!(segments.errors_pct(&off, noise_m).iter().all(|pct| (pct / expected_pct - 1.0).abs() < 0.1));
    let hidden_pct = 100.0 * 0.25 * noise_m / segments.range_m;
    assert!(segments.errors_pct(&rows(0.0), noise_m).iter().all(|pct| (hidden_pct..2.0 * hidden_pct).contains(pct)));
    let at = |k: usize| (100.0 * segments.times_s[k].start) as usize + 50;
    off[at(3)].displacement_m = f64::NAN;
    off.truncate(at(58) - 60);
    let infinite: Vec<bool> = segments.errors_pct(&off, noise_m).iter().map(|pct| pct.is_infinite()).collect();
    assert_eq!(infinite, (0..60).map(|k| k == 3 || k > 57).collect::<Vec<_>>());

    assert_eq!(segments.shortened(|_| false), None);
    // The twentieth segment, at 1000 Hz.
    let limited = 10 * at(19);
    let shorter = segments.shortened(|k| k == limited).expect("shorter");
    let end = |segments: &Segments, k: usize| segments.at(segments.times_s[k].end - 1e-3);
    for k in 0..60 {
        let (before, after) = (end(&segments, k), end(&shorter, k));
        let wanted = if k == 19 { end(&segments, 18) + 0.7 * (before - end(&segments, 18)) } else { before };
        assert!((after - wanted).abs() < 1e-6, "{k}: {before} {after} {wanted}");
    }
}

/// The observer is as fast as stated on a film that allows it, slower near a resonance, and never slower than the band.
#[test]
fn a_bandwidth_is_what_a_controller_accepts() {
    let bench = Board::bench(&Actuator::KARNER_2022);
    for missing in [vec![], Board::KEYS.to_vec()] {
        accepts_what_a_controller_accepts(&Board { missing, ..bench.clone() });
    }
}

fn accepts_what_a_controller_accepts(board: &Board) {
    let accepted = |c: f64, band_hz: f64| {
        let mut film = Parameters::preset("table3-n2").expect("a preset");
        film.model = Maxwell::new(Springpot::new(c, 0.25), &[], Topology::Parallel, 0.316).expect("valid");
        let film = commission::plan::with_accepted_bandwidth(film, board, band_hz)?;
        let stated = film.board.clone().expect("a board");
        // What is written is what a controller runs.
        assert!(stated.states_control() && film.control(1000.0)?.bandwidth_hz == stated.control.bandwidth_hz);
        Ok::<f32, host_io::Error>(stated.control.bandwidth_hz)
    };
    assert_eq!(accepted(1e5, 0.2).expect("accepted"), 0.6);
    let hz = accepted(16.0, 0.2).expect("accepted");
    assert!((0.2..0.5).contains(&hz), "{hz} Hz");
    let refused = accepted(16.0, 0.59).expect_err("refused").to_string();
    assert!(refused.contains("resonance"), "{refused}");
}

/// Faults, the causes that name them, and strengths; below 0 as a share of the sound film's stroke or voltage, or as its noise.
const FAULTS: &[(FaultKind, &[Cause], &[f64])] = &[
    (FaultKind::SensorSign, &[Cause::SensorSign], &[1.0]),
    (FaultKind::SensorScale, &[Cause::SensorScale], &[0.5, 0.9, 1.05, 2.0, 25.4]),
    (FaultKind::MonitorGain, &[Cause::MonitorGain], &[0.9, 0.95, 1.04, 1.1]),
    (FaultKind::Lag, &[Cause::Lag], &[0.03, 0.1, 0.5]),
    (FaultKind::SensorDelay, &[Cause::Lag, Cause::Frozen], &[0.1, 0.2, 0.3]),
    (FaultKind::Resonance, &[Cause::Resonance], &[0.3, 0.5, 0.8, 1.2]),
    (FaultKind::Slip, &[Cause::Slip], &[0.02, 0.05, 0.2]),
    (FaultKind::Leak, &[Cause::Leak], &[0.03, 0.1, 0.3]),
    (FaultKind::Arc, &[Cause::Arc], &[0.02, 0.2, 2.0]),
    (FaultKind::DropOuts, &[Cause::DropOuts], &[0.001, 0.01, 0.1]),
    (FaultKind::Saturation, &[Cause::Saturation, Cause::Frozen], &[-0.3, -0.6, -0.8, -0.9]),
    (FaultKind::AmplifierEnd, &[Cause::Saturation], &[-0.5, -0.8, -0.95]),
    (FaultKind::LittleStroke, &[Cause::LittleStroke], &[-8.0, -20.0]),
    (FaultKind::Clock, &[Cause::Clock], &[0.01, 0.03, 0.1]),
    // Not among those that issue a passing record at any strength, but as strong as here they must not.
    (FaultKind::Drift, &[Cause::Drift], &[1e-6, 5e-6]),
    (FaultKind::Friction, &[Cause::Friction], &[-0.03, -0.1]),
    (FaultKind::Softening, &[Cause::Unexplained], &[0.3]),
    (FaultKind::Hum, &[Cause::LittleStroke], &[-0.03, -0.1]),
    (FaultKind::Shaking, &[Cause::Slip, Cause::SelfTest], &[-0.03, -0.1, -0.3]),
    (FaultKind::Contact, &[Cause::Slip, Cause::Arc], &[0.03, 0.1, 1.0]),
];

/// Faults that are weak, or look like another one: the amplifier's shows in an error of the voltages that were commanded in advance.
#[test]
fn what_was_found_is_named_by_its_cause() {
    for (kind, strength, cause, words) in [
        (FaultKind::MonitorOffset, 30.0, Cause::MonitorGain, "+30 V at every voltage"),
        (FaultKind::AmplifierGain, 0.982, Cause::MonitorGain, "differs from the command by -1.8 %"),
    ] {
        let report = Case::random(1003).run(vec![Fault { kind, strength }]);
        let first = &report.findings[0];
        let is_named = first.cause == cause && first.measured.contains(words);
        assert!(is_named && !report.verdict.passed, "{}: {}", kind.name(), printed(&report));
    }
}

#[test]
fn bad_benches_do_not_pass() {
    let all: Vec<(FaultKind, &[Cause], f64)> = FAULTS
        .iter()
        .flat_map(|(kind, causes, strengths)| strengths.iter().map(|strength| (*kind, *causes, *strength)))
        .collect();
    let cases = sample((0..300_usize).collect(), 8);
    let (mut passed, mut misnamed) = (Vec::new(), Vec::new());
    for &k in &cases {
        // In the sample one of each kind comes after the other.
        let (kind, causes, strength) = all[k % all.len()];
        let case = Case::random(1000 + k as u64);
        let mut sound = Case::random(1000 + k as u64);
        sound.plan.steps[1] = Step::Ramp;
        let ramp = sound.run(Vec::new()).ramp.expect("a ramp");
        let strength = match kind {
            _ if strength > 0.0 => strength,
            FaultKind::Saturation | FaultKind::Friction | FaultKind::Hum | FaultKind::Shaking => {
                -strength * ramp.stroke_m
            }
            FaultKind::AmplifierEnd => -strength * ramp.peak_v,
            // A film that moves less is driven up to the largest voltage.
            _ => {
                let load = (f64::from(case.plan.board.limits.max_voltage_v) / ramp.peak_v).powi(2);
                load * ramp.stroke_m / (-strength * ramp.noise_m)
            }
        };
        let report = case.run(vec![Fault { kind, strength }]);
        let line = format!("{k} {}={strength:.3e}: {}", kind.name(), printed(&report));
        println!("{line}");
        if report.verdict.passed {
            passed.push(line.clone());
        }
        if !report.findings.iter().any(|finding| causes.contains(&finding.cause)) {
            misnamed.push(line);
        }
    }
    println!(
        "{} bad benches, {} with a passing record, {} with another cause",
        cases.len(),
        passed.len(),
        misnamed.len()
    );
    assert!(passed.is_empty(), "{passed:#?}");
    assert!(5 * misnamed.len() <= cases.len(), "{misnamed:#?}");
}

/// Ended at any moment of the excitation or of the verification: 0 V, and no report; what was measured until then is on the disk.
#[test]
fn a_sitting_that_is_ended_ends_at_0_v() {
    let count = if full_sweep() { 1000 } else { 10 };
    let mut random = Pcg64::seed_from_u64(3);
    let mut case = Case { preset: None, ..Case::random(8) };
    case.plan.steps[1] = Step::Fit;
    let (begun, never) = (tempfile::tempdir().expect("a folder"), AtomicBool::new(false));
    commission::commission(&mut case.bench(Vec::new()), &case.plan, begun.path(), &never, &|_| ()).expect("fitted");
    let mut kept = 0;
    for k in 0..count {
        let (folder, stop) = (tempfile::tempdir().expect("a folder"), AtomicBool::new(false));
        // The verification begins with a rest.
        let (steps, file, rest_s) = match k % 2 {
            0 => ([Step::SelfTest, Step::Excite], commission::RECORDING, 0.0),
            _ => ([Step::Upload, Step::Verify], commission::VERIFICATION, case.plan.rest_s),
        };
        case.plan.steps = steps;
        if k % 2 == 1 {
            for entry in std::fs::read_dir(begun.path()).expect("a folder") {
                let entry = entry.expect("a file");
                std::fs::copy(entry.path(), folder.path().join(entry.file_name())).expect("copied");
            }
        }
        let rows = random.random_range(0..38_000);
        let mut bench = Ended { bench: case.bench(Vec::new()), left: rows, stop: &stop };
        let report = commission::commission(&mut bench, &case.plan, folder.path(), &stop, &|_| ());
        assert!(matches!(report, Err(host_io::Error::Interrupted)), "{file}, {rows} rows: {report:?}");
        assert!(bench.bench.film().1.abs() < 1.0, "{} V", bench.bench.film().1);
        assert!(!folder.path().join(file).exists());
        if let Ok(part) = std::fs::read_to_string(folder.path().join(format!("{file}.part"))) {
            let lines = part.lines().count() + (rest_s * commission::bench::ROWS_HZ) as usize;
            assert!(lines > rows, "{lines} lines of {rows} rows");
            kept += 1;
        }
    }
    assert!(2 * kept > count, "{kept} of {count}");
}

/// A bench at which Ctrl-C comes after so many rows.
struct Ended<'a> {
    bench: SimulatedBench<'a>,
    left: usize,
    stop: &'a AtomicBool,
}

impl commission::Bench for Ended<'_> {
    fn name(&self) -> String {
        self.bench.name()
    }

    fn firmware(&self) -> String {
        self.bench.firmware()
    }

    fn self_test(&mut self) -> host_io::Result<Vec<commission::Check>> {
        self.bench.self_test()
    }

    fn install(&mut self, parameters: &Parameters, keep: bool) -> host_io::Result<u32> {
        self.bench.install(parameters, keep)
    }

    fn restore(&mut self) -> host_io::Result<()> {
        self.bench.restore()
    }

    fn run(
        &mut self,
        mode: commission::Mode,
        pilot: &mut commission::bench::Pilot<'_>,
    ) -> host_io::Result<Option<String>> {
        let Self { bench, left, stop } = self;
        bench.run(mode, &mut |row| {
            stop.store(*left == 0, Ordering::Relaxed);
            *left = left.saturating_sub(1);
            pilot(row)
        })
    }

    fn gauge(&mut self, displacement_m: f64) -> Option<f64> {
        self.bench.gauge(displacement_m)
    }
}
