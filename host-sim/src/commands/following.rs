//! A sine that a fitted film can follow, without and with compensation: the first that the pages of a fit and of a demo show.

use std::f64::consts::PI;
use std::sync::atomic::{AtomicBool, Ordering};

use maud::{Markup, html};
use springpot::CommandLimits;

use super::prelude::*;
use crate::choice::Choice;
use crate::files::parameters::Parameters;
use crate::grid::Grid;
use crate::references::{Reference, Shape};
use crate::replay::expectation::Recorded;
use crate::replay::feasibility::{self, Feasibility};
use crate::replay::feedforward::{self, VoltagePlan};
use crate::replay::limits::command_limits;
use crate::replay::memory::{Precision, RunOptions};
use crate::report::axis::DISPLACEMENT;
use crate::report::chart;
use crate::report::figure::{Colour, Line, Panel};
use crate::report::fit_page::Picture;
use crate::report::numbers::{Form, Numbers};
use crate::report::page::Section;
use crate::report::tracking_figure;
use crate::simulation::closed_loop::{self, BenchModel, LoopRun, TrackingQuality};
use crate::simulation::controllers::{self, ControllerKind};
use crate::simulation::plant::{FullMemoryPlant, Mismatch, Plant};
use crate::simulation::tuning::ControllerTuning;

/// The controllers that are compared.
const CONTROLLERS: [ControllerKind; 3] = [ControllerKind::None, ControllerKind::Feedforward, ControllerKind::Tracking];
/// Its shares of the recorded stroke, of which the first that the film can follow is taken.
const SHARES: [f64; 3] = [0.45, 0.25, 0.1];
/// The longest sine, s.
const MAX_S: f64 = 155.0;

/// Films that the runs are on, as subjects of the verdict.
pub(super) const SIMULATED_FILM: &str = "the simulated film";
pub(super) const REFITTED_FILM: &str = "the film as it is fitted to a part of the recordings";

/// A sine and how a film follows it, for machines.
#[derive(Default, Serialize)]
pub(super) struct Following {
    /// How the film follows, in a sentence.
    pub(super) verdict: Option<String>,
    /// The sine; none where no voltage was recorded or the film can follow none.
    pub(super) reference: Option<ReferenceRow>,
    pub(super) closed_loop: Vec<LoopRow>,
}

#[derive(Serialize)]
pub(super) struct ReferenceRow {
    pub(super) low_m: f64,
    pub(super) high_m: f64,
    pub(super) period_s: f64,
    pub(super) duration_s: f64,
    pub(super) check: Feasibility,
}

#[derive(Serialize)]
pub(super) struct LoopRow {
    pub(super) controller: &'static str,
    #[serde(flatten)]
    pub(super) quality: TrackingQuality,
}

/// A sine that the film can follow.
pub(super) struct Sine {
    pub(super) grid: Grid,
    pub(super) values: Vec<f64>,
    limits: CommandLimits,
    reference: Reference,
    check: Feasibility,
}

impl Sine {
    /// A sine of one of the [`SHARES`] of the stroke that was recorded of the film of `parameters`, about its middle, moved by an offset
    /// where the check finds one; within the voltage and the field of the recordings.
    pub(super) fn followable(parameters: &Parameters) -> Result<Option<Self>> {
        let Some(recorded) = Recorded::from_parameters(parameters) else { return Ok(None) };
        let Recorded { stroke_m: [_, peak_m], voltage_v, .. } = recorded;
        // As long as the model was fitted for, with a rise of half a period and fifteen periods, or fewer that are no faster than the recordings.
        let duration_s = recorded.time_s.min(MAX_S);
        let slowest_s = PI * SHARES[0] * peak_m / recorded.speed_m_per_s;
        let period_s = (duration_s / 15.5).max(slowest_s.min(duration_s / 2.5));
        let grid = Grid::covering(duration_s, RunOptions::default().rate_hz)?;
        if !(voltage_v > 0.0 && peak_m > 0.0 && grid.samples > 100) {
            return Ok(None);
        }
        let actuator = &parameters.actuator;
        let max_field = voltage_v * actuator.thinning(peak_m) / actuator.thickness_m;
        let limits = command_limits(None, [("max_voltage_v", voltage_v), ("max_field_v_per_m", max_field)])?;
        let on = |low_m: f64, high_m: f64| -> Result<Self> {
            let reference =
                Reference { rise_s: 0.5 * period_s, ..Reference::new(Shape::Sine, low_m, high_m, period_s) };
            let values = reference.on(grid)?;
            let check = feasibility::check(parameters, &values, grid, &limits)?;
            Ok(Self { grid, values, limits, reference, check })
        };
        for share in SHARES {
            let (low_m, high_m) = (0.5 - 0.5 * share, 0.5 + 0.5 * share);
            let mut sine = on(low_m * peak_m, high_m * peak_m)?;
            if let (false, Some(least), Some(most)) =
                (sine.check.feasible, sine.check.least_offset_m, sine.check.most_offset_m)
            {
                let offset_m = 0.5 * (least + most);
                sine = on(low_m * peak_m + offset_m, high_m * peak_m + offset_m)?;
            }
            if sine.check.feasible {
                return Ok(Some(sine));
            }
        }
        Ok(None)
    }

