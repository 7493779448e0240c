//! `--columns`: which column is what, as a person says it.

use super::Quantity;
use super::units::{self, Unit};
use crate::choice::Choice as _;

/// Columns that were named, by quantity.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Choices(Vec<Choice>);

/// One of them: `voltage="HV mon":kV*2`.
#[derive(Clone, Debug, PartialEq)]
pub struct Choice {
    /// Quantity of the column.
    pub quantity: Quantity,
    /// Which column; `None` leaves the quantity out.
    pub column: Option<Column>,
    /// Its unit, if it was given.
    pub unit: Option<Unit>,
    /// Factor of its numbers beside the unit.
    pub factor: Option<f64>,
}

/// A column as it was named.
#[derive(Clone, Debug, PartialEq)]
pub enum Column {
    /// By its number, from one.
    Number(usize),
    /// By its name.
    Name(String),
}

impl Choices {
    /// The choice for `quantity`.
    pub fn get(&self, quantity: Quantity) -> Option<&Choice> {
        self.0.iter().find(|choice| choice.quantity == quantity)
    }

    /// Whether all columns, and the time among them, are chosen by their numbers.
    pub fn are_numbers(&self) -> bool {
        let is_number = |choice: &Choice| matches!(choice.column, None | Some(Column::Number(_)));
        self.get(Quantity::Time).is_some() && self.0.len() > 1 && self.0.iter().all(is_number)
    }

    /// Whether nothing was chosen.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl std::str::FromStr for Choices {
    type Err = String;

    /// `time=Zeit:s,voltage="HV mon"*2000,displacement=3:mm,force=none`.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut choices: Vec<Choice> = Vec::new();
        for item in parts(text, ',')? {
            let choice = choice(item.trim())?;
            if choices.iter().any(|other| other.quantity == choice.quantity) {
                return Err(format!("{} is given twice", choice.quantity));
            }
            choices.push(choice);
        }
        Ok(Self(choices))
    }
}

fn choice(item: &str) -> Result<Choice, String> {
    let example = "such as time=Zeit:s, voltage=\"HV mon\"*2000, displacement=3:mm or force=none";
    let (key, column) = item.split_once('=').ok_or_else(|| format!("{item:?}: use quantity=column, {example}"))?;
    let quantity = Quantity::from_name(key.trim()).ok_or_else(|| {
        let names: Vec<&str> = Quantity::CHOICES.iter().map(|(_, name, _)| *name).collect();
        format!("{:?} is not one of {}", key.trim(), names.join(", "))
    })?;
    let (column, factor) = last_part(column, '*')?;
    let number = |factor: &str| {
        let value = factor.trim().parse::<f64>().ok().filter(|value| value.is_finite() && *value != 0.0);
        value.ok_or_else(|| format!("{factor:?} is not a factor, {example}"))
    };
    let factor = factor.map(number).transpose()?;
    let (column, unit) = last_part(column, ':')?;
    let unit = unit.map(|unit| unit_of(quantity, unit.trim())).transpose()?;
    let column = column.trim();
    let column = match (column.strip_prefix('"').and_then(|c| c.strip_suffix('"')), column.parse::<usize>()) {
        (Some(name), _) => Some(Column::Name(name.into())),
        (None, _) if column == "none" => None,
        (None, Ok(0)) => return Err("columns count from 1".into()),
        (None, Ok(number)) => Some(Column::Number(number)),
        (None, Err(_)) if column.is_empty() => return Err(format!("{item:?} names no column, {example}")),
        (None, Err(_)) => Some(Column::Name(column.into())),
    };
    Ok(Choice { quantity, column, unit, factor })
}

fn unit_of(quantity: Quantity, text: &str) -> Result<Unit, String> {
    let unit = units::read(text, false).filter(|unit| unit.quantity == quantity.measure());
    unit.ok_or_else(|| format!("{text:?} is not a unit of {quantity}: {}", units::usual(quantity)))
}

/// `text` in parts at every `separator` outside of quotes.
fn parts(text: &str, separator: char) -> Result<Vec<&str>, String> {
    let (mut parts, mut start, mut quoted) = (Vec::new(), 0, false);
    for (at, c) in text.char_indices() {
        if c == '"' {
            quoted = !quoted;
        } else if c == separator && !quoted {
            parts.push(&text[start..at]);
            start = at + c.len_utf8();
        }
    }
    parts.push(&text[start..]);
    if quoted { Err(format!("a quote is not closed in {text:?}")) } else { Ok(parts) }
}

/// `text` before and after its last `separator` outside of quotes.
fn last_part(text: &str, separator: char) -> Result<(&str, Option<&str>), String> {
    let parts = parts(text, separator)?;
    Ok(match parts.as_slice() {
        [.., last] if parts.len() > 1 => (&text[..text.len() - last.len() - separator.len_utf8()], Some(last)),
        _ => (text, None),
    })
}
