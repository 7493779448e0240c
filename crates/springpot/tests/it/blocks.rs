//! Blocks of learning, of an error of one number: a mean or a harmonic that the correction changes in proportion, as no film does.

use std::f64::consts::TAU;

use springpot::{
    Actuator, Law, LawOptions, Learning, LearningOptions, LearningState, Limited, Maxwell, SensorSample, Springpot,
    Topology,
};

const REFERENCE_M: f64 = 1e-3;
const ERROR_M: f64 = 20e-6;

/// An error (m) to which the correction is added times `response`. Its samples, every 10 ms, are more and less by the noise in turn.
struct Bench {
    learning: Learning<f64>,
    state: LearningState<f64>,
    noise_m: f64,
    response: f64,
    error_m: f64,
    /// Whether the error is a cosine of the period instead of a mean.
    swings: bool,
    left_m: f64,
    tick: u32,
}

impl Bench {
    /// With a period of 2 s, which has one cycle in a block while there is much to learn.
    fn new(response: f64, noise_m: f64) -> Self {
        let model = Maxwell::new(Springpot::new(5000.0, 0.1), &[], Topology::Parallel, 0.0).expect("valid");
        let law: Law<f64> = Law::compressed(&model, LawOptions::at_step(1e-3)).expect("valid");
        let options = LearningOptions { period_s: Some(2.0), ..LearningOptions::BENCH };
        let learning = Learning::new(&law, &Actuator::KARNER_2022, 6000.0, options).expect("valid");
        let state = learning.state(REFERENCE_M);
        Self { learning, state, noise_m, response, error_m: ERROR_M, swings: false, left_m: ERROR_M, tick: 0 }
    }

    /// The largest error in so many seconds, m, and the largest correction.
    fn run(&mut self, seconds: u32) -> [f64; 2] {
        self.run_ticks(1000 * seconds)
    }

    fn run_ticks(&mut self, ticks: u32) -> [f64; 2] {
        let mut largest = [0.0_f64; 2];
        for _ in 0..ticks {
            if self.tick.is_multiple_of(10) {
                let noise_m = if self.tick.is_multiple_of(20) { self.noise_m } else { -self.noise_m };
                self.state.observe(SensorSample { displacement_m: REFERENCE_M + self.left_m + noise_m, age_ticks: 0 });
            }
            let asked = self.learning.advance(&mut self.state, REFERENCE_M, Limited::NONE);
            let added_m = asked - REFERENCE_M;
            let shape = if self.swings { (TAU * f64::from(self.tick + 1) / 2000.0).cos() } else { 1.0 };
            self.left_m = self.error_m * shape + self.response * added_m;
            largest = [largest[0].max(self.left_m.abs()), largest[1].max(added_m.abs())];
            self.tick += 1;
        }
        largest
    }
}

/// A sixteenth in each block, and no more than all of it.
#[test]
fn learning_takes_over_in_sixteen_blocks() {
    for noise_m in [0.0, 1e-6] {
        let mut bench = Bench::new(1.0, noise_m);
        let mut shares = vec![0.0];
        // A block is at most two cycles and half a second.
        for _ in 0..20 * 5 {
            bench.run(1);
            let share = bench.state.taken_over();
            if Some(&share) != shares.last() {
                shares.push(share);
            }
        }
        let expected: Vec<f64> = (0..=16).map(|blocks| f64::from(blocks) / 16.0).collect();
        assert_eq!(shares, expected, "{noise_m} m of noise");
    }
}

/// The first step is 0.6 of the error, by the weight E⁴ / (E⁴ + 16 σ⁴) with the variance σ² of a mean of 200 samples, twice that of each by 200.
#[test]
fn the_step_is_less_near_the_noise() {
    for noise_m in [0.0, 3.0 * ERROR_M, 5.0 * ERROR_M, 7.0 * ERROR_M] {
        let mut bench = Bench::new(1.0, noise_m);
        // The first block, and a second for the correction to arrive.
        bench.run(4);
        let variance = 2.0 * noise_m * noise_m / 200.0;
        let weight = ERROR_M.powi(4) / (ERROR_M.powi(4) + 16.0 * variance * variance);
        let share = -bench.state.added() / (0.6 * weight * ERROR_M);
        assert!((share - 1.0).abs() < 0.03, "{noise_m} m of noise: {share} of what is expected");
    }
}

/// An error that grows by a fifth, again and again: caution after it does not last.
#[test]
fn small_changes_are_learned_without_overshoot() {
    let mut bench = Bench::new(1.0, 0.0);
    bench.run(100);
    for _ in 0..8 {
        bench.error_m *= 1.2;
        let [largest, _] = bench.run(40);
        assert!(largest < 1.001 * (bench.error_m - bench.error_m / 1.2), "{largest:e} m");
        let [left, _] = bench.run(10);
        assert!(left < 0.01 * ERROR_M, "{left:e} m of an error of {:e} m", bench.error_m);
    }
}

