//! Numbers as they are written in text.

/// The sign between whole and broken part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Decimal {
    /// 1.5
    Point,
    /// 1,5
    Comma,
}

/// A cell of text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cell<'a> {
    /// Nothing was measured: empty, `NaN` or a dash.
    Nothing,
    /// A number.
    Number(f64),
    /// Anything else.
    Text(&'a str),
}

/// Reads the cell `text`.
pub fn cell(text: &str, decimal: Decimal) -> Cell<'_> {
    let text = text.trim();
    if let Some(value) = number(text, decimal) {
        return Cell::Number(value);
    }
    match text.to_ascii_lowercase().as_str() {
        "" | "nan" | "na" | "n/a" | "#n/a" | "-" | "--" | "---" => Cell::Nothing,
        _ => Cell::Text(text),
    }
}

/// Digits with at most one decimal sign, and an exponent.
pub fn number(text: &str, decimal: Decimal) -> Option<f64> {
    let sign = match decimal {
        Decimal::Point => '.',
        Decimal::Comma => ',',
    };
    let digits = text.strip_prefix(['+', '-', '\u{2212}']).unwrap_or(text);
    let mantissa = digits.split(['e', 'E', 'd', 'D']).next().unwrap_or_default();
    let exponent = &digits[mantissa.len()..];
    let (whole, broken) = mantissa.split_once(sign).unwrap_or((mantissa, ""));
    let all_digits = |part: &str| part.bytes().all(|byte| byte.is_ascii_digit());
    // A comma at the end separates; a point at the end is how some write whole numbers.
    let ends_badly = decimal == Decimal::Comma && mantissa.ends_with(',');
    if !all_digits(whole) || !all_digits(broken) || whole.len() + broken.len() == 0 || ends_badly {
        return None;
    }
    if !exponent.is_empty() && !all_digits(exponent[1..].trim_start_matches(['+', '-'])) {
        return None;
    }
    let plain: String = text
        .chars()
        .map(|c| match c {
            ',' => '.',
            'd' | 'D' => 'e',
            '\u{2212}' => '-',
            c => c,
        })
        .collect();
    plain.parse().ok()
}

/// The signs between digits in a text of digits only: how numbers are grouped there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Signs {
    /// Cells with one point.
    pub points: usize,
    /// Cells with one comma.
    pub commas: usize,
    /// Number of those that may be thousands: 1,234.
    pub thousands: usize,
    /// Cells with both: 1,234.5 or 1.234,5.
    pub both: usize,
}

impl Signs {
    /// Counts the signs of the cell `text`.
    pub fn count(&mut self, text: &str) {
        let text = text.trim();
        let digits = text.trim_start_matches(['+', '-']);
        if !digits.bytes().all(|byte| byte.is_ascii_digit() || b".,eE+-".contains(&byte)) {
            return;
        }
        let count = |sign: char| digits.matches(sign).count();
        match (count('.'), count(',')) {
            (1, 0) => self.points += 1,
            (0, 1) => {
                self.commas += 1;
                let (before, after) = digits.split_once(',').unwrap_or_default();
                let grouped = (1..=3).contains(&before.len()) && !before.starts_with('0') && after.len() == 3;
                self.thousands += usize::from(grouped);
            }
            (1.., 1..) => self.both += 1,
            _ => {}
        }
    }
}
