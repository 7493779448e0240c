//! Reports for people: pages and figures.

pub mod html;
pub mod plot;
