//! Computations of the host tool.
//!
//! | room | what it does |
//! | --- | --- |
//! | [`commission`] | from an unknown film to one that follows, with a record |
//! | [`studies`] | the paper's study, and other models of creep beside this one |
//! | [`excitation`] | profiles that identify a film, and whether recordings do |
//! | [`fit`], [`amplifier`] | the parameters of the model from recordings, and of an amplifier from logs |
//! | [`simulation`] | a simulated nonlinear film, controllers that make it follow a reference, the firmware in the loop |
//! | [`replay`] | recordings and references through a model: the code that a microcontroller steps, or its exact full-memory reference |
//! | [`agreement`], [`references`], [`reduce`], [`spectrum`], [`statistics`], [`sampling`] | measures of agreement, references to follow, smaller models with the same response, spectra and statistics of series, what a model misses of them |
//!
//! Imports point downwards, without a circle, and to [`host_io`] for files, series and errors.
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod agreement;
pub mod amplifier;
pub mod commission;
pub mod compression;
pub mod cost;
pub mod excitation;
pub mod fit;
pub(crate) mod least_squares;
pub mod reduce;
pub mod references;
pub mod replay;
pub mod sampling;
pub mod simulation;
pub mod spectrum;
pub mod statistics;
pub mod studies;

use host_io::{error, files, grid, link, progress, quantity};
