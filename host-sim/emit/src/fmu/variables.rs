//! Variables of an FMU: the same for every film and both versions.

/// The type of a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// A number of the model, in single precision, with its unit and the one that people read it in.
    Real {
        unit: &'static str,
        shown: Option<&'static str>,
        start: &'static str,
    },
    /// A whole number up to `most`.
    Whole {
        most: u32,
    },
    Flag,
    /// The mode.
    Choice,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Causality {
    Parameter,
    Input,
    Output,
}

impl Kind {
    /// Its name in C.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Real { .. } => "FMU_REAL",
            Self::Whole { .. } => "FMU_WHOLE",
            Self::Flag => "FMU_FLAG",
            Self::Choice => "FMU_CHOICE",
        }
    }
}

impl Causality {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Parameter => "parameter",
            Self::Input => "input",
            Self::Output => "output",
        }
    }
}

pub(super) struct Variable {
    pub(super) name: &'static str,
    pub(super) causality: Causality,
    pub(super) kind: Kind,
    pub(super) description: &'static str,
}

/// Modes by their values, from 1.
pub(super) const MODES: [(&str, &str); 5] = [
    ("plant", "the film: voltage to displacement"),
    ("observer", "an estimate of a film from voltage and samples of its displacement"),
    ("feedforward", "a voltage for a reference, without a sensor"),
    ("tracking", "a voltage for a reference, with a sensor"),
    ("adaptive", "tracking whose law follows a film that changes"),
];

const METRES: Kind = real("m", Some("mm"), "0");
const VOLTS: Kind = real("V", Some("kV"), "0");
const NEWTONS: Kind = real("N", None, "0");

const fn real(unit: &'static str, shown: Option<&'static str>, start: &'static str) -> Kind {
    Kind::Real { unit, shown, start }
}

const fn parameter(name: &'static str, kind: Kind, description: &'static str) -> Variable {
    Variable { name, causality: Causality::Parameter, kind, description }
}

const fn input(name: &'static str, kind: Kind, description: &'static str) -> Variable {
    Variable { name, causality: Causality::Input, kind, description }
}

const fn output(name: &'static str, kind: Kind, description: &'static str) -> Variable {
    Variable { name, causality: Causality::Output, kind, description }
}

/// All but the time, whose reference is 0, in the order of their references from 1.
pub(super) const VARIABLES: [Variable; 22] = [
    parameter("mode", Kind::Choice, "What this FMU is"),
    parameter("learning", Kind::Flag, "Feedforward, tracking: the errors of periodic references are learned"),
    parameter(
        "applied_is_given",
        Kind::Flag,
        "Feedforward, tracking: the input voltage is what was applied since the last tick; otherwise it was the command",
    ),
    parameter(
        "temperature_is_given",
        Kind::Flag,
        "Tracking, adaptive: the input temperature is the film's, which was fitted at several; otherwise it is that of its parameters",
    ),
    input(
        "voltage",
        VOLTS,
        "Plant, observer: voltage on the film. Feedforward, tracking: what was applied, if that is given",
    ),
    input("reference", METRES, "Feedforward, tracking: displacement to reach at the end of this tick"),
    input("sample", METRES, "Observer, tracking, learning: a sample of the displacement sensor"),
    input("sample_taken", Kind::Flag, "Whether a sample has arrived"),
    input("sample_age", Kind::Whole { most: 63 }, "How many ticks ago it was measured"),
    input("reading", VOLTS, "Feedforward, tracking: what a voltage monitor read"),
    input("reading_taken", Kind::Flag, "Whether there is such a reading"),
    input("temperature", real("degC", None, "20"), "Tracking, adaptive: temperature of the film, if that is given"),
    output("displacement", METRES, "Of the film: simulated (plant, feedforward) or estimated (observer, tracking)"),
    output(
        "force",
        NEWTONS,
        "Plant, observer: of the voltage, weight included. Feedforward, tracking: electrostatic force that the command needs",
    ),
    output("command", VOLTS, "Feedforward, tracking: voltage to apply from now on"),
    output("shaped_reference", METRES, "Feedforward, tracking: the reference within speed and acceleration"),
    output(
        "limits",
        Kind::Whole { most: 255 },
        "Sum of the limits met: 1 below zero, 2 voltage, 4 field, 8 slew, 16 speed, 32 acceleration, 64 beyond the curve, 128 amplifier",
    ),
    output("disturbance", NEWTONS, "Observer, tracking: force that the model does not know"),
    output(
        "force_scale",
        real("1", None, "1"),
        "Observer, tracking: effect of the electrostatic force over the model's",
    ),
    output("ageing", real("1", None, "0"), "Adaptive: how far the film has moved from its law; fit it again from 1 on"),
    output(
        "stiffness_change",
        real("1", None, "0"),
        "Adaptive: change of the film's stiffness, if nothing else has changed, as a share of it",
    ),
    output("sensor_lost", Kind::Flag, "Observer, tracking: no sample for too long"),
];
