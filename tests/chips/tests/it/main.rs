//! Statements of the data sheets, worked by hand, against the models.
#![allow(clippy::unusual_byte_groupings, reason = "digits are grouped as the data sheets' fields")]

mod ad5754_frames;
mod ad5754_outputs;
mod ads868x_frames;
mod ads868x_results;
mod bus;
mod master;
