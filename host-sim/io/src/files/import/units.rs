//! Units as headers have them, with their factors to SI.

use super::Quantity;

/// A unit of one of the quantities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// Quantity that is measured in it.
    pub quantity: Quantity,
    /// As it is written here.
    pub name: &'static str,
    /// To SI.
    pub factor: f64,
}

const fn unit(quantity: Quantity, name: &'static str, factor: f64) -> Unit {
    Unit { quantity, name, factor }
}

/// The units with all their spellings.
const UNITS: &[(Unit, &[&str])] = &[
    (unit(Quantity::Time, "s", 1.0), &["s", "sec", "secs", "second", "seconds", "sek", "sekunden", "秒"]),
    (unit(Quantity::Time, "ms", 1e-3), &["ms", "msec", "millisecond", "milliseconds", "millisekunden", "毫秒"]),
    (unit(Quantity::Time, "µs", 1e-6), &["µs", "us", "usec", "microseconds", "mikrosekunden"]),
    (unit(Quantity::Time, "min", 60.0), &["min", "mins", "minute", "minutes", "minuten", "分"]),
    (unit(Quantity::Time, "h", 3600.0), &["h", "hr", "hrs", "hour", "hours", "stunden"]),
    (unit(Quantity::Voltage, "V", 1.0), &["V", "v", "volt", "volts", "伏"]),
    (unit(Quantity::Voltage, "kV", 1e3), &["kV", "kv", "kilovolt", "kilovolts", "千伏"]),
    (unit(Quantity::Voltage, "mV", 1e-3), &["mV", "mv", "millivolt", "millivolts"]),
    (unit(Quantity::Force, "N", 1.0), &["N", "n", "newton", "newtons", "牛"]),
    (unit(Quantity::Force, "kN", 1e3), &["kN", "kn", "kilonewton"]),
    (unit(Quantity::Force, "mN", 1e-3), &["mN", "mn", "millinewton"]),
    (unit(Quantity::Force, "µN", 1e-6), &["µN", "uN", "un", "micronewton"]),
    (unit(Quantity::Displacement, "m", 1.0), &["m", "meter", "meters", "metre", "metres", "米"]),
    (unit(Quantity::Displacement, "cm", 1e-2), &["cm", "centimeter", "centimetre", "厘米"]),
    (
        unit(Quantity::Displacement, "mm", 1e-3),
        &["mm", "millimeter", "millimeters", "millimetre", "millimetres", "毫米"],
    ),
    (unit(Quantity::Displacement, "µm", 1e-6), &["µm", "um", "micron", "microns", "micrometer", "micrometre", "微米"]),
    (unit(Quantity::Displacement, "nm", 1e-9), &["nm", "nanometer", "nanometre"]),
    (unit(Quantity::Stress, "Pa", 1.0), &["Pa", "pa", "pascal"]),
    (unit(Quantity::Stress, "kPa", 1e3), &["kPa", "kpa"]),
    // Millipascals do not occur: capitals or not, it is mega.
    (unit(Quantity::Stress, "MPa", 1e6), &["MPa", "mpa", "N/mm²", "n/mm²", "N/mm2", "n/mm2"]),
];

/// Interpretation of a text as a unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Read {
    /// One of the units above.
    Unit(Unit),
    /// A capital M before V or N: milli or mega.
    MilliOrMega,
    /// None of them.
    Other,
}

/// Reads `text` as a unit. Its case counts where it is right, and does not where a header is in capitals.
pub fn read(text: &str) -> Read {
    // The Greek letter and the sign of the micro prefix look the same.
    let text = text.trim().trim_end_matches('.').replace('\u{3bc}', "µ");
    let exact = |wanted: &str| UNITS.iter().find(|(_, names)| names.contains(&wanted)).map(|(unit, _)| *unit);
    if let Some(unit) = exact(&text) {
        return Read::Unit(unit);
    }
    if matches!(text.as_str(), "MV" | "MN" | "Mv" | "Mn") {
        return Read::MilliOrMega;
    }
    exact(&text.to_lowercase()).map_or(Read::Other, Read::Unit)
}

/// The spellings that errors show for `quantity`.
pub fn usual(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Time => "s, ms, µs, min or h",
        Quantity::Voltage | Quantity::Command => "V, kV or mV",
        Quantity::Force => "N, mN, µN or kN",
        Quantity::Displacement => "m, cm, mm, µm or nm",
        Quantity::Stress => "Pa, kPa or MPa",
        Quantity::Weight | Quantity::Stretch => "none",
    }
}
