//! Plots of a recording: what was measured and what the model makes of it.

use std::ops::Range;

use maud::{Markup, html};

use super::super::axis::{Axis, DISPLACEMENT, FORCE, MICROMETRES, MILLINEWTONS, VOLTAGE};
use super::super::chart;
use super::super::comparison_figure;
use super::super::course::Course;
use super::super::figure::{Colour, Line, Panel};
use crate::files::recording::Input;
use crate::fit::observation::Observation;
use crate::grid::{Samples, range};
use crate::spectrum::Spectrum;
use crate::statistics::mean;

/// A recording with its axes.
struct Shown<'a> {
    observation: &'a Observation,
    modelled: &'a [f64],
    /// Axis of the measured quantity.
    axis: Axis,
    /// The same for differences.
    fine: Axis,
    drive: Axis,
}

/// The plots of `observation` beside what was `modelled` at the measured times.
pub fn charts(observation: &Observation, modelled: &[f64]) -> Markup {
    let (axis, fine, drive) = match observation.input {
        Input::Voltage(_) => (DISPLACEMENT, MICROMETRES, VOLTAGE),
        Input::Force(_) => (DISPLACEMENT, MICROMETRES, FORCE),
        Input::Displacement(_) => (FORCE, MILLINEWTONS, DISPLACEMENT),
    };
    let shown = Shown { observation, modelled, axis, fine, drive };
    let [response, difference] = comparison_figure::panels(&observation.measured, modelled, axis, fine);
    let wide = [response, difference, shown.drive()];
    let more: Vec<Panel> = match Course::from_drive(observation.input.samples()) {
        Course::Held(since_s) => vec![shown.creep(since_s)],
        Course::Cycles(cycles) => [shown.loops(&cycles), shown.drift(&cycles)].into_iter().collect(),
        Course::Other => vec![shown.whole_loop()],
    };
    html! {
        h3 { (observation.name) }
        div.charts {
            @for panel in &wide { div.wide { (chart::chart(panel, &observation.name)) } }
            @for panel in more.iter().chain(&shown.spectrum()) { (chart::chart(panel, &observation.name)) }
        }
    }
}