/// A correction that moves the film the other way does harm: with 0.6 of the error at most. Each time half as much is trusted, and nothing below a tenth.
/// Two blocks measure the film before each correction, of which it takes 1, 1, 2 and 3 steps until the square of the error is half as large again.
#[test]
fn what_does_harm_is_given_up() {
    let mut bench = Bench::new(-1.0, 0.0);
    let (mut largest, mut harms, mut is_added, mut last_s) = (0.0_f64, 0, false, 0);
    for second in 1..=200 {
        let [left, added] = bench.run(1);
        largest = largest.max(left);
        harms += u32::from(is_added && added < 1e-3 * ERROR_M);
        is_added = added > 1e-3 * ERROR_M;
        last_s = if is_added { second } else { last_s };
    }
    // 14 blocks of 2.2 s, as the first has nothing before it, and until the correction is gone.
    assert!((31..=32).contains(&last_s), "{last_s} s");
    assert!((1.59..1.61).contains(&(largest / ERROR_M)), "{largest:e} m");
    assert_eq!((harms, is_added), (4, false));
    let [_, added] = bench.run(200);
    assert!(added < 1e-6 * ERROR_M, "{added:e} m are still added");
}

/// Less than a fifth of the correction: it is added in two blocks, of 0.6 each, and given up.
#[test]
fn a_harmonic_without_a_response_gets_nothing() {
    for response in [0.0, 0.1] {
        let mut bench = Bench { swings: true, ..Bench::new(response, 0.0) };
        let [_, largest] = bench.run(60);
        assert!((1.1..1.25).contains(&(largest / ERROR_M)), "{response}: {largest:e} m");
        let [_, added] = bench.run(60);
        // Cycles end within seven ticks, so the mean has a little of them.
        assert!(added < 0.05 * ERROR_M, "{response}: {added:e} m are still added");
    }
}

/// An error that turns round, of ten times its size: 16 samples show it, long before the block ends.
#[test]
fn an_excessive_error_ends_a_block() {
    let mut bench = Bench::new(1.0, 0.0);
    bench.run(100);
    assert!((bench.state.added() / ERROR_M + 1.0).abs() < 1e-3);
    bench.error_m = -10.0 * ERROR_M;
    // To settle, 16 samples, and six times the two lags and the approach.
    bench.run(1);
    assert!(bench.state.added().abs() < 0.02 * ERROR_M, "{:e} m are still added", bench.state.added());
    // A block of two cycles, in which the film settles, and one of one cycle, after which the first step is made: 0.2 s more each.
    bench.run(7);
    let share = -bench.state.added() / (0.6 * bench.error_m);
    assert!((share - 1.0).abs() < 0.01, "{share} of the first step");
}

/// A change within the noise of a sample, and above that of a block: once a block shows it, the next has one cycle, which ends 2.2 s later.
#[test]
fn a_block_after_a_worse_one_is_short() {
    let mut bench = Bench::new(1.0, 0.5 * ERROR_M);
    bench.run(100);
    assert_eq!(bench.state.taken_over(), 1.0);
    bench.error_m += 0.75 * ERROR_M;
    let mut next = |before: f64| {
        let ticks = (1..).find(|_| {
            bench.run_ticks(1);
            bench.state.taken_over() != before
        });
        (ticks, bench.state.taken_over())
    };
    // Two sixteenths less, and one more.
    let (_, taken_over) = next(1.0);
    assert_eq!(taken_over, 1.0 - 2.0 / 16.0);
    let (ticks, taken_over) = next(taken_over);
    assert_eq!(taken_over, 1.0 - 1.0 / 16.0);
    // To the seven ticks in which each harmonic is visited once.
    assert!(ticks.is_some_and(|ticks| (2193..=2207).contains(&ticks)), "{ticks:?} ticks");
}

/// Limits that leave no block for 10 s halve the correction, and again after as long.
#[test]
fn limits_halve_the_correction_every_ten_seconds() {
    let mut bench = Bench::new(1.0, 0.0);
    bench.run(100);
    for seconds in 1..=30_u32 {
        for _ in 0..1000 {
            bench.learning.advance(&mut bench.state, REFERENCE_M, Limited::SLEW);
        }
        // The last block has ended within 4.2 s before them.
        if let Some(halved) = [(5, 0), (12, 1), (15, 1), (22, 2), (25, 2)].iter().find(|at| at.0 == seconds) {
            let left = -bench.state.added() / ERROR_M;
            assert!((left - 0.5_f64.powi(halved.1)).abs() < 1e-3, "{left} after {seconds} s");
        }
    }
}

#[test]
fn another_run_begins_with_what_was_learned() {
    let mut bench = Bench::new(1.0, 0.0);
    bench.run(100);
    bench.learning.restart(&mut bench.state, REFERENCE_M, true);
    assert_eq!(bench.state.added(), 0.0);
    let [_, largest] = bench.run(2);
    assert!((largest / ERROR_M - 1.0).abs() < 1e-3, "{largest:e} m");
    bench.learning.restart(&mut bench.state, REFERENCE_M, false);
    let [_, largest] = bench.run(2);
    assert_eq!(largest, 0.0);
}
