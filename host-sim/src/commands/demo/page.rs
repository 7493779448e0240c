//! What a demo adds to the page of its fit.

use maud::{Markup, html};

use super::Sine;
use crate::report::chart;
use crate::report::figure::{Colour, Line, Panel};
use crate::report::numbers::{Form, Numbers};
use crate::report::page::{Row, table, text};
use crate::report::tracking_figure;
use crate::simulation::closed_loop::LoopRun;

/// The replay of the document at `numbers`.
pub(super) fn replay(numbers: &Numbers<'_>) -> Markup {
    let rows: Vec<Row> = numbers
        .at("/recordings")
        .rows()
        .iter()
        .map(|row| {
            Row::new(vec![
                text(row.text("/file")),
                row.number("/r2", Form::Fixed(6)),
                row.number("/nrmse_pct", Form::Fixed(3)),
                row.number("/rmse_m", Form::In(1e6, 2, "µm")),
                row.number("/samples", Form::Fixed(0)),
            ])
        })
        .collect();
    html! {
        (table(
            "The recordings through the code that a controller runs: f32, compressed memory, 1 kHz",
            &["recording", "R²", "NRMSE, % of p-p", "RMS error", "samples"],
            &rows,
        ))
        p {
            "R² mean " (numbers.number("/r2_mean", Form::Fixed(6))) ". It differs from that of the fit by the rounding to f32 and by the \
             controller's rate."
        }
    }
}

/// The `sine` and the `runs` along it.
pub(super) fn following(numbers: &Numbers<'_>, sine: &Sine, runs: &[(&'static str, LoopRun)]) -> Markup {
    let reference = numbers.at("/reference");
    let named: Vec<(&str, &LoopRun)> = runs.iter().map(|(name, run)| (*name, run)).collect();
    html! {
        p {
            "A sine of " (reference.number("/low_m", Form::In(1e3, 3, "mm"))) " to "
            (reference.number("/high_m", Form::In(1e3, 3, "mm"))) ", period "
            (reference.number("/period_s", Form::In(1.0, 1, "s"))) ", over "
            (reference.number("/duration_s", Form::In(1.0, 0, "s"))) ": the film can follow it with at most "
            (reference.number("/check/largest_voltage_v", Form::In(1.0, 0, "V"))) "."
        }
        @if runs.is_empty() {
            (chart::chart(&panel(sine), "reference"))
            p { "voltage.csv holds the voltage that makes the model follow it." }
        } @else {
            p {
                "The same film, simulated, from rest: without compensation the voltage is scaled to the reference's peak; feedforward inverts \
                 the fitted model; tracking corrects it with the sensor."
            }
            (tracking_figure::comparison(&numbers.at("/closed_loop"), &named, sine.grid))
        }
    }
}

fn panel(sine: &Sine) -> Panel {
    let millimetres: Vec<f64> = sine.values.iter().map(|x| 1e3 * x).collect();
    Panel::new("Reference", "time (s)", "displacement (mm)")
        .with(Line::new("reference", &sine.grid.times_s(), &millimetres).coloured(Colour::Green))
}
