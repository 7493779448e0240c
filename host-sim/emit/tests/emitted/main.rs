//! The emitted C against the crate `springpot`: the truth is the Rust law in the same test.

mod bits;
mod builds;
mod chips;
mod circuit;
mod films;
mod job;
mod matlab;
mod program;
mod text;

#[path = "../../../../crates/springpot/tests/it/support/models.rs"]
#[allow(dead_code)] // not all of them
mod models;
#[path = "../../../../tests/support/recordings.rs"]
#[allow(dead_code)]
mod recordings;
