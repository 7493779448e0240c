//! Comparisons over many fits: the paper's study, and other models of creep.

pub mod compare;
pub mod paper;
mod prandtl_ishlinskii;
