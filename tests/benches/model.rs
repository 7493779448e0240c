//! Time of a step, and time and error of 155 s by every way to compute it.
//!
//! `cargo bench -p tests --bench model`

use std::hint::black_box;

use divan::Bencher;
use host_sim::agreement::relative_rms;
use host_sim::replay::full_memory::FullMemory;
use oxictl::pid::fractional::GrunwaldLeibniz;
use springpot::{Law, LawOptions, LawState, Maxwell, Preset, Scalar, Springpot, Topology, Window};
use tests::paper_force;

const RATE_HZ: f64 = 1000.0;
const SECONDS: f64 = 155.0;

fn main() {
    print_errors();
    divan::main();
}

/// The models whose step is timed.
const MODELS: [&str; 4] = ["eq11 n = 1", "eq11 n = 2", "eq11 n = 5", "parallel n = 5"];

fn model(name: &str) -> Maxwell {
    let preset = match name {
        "eq11 n = 1" => "table3-n1",
        "eq11 n = 2" => "table3-n2",
        _ => "table3-n5",
    };
    let topology = if name.starts_with("parallel") { Topology::Parallel } else { Topology::Eq11 };
    Preset::named(preset).expect("a preset").model().expect("valid").with_topology(topology)
}

fn step<T: Scalar>(bencher: Bencher<'_, '_>, name: &str, run: impl Fn(&Law<T>, &mut LawState<T>, T) -> T) {
    let law: Law<T> = Law::compressed(&model(name), LawOptions::at_step(1.0 / RATE_HZ)).expect("valid");
    let force: Vec<T> = paper_force(1.0 / 7.0, 7.0, RATE_HZ).into_iter().map(T::from_f64).collect();
    let mut state = law.state();
    let mut k = 0;
    bencher.bench_local(|| {
        k = (k + 1) % force.len();
        run(black_box(&law), &mut state, black_box(force[k]))
    });
}

#[divan::bench(args = MODELS)]
fn step_f32(bencher: Bencher<'_, '_>, name: &str) {
    step::<f32>(bencher, name, |law, state, force| law.displacement(state, force));
}

#[divan::bench(args = MODELS)]
fn step_f64(bencher: Bencher<'_, '_>, name: &str) {
    step::<f64>(bencher, name, |law, state, force| law.displacement(state, force));
}

#[divan::bench(args = MODELS)]
fn build_law(name: &str) -> Law<f32> {
    Law::compressed(black_box(&model(name)), LawOptions::at_step(1.0 / RATE_HZ)).expect("valid")
}

/// A springpot alone, without mass: what every peer can compute.
fn springpot() -> Maxwell {
    Maxwell::new(Springpot::new(62_740.0, 0.2), &[], Topology::Eq11, 0.0).expect("valid")
}

fn force() -> Vec<f64> {
    paper_force(1.0 / 7.0, SECONDS, RATE_HZ)
}

fn compressed<T: Scalar>(force: &[f64]) -> Vec<f64> {
    let law: Law<T> = Law::compressed(&springpot(), LawOptions::at_step(1.0 / RATE_HZ)).expect("valid");
    let mut state = law.state();
    force.iter().map(|&f| law.displacement(&mut state, T::from_f64(f)).to_f64()).collect()
}

fn window(force: &[f64], length: usize) -> Vec<f64> {
    let law: Law<f64, Window<f64, Vec<f64>>> =
        Law::window(&springpot(), 1.0 / RATE_HZ, vec![0.0; length]).expect("valid");
    let mut state = law.state(vec![0.0; length]).expect("same length");
    force.iter().map(|&f| law.displacement(&mut state, f)).collect()
}

fn fft(force: &[f64]) -> Vec<f64> {
    FullMemory::new(force.len(), 1.0 / RATE_HZ).displacement(&springpot(), force)
}

/// The defining sum: x is the fractional integral of F/c.
fn sum(force: &[f64]) -> Vec<f64> {
    let (c, alpha) = (62_740.0, 0.2);
    let mut weights = vec![(1.0 / RATE_HZ).powf(alpha) / c];
    for j in 1..force.len() {
        weights.push(weights[j - 1] * (j as f64 - 1.0 + alpha) / j as f64);
    }
    (0..force.len()).map(|k| weights[..=k].iter().zip(force[..=k].iter().rev()).map(|(w, f)| w * f).sum()).collect()
}

/// The nearest peer: its short-window operator as the fractional integral of order 0.2.
fn peer<const N: usize>(force: &[f64]) -> Vec<f64> {
    let mut operator = Box::new(GrunwaldLeibniz::<f64, N>::new(-0.2, 1.0 / RATE_HZ).expect("valid"));
    force.iter().map(|f| operator.update(f / 62_740.0)).collect()
}

#[divan::bench(sample_count = 20)]
fn run_155_s_compressed_f32(bencher: Bencher<'_, '_>) {
    bencher.with_inputs(force).bench_refs(|force| compressed::<f32>(force));
}

#[divan::bench(sample_count = 20)]
fn run_155_s_compressed_f64(bencher: Bencher<'_, '_>) {
    bencher.with_inputs(force).bench_refs(|force| compressed::<f64>(force));
}

#[divan::bench(sample_count = 10)]
fn run_155_s_fft(bencher: Bencher<'_, '_>) {
    bencher.with_inputs(force).bench_refs(|force| fft(force));
}

#[divan::bench(sample_count = 3, sample_size = 1, args = [1000, 10_000])]
fn run_155_s_window(bencher: Bencher<'_, '_>, length: usize) {
    bencher.with_inputs(force).bench_refs(|force| window(force, length));
}

#[divan::bench(sample_count = 1, sample_size = 1)]
fn run_155_s_sum(bencher: Bencher<'_, '_>) {
    bencher.with_inputs(force).bench_refs(|force| sum(force));
}

#[divan::bench(sample_count = 3, sample_size = 1)]
fn run_155_s_oxictl_1000(bencher: Bencher<'_, '_>) {
    bencher.with_inputs(force).bench_refs(|force| peer::<1000>(force));
}

#[divan::bench(sample_count = 1, sample_size = 1)]
fn run_155_s_oxictl_10000(bencher: Bencher<'_, '_>) {
    bencher.with_inputs(force).bench_refs(|force| peer::<10_000>(force));
}

/// Divan measures time only: the errors of the same runs, against the FFT.
fn print_errors() {
    // `cargo test` runs benchmarks once to see that they work.
    if std::env::args().any(|argument| argument == "--test") {
        return;
    }
    let force = force();
    let exact = fft(&force);
    println!("relative RMS error over 155 s at 1 kHz, springpot of order 0.2:");
    for (name, x) in [
        ("compressed, f32", compressed::<f32>(&force)),
        ("compressed, f64", compressed::<f64>(&force)),
        ("defining sum", sum(&force)),
        ("window of 1 000", window(&force, 1000)),
        ("window of 10 000", window(&force, 10_000)),
        ("oxictl, N = 1 000", peer::<1000>(&force)),
        ("oxictl, N = 10 000", peer::<10_000>(&force)),
    ] {
        println!("  {name:20} {:.1e}", relative_rms(&x, &exact));
    }
}
