//! Learning of periodic references, on films that are closed forms: oscillators that no law knows.

use std::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::{
    Actuator, ControlError, LawOptions, Learning, LearningOptions, LearningState, Limited, Maxwell, SensorSample,
    Springpot, Topology,
};

use crate::support::full_sweep;

const STEP_S: f64 = 1e-3;

/// The plant behind the learning: reference to displacement, x'' = ω² (g r − x) − 2 ζ ω x', with a part that bends.
#[derive(Clone, Copy, Debug)]
struct Oscillator {
    resonance_hz: f64,
    damping: f64,
    gain: f64,
    /// Share of the square of the reference's stroke.
    bend: f64,
    offset_m: f64,
    state: [f64; 2],
}

impl Oscillator {
    /// A millisecond towards `reference` (m), in parts of 0.1 ms.
    fn advance(&mut self, reference: f64) -> f64 {
        let Self { resonance_hz, damping, gain, bend, offset_m, state: [x, speed] } = self;
        let omega = TAU * *resonance_hz;
        let goal = *gain * reference * (1.0 + *bend * reference / 1e-3) + *offset_m;
        for _ in 0..10 {
            *speed += 1e-4 * (omega * omega * (goal - *x) - 2.0 * *damping * omega * *speed);
            *x += 1e-4 * *speed;
        }
        *x
    }
}

fn learning(period_s: Option<f64>) -> Learning<f32> {
    learning_with(LearningOptions { period_s, ..LearningOptions::BENCH }).expect("valid")
}

fn learning_with(options: LearningOptions) -> Result<Learning<f32>, ControlError> {
    let model = Maxwell::new(Springpot::new(5000.0, 0.1), &[], Topology::Parallel, 0.0).expect("valid");
    let law: springpot::Law<f32> = springpot::Law::compressed(&model, LawOptions::at_step(STEP_S)).expect("valid");
    Learning::new(&law, &Actuator::KARNER_2022, 6000.0, options)
}

/// A loop around an oscillator: a sensor of 100 Hz with 2 µm of noise.
struct Loop {
    learning: Learning<f32>,
    state: LearningState<f32>,
    film: Oscillator,
    random: Pcg64,
    /// Displacements of the last ticks, the newest last.
    past: Vec<f64>,
    /// Ticks from a measurement to its sample, and what the controller thinks of them.
    delay: usize,
    believed: usize,
    tick: usize,
}

impl Loop {
    fn new(period_s: Option<f64>, film: Oscillator, delay: usize, believed: usize, seed: u64) -> Self {
        let learning = learning(period_s);
        let state = learning.state(0.0);
        Self { learning, state, film, random: Pcg64::seed_from_u64(seed), past: vec![0.0], delay, believed, tick: 0 }
    }

    /// A tick towards `reference` (m); the error at its end.
    fn advance(&mut self, reference: f64, is_seen: bool) -> f64 {
        let due = is_seen && self.tick.is_multiple_of(10) && self.past.len() > self.delay;
        let sample = due.then(|| {
            let noise = 2e-6 * 3f64.sqrt() * self.random.random_range(-1.0..1.0);
            let displacement = (self.past[self.past.len() - 1 - self.delay] + noise) as f32;
            SensorSample { displacement_m: displacement, age_ticks: self.believed }
        });
        if let Some(sample) = sample {
            self.state.observe(sample);
        }
        let asked = self.learning.advance(&mut self.state, reference as f32, Limited::NONE);
        let x = self.film.advance(f64::from(asked));
        self.past.push(x);
        self.tick += 1;
        x - reference
    }
}

/// A limit that the command before met, or none.
fn met(is_met: bool) -> Limited {
    if is_met { Limited::SLEW } else { Limited::NONE }
}

fn sine(period_s: f64, tick: usize) -> f64 {
    1e-3 - 0.5e-3 * (TAU * tick as f64 * STEP_S / period_s).cos()
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|e| e * e).sum::<f64>() / values.len() as f64).sqrt()
}

/// The error without learning, once the start has died away: one more loop that nothing is learned in.
fn errors(
    period_s: f64,
    given: bool,
    film: Oscillator,
    delays: [usize; 2],
    seed: u64,
    seconds: usize,
) -> [Vec<f64>; 2] {
    [true, false].map(|is_seen| {
        let mut film = Loop::new(given.then_some(period_s), film, delays[0], delays[1], seed);
        (0..seconds * 1000).map(|tick| film.advance(sine(period_s, tick + 1), is_seen)).collect()
    })
}

