//! A library for Arduino and PlatformIO: header and film, what describes them, and an example that tracks a reference.

use crate::{Film, HEADER, filled, film};

/// Files of a library, by their paths within its folder.
#[must_use]
pub fn library(described: &Film) -> Vec<(String, String)> {
    let symbol = described.symbol;
    vec![
        ("library.properties".into(), filled(PROPERTIES, symbol, symbol)),
        ("library.json".into(), filled(JSON, symbol, symbol)),
        ("src/springpot.h".into(), HEADER.into()),
        (format!("src/{symbol}.c"), film(described)),
        ("examples/Tracking/Tracking.ino".into(), filled(SKETCH, symbol, symbol)),
    ]
}

const PROPERTIES: &str = include_str!("../arduino/library.properties");
const JSON: &str = include_str!("../arduino/library.json");
const SKETCH: &str = include_str!("../arduino/Tracking.ino");
