//! How a law is built: the relaxation modulus of a model, exact and as a sum of decaying modes. In f64, once.

pub(crate) mod laplace;
mod method;
pub(crate) mod power_series;
pub(crate) mod quadrature;
mod spectrum;
pub(crate) mod tail;

pub use method::Discretisation;
