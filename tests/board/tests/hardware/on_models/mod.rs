//! Each test has a board of its own; they wait for one another.

mod clock;
mod pads;
mod reset;
mod serial;
mod start;
