//! Choices of the library as values of options.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use crate::choice::Choice;

/// The parser of a choice by its names, with the help of each.
pub(super) fn named<T: Choice>() -> impl TypedValueParser<Value = T> {
    let help = |text: &'static str| text.trim().trim_end_matches('.');
    let values = T::CHOICES.iter().map(|(_, name, text)| PossibleValue::new(*name).help(help(text)));
    PossibleValuesParser::new(values.collect::<Vec<_>>()).try_map(|name| T::from_name(&name).ok_or("unknown name"))
}
