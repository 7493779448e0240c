//! Fits of random recordings with random options: each ends with a fit that states its agreement, or with an error.
//!
//! `cargo xtask campaign fits` tries 10 000, and prints how far it is.

use std::f64::consts::TAU;
use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::recorded::fitted_to;
use crate::sweep::full_sweep;
use host_io::files::import::Quantity;
use host_io::files::parameters::Parameters;
use host_io::files::recording::{Direction, Recording};
use host_models::fit::options::{AtGap, Branches, Sharing, TopologyChoice, Weight};
use host_models::fit::settings::CurveChoice;
use host_models::fit::{self, Fit, FitOptions, Loss, Method};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::{Actuator, LawOptions, Maxwell, Springpot, Topology};

/// One of `choices`.
fn any<T: Copy>(random: &mut Pcg64, choices: &[T]) -> T {
    choices[random.random_range(0..choices.len())]
}

/// A power of ten between two.
fn size(random: &mut Pcg64, low: f64, high: f64) -> f64 {
    10f64.powf(random.random_range(low..high))
}

fn times(random: &mut Pcg64) -> Vec<f64> {
    let rows = any(random, &[2, 12, 30, 30, 60, 60, 120, 120, 250]);
    let step_s = size(random, -3.0, 1.0);
    let uneven = random.random_bool(0.2);
    let mut t = if random.random_bool(0.8) { 0.0 } else { size(random, -3.0, 4.0) };
    let mut next = || {
        let now = t;
        t += step_s * if uneven { size(random, -1.0, 1.0) } else { 1.0 };
        now
    };
    (0..rows).map(|_| next()).collect()
}

/// A drive from 0 to 1.
fn drive(random: &mut Pcg64, time_s: &[f64]) -> Vec<f64> {
    let duration_s = time_s[time_s.len() - 1] - time_s[0];
    let hz = random.random_range(0.5..8.0) / duration_s;
    let kind = random.random_range(0..7);
    let level = random.random_range(0.0..1.0);
    let at = |t: &f64| match kind {
        0..=2 => 0.5 * (1.0 - (TAU * hz * (t - time_s[0])).cos()),
        3 => f64::from((t * hz) as i32 % 2),
        4 => (t - time_s[0]) / duration_s,
        5 => level,
        _ => (TAU * hz * t).sin(),
    };
    time_s.iter().map(at).collect()
}

/// Readings of a film, or of something else, under a `drive`.
fn measured(random: &mut Pcg64, time_s: &[f64], drive: &[f64]) -> Vec<f64> {
    let mean_step_s = (time_s[time_s.len() - 1] - time_s[0]) / (time_s.len() - 1) as f64;
    let mut element = || Springpot::new(size(random, -0.5, 0.5), random.random_range(0.0..1.0));
    let branches = [[element(), element()]];
    let model = Maxwell::new(element(), &branches, Topology::Parallel, 0.0).expect("a model");
    let mut values: Vec<f64> = match random.random_range(0..8) {
        0..=4 => {
            let law = springpot::Law::<f64, springpot::Compressed<f64, 8, 16, 8>>::compressed(
                &model,
                LawOptions::at_step(mean_step_s.max(1e-6)).with_tolerance(f64::MAX),
            );
            match law {
                Ok(law) => {
                    let mut state = law.state();
                    drive.iter().map(|&f| law.displacement(&mut state, f)).collect()
                }
                Err(_) => drive.to_vec(),
            }
        }
        5 => drive.iter().map(|_| random.random_range(-1.0..1.0)).collect(),
        6 => vec![random.random_range(-1.0..1.0); drive.len()],
        _ => drive.iter().map(|f| f * f * f).collect(),
    };
    let (scale, offset) = match random.random_range(0..8) {
        0 => (size(random, -14.0, 12.0), 0.0),
        1 => (1e-3, size(random, -3.0, 6.0)),
        2 => (-1e-3, 0.0),
        _ => (1e-3, 0.0),
    };
    let noise = any(random, &[0.0, 1e-3, 1e-2, 0.5]);
    let rare = any(random, &[0.0, 0.0, 0.02]);
    for value in &mut values {
        *value = offset + scale * (*value + noise * random.random_range(-1.0..1.0));
        if random.random_bool(rare) {
            *value = any(random, &[f64::NAN, 0.0, 1e3, -1e15]);
        }
    }
    values
}

