//! Blocks of learning, of an error of one number: a mean that the correction changes in proportion, as no film does.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::{
    Actuator, Law, LawOptions, Learning, LearningOptions, LearningState, Limited, Maxwell, SensorSample, Springpot,
    Topology,
};

const REFERENCE_M: f64 = 1e-3;
const ERROR_M: f64 = 20e-6;

/// An error (m) to which the correction is added times `response`, sampled every 10 ms.
struct Bench {
    learning: Learning<f64>,
    state: LearningState<f64>,
    random: Pcg64,
    noise_m: f64,
    response: f64,
    error_m: f64,
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
        let (state, random) = (learning.state(REFERENCE_M), Pcg64::seed_from_u64(1));
        Self { learning, state, random, noise_m, response, error_m: ERROR_M, left_m: ERROR_M, tick: 0 }
    }

    /// The largest error in so many seconds, m, and the largest correction.
    fn run(&mut self, seconds: u32) -> [f64; 2] {
        let mut largest = [0.0_f64; 2];
        for _ in 0..1000 * seconds {
            if self.tick.is_multiple_of(10) {
                let noise_m = self.noise_m * self.random.random_range(-1.0..1.0);
                self.state.observe(SensorSample { displacement_m: REFERENCE_M + self.left_m + noise_m, age_ticks: 0 });
            }
            let asked = self.learning.advance(&mut self.state, REFERENCE_M, Limited::NONE);
            let added_m = asked - REFERENCE_M;
            self.left_m = self.error_m + self.response * added_m;
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

/// An error that grows by a fifth once all is learned.
#[test]
fn a_small_change_is_learned_without_overshoot() {
    let mut bench = Bench::new(1.0, 0.0);
    bench.run(100);
    bench.error_m *= 1.2;
    let [largest, _] = bench.run(60);
    assert!(largest < 1.001 * 0.2 * ERROR_M, "{largest:e} m");
    let [left, _] = bench.run(10);
    assert!(left < 0.01 * ERROR_M, "{left:e} m");
}

/// A correction that moves the film the other way does harm. Each time half as much is trusted, and nothing below a tenth.
#[test]
fn what_does_harm_is_given_up() {
    let mut bench = Bench::new(-1.0, 0.0);
    let [largest, _] = bench.run(200);
    assert!(largest > 1.5_f64.sqrt() * ERROR_M, "it did harm: {largest:e} m");
    let [_, added] = bench.run(200);
    assert!(added < 1e-3 * ERROR_M, "{added:e} m are still added");
}
