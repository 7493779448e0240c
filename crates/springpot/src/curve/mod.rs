//! The elastic curve T in front of the law: quasi-linear viscoelasticity.

mod knots;
mod rubber;
mod table;

pub use knots::{Curve, Knot, MAX_KNOTS};
pub use rubber::Rubber;
pub(crate) use table::{Place, Table};
