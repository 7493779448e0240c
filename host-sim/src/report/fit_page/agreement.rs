//! How well a fit follows each recording, in numbers.

use maud::{Markup, html};

use super::super::numbers::{Form, Numbers};
use super::super::page::{Row, table, text};

/// The tables of agreement of the fit at `numbers`.
pub fn tables(numbers: &Numbers<'_>) -> Markup {
    let recordings = numbers.at("/recordings").rows();
    let of_force = recordings.iter().any(|row| !row.at("/rmse_n").value().is_null());
    let (rmse, offset) = if of_force {
        (("/rmse_n", Form::In(1e3, 3, "mN")), Form::In(1e3, 3, "mN"))
    } else {
        (("/rmse_m", Form::In(1e6, 2, "µm")), Form::In(1e6, 2, "µm"))
    };
    let own = |name: &str| recordings.iter().any(|row| !row.at(name).value().is_null());
    let (own_offset, own_gain) = (own("/offset"), own("/gain"));
    let mut header = vec!["recording", "R²", "NRMSE, % of p-p", "RMS error", "samples", "model's rate"];
    header.extend(own_offset.then_some("offset"));
    header.extend(own_gain.then_some("gain"));
    let rows: Vec<Row> = recordings
        .iter()
        .map(|row| {
            let mut cells = vec![
                text(row.text("/file")),
                row.number("/r2", Form::Fixed(6)),
                row.number("/nrmse_pct", Form::Fixed(3)),
                row.number(rmse.0, rmse.1),
                row.number("/samples", Form::Fixed(0)),
                row.number("/rate_hz", Form::In(1.0, 2, "Hz")),
            ];
            cells.extend(own_offset.then(|| row.number("/offset", offset)));
            cells.extend(own_gain.then(|| row.number("/gain", Form::Fixed(5))));
            Row::new(cells)
        })
        .collect();
    html! {
        (table("Agreement of the fit with each recording", &header, &rows))
        p {
            "R² is that of Eq. 14; NRMSE is the RMS error in % of the measurement's peak to peak. R² mean: "
            (numbers.number("/r2_mean", Form::Fixed(6))) "."
        }
    }
}
