//! The safety campaign: the driver under every fault and request that its documentation names, many times over.
//!
//! `cargo test -p dea-driver --test campaign` runs a sample. All of it:
//! `SPRINGPOT_CAMPAIGN=full cargo test --release -p dea-driver --test campaign -- --nocapture`.

#[path = "../driver/bench.rs"]
#[allow(dead_code)] // shared with the other tests
mod bench;
mod blobs;
mod commands;
mod hosts;
mod nor_flash;
mod power_loss;
mod reference;
mod scale;
mod states;