/// Temperatures (°C) of recordings, of which some have none: mostly those of a film.
fn temperatures(seed: u64) -> [Option<f64>; 3] {
    let mut random = Pcg64::seed_from_u64(!seed);
    [0; 3].map(|_| {
        let temperature_c = any(&mut random, &[20.0, 20.0, 21.0, 35.0, 50.0, -40.0, 400.0]);
        (seed % 5 == 3 && random.random_bool(0.95)).then_some(temperature_c)
    })
}

fn recordings(random: &mut Pcg64, temperatures_c: [Option<f64>; 3]) -> Vec<Recording> {
    let count = any(random, &[1, 1, 2, 2, 3]);
    let peak = any(random, &[3500.0, 3500.0, 3500.0, 3500.0, 3500.0, 3500.0, 1e-3, 1e9, 0.0]);
    let is_force = random.random_bool(0.3);
    let recording = |k: usize| {
        let time_s = times(random);
        let drive = drive(random, &time_s);
        // At rest until the drive begins, and in proportion to its square.
        let force: Vec<f64> = drive.iter().map(|u| u * u).collect();
        let displacement = measured(random, &time_s, &force);
        let mut columns = vec![(Quantity::Voltage, drive.iter().map(|u| peak * u).collect::<Vec<f64>>())];
        if is_force {
            columns.push((Quantity::Force, displacement.iter().map(|x| 1e3 * x).collect()));
            columns.swap_remove(usize::from(random.random_bool(0.5)));
        }
        if random.random_bool(0.1) {
            columns.push((Quantity::Weight, drive.iter().map(|u| u.max(0.0)).collect()));
        }
        columns.push((Quantity::Displacement, displacement));
        columns.extend(temperatures_c[k].map(|value| (Quantity::Temperature, vec![value; drive.len()])));
        Recording::of_values(&format!("{k}.csv"), time_s, columns).ok()
    };
    (0..count).filter_map(recording).collect()
}

fn options(random: &mut Pcg64, count: usize) -> FitOptions {
    let names = ["stretch_coupling", "offset_m", "mass_kg", "relative_permittivity", "length_m", "thickness_m"];
    let sharing = [Sharing::Joint, Sharing::Joint, Sharing::Joint, Sharing::PerRecording];
    let mut some = || if random.random_bool(0.2) { vec![any(random, &names).to_owned()] } else { Vec::new() };
    let (free, hold) = (some(), some());
    let weights = match random.random_range(0..6) {
        0 => vec![Weight::LogTime],
        1 => (0..count).map(|_| Weight::Recording(size(random, -2.0, 2.0))).collect(),
        _ => Vec::new(),
    };
    let (offset, gain) = (any(random, &sharing), any(random, &sharing));
    let is_joint = (offset, gain) == (Sharing::Joint, Sharing::Joint);
    let branches = any(random, &[0, 0, 1, 1, 1, 2, 3, 9]);
    use CurveChoice::{Auto, Both, Free, Gent, MooneyRivlin, None as Linear, Saturation};
    FitOptions {
        branches: if branches == 9 { Branches::Auto } else { Branches::Number(branches) },
        topology: any(random, &[TopologyChoice::Parallel, TopologyChoice::Eq11, TopologyChoice::Auto]),
        curve: any(random, &[Linear, Auto, Auto, Auto, Saturation, MooneyRivlin, Gent, Free, Both]),
        method: if random.random_bool(0.02) { Method::PatternSearch } else { Method::Lm },
        drive: if random.random_bool(0.15) { Direction::Displacement } else { Direction::Force },
        free,
        hold,
        loss: if is_joint { any(random, &[Loss::Square, Loss::Huber]) } else { Loss::Square },
        weights,
        offset,
        gain,
        sensor_delay_s: any(random, &[None, None, Some(0.0), Some(0.1)]),
        gap_s: any(random, &[None, None, Some(0.5)]),
        at_gap: any(random, &[AtGap::End, AtGap::Skip]),
        invert: random.random_bool(0.1),
        from_s: any(random, &[0.0, 0.0, 0.0, 0.0, 0.0, 0.1]),
        starts: any(random, &[1, 2, 3]),
        ..FitOptions::default()
    }
}

