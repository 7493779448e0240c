//! Parameter files: TOML text.

use std::path::Path;

use host_io::files::parameters::Parameters;

use crate::place::{PATH, line_of};

/// Reads `data` as a parameter file. What is read can be written and read again; what is refused names its line.
/// Returns whether it was read.
pub fn run(data: &[u8]) -> bool {
    // Files that are not UTF-8 are refused before.
    let Ok(text) = std::str::from_utf8(data) else { return false };
    match Parameters::from_toml(Path::new(PATH), text) {
        Ok(parameters) => {
            comes_back(&parameters);
            true
        }
        Err(error) => {
            let line = line_of(&error).unwrap_or_else(|| panic!("no line: {error}"));
            let lines = text.lines().count().max(1) as u64;
            // The end of a text that ends with a line is on the next.
            assert!((1..=lines + 1).contains(&line), "{error}, of {lines} lines");
            false
        }
    }
}

/// Written and read again it is the same, and so is what is written of that.
fn comes_back(parameters: &Parameters) {
    let written = parameters.to_toml();
    let again = Parameters::from_toml(Path::new(PATH), &written).unwrap_or_else(|error| panic!("{error}\n{written}"));
    assert_eq!(again.to_toml(), written);
    let Parameters {
        name,
        actuator,
        assumed_sizes,
        model,
        curve,
        spring,
        temperature,
        sensor_offset_m,
        sensor_delay_s,
        board,
        method: _,
        provenance: _,
    } = parameters;
    // Of the provenance, free text, the words alone: it may hold NaN, which is unequal to itself.
    assert_eq!((&again.name, &again.actuator, &again.model), (name, actuator, model));
    assert_eq!(&again.curve, curve);
    assert_eq!((&again.spring, &again.temperature), (spring, temperature));
    assert_eq!((again.sensor_offset_m, &again.board, again.assumed_sizes), (*sensor_offset_m, board, *assumed_sizes));
    assert_eq!(again.sensor_delay_s, *sensor_delay_s);
    assert!(model.branches().len() <= 5 && sensor_offset_m.is_finite());
}
