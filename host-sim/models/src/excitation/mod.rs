//! Excitation that identifies a film: profiles, and a check of recordings.

pub mod check;
pub mod drive;
mod finding;
pub mod profile;
mod rows;
