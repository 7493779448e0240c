//! The promises of this library, against independent answers: closed forms, sums over the whole past, exact responses.
//!
//! Sweeps over many models run on a sample of them by default and on all with `SPRINGPOT_SWEEP=full`.

mod adaptation;
mod amplifier;
mod bent_laws;
mod blocks;
mod capacitance;
mod coarser;
mod compressed_memory;
mod compression_bound;
mod constants;
mod continuous_oracle;
mod curves;
mod cycles;
mod dual_numbers;
mod feedforward;
mod follower;
mod full_memory;
mod laws;
mod learned_films;
mod learning;
mod observer;
mod passivity;
mod reported_changes;
mod responses;
mod second_order;
mod self_sensing;
#[cfg(feature = "serde")]
mod serde_formats;
mod series;
mod single_precision;
mod state_names;
mod support;
mod temperature;
mod tone;
mod two_curves;
