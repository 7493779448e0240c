//! The safety campaign: faults in large numbers. A sample by default; all of it where `SPRINGPOT_CAMPAIGN=full` is set, in release:
//! `SPRINGPOT_CAMPAIGN=full cargo test --release -p dea-driver --test campaign -- --nocapture`.

#[path = "../driver/bench.rs"]
mod bench;
#[path = "../driver/flash.rs"]
mod flash;

mod actuator;
mod film;
mod line;
mod link;
mod monitor;
mod month;
mod player;
mod scale;
mod sensor;
