//! An FMU for co-simulation, of FMI 2.0 or 3.0: the film and its laws of control behind an interface in C.
//!
//! | file | what it holds |
//! | --- | --- |
//! | `fmu/springpot_fmu.h` | variables, steps and states, written by hand, for both versions; a tick is that of MATLAB and Simulink |
//! | `fmu/fmi2.c`, `fmu/fmi3.c` | the functions of a version in front of that |
//! | `fmu/springpot_fmi.h` | what both versions share of these |
//! | `variables` | what an importer sees |
//! | `description` | modelDescription.xml and buildDescription.xml |

mod description;
mod variables;

use std::fmt::Write;

use sha2::{Digest, Sha256};

use self::variables::{VARIABLES, Variable};
use crate::film::{plain, rounded};
use crate::{Film, HEADER, TICK, film};

/// A version of the standard. One file has one: its `modelDescription.xml` is of either.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// FMI 2.0.
    Fmi2,
    /// FMI 3.0.
    Fmi3,
}

impl Version {
    /// Sources that are the same for every film; the one that is compiled first.
    fn sources(self) -> [(&'static str, &'static str); 5] {
        let interface = match self {
            Self::Fmi2 => ("fmi2.c", include_str!("../../fmu/fmi2.c")),
            Self::Fmi3 => ("fmi3.c", include_str!("../../fmu/fmi3.c")),
        };
        let functions = include_str!("../../fmu/springpot_fmi.h");
        let common = include_str!("../../fmu/springpot_fmu.h");
        [
            interface,
            ("springpot_fmi.h", functions),
            ("springpot_fmu.h", common),
            ("springpot_tick.h", TICK),
            ("springpot.h", HEADER),
        ]
    }
}

/// The text files of an FMU, and those of them to compile.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fmu {
    /// Paths within the archive, and contents: the same for the same film, `modelDescription.xml` first.
    pub files: Vec<(String, String)>,
    /// Names within `sources/` of the files to compile.
    pub compiled: Vec<String>,
}

/// Values of a film's description.
struct Described<'a> {
    symbol: &'a str,
    name: String,
    version: Version,
    /// The library recognises its description by it.
    token: String,
    step_s: f64,
    learns: bool,
    compiled: &'a [String],
}

/// The FMU of a film; its symbol is the model's identifier.
#[must_use]
pub fn fmu(of: &Film, version: Version) -> Fmu {
    let text = film(of);
    let own = format!("{}.c", of.symbol);
    let sources = version.sources();
    let compiled = vec![sources[0].0.to_owned(), own.clone()];
    let mut described = Described {
        symbol: of.symbol,
        name: plain(of.name),
        version,
        token: String::new(),
        // As it was asked for: the law has it in single precision.
        step_s: 1.0 / rounded(1.0 / of.tracking.observer().law().step_s()),
        learns: of.learning.is_some(),
        compiled: &compiled,
    };
    // Of everything that a library and its description are made of.
    let fixed = sources.iter().map(|(_, text)| *text);
    let parts = [description::model(&described), text.clone()];
    described.token = token(fixed.chain(parts.iter().map(String::as_str)));

    let mut files = vec![("modelDescription.xml".to_owned(), description::model(&described))];
    if version == Version::Fmi3 {
        files.push(("sources/buildDescription.xml".into(), description::build(&described)));
    }
    files.extend(sources.iter().map(|(name, text)| (format!("sources/{name}"), (*text).to_owned())));
    files.push(("sources/springpot_fmu_film.h".into(), film_header(&described)));
    files.push((format!("sources/{own}"), text));
    Fmu { files, compiled }
}

/// The film's constants and the variables for springpot_fmu.h.
fn film_header(of: &Described) -> String {
    let Described { symbol, token, step_s, learns, .. } = of;
    let learns = u8::from(*learns);
    let (mut names, mut types) = (String::new(), String::new());
    // Writing to a string cannot fail.
    for (reference, Variable { name, kind, .. }) in (1..).zip(&VARIABLES) {
        let _ = writeln!(names, "    FMU_{} = {reference},", name.to_uppercase());
        let _ = write!(types, ", {}", kind.name());
    }
    format!(
        "/* The film of this FMU. Free for any use: SPDX-License-Identifier: 0BSD */\n\
         #define FMU_FILM {symbol}\n#define FMU_TOKEN \"{token}\"\n#define FMU_STEP_S {step_s:e}\n#define FMU_LEARNS {learns}\n\n\
         /* Variables by their value references, as modelDescription.xml has them, and their types. */\n\
         enum {{\n    FMU_TIME = 0,\n{names}    FMU_VARIABLES = {}\n}};\n\n\
         static const unsigned char fmu_types[FMU_VARIABLES] = {{\n    FMU_REAL{types}}};\n",
        VARIABLES.len() + 1
    )
}

/// A token in the form of a GUID, which depends on all of `parts`.
fn token<'a>(parts: impl Iterator<Item = &'a str>) -> String {
    let mut digest = Sha256::new();
    for part in parts {
        digest.update(part);
        digest.update([0]);
    }
    let mut text = "{".to_owned();
    for (index, byte) in digest.finalize().iter().take(16).enumerate() {
        let dash = if matches!(index, 4 | 6 | 8 | 10) { "-" } else { "" };
        let _ = write!(text, "{dash}{byte:02x}");
    }
    text + "}"
}
