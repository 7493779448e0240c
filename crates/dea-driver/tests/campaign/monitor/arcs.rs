//! A film that arcs, how its arcs show, and the one with which it must trip.

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

/// How arcs show, by the closed form.
#[derive(Clone, Copy)]
pub struct Shows {
    pub dwell_ms: f64,
    /// Probability that one shows as such.
    pub arc: f64,
    /// Probability that it trips in time.
    pub in_time: f64,
}

impl Shows {
    /// Arcs of a film that takes `charging_ms` to be charged to `volts`.
    pub fn new(dwell_ms: f64, charging_ms: f64, volts: f64) -> Self {
        let band = (60.0 + 0.03 * volts) / volts;
        let probability = |depth: f64| (charging_ms * depth).min(1.0);
        let (arc, outside) = (probability(0.75 - band), probability(1.0 - band));
        let number = 480.0 * arc / (dwell_ms + charging_ms);
        let (one_more, two_more) = (1.0 - (-number).exp(), 1.0 - (-number).exp() * (1.0 + number));
        let first = arc / outside;
        Self { dwell_ms, arc, in_time: first * one_more + (1.0 - first) * two_more }
    }
}

/// Finds the arc with which it must trip, apart from the driver: those that fall clearly deep enough.
#[derive(Default)]
pub struct ArcsSeen {
    shown_v: f64,
    first_at: Option<u32>,
}

impl ArcsSeen {
    /// Whether the reading of a tick is the arc that must trip.
    pub fn trips(&mut self, tick: u32, lowest_v: f64, monitor_v: f64) -> bool {
        let band_v = 61.0 + 0.03 * lowest_v;
        let arcs = monitor_v < 0.75 * lowest_v - band_v && self.shown_v - monitor_v > band_v;
        self.shown_v = monitor_v;
        let apart = self.first_at.map_or(u32::MAX, |at| tick - at);
        if arcs && apart > 520 {
            self.first_at = Some(tick);
        }
        arcs && (21..=520).contains(&apart)
    }
}
