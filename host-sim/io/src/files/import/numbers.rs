//! Numbers as they are written in text.

use super::words::is_of;

crate::choice! {
    /// The sign between whole and broken part of a number.
    pub enum Decimal {
        /// 1.5; a comma separates thousands.
        Point = "point",
        /// 1,5; a point separates thousands.
        Comma = "comma",
    }
}

impl Decimal {
    /// The sign itself.
    pub(super) fn sign(self) -> char {
        if self == Self::Point { '.' } else { ',' }
    }

    /// The other sign, which may separate thousands.
    pub fn other(self) -> Self {
        if self == Self::Point { Self::Comma } else { Self::Point }
    }
}

/// A cell of text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cell<'a> {
    /// Nothing was measured: empty, `NaN` or a dash.
    Nothing,
    /// A word or a number for a reading out of range.
    OutOfRange,
    /// A number.
    Number(f64),
    /// Anything else.
    Text(&'a str),
    /// The row ends before it.
    Ended,
}

impl Cell<'_> {
    /// Its number.
    pub fn number(self) -> Option<f64> {
        if let Self::Number(number) = self { Some(number) } else { None }
    }
}

/// Words of instruments and spreadsheets for a reading that is missing or out of range, in small letters and without a sign.
const OUT_OF_RANGE: &str = "∞ inf infinity ol o.l. o.l ovl ovld ovr over overload overrange ofl overflow underflow fffffff 1.#qnan 1.#ind 1.#inf \
    1.#snan #div/0! #value! #num! #ref! invalid err error";

/// Numbers that instruments send for infinity and for no number (SCPI).
const SCPI: std::ops::RangeInclusive<f64> = 9.9e37..=9.91e37;

/// Reads the cell `text`.
pub fn cell(text: &str, decimal: Decimal) -> Cell<'_> {
    let text = text.trim();
    match number(text, decimal) {
        Some(value) if SCPI.contains(&value.abs()) => return Cell::OutOfRange,
        Some(value) => return Cell::Number(value),
        None => {}
    }
    match text.to_lowercase().as_str() {
        "" | "nan" | "-nan" | "nan(ind)" | "-nan(ind)" | "na" | "n/a" | "#n/a" | "null" | "none" => Cell::Nothing,
        // Digits that a display does not show.
        dashes if dashes.bytes().all(|byte| matches!(byte, b'-' | b'.')) && dashes.contains('-') => Cell::Nothing,
        stars if stars.bytes().all(|byte| byte == b'*') => Cell::OutOfRange,
        other if is_of(OUT_OF_RANGE, other.trim_start_matches(['+', '-', '>', '<'])) => Cell::OutOfRange,
        "out of range" => Cell::OutOfRange,
        // Beyond the end of a range: >10.
        beyond if beyond.strip_prefix(['<', '>']).is_some_and(|end| number(end.trim(), decimal).is_some()) => {
            Cell::OutOfRange
        }
        _ => Cell::Text(text),
    }
}

/// The point or comma of a number that needs no closer look, as almost all do not: digits with at most one of them in between, and an
/// exponent. `None` for all other texts.
fn plain(text: &str) -> Option<Option<u8>> {
    let (mut sign, mut has_exponent, mut before) = (None, false, b'-');
    for &byte in text.as_bytes().strip_prefix(b"+").or(text.as_bytes().strip_prefix(b"-")).unwrap_or(text.as_bytes()) {
        match byte {
            b'0'..=b'9' => {}
            b'.' | b',' if sign.is_none() && !has_exponent && before.is_ascii_digit() => sign = Some(byte),
            b'e' | b'E' if !has_exponent && before.is_ascii_digit() => has_exponent = true,
            b'+' | b'-' if matches!(before, b'e' | b'E') => {}
            _ => return None,
        }
        before = byte;
    }
    before.is_ascii_digit().then_some(sign)
}

/// Whether `text` is a number with one decimal sign or the other, as almost all are. Not all numbers are.
pub fn is_plain(text: &str) -> bool {
    plain(text).is_some()
}