    /// The controllers for `parameters` on films that `plant` gives at rest, until `stop`.
    pub(super) fn follow<'a>(
        self,
        parameters: &Parameters,
        plant: impl Fn(f64, usize) -> Result<Box<dyn Plant + 'a>>,
        stop: &AtomicBool,
    ) -> Result<Followed> {
        let runs = self.runs(parameters, plant, stop)?;
        Ok(Followed { sine: self, runs, ended_by: None })
    }

    fn runs<'a>(
        &self,
        parameters: &Parameters,
        plant: impl Fn(f64, usize) -> Result<Box<dyn Plant + 'a>>,
        stop: &AtomicBool,
    ) -> Result<Vec<(&'static str, LoopRun)>> {
        let grid = self.grid;
        let (substeps, substep_s) = closed_loop::substeps(grid);
        let tuning = ControllerTuning::at_rate(grid.rate_hz);
        let bench = BenchModel::default();
        let mut runs = Vec::new();
        for kind in CONTROLLERS {
            if stop.load(Ordering::Relaxed) {
                break;
            }
            let mut settings = tuning.settings(kind, parameters, self.limits)?;
            settings.peak_m = self.reference.high_m;
            let mut controller = controllers::build(kind, parameters, &settings, Precision::F32)?;
            let mut film = plant(substep_s, substeps * grid.samples)?;
            let bar = Progress::over(grid.samples as u64, kind.name());
            let run = closed_loop::track_plant(film.as_mut(), &bench, controller.as_mut(), &self.values, grid, &bar)?;
            bar.finish_and_clear();
            runs.push((kind.name(), run));
        }
        Ok(runs)
    }

    /// As [`follow`](Self::follow), on the film as it is fitted to a part of the recordings: of these the one whose answer to feedforward is the
    /// farthest from the sine. Nothing is run where it was fitted to the whole alone; a film that cannot be followed is no fault of the fit.
    pub(super) fn follow_refit(self, parameters: &Parameters, stop: &AtomicBool) -> Followed {
        match self.runs_on_refit(parameters, stop) {
            Ok(runs) => Followed { sine: self, runs, ended_by: None },
            Err(error) => Followed { sine: self, runs: Vec::new(), ended_by: Some(error) },
        }
    }

    fn runs_on_refit(&self, parameters: &Parameters, stop: &AtomicBool) -> Result<Vec<(&'static str, LoopRun)>> {
        let plan = self.plan(parameters)?;
        let farthest = |recorded: Recorded| recorded.farthest(parameters, &self.values, self.grid, plan.voltage_v);
        let Some(film) = Recorded::from_parameters(parameters).and_then(farthest) else { return Ok(Vec::new()) };
        let plant = |substep_s, substeps| -> Result<Box<dyn Plant>> {
            Ok(Box::new(FullMemoryPlant::at_rest(&film, Mismatch::NONE, substep_s, substeps)?))
        };
        self.runs(parameters, plant, stop)
    }

    /// The voltage that makes the model of `parameters` follow it.
    pub(super) fn plan(&self, parameters: &Parameters) -> Result<VoltagePlan> {
        let bar = Progress::over(self.grid.samples as u64, "feedforward");
        let plan = feedforward::plan(parameters, &self.values, self.grid, &RunOptions::default(), self.limits, &bar)?;
        bar.finish_and_clear();
        Ok(plan)
    }
}

/// A sine, and the runs along it by their controllers.
pub(super) struct Followed {
    sine: Sine,
    runs: Vec<(&'static str, LoopRun)>,
    /// Why there are no runs.
    ended_by: Option<Error>,
}

impl Followed {
    /// Its numbers.
    pub(super) fn report(&self) -> Following {
        let Sine { reference: Reference { low_m, high_m, period_s, .. }, grid, check, .. } = &self.sine;
        let rows = self.runs.iter().map(|(controller, run)| LoopRow { controller, quality: run.quality() });
        let closed_loop: Vec<LoopRow> = rows.collect();
        let reference = ReferenceRow {
            low_m: *low_m,
            high_m: *high_m,
            period_s: *period_s,
            duration_s: grid.time_s(grid.samples - 1),
            check: check.clone(),
        };
        Following { verdict: verdict(&closed_loop), reference: Some(reference), closed_loop }
    }

    /// Its part of a page whose document has this `report` at `numbers`; the runs are on `film`.
    pub(super) fn picture(&self, report: &Following, numbers: &Numbers<'_>, film: &str) -> Picture {
        let (first, rest) = film.split_at(1);
        let verdict = report.verdict.as_ref().map(|verdict| format!("{}{rest} {verdict}.", first.to_uppercase()));
        Picture { verdict, section: Section::new("following", "Following a reference", self.body(numbers, film)) }
    }

    fn body(&self, numbers: &Numbers<'_>, film: &str) -> Markup {
        let reference = numbers.at("/reference");
        let Self { sine, runs, ended_by } = self;
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
                @if let Some(error) = ended_by { p { "It was not tried on a film: " (error.to_string()) "." } }
            } @else {
                p {
                    "On " (film) ", from rest: without compensation the voltage is scaled to the reference's peak; feedforward inverts \
                     the fitted model; tracking corrects it with the sensor."
                }
                (tracking_figure::comparison(&numbers.at("/closed_loop"), &named, sine.grid))
            }
        }
    }
}

/// How a film follows with each of the [`CONTROLLERS`], in a sentence.
fn verdict(rows: &[LoopRow]) -> Option<String> {
    let [none, feedforward, tracking] = rows else { return None };
    let rms = |row: &LoopRow| row.quality.tracking_rms_pct.unwrap_or(f64::NAN);
    Some(format!(
        "follows within {:.2} % RMS, {:.2} % without the sensor, {:.1} % without compensation",
        rms(tracking),
        rms(feedforward),
        rms(none)
    ))
}

fn panel(sine: &Sine) -> Panel {
    let line = Line::new("reference", &sine.grid.times_s(), &DISPLACEMENT.transform(&sine.values));
    Panel::new("Reference", "time (s)", DISPLACEMENT.label()).with(line.coloured(Colour::GREEN))
}
