//! What a recording must excite so that it identifies a film: profiles that do, and a check of recordings.

pub mod check;
pub mod drive;
pub mod profile;
