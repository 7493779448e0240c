//! The safety campaign: faults in large numbers. A sample by default; all of it where `SPRINGPOT_CAMPAIGN=full` is set, in release:
//! `SPRINGPOT_CAMPAIGN=full cargo test --release -p dea-driver --test campaign -- --nocapture`.

#[path = "../driver/bench.rs"]
mod bench;

mod actuator;
mod film;
mod monitor;
mod scale;
mod sensor;
