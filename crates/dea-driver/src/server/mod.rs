//! Who answers a host: the board that ticks, the session of its link, and uploads.

mod device;
mod session;
mod upload;

pub use device::Device;
pub use session::{Board, Session, StartError};
pub use upload::{Upload, UploadError};
