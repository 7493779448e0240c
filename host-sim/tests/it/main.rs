//! The library behind the commands, against independent answers.

mod film;
mod fitting;
mod full_memory;
mod reduce;
mod sensor_offset;
mod tracking;
