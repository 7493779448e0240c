//! Each test has a board of its own; they wait for one another.

mod bench;
mod clock;
mod converters;
mod host;
mod judges;
mod pads;
mod reset;
mod serial;
mod slaves;
mod start;
mod wired;
