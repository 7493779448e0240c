//! Closed loops without high voltage: a simulated nonlinear film with its instruments, the model of a parameter file as a plant,
//! controllers that make it follow a reference, and the firmware in the loop.

pub mod board;
pub mod closed_loop;
pub mod controllers;
pub mod electrical;
pub mod film;
pub mod film_recording;
pub mod plant;
pub mod processor;
pub mod self_sensed;
pub mod tuning;
