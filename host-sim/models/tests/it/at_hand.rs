//! Inputs of a caller other than the command line: recordings made of values, and runs that it ends.

use std::sync::atomic::{AtomicU64, Ordering};

use host_io::Error;
use host_io::files::import::Quantity;
use host_io::files::output::size_notice;
use host_io::files::parameters::Parameters;
use host_io::files::recording::{Direction, Recording};
use host_io::progress::Watch;
use host_models::fit::{FitOptions, Settings};
use host_models::replay::memory::{MemoryChoice, RunOptions};
use host_models::replay::simulate;
use indicatif::ProgressBar;

const NAN: f64 = f64::NAN;

fn recording(time_s: &[f64], voltage_v: &[f64]) -> Result<Recording, String> {
    let columns = vec![(Quantity::Voltage, voltage_v.to_vec())];
    Recording::of_values("log", time_s.to_vec(), columns).map_err(|error| error.to_string())
}

/// Values are what a file with them is, but for its digest.
#[test]
fn values_are_a_recording() {
    let text = "time_s,voltage_v,displacement_mm\n3,0,\n4,100,0.5\n5.5,50,0.25\n";
    let file = Recording::from_csv("log".as_ref(), text.as_bytes()).expect("a recording");
    let displacement = vec![NAN, 0.5e-3, 0.25e-3];
    let columns = vec![(Quantity::Voltage, vec![0.0, 100.0, 50.0]), (Quantity::Displacement, displacement)];
    let made = Recording::of_values("log", vec![3.0, 4.0, 5.5], columns).expect("a recording");
    assert_eq!(made.time_s(), file.time_s());
    assert_eq!(made.drive().expect("a voltage"), file.drive().expect("a voltage"));
    assert_eq!(made.displacement().expect("a sensor"), file.displacement().expect("a sensor"));
    assert_eq!(made.sha256().expect("nothing is read"), None);
    assert!(file.sha256().is_err(), "there is no such file");
}

#[test]
fn values_that_no_recording_has_are_refused() {
    let refusal = |time_s: &[f64], volts: &[f64]| recording(time_s, volts).expect_err("refused");
    assert_eq!(refusal(&[0.0], &[1.0]), "log: time_s has 1 rows; a recording needs at least 2");
    assert_eq!(refusal(&[0.0, NAN], &[1.0, 2.0]), "log: time_s[1] is NaN; no clock shows that");
    assert_eq!(refusal(&[0.0, 1.0, 1.0], &[1.0; 3]), "log: time_s[2] is 1.0 after 1.0; times must increase");
    assert_eq!(refusal(&[0.0, 1.0], &[1.0]), "log: 1 values of voltage_v at 2 times");
    assert_eq!(
        refusal(&[0.0, 1.0], &[1.0, -1e16]),
        "log: voltage_v[1] is -10000000000000000; no instrument reads that"
    );
    let gap = recording(&[0.0, 1.0], &[1.0, NAN]).expect("a gap is no fault of its own");
    let fault = gap.drive().expect_err("but it cannot drive").to_string();
    assert!(fault.starts_with("log: voltage_v is empty at 1 s; what drives the film must be complete; "), "{fault}");
}

/// Ends work once so much of it is done.
struct Until(AtomicU64, u64);

impl Watch for Until {
    fn advance(&self, units: u64) -> host_io::Result<()> {
        let done = self.0.fetch_add(units, Ordering::Relaxed) + units;
        if done < self.1 { Ok(()) } else { Err(Error::Interrupted) }
    }
}

#[test]
fn a_run_ends_when_its_caller_says() {
    let parameters = Parameters::preset("table3-n2").expect("a preset");
    let recording = recording(&[0.0, 100.0], &[0.0, 1000.0]).expect("a recording");
    let (input, grid) = (recording.drive().expect("a voltage"), recording.grid(1000.0).expect("a grid"));
    let run = |memory, watch: &dyn Watch| {
        let options = RunOptions { memory, ..RunOptions::default() };
        simulate::response(&parameters, &input, grid, &options, watch)
    };
    let whole = run(MemoryChoice::Compressed, &ProgressBar::hidden()).expect("a response");
    assert_eq!(whole.displacement_m.len(), 100_001);
    // Reported at least once in 5000 samples.
    let watch = Until(AtomicU64::new(0), 30_000);
    assert!(matches!(run(MemoryChoice::Compressed, &watch), Err(Error::Interrupted)));
    assert!((30_000..35_000).contains(&watch.0.load(Ordering::Relaxed)));
    let at_once = Until(AtomicU64::new(0), 0);
    assert!(matches!(run(MemoryChoice::Full, &at_once), Err(Error::Interrupted)));
}

/// Options that are not set are those of the command line.
#[test]
fn options_have_their_defaults() {
    let options = FitOptions::default();
    assert_eq!(options.drive, Direction::Force);
    let settings = options.settings(None, None).expect("settings");
    let usual = Settings::default();
    assert_eq!((settings.seed, settings.starts), (usual.seed, usual.starts));
    assert_eq!((settings.branches, settings.topologies), (usual.branches, usual.topologies));
    assert!(settings.assumed_sizes, "no actuator was given");
}

/// A large file is announced, one that the disk has no room for is refused.
#[test]
fn large_files_are_announced() {
    assert_eq!(size_notice(400e6, Some(1 << 40)), Ok(None));
    assert_eq!(size_notice(5.7e9, Some(1 << 40)), Ok(Some("about 5.7 GB are written".into())));
    assert_eq!(size_notice(5.7e9, None), Ok(Some("about 5.7 GB are written".into())));
    let refusal = "needs about 0.4 GB, the disk has 0.1 GB; write fewer rows or to another disk";
    assert_eq!(size_notice(400e6, Some(100_000_000)), Err(refusal.into()));
    let refusal = "needs about 41.2 kB, the disk has 4.1 kB; write fewer rows or to another disk";
    assert_eq!(size_notice(41_200.0, Some(4096)), Err(refusal.into()));
}