/// Digits with at most one decimal sign, and an exponent. Thousands may be separated by blanks, apostrophes or the other sign.
pub fn number(text: &str, decimal: Decimal) -> Option<f64> {
    if let Some(sign) = plain(text)
        && sign.is_none_or(|sign| sign == b'.' && decimal == Decimal::Point)
    {
        return text.parse().ok();
    }
    let digits = text.strip_prefix(['+', '-', '\u{2212}', '\u{2013}']).unwrap_or(text);
    let mantissa = mantissa(digits);
    let exponent = &digits[mantissa.len()..];
    let (whole, broken) = mantissa.split_once(decimal.sign()).unwrap_or((mantissa, ""));
    let ungrouped: String;
    let whole = if all_digits(whole) {
        whole
    } else {
        let separator = whole.chars().find(|c| !c.is_ascii_digit())?;
        if !(separator == decimal.other().sign() || is_group_separator(separator)) || !is_grouped(whole, separator) {
            return None;
        }
        ungrouped = whole.replace(separator, "");
        &ungrouped
    };
    // A comma at the end separates; a point at the end is how some write whole numbers.
    let ends_badly = decimal == Decimal::Comma && mantissa.ends_with(',');
    if !all_digits(broken) || whole.len() + broken.len() == 0 || ends_badly {
        return None;
    }
    if !exponent.is_empty() && !all_digits(exponent[1..].trim_start_matches(['+', '-'])) {
        return None;
    }
    let sign = if text.starts_with(['-', '\u{2212}', '\u{2013}']) { "-" } else { "" };
    format!("{sign}{whole}.{broken}{}", exponent.replace(['d', 'D'], "e")).parse().ok()
}

/// Whether the cell `text` is a number with one decimal sign or the other.
pub fn is_number(text: &str) -> bool {
    [Decimal::Point, Decimal::Comma].iter().any(|sign| cell(text, *sign).number().is_some())
}

/// The number `text` with a decimal point, or else with a decimal comma.
pub fn with_either_sign(text: &str) -> Option<f64> {
    number(text, Decimal::Point).or_else(|| number(text, Decimal::Comma))
}

/// Whether each of the first `values` is larger than the one before.
pub fn increase(values: &[f64]) -> bool {
    const COUNT: usize = 200;
    let first = &values[..values.len().min(COUNT)];
    first.len() > 1 && first.windows(2).all(|pair| pair[0] < pair[1])
}

/// `digits` without an exponent.
fn mantissa(digits: &str) -> &str {
    let end = digits.bytes().position(|byte| matches!(byte, b'e' | b'E' | b'd' | b'D'));
    &digits[..end.unwrap_or(digits.len())]
}

/// Whether there is nothing but digits in `part`, if anything.
pub fn all_digits(part: &str) -> bool {
    part.bytes().all(|byte| byte.is_ascii_digit())
}

/// Blanks of all widths and apostrophes between groups of three digits.
fn is_group_separator(c: char) -> bool {
    matches!(c, ' ' | '\u{a0}' | '\u{2009}' | '\u{202f}' | '\'' | '\u{2019}')
}

/// Whether `whole` is digits in groups of three: 1.234 or 12.345.678, but not 0.123 or 1234.567.
fn is_grouped(whole: &str, separator: char) -> bool {
    let mut groups = whole.split(separator);
    let first = groups.next().unwrap_or_default();
    (1..=3).contains(&first.len())
        && all_digits(first)
        && !first.starts_with('0')
        && groups.all(|group| group.len() == 3 && all_digits(group))
}

/// How the numbers of a column or of a file are written: cells by the signs in them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Signs {
    /// Whole numbers without any sign.
    pub plain: usize,
    /// Cells whose one point can only be decimal: 1.5.
    pub points: usize,
    /// Cells whose one comma can only be decimal.
    pub commas: usize,
    /// Cells whose point may separate thousands: 1.234.
    pub grouped_points: usize,
    /// Cells whose comma may.
    pub grouped_commas: usize,
    /// Cells that separate thousands with points beyond doubt: 1.234,5 or 1.234.567.
    pub thousands_points: usize,
    /// Cells that do with commas.
    pub thousands_commas: usize,
}

