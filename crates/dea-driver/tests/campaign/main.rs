//! The safety campaign: the driver under every fault and request that its documentation names, many times over.
//!
//! `cargo test -p dea-driver --test campaign` runs a sample. All of it:
//! `SPRINGPOT_CAMPAIGN=full cargo test --release -p dea-driver --test campaign -- --nocapture`.

#[path = "../driver/arcing.rs"]
mod arcing;
#[path = "../driver/bench.rs"]
mod bench;
#[path = "../driver/board.rs"]
mod board;
#[path = "../driver/circuit.rs"]
mod circuit;

mod actuator;
mod blobs;
mod commands;
mod explore;
mod film;
// Its stack is that of this processor.
#[cfg(all(target_arch = "x86_64", target_os = "linux"))]
mod flips;
mod hosts;
mod line;
mod link;
mod monitor;
mod month;
mod player;
mod power_loss;
mod reference;
mod scale;
mod self_sensing;
mod sensor;
#[cfg(all(target_arch = "x86_64", target_os = "linux"))]
mod stack;
mod states;
mod torn_flash;
