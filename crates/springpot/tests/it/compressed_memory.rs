//! The compressed memory against the exact answer with full memory.

use rayon::prelude::*;
use springpot::{Compressed, Law, LawError, LawOptions, Maxwell, Window};

use crate::support::full_memory::FullMemory;
use crate::support::models::{hard_models, paper_force, presets, random_models};
use crate::support::{relative_rms, sample};

const SECONDS: f64 = 155.0;
const FREQUENCY_HZ: f64 = 1.0 / 7.0;

/// Relative RMS error of the default law over 155 s at 1/7 Hz, and the tail error that its constructor reported.
fn errors(models: &[(String, Maxwell)], rate_hz: f64) -> Vec<(f64, f64)> {
    let force = paper_force(FREQUENCY_HZ, SECONDS, rate_hz);
    let full = FullMemory::new(force.len(), 1.0 / rate_hz);
    models
        .par_iter()
        .map(|(name, model)| {
            let law = Law::<f64>::compressed(model, LawOptions::at_step(1.0 / rate_hz))
                .unwrap_or_else(|e| panic!("{name} at {rate_hz} Hz: {e}"));
            let mut state = law.state();
            let x: Vec<f64> = force.iter().map(|&f| law.displacement(&mut state, f)).collect();
            (relative_rms(&x, &full.displacement(model, &force)), law.memory().tail_error())
        })
        .collect()
}

#[test]
fn follows_full_memory_to_1e_7_at_every_rate() {
    let all = || presets().into_iter().chain(random_models(2022, 200)).chain(hard_models()).collect();
    for (rate_hz, count) in [(100.0, 60), (1000.0, 24), (5000.0, 4)] {
        let models: Vec<_> = sample(all(), count);
        let errors = errors(&models, rate_hz);
        let mut sorted = errors.clone();
        sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
        println!(
            "{rate_hz} Hz, {} laws, 12 + 36 numbers, 24 h: relative RMS error median {:.1e}, largest {:.1e}; \
             tail error largest {:.1e}",
            sorted.len(),
            sorted[sorted.len() / 2].0,
            sorted[sorted.len() - 1].0,
            errors.iter().map(|e| e.1).fold(0.0, f64::max),
        );
        for ((name, _), (error, _)) in models.iter().zip(errors) {
            assert!(error <= 1e-7, "{name} at {rate_hz} Hz: {error:.1e}");
        }
    }
}

/// The textbooks' short memory loses it.
#[test]
fn a_plain_window_loses_the_creep() {
    let rate_hz = 100.0;
    let force = paper_force(FREQUENCY_HZ, SECONDS, rate_hz);
    let full = FullMemory::new(force.len(), 1.0 / rate_hz);
    println!("{:24}{:>12}{:>12}{:>12}{:>14}", "relative RMS error of", "window 1 s", "10 s", "50 s", "compressed");
    for (name, model) in presets() {
        let exact = full.displacement(&model, &force);
        let window = |seconds: f64| {
            let length = (seconds * rate_hz) as usize;
            let law = Law::window(&model, 1.0 / rate_hz, vec![0.0; length]).expect("valid");
            let law: Law<f64, Window<f64, Vec<f64>>> = law;
            let mut state = law.state(vec![0.0; length]).expect("same length");
            let x: Vec<f64> = force.iter().map(|&f| law.displacement(&mut state, f)).collect();
            relative_rms(&x, &exact)
        };
        let [short, middle, long] = [1.0, 10.0, 50.0].map(window);
        let compressed = errors(&[(name.clone(), model.clone())], rate_hz)[0].0;
        println!("{name:24}{short:>12.2}{middle:>12.2}{long:>12.2}{compressed:>14.1e}");
        if name.starts_with("table3") {
            // Measured on other code: 135 %, 74 % and 20 % for α = 0.2, whatever the weak branches.
            assert!((1.0..1.6).contains(&short) && (0.5..0.9).contains(&middle) && (0.1..0.3).contains(&long));
        }
        assert!(long > 1e5 * compressed, "{name}");
    }
}

/// A window as long as the run forgets nothing, so it must be exact: the other memory as a check on the reference.
#[test]
fn a_window_as_long_as_the_run_is_exact() {
    let rate_hz = 20.0;
    let force = paper_force(FREQUENCY_HZ, 60.0, rate_hz);
    let full = FullMemory::new(force.len(), 1.0 / rate_hz);
    for (name, model) in presets() {
        let law: Law<f64, Window<f64, Vec<f64>>> =
            Law::window(&model, 1.0 / rate_hz, vec![0.0; force.len()]).expect("valid");
        let mut state = law.state(vec![0.0; force.len()]).expect("same length");
        let x: Vec<f64> = force.iter().map(|&f| law.displacement(&mut state, f)).collect();
        let error = relative_rms(&x, &full.displacement(&model, &force));
        assert!(error < 1e-10, "{name}: {error:.1e}");
    }
}

