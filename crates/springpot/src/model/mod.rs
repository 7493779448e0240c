//! The model of a film: springpots (Eqs. 12–13) in the generalised Maxwell model (Eqs. 9 and 11), and its published parameters.

mod element;
mod maxwell;
mod presets;
mod temperature;

pub use element::Springpot;
pub use maxwell::{Chain, Maxwell, Topology};
pub use presets::Preset;
pub use temperature::TemperatureDependence;
