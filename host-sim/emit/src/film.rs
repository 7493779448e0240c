//! The numbers of a film as a C source.

use springpot::{Learning, SelfSensing, TemperatureDependence, Tracking};

use crate::FORMAT;
use crate::table::Table;

/// The contents of a C source.
#[derive(Clone, Copy, Debug)]
pub struct Film<'a> {
    /// Its name in C: see [`symbol`](crate::symbol()).
    pub symbol: &'a str,
    /// Its description, for a comment.
    pub name: &'a str,
    /// Law, drive, limits and observer.
    pub tracking: &'a Tracking<f32>,
    /// Learning of periodic references, if it is configured.
    pub learning: Option<&'a Learning<f32>>,
    /// The film as its own sensor, if it is configured: `self_sensing_` and the film's symbol in C.
    pub self_sensing: Option<&'a SelfSensing<f32>>,
    /// How it changes with its temperature, if it was fitted at several.
    pub temperature: Option<&'a TemperatureDependence>,
}

/// `NAME.c`: the tables of a film. One program can have several films: nothing but their symbols is visible.
#[must_use]
pub fn film(film: &Film) -> String {
    let Film { symbol, name, tracking, .. } = *film;
    let step_s = tracking.observer().law().step_s();
    let name = plain(name);
    let mut text = format!(
        "/*\n * The film {name} at {} Hz, for springpot.h, by springpot {}.\n * Free for any use: SPDX-License-Identifier: 0BSD\n *\n\
         \x20* SPRINGPOT_FILM({symbol}); declares it where it is used.\n */\n\
         #include \"springpot.h\"\n\n#if SPRINGPOT_FORMAT != {FORMAT}U\n\
         #error \"springpot.h is of another version than this film: export both again\"\n#endif\n\n",
        rounded(1.0 / step_s),
        env!("CARGO_PKG_VERSION"),
    );
    text.push_str(&table(film).definitions(symbol, step_s));
    text
}

/// Declarations of the structures of two films, which together have all of them: `c/2-film.h`.
#[must_use]
pub fn declarations(film: &Film, other: &Film) -> String {
    let mut all = table(film);
    all.add(table(other));
    all.declarations()
}

fn table(film: &Film) -> Table {
    Table::new(film.tracking, film.learning, film.self_sensing, film.temperature)
}

/// `name` without what would end a comment or an attribute, or begin one within it.
pub(crate) fn plain(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric() || " -_.,+()".contains(*c)).collect()
}

/// A rate without the noise of its last digits.
pub(crate) fn rounded(rate_hz: f64) -> f64 {
    (rate_hz * 1e6).round() / 1e6
}
