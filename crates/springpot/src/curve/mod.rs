//! Elastic curves: T in front of the law (quasi-linear viscoelasticity), and the spring E beside its memory.

mod knots;
mod measure;
mod rubber;
mod spread;
mod spring;
mod table;

pub use knots::{Curve, Knot, MAX_KNOTS};
pub use measure::Measure;
pub use rubber::Rubber;
pub use spring::{MAX_SPRING_KNOTS, Spring};
pub(crate) use table::{Place, Table};
