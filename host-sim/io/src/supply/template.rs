//! Commands and replies: text around one number.

use serde::Deserialize;

/// Largest length of a number in a reply.
const MAX_DIGITS: usize = 16;

/// Text with at most one place for a number: `{}`, in a reply also `{=}` for the number that was sent, or `{*}` for any text.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "String")]
pub struct Template {
    before: String,
    hole: Hole,
    after: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Hole {
    Nothing,
    Number,
    Sent,
    AnyText,
}

impl TryFrom<String> for Template {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let holes = [("{}", Hole::Number), ("{=}", Hole::Sent), ("{*}", Hole::AnyText)];
        let found = holes.iter().find_map(|&(mark, hole)| Some((text.split_once(mark)?, hole)));
        let ((before, after), hole) = found.unwrap_or(((text.as_str(), ""), Hole::Nothing));
        if before.contains(['{', '}']) || after.contains(['{', '}']) {
            return Err(format!("{text:?}: one of {{}}, {{=}} and {{*}} at most, and no other braces"));
        }
        if !text.is_ascii() || text.contains(|c: char| c.is_ascii_control()) {
            return Err(format!("{text:?}: printable ASCII is needed; line ends have keys of their own"));
        }
        Ok(Self { before: before.into(), hole, after: after.into() })
    }
}

impl Template {
    /// Text without a number.
    pub fn literal(text: &str) -> Self {
        Self { before: text.into(), hole: Hole::Nothing, after: String::new() }
    }

    /// Whether it has a place for a number.
    pub fn has_number(&self) -> bool {
        self.hole == Hole::Number
    }

    /// Whether it has text beside its place.
    pub fn has_text(&self) -> bool {
        !(self.before.is_empty() && self.after.is_empty())
    }

    /// The command with `number` in its place.
    pub fn filled(&self, number: &str) -> String {
        let number = if self.hole == Hole::Number { number } else { "" };
        format!("{}{number}{}", self.before, self.after)
    }

    /// The number of a reply; NaN of one that has none, and nothing of a line that is not this reply, whole, to the command that `sent` this
    /// number.
    pub fn read(&self, line: &str, sent: f64) -> Option<f64> {
        let inner = line.strip_prefix(self.before.as_str())?.strip_suffix(self.after.as_str())?;
        match self.hole {
            Hole::Nothing => inner.is_empty().then_some(f64::NAN),
            Hole::AnyText => (!inner.is_empty()).then_some(f64::NAN),
            Hole::Number => number(inner),
            // As many digits as the command has.
            Hole::Sent => number(inner).filter(|value| (value - sent).abs() <= 1e-6 * sent.abs().max(1.0)),
        }
    }
}

/// A decimal number and nothing else: `f64::from_str` takes `inf` and `nan` as well.
pub(super) fn number(text: &str) -> Option<f64> {
    let is_decimal = text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'.' | b'-' | b'+' | b'e' | b'E'));
    (is_decimal && text.len() <= MAX_DIGITS)
        .then(|| text.parse().ok())
        .flatten()
        .filter(|value: &f64| value.is_finite())
}
