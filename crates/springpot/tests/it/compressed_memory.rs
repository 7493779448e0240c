//! The compressed memory against the exact answer with full memory.

use rayon::prelude::*;
use springpot::{Compressed, Discretisation, Law, LawOptions, Maxwell, Window};

use crate::support::full_memory::FullMemory;
use crate::support::models::{paper_force, presets};
use crate::support::{METHODS, all_models, creep, largest, law_by, relative_rms, relaxation, sample};

const SECONDS: f64 = 155.0;
const FREQUENCY_HZ: f64 = 1.0 / 7.0;

/// Errors of the default law over 155 s at 1/7 Hz.
struct Errors {
    /// Relative RMS of creep, and of relaxation along the exact displacement.
    creep: f64,
    relaxation: f64,
    /// As the law's constructor reported it.
    tail: f64,
}

fn errors(models: &[(String, Maxwell)], rate_hz: f64, method: Discretisation) -> Vec<Errors> {
    let force = paper_force(FREQUENCY_HZ, SECONDS, rate_hz);
    let new = if method == Discretisation::Gl { FullMemory::new } else { FullMemory::of_second_order };
    let full = new(force.len(), 1.0 / rate_hz);
    let of = |(_, model): &(String, Maxwell)| {
        let law = law_by::<f64>(model, rate_hz, method);
        let exact = full.displacement(model, &force);
        Errors {
            creep: relative_rms(&creep(&law, force.iter().copied()), &exact),
            relaxation: relative_rms(&relaxation(&law, exact), &force),
            tail: law.memory().tail_error(),
        }
    };
    models.par_iter().map(of).collect()
}

/// The memory compresses the second-order discretisation as well as the first-order one, forwards and backwards.
#[test]
fn follows_full_memory_to_1e_7_at_every_rate() {
    for (rate_hz, count) in [(100.0, 60), (1000.0, 20), (5000.0, 4)] {
        let models: Vec<_> = sample(all_models(200), count);
        let [gl, bdf2] = METHODS.map(|method| errors(&models, rate_hz, method));
        for (method, errors) in METHODS.into_iter().zip([&gl, &bdf2]) {
            let mut sorted: Vec<f64> = errors.iter().map(|e| e.creep).collect();
            sorted.sort_by(f64::total_cmp);
            println!(
                "{method:?} at {rate_hz} Hz, {} laws, 12 + 36 numbers, 24 h: relative RMS error median {:.1e}, largest {:.1e}, \
                 inverse {:.1e}; tail error largest {:.1e}",
                sorted.len(),
                sorted[sorted.len() / 2],
                sorted[sorted.len() - 1],
                largest(errors.iter().map(|e| e.relaxation)),
                largest(errors.iter().map(|e| e.tail)),
            );
        }
        for (((name, _), gl), bdf2) in models.iter().zip(&gl).zip(&bdf2) {
            assert!(gl.creep <= 1e-7, "{name} at {rate_hz} Hz: {:.1e}", gl.creep);
            // 1e-9 is what both promise at the least, and near what is left of the exact answer itself.
            for (gl, bdf2) in [(gl.creep, bdf2.creep), (gl.relaxation, bdf2.relaxation)] {
                assert!(bdf2 <= 1.1 * gl + 1e-9, "{name} at {rate_hz} Hz: {bdf2:.1e}, GL {gl:.1e}");
            }
        }
    }
}

/// Displacements of the law with a window of `length` steps.
fn by_window(model: &Maxwell, rate_hz: f64, length: usize, force: &[f64]) -> Vec<f64> {
    let law: Law<f64, Window<f64, Vec<f64>>> = Law::window(model, 1.0 / rate_hz, vec![0.0; length]).expect("valid");
    let mut state = law.state(vec![0.0; length]).expect("same length");
    force.iter().map(|&f| law.displacement(&mut state, f)).collect()
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
        let window =
            |seconds: f64| relative_rms(&by_window(&model, rate_hz, (seconds * rate_hz) as usize, &force), &exact);
        let [short, middle, long] = [1.0, 10.0, 50.0].map(window);
        let compressed = errors(&[(name.clone(), model.clone())], rate_hz, Discretisation::Gl)[0].creep;
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
        let x = by_window(&model, rate_hz, force.len(), &force);
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
            let force = || period.iter().copied().cycle().take(3600 * RATE_HZ);
            let path = || force().map(|force| 1e-5 * force);
            let creep = relative_rms(&creep(&lean, force()), &creep(&exact, force()));
            let relaxation = relative_rms(&relaxation(&lean, path()), &relaxation(&exact, path()));
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
            let exact = full.displacement(model, &force);
            let x = creep(&lean, force.iter().copied());
            let back = relaxation(&lean, exact.iter().copied());
            (relative_rms(&x, &exact), relative_rms(&back, &force))
        })
        .collect();
    let (forwards, backwards) = (largest(errors.iter().map(|e| e.0)), largest(errors.iter().map(|e| e.1)));
    println!("8 + 16 over 155 s in f32: {forwards:.1e} forwards, {backwards:.1e} backwards");
    assert!(forwards <= 1e-4 && backwards <= 1e-3);
}
