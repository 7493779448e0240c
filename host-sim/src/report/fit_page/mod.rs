//! The page of a fit: how well it follows the recordings, what it is, and how far it can be relied on.

mod agreement;
mod controller;
mod model;
mod origin;
mod parameters;
mod recording;
pub(super) mod warnings;

use maud::html;

use super::numbers::{Document, Form, Numbers};
use super::page::{Page, Section};
use crate::files::parameters::Parameters;
use crate::files::recording::{Direction, Input};
use crate::fit::observation::Observation;
use crate::fit::{Fit, FitReport};

/// Contents of the page of a fit.
pub struct FitPage<'a> {
    pub report: &'a FitReport,
    pub fit: &'a Fit,
    /// The recordings as they were fitted.
    pub observations: &'a [Observation],
    /// The parameters as they are written.
    pub parameters: &'a Parameters,
    /// Input of the model.
    pub direction: Direction,
    /// How a film follows with it, where one was simulated.
    pub followed: Option<Picture>,
}

/// How a film follows a reference: the first that the page shows.
pub struct Picture {
    /// In a sentence, where it was run.
    pub verdict: Option<String>,
    pub section: Section,
}

impl FitPage<'_> {
    /// The page. The report is in `document`, which `--json` prints, at `place`; `more` follows the recordings.
    pub fn html(self, title: &str, document: &Document, place: &str, more: Vec<Section>) -> String {
        let numbers = Numbers::from_document(document).at(place);
        let recordings = html! {
            @for (observation, modelled) in self.observations.iter().zip(&self.fit.modelled) {
                (recording::charts(observation, modelled))
            }
        };
        let (verdict, first) =
            self.followed.map_or((None, None), |Picture { verdict, section }| (verdict, Some(section)));
        let mut sections: Vec<Section> = first.into_iter().collect();
        sections.extend([
            Section::new(
                "warnings",
                "Warnings",
                warnings::list(&self.report.warnings, self.report.uncertainty.is_some()),
            ),
            Section::new("agreement", "Agreement", agreement::tables(&numbers)),
            Section::new("recordings", "Recordings", recordings),
        ]);
        sections.extend(more);
        sections.extend([
            Section::new("model", "Model", model::body(&numbers, self.parameters, self.observations)),
            Section::new("parameters", "Parameters", parameters::tables(&numbers)),
            Section::new("controller", "On a controller", controller::body(&numbers)),
            Section::new("origin", "Files and origin", origin::body(&numbers, self.direction)),
        ]);
        let lead = html! {
            @if let Some(verdict) = verdict { p.verdict { (verdict) } }
            @if matches!(self.observations[0].input, Input::Voltage(_)) {
                p.verdict {
                    "Expect feedforward to be off by up to " (numbers.number("/expected_pct", Form::Fixed(2)))
                    " % RMS of the recorded stroke, within the recorded strokes, speeds and times."
                }
            }
            p.verdict {
                (self.report.topology) " with n = " (numbers.number("/branches", Form::Fixed(0)))
                @if self.report.branches == 1 { " branch" } @else { " branches" }
                ": R² mean " (numbers.number("/r2_mean", Form::Fixed(6))) " over "
                (self.report.recordings.len())
                @if self.report.recordings.len() == 1 { " recording" } @else { " recordings" }
                "; " (warnings::count(&self.report.warnings)) "."
                @if self.report.interrupted { " The search was interrupted: this is the best so far." }
            }
            @if let Some(file) = &self.report.parameters_file {
                p { "Next: check a reference of yours with " code { "springpot feedforward --params " (file) " --reference reference.csv --check" } }
            }
        };
        Page { title, lead, sections, document: Some(document) }.html()
    }
}
