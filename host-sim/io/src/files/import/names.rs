//! Titles of columns: what is measured, and in which unit.

use super::factors::{is_factor, is_scaled};
use super::units::{self, Unit};
use super::words::{
    DEGREES, DERIVED, DRIVEN, ELSEWHERE, MACHINES, NO_CELSIUS, NO_TIMES, OF_TWO_VOLTAGES, ORDERED, OTHER_UNITS,
    OTHER_WORDS, SIZES, STEPS, TEMPERATURES, TRUE_STRESS, WORDS, is_of, letter_quantity, without_brackets, words,
};
use super::{Names, Quantity, Request};

/// The title of a column.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Title {
    /// As it is written in the header.
    pub name: String,
    /// Its cell in a row of units below the header.
    pub unit: Option<String>,
    /// The group that a row above the header has for it, such as set points.
    pub group: String,
    /// Whether its cells are times of day.
    pub clock: bool,
    /// Whether its cells are neither that nor numbers.
    pub text: bool,
    /// Whether its first numbers increase from row to row, as times do.
    pub increases: bool,
}

/// Interpretation of a title.
#[derive(Clone, Debug, PartialEq)]
pub struct Sense {
    /// The quantity that its words name; `None` for none, or for two at once.
    pub named: Option<Quantity>,
    /// Its unit.
    pub unit: UnitSense,
    /// Why it may not be what was measured.
    pub doubt: Option<Doubt>,
    /// Whether it may be the command or the monitor of an amplifier by its words, which name nothing else.
    pub of_amplifier: bool,
}

/// Unit in a title.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum UnitSense {
    /// One unit of those that are known.
    Known(Unit),
    /// Times of day.
    Clock,
    /// Nothing.
    Missing,
    /// One unit in the name and another in the row of units.
    Conflict,
    /// A unit of something else, or several.
    Other,
    /// A text that is no unit here: a rare unit, one in a wrong encoding, or a remark.
    Unread,
    /// A capital M before V or N.
    MilliOrMega,
}

/// Why a column of a quantity may not be what was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Doubt {
    /// Its name says that it was asked for.
    Ordered,
    /// Its name says that it was computed.
    Derived,
    /// Its name is that of a size.
    Size,
    /// Its name is that of a voltage elsewhere.
    Elsewhere,
    /// Its name has a factor.
    Scaled,
}

impl Doubt {
    /// As an error says it of a column.
    pub fn text(self) -> &'static str {
        match self {
            Self::Ordered => "may be what was asked for, not what was measured",
            Self::Derived => "may be computed, not measured from moment to moment",
            Self::Size => "may be a size, which does not move",
            Self::Elsewhere => {
                "may be a current, or the voltage of the mains, a supply, a sensor, a switch or an input, not that of the film"
            }
            Self::Scaled => "has a factor in its name, which its numbers may have or not",
        }
    }

    /// The doubt about a column of `quantity` with a title, which is `base` without its unit, in a file of `request`.
    fn about(title: &Title, base: &str, quantity: Option<Quantity>, request: &Request<'_>) -> Option<Self> {
        let name = title.name.as_str();
        let words = words(&format!("{} {name}", title.group));
        let says =
            |parts: &str| parts.split(' ').any(|part| is_within(part, name) || words.iter().any(|w| has(w, part)));
        // What was asked for is what a reference and the command of an amplifier are.
        let may_be_ordered = !request.wants(Quantity::Voltage) && !request.wants(Quantity::Force)
            || matches!(quantity, Some(Quantity::Command | Quantity::Time | Quantity::Stretch | Quantity::Stress));
        if !may_be_ordered && says(ORDERED) {
            return Some(Self::Ordered);
        }
        let is_derived = match quantity {
            Some(Quantity::Time) => says(NO_TIMES) || says(STEPS),
            None => says(DERIVED) || says(STEPS),
            Some(Quantity::Stress) => says(DERIVED) || says(TRUE_STRESS),
            Some(_) => says(DERIVED),
        };
        // Not a differential probe.
        let is_difference = quantity != Some(Quantity::Voltage) && words.iter().any(|word| word == "diff");
        if is_derived || is_difference || is_negated(name) || name.contains("/dt") {
            return Some(Self::Derived);
        }
        if matches!(quantity, None | Some(Quantity::Displacement)) && says(SIZES) {
            return Some(Self::Size);
        }
        // On a film is not the end of a name, on or off is.
        let is_switch = || self::words(base).last().is_some_and(|last| matches!(last.as_str(), "on" | "off"));
        if quantity == Some(Quantity::Voltage) && !request.wants(Quantity::Command) && (says(ELSEWHERE) || is_switch())
        {
            return Some(Self::Elsewhere);
        }
        // A second laser is x2, a second voltage is not.
        let is_doubled = || quantity == Some(Quantity::Voltage) && words.iter().any(|word| is_factor(word));
        (is_scaled(name) || base.contains(['²', '³']) || is_doubled()).then_some(Self::Scaled)
    }
}

