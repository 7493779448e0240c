//! Recordings and references through a model: the controller's own code, or its full-memory reference.

pub mod comparison;
pub mod coupling;
pub mod expectation;
pub mod feasibility;
pub mod feedforward;
pub mod frequency_response;
pub mod full_memory;
pub mod in_series;
pub mod limits;
pub mod memory;
pub mod nonlinear;
pub mod observer;
pub mod running_memory;
pub mod simulate;
