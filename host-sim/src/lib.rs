//! The library behind the `host-sim` commands.
//!
//! | room | what it does |
//! | --- | --- |
//! | [`files`] | reads and writes recordings, parameters, tables |
//! | [`grid`], [`agreement`], [`references`], [`reduce`] | sampled series, measures of agreement, references to follow, smaller models with the same response |
//! | [`replay`] | recordings and references through a model: the code that a microcontroller steps, or its exact full-memory reference |
//! | [`fit`] | the parameters of the model from recordings, and of an amplifier from logs |
//! | [`excitation`] | profiles that identify a film, and whether recordings do |
//! | [`studies`] | the paper's study, and other models of creep beside this one |
//! | [`bench`](mod@bench) | a simulated nonlinear film, controllers that make it follow a reference, the firmware in the loop |
//! | [`link`] | the host's side of the link to a controller |
//! | [`report`] | figures and HTML pages |
//! | [`commands`] | the command line, one file per command |
//!
//! Imports point downwards, without a circle: commands, report, studies, excitation, fit, replay, references, files, grid, and at the bottom
//! [`error`](mod@error), [`interrupt`], [`progress`], [`quantity`] and [`terminal`]. [`bench`](mod@bench) stands on replay, and on [`link`] for the firmware in the loop.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod agreement;
pub mod bench;
pub mod commands;
pub mod error;
pub mod excitation;
pub mod files;
pub mod fit;
pub mod grid;
pub mod interrupt;
pub mod link;
pub mod progress;
pub mod quantity;
pub mod reduce;
pub mod references;
pub mod replay;
pub mod report;
pub mod studies;
pub mod terminal;

pub use error::{Error, Result};
