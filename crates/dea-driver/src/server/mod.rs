//! The board's side of the link: the device that ticks, the session that answers a host, and uploads.

mod board;
mod device;
mod flight_recorder;
#[cfg(test)]
mod flips;
mod image;
#[cfg(feature = "loop-test")]
mod loop_test;
#[cfg(feature = "chips")]
mod parts;
mod session;
mod upload;

pub use board::Board;
pub use device::{Denial, Device};
pub use flight_recorder::{FlightRecorder, FlightSlot};
pub use image::Image;
pub use session::{Session, StartError};
pub use upload::Upload;
