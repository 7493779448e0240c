//! Films of several kinds, integrated step by step, and the rows that are recorded of them.

use std::f64::consts::TAU;

use rand::RngExt;
use rand_pcg::Pcg64;

/// Steps of the films, s.
pub(super) const STEP_S: f64 = 1e-3;
pub(super) const PEAK_V: f64 = 3500.0;

/// A film whose stroke under the largest voltage is about 1.
#[derive(Clone)]
pub(super) struct Film {
    /// Share of the stroke and time (s) of each part that creeps.
    branches: Vec<(f64, f64)>,
    /// Cubic stiffening, and growth of the force with the stroke.
    cubic: f64,
    coupling: f64,
    /// Whether the branches are beside the spring instead of in series with it.
    beside: bool,
}

impl Film {
    pub(super) fn random(random: &mut Pcg64) -> Self {
        let branches = if random.random_bool(0.5) {
            (0..random.random_range(1..4))
                .map(|_| (random.random_range(0.05..0.4), 10f64.powf(random.random_range(-0.3..2.0))))
                .collect()
        } else {
            let (alpha, share) = (random.random_range(0.02..0.25), random.random_range(0.02..0.1));
            (-6..=9).map(|k| 2.5f64.powi(k)).map(|tau_s| (share * tau_s.powf(alpha), tau_s)).collect()
        };
        let cubic = if random.random_bool(0.5) { 0.0 } else { random.random_range(0.0..0.8) };
        Self { branches, cubic, coupling: random.random_range(0.0..0.15), beside: random.random_bool(0.4) }
    }

    /// One springpot of order `alpha`, whose stroke after 100 s is about 1.
    pub(super) fn springpot(alpha: f64) -> Self {
        let (ratio, shortest_s): (f64, f64) = (2.5, 2.5f64.powi(-6));
        // Times below the shortest are the elastic part, 1, which is their sum.
        let share = (ratio.powf(alpha) - 1.0) / shortest_s.powf(alpha);
        let branches = (-6..=9).map(|k| ratio.powi(k)).map(|tau_s| (share * tau_s.powf(alpha), tau_s)).collect();
        Self { branches, cubic: 0.0, coupling: 0.0, beside: false }
    }

    /// The stroke under a voltage, a value for each step.
    pub(super) fn stroke(&self, volts: &[f64], driven_before: bool) -> Vec<f64> {
        let mut states = vec![0.0; self.branches.len()];
        let mut x = 0.0;
        let mut step = |volts: f64| {
            let load = (volts / PEAK_V).powi(2) * (1.0 + self.coupling * x);
            if self.beside {
                for _ in 0..4 {
                    let resisted: f64 = self.branches.iter().zip(&states).map(|((share, _), y)| share * (x - y)).sum();
                    let stiffness = 1.0 + 3.0 * self.cubic * x * x + self.branches.iter().map(|b| b.0).sum::<f64>();
                    x -= (x + self.cubic * x.powi(3) + resisted - load) / stiffness;
                }
                for ((_, tau_s), y) in self.branches.iter().zip(&mut states) {
                    *y += (x - *y) * (1.0 - (-STEP_S / tau_s).exp());
                }
            } else {
                let mut spring = load;
                for _ in 0..6 {
                    spring -=
                        (spring + self.cubic * spring.powi(3) - load) / (1.0 + 3.0 * self.cubic * spring * spring);
                }
                for ((share, tau_s), y) in self.branches.iter().zip(&mut states) {
                    *y += (share * load - *y) * (1.0 - (-STEP_S / tau_s).exp());
                }
                x = spring + states.iter().sum::<f64>();
            }
            x
        };
        if driven_before {
            (0..60_000).for_each(|_| {
                step(PEAK_V);
            });
        }
        volts.iter().map(|volts| step(*volts)).collect()
    }
}

/// A recording as it is made: values for each step, and the rows in the end.
pub(super) struct Run {
    pub(super) film: Film,
    /// As it is recorded, and as it is on the film.
    pub(super) recorded_v: Vec<f64>,
    pub(super) volts: Vec<f64>,
    /// Stroke and reading as shares of the stroke.
    pub(super) reading: Vec<f64>,
    pub(super) driven_before: bool,
    /// The number of this recording.
    pub(super) number: usize,
    pub(super) rows: Vec<[f64; 3]>,
    pub(super) every: usize,
    pub(super) noise: f64,
}

pub(super) fn sine(hz: f64, peak: f64, t: f64) -> f64 {
    0.5 * peak * (1.0 - (TAU * hz * t).cos())
}

/// Voltages of a set of recordings: one composite, or three sines.
pub(super) fn voltages(random: &mut Pcg64) -> Vec<Vec<f64>> {
    let steps = |duration_s: f64| (0..(duration_s / STEP_S) as usize).map(|k| k as f64 * STEP_S);
    if random.random_bool(0.4) {
        let at = |t: f64| match t - 3.0 {
            t if t < 0.0 => 0.0,
            t if t < 15.0 => sine(0.2, PEAK_V, t),
            t if t < 43.5714285 => sine(0.14, PEAK_V, t - 15.0),
            t if t < 69.5454545 => sine(0.077, PEAK_V, t - 43.5714285),
            t if t < 83.8311688 => sine(0.14, 0.6 * PEAK_V, t - 69.5454545),
            t if t < 145.0 => 0.8 * PEAK_V * ((t - 83.8311688) / 2.0).min(((145.0 - t) / 2.0).min(1.0)),
            _ => 0.0,
        };
        return vec![steps(170.0).map(at).collect()];
    }
    let scale = random.random_range(0.7..1.4);
    let one = |(hz, peak): (f64, f64)| {
        steps(90.0).map(|t| if t < 2.0 { 0.0 } else { sine(scale * hz, peak * PEAK_V, t - 2.0) }).collect()
    };
    [(0.4, 1.0), (0.15, 0.6), (0.08, 1.0)].map(one).into()
}

impl Run {
    /// The lowest and the highest reading.
    pub(super) fn range(&self) -> (f64, f64) {
        self.rows.iter().fold((f64::MAX, f64::MIN), |(low, high), row| (low.min(row[2]), high.max(row[2])))
    }

    /// Changes the rows, whose times stay in their places.
    pub(super) fn under_the_clock(&mut self, change: impl FnOnce(&mut Vec<[f64; 3]>)) {
        let times: Vec<f64> = self.rows.iter().map(|row| row[0]).collect();
        change(&mut self.rows);
        self.rows.iter_mut().zip(times).for_each(|(row, t)| row[0] = t);
    }
}
