//! The replay in the page of a demo.

use maud::{Markup, html};

use crate::report::numbers::{Form, Numbers};
use crate::report::page::{Row, table, text};

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
