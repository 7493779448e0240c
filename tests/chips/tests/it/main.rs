//! What the data sheets say, worked by hand, against the models.
#![allow(clippy::unusual_byte_groupings, reason = "digits stand in the groups of the data sheets' fields")]

mod ad5754_faults;
mod ad5754_frames;
mod ad5754_outputs;
mod master;
