//! A sensor that is late: by how much, where the recordings show it, and nothing where they do not.
//!
//! The films are integrated here at 10 kHz. `SPRINGPOT_SWEEP=full cargo test -p host-models --test it late_sensor -- --nocapture` runs all.

use std::f64::consts::TAU;

use host_io::files::recording::Recording;
use host_models::excitation::check;
use host_models::fit::options::{Branches, TopologyChoice};
use host_models::fit::settings::CurveChoice;
use host_models::fit::{Fit, FitOptions};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;
use springpot::Actuator;

use crate::recorded::{fitted_to, noise, recording};
use crate::sweep::full_sweep;

const PEAK_V: f64 = 3500.0;
/// Steps a second of the films.
const FINE_HZ: f64 = 1e4;

/// Shares and times (s) of what creeps beside an elastic part of 1.
struct Film(Vec<(f64, f64)>);

impl Film {
    fn random(random: &mut Pcg64) -> Self {
        if random.random_bool(0.5) {
            let (alpha, ratio) = (random.random_range(0.04..0.2), 2.5f64);
            // As much for each ratio of times, from 4 ms on, as a springpot of this order.
            let share = ratio.powf(alpha) - 1.0;
            return Self((0..16).map(|k| (share * ratio.powf(alpha * f64::from(k)), ratio.powi(k - 6))).collect());
        }
        let branch = |_| (random.random_range(0.05..0.4), 10f64.powf(random.random_range(-0.3..2.0)));
        Self((0..2).map(branch).collect())
    }

