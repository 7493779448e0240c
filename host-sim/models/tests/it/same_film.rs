//! The same film is found wherever the sensor was zeroed, whichever way it counts, however late it is, and in any order of recordings.

use std::f64::consts::{PI, TAU};
use std::fmt::Write;
use std::path::Path;
use std::sync::LazyLock;

use host_io::files::parameters::Parameters;
use host_io::files::recording::{Direction, Recording};
use host_io::grid::Grid;
use host_models::fit::options::Branches;
use host_models::fit::{Fit, FitOptions};
use host_models::references::minimum_jerk;
use host_models::replay::feedforward;
use host_models::replay::memory::{MemoryChoice, RunOptions};
use indicatif::ProgressBar;
use springpot::{Actuator, CommandLimits, Maxwell, Springpot, Topology};

use crate::recorded::{fitted_to, moved_m, noise, recording};
use crate::sweep::full_sweep;

pub(crate) const ACTUATOR: Actuator = Actuator {
    length_m: 0.02,
    width_m: 0.03,
    thickness_m: 100e-6,
    mass_kg: 0.1,
    stretch_coupling: 20.0,
    ..Actuator::KARNER_2022
};

/// One springpot and a branch, 1 mm at 3.5 kV.
fn film() -> Parameters {
    let branch = [Springpot::new(2e3, 0.05), Springpot::new(4e3, 0.9)];
    let model = Maxwell::new(Springpot::new(8.5e3, 0.12), &[branch], Topology::Parallel, 0.1).expect("valid");
    Parameters { model, actuator: ACTUATOR, ..Parameters::preset("table3-n1").expect("there") }
}

/// Displacement (m) of `film` at 1 kHz under `voltage_v`.
fn displacement_m(film: &Parameters, voltage_v: Vec<f64>) -> Vec<f64> {
    moved_m(film, voltage_v, 1000.0, MemoryChoice::Compressed)
}

const HZ: [f64; 3] = [0.4, 0.15, 0.08];

/// Time (s), voltage (V) and displacement (m).
type Rows = Vec<[f64; 3]>;

/// Rows of a sine of `hz` at 100 Hz with 4 µm of noise, `late_ms` behind the film.
fn sine(hz: f64, late_ms: usize, seed: u64) -> Rows {
    let mut noise = noise(seed, 4e-6);
    let volts: Vec<f64> = (0..30_000).map(|k| 1750.0 * (1.0 - (TAU * hz * 1e-3 * f64::from(k)).cos())).collect();
    let film = displacement_m(&film(), volts.clone());
    let row = |k: usize| {
        let read = if k < late_ms { 0.0 } else { film[k - late_ms] };
        [1e-3 * k as f64, volts[k], read + noise()]
    };
    (0..film.len()).step_by(10).map(row).collect()
}

fn rows(late_ms: usize) -> [Rows; 3] {
    HZ.map(|hz| sine(hz, late_ms, (1e3 * hz) as u64))
}

fn recordings(rows: &[Rows]) -> Vec<Recording> {
    HZ.iter().zip(rows).map(|(hz, rows)| recording(&format!("{hz}.csv"), rows)).collect()
}

fn options() -> FitOptions {
    FitOptions { branches: Branches::Number(1), starts: 4, ..FitOptions::default() }
}

fn fitted(recordings: &[Recording], options: &FitOptions) -> Fit {
    fitted_to(recordings, options, Actuator { stretch_coupling: 0.0, ..ACTUATOR }).expect("a fit").0
}

/// The fit to the film as it is, made once.
fn plain() -> &'static Fit {
    static PLAIN: LazyLock<Fit> = LazyLock::new(|| fitted(&recordings(&rows(0)), &options()));
    &PLAIN
}

/// The values of a film, without the sensor.
fn values(fit: &Fit) -> Vec<f64> {
    let candidate = &fit.candidate;
    let elements = candidate.elements.iter().flat_map(|element| [element.c, element.alpha]);
    let curve = candidate.bend.curve().expect("a curve").map_or(0.0, |curve| curve.value(1e-3));
    let volts = candidate.actuator.saturation_v.unwrap_or(0.0);
    elements.chain([candidate.actuator.stretch_coupling, curve, volts]).collect()
}

