//! The name of a film in a program.

/// The C name of a film in the file `stem`.c: `film_` and the stem, with `_` for what a C name cannot hold. A stem that begins with `film`
/// stays as it is: `vhb-5s` gives `film_vhb_5s`, `film-2` gives `film_2`.
///
/// So it is no word of C or C++, and no name of a library.
#[must_use]
pub fn symbol(stem: &str) -> String {
    let name: String = stem.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    if name.starts_with("film") { name } else { format!("film_{name}") }
}
