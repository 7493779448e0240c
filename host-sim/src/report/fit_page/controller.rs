//! Cost of the model on a controller, and loss of accuracy by the compression of its memory.

use maud::{Markup, html};

use super::super::numbers::{Form, Numbers};
use super::super::page::{Row, table, text};

/// The tables of the fit at `numbers`.
pub fn body(numbers: &Numbers<'_>) -> Markup {
    let compression = numbers.at("/compression");
    html! {
        @if compression.value().is_null() {
            p { "No law of this model runs at the controller's usual rate." }
        } @else {
            (bounds(&compression))
        }
        (cost(&numbers.at("/cost")))
    }
}

fn bounds(compression: &Numbers<'_>) -> Markup {
    let rows: Vec<Row> = [
        ("displacement, of the stroke", "/displacement_per_stroke", ""),
        ("displacement, of the largest increment", "/displacement_per_increment", ""),
        ("force, per stroke", "/force_per_stroke", "N/m"),
        ("force, per largest increment", "/force_per_increment", "N/m"),
    ]
    .into_iter()
    .map(|(name, path, unit)| {
        Row::new(vec![text(name), compression.number_or(path, Form::Digits(3), "no bound"), text(unit)])
    })
    .collect();
    html! {
        (table("Bounds of what the compressed memory changes", &["error", "at most", "unit"], &rows))
        p {
            "At " (compression.number("/rate_hz", Form::In(1.0, 0, "Hz"))) ", over "
            (compression.number("/horizon_s", Form::In(1.0, 0, "s"))) " from rest, against the whole memory."
        }
    }
}

fn cost(cost: &Numbers<'_>) -> Markup {
    let rows: Vec<Row> = [
        ("instructions of a step of the model", "/instructions_per_step", Form::Fixed(0)),
        ("instructions of a control tick", "/instructions_per_tick", Form::Fixed(0)),
        ("cycles of a control tick, modelled", "/cycles_per_tick", Form::Fixed(0)),
        ("share of a core at 168 MHz and 1 kHz", "/core_pct", Form::In(1.0, 1, "%")),
        ("coefficients of the law, in flash or RAM", "/law_bytes", Form::In(1.0, 0, "bytes")),
        ("state of the law, in RAM", "/state_bytes", Form::In(1.0, 0, "bytes")),
    ]
    .into_iter()
    .map(|(name, path, form)| Row::new(vec![text(name), cost.number(path, form)]))
    .collect();
    html! {
        (table("Cost on a Cortex-M4F", &["quantity", "value"], &rows))
        p {
            "Instructions were counted in QEMU for a law of this kind, cycles are modelled without wait states, as docs/results.md says; no \
             board was measured. A tick is all of the controller: calibrations, checks, tracking, limits."
        }
    }
}
