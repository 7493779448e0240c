//! Reports: pages, tables and figures.
//!
//! A [`figure`] is drawn by [`drawing`] (SVG, PNG) or by the script of a [`page`] (HTML).

pub mod axis;
pub mod chart;
pub mod comparison_figure;
pub mod course;
pub mod drawing;
pub mod figure;
pub mod figure_file;
pub mod fit_page;
pub mod model_figure;
pub mod numbers;
pub mod origin;
pub mod page;
pub mod record_page;
pub mod response_figure;
pub mod run_page;
pub mod study_page;
pub mod tracking_figure;