impl Shown<'_> {
    fn measured(&self) -> &Samples {
        &self.observation.measured
    }

    fn residuals(&self) -> Vec<f64> {
        self.modelled.iter().zip(&self.measured().value).map(|(model, measured)| model - measured).collect()
    }

    fn drive(&self) -> Panel {
        let drive = self.observation.input.samples();
        Panel::new("Drive", "time (s)", self.drive.label()).with(
            Line::new(self.drive.name, &drive.time_s, &self.drive.transform(&drive.value)).coloured(Colour::GREEN),
        )
    }

    /// On a logarithmic axis from the time at which the load is held, where creep of any order is a straight or smooth line.
    fn creep(&self, since_s: f64) -> Panel {
        let Samples { time_s, value } = self.measured();
        let time: Vec<f64> = time_s.iter().map(|t| t - since_s).collect();
        let what = if self.axis.name == "force" { "Relaxation" } else { "Creep" };
        Panel::new(format!("{what} on logarithmic time"), "time since the load is held (s)", self.axis.label())
            .with(Line::on_logarithmic("measured", &time, &self.axis.transform(value)).beneath())
            .with(Line::on_logarithmic("model", &time, &self.axis.transform(self.modelled)))
            .logarithmic(true, false)
            .captioned(format!("The load is held from {since_s:.3} s on."))
    }

    /// The first and the last of the `cycles` as loops.
    fn loops(&self, cycles: &[Range<f64>]) -> Panel {
        let [Some(first), Some(last)] = [cycles.first(), cycles.last()] else { return self.whole_loop() };
        let cycles = [("first cycle", first, Colour::BLUE), ("last cycle", last, Colour::VERMILION)];
        let mut panel = self.empty_loops();
        for (name, cycle, _) in &cycles {
            let line = self.path(format!("{name}, measured"), cycle, &self.measured().value);
            panel = panel.with(line.beneath());
        }
        for (name, cycle, colour) in cycles {
            panel = panel.with(self.path(format!("{name}, model"), cycle, self.modelled).coloured(colour));
        }
        panel.captioned("The distance of the last loop from the first is creep; the width of a loop is loss.")
    }

    fn whole_loop(&self) -> Panel {
        let all = 0.0..f64::INFINITY;
        self.empty_loops().with(self.path("measured", &all, &self.measured().value).beneath()).with(self.path(
            "model",
            &all,
            self.modelled,
        ))
    }

    fn empty_loops(&self) -> Panel {
        let title = format!("{} against {}", capital(self.axis.name), self.drive.name);
        Panel { is_path: true, ..Panel::new(title, self.drive.label(), self.axis.label()) }
    }

    fn path(&self, label: impl Into<String>, during: &Range<f64>, values: &[f64]) -> Line {
        let rows = self.rows(during);
        let drive = self.observation.input.samples().at(self.measured().time_s[rows.clone()].iter().copied());
        Line::path(label, &self.drive.transform(&drive), &self.axis.transform(&values[rows]))
    }

    /// The rows that were measured `during` these times.
    fn rows(&self, during: &Range<f64>) -> Range<usize> {
        let row = |t: f64| self.measured().time_s.partition_point(|time| *time < t);
        row(during.start)..row(during.end)
    }

    /// Mean and lowest value of each cycle, less those of the first.
    fn drift(&self, cycles: &[Range<f64>]) -> Panel {
        type Kind = (&'static str, fn(&[f64]) -> f64, Colour);
        const KINDS: [Kind; 2] =
            [("mean", mean, Colour::BLUE), ("lowest", |values| range(values).0, Colour::VERMILION)];
        let cycles: Vec<&Range<f64>> = cycles.iter().filter(|cycle| !self.rows(cycle).is_empty()).collect();
        let middle: Vec<f64> = cycles.iter().map(|cycle| 0.5 * (cycle.start + cycle.end)).collect();
        let drift = |values: &[f64], of: fn(&[f64]) -> f64| -> Vec<f64> {
            let each: Vec<f64> = cycles.iter().map(|cycle| of(&values[self.rows(cycle)])).collect();
            // Both from the first measured one: a model that starts elsewhere is seen.
            let first = cycles.first().map_or(0.0, |cycle| of(&self.measured().value[self.rows(cycle)]));
            each.iter().map(|value| self.fine.per_si * (value - first)).collect()
        };
        let title = "Creep: change of each cycle";
        let mut panel = Panel::new(title, "time (s)", format!("since the first cycle ({})", self.fine.unit));
        for (name, of, _) in KINDS {
            let line = Line::new(format!("{name}, measured"), &middle, &drift(&self.measured().value, of));
            panel = panel.with(line.beneath());
        }
        for (name, of, colour) in KINDS {
            panel = panel.with(
                Line::new(format!("{name}, model"), &middle, &drift(self.modelled, of)).marked().coloured(colour),
            );
        }
        panel.captioned("Mean and lowest value of every cycle, less the first measured ones.")
    }

    fn spectrum(&self) -> Option<Panel> {
        let of = |value: Vec<f64>| Spectrum::new(&Samples { time_s: self.measured().time_s.clone(), value });
        let (measured, residual) = (of(self.measured().value.clone())?, of(self.residuals())?);
        let density = |spectrum: &Spectrum| self.fine.transform(&spectrum.density);
        Some(
            Panel::new("Spectrum", "frequency (Hz)", format!("amplitude density ({}/√Hz)", self.fine.unit))
                .with(Line::new("measured", &measured.frequency_hz, &density(&measured)).beneath())
                .with(
                    Line::new("residual", &residual.frequency_hz, &density(&residual)).coloured(Colour::VERMILION),
                )
                .logarithmic(true, true)
                .captioned("A flat residual is noise; peaks at the drive's frequency and its multiples are what the model does not follow."),
        )
    }
}

fn capital(word: &str) -> String {
    let mut letters = word.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
