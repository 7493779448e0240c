//! Titles of columns: what is measured, and in which unit.

use super::units::{self, Unit};
use super::{Quantity, Request};

/// The title of a column.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Title {
    /// As it is written in the header.
    pub name: String,
    /// Its cell in a row of units below the header.
    pub unit: Option<String>,
}

/// Interpretation of a title.
#[derive(Clone, Debug, PartialEq)]
pub struct Sense {
    /// The quantity that its words name; `None` for none, or for two at once.
    pub named: Option<Quantity>,
    /// Its unit.
    pub unit: UnitSense,
}

/// Unit in a title.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum UnitSense {
    /// One unit of those that are known.
    Known(Unit),
    /// Nothing.
    Missing,
    /// Another unit, or several.
    Other,
    /// A capital M before V or N.
    MilliOrMega,
}

/// Words that name a quantity anywhere in a title.
const WORDS: &[(Quantity, &[&str])] = &[
    (Quantity::Time, &["time", "zeit", "temps", "tiempo", "tempo", "elapsed", "timestamp", "时间", "時間"]),
    (
        Quantity::Voltage,
        &[
            "voltage",
            "volts",
            "hv",
            "highvoltage",
            "spannung",
            "hochspannung",
            "tension",
            "voltaje",
            "tensione",
            "电压",
            "電壓",
            "高压",
            "vmon",
            "umon",
        ],
    ),
    (Quantity::Force, &["force", "load", "loadcell", "kraft", "fuerza", "forza", "力", "载荷"]),
    (
        Quantity::Displacement,
        &[
            "displacement",
            "stroke",
            "laser",
            "extension",
            "elongation",
            "deflection",
            "travel",
            "position",
            "weg",
            "hub",
            "auslenkung",
            "verschiebung",
            "deplacement",
            "déplacement",
            "desplazamiento",
            "spostamento",
            "位移",
        ],
    ),
];

/// Words for what is not in recordings, which count where such a quantity is asked for.
const OTHER_WORDS: &[(Quantity, &[&str])] =
    &[(Quantity::Stretch, &["stretch", "lambda", "λ"]), (Quantity::Stress, &["stress", "zugspannung", "contrainte"])];

/// Words that name which of an amplifier's two voltages a column is.
const OF_TWO_VOLTAGES: &[(Quantity, &[&str])] = &[
    (
        Quantity::Command,
        &["command", "cmd", "setpoint", "set", "demand", "target", "input", "control", "soll", "sollwert"],
    ),
    (
        Quantity::Voltage,
        &["monitor", "mon", "vmon", "umon", "readback", "measured", "actual", "output", "ist", "istwert"],
    ),
];

/// Letters that name a quantity where they are all of a name.
const LETTERS: &[(Quantity, &[&str])] = &[
    (Quantity::Time, &["t"]),
    (Quantity::Voltage, &["u", "v"]),
    (Quantity::Force, &["f"]),
    (Quantity::Displacement, &["x", "disp", "pos"]),
];

/// Opening and closing brackets around units.
const BRACKETS: [(char, char); 4] = [('(', ')'), ('[', ']'), ('{', '}'), ('（', '）')];

impl Title {
    /// A title without a row of units.
    pub fn new(name: &str) -> Self {
        Self { name: name.into(), unit: None }
    }

    /// Interpretation of the title in a file of `request`.
    pub fn sense(&self, request: &Request<'_>) -> Sense {
        let (base, unit) = match &self.unit {
            Some(text) if !text.trim().is_empty() => (self.name.clone(), unit_cell(text)),
            _ => split(&self.name),
        };
        Sense { named: quantity(&base, request), unit }
    }
}

/// A cell of a row of units, with brackets or without.
pub fn unit_cell(text: &str) -> UnitSense {
    let bare = text.trim().trim_matches(['(', ')', '[', ']', '{', '}', '（', '）', '<', '>']);
    sense_of(bare)
}

