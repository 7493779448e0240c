//! The library of the tool: what it draws, and what it says.

mod figures;
mod library;
