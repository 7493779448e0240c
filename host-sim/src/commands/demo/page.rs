//! The replay in the page of a demo.

use maud::{Markup, html};

use crate::report::numbers::{Form, Numbers};
use crate::report::page::{Cell, list};

/// The replay of the document at `numbers`.
pub(super) fn replay(numbers: &Numbers<'_>) -> Markup {
    let columns = [
        ("recording", Cell::Text("/file")),
        ("R²", Cell::Number("/r2", Form::Fixed(6))),
        ("NRMSE, % of p-p", Cell::Number("/nrmse_pct", Form::Fixed(3))),
        ("RMS error", Cell::Number("/rmse_m", Form::In(1e6, 2, "µm"))),
        ("samples", Cell::Number("/samples", Form::Fixed(0))),
    ];
    let caption = "The recordings through the code that a controller runs: f32, compressed memory, 1 kHz";
    html! {
        (list(caption, &columns, &numbers.at("/recordings")))
        p {
            "R² mean " (numbers.number("/r2_mean", Form::Fixed(6))) ". It differs from that of the fit by the rounding to f32 and by the \
             controller's rate."
        }
    }
}