const PLAIN: Oscillator =
    Oscillator { resonance_hz: 30.0, damping: 0.3, gain: 0.9, bend: 0.05, offset_m: 20e-6, state: [0.0; 2] };

/// A film 10 % too stiff that bends as well: what is left is the sensor's noise.
#[test]
fn unmodelled_errors_are_learned() {
    for (period_s, given) in [(3.0, true), (3.0, false), (1.0, false), (0.5, true), (0.2, false)] {
        let [with, without] = errors(period_s, given, PLAIN, [10, 10], 1, 60);
        let (with, without) = (rms(&with[40_000..]), rms(&without[40_000..]));
        println!("{period_s} s: {:.2} µm with, {:.1} µm without", 1e6 * with, 1e6 * without);
        assert!(without > 25e-6 && with < 1e-6, "{period_s} s: {with:e} of {without:e}");
    }
}

/// Random films with a resonance anywhere from 1 to 30 Hz that no law knows, ±30 % of stiffness, a delay that is wrong by up to 10 ms:
/// never worse than without learning but for the noise and for what the wrong delay makes of the speed, and nearly always far better.
#[test]
fn no_film_is_made_worse() {
    let mut random = Pcg64::seed_from_u64(14);
    let count = if full_sweep() { 1000 } else { 60 };
    let mut shares = Vec::new();
    for seed in 0..count {
        let film = Oscillator {
            resonance_hz: 30f64.powf(random.random_range(0.0..1.0)),
            damping: 0.03 * 20f64.powf(random.random_range(0.0..1.0)),
            gain: random.random_range(0.7..1.3),
            bend: random.random_range(-0.1..0.1),
            offset_m: random.random_range(-50e-6..50e-6),
            state: [0.0; 2],
        };
        let period_s = 0.1 * 50f64.powf(random.random_range(0.0..1.0));
        // Every other one is dated rightly.
        let delays = [if seed % 2 == 0 { 10 } else { random.random_range(0..20) }, 10];
        let given = random.random_range(0..2) == 0;
        let [with, without] = errors(period_s, given, film, delays, seed, 60);
        let [with, without] = [with, without].map(|errors| rms(&errors[40_000..]));
        // A film that follows its samples exactly is off by as much as they are dated wrongly.
        let misdated_s = (delays[0] as f64 - delays[1] as f64) * STEP_S;
        let misdated = misdated_s.abs() * 0.5e-3 * TAU / period_s / 2f64.sqrt();
        assert!(
            with < 1.02 * without + 1.05 * misdated + 1e-6,
            "{seed}: {with:e} of {without:e}, {period_s} s, {delays:?}, {film:?}"
        );
        if misdated < 1e-6 {
            shares.push(with / without);
        }
    }
    shares.sort_by(f64::total_cmp);
    let [median, worst] = [shares[shares.len() / 2], shares[shares.len() - 1]];
    let left = shares.iter().filter(|&&share| share > 0.5).count();
    println!("of {count} films: error with over without: median {median:.4}, worst {worst:.3}; {left} above a half");
    assert!(median < 0.02 && left * 5 < shares.len());
}

/// A film that gets a fifth stiffer, and a reference that gets faster: learned again within ten cycles, without a jump.
#[test]
fn changes_are_learned_again() {
    let mut film = Loop::new(Some(1.0), PLAIN, 10, 10, 3);
    let (mut errors, mut added) = (Vec::new(), Vec::new());
    for tick in 0..60_000 {
        if tick == 30_000 {
            film.film.gain *= 0.8;
        }
        errors.push(film.advance(sine(1.0, tick + 1), true));
        added.push(f64::from(film.state.added()));
    }
    assert!(rms(&errors[30_000..31_000]) > 50e-6 && rms(&errors[40_000..50_000]) < 2e-6);
    let jump = added[1000..].windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
    assert!(jump < 5e-6, "{jump:e}");

    // From 2 s to 1.3 s: what was learned fades out, and in again.
    let mut film = Loop::new(None, PLAIN, 10, 10, 4);
    let (mut errors, mut added, mut phase) = (Vec::new(), Vec::new(), 0.0);
    for tick in 0..80_000 {
        phase += TAU * STEP_S / if tick < 40_000 { 2.0 } else { 1.3 };
        errors.push(film.advance(1e-3 - 0.5e-3 * f64::cos(phase), true));
        added.push(f64::from(film.state.added()));
    }
    assert!(rms(&errors[30_000..40_000]) < 1e-6 && rms(&errors[60_000..]) < 1e-6);
    let jump = added[1000..].windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
    assert!(jump < 5e-6, "{jump:e}");
}

