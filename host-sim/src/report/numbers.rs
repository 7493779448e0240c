//! Numbers of a page: each is taken from the document that `--json` prints, and says where from.

use maud::{Markup, html};
use serde::Serialize;
use serde_json::Value;

use crate::error::{Error, Result};

/// Output of `--json`, to the letter.
#[derive(Clone, Debug)]
pub struct Document {
    text: String,
    value: Value,
}

impl Document {
    /// The document of `report`.
    pub fn from_report(report: &impl Serialize) -> Result<Self> {
        let fault = |e: serde_json::Error| Error::Computation(format!("JSON: {e}"));
        let text = serde_json::to_string(report).map_err(fault)?;
        // Through the text, so that numbers of single precision are those that it shows.
        let value = serde_json::from_str(&text).map_err(fault)?;
        Ok(Self { text, value })
    }

    pub fn text(&self) -> &str {
        &self.text
    }
}

/// A place in the document.
#[derive(Clone, Debug)]
pub struct Numbers<'a> {
    document: &'a Value,
    place: String,
}

/// How a number reads.
#[derive(Clone, Copy, Debug)]
pub enum Form {
    /// With so many decimals.
    Fixed(usize),
    /// With so many digits, and a power of ten where it is far from 1.
    Digits(usize),
    /// Times a factor, with so many decimals and a unit.
    In(f64, usize, &'static str),
}

impl<'a> Numbers<'a> {
    /// The whole document.
    pub fn from_document(document: &'a Document) -> Self {
        Self { document: &document.value, place: String::new() }
    }

    /// The place at `path` (a JSON pointer) beneath this one.
    #[must_use]
    pub fn at(&self, path: &str) -> Self {
        Self { document: self.document, place: format!("{}{path}", self.place) }
    }

    /// The value there; null if it is missing.
    pub fn value(&self) -> &'a Value {
        self.document.pointer(&self.place).unwrap_or(&Value::Null)
    }

    /// The elements of the list there.
    pub fn rows(&self) -> Vec<Self> {
        (0..self.value().as_array().map_or(0, Vec::len)).map(|index| self.at(&format!("/{index}"))).collect()
    }

    /// The text at `path`.
    pub fn text(&self, path: &str) -> &'a str {
        self.at(path).value().as_str().unwrap_or_default()
    }

    /// The number at `path`, with its place for those who check it; a dash if it is missing.
    pub fn number(&self, path: &str, form: Form) -> Markup {
        self.number_or(path, form, "–")
    }

    /// The same, with a word in place of a number that is missing.
    pub fn number_or(&self, path: &str, form: Form, missing: &str) -> Markup {
        let there = self.at(path);
        let Some(value) = there.value().as_f64() else { return html! { (missing) } };
        let (factor, text) = match form {
            Form::Fixed(decimals) => (1.0, format!("{value:.decimals$}")),
            Form::Digits(digits) => (1.0, with_digits(value, digits)),
            Form::In(factor, decimals, unit) => (factor, format!("{:.decimals$} {unit}", factor * value)),
        };
        html! { data value=(value) data-at=(there.place) data-factor=(factor) { (text) } }
    }
}

/// `value` with so many digits.
fn with_digits(value: f64, digits: usize) -> String {
    let before_point = value.abs().log10().floor() as i32 + 1;
    match before_point {
        _ if value == 0.0 => "0".into(),
        -2..=6 => {
            let decimals = usize::try_from(digits as i32 - before_point).unwrap_or(0);
            format!("{value:.decimals$}")
        }
        _ => format!("{value:.*e}", digits - 1),
    }
}