/// Whether `word` is `part`, also behind the symbol of a quantity, as in Vset; or has a long one in it, or a short one at its beginning.
fn has(word: &str, part: &str) -> bool {
    let letters = part.chars().count();
    let behind_symbol = || ["hv", "v", "u", "x"].iter().any(|symbol| word.strip_prefix(symbol) == Some(part));
    word == part
        || (letters >= 5 && word.contains(part))
        || (letters == 4 && word.chars().count() > 6 && word.starts_with(part))
        || behind_symbol()
}

/// Whether `name` begins with a minus: `-Voltage`.
fn is_negated(name: &str) -> bool {
    let behind = name.trim_start().strip_prefix(['-', '\u{2212}', '\u{2013}']);
    behind.is_some_and(|name| name.trim_start().starts_with(char::is_alphabetic))
}

/// Whether `name` has the Chinese word `candidate`: there are no blanks between those.
fn is_within(candidate: &str, name: &str) -> bool {
    !candidate.is_ascii() && candidate.chars().all(|c| c > '\u{2e80}') && name.contains(candidate)
}

impl Title {
    /// A title without a row of units.
    pub fn new(name: &str) -> Self {
        Self { name: name.into(), ..Self::default() }
    }

    /// Interpretation of the title in a file of `request`, whose titles are all in `capitals` or not.
    pub fn sense(&self, request: &Request<'_>, capitals: bool) -> Sense {
        let (base, own) = split(&self.name, request, capitals);
        let below = self.unit.as_ref().filter(|text| !text.trim().is_empty());
        let unit = match below.map(|text| (unit_cell(text, capitals), own)) {
            None => own,
            Some((UnitSense::Known(below), UnitSense::Known(own))) if below != own => UnitSense::Conflict,
            Some((below, UnitSense::Missing | UnitSense::Other | UnitSense::Unread)) => below,
            Some((_, own)) => own,
        };
        let named = quantity_in(&base, unit.known(), request);
        let is_clock = self.clock && named.is_none_or(|named| named == Quantity::Time);
        Sense {
            named,
            unit: if is_clock { UnitSense::Clock } else { unit },
            doubt: Doubt::about(self, &base, named, request),
            of_amplifier: named.is_none() && is_of_amplifier(&base),
        }
    }
}

/// Whether a column of this `name` may be a temperature, by its words or its unit.
pub(super) fn is_temperature(name: &str) -> bool {
    let words = words(name);
    let is_word = |word: &str, candidate: &str| {
        let bare = word.trim_end_matches(|c: char| c.is_ascii_digit());
        word == candidate || bare == candidate || (candidate.len() > 9 && word.contains(candidate))
    };
    let is_named = |candidate: &str| words.iter().any(|word| is_word(word, candidate)) || is_within(candidate, name);
    let is_unit =
        |unit: &str| name.trim().ends_with(unit) || without_brackets(name).1.iter().any(|text| text.trim() == unit);
    TEMPERATURES.split(' ').any(is_named) || DEGREES.split(' ').any(is_unit)
}

/// Whether the title of a temperature has another unit than °C, or a factor.
pub(super) fn is_no_celsius(title: &Title) -> bool {
    let inside = without_brackets(&title.name).1;
    let mut units = inside.iter().map(String::as_str).chain(title.unit.as_deref()).map(str::trim);
    units.any(|unit| is_of(NO_CELSIUS, unit) || unit.contains(|c: char| c.is_ascii_digit()))
}

/// Whether the `title` of a displacement may be that of a machine or a stage, and not of the sensor with the title `sensor`.
pub(super) fn is_of_machine(title: &Title, sensor: &Title) -> bool {
    let is_of_one = |title: &Title| words(&title.name).iter().any(|word| is_of(MACHINES, word));
    is_of_one(title) && !is_of_one(sensor)
}

/// Whether `name` has a word for an amplifier, its command or its monitor, or what it drives, and none for its current. Any instrument
/// has an output.
fn is_of_amplifier(name: &str) -> bool {
    let words = words(name);
    let is_word =
        |word: &str| words.iter().any(|other| other == word) && !matches!(word, "input" | "output" | "control");
    let of_two = OF_TWO_VOLTAGES.iter().flat_map(|(_, candidates)| candidates.split(' '));
    let says = of_two.chain(DRIVEN.split(' ')).any(is_word);
    says && !words.iter().any(|word| matches!(word.as_str(), "current" | "i" | "strom" | "courant"))
}

