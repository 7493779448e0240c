//! Files that are read and written: recordings, logs, material tests, parameters, results.

pub mod amplifier_log;
pub(crate) mod bounded;
pub mod capacitance;
pub mod digest;
pub mod drop_outs;
mod held;
pub mod import;
pub mod journal;
pub mod layout;
pub mod material_test;
pub mod output;
pub mod parameters;
mod plausible;
pub mod recording;
pub mod seal;
pub mod table;
