//! The description of an FMU for importers. All names come from the project or are plain text, so that nothing needs escaping.

use std::fmt::Write;

use super::variables::{Causality, Kind, MODES, VARIABLES, Variable};
use super::{Described, Version};

const HEAD: &str = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n";

/// Units: all that the variables have, by SI base units, and what people read instead.
const UNITS: &str = include_str!("../../fmu/units.xml");

/// Categories of messages.
const LOG_CATEGORIES: &str = include_str!("../../fmu/log_categories.xml");

/// `modelDescription.xml`.
pub(super) fn model(of: &Described) -> String {
    let Described { symbol, name, version, token, step_s, .. } = of;
    let (number, token_is) = match version {
        Version::Fmi2 => ("2.0", "guid"),
        Version::Fmi3 => ("3.0", "instantiationToken"),
    };
    let tool = env!("CARGO_PKG_VERSION");
    // Writing to a string cannot fail.
    let mut text = HEAD.to_owned();
    let _ = writeln!(
        text,
        "<fmiModelDescription fmiVersion=\"{number}\" modelName=\"{symbol}\" {token_is}=\"{token}\" \
         description=\"The dielectric elastomer actuator {name} and its control\" license=\"0BSD\" \
         generationTool=\"springpot {tool}\" variableNamingConvention=\"structured\">"
    );
    interface(&mut text, of);
    text += UNITS;
    modes(&mut text, *version);
    text += LOG_CATEGORIES;
    let _ = writeln!(text, "  <DefaultExperiment startTime=\"0\" stopTime=\"10\" stepSize=\"{step_s:?}\"/>");
    text += "  <ModelVariables>\n";
    if *version == Version::Fmi3 {
        text += "    <Float64 name=\"time\" valueReference=\"0\" causality=\"independent\" variability=\"continuous\" \
                 description=\"Simulated time\" unit=\"s\"/>\n";
    }
    for (reference, variable) in (1..).zip(&VARIABLES) {
        text += &element(*version, reference, variable);
    }
    text += "  </ModelVariables>\n";
    structure(&mut text, *version);
    text + "</fmiModelDescription>\n"
}

/// Co-simulation, by the film's identifier.
fn interface(text: &mut String, of: &Described) {
    let Described { symbol, step_s, compiled, .. } = of;
    match of.version {
        Version::Fmi2 => {
            let _ = writeln!(
                text,
                "  <CoSimulation modelIdentifier=\"{symbol}\" canHandleVariableCommunicationStepSize=\"false\" \
                 canNotUseMemoryManagementFunctions=\"true\" canGetAndSetFMUstate=\"true\" canSerializeFMUstate=\"true\">\n    \
                 <SourceFiles>"
            );
            for file in *compiled {
                let _ = writeln!(text, "      <File name=\"{file}\"/>");
            }
            text.push_str("    </SourceFiles>\n  </CoSimulation>\n");
        }
        Version::Fmi3 => {
            let _ = writeln!(
                text,
                "  <CoSimulation modelIdentifier=\"{symbol}\" canHandleVariableCommunicationStepSize=\"false\" \
                 fixedInternalStepSize=\"{step_s:?}\" canGetAndSetFMUState=\"true\" canSerializeFMUState=\"true\"/>"
            );
        }
    }
}

/// The type of the parameter `mode`.
fn modes(text: &mut String, version: Version) {
    let (begin, end) = match version {
        Version::Fmi2 => ("<SimpleType name=\"Mode\"><Enumeration>", "</Enumeration></SimpleType>"),
        Version::Fmi3 => ("<EnumerationType name=\"Mode\">", "</EnumerationType>"),
    };
    let _ = writeln!(text, "  <TypeDefinitions>\n    {begin}");
    for (value, (name, description)) in (1..).zip(MODES) {
        let _ = writeln!(text, "      <Item name=\"{name}\" value=\"{value}\" description=\"{description}\"/>");
    }
    let _ = writeln!(text, "    {end}\n  </TypeDefinitions>");
}

/// The type's attributes: units and bounds; a start value where it is not calculated.
fn typed(variable: &Variable) -> String {
    let start = |value: &str| match variable.causality {
        Causality::Output => String::new(),
        Causality::Parameter | Causality::Input => format!(" start=\"{value}\""),
    };
    match variable.kind {
        Kind::Real { unit, shown, start: value } => {
            let shown = shown.map(|shown| format!(" displayUnit=\"{shown}\"")).unwrap_or_default();
            format!(" unit=\"{unit}\"{shown}{}", start(value))
        }
        Kind::Whole { most } => format!(" min=\"0\" max=\"{most}\"{}", start("0")),
        Kind::Flag => start("false"),
        Kind::Choice => format!(" declaredType=\"Mode\"{}", start("1")),
    }
}

/// A variable with its type, as the version writes them.
fn element(version: Version, reference: u32, variable: &Variable) -> String {
    let Variable { name, causality, kind, description } = variable;
    let variability = match (causality, kind) {
        (Causality::Parameter, _) => "fixed",
        (_, Kind::Real { .. }) => "continuous",
        _ => "discrete",
    };
    let (kind_2, kind_3) = match kind {
        Kind::Real { .. } => ("Real", "Float64"),
        Kind::Whole { .. } => ("Integer", "Int32"),
        Kind::Flag => ("Boolean", "Boolean"),
        Kind::Choice => ("Enumeration", "Enumeration"),
    };
    let common = format!(
        "name=\"{name}\" valueReference=\"{reference}\" causality=\"{}\" variability=\"{variability}\" description=\"{description}\"",
        causality.name()
    );
    let typed = typed(variable);
    match version {
        Version::Fmi2 => format!("    <ScalarVariable {common}><{kind_2}{typed}/></ScalarVariable>\n"),
        Version::Fmi3 => format!("    <{kind_3} {common}{typed}/>\n"),
    }
}

/// All outputs: they change within steps alone, so that none depends on an input at once.
fn structure(text: &mut String, version: Version) {
    text.push_str("  <ModelStructure>\n");
    // References are places in the list, too.
    let outputs = || (1..).zip(&VARIABLES).filter(|(_, variable)| variable.causality == Causality::Output);
    for (list, element) in [("Outputs", "Output"), ("InitialUnknowns", "InitialUnknown")] {
        let unknowns = outputs().map(|(index, _)| match version {
            Version::Fmi2 => format!("      <Unknown index=\"{index}\" dependencies=\"\"/>\n"),
            Version::Fmi3 => format!("    <{element} valueReference=\"{index}\" dependencies=\"\"/>\n"),
        });
        let unknowns: String = unknowns.collect();
        *text += &match version {
            Version::Fmi2 => format!("    <{list}>\n{unknowns}    </{list}>\n"),
            Version::Fmi3 => unknowns,
        };
    }
    text.push_str("  </ModelStructure>\n");
}

/// `sources/buildDescription.xml` of FMI 3.0.
pub(super) fn build(of: &Described) -> String {
    let mut text = format!(
        "{HEAD}<fmiBuildDescription fmiVersion=\"3.0\">\n  <BuildConfiguration modelIdentifier=\"{}\">\n    \
         <SourceFileSet language=\"C99\">\n",
        of.symbol
    );
    for file in of.compiled {
        let _ = writeln!(text, "      <SourceFile name=\"{file}\"/>");
    }
    text + "    </SourceFileSet>\n    <Library name=\"m\" external=\"true\" description=\"sqrtf, exp\"/>\n  \
            </BuildConfiguration>\n</fmiBuildDescription>\n"
}