    /// The stroke after each step of the voltage (share of the largest).
    fn strokes(&self, volts: &[f64]) -> Vec<f64> {
        let rises: Vec<f64> = self.0.iter().map(|(_, tau_s)| 1.0 - (-1.0 / (FINE_HZ * tau_s)).exp()).collect();
        let mut states = vec![0.0; self.0.len()];
        let step = |volts: &f64| {
            let load = volts * volts;
            for ((state, (share, _)), rise) in states.iter_mut().zip(&self.0).zip(&rises) {
                *state += (share * load - *state) * rise;
            }
            load + states.iter().sum::<f64>()
        };
        volts.iter().map(step).collect()
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Drive {
    Sine,
    Ramps,
    /// Between two rows, anywhere.
    Steps,
    /// With a row, which has the new voltage already.
    HeldSteps,
    /// A sine in one recording, steps in the other.
    Both,
}

const DRIVES: [Drive; 5] = [Drive::Sine, Drive::Ramps, Drive::Steps, Drive::HeldSteps, Drive::Both];

impl Drive {
    /// The voltage (share of the largest) at each step of the film, after 2 s of rest.
    fn volts(self, seconds: f64, every: usize, random: &mut Pcg64) -> Vec<f64> {
        let count = (seconds * FINE_HZ) as usize;
        let after_rest = |at: &dyn Fn(f64) -> f64| -> Vec<f64> {
            (0..count).map(|k| k as f64 / FINE_HZ - 2.0).map(|t| if t < 0.0 { 0.0 } else { at(t) }).collect()
        };
        match self {
            Self::Sine | Self::Both => {
                let (hz, peak) = (10f64.powf(random.random_range(-1.0..0.2)), random.random_range(0.6..1.0));
                after_rest(&|t| 0.5 * peak * (1.0 - (TAU * hz * t).cos()))
            }
            Self::Ramps => {
                let (rise_s, hold_s) = (random.random_range(0.2..2.0), random.random_range(0.5..3.0));
                let each_s = 2.0 * (rise_s + hold_s);
                after_rest(&|t| {
                    let size = if (t / each_s) as i64 % 2 == 0 { 1.0 } else { 0.6 };
                    let t = t % each_s;
                    size * (t / rise_s).min((2.0 * rise_s + hold_s - t) / rise_s).clamp(0.0, 1.0)
                })
            }
            Self::Steps | Self::HeldSteps => {
                let mut volts = vec![0.0; count];
                let (mut at, mut level) = (2 * FINE_HZ as usize, 0.0);
                while at < count {
                    // Up and down in turn, by a quarter at least.
                    level = if level < 0.5 { random.random_range(0.75..1.0) } else { random.random_range(0.0..0.5) };
                    let from = if self == Self::HeldSteps { at / every * every } else { at };
                    volts[from..].fill(level);
                    at += (random.random_range(1.0..5.0) * FINE_HZ) as usize;
                }
                volts
            }
        }
    }
}

/// Two recordings of a random film at a random rate, `late_s` behind it.
fn recordings(drive: Drive, late_s: f64, seed: u64) -> Vec<Recording> {
    let mut random = Pcg64::seed_from_u64(seed);
    let film = Film::random(&mut random);
    let rate_hz = [50.0, 100.0, 100.0, 200.0, 500.0, 1000.0][random.random_range(0..6)];
    let (seconds, every) = (if rate_hz > 300.0 { 20.0 } else { 40.0 }, (FINE_HZ / rate_hz) as usize);
    let (noise_m, late) = (1e-3 * 10f64.powf(random.random_range(-4.0..-2.4)), (late_s * FINE_HZ).round() as usize);
    let record = |number: u64| {
        let drive = if drive == Drive::Both && number == 1 { Drive::Steps } else { drive };
        let volts = drive.volts(seconds, every, &mut random);
        let strokes = film.strokes(&volts);
        let mut noise = noise(100 * seed + number, noise_m);
        let row = |k: usize| {
            let read_m = if k < late { 0.0 } else { 1e-3 * strokes[k - late] };
            [k as f64 / FINE_HZ, PEAK_V * volts[k], read_m + noise()]
        };
        recording(&format!("{number}.csv"), &(0..volts.len()).step_by(every).map(row).collect::<Vec<_>>())
    };
    (0..2).map(record).collect()
}

fn fitted(recordings: &[Recording]) -> Fit {
    let options = FitOptions {
        branches: Branches::Number(1),
        topology: TopologyChoice::Parallel,
        curve: CurveChoice::None,
        starts: 2,
        ..FitOptions::default()
    };
    // The films have no mass.
    fitted_to(recordings, &options, Actuator { mass_kg: 0.0, ..Actuator::KARNER_2022 }).expect("a fit").0
}

/// The findings of `check` about a sensor or a drive that is late.
fn found(recordings: &[Recording]) -> Vec<String> {
    let findings = check::check(recordings).findings.into_iter().map(|finding| finding.finding);
    findings.filter(|finding| finding.contains(" lags the ")).collect()
}

/// A film moves just after the row that has the new voltage: its readings are late by a row, and its sensor is not.
#[test]
fn the_time_between_two_rows_is_no_delay_of_the_sensor() {
    let count = if full_sweep() { 40 } else { 2 };
    (0..count).into_par_iter().for_each(|seed| {
        let recordings = recordings(Drive::HeldSteps, 3e-4, seed);
        let fit = fitted(&recordings);
        let warnings: Vec<_> = fit.warnings.iter().filter(|warning| warning.text.contains("lags")).collect();
        assert!(fit.candidate.delay_s == 0.0 && warnings.is_empty(), "{seed}: {warnings:?}");
        assert_eq!(found(&recordings), Vec::<String>::new(), "{seed}");
    });
}

/// The interval that a fit or a check states contains the delay.
#[test]
fn the_interval_contains_the_delay() {
    let count = if full_sweep() { 200 } else { 5 };
    let named: Vec<[bool; 2]> = (0..count)
        .into_par_iter()
        .map(|seed| {
            let drive = DRIVES[seed as usize % DRIVES.len()];
            let late_s = [0.03, 0.02, 0.01, 0.005][(seed / DRIVES.len() as u64 % 4) as usize];
            let recordings = recordings(drive, late_s, 1000 + seed);
            let case = format!("{seed} {drive:?} {late_s} s");
            let (fit, found) = (fitted(&recordings), found(&recordings));
            println!("{case}: fit {} s, {found:?}", fit.candidate.delay_s);
            let estimates = fit.uncertainty.expect("computed").estimates;
            let of_fit = estimates.into_iter().find(|estimate| estimate.name == "delay_s");
            if let Some((low, high)) = of_fit.as_ref().and_then(|estimate| estimate.low.zip(estimate.high)) {
                assert!(low <= late_s && late_s <= high, "{case}: {low} to {high} s");
            }
            // Lags of cycles are stated without an interval.
            let of_check = found.iter().find_map(|text| Some(text.split_once(" ms (")?.1.split_once(" ms)")?.0));
            if let Some((low, high)) = of_check.and_then(|interval| interval.split_once(" to ")) {
                let [low, high] = [low, high].map(|ms| 1e-3 * ms.parse::<f64>().expect("a number"));
                assert!(low <= late_s && late_s <= high, "{case}: {found:?}");
            }
            [of_fit.is_some(), !found.is_empty()]
        })
        .collect();
    let [of_fit, of_check] = [0, 1].map(|k| named.iter().filter(|named| named[k]).count());
    println!("of {count} delays fit names {of_fit}, check {of_check}");
    assert!(3 * of_fit > count as usize && 4 * of_check > count as usize, "{named:?}");
}

/// A check reports no delay of a sensor that has none.
#[test]
fn a_prompt_sensor_is_not_late() {
    let count = if full_sweep() { 240 } else { 5 };
    (0..count).into_par_iter().for_each(|seed| {
        let drive = DRIVES[seed as usize % DRIVES.len()];
        assert_eq!(found(&recordings(drive, 0.0, 2000 + seed)), Vec::<String>::new(), "{seed} {drive:?}");
    });
}
