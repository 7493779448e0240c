//! A film that arcs.

use rand::Rng;
use rand_distr::{Distribution, Exp1};

/// A film of constant charging current that arcs once it is charged.
pub struct Arcing {
    pub dwell_ms: f64,
    pub recharge_ms: f64,
    pub film_v: f64,
    /// Until the next arc, once it is charged, ms.
    pub wait_ms: Option<f64>,
}

impl Arcing {
    /// The film's voltage a millisecond later, at an amplifier of `target_v`.
    pub fn step(&mut self, target_v: f64, random: &mut impl Rng) -> f64 {
        let v_per_ms = 4000.0 / self.recharge_ms;
        let mut left_ms = 1.0;
        while left_ms > 0.0 {
            match &mut self.wait_ms {
                Some(wait_ms) if *wait_ms < left_ms => {
                    left_ms -= *wait_ms;
                    (self.film_v, self.wait_ms) = (0.0, None);
                }
                Some(wait_ms) => {
                    *wait_ms -= left_ms;
                    self.film_v = target_v;
                    left_ms = 0.0;
                }
                None => {
                    let full_ms = (target_v - self.film_v).max(0.0) / v_per_ms;
                    if full_ms < left_ms {
                        left_ms -= full_ms;
                        let units: f64 = Exp1.sample(random);
                        (self.film_v, self.wait_ms) = (target_v, Some(self.dwell_ms * units));
                    } else {
                        self.film_v += v_per_ms * left_ms;
                        left_ms = 0.0;
                    }
                }
            }
        }
        self.film_v
    }
}
