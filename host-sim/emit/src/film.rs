//! The numbers of a film as a C source.

use std::fmt::Write;

use springpot::{Learning, Tracking};

use crate::FORMAT;
use crate::table::Table;

/// What a C source is made of.
#[derive(Clone, Copy, Debug)]
pub struct Film<'a> {
    /// Its name in C: see [`symbol`](crate::symbol()).
    pub symbol: &'a str,
    /// What it is, for a comment.
    pub name: &'a str,
    /// Law, drive, limits and observer.
    pub tracking: &'a Tracking<f32>,
    /// What learns periodic references, if anything does.
    pub learning: Option<&'a Learning<f32>>,
}

/// `NAME.c`: the tables of a film. Two films can stand in one program, since nothing but their symbols is visible.
#[must_use]
pub fn film(film: &Film) -> String {
    let Film { symbol, name, tracking, learning } = *film;
    let mut table = Table::default();
    tracking.numbers(&mut table);
    if let Some(learning) = learning {
        learning.numbers(&mut table);
    }
    let step_s = tracking.observer().law().step_s();
    let name = plain(name);
    let mut text = format!(
        "/*\n * The film {name} at {} Hz, for springpot.h, by host-sim {}.\n * Free for any use: SPDX-License-Identifier: 0BSD\n *\n\
         \x20* SPRINGPOT_FILM({symbol}); declares it where it is used.\n */\n\
         #include \"springpot.h\"\n\n#if SPRINGPOT_FORMAT != {FORMAT}U\n\
         #error \"springpot.h is of another version than this film: export both again\"\n#endif\n\n",
        rounded(1.0 / step_s),
        env!("CARGO_PKG_VERSION"),
    );
    let curve = table.has("curve.instant").then(|| curve(&mut text, &mut table, symbol));
    let amplifier = table.has("amplifier.up").then(|| amplifier(&mut text, &mut table, symbol));
    let learning = learning.map(|_| learn(&mut text, &mut table, symbol));
    let pointer = |part: Option<&str>| part.map_or("NULL".to_owned(), |part| format!("&{symbol}_{part}"));

    let _ = writeln!(text, "SPRINGPOT_FILM({symbol});\n\nconst springpot_film {symbol} = {{");
    #[allow(clippy::cast_possible_truncation)] // for its reader
    let _ = writeln!(text, "    {:.8e}F, /* step_s */", step_s as f32);
    object(&mut text, &mut table, "drive", &DRIVE);
    object(&mut text, &mut table, "inverse", &INVERSE);
    object(&mut text, &mut table, "observer", &OBSERVER);
    object(&mut text, &mut table, "fade", &FADE);
    let _ = writeln!(text, "    {}, /* curve */", pointer(curve));
    let _ = writeln!(text, "    {}, /* amplifier */", pointer(amplifier));
    let _ = writeln!(text, "    {}, /* learning */", pointer(learning));
    text.push_str("    { /* law */\n");
    table.fields(&mut text, "        ", "law", &["stiffness", "head"]);
    table.rows(&mut text, "        ", "law.fast", &["loss", "weight"]);
    table.rows(&mut text, "        ", "law.slow", &["loss", "weight"]);
    text.push_str("    },\n};\n");
    table.end();
    text
}

// Fields in the order of c/2-film.h.
const DRIVE: [&str; 5] = ["force_per_square_volt", "coupling", "saturation", "preload", "max_voltage"];
const INVERSE: [&str; 12] = [
    "max_increment",
    "max_change",
    "damping",
    "approach",
    "max_return",
    "max_voltage",
    "field_voltage",
    "thinning",
    "slew",
    "averaging",
    "gain_share",
    "gains",
];
const OBSERVER: [&str; 15] = [
    "gains",
    "lost_after",
    "smoothing",
    "recovery",
    "averaging",
    "forgetting",
    "forgetting_slope",
    "adapting",
    "regularisation",
    "max_disturbance",
    "max_slope",
    "max_innovation",
    "statistics",
    "full_share",
    "scales",
];
const FADE: [&str; 7] = ["forgets", "averages", "follows", "floor", "highest", "falls", "least"];
const AMPLIFIER: [&str; 6] = ["up", "down", "left", "reading_share", "gain_s", "paces"];
const LEARNING: [&str; 27] = [
    "least_swing",
    "swing_forgetting",
    "hysteresis",
    "missed",
    "agreement",
    "period",
    "harmonics",
    "largest_angle",
    "rate",
    "approach",
    "first_share",
    "largest_share",
    "gains",
    "seen",
    "silent_blocks",
    "series_angle",
    "cosine",
    "sine",
    "settling_s",
    "least_s",
    "longest_s",
    "least_samples",
    "smoothing",
    "fading",
    "same_period",
    "faded",
    "turn",
];

/// A structure within the film.
fn object(text: &mut String, table: &mut Table, name: &str, fields: &[&str]) {
    let _ = writeln!(text, "    {{ /* {name} */");
    table.fields(text, "        ", name, fields);
    text.push_str("    },\n");
}

/// A structure beside the film, which points to it. Returns its name.
fn part(text: &mut String, symbol: &str, name: &'static str, fill: impl FnOnce(&mut String)) -> &'static str {
    let _ = writeln!(text, "static const springpot_{name} {symbol}_{name} = {{");
    fill(text);
    text.push_str("};\n\n");
    name
}

fn curve(text: &mut String, table: &mut Table, symbol: &str) -> &'static str {
    part(text, symbol, "curve", |text| {
        table.fields(text, "    ", "curve", &["instant", "inertia", "past_inertia", "low", "high"]);
        table.rows(text, "    ", "curve.piece", &["at", "value", "slope", "second", "third"]);
    })
}

fn amplifier(text: &mut String, table: &mut Table, symbol: &str) -> &'static str {
    part(text, symbol, "amplifier", |text| table.fields(text, "    ", "amplifier", &AMPLIFIER))
}

fn learn(text: &mut String, table: &mut Table, symbol: &str) -> &'static str {
    part(text, symbol, "learning", |text| table.fields(text, "    ", "learning", &LEARNING))
}

/// `name` without what would end a comment or an attribute, or begin one within it.
pub(crate) fn plain(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric() || " -_.,+()".contains(*c)).collect()
}

/// A rate without the noise of its last digits.
pub(crate) fn rounded(rate_hz: f64) -> f64 {
    (rate_hz * 1e6).round() / 1e6
}