/// A memory of 26 numbers.
type Lean<T> = Compressed<T, 8, 14, 4>;

/// The lean memory on the controller's arithmetic holds 1e-4 over its hour, in both directions.
#[test]
fn a_lean_memory_holds_1e_4_over_an_hour() {
    const RATE_HZ: usize = 1000;
    let period = &paper_force(FREQUENCY_HZ, 7.0, RATE_HZ as f64)[..7 * RATE_HZ];
    let (creep, relaxation) = sample(presets(), 2)
        .par_iter()
        .map(|(name, model)| {
            let exact = Law::<f64>::compressed(model, LawOptions::at_step(1e-3)).expect("valid");
            let options = LawOptions::at_step(1e-3).with_horizon(3600.0).with_tolerance(1e-4);
            let lean = Law::<f32, Lean<f32>>::compressed(model, options).expect("within 1e-4");
            let mut forwards = (exact.state(), lean.state());
            let mut backwards = (exact.state(), lean.state());
            let (mut x, mut f) = ((Vec::new(), Vec::new()), (Vec::new(), Vec::new()));
            for &force in period.iter().cycle().take(3600 * RATE_HZ) {
                x.0.push(exact.displacement(&mut forwards.0, force));
                x.1.push(f64::from(lean.displacement(&mut forwards.1, force as f32)));
                let path = 1e-5 * force;
                f.0.push(exact.force(&mut backwards.0, path));
                f.1.push(f64::from(lean.force(&mut backwards.1, path as f32)));
            }
            let (creep, relaxation) = (relative_rms(&x.1, &x.0), relative_rms(&f.1, &f.0));
            assert!(creep <= 1e-4 && relaxation <= 1e-4, "{name}: creep {creep:.1e}, relaxation {relaxation:.1e}");
            (creep, relaxation)
        })
        .reduce(|| (0.0, 0.0), |a, b| (f64::max(a.0, b.0), f64::max(a.1, b.1)));
    println!("8 + 18 numbers in f32, 1 h at 1 kHz: largest error of creep {creep:.1e}, of relaxation {relaxation:.1e}");
}

/// The leanest memory, of plain sums: 1e-4 over 155 s, forwards in f32, which is what it is for. The compensated one above
/// holds longer, and backwards.
#[test]
fn the_leanest_memory_holds_1e_4_over_155_s_forwards() {
    let options = LawOptions::at_step(1e-3).with_horizon(155.0).with_tolerance(1e-3);
    let force = paper_force(1.0 / 7.0, 155.0, 1000.0);
    let full = FullMemory::new(force.len(), 1e-3);
    let errors: Vec<(f64, f64)> = sample(presets(), 6)
        .par_iter()
        .map(|(_, model)| {
            let lean = Law::<f32, Compressed<f32, 8, 16, 0>>::compressed(model, options).expect("within 1e-3");
            let mut film = lean.state();
            let x: Vec<f64> = force.iter().map(|&f| f64::from(lean.displacement(&mut film, f as f32))).collect();
            let exact = full.displacement(model, &force);
            let mut film = lean.state();
            let back: Vec<f64> = exact.iter().map(|&x| f64::from(lean.force(&mut film, x as f32))).collect();
            (relative_rms(&x, &exact), relative_rms(&back, &force))
        })
        .collect();
    let largest = |of: fn(&(f64, f64)) -> f64| errors.iter().map(of).fold(0.0, f64::max);
    let (forwards, backwards) = (largest(|e| e.0), largest(|e| e.1));
    println!("8 + 16 over 155 s in f32: {forwards:.1e} forwards, {backwards:.1e} backwards");
    assert!(forwards <= 1e-4 && backwards <= 1e-3);
}

/// A law that misses its tolerance is refused, and the error states what it would reach.
#[test]
fn a_tolerance_that_is_missed_is_refused() {
    let (_, model) = presets().swap_remove(2);
    let options = LawOptions::at_step(1e-3).with_tolerance(1e-7);
    let refused = Law::<f64, Lean<f64>>::compressed(&model, options);
    assert!(matches!(refused, Err(LawError::ToleranceMissed { reached, asked }) if reached > asked && asked == 1e-7));
}
