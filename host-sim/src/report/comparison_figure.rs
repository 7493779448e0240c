//! Measured values beside those of a model.

use super::axis::Axis;
use super::figure::{Colour, Line, Panel};
use crate::grid::Samples;

/// Both on `axis`, and their difference on the `fine` one; `modelled` is at the measured times.
pub fn panels(measured: &Samples, modelled: &[f64], axis: Axis, fine: Axis) -> [Panel; 2] {
    let Samples { time_s: time, value } = measured;
    let difference: Vec<f64> = modelled.iter().zip(value).map(|(model, measured)| model - measured).collect();
    [
        Panel::new("Measured and modelled", "time (s)", axis.label())
            .with(Line::new("measured", time, &axis.transform(value)).beneath())
            .with(Line::new("model", time, &axis.transform(modelled)))
            .captioned(
                "Measured is the wide grey line; where the model follows it, the thin line runs along its middle.",
            ),
        Panel::new("Residual", "time (s)", format!("model − measured ({})", fine.unit))
            .with(Line::new("model − measured", time, &fine.transform(&difference)).coloured(Colour::VERMILION)),
    ]
}
