//! A library for Arduino and PlatformIO: header and film, what describes them, and an example that tracks a reference.

use crate::{Film, HEADER, film};

/// Files of a library, by their paths within its folder.
#[must_use]
pub fn library(described: &Film) -> Vec<(String, String)> {
    let symbol = described.symbol;
    vec![
        ("library.properties".into(), filled(PROPERTIES, symbol)),
        ("library.json".into(), filled(JSON, symbol)),
        ("src/springpot.h".into(), HEADER.into()),
        (format!("src/{symbol}.c"), film(described)),
        ("examples/Tracking/Tracking.ino".into(), filled(SKETCH, symbol)),
    ]
}

/// A template with the film's symbol and the version of this tool.
fn filled(template: &str, symbol: &str) -> String {
    template.replace("@SYMBOL@", symbol).replace("@VERSION@", env!("CARGO_PKG_VERSION"))
}

const PROPERTIES: &str = include_str!("../arduino/library.properties");
const JSON: &str = include_str!("../arduino/library.json");
const SKETCH: &str = include_str!("../arduino/Tracking.ino");
