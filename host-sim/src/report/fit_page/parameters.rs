//! Fitted values with their intervals, and the film that they belong to.

use maud::{Markup, html};

use super::super::numbers::{Form, Numbers};
use super::super::page::{Cell, Row, list, table, text};

/// The tables of the fit at `numbers`.
pub fn tables(numbers: &Numbers<'_>) -> Markup {
    html! { (estimates(&numbers.at("/uncertainty"))) (film(&numbers.at("/film"))) }
}

fn estimates(uncertainty: &Numbers<'_>) -> Markup {
    let estimates = uncertainty.at("/estimates");
    if estimates.rows().is_empty() {
        return html! { p { "Intervals were not computed." } };
    }
    let columns = [
        ("parameter", Cell::Made(|row| html! { code { (row.text("/name")) } })),
        ("value", Cell::Number("/value", Form::Digits(6))),
        ("from", Cell::Made(|row| row.number_or("/low", Form::Digits(5), "open"))),
        ("to", Cell::Made(|row| row.number_or("/high", Form::Digits(5), "open"))),
        ("unit", Cell::Made(|row| text(unit(row.text("/name"))))),
        ("", Cell::Made(|row| text(if row.at("/at_bound").value() == true { "on its bound" } else { "" }))),
    ];
    html! {
        (list("Fitted parameters with 95 % intervals from the profile likelihood", &columns, &estimates))
        p { "An end that the recordings do not set is open, or for an order 0 or 1." }
    }
}

/// The unit of a fitted quantity.
fn unit(name: &str) -> &'static str {
    match name {
        _ if name.ends_with(".c") => "N·s^α/m",
        "stretch_coupling" => "1/m",
        "stiffness_per_k" => "1/K",
        "activation_kj_per_mol" => "kJ/mol",
        _ if name.ends_with("_m") => "m",
        _ if name.ends_with("_v") => "V",
        _ if name.ends_with("_kg") => "kg",
        _ => "1",
    }
}

fn film(film: &Numbers<'_>) -> Markup {
    let mut rows: Vec<Row> = [
        ("length", "/length_m", Form::In(1e3, 3, "mm")),
        ("width", "/width_m", Form::In(1e3, 3, "mm")),
        ("thickness", "/thickness_m", Form::In(1e6, 2, "µm")),
        ("relative permittivity", "/relative_permittivity", Form::Fixed(3)),
        ("mass", "/mass_kg", Form::In(1e3, 2, "g")),
        ("stretch coupling", "/stretch_coupling", Form::In(1.0, 3, "1/m")),
        ("saturation", "/saturation_v", Form::In(1.0, 1, "V")),
        ("temperature", "/temperature/reference_c", Form::In(1.0, 1, "°C")),
        ("sensor's reading at rest", "/sensor_offset_m", Form::In(1e6, 2, "µm")),
    ]
    .into_iter()
    .filter(|(_, path, _)| !film.at(path).value().is_null())
    .map(|(name, path, form)| Row::new(vec![text(name), film.number(path, form)]))
    .collect();
    rows.push(Row::new(vec![text("weight"), text(film.text("/preload"))]));
    rows.push(Row::new(vec![text("elastic curve"), text(film.text("/curve"))]));
    let assumed = film.at("/sizes_assumed").value() == true;
    html! {
        (table("The film and its actuator", &["quantity", "value"], &rows))
        @if assumed { p { "Length, width and thickness are assumed, not measured: nothing is known of the electric field." } }
    }
}