/// Whether `end`, behind the name in a title, is its unit: in brackets, or one that is known here in any case of letters.
pub(super) fn is_unit(end: &str) -> bool {
    let (outside, inside) = without_brackets(end);
    let unit = outside.trim().trim_start_matches(['_', '/', ',', ' ']);
    let unit = unit.strip_prefix("in ").unwrap_or(unit);
    if unit.is_empty() { !inside.is_empty() } else { sense_of(unit, true).known().is_some() && unit != end }
}

/// Whether the `name` of a column is that of a time.
pub(super) fn is_time(name: &str) -> bool {
    let request = Request { wanted: &[], needed: &[] };
    Title::new(name).sense(&request, false).named == Some(Quantity::Time)
}

/// Whether a column of this `title` may be a time, by its words or its unit.
pub(super) fn may_be_time(title: &Title) -> bool {
    is_time(&title.name) || title.sense(&Request { wanted: &[], needed: &[] }, false).unit.is_of(Quantity::Time)
}

/// Whether a column of this `title` is a reading, a setting or a result by its words or its unit, and not a name or a number of something.
pub(super) fn may_be_read(title: &Title) -> bool {
    let drives: &[(Quantity, &Names)] = &[(Quantity::Voltage, &[])];
    let sense = title.sense(&Request { wanted: drives, needed: &[] }, false);
    sense.named.is_some()
        || sense.unit != UnitSense::Missing
        || matches!(sense.doubt, Some(Doubt::Ordered | Doubt::Derived | Doubt::Scaled))
        || is_temperature(&title.name)
}

/// A cell of a row of units, with brackets or without.
pub fn unit_cell(text: &str, capitals: bool) -> UnitSense {
    let bare = text.trim().trim_matches(['(', ')', '[', ']', '{', '}', '（', '）', '<', '>']);
    sense_of(bare, capitals)
}

fn sense_of(text: &str, capitals: bool) -> UnitSense {
    match units::read(text, capitals) {
        Some(unit) => UnitSense::Known(unit),
        None if units::is_milli_or_mega(text) => UnitSense::MilliOrMega,
        // A number without a unit.
        None if matches!(text.trim(), "-" | "1") => UnitSense::Missing,
        None if is_other_unit(text.trim()) => UnitSense::Other,
        None => UnitSense::Unread,
    }
}

/// Whether `text` is a unit of a quantity that a recording does not have.
pub(super) fn is_other_unit(text: &str) -> bool {
    is_of(OTHER_UNITS, &text.to_lowercase())
}

impl UnitSense {
    /// The unit, if it is known here.
    pub fn known(self) -> Option<Unit> {
        if let Self::Known(unit) = self { Some(unit) } else { None }
    }

    /// Whether it is a unit of `quantity`.
    pub fn is_of(self, quantity: Quantity) -> bool {
        self.known().is_some_and(|unit| unit.quantity == quantity)
    }

    /// Whether there is a text that is no unit of a recording's quantities.
    pub(super) fn is_nothing(self) -> bool {
        matches!(self, Self::Other | Self::Unread)
    }
}

/// The name and the unit of `title`: `Time (s)`, `U [kV]`, `t/s`, `Weg, mm`, `Time in s`, `Time_s`, `Time s`.
fn split(title: &str, request: &Request<'_>, capitals: bool) -> (String, UnitSense) {
    let (outside, inside) = without_brackets(title);
    let mut known: Vec<UnitSense> =
        inside.iter().map(|text| sense_of(text, capitals)).filter(|sense| !sense.is_nothing()).collect();
    known.dedup();
    match known.as_slice() {
        [unit] => return (outside, *unit),
        [] => {}
        _ => return (outside, UnitSense::Other),
    }
    let outside = outside.replace(" per ", "/").replace(" pro ", "/");
    for separator in ["/", ",", " in ", "_", " "] {
        // The word in is no inch: `Channel in`.
        if let Some((name, unit)) = outside.trim().rsplit_once(separator).filter(|(_, unit)| unit.trim() != "in") {
            let sense = sense_of(unit, capitals);
            if let UnitSense::Known(unit) = sense
                && is_compound(name, separator, unit)
            {
                return (name.into(), UnitSense::Other);
            }
            // `Channel V` and `Force N` end in a unit, a name of one word does not, and in `Laser_min` it is not minutes.
            let fits = match (sense, quantity_in(name, sense.known(), request)) {
                (UnitSense::Known(unit), None) if matches!(separator, "/" | "_" | " ") => {
                    unit.quantity != Quantity::Time || is_numbered_time(name)
                }
                (UnitSense::Known(unit), Some(named)) if matches!(separator, "_" | " ") => {
                    named.measure() == unit.quantity
                }
                _ => true,
            };
            if !sense.is_nothing() && sense != UnitSense::Missing && !name.trim().is_empty() && fits {
                return (name.into(), if ends_in_factor(name, sense) { UnitSense::Other } else { sense });
            }
        }
    }
    if let (true, sense @ UnitSense::Known(_)) = (letter_quantity(&outside).is_none(), sense_of(&outside, capitals)) {
        // The unit is all there is: `kV`.
        return (String::new(), sense);
    }
    // Text in brackets is a unit that recordings do not have, such as (°C) or (Hz): no remark holds it back.
    let unread = inside.iter().any(|text| sense_of(text, capitals) == UnitSense::Unread);
    let unit = if unread { UnitSense::Unread } else { UnitSense::Other };
    (outside, if inside.is_empty() { UnitSense::Missing } else { unit })
}