impl Signs {
    /// Counts the signs of the cell `text`.
    pub fn count(&mut self, text: &str) {
        let text = text.trim();
        let plain = plain(text);
        if plain == Some(None) {
            self.plain += 1;
            return;
        }
        let digits = text.trim_start_matches(['+', '-', '\u{2212}', '\u{2013}']);
        let mantissa = mantissa(digits);
        if mantissa.is_empty() || !(plain.is_some() || with_either_sign(digits).is_some()) {
            return;
        }
        let count = |sign: u8| mantissa.bytes().filter(|byte| *byte == sign).count();
        // Other separators of thousands leave no doubt about the sign.
        let has_others = plain.is_none() && mantissa.chars().any(is_group_separator);
        let certain = has_others || mantissa.len() < digits.len();
        let grouped = |sign: char| !certain && is_grouped(mantissa, sign);
        let slot = match (count(b'.'), count(b',')) {
            (0, 0) => &mut self.plain,
            (1, 0) if grouped('.') => &mut self.grouped_points,
            (0, 1) if grouped(',') => &mut self.grouped_commas,
            (1, 0) => &mut self.points,
            (0, 1) => &mut self.commas,
            (_, 0) => &mut self.thousands_points,
            (0, _) => &mut self.thousands_commas,
            _ if mantissa.rfind('.') > mantissa.rfind(',') => {
                self.points += 1;
                &mut self.thousands_commas
            }
            _ => {
                self.commas += 1;
                &mut self.thousands_points
            }
        };
        *slot += 1;
    }

    /// Whether a number has any sign.
    pub fn has_signs(self) -> bool {
        self != Self { plain: self.plain, ..Self::default() }
    }

    /// The same of two.
    pub fn and(self, other: Self) -> Self {
        Self {
            plain: self.plain + other.plain,
            points: self.points + other.points,
            commas: self.commas + other.commas,
            grouped_points: self.grouped_points + other.grouped_points,
            grouped_commas: self.grouped_commas + other.grouped_commas,
            thousands_points: self.thousands_points + other.thousands_points,
            thousands_commas: self.thousands_commas + other.thousands_commas,
        }
    }

    /// The decimal sign of a file with these signs; none where all of them may separate thousands.
    pub fn decimal(self) -> Result<Option<Decimal>, String> {
        const BOTH: &str = "numbers have decimal points and decimal commas in one file; export them with one of both, or say which it is with `decimal`";
        let points = self.points + self.thousands_commas;
        let commas = self.commas + self.thousands_points;
        match (points, commas) {
            (1.., 1..) => Err(BOTH.into()),
            (1.., 0) if self.grouped_commas > 0 && self.thousands_commas == 0 => Err(BOTH.into()),
            (0, 1..) if self.grouped_points > 0 && self.thousands_points == 0 => Err(BOTH.into()),
            (1.., 0) => Ok(Some(Decimal::Point)),
            (0, 1..) => Ok(Some(Decimal::Comma)),
            (0, 0) if self.grouped_points + self.grouped_commas > 0 => Ok(None),
            (0, 0) => Ok(Some(Decimal::Point)),
        }
    }

    /// Whether the numbers of a column can be read in two ways in a file with that `decimal` sign: some are whole, and the signs of all others
    /// may separate thousands, as in 850 and 1.234.
    pub fn is_ambiguous(self, decimal: Option<Decimal>) -> bool {
        let (grouped, certain) = match decimal {
            Some(Decimal::Point) => (self.grouped_points, self.points),
            Some(Decimal::Comma) => (self.grouped_commas, self.commas),
            None => (self.grouped_points + self.grouped_commas, 0),
        };
        grouped > 0 && certain == 0 && (self.plain > 0 || decimal.is_none())
    }
}
