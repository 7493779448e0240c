//! Sizes that no film has, with the unit that they are likely in: millimetres read as metres would lift every limit of the field.

use springpot::{Actuator, ActuatorError, CapacitanceRelation, EPSILON_0, GRAVITY, SelfSensing, SelfSensingOptions};

use super::{Board, Parameters, as_written};
use crate::error::{self, Error};
use crate::terminal::rounded;

/// A quantity with the values that films have, in SI units, and others that people write it in.
struct Quantity {
    symbol: &'static str,
    /// Values outside are refused.
    min: f64,
    max: f64,
    /// Units with their sizes in SI units, the likeliest first.
    units: &'static [(&'static str, f64)],
}

/// Units of lengths.
const LENGTHS: &[(&str, f64)] = &[("millimetres", 1e-3), ("micrometres", 1e-6)];
/// Sides of films from 0.1 mm to 5 m.
const SIDE: Quantity = Quantity { symbol: "m", min: 1e-4, max: 5.0, units: LENGTHS };
/// Films from 0.1 µm to 5 mm thick.
const THICKNESS: Quantity = Quantity { symbol: "m", min: 1e-7, max: 5e-3, units: LENGTHS };
/// Cross-sections of bodies as wide and thick as films may be.
const AREA: Quantity = Quantity {
    symbol: "m²",
    min: SIDE.min * THICKNESS.min,
    max: SIDE.max * THICKNESS.max,
    units: &[("square millimetres", 1e-6), ("square centimetres", 1e-4), ("square micrometres", 1e-12)],
};
/// Stretches of elastomers.
const STRETCH: std::ops::RangeInclusive<f64> = 0.05..=15.0;
/// Readings of displacement sensors at x = 0, of either sign.
const OFFSET: Quantity = Quantity { symbol: "m", min: -1.0, max: 1.0, units: LENGTHS };
/// Weights up to 20 kg, or none.
const MASS: Quantity = Quantity { symbol: "kg", min: 0.0, max: 20.0, units: &[("grams", 1e-3)] };
/// A fit may find any permittivity, as it scales the force.
const PERMITTIVITY: Quantity =
    Quantity { symbol: "times that of vacuum", min: 1e-6, max: 1e9, units: &[("F/m", 1.0 / EPSILON_0)] };
/// Voltages of films, which are far above those of a battery.
const VOLTAGE: Quantity = Quantity { symbol: "V", min: 20.0, max: f64::INFINITY, units: &[("kilovolts", 1e3)] };
/// Fields that limit something: films break down above 10 MV/m.
const FIELD: Quantity = Quantity {
    symbol: "V/m",
    min: 1e4,
    max: 1e10,
    units: &[("megavolts per metre", 1e6), ("kilovolts per metre", 1e3)],
};
/// Films and cables from 1 pF to 10 µF.
const CAPACITANCE: Quantity = Quantity {
    symbol: "F",
    min: 1e-12,
    max: 1e-5,
    units: &[("picofarads", 1e-12), ("nanofarads", 1e-9), ("microfarads", 1e-6)],
};
/// Strokes from 1 µm to 1 m.
const STROKE: Quantity = Quantity { symbol: "m", min: 1e-6, max: 1.0, units: LENGTHS };
/// Tones that an amplifier of kilovolts makes.
const TONE: Quantity = Quantity { symbol: "V", min: 0.5, max: 2000.0, units: &[("kilovolts", 1e3)] };
/// Currents of the tone into the largest capacitance: amplifiers of kilovolts deliver 1 to 40 mA, which the drive of the film needs as well.
const TONE_CURRENT: Quantity = Quantity { symbol: "A", min: 0.0, max: 0.02, units: &[] };
/// Most noise of a sample by the film as its own sensor, as a share of its stroke.
const MAX_NOISE: f64 = 0.1;

impl Quantity {
    /// The fault of the value of `name`, and the value that is likely meant.
    fn fault(&self, name: &str, value: f64) -> Option<String> {
        Some(format!("{name} = {value} is {}", self.advice(value)?))
    }

    /// The same without the name.
    fn advice(&self, value: f64) -> Option<String> {
        let holds = |value: f64| (self.min..=self.max).contains(&value);
        if holds(value) {
            return None;
        }
        let Self { symbol, min, max, .. } = self;
        let meant = self.units.iter().find(|(_, size)| holds(value * size));
        let advice = match meant {
            Some((unit, size)) => match short(value * size) {
                meant if meant.abs() < 1e-6 => format!("is it in {unit}? write {meant:e}"),
                meant => format!("is it in {unit}? write {meant}"),
            },
            None => format!("films have {min} to {max} {symbol}"),
        };
        Some(format!("{value} {symbol}: {advice}"))
    }
}

/// `value` without the digits of a product's rounding.
fn short(value: f64) -> f64 {
    format!("{value:.9e}").parse().unwrap_or(value)
}

