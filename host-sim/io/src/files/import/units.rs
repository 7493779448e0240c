//! Units as headers have them, with their factors to SI.

use super::Quantity;
use super::numbers;
use super::words::is_of;

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

/// The units with their symbols, whose case counts, and their words, whose case does not, with blanks between them.
const UNITS: &[(Unit, &str, &str)] = &[
    (unit(Quantity::Time, "s", 1.0), "s 秒 с сек", "sec secs second seconds sek sekunde sekunden secondes segundos"),
    (unit(Quantity::Time, "ms", 1e-3), "ms 毫秒 мс ㎳", "msec millisecond milliseconds millisekunden"),
    (unit(Quantity::Time, "µs", 1e-6), "µs us мкс ㎲", "usec microsecond microseconds mikrosekunden"),
    (unit(Quantity::Time, "ns", 1e-9), "ns", "nsec nanosecond nanoseconds"),
    (unit(Quantity::Time, "min", 60.0), "min mins 分 мин", "minute minutes minuten"),
    (unit(Quantity::Time, "h", 3600.0), "h hr hrs", "hour hours stunden"),
    (unit(Quantity::Time, "d", 86400.0), "", "days tage"),
    (unit(Quantity::Voltage, "V", 1.0), "V v 伏 В", "volt volts"),
    (unit(Quantity::Voltage, "kV", 1e3), "kV kv KV 千伏 кВ ㎸", "kilovolt kilovolts"),
    (unit(Quantity::Voltage, "mV", 1e-3), "mV мВ ㎷", "millivolt millivolts"),
    (unit(Quantity::Force, "N", 1.0), "N 牛 Н", "newton newtons"),
    (unit(Quantity::Force, "kN", 1e3), "kN", "kilonewton kilonewtons"),
    (unit(Quantity::Force, "mN", 1e-3), "mN мН", "millinewton millinewtons"),
    (unit(Quantity::Force, "µN", 1e-6), "µN uN", "micronewton micronewtons"),
    (unit(Quantity::Force, "gf", 9.80665e-3), "gf", "gram-force"),
    (unit(Quantity::Force, "kgf", 9.80665), "kgf", "kilogram-force"),
    (unit(Quantity::Force, "lbf", 4.448_221_615_260_5), "lbf", "pound-force"),
    (unit(Quantity::Displacement, "m", 1.0), "m 米 м", "meter meters metre metres"),
    (unit(Quantity::Displacement, "cm", 1e-2), "cm 厘米 см ㎝", "centimeter centimetre centimeters centimetres"),
    (unit(Quantity::Displacement, "mm", 1e-3), "mm MM 毫米 мм ㎜", "millimeter millimeters millimetre millimetres"),
    (
        unit(Quantity::Displacement, "µm", 1e-6),
        "µm um 微米 мкм ㎛",
        "micron microns micrometer micrometers micrometre micrometres",
    ),
    (unit(Quantity::Displacement, "nm", 1e-9), "nm", "nanometer nanometers nanometre nanometres"),
    (unit(Quantity::Displacement, "in", 25.4e-3), "in", "inch inches"),
    (unit(Quantity::Displacement, "mil", 25.4e-6), "mil mils thou", ""),
    (unit(Quantity::Stress, "Pa", 1.0), "Pa pa", "pascal"),
    (unit(Quantity::Stress, "kPa", 1e3), "kPa kpa", "kilopascal"),
    (unit(Quantity::Stress, "MPa", 1e6), "MPa mpa N/mm² N/mm2", "megapascal"),
];

/// Whether `cell` is a number with its unit.
pub fn is_behind_number(cell: &str) -> bool {
    let (number, unit) = cell.split_at(cell.find(char::is_alphabetic).unwrap_or(cell.len()));
    numbers::with_either_sign(number.trim()).is_some() && read(unit, false).is_some()
}

/// `text` as the table has units: without a point at its end, and without DC behind volts.
fn bare(text: &str) -> String {
    // The Greek letter and the sign of the micro prefix look the same.
    let text = text.trim().trim_end_matches('.').replace('\u{3bc}', "µ");
    let direct = ["DC", "dc"].iter().find_map(|end| text.strip_suffix(end)).map(str::trim_end);
    direct.filter(|volts| volts.to_lowercase().contains('v')).map_or(text.clone(), str::to_owned)
}

/// Symbols with a capital M before V or N: milli or mega.
const MILLI_OR_MEGA: [&str; 4] = ["MV", "MN", "Mv", "Mn"];

/// Whether `text` is one of those.
pub fn is_milli_or_mega(text: &str) -> bool {
    MILLI_OR_MEGA.contains(&bare(text).as_str())
}

/// The unit that `text` is. The case of a symbol counts (Nm is a torque, nm a length), except in a header in `capitals`.
pub fn read(text: &str, capitals: bool) -> Option<Unit> {
    let text = bare(text);
    let lower = text.to_lowercase();
    let found = |is: &dyn Fn(&str) -> bool| {
        let has = |(_, symbols, words): &&(Unit, &str, &str)| symbols.split(' ').any(is) || is_of(words, &lower);
        UNITS.iter().find(has).filter(|_| !text.is_empty()).map(|(unit, ..)| *unit)
    };
    // NM is newton metres as well as nanometres.
    let may_be_lower = || capitals && text != "NM" && !MILLI_OR_MEGA.contains(&text.as_str());
    found(&|symbol| symbol == text)
        .or_else(|| may_be_lower().then(|| found(&|symbol| symbol.to_lowercase() == lower)).flatten())
}

/// The units of `quantity`.
pub fn units_of(quantity: Quantity) -> impl Iterator<Item = Unit> {
    UNITS.iter().map(|(unit, ..)| *unit).filter(move |unit| unit.quantity == quantity)
}

/// The spellings that errors show for `quantity`.
pub fn usual(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::Time => "s, ms, µs, ns, min, h or days",
        Quantity::Voltage | Quantity::Command => "V, kV or mV",
        Quantity::Force => "N, mN, µN, kN, gf, kgf or lbf",
        Quantity::Displacement => "m, cm, mm, µm, nm, in or mil",
        Quantity::Stress => "Pa, kPa or MPa",
        Quantity::Weight | Quantity::Temperature | Quantity::Stretch => "none",
    }
}
