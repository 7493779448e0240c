//! Holds a film at 0.8 mm for two minutes without a sensor: the voltage falls while the film would creep.
//!
//! `cargo run --example hold_position`

use std::error::Error;

use springpot::{Actuator, Applied, CommandLimits, Feedforward, Law, LawOptions, Preset};

const RATE_HZ: u16 = 1000;
const TARGET_M: f32 = 0.8e-3;

fn main() -> Result<(), Box<dyn Error>> {
    // Configuration: what the film is, and how fast it is stepped.
    let model = Preset::TABLE3_N2.model()?;
    let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(1.0 / f64::from(RATE_HZ)))?;
    let rest = law.state();
    let feedforward = Feedforward::new(law, &Actuator::KARNER_2022, CommandLimits::BENCH)?;

    // State: a film at rest, at 0 V.
    let mut state = feedforward.state(rest);
    let mut voltage = 0.0;
    let mut highest = 0.0;
    for second in 0..120 {
        for _ in 0..RATE_HZ {
            // What really acted since the last tick, then what shall act until the next.
            feedforward.apply(&mut state, Applied::as_commanded(voltage));
            let command = feedforward.command(&mut state, TARGET_M);
            voltage = command.voltage_v;
            highest = f32::max(highest, voltage);
        }
        if [0, 1, 10, 119].contains(&second) {
            println!("after {:3} s: {:.4} mm at {voltage:.0} V", second + 1, 1e3 * state.displacement());
        }
    }
    if (state.displacement() - TARGET_M).abs() > 1e-7 {
        return Err("the film left its target".into());
    }
    println!("{highest:.0} V at first, {voltage:.0} V in the end");
    Ok(())
}