/// Rounding moves where a search ends within a hundredth of the intervals.
#[test]
fn wherever_the_sensor_is_zeroed_and_whichever_way_it_counts() {
    let rows = rows(0);
    let plain = plain();
    println!("{:?} {:?}", plain.candidate, plain.warnings);
    let same = |what: &str, recordings: &[Recording], options: &FitOptions, offset_m: f64| {
        let fit = fitted(recordings, options);
        for (value, expected) in values(&fit).into_iter().zip(values(plain)) {
            assert!((value - expected).abs() <= 1e-5 * expected.abs(), "{what}: {value} for {expected}");
        }
        let moved_m = fit.candidate.offset_m - plain.candidate.offset_m - offset_m;
        assert!(moved_m.abs() < 1e-9, "{what}: an offset that is {moved_m} m off");
    };
    let read = |of: &dyn Fn(f64) -> f64| {
        recordings(&rows.each_ref().map(|rows| rows.iter().map(|&[t, v, x]| [t, v, of(x)]).collect()))
    };
    for offset_m in [-35e-3, -1e-3, 35e-3] {
        same(&format!("{offset_m} m"), &read(&|x| x + offset_m), &options(), offset_m);
    }
    same("turned", &read(&|x| -x), &FitOptions { invert: true, ..options() }, 0.0);
    let mut reversed = recordings(&rows);
    reversed.reverse();
    same("reversed", &reversed, &options(), 0.0);
    let written = |(hz, rows): (&f64, &Rows)| {
        let mut csv = "time_s,voltage_kv,displacement_mm\n".to_owned();
        for &[t, v, x] in rows {
            writeln!(csv, "{:?},{:?},{:?}", 100.0 + t, 1e-3 * v, 1e3 * x).expect("memory");
        }
        Recording::from_csv(Path::new(&format!("{hz}.csv")), csv.as_bytes()).expect("valid")
    };
    let written: Vec<_> = HZ.iter().zip(&rows).map(written).collect();
    same("mm and kV on a clock from 100 s", &written, &options(), 0.0);
}

/// Feedforward error (RMS, % of peak to peak) of `fit` on the film.
fn feedforward_pct(fit: &Fit) -> f64 {
    let settings = options().settings(None, Some((ACTUATOR, false))).expect("settings");
    let parameters = fit.parameters(&settings, Direction::Force, &[]).expect("a file");
    let at = |k: i32| {
        let t = 1e-3 * f64::from(k);
        minimum_jerk(t / 2.0) * (0.5e-3 + 0.3e-3 * (TAU * 0.3 * t).sin())
    };
    let wanted: Vec<f64> = (0..=20_000).map(at).collect();
    let grid = Grid { rate_hz: 1000.0, samples: wanted.len() };
    let (options, bar) = (RunOptions::default(), ProgressBar::hidden());
    let plan = feedforward::plan(&parameters, &wanted, grid, &options, CommandLimits::BENCH, &bar).expect("a plan");
    let square: f64 = displacement_m(&film(), plan.voltage_v).iter().zip(&wanted).map(|(x, r)| (x - r).powi(2)).sum();
    100.0 * (square / wanted.len() as f64).sqrt() / 0.6e-3
}

#[test]
fn however_late_the_sensor_is() {
    let prompt = plain();
    assert_eq!(prompt.candidate.delay_s, 0.0);
    let lags: &[usize] = if full_sweep() { &[60, 100] } else { &[100] };
    for &late_ms in lags {
        let late = recordings(&rows(late_ms));
        let delay_s = 1e-3 * late_ms as f64;
        let fit = fitted(&late, &options());
        let [straight, lagged] = [prompt, &fit].map(feedforward_pct);
        println!("{late_ms} ms: {:?}, feedforward {straight:.3} and {lagged:.3} %", fit.candidate);
        let uncertainty = fit.uncertainty.as_ref().expect("computed");
        let estimate = uncertainty.estimates.iter().find(|e| e.name == "delay_s").expect("estimated");
        // The model's own steps of 10 ms are some tenths of a millisecond off.
        assert!((estimate.value - delay_s).abs() < 1e-3 && estimate.low < estimate.high, "{estimate:?}");
        let warnings: Vec<_> = fit.warnings.iter().filter(|warning| warning.contains("lags")).collect();
        let [value, low, high] = [Some(estimate.value), estimate.low, estimate.high].map(|s| 1e3 * s.expect("known"));
        let stated = format!("{value:.1} ms ({low:.1} to {high:.1} ms)");
        assert!(matches!(warnings.as_slice(), [warning] if warning.contains(&stated)), "{warnings:?}");
        assert!(lagged <= 1.1 * straight + 0.01, "{lagged} % for {straight} %");
        let fixed = fitted(&late, &FitOptions { sensor_delay_s: Some(delay_s), ..options() });
        assert_eq!(fixed.candidate.delay_s, delay_s);
        assert!(fixed.r2_mean > 0.9999 && fixed.warnings.iter().all(|warning| !warning.contains("lags")));
        let ignored = fitted(&late, &FitOptions { sensor_delay_s: Some(0.0), ..options() });
        assert!(ignored.r2_mean < fit.r2_mean);
    }
}

