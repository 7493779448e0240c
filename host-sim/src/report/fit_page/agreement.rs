//! How well a fit follows each recording, in numbers.

use maud::{Markup, html};

use super::super::numbers::{Form, Numbers};
use super::super::page::{Cell, list};

/// The tables of agreement of the fit at `numbers`.
pub fn tables(numbers: &Numbers<'_>) -> Markup {
    let recordings = numbers.at("/recordings");
    let rows = recordings.rows();
    let has = |path: &str| rows.iter().any(|row| !row.at(path).value().is_null());
    let (rmse, form) = match has("/rmse_n") {
        true => ("/rmse_n", Form::In(1e3, 3, "mN")),
        false => ("/rmse_m", Form::In(1e6, 2, "µm")),
    };
    let mut columns = vec![
        ("recording", Cell::Text("/file")),
        ("R²", Cell::Number("/r2", Form::Fixed(6))),
        ("NRMSE, % of p-p", Cell::Number("/nrmse_pct", Form::Fixed(3))),
        ("RMS error", Cell::Number(rmse, form)),
        ("samples", Cell::Number("/samples", Form::Fixed(0))),
        ("model's rate", Cell::Number("/rate_hz", Form::In(1.0, 2, "Hz"))),
    ];
    columns.extend(has("/offset").then_some(("offset", Cell::Number("/offset", form))));
    columns.extend(has("/gain").then_some(("gain", Cell::Number("/gain", Form::Fixed(5)))));
    html! {
        (list("Agreement of the fit with each recording", &columns, &recordings))
        p {
            "R² is that of Eq. 14; NRMSE is the RMS error in % of the measurement's peak to peak. R² mean: "
            (numbers.number("/r2_mean", Form::Fixed(6))) "."
        }
    }
}