/// The fit of a random case, if it has one.
fn fitted(seed: u64) -> Result<Fit, String> {
    let mut random = Pcg64::seed_from_u64(seed);
    let recordings = recordings(&mut random, temperatures(seed));
    let options = options(&mut random, recordings.len());
    let text_of = |error: host_io::Error| error.to_string();
    let (fit, settings, _) = fitted_to(&recordings, &options, Actuator::KARNER_2022).map_err(text_of)?;
    let recordings: Vec<&Recording> = recordings.iter().collect();
    let parameters = fit.parameters(&settings, options.drive, &recordings).map_err(text_of)?;
    let text = parameters.to_toml();
    Parameters::from_toml("fit.toml".as_ref(), &text).unwrap_or_else(|error| panic!("{error}\n{text}"));
    Ok(fit)
}

fn fault(fit: &Fit) -> Option<String> {
    let stated = |value: f64| value.is_finite();
    let agreements = fit.agreements.iter().all(|a| stated(a.r2) && stated(a.nrmse_pct) && stated(a.rmse));
    if fit.agreements.is_empty() || !agreements || !stated(fit.r2_mean) {
        return Some(format!("no agreement: {:?}", fit.agreements));
    }
    if fit.structures.iter().any(|row| row.delta_aic.is_nan() || row.nrmse_pct.is_nan()) {
        return Some(format!("no criterion: {:?}", fit.structures));
    }
    let estimates = fit.uncertainty.iter().flat_map(|uncertainty| &uncertainty.estimates);
    let wrong = |e: &&fit::Estimate| {
        let ends = [e.low, e.high, e.linear.map(|l| l.0), e.linear.map(|l| l.1)];
        !stated(e.value) || ends.into_iter().flatten().any(f64::is_nan)
    };
    estimates.into_iter().find(wrong).map(|estimate| format!("{estimate:?}"))
}

#[test]
fn a_random_fit_states_its_agreement_or_is_refused() {
    let cases = if full_sweep() { 10_000 } else { 12 };
    let mut fits = 0;
    let mut faults = Vec::new();
    // Of 1610 nothing that changes is left in a thinned recording, the saturation of 2645 ends at infinity, and the spring of 4834 falls too
    // steeply beyond the recorded strokes.
    for seed in (0..cases).chain([1610, 2645, 4834]) {
        if seed % 250 == 0 && seed > 0 {
            println!("{seed} cases, {fits} fits, {faults:?}");
        }
        match catch_unwind(AssertUnwindSafe(|| fitted(seed))) {
            Ok(Ok(fit)) => {
                fits += 1;
                faults.extend(fault(&fit).map(|fault| format!("{seed}: {fault}")));
            }
            // A refusal is one line that says what is wrong.
            Ok(Err(refusal)) => {
                if refusal.is_empty() || refusal.contains('\n') {
                    faults.push(format!("{seed}: {refusal:?}"));
                }
            }
            Err(_) => faults.push(format!("{seed}: panic")),
        }
    }
    println!("{fits} of {cases} random cases have a fit, {} of them are wrong", faults.len());
    assert!(faults.is_empty(), "{faults:#?}");
    assert!(4 * fits > cases, "{fits} of {cases}");
}
