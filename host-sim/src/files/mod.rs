//! Files that are read and written: recordings, parameters, results.

pub mod csv;
pub mod output;
pub mod parameters;
pub mod recording;