/// Refuses values that no actuator can have, whatever its size: with the quantity that is at fault, and the fault.
pub(super) fn check_numbers(actuator: &Actuator) -> Result<(), (&'static str, String)> {
    actuator.check().map_err(|error| {
        let name = match error {
            ActuatorError::NotPositive { quantity, .. } => quantity,
            ActuatorError::Mass(_) => "mass_kg",
            ActuatorError::Coupling(_) => "stretch_coupling",
            ActuatorError::Saturation(_) => "saturation_v",
            _ => "actuator",
        };
        (name, error::short(&error))
    })
}

/// Refuses an actuator that no film has.
///
/// # Errors
///
/// The first quantity that is at fault, and the faults of all, each with the unit that it is likely in.
pub fn check(actuator: &Actuator) -> Result<(), (&'static str, String)> {
    check_numbers(actuator)?;
    let values = [
        ("relative_permittivity", actuator.relative_permittivity, PERMITTIVITY),
        ("length_m", actuator.length_m, SIDE),
        ("width_m", actuator.width_m, SIDE),
        ("thickness_m", actuator.thickness_m, THICKNESS),
        ("mass_kg", actuator.mass_kg, MASS),
        ("saturation_v", actuator.saturation_v.unwrap_or(VOLTAGE.min), VOLTAGE),
    ];
    let faults: Vec<(&str, String)> =
        values.iter().filter_map(|(name, value, quantity)| Some((*name, quantity.fault(name, *value)?))).collect();
    let Some((first, _)) = faults.first() else { return Ok(()) };
    Err((first, faults.iter().map(|(_, fault)| fault.as_str()).collect::<Vec<_>>().join("; ")))
}

/// Refuses a thickness in the limits of `board` that no film has, as its supervisor takes the field from that, and implausible self-sensing.
pub(super) fn check_board(board: &Board) -> Result<(), String> {
    THICKNESS.fault("limits.thickness_m", as_written(board.limits.thickness_m)).map_or(Ok(()), Err)?;
    board.self_sensing.as_ref().map_or(Ok(()), |sensing| check_self_sensing(&sensing.relation, &sensing.options))
}

/// Refuses a length (m) along the load and a cross-section (m²) that no body has.
///
/// # Errors
///
/// [`Error::Field`] naming the one that is at fault, with the unit that it is likely in.
pub fn check_body(length_m: Option<f64>, area_m2: Option<f64>) -> crate::Result<()> {
    for (field, value, quantity) in [("length_m", length_m, SIDE), ("area_m2", area_m2, AREA)] {
        if let Some(cause) = value.and_then(|value| quantity.advice(value)) {
            return Err(Error::field(field, cause));
        }
    }
    Ok(())
}

/// Whether no elastomer has this `stretch`, and then whether it is likely in percent.
pub(in crate::files) fn implausible_stretch(stretch: f64) -> Option<bool> {
    let holds = |stretch| STRETCH.contains(&stretch);
    (!holds(stretch)).then(|| holds(1e-2 * stretch))
}

/// Refuses a reading at x = 0 (m) that no displacement sensor has.
///
/// # Errors
///
/// The fault, with the unit that it is likely in.
pub fn check_offset(offset_m: f64) -> Result<(), String> {
    if !offset_m.is_finite() {
        return Err(format!("offset_m = {offset_m} must be finite"));
    }
    OFFSET.fault("offset_m", offset_m).map_or(Ok(()), Err)
}

/// Faults of capacitances, a stroke and a tone that no film has.
pub fn self_sensing_faults(relation: &CapacitanceRelation, options: &SelfSensingOptions) -> Vec<String> {
    let CapacitanceRelation { rest_f, max_f, .. } = *relation;
    let stroke_m = stroke_m(relation);
    let values = [
        ("rest_f", rest_f, CAPACITANCE),
        ("max_f", max_f, CAPACITANCE),
        ("cable_f", if options.cable_f == 0.0 { CAPACITANCE.min } else { options.cable_f }, CAPACITANCE),
        // One that does not rise has its own message, as what is refused below.
        ("the stroke by stroke_m", if stroke_m > 0.0 { short(stroke_m) } else { STROKE.min }, STROKE),
        ("tone_v", options.tone_v, TONE),
        ("the current of the tone", short(options.tone_slew_v_per_s() * max_f), TONE_CURRENT),
    ];
    values.iter().filter_map(|(name, value, quantity)| quantity.fault(name, *value)).collect()
}

/// Displacement at the largest capacitance of `relation`, m.
fn stroke_m(relation: &CapacitanceRelation) -> f64 {
    relation.displacement_of_change(relation.max_f / relation.rest_f - 1.0)
}

/// Refuses capacitances, a stroke and a tone that no film has, and monitors whose noise hides the stroke.
pub(in crate::files) fn check_self_sensing(
    relation: &CapacitanceRelation,
    options: &SelfSensingOptions,
) -> Result<(), String> {
    let faults = self_sensing_faults(relation, options);
    if !faults.is_empty() {
        return Err(format!("self-sensing: {}", faults.join("; ")));
    }
    let noise = SelfSensing::<f64>::new(relation, *options)
        .map_or(0.0, |film| film.noise_m(options.tone_v, 1.0) / stroke_m(relation));
    if noise > MAX_NOISE {
        return Err(format!(
            "self-sensing: the noise of the monitors alone is {:.0} % of the stroke: check voltage_noise_v, current_noise_a and their units",
            100.0 * noise
        ));
    }
    Ok(())
}