fn sense_of(text: &str) -> UnitSense {
    match units::read(text) {
        units::Read::Unit(unit) => UnitSense::Known(unit),
        units::Read::MilliOrMega => UnitSense::MilliOrMega,
        units::Read::Other => UnitSense::Other,
    }
}

/// The name and the unit of `title`: `Time (s)`, `U [kV]`, `t/s`, `Weg, mm`, `Time in s`, `Time_s`, `Time s`.
fn split(title: &str) -> (String, UnitSense) {
    let (outside, inside) = without_brackets(title);
    let mut known: Vec<UnitSense> =
        inside.iter().map(|text| sense_of(text)).filter(|sense| *sense != UnitSense::Other).collect();
    known.dedup();
    match known.as_slice() {
        [unit] => return (outside, *unit),
        [] => {}
        _ => return (outside, UnitSense::Other),
    }
    for separator in ["/", ",", " in ", "_", " "] {
        if let Some((name, unit)) = outside.trim().rsplit_once(separator) {
            let sense = sense_of(unit);
            // `Channel V` and `Force N` end in a unit, a name of one word does not.
            if sense != UnitSense::Other && !name.trim().is_empty() {
                return (name.into(), sense);
            }
        }
    }
    if let (true, sense @ UnitSense::Known(_)) = (letter_quantity(&outside).is_none(), sense_of(&outside)) {
        // The unit is all there is: `kV`.
        return (String::new(), sense);
    }
    // Text in brackets is a unit that recordings do not have, such as (°C) or (Hz): no remark holds it back.
    (outside, if inside.is_empty() { UnitSense::Missing } else { UnitSense::Other })
}

/// Text outside of brackets, and inside of each pair.
fn without_brackets(title: &str) -> (String, Vec<String>) {
    let (mut outside, mut inside) = (String::new(), Vec::new());
    let mut open: Option<(char, String)> = None;
    for letter in title.chars() {
        match &mut open {
            Some((end, text)) => {
                if letter == *end {
                    inside.push(std::mem::take(text));
                    open = None;
                } else {
                    text.push(letter);
                }
            }
            None => match BRACKETS.iter().find(|(start, _)| *start == letter) {
                Some((_, end)) => {
                    outside.push(' ');
                    open = Some((*end, String::new()));
                }
                None => outside.push(letter),
            },
        }
    }
    if let Some((_, text)) = open {
        outside.push_str(&text);
    }
    (outside, inside)
}

/// The quantity of a name of one letter.
fn letter_quantity(name: &str) -> Option<Quantity> {
    let name = name.trim().to_lowercase();
    LETTERS.iter().find(|(_, letters)| letters.contains(&name.as_str())).map(|(quantity, _)| *quantity)
}

/// The quantity that the words of `name` mean in a file of `request`.
fn quantity(name: &str, request: &Request<'_>) -> Option<Quantity> {
    let lower = name.to_lowercase();
    let all = lower.trim();
    if all == "weight" {
        return Some(Quantity::Weight);
    }
    if let Some(quantity) = letter_quantity(all) {
        return Some(quantity);
    }
    let words: Vec<&str> = all.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty()).collect();
    let says = |candidates: &[&str]| {
        candidates.iter().any(|candidate| {
            // Chinese has no blanks between words.
            words.contains(candidate)
                || (!candidate.is_ascii() && candidate.chars().all(|c| c > '\u{2e80}') && all.contains(candidate))
        })
    };
    let only = |named: &mut dyn Iterator<Item = &(Quantity, &[&str])>| match (named.next(), named.next()) {
        (Some((quantity, _)), None) => Some(*quantity),
        _ => None,
    };
    let of_two = |(_, candidates): &&(Quantity, &[&str])| request.wants(Quantity::Command) && says(candidates);
    if let Some(quantity) = only(&mut OF_TWO_VOLTAGES.iter().filter(of_two)) {
        return Some(quantity);
    }
    let others = OTHER_WORDS.iter().filter(|(quantity, _)| request.wants(*quantity));
    only(&mut WORDS.iter().chain(others).filter(|(_, candidates)| says(candidates)))
}
