//! A film for MATLAB, Octave and Simulink: a MEX gateway and an S-function, with the tick that both step.

use crate::{Film, HEADER, TICK, filled, film};

/// Files by their names, for a film that is exported as `name`.c: the film, the headers, `name`_mex.c and `name`_sfun.c.
///
/// `name` must be a name in MATLAB: see [`is_name`].
#[must_use]
pub fn sources(described: &Film, name: &str) -> Vec<(String, String)> {
    let symbol = described.symbol;
    vec![
        (format!("{name}.c"), film(described)),
        ("springpot.h".into(), HEADER.into()),
        ("springpot_tick.h".into(), TICK.into()),
        (format!("{name}_mex.c"), filled(MEX, symbol, name)),
        (format!("{name}_sfun.c"), filled(SFUN, symbol, name)),
    ]
}

/// Whether MATLAB can call functions `name`_mex and `name`_sfun: a letter, then letters, digits and `_`, at most 58.
#[must_use]
pub fn is_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic())
        && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
        && name.len() <= 58
}

const MEX: &str = include_str!("../matlab/mex.c");
const SFUN: &str = include_str!("../matlab/sfun.c");
