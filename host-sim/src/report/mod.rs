//! Reports: pages, tables and figures.
//!
//! A [`figure`] is drawn by [`drawing`] (SVG, PNG) or by the script of a page (HTML).

pub(crate) mod axis;
pub(crate) mod chart;
pub(crate) mod comparison_figure;
pub mod course;
pub mod drawing;
pub mod figure;
pub mod figure_file;
pub(crate) mod fit_page;
pub(crate) mod model_figure;
pub(crate) mod numbers;
pub(crate) mod origin;
pub(crate) mod page;
pub(crate) mod record_page;
pub(crate) mod response_figure;
pub(crate) mod run_page;
pub(crate) mod study_page;
pub(crate) mod tracking_figure;
