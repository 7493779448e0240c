//! The name of a film in a program.

use sha2::{Digest, Sha256};

/// The C name of a film in the file `stem`.c: `film_` and the stem; a stem that begins with `film` stays as it is: `vhb_5s` gives
/// `film_vhb_5s`, `film_2` gives `film_2`.
///
/// What else a stem has that a C name does not is `_` or left out, and eight digits of the whole stem are added: `film-2` gives
/// `film_2_c850ad00`. So two films have different names unless their stems differ in a leading `film_` alone. No name is a
/// word of C, C++ or MATLAB, or has `__`, which C++ keeps for itself.
#[must_use]
pub fn symbol(stem: &str) -> String {
    let words: Vec<&str> = stem.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty()).collect();
    let mut name = words.join("_");
    if name.is_empty() || name != stem {
        let digest = Sha256::digest(stem);
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| digest[k]);
        name = format!("{name}_{a:02x}{b:02x}{c:02x}{d:02x}");
    }
    let name = name.trim_start_matches('_');
    if name.starts_with("film") { name.to_owned() } else { format!("film_{name}") }
}
