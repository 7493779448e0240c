//! The bench as a page and as a terminal see it: the board, and everything that may move the film.

mod board;
pub mod control;
pub(crate) mod reference;
pub mod session;
pub mod shared;
pub mod terminal;
pub mod web;
