//! Estimates a film from a recording: a sensor of 20 Hz with noise, on a film that is softer than its model.
//!
//! `cargo run --example observe_recording`

use std::error::Error;
use std::f64::consts::TAU;

use springpot::{
    Actuator, Applied, Law, LawOptions, Maxwell, Observer, ObserverOptions, Preset, SensorSample, VoltageDrive,
};

const STEP_S: f64 = 1e-3;
/// Ticks from one sample to the next.
const INTERVAL: usize = 50;

/// A tick of the recording.
struct Row {
    voltage_v: f32,
    /// The film, which a real recording does not hold.
    true_m: f32,
    sample_m: Option<f32>,
}

/// A recording of 60 s on a film whose stiffness is 0.8 times the model's.
fn recording(model: &Maxwell) -> Result<Vec<Row>, Box<dyn Error>> {
    let law: Law<f64> = Law::compressed(&model.clone().scaled(0.8)?, LawOptions::at_step(STEP_S))?;
    let drive = VoltageDrive::new(&Actuator::KARNER_2022, 6000.0, law.stiffness())?;
    let mut film = law.state();
    // Noise of ± 4 µm from a linear congruential generator.
    let mut seed = 1u32;
    let mut noise = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        8e-6 * (f64::from(seed >> 8) / f64::from(1 << 24) - 0.5)
    };
    let rows = (0..60_000).map(|tick| {
        let voltage = 3000.0 * (1.0 - (TAU * 0.2 * STEP_S * tick as f64).cos());
        let x = law.displacement_under(&mut film, drive.load(voltage));
        let sample_m = (tick % INTERVAL == 0).then(|| (x + noise()) as f32);
        Row { voltage_v: voltage as f32, true_m: x as f32, sample_m }
    });
    Ok(rows.collect())
}

fn main() -> Result<(), Box<dyn Error>> {
    let model = Preset::TABLE3_N2.model()?;
    let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(STEP_S))?;
    let rest = law.state();
    let options = ObserverOptions {
        sample_interval_s: INTERVAL as f64 * STEP_S,
        delay_s: 0.0,
        lost_after_s: 0.2,
        ..ObserverOptions::at_bandwidth(0.6)
    };
    let observer: Observer<f32> = Observer::new(law, &Actuator::KARNER_2022, 6000.0, options)?;

    let mut state = observer.state(rest);
    println!("time_s,estimate_m,true_m,disturbance_n,force_scale");
    let mut largest = 0.0;
    for (tick, row) in recording(&model)?.into_iter().enumerate() {
        let sample = row.sample_m.map(|displacement| SensorSample { displacement_m: displacement, age_ticks: 0 });
        let estimate = observer.observe(&mut state, Applied::as_commanded(row.voltage_v), sample);
        if tick % 5000 == 0 {
            let (disturbance, scale) = (state.disturbance(), state.force_scale());
            println!("{},{estimate:.3e},{:.3e},{disturbance:.3},{scale:.3}", tick / 1000, row.true_m);
        }
        if tick >= 50_000 {
            largest = f32::max(largest, (estimate - row.true_m).abs());
        }
    }
    // The film answers to every force as if it were 1 / 0.8 times as large.
    let noise_rms = (f64::from(state.statistics().variance())).sqrt();
    println!("largest error of the last 10 s: {:.1} µm; innovation: {:.1} µm RMS", 1e6 * largest, 1e6 * noise_rms);
    if (state.force_scale() - 1.25).abs() > 0.02 || largest > 8e-6 {
        return Err("the observer did not find the film".into());
    }
    Ok(())
}
