//! The page of a recording of a run on a board.

use std::path::Path;

use maud::html;

use super::axis::{DISPLACEMENT, MICROMETRES, VOLTAGE};
use super::chart;
use super::figure::{Colour, Figure, Line, Panel};
use super::page::{Page, Section};
use crate::error::{Error, Result, shown};
use crate::grid::range;

/// Columns of a stream's recording that are drawn.
const COLUMNS: [&str; 6] = ["time_s", "command_v", "voltage_v", "displacement_m", "predicted_m", "reference_m"];

/// The page of the recording at `path`: how well the film has followed, and its course.
pub fn html(path: &Path) -> Result<String> {
    let text = std::fs::read_to_string(path).map_err(|e| Error::file(path, e))?;
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let place = |name: &&str| {
        let cause = || Error::file(path, format!("no column {name}: a recording that the page has written is needed"));
        header.iter().position(|known| known == name).ok_or_else(cause)
    };
    let places = COLUMNS.iter().map(place).collect::<Result<Vec<usize>>>()?;
    let mut columns: [Vec<f64>; 6] = Default::default();
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        for (column, place) in columns.iter_mut().zip(&places) {
            column.push(cells.get(*place).and_then(|cell| cell.parse().ok()).unwrap_or(f64::NAN));
        }
    }
    let [time, command, voltage, film, predicted, reference] = columns;
    let error: Vec<f64> = film.iter().zip(&reference).map(|(film, wanted)| film - wanted).collect();
    // Under a voltage that is set there is no reference: its column has the prediction.
    let wanted = if reference == predicted { "prediction" } else { "reference" };
    let driven = command.iter().position(|&volts| volts > 0.0).zip(command.iter().rposition(|&volts| volts > 0.0));
    let sentence = driven.map_or("The film was not driven".into(), |(from, to)| {
        let (low, high) = range(&reference[from..=to]);
        let seen: Vec<f64> = error[from..=to].iter().copied().filter(|error| error.is_finite()).collect();
        let rms = (seen.iter().map(|error| error * error).sum::<f64>() / seen.len().max(1) as f64).sqrt();
        let pct = 100.0 * rms / (high - low);
        format!("The film was within {pct:.2} % RMS of the {wanted}'s range, over {:.1} s", time[to] - time[from])
    });
    let panels = vec![
        Panel::new("Stroke", "time (s)", DISPLACEMENT.label())
            .with(Line::new(wanted, &time, &DISPLACEMENT.transform(&reference)).beneath())
            .with(Line::new("film", &time, &DISPLACEMENT.transform(&film)).coloured(Colour::BLUE)),
        Panel::new("Error", "time (s)", format!("film − {wanted} (µm)"))
            .with(Line::new("error", &time, &MICROMETRES.transform(&error)).coloured(Colour::VERMILION)),
        Panel::new("Voltage", "time (s)", VOLTAGE.label())
            .with(Line::new("command", &time, &VOLTAGE.transform(&command)).beneath())
            .with(Line::new("monitor", &time, &VOLTAGE.transform(&voltage)).coloured(Colour::GREEN)),
    ];
    let picture = chart::figure(&Figure::new("Run", panels));
    let lead = html! {
        p.verdict { (sentence) "." }
        p { "Next: springpot replay shows how well the model holds, springpot fit finds another one." }
        p { code { (shown(path)) } }
    };
    let sections = vec![Section::new("course", "Course", picture)];
    Ok(Page { title: "Run at the bench", lead, sections, document: None }.html())
}