/// Whether `unit` behind `name` and `separator` is the last part of another unit, as in `E kV/mm`, `Torque N m` and `Counts/mm`; the
/// symbol of a quantity is in front of its own unit (`V/kV`), and s is a displacement as well (`s/mm`).
fn is_compound(name: &str, separator: &str, unit: Unit) -> bool {
    let last = name.trim_end().rsplit([' ', '_', '/', '·', '*']).next().unwrap_or_default();
    let is_unit = |first: Unit| first.quantity != Quantity::Time && letter_quantity(last) != Some(unit.quantity);
    units::read(last, false).is_some_and(is_unit) || (separator == "/" && is_other_unit(last))
}

/// Whether `name` has a word such as t, t2 or time1.
fn is_numbered_time(name: &str) -> bool {
    words(name).iter().any(|word| matches!(word.trim_end_matches(|c: char| c.is_ascii_digit()), "t" | "time" | "zeit"))
}

/// Whether the `unit` behind `name` is counted by a number: in `HV in 100 V`, `Weg 1/100 mm` and `Time 5 ms`, but not in `Laser 2 mm`.
fn ends_in_factor(name: &str, unit: UnitSense) -> bool {
    let mut words = name.split([' ', '_']).filter(|word| !word.is_empty()).rev();
    let last = words.next().unwrap_or_default();
    let has_letters = last.contains(|c: char| c.is_alphabetic()) && last.parse::<f64>().is_err();
    let is_number = last.contains(|c: char| c.is_ascii_digit()) && !has_letters;
    let is_time = unit.is_of(Quantity::Time);
    let counts = |word: &str| matches!(word, "in" | "à" | "of" | "von" | "de");
    is_number && (is_time || last.chars().count() > 1 || words.next().is_some_and(counts))
}

/// The quantity of a `name` with a `unit`: u and v in a unit of length are displacements in mechanics, so they name nothing.
fn quantity_in(name: &str, unit: Option<Unit>, request: &Request<'_>) -> Option<Quantity> {
    let is_length = unit.is_some_and(|unit| unit.quantity == Quantity::Displacement);
    quantity(name, request).filter(|_| !is_length || letter_quantity(name) != Some(Quantity::Voltage))
}

/// The quantity that the words of `name` mean in a file of `request`.
pub(super) fn quantity(name: &str, request: &Request<'_>) -> Option<Quantity> {
    if name.trim().to_lowercase() == "weight" {
        return Some(Quantity::Weight);
    }
    // Of the temperatures of a laboratory only this one is the film's.
    if name.trim() == "temperature_c" {
        return Some(Quantity::Temperature);
    }
    if let Some(quantity) = letter_quantity(name) {
        return Some(quantity);
    }
    let words = words(name);
    let says = |candidates: &str| {
        candidates.split(' ').any(|candidate| words.iter().any(|word| word == candidate) || is_within(candidate, name))
    };
    let only = |named: &mut dyn Iterator<Item = &(Quantity, &str)>| match (named.next(), named.next()) {
        (Some((quantity, _)), None) => Some(*quantity),
        _ => None,
    };
    let of_two = |(_, candidates): &&(Quantity, &str)| request.wants(Quantity::Command) && says(candidates);
    if let Some(quantity) = only(&mut OF_TWO_VOLTAGES.iter().filter(of_two)) {
        return Some(quantity);
    }
    let others = OTHER_WORDS.iter().filter(|(quantity, _)| request.wants(*quantity));
    only(&mut WORDS.iter().chain(others).filter(|(_, candidates)| says(candidates)))
}
