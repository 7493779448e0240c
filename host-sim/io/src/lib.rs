//! Input and output of the host tool.
//!
//! | room | what it does |
//! | --- | --- |
//! | [`files`] | reads and writes recordings, parameters, tables |
//! | [`link`] | the host's side of the link to a controller |
//! | [`supply`] | high-voltage supplies at a serial port, and the loop through them |
//! | [`choice`](mod@choice) | choices by their names |
//! | [`grid`] | sampled series |
//! | [`quantity`], [`progress`], [`terminal`], [`interrupt`] | what people type; progress; what is printed; signals |
//! | [`error`](mod@error) | errors that name the place and the fix |
//!
//! Imports point downwards, without a circle.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod choice;
pub mod error;
pub mod files;
pub mod grid;
pub mod interrupt;
pub mod link;
pub mod progress;
pub mod quantity;
pub mod supply;
pub mod terminal;

pub use error::{Error, Result};
