//! The film as its own sensor, on a simulated film in its circuit.
//!
//! `SPRINGPOT_SWEEP=full cargo test --release -p host-models --test it self_sensing -- --nocapture` prints the tables of docs/results.md;
//! the default runs a sample.

use std::f64::consts::TAU;

use host_io::files::capacitance::ToneRecording;
use host_io::grid::Grid;
use host_models::fit::capacitance::{self, CapacitanceFit, CapacitanceSample, Prospect};
use host_models::references::minimum_jerk;
use host_models::replay::memory::Precision;
use host_models::simulation::controllers::{self, ControllerKind, ControllerSettings};
use host_models::simulation::electrical::{ElectricalBench, ElectricalFault, FilmCircuit, Monitors};
use host_models::simulation::film::{self, Film, Instruments, Waveform};
use host_models::simulation::film_recording::{self, Session};
use host_models::simulation::plant::NonlinearPlant;
use host_models::simulation::self_sensed::{self, SensedBench};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::{
    CapacitanceRelation, CommandLimits, ObserverOptions, SelfSensing, SelfSensingFault, SelfSensingOptions,
};

use crate::hours::Kind;
use crate::recorded::{controller, far, peak, rms};
use crate::sweep::full_sweep;

const STEP_S: f64 = 1e-3;
/// Advances of the plant in a tick.
const SUBSTEPS: usize = 2;
const TONE_V: f64 = 50.0;

/// A block: what was sensed of it, and where the film really was then.
#[derive(Clone, Copy, Debug)]
struct Block {
    sensed_m: f64,
    stated_m: f64,
    capacitance_f: f64,
    film_m: f64,
}

/// Runs `bench` for so many `seconds` under `drive` (V, of a time in s) and the tone, and senses it.
fn sensed(
    bench: &mut ElectricalBench,
    relation: &CapacitanceRelation,
    options: SelfSensingOptions,
    seconds: f64,
    drive: impl Fn(f64) -> f64,
) -> Vec<Block> {
    let sensing = SelfSensing::<f32>::new(relation, options).expect("valid");
    let mut run = SensedBench::at_rest(bench, &sensing);
    let (mut film, mut blocks) = (Vec::new(), Vec::new());
    for k in 0..(seconds / STEP_S).round() as usize {
        film.push(run.bench().plant().displacement_m());
        if let Some(sensed) = run.sense() {
            blocks.push(Block {
                sensed_m: f64::from(sensed.sample.displacement_m),
                stated_m: f64::from(sensed.uncertainty_m()),
                capacitance_f: f64::from(sensed.capacitance_f),
                // Over the 20 ticks of the block.
                film_m: film[k - sensed.sample.age_ticks - 10..][..20].iter().sum::<f64>() / 20.0,
            });
        }
        run.drive(drive(k as f64 * STEP_S));
        assert_eq!(run.fault(), None, "at {} s", k as f64 * STEP_S);
    }
    blocks
}

/// A recording to calibrate with: rest, then levels that are held, with cycles of 0.5 and 2 Hz in each, over so many `seconds`.
fn calibration_v(t: f64, seconds: f64, peak_v: f64) -> f64 {
    let levels = [0.0, 0.7, 0.95, 0.4, 1.0, 0.6, 0.85, 0.25, 0.75];
    let each = (seconds - 2.0) / (levels.len() - 1) as f64;
    let place = ((t - 2.0) / each).max(0.0);
    let (level, part) = ((place as usize).min(levels.len() - 2), place.fract());
    let (from, to) = (levels[level], levels[level + 1]);
    let smooth = |share: f64| 0.5 * (1.0 - (0.5 * TAU * share.clamp(0.0, 1.0)).cos());
    let since = part * each;
    let swing = |from: f64, hz: f64| match since / each - from {
        place if (0.0..0.1).contains(&place) => {
            0.5 * (1.0 - (TAU * hz * place * each).cos()) * smooth(10.0 * place) * smooth(10.0 - 100.0 * place)
        }
        _ => 0.0,
    };
    peak_v * (from + (to - from) * smooth(since) - 0.3 * to * (swing(0.5, 0.5) + swing(0.7, 2.0)))
}