/// Whether films have this relative permittivity.
pub fn is_permittivity(value: f64) -> bool {
    (1.0..=2000.0).contains(&value)
}

/// Doubts about sizes of `actuator` that some film may have, most severe first; with `scales` the permittivity only scales the force.
pub fn doubts(actuator: &Actuator, scales: bool) -> Vec<String> {
    let Actuator { relative_permittivity, length_m, width_m, thickness_m, mass_kg, .. } = *actuator;
    let mut doubts = Vec::new();
    let ((longer, long_m), (shorter, short_m)) = if length_m > width_m {
        (("length_m", length_m), ("width_m", width_m))
    } else {
        (("width_m", width_m), ("length_m", length_m))
    };
    if long_m > MAX_ASPECT * short_m || (long_m > 1.0 && long_m * short_m > MAX_AREA_M2) {
        doubts.push(format!(
            "the film is {long_m} m by {short_m} m: is {longer} in centimetres or millimetres? then write {} or {}",
            short(1e-2 * long_m),
            short(1e-3 * long_m)
        ));
    }
    if thickness_m >= short_m {
        doubts.push(format!("thickness_m = {thickness_m} is not below {shorter} = {short_m}: check the units of both"));
    }
    let volume_m3 = length_m * width_m * thickness_m;
    if thickness_m > MAX_THICKNESS_M || volume_m3 > MAX_VOLUME_M3 {
        doubts.push(format!(
            "a film of {length_m} m by {width_m} m by {thickness_m} m weighs {} kg: are its sizes in metres?",
            rounded(DENSITY * volume_m3)
        ));
    }
    let stress_pa = mass_kg * GRAVITY / (width_m * thickness_m);
    if mass_kg >= 1.0 && stress_pa > MAX_STRESS_PA {
        doubts.push(format!(
            "mass_kg = {mass_kg} is a stress of {:.0} MPa on this film, more than elastomers of actuators bear: is it in grams? then write {}",
            1e-6 * stress_pa,
            short(1e-3 * mass_kg)
        ));
    }
    if !scales && !is_permittivity(relative_permittivity) {
        doubts.push(format!("relative_permittivity = {relative_permittivity}: films have 1.5 to 1000"));
    }
    doubts
}

/// Longest side over the shortest, without doubt.
const MAX_ASPECT: f64 = 150.0;
/// Largest area without doubt, m².
const MAX_AREA_M2: f64 = 1.1;
/// Thickest film without doubt, m: at 50 MV/m that are 100 kV.
const MAX_THICKNESS_M: f64 = 2e-3;
/// Largest film without doubt, m³: a quarter of a kilogram.
const MAX_VOLUME_M3: f64 = 2.5e-4;
/// Density of elastomers, kg/m³.
const DENSITY: f64 = 1e3;
/// Largest stress of a weight without doubt, Pa: twice that of the stiffest films that are stretched by one.
const MAX_STRESS_PA: f64 = 2e6;
/// Largest displacement over the film's length without doubt: prestretched films move by more than their active length.
const MAX_STROKES: f64 = 20.0;

impl Parameters {
    /// Doubts about the sizes of the film, the limits of its board, and its model, most severe first.
    pub fn doubts(&self) -> Vec<String> {
        let limits = self.board.as_ref().map(|board| board.limits);
        let max_voltage_v = limits.map_or(6000.0, |limits| f64::from(limits.max_voltage_v));
        let faults = limits.map(|limits| {
            [
                VOLTAGE.fault("max_voltage_v", as_written(limits.max_voltage_v)),
                FIELD.fault("max_field_v_per_m", as_written(limits.max_field_v_per_m)),
            ]
        });
        let mut doubts: Vec<String> = faults.into_iter().flatten().flatten().collect();
        doubts.extend(check(&self.actuator).err().map(|(_, cause)| cause));
        // With two curves it is the scale of the force in which the mass has the recorded inertia.
        let scales = self.assumed_sizes || self.curve.is_some() && self.spring.is_some();
        doubts.extend(self::doubts(&self.actuator, scales));
        if !self.assumed_sizes && self.curve.is_none() && doubts.is_empty() {
            // As far as the field limit of films lets the voltage go.
            let volts = max_voltage_v.min(1e8 * self.actuator.thickness_m);
            let force_n = self.actuator.force_per_square_volt() * volts * volts;
            let stroke_m = force_n * self.model.creep_compliance(1.0);
            if stroke_m > MAX_STROKES * self.actuator.length_m {
                doubts.push(format!(
                    "{volts:.0} V exert {force_n:.3} N, which moves the model by {:.0e} times the film's length in 1 s: check the units of its sizes \
                     and of c",
                    stroke_m / self.actuator.length_m
                ));
            }
        }
        doubts
    }
}