/// Without samples what was learned stays; without a period it fades out; on order it is forgotten.
#[test]
fn the_correction_is_kept_faded_or_reset() {
    let mut film = Loop::new(None, PLAIN, 10, 10, 5);
    let period_s = 1.0;
    let mut errors: Vec<f64> = (0..40_000).map(|tick| film.advance(sine(period_s, tick + 1), true)).collect();
    assert_eq!(film.state.period_ticks().map(f32::round), Some(1000.0));
    errors.extend((40_000..60_000).map(|tick| film.advance(sine(period_s, tick + 1), false)));
    assert!(rms(&errors[50_000..]) < 1.2e-6, "{:e}", rms(&errors[50_000..]));

    let held = sine(period_s, 60_000);
    for _ in 0..3000 {
        film.advance(held, true);
    }
    assert_eq!(film.state.period_ticks(), None);
    assert!(film.state.added().abs() < 1e-7);

    let mut film = Loop::new(Some(1.0), PLAIN, 10, 10, 6);
    for tick in 0..20_000 {
        film.advance(sine(period_s, tick + 1), true);
    }
    assert!(film.state.added().abs() > 1e-5);
    film.state.forget();
    for tick in 20_000..20_050 {
        film.advance(sine(period_s, tick + 1), true);
    }
    assert!(film.state.added().abs() < 1e-6);
}

/// Nothing is added to references without cycles, and nothing is learned from non-finite values.
#[test]
fn only_cycles_are_learned() {
    let mut film = Loop::new(None, PLAIN, 10, 10, 7);
    let mut random = Pcg64::seed_from_u64(8);
    let (mut goal, mut reference) = (1e-3, 1e-3);
    for tick in 0..60_000 {
        if tick % 1733 == 0 {
            goal = random.random_range(0.5e-3..1.5e-3);
        }
        reference += 0.01 * (goal - reference);
        film.advance(reference, true);
        assert!(film.state.added().abs() < 60e-6, "{tick}");
    }

    let learning = learning(Some(1.0));
    let mut state = learning.state(0.0);
    for tick in 0..20_000_usize {
        let wrong = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY][tick % 3];
        state.observe(SensorSample { displacement_m: wrong, age_ticks: [0, 62, 63, usize::MAX][tick % 4] });
        let reference = if tick % 7 == 0 { wrong } else { 1e-3 };
        let asked = learning.advance(&mut state, reference, met(tick % 5 != 0));
        assert!(state.added() == 0.0 && (asked == reference || reference.is_nan()), "{tick}");
    }
}

/// A limit that is met in every cycle leaves no block: what was learned is halved until it is gone.
#[test]
fn limits_reduce_the_correction() {
    let mut film = Loop::new(Some(1.0), PLAIN, 10, 10, 9);
    let mut learned = 0.0_f64;
    for tick in 0..20_000 {
        film.advance(sine(1.0, tick + 1), true);
        learned = learned.max(f64::from(film.state.added()).abs());
    }
    for tick in 20_000..140_000 {
        let asked = film.learning.advance(&mut film.state, sine(1.0, tick + 1) as f32, met(tick % 500 == 0));
        film.film.advance(f64::from(asked));
    }
    let left = f64::from(film.state.added()).abs();
    assert!(learned > 3e-5 && left < 0.01 * learned, "{left:e} of {learned:e}");
}

#[test]
fn invalid_options_are_refused() {
    for harmonics in [0, 7] {
        let refused = learning_with(LearningOptions { harmonics, ..LearningOptions::BENCH });
        assert_eq!(refused, Err(ControlError::Harmonics { harmonics }));
    }
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        for options in [
            LearningOptions { period_s: Some(wrong), ..LearningOptions::BENCH },
            LearningOptions { sample_interval_s: wrong, ..LearningOptions::BENCH },
        ] {
            assert!(matches!(learning_with(options), Err(ControlError::NotPositive { .. })), "{options:?}");
        }
    }
    assert!(learning_with(LearningOptions { harmonics: 1, ..LearningOptions::BENCH }).is_ok());
}
