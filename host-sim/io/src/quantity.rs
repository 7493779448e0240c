//! Quantities as a person types them: `6kV`, `2.5mm`, `10s`, or the plain number in SI units.
//!
//! One parser per quantity, for every option of every command. What is not finite is refused here, before any work.

use crate::error::{Error, Result};

/// A quantity that options take.
struct Quantity {
    /// The unit of a plain number.
    si: &'static str,
    /// Units and their sizes in SI units. `u` means `µ` and `2` means `²`.
    units: &'static [(&'static str, f64)],
}

/// Sizes of the numbers that are taken, beside 0: no instrument of this field is beyond.
const SIZES: std::ops::RangeInclusive<f64> = 1e-15..=1e15;

/// Result of a parser: the value in SI units, or what is wrong with the text.
pub type Parsed = std::result::Result<f64, String>;

/// A parser for each quantity: the unit of a plain number, and the units with their sizes. Each refuses text that is not a finite number with
/// one of them.
macro_rules! parsers {
    ($($(#[$doc:meta])* $name:ident($si:literal) $([$($unit:literal = $size:literal),*])?;)*) => {
        $($(#[$doc])*
        pub fn $name(text: &str) -> Parsed {
            Quantity { si: $si, units: &[$($(($unit, $size)),*)?] }.parse(text)
        })*
    };
}

parsers! {
    /// A voltage, V.
    volts("V") ["V" = 1.0, "mV" = 1e-3, "kV" = 1e3];
    /// A length, m.
    metres("m") ["m" = 1.0, "cm" = 1e-2, "mm" = 1e-3, "um" = 1e-6, "nm" = 1e-9];
    /// A time, s.
    seconds("s") ["s" = 1.0, "ms" = 1e-3, "us" = 1e-6, "min" = 60.0, "h" = 3600.0, "d" = 86_400.0];
    /// A frequency or a rate, Hz.
    hertz("Hz") ["Hz" = 1.0, "mHz" = 1e-3, "kHz" = 1e3, "MHz" = 1e6];
    /// An electric field, V/m.
    volts_per_metre("V/m") ["V/m" = 1.0, "kV/m" = 1e3, "MV/m" = 1e6, "V/mm" = 1e3, "kV/mm" = 1e6, "V/um" = 1e6];
    /// A change of voltage, V/s.
    volts_per_second("V/s") ["V/s" = 1.0, "kV/s" = 1e3, "MV/s" = 1e6, "V/ms" = 1e3, "kV/ms" = 1e6];
    /// A speed, m/s.
    metres_per_second("m/s") ["m/s" = 1.0, "cm/s" = 1e-2, "mm/s" = 1e-3, "um/s" = 1e-6];
    /// An acceleration, m/s².
    metres_per_second_squared("m/s2") ["m/s2" = 1.0, "cm/s2" = 1e-2, "mm/s2" = 1e-3, "um/s2" = 1e-6];
    /// An area, m².
    square_metres("m2") ["m2" = 1.0, "cm2" = 1e-4, "mm2" = 1e-6, "um2" = 1e-12];
    /// A temperature, °C.
    celsius("°C") ["C" = 1.0, "°C" = 1.0];
    /// A share of 1, or in %.
    share("") ["%" = 1e-2];
    /// A number without a unit.
    number("");
}

impl Quantity {
    fn parse(&self, text: &str) -> Parsed {
        let text = text.trim();
        let (digits, unit) = text.split_at(number_length(text));
        let value: f64 = digits.parse().map_err(|_| self.not_a_number(text))?;
        let unit = unit.trim();
        if unit.starts_with(',') {
            return Err("write a point for the decimals, no comma".into());
        }
        let size = self.factor(unit)?;
        let value = value * size;
        if value == 0.0 || SIZES.contains(&value.abs()) {
            // 2.5 mm is 0.0025 m, not the product's 0.0025000000000000001.
            Ok(decimal(digits, size).unwrap_or(value))
        } else if value.is_finite() {
            Err(format!("{value:e} must be 0, or from {:e} to {:e} in size", SIZES.start(), SIZES.end()))
        } else {
            Err("must be finite".into())
        }
    }

    /// The size of `unit`; a plain number is in SI units.
    fn factor(&self, unit: &str) -> Parsed {
        if unit.is_empty() {
            return Ok(1.0);
        }
        let plain = unit.replace(['µ', 'μ'], "u").replace('²', "2").replace(['^', ' '], "");
        if let Some((_, size)) = self.units.iter().find(|(name, _)| *name == plain) {
            return Ok(*size);
        }
        let names: Vec<&str> = self.units.iter().map(|(name, _)| *name).collect();
        if names.is_empty() {
            return Err(format!("{unit:?} follows the number; this option takes a plain number"));
        }
        // A capital M is a millionfold and no misspelt m.
        let same =
            |name: &&&str| name.eq_ignore_ascii_case(&plain) && !(name.starts_with('m') && plain.starts_with('M'));
        let mut alike = names.iter().filter(same);
        let meant = match (alike.next(), alike.next()) {
            (Some(name), None) => format!("; did you mean {name}?"),
            _ => String::new(),
        };
        let si = if self.si.is_empty() { "".into() } else { format!("a plain number in {}, or ", self.si) };
        Err(format!("unknown unit {unit:?}: write {si}one of {}{meant}", names.join(", ")))
    }

    fn not_a_number(&self, text: &str) -> String {
        let word = text.trim_start_matches(['+', '-']).to_ascii_lowercase();
        if ["nan", "inf", "infinity"].contains(&word.as_str()) {
            return "must be finite".into();
        }
        if text.starts_with("--") {
            return "the value is missing".into();
        }
        let example = self.units.iter().find(|(name, _)| *name != self.si);
        match example {
            Some((name, _)) => format!("a number is needed, such as 2 or 2{name}"),
            None => "a number is needed, such as 2".into(),
        }
    }
}

/// The value of `digits` in a unit whose `size` is a power of ten: rounded once, as the plain number would be.
fn decimal(digits: &str, size: f64) -> Option<f64> {
    let power = size.log10().round();
    let is_decimal = format!("1e{power}").parse() == Ok(size) && !digits.contains(['e', 'E']);
    is_decimal.then(|| format!("{digits}e{power}").parse().ok()).flatten()
}

/// Length of the number that `text` begins with, bytes.
fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let digits = |from: usize| from + bytes[from..].iter().take_while(|byte| byte.is_ascii_digit()).count();
    let sign = |at: usize| at + usize::from(bytes.get(at).is_some_and(|byte| matches!(byte, b'+' | b'-')));
    let mut end = digits(sign(0));
    if bytes.get(end) == Some(&b'.') {
        end = digits(end + 1);
    }
    if matches!(bytes.get(end), Some(b'e' | b'E')) {
        let from = sign(end + 1);
        let after = digits(from);
        if after > from {
            end = after;
        }
    }
    end
}

/// Refuses a value that is not finite and greater than 0.
pub fn positive(option: &'static str, value: f64) -> Result<()> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(Error::field(option, format!("{value:?} must be finite and greater than 0")))
    }
}

/// Refuses a value outside 0 to `most`.
pub fn at_most(option: &'static str, value: f64, most: f64) -> Result<()> {
    if (0.0..=most).contains(&value) {
        Ok(())
    } else {
        Err(Error::field(option, format!("{value:?} must be from 0 to {most}")))
    }
}
