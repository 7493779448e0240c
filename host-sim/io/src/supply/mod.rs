//! A high-voltage supply at a serial port that closes the loop: its commands are a description, not code.

mod description;
mod drive;
mod line;
mod sensor;
mod session;
mod template;

pub use description::{Supply, shipped};
pub use drive::{Follow, Row, Summary, controller, follow};
pub use line::{Line, SerialLine};
pub use sensor::Sensor;
pub use session::Session;
pub use template::Template;
