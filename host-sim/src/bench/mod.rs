//! The simulated bench: a nonlinear film with its instruments, and controllers that make it follow a reference.

pub mod closed_loop;
pub mod controllers;
pub mod film;