/// A file with the delay is what was fitted, and where a controller and a replay take it from.
#[test]
fn the_delay_is_in_the_file() {
    let parameters = Parameters { sensor_delay_s: 0.021, ..film() };
    let again = Parameters::from_toml(Path::new("film.toml"), &parameters.to_toml()).expect("valid");
    assert_eq!(again.sensor_delay_s, 0.021);
    assert_eq!(again.board_or_bench(1000.0).control.delay_s, 0.021);
    again.checked_blob(1000.0).expect("a controller takes it");
    let error = Parameters::from_toml(
        Path::new("film.toml"),
        &parameters.to_toml().replace("delay_s = 0.021", "delay_s = 20.0"),
    );
    assert!(error.expect_err("20 s").to_string().contains("delay_s"));
}

/// Displacement (m) of a springpot of order 0.12 under a force 1 − cos ωt in closed form, t s after rest: the fractional integral of the constant,
/// and of the cosine its steady state and the integral along the branch cut.
fn springpot_m(hz: f64, t: f64) -> f64 {
    const ALPHA: f64 = 0.12;
    /// Γ(1 + α).
    const GAMMA: f64 = 0.943_590_185_613_903_5;
    if t == 0.0 {
        return 0.0;
    }
    let omega = TAU * hz;
    // The trapezoidal rule in ln r converges exponentially.
    let step = 0.1;
    let cut: f64 = (-300..200)
        .map(|i| {
            let r = omega * (step * f64::from(i)).exp();
            step * r.powf(2.0 - ALPHA) / (r * r + omega * omega) * (-r * t).exp()
        })
        .sum();
    let cut = (PI * ALPHA).sin() / PI * cut;
    let steady = omega.powf(-ALPHA) * (omega * t - 0.5 * PI * ALPHA).cos();
    let force_n = ACTUATOR.force_per_square_volt() * 0.5 * 3500f64.powi(2);
    // Half of it, its mean, times 1 − cos.
    force_n * (t.powf(ALPHA) / GAMMA - steady + cut) / 8.5e3
}

/// The film that is one springpot needs neither branch nor curve to explain the steps of the model, whatever the rate of the rows; its numbers are
/// those of the springpot, not of its steps.
#[test]
fn one_springpot_is_found_as_one() {
    for every_ms in [10, 100] {
        let rows = |hz: f64| {
            let mut noise = noise((1e3 * hz) as u64, 2e-6);
            let row = |k: i32| {
                let t = 1e-3 * f64::from(k);
                [t, 3500.0 * (0.5 * TAU * hz * t).sin().abs(), springpot_m(hz, t) + noise()]
            };
            (0..60_000).step_by(every_ms).map(row).collect()
        };
        let recordings = recordings(&HZ.map(rows));
        let actuator = Actuator { mass_kg: 0.0, stretch_coupling: 0.0, ..ACTUATOR };
        let (fit, ..) = fitted_to(&recordings, &FitOptions::default(), actuator).expect("a fit");
        println!("{every_ms} ms: {:?} {:?} {:#?}", fit.candidate, fit.structures, fit.warnings);
        assert_eq!((fit.candidate.branches(), fit.candidate.bend.name().as_str()), (0, "linear"));
        assert_eq!(fit.candidate.actuator.saturation_v, None);
        let Springpot { c, alpha } = fit.candidate.elements[0];
        println!("{alpha} {c}");
        assert!((alpha - 0.12).abs() < 1e-4 && (c / 8.5e3 - 1.0).abs() < 1e-3, "{every_ms} ms: {c} {alpha}");
    }
}
