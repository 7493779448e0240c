//! Reports: pages, tables and figures.

pub mod compression;
pub mod fit_page;
pub mod fit_report;
pub mod html;
pub mod plot;
pub mod study_page;
