//! The model: the structures that were compared, the branches of the chosen one, and its frequency response.

use maud::{Markup, html};

use super::super::chart;
use super::super::figure::Figure;
use super::super::numbers::{Form, Numbers};
use super::super::page::{Cell, list, text};
use super::super::response_figure;
use crate::files::parameters::Parameters;
use crate::files::recording::Input;
use crate::fit::observation::Observation;
use crate::grid::Samples;
use crate::spectrum;

/// Frequencies at which the drive has less than this share of its largest amplitude are not recorded.
const MIN_SHARE: f64 = 0.01;
/// How far the response is drawn beyond the recorded band, as a factor.
const BEYOND: f64 = 30.0;

/// The part of the page at `numbers`.
pub fn body(numbers: &Numbers<'_>, parameters: &Parameters, observations: &[Observation]) -> Markup {
    html! {
        (structures(numbers))
        (branches(numbers))
        @if let Some((from_hz, to_hz)) = band(observations) {
            @let at_m = middle_m(observations, parameters);
            @let panels = response_figure::panels(parameters, (from_hz / BEYOND, BEYOND * to_hz), at_m);
            @let panels = panels.map(|panel| panel.banded("recorded", from_hz, to_hz)).into();
            div.charts { (chart::figure(&Figure::new("Frequency response", panels))) }
            p {
                "The recorded band is marked: from once in the longest recording to the highest frequency at which the load has "
                (format!("{:.0}", 100.0 * MIN_SHARE)) " % of its largest amplitude. Outside, the response is what the model makes of the \
                 recorded band; nothing was measured there."
            }
        }
    }
}

fn structures(numbers: &Numbers<'_>) -> Markup {
    let structures = numbers.at("/structures");
    if structures.rows().is_empty() {
        return html! { p { "One structure was fitted; none was compared with it." } };
    }
    let several = numbers.at("/recordings").rows().len() > 1;
    let by = if several { "on left-out recordings" } else { "by the Bayesian criterion" };
    let columns = [
        ("structure", Cell::Made(structure)),
        ("film", Cell::Made(nonlinearity)),
        ("variables", Cell::Number("/variables", Form::Fixed(0))),
        ("R²", Cell::Number("/r2_mean", Form::Fixed(6))),
        ("NRMSE %", Cell::Number("/nrmse_pct", Form::Fixed(3))),
        ("ΔAIC", Cell::Number("/delta_aic", Form::Fixed(0))),
        ("ΔBIC", Cell::Number("/delta_bic", Form::Fixed(0))),
        ("left out, NRMSE %", Cell::Number("/left_out_nrmse_pct", Form::Fixed(3))),
    ];
    html! {
        (list("Structures that were compared", &columns, &structures))
        p { "The smallest structure that is not worse than the best " (by) " is chosen." }
    }
}

fn structure(row: &Numbers<'_>) -> Markup {
    let chosen = if row.at("/chosen").value() == true { " (chosen)" } else { "" };
    html! { (row.text("/topology")) ", n = " (row.number("/branches", Form::Fixed(0))) (chosen) }
}

fn nonlinearity(row: &Numbers<'_>) -> Markup {
    text(match (row.text("/curve"), row.at("/saturates").value() == true) {
        ("linear", true) => "saturation".to_owned(),
        (curve, false) => curve.into(),
        (curve, true) => format!("{curve} + saturation"),
    })
}

fn branches(numbers: &Numbers<'_>) -> Markup {
    let relaxations = numbers.at("/relaxations");
    let columns = [
        ("branch", Cell::Made(|row| html! { code { "branches[" (row.number("/branch", Form::Fixed(0))) "]" } })),
        ("relaxation time, s", Cell::Number("/relaxation_time_s", Form::Digits(4))),
        ("share there, %", Cell::Number("/share_pct", Form::Fixed(2))),
        ("of the", Cell::Text("/share_of")),
    ];
    html! {
        @if !relaxations.rows().is_empty() { (list("Relaxation times of the branches", &columns, &relaxations)) }
    }
}

/// The recorded band, Hz.
fn band(observations: &[Observation]) -> Option<(f64, f64)> {
    let drives = || observations.iter().map(|observation| &observation.input);
    let longest_s = drives().filter_map(|input| input.samples().time_s.last()).copied().fold(0.0, f64::max);
    let highest_hz = drives().filter_map(|input| spectrum::highest_hz(&load(input), MIN_SHARE)).fold(0.0, f64::max);
    let from_hz = 1.0 / longest_s;
    (from_hz.is_finite() && highest_hz > from_hz).then_some((from_hz, highest_hz))
}

/// Load on the film; a voltage acts by its square.
fn load(input: &Input) -> Samples {
    let Samples { time_s, value } = input.samples();
    let value = match input {
        Input::Voltage(_) => value.iter().map(|v| v * v).collect(),
        Input::Force(_) | Input::Displacement(_) => value.clone(),
    };
    Samples { time_s: time_s.clone(), value }
}

/// The displacement about which the film was recorded, m.
fn middle_m(observations: &[Observation], parameters: &Parameters) -> f64 {
    let Some(observation) = observations.first() else { return 0.0 };
    let mean = |samples: &Samples| samples.value.iter().sum::<f64>() / samples.value.len() as f64;
    match &observation.input {
        Input::Displacement(displacement) => mean(displacement),
        _ => parameters.sensor().film_displacement_m(mean(&observation.measured)),
    }
}
