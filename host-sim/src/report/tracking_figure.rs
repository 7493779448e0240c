//! Films that follow a reference: figures and tables of closed loops.

use maud::{Markup, html};

use super::axis::{DISPLACEMENT, MICROMETRES, VOLTAGE};
use super::chart;
use super::figure::{Colour, Figure, Line, Panel};
use super::numbers::{Form, Numbers};
use super::page::{Cell, list, text};
use crate::grid::Grid;
use crate::simulation::closed_loop::LoopRun;

/// Colours of runs side by side.
const COLOURS: [Colour; 4] = [Colour::VERMILION, Colour::BLUE, Colour::GREEN, Colour::PURPLE];

/// The run without compensation, in words.
const UNCOMPENSATED: &str = "no compensation";

/// Film and reference, error and voltage of `runs` of one reference on `grid`, by the names of their controllers.
pub fn panels(runs: &[(&str, &LoopRun)], grid: Grid) -> Vec<Panel> {
    let time = grid.times_s();
    let mut film = Panel::new("Reference and film", "time (s)", DISPLACEMENT.label());
    let mut error = Panel::new("Error", "time (s)", "film − reference (µm)");
    let mut voltage = Panel::new("Voltage", "time (s)", VOLTAGE.label());
    if let Some((_, run)) = runs.first() {
        film = film.with(Line::new("reference", &time, &DISPLACEMENT.transform(&run.reference_m)).beneath());
    }
    for ((name, run), colour) in runs.iter().zip(COLOURS.into_iter().cycle()) {
        let line = |values: &[f64]| Line::new(*name, &time, values).coloured(colour);
        film = film.with(line(&DISPLACEMENT.transform(&run.displacement_m)));
        error = error.with(line(&MICROMETRES.transform(&run.error_m())));
        voltage = voltage.with(line(&VOLTAGE.transform(&run.voltage_v)));
    }
    let mut panels = vec![film, error, voltage];
    // Beside an error that is not compensated the others are a straight line.
    let compensated: Vec<Line> = panels[1].lines.iter().filter(|line| line.label != UNCOMPENSATED).cloned().collect();
    if (1..runs.len()).contains(&compensated.len()) {
        let panel = Panel::new("Error with compensation", "time (s)", "film − reference (µm)");
        panels.insert(2, compensated.into_iter().fold(panel, Panel::with));
    }
    panels
}

/// The runs of the list at `numbers`, in a table and a figure.
pub fn comparison(numbers: &Numbers<'_>, runs: &[(&str, &LoopRun)], grid: Grid) -> Markup {
    let columns = [
        ("controller", Cell::Made(|row| text(words(row.text("/controller"))))),
        ("RMS, % of p-p", Cell::Number("/tracking_rms_pct", Form::Fixed(3))),
        ("largest error", Cell::Number("/largest_error_m", Form::In(1e6, 1, "µm"))),
        ("drift, % of p-p", Cell::Number("/drift_pct", Form::Fixed(3))),
        ("largest voltage", Cell::Number("/largest_voltage_v", Form::In(1.0, 0, "V"))),
    ];
    let named: Vec<(&str, &LoopRun)> = runs.iter().map(|(name, run)| (words(name), *run)).collect();
    html! {
        (list("Error of the film from t = 0", &columns, numbers))
        (chart::figure(&Figure::new("Closed loop", panels(&named, grid))))
    }
}

/// A controller's name in words.
fn words(name: &str) -> &str {
    if name == "none" { UNCOMPENSATED } else { name }
}
