//! `NAME.json` beside a C file: the film for MATLAB and Octave, which read it with `jsondecode` (`matlab/springpot_film.m`).

use host_io::files::parameters::Parameters;
use host_io::{Error, Result};
use serde::Serialize;
use springpot::{Preload, Springpot, Tracking};

/// How the file begins: what is written over.
pub(super) const BEGIN: &str = "{\n  \"format\": \"springpot-film\",";

#[derive(Serialize)]
struct Description<'a> {
    format: &'a str,
    schema: u32,
    name: &'a str,
    actuator: Actuator,
    model: Model,
    sensor: Sensor,
    law: Law,
}

#[derive(Serialize)]
struct Actuator {
    relative_permittivity: f64,
    length_m: f64,
    width_m: f64,
    thickness_m: f64,
    mass_kg: f64,
    preload: Preload,
    stretch_coupling: f64,
    saturation_per_square_volt: f64,
    force_per_square_volt: f64,
    preload_n: f64,
}

/// Springpots as pairs of c and alpha: `jsondecode` makes a matrix of them. Two rows are a branch.
#[derive(Serialize)]
struct Model {
    topology: springpot::Topology,
    main: [f64; 2],
    branches: Vec<[f64; 2]>,
    has_curve: bool,
}

#[derive(Serialize)]
struct Sensor {
    offset_m: f64,
}

/// The law in single precision, as the C file has it.
#[derive(Serialize)]
struct Law {
    rate_hz: f64,
    stiffness_n_per_m: f64,
}

/// The text of `NAME.json`: `parameters` at `rate_hz`, whose C file holds `tracking`.
pub(super) fn json(parameters: &Parameters, rate_hz: f64, tracking: &Tracking<f32>) -> Result<String> {
    let Parameters { name, actuator, model, curve, spring, sensor_offset_m, .. } = parameters;
    let pair = |element: &Springpot| [element.c, element.alpha];
    let description = Description {
        format: "springpot-film",
        schema: 1,
        name,
        actuator: Actuator {
            relative_permittivity: actuator.relative_permittivity,
            length_m: actuator.length_m,
            width_m: actuator.width_m,
            thickness_m: actuator.thickness_m,
            mass_kg: actuator.mass_kg,
            preload: actuator.preload,
            stretch_coupling: actuator.stretch_coupling,
            saturation_per_square_volt: actuator.saturation(),
            force_per_square_volt: actuator.force_per_square_volt(),
            preload_n: actuator.preload_n(),
        },
        model: Model {
            topology: model.topology(),
            main: pair(&model.main()),
            branches: model.branches().iter().flatten().map(pair).collect(),
            has_curve: curve.is_some() || spring.is_some(),
        },
        sensor: Sensor { offset_m: *sensor_offset_m },
        law: Law { rate_hz, stiffness_n_per_m: tracking.observer().law().stiffness().into() },
    };
    let text = serde_json::to_string_pretty(&description).map_err(|e| Error::Computation(e.to_string()))?;
    Ok(text + "\n")
}