/// The relation of a film, as `fit` finds it in a recording with a sensor of 5 µm.
fn calibrated(film: &Film, circuit: FilmCircuit, monitors: Monitors, seconds: f64, peak_v: f64) -> CapacitanceFit {
    let mut plant = NonlinearPlant::at_rest(film, STEP_S / SUBSTEPS as f64);
    let mut bench = ElectricalBench::new(circuit, monitors, &mut plant, (SUBSTEPS, STEP_S), 11);
    let options = monitors.options(&circuit, TONE_V, STEP_S);
    let guess = circuit.relation_of_sizes(8e-3);
    let blocks = sensed(&mut bench, &guess, options, seconds, |t| calibration_v(t, seconds, peak_v));
    let mut random = Pcg64::seed_from_u64(5);
    let samples: Vec<CapacitanceSample> = blocks
        .iter()
        .map(|block| {
            // Two readings of a sensor of 100 Hz in a block.
            let noise = 5e-6 / 2f64.sqrt() * (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>();
            CapacitanceSample { capacitance_f: block.capacitance_f, displacement_m: block.film_m + noise }
        })
        .collect();
    capacitance::fit(&samples, options.sample_interval_s()).expect("a relation")
}

/// Errors (% of the stroke) of a film under a drive of `hz`: of blocks, and of 50 ms.
fn stroke_errors_pct(
    film: &Film,
    circuit: FilmCircuit,
    relation: &CapacitanceRelation,
    tone_v: f64,
    hz: f64,
) -> [f64; 2] {
    let monitors = Monitors::default();
    let mut plant = NonlinearPlant::at_rest(film, STEP_S / SUBSTEPS as f64);
    let mut bench = ElectricalBench::new(circuit, monitors, &mut plant, (SUBSTEPS, STEP_S), 3);
    let options = monitors.options(&circuit, tone_v, STEP_S);
    let drive = |t: f64| 2250.0 - 1750.0 * (TAU * hz * t).cos();
    let blocks = sensed(&mut bench, relation, options, 40.0, drive);
    let late = &blocks[blocks.len() / 2..];
    let (low, high) = late.iter().fold((f64::MAX, f64::MIN), |(l, h), b| (l.min(b.film_m), h.max(b.film_m)));
    let error = |block: &Block| block.sensed_m - block.film_m;
    // 50 ms: two and a half blocks.
    let windows = late.windows(3).map(|w| (0.75 * error(&w[0]) + error(&w[1]) + 0.75 * error(&w[2])) / 2.5);
    let errors = [late.iter().map(error).collect(), windows.collect()]
        .map(|errors: Vec<f64>| 100.0 * rms(&errors) / (high - low));
    println!(
        "| {tone_v} V | {hz} Hz, {:.2} mm | {:.2} | {:.2} | {:.2} |",
        1e3 * (high - low),
        errors[0],
        errors[1],
        100.0 * late[100].stated_m / (high - low)
    );
    errors
}

#[test]
fn strokes_are_sensed_within_a_percent() {
    let (kinds, frequencies) = match full_sweep() {
        true => (vec![film::Plant::Hossain, film::Plant::Wang], vec![0.2, 0.5, 1.0, 2.0, 3.0]),
        false => (vec![film::Plant::Hossain], vec![0.2, 3.0]),
    };
    for plant in kinds {
        let film = Film::new(plant);
        let circuit = FilmCircuit { creep: 0.05, ..FilmCircuit::of_film(&film) };
        let fit = calibrated(&film, circuit, Monitors::default(), 600.0, 5000.0);
        println!("{plant:?}: {:?}, without creep {:.1e} m", fit.relation, fit.rms_without_creep_m);
        // The springpot explains what a curve alone does not; noise is left.
        assert!(fit.rms_m < 0.003 * fit.stroke_m && fit.rms_m < 0.8 * fit.rms_without_creep_m, "{fit:?}");
        for &hz in &frequencies {
            let [_, window] = stroke_errors_pct(&film, circuit, &fit.relation, TONE_V, hz);
            assert!(window < 1.0, "{plant:?}, {hz} Hz: {window:.2} % of the stroke");
            if full_sweep() {
                let small = [20.0, 10.0].map(|tone_v| stroke_errors_pct(&film, circuit, &fit.relation, tone_v, hz)[1]);
                assert!(small[0] < small[1], "less tone, more noise: {small:?}");
            }
        }
    }
}

#[test]
fn the_tone_does_not_move_the_film() {
    let film = Film::new(film::Plant::Hossain);
    let circuit = FilmCircuit::of_film(&film);
    let moved = |tone_v: f64| {
        let mut plant = NonlinearPlant::at_rest(&film, STEP_S / SUBSTEPS as f64);
        let mut bench = ElectricalBench::new(circuit, Monitors::default(), &mut plant, (SUBSTEPS, STEP_S), 1);
        let mut film_m = Vec::new();
        for k in 0..20_000 {
            let drive = 3000.0 - 1000.0 * (TAU * 0.2 * f64::from(k) * STEP_S).cos();
            bench.tick(drive + tone_v * [0.0, 1.0, 0.0, -1.0][k as usize % 4]);
            film_m.push(bench.plant().displacement_m());
        }
        film_m
    };
    let (without, with) = (moved(0.0), moved(TONE_V));
    let stroke = without[10_000..].iter().fold(0.0, |high: f64, x| high.max(*x))
        - without[10_000..].iter().fold(1.0, |low: f64, x| low.min(*x));
    let largest = far(&with, &without);
    println!("the tone moves the film by {:.4} % of {:.2} mm", 100.0 * largest / stroke, 1e3 * stroke);
    assert!(largest < 3e-3 * stroke, "{largest:e} of {stroke:e} m");
}

/// Largest and RMS error (%) of a displacement that is held for half an hour, with the film as the only sensor.
fn held_pct(plant: film::Plant, creep: f64, stiffness: f64) -> [f64; 2] {
    let (kind, held_m) = match plant {
        film::Plant::Hossain => (Kind::Hossain, 3e-3),
        film::Plant::Wang => (Kind::Wang, 1.2e-3),
    };
    let as_recorded = Film::new(plant);
    let (circuit, monitors) = (FilmCircuit { creep, ..FilmCircuit::of_film(&as_recorded) }, Monitors::default());
    // Calibrated as it was recorded, for as long as it will be held.
    let relation = calibrated(&as_recorded, circuit, monitors, 1800.0, 5000.0).relation;
    let film = as_recorded.warmed(stiffness, 1.0);
    let options = monitors.options(&circuit, TONE_V, STEP_S);
    let sensing = SelfSensing::<f32>::new(&relation, options).expect("valid");
    let observer = ObserverOptions {
        sample_interval_s: options.sample_interval_s(),
        delay_s: STEP_S * options.age_ticks() as f64,
        lost_after_s: 0.2,
        ..ObserverOptions::at_bandwidth(0.6)
    };
    let limits = CommandLimits { max_voltage_v: 5900.0, max_field_v_per_m: 1e8, ..CommandLimits::BENCH };
    let settings = ControllerSettings { rate_hz: 1.0 / STEP_S, limits, observer, learning: None, peak_m: held_m };
    let parameters = kind.parameters();
    let mut controller =
        controllers::build(ControllerKind::Tracking, &parameters, &settings, Precision::F32).expect("valid");
    let mut plant_in_motion = NonlinearPlant::at_rest(&film, STEP_S / SUBSTEPS as f64);
    let mut bench = ElectricalBench::new(circuit, monitors, &mut plant_in_motion, (SUBSTEPS, STEP_S), 17);
    let mut sensed = SensedBench::at_rest(&mut bench, &sensing);
    let grid = Grid::covering(1810.0, 1.0 / STEP_S).expect("a grid");
    let reference = |k: usize| held_m * minimum_jerk(grid.time_s(k) / 5.0);
    let mut errors = Vec::new();
    let found = self_sensed::follow(&mut sensed, controller.as_mut(), reference, grid, |k, _, tick| {
        if grid.time_s(k) >= 10.0 {
            errors.push(100.0 * (tick.displacement_m - tick.asked_m) / held_m);
        }
        Ok(())
    });
    assert_eq!(found.expect("no pull-in"), None, "no fault");
    let [rms, largest] = [rms, peak].map(|of| of(&errors));
    println!("| {plant:?} | creep {creep} | stiffness {stiffness} | {rms:.2} | {largest:.2} |");
    [rms, largest]
}

#[test]
fn half_an_hour_is_held_without_another_sensor() {
    let mut cases = vec![(film::Plant::Hossain, 0.05, 0.8)];
    if full_sweep() {
        for plant in [film::Plant::Hossain, film::Plant::Wang] {
            for creep in [0.05, -0.05, 0.0] {
                cases.extend([0.8, 1.0, 1.2].map(|stiffness| (plant, creep, stiffness)));
            }
        }
    }
    for (plant, creep, stiffness) in cases {
        let [rms, _] = held_pct(plant, creep, stiffness);
        let most = if stiffness == 1.0 { 0.5 } else { 1.0 };
        assert!(rms < most, "{plant:?}, creep {creep}, stiffness {stiffness}: {rms:.2} %");
    }
}

#[test]
fn what_breaks_ends_at_0_v_within_a_tenth_of_a_second() {
    let film = Film::new(film::Plant::Hossain);
    let (circuit, monitors) = (FilmCircuit::of_film(&film), Monitors::default());
    let options = monitors.options(&circuit, TONE_V, STEP_S);
    let sensing = SelfSensing::<f32>::new(&circuit.relation_of_sizes(5e-3), options).expect("valid");
    let cases = [
        (ElectricalFault::LostElectrode, SelfSensingFault::Electrode),
        (ElectricalFault::Shorted(1e5), SelfSensingFault::Shorted),
        (ElectricalFault::Shorted(3e6), SelfSensingFault::Shorted),
        (ElectricalFault::CurrentMonitor(0.0), SelfSensingFault::CurrentMonitor),
        (ElectricalFault::CurrentMonitor(0.25e-3), SelfSensingFault::CurrentMonitor),
        (ElectricalFault::CurrentMonitor(f64::NAN), SelfSensingFault::CurrentMonitor),
    ];
    let parameters = Kind::Hossain.parameters();
    for (broken, cause) in cases {
        // At any tick of a block.
        for at in [2000, 2003, 2007, 2012, 2018] {
            let mut plant = NonlinearPlant::at_rest(&film, STEP_S / SUBSTEPS as f64);
            let mut bench = ElectricalBench::new(circuit, monitors, &mut plant, (SUBSTEPS, STEP_S), 1);
            let mut sensed = SensedBench::at_rest(&mut bench, &sensing);
            let mut controller = controller(ControllerKind::Feedforward, &parameters, CommandLimits::BENCH, None, 2e-3);
            let grid = Grid::covering(2.3, 1.0 / STEP_S).expect("a grid");
            let reference = |k: usize| 2e-3 * minimum_jerk(grid.time_s(k) / 1.5);
            let mut live = 0;
            let found = self_sensed::follow(&mut sensed, controller.as_mut(), reference, grid, |k, bench, _| {
                if k == at {
                    bench.break_down(broken);
                }
                // An amplifier, and with it the film, at 0 V.
                live = if bench.amplifier_v() > 1.0 { k } else { live };
                Ok(())
            });
            let (fault, tick) = found.expect("no pull-in").unwrap_or_else(|| panic!("{broken:?} at {at}: not found"));
            assert_eq!(fault, cause, "{broken:?} at {at}");
            assert!(tick > at && live < at + 100, "{broken:?} at {at}: found at {tick}, above 0 V until {live}");
        }
    }
}

/// A recording of two minutes with a tone of `tone_v` (V), by converters of so many bits.
fn recording(bits: u32, tone_v: f64) -> ToneRecording {
    recording_at(1000.0, bits, tone_v)
}

/// The same at another rate, Hz.
fn recording_at(rate_hz: f64, bits: u32, tone_v: f64) -> ToneRecording {
    let session = Session {
        waveform: Waveform { peak_v: 5500.0, frequencies_hz: vec![0.05] },
        duration_s: 120.0,
        rate_hz,
        instruments: Instruments::default(),
        seed: 4,
    };
    let monitors = Monitors { bits, ..Monitors::default() };
    film_recording::with_tone(&session, &Film::new(film::Plant::Hossain), monitors, tone_v).expect("a recording")
}

#[test]
fn monitors_of_16_bits_suffice_and_of_12_do_not() {
    let (file, report) = capacitance::identify(&recording(16, 50.0), 100e-12).expect("identified");
    assert!(report.senses && report.noise_pct < 0.2 && report.residual_pct < 0.3, "{report:?}");
    assert!((report.tone_v - 50.0).abs() < 0.1, "{report:?}");
    // Two bits of 6 kV, and the film's own geometry: λ² of 599 pF, with the cable.
    assert!((report.voltage_noise_v / (2.0 * 6000.0 / 65536.0) - 1.0).abs() < 0.15, "{report:?}");
    assert!((report.rest_f / 699.0e-12 - 1.0).abs() < 0.003, "{report:?}");
    assert!(SelfSensing::<f32>::new(&file.relation, file.options).is_ok());
    let (_, report) = capacitance::identify(&recording(12, 50.0), 100e-12).expect("identified");
    assert!(!report.senses && report.noise_pct > 1.0, "{report:?}");
    // A small tone on good monitors.
    let (_, report) = capacitance::identify(&recording(16, 3.0), 100e-12).expect("identified");
    assert!(!report.senses && report.noise_pct > 1.0, "{report:?}");
    let silent = ToneRecording {
        voltage_v: vec![1000.0; 20_000],
        current_a: vec![1e-6; 20_000],
        displacement_m: vec![0.0; 20_000],
        step_s: 1e-3,
    };
    let refused = capacitance::identify(&silent, 0.0).expect_err("no tone").to_string();
    assert!(refused.contains("no tone"), "{refused}");
}

/// Columns in other units than their names have are those of no film.
#[test]
fn columns_in_other_units_are_refused_with_the_unit() {
    let good = recording(16, 50.0);
    let scaled = |values: &[f64], size: f64| values.iter().map(|value| size * value).collect::<Vec<_>>();
    // Factors on voltage, current and displacement.
    let cases = [
        ("is current_a in mA? multiply it by 1e-3", [1.0, 1e3, 1.0]),
        ("is current_a in µA? multiply it by 1e-6", [1.0, 1e6, 1.0]),
        ("is current_a in nA? multiply it by 1e-9", [1.0, 1e9, 1.0]),
        ("is voltage_v in kV? multiply it by 1e3", [1e-3, 1.0, 1.0]),
        ("is displacement_m in mm? multiply it by 1e-3", [1.0, 1.0, 1e3]),
        ("is displacement_m in µm? multiply it by 1e-6", [1.0, 1.0, 1e6]),
    ];
    for (advice, [volts, amperes, metres]) in cases {
        let wrong = ToneRecording {
            voltage_v: scaled(&good.voltage_v, volts),
            current_a: scaled(&good.current_a, amperes),
            displacement_m: scaled(&good.displacement_m, metres),
            step_s: good.step_s,
        };
        let refused = capacitance::identify(&wrong, 0.0).expect_err(advice).to_string();
        assert!(refused.ends_with(advice), "{refused}");
    }
}

/// A board refuses blocks in which a fault is found after more than 0.1 s: three of them and a row.
#[test]
fn blocks_are_short_enough_for_a_board_at_every_rate() {
    for (rate_hz, periods) in [(250.0, 2), (400.0, 3), (500.0, 4), (2000.0, 5)] {
        let (file, report) = capacitance::identify(&recording_at(rate_hz, 16, 50.0), 100e-12).expect("identified");
        assert_eq!(file.options.periods, periods, "{rate_hz} Hz");
        assert!((report.rest_f / 699.0e-12 - 1.0).abs() < 0.01, "{rate_hz} Hz: {report:?}");
    }
    let slow = recording_at(200.0, 16, 50.0);
    let refused = capacitance::identify(&slow, 100e-12).expect_err("too slow").to_string();
    assert!(refused.contains("5.000 ms") && refused.contains("use 250 Hz or more"), "{refused}");
}

#[test]
fn boards_that_do_not_pass_the_tone_say_why() {
    let mut board = Kind::Hossain.parameters().board_or_bench(1000.0);
    // 79 kV/s for 50 V at 250 Hz, and 50 kV/s by default.
    let refusals = capacitance::refusals(&board, 50.0, 1e-3);
    assert!(
        matches!(refusals.as_slice(), [slew] if slew.contains("79 kV/s") && slew.contains("or use 31 V")),
        "{refusals:?}"
    );
    board.limits.max_slew_v_per_s = 100e3;
    assert!(capacitance::refusals(&board, 50.0, 1e-3).is_empty());
    board.amplifier_lag.rise_s = 0.1;
    let refusals = capacitance::refusals(&board, 50.0, 1e-3);
    assert!(matches!(refusals.as_slice(), [lag] if lag.contains("0.100 s and passes 1 %")), "{refusals:?}");
}

#[test]
fn a_bench_without_a_tone_states_what_its_monitor_leaves() {
    let parameters = Kind::Hossain.parameters();
    let mut board = parameters.board_or_bench(1000.0);
    board.limits.max_slew_v_per_s = 100e3;
    let mut random = Pcg64::seed_from_u64(8);
    // A slow cycle by a converter of 6 kV, with noise of half a step and more.
    let mut prospect = |bits: i32, noise_v: f64| {
        let step_v = 6000.0 / f64::from(1 << bits);
        let mut reading = |k: i32| {
            let noise_v = noise_v * (0..12).map(|_| random.random_range(-0.5..0.5)).sum::<f64>();
            let voltage_v = 2500.0 * (1.0 - (TAU * 1e-3 * f64::from(k)).cos());
            ((voltage_v + noise_v) / step_v).round() * step_v
        };
        let monitor_v: Vec<f64> = (0..5000).map(&mut reading).collect();
        Prospect::new(&parameters.actuator, &board, 4e-3, 1e-3, &monitor_v).expect("a film that moves")
    };
    let fine = prospect(16, 0.17);
    assert!((fine.voltage_noise_v / 0.17 - 1.0).abs() < 0.05 && fine.noise_pct < 0.1, "{fine:?}");
    assert!(fine.refusals.is_empty() && fine.sentence().contains("pass a tone of 50 V"), "{fine:?}");
    // Resolution alone is noise, too.
    let coarse = prospect(8, 0.1);
    assert!(coarse.voltage_noise_v > 0.9 * 6000.0 / 256.0 / 12f64.sqrt(), "{coarse:?}");
    assert!(
        matches!(coarse.refusals.as_slice(), [noise] if noise.contains("a converter with more bits")),
        "{coarse:?}"
    );
    // In proportion to the noise.
    let noisy = prospect(16, 1.7);
    assert!((noisy.noise_pct / fine.noise_pct / 10.0 - 1.0).abs() < 0.1, "{noisy:?}, {fine:?}");
    assert!(Prospect::new(&parameters.actuator, &board, 0.0, 1e-3, &[0.0; 9]).is_none(), "no stroke");
}
