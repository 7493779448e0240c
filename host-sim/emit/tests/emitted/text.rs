//! The text of a film: every number to its last bit, and names that a program can have.

use std::collections::BTreeMap;

use host_emit::{Film, HEADER, declarations, film, symbol};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use springpot::Numbers;

use crate::films::{in_series, plain, rich, richest};

/// The bits of all numbers, sorted.
#[derive(Default)]
struct Listed(Vec<u32>);

impl Numbers<f32> for Listed {
    fn number(&mut self, _: &'static str, value: f32, _: &'static str) {
        self.0.push(value.to_bits());
    }

    fn count(&mut self, _: &'static str, value: u32, _: &'static str) {
        self.0.push(value);
    }
}

/// The text has each number of the laws, with its bits when read back, and no other.
#[test]
fn every_number_is_written_to_its_last_bit() {
    for case in [plain(), rich(), richest(), in_series()] {
        let mut listed = Listed::default();
        case.tracking.numbers(&mut listed);
        case.tracking.numbers_of_changes(&mut listed);
        if let Some(learning) = &case.learning {
            learning.numbers(&mut listed);
        }
        if let Some(sensed) = &case.sensed {
            sensed.sensing.numbers(&mut listed);
        }
        if let Some(temperature) = &case.temperature {
            temperature.numbers(&mut listed);
        }
        let text = film(&case.film("film_x"));
        let (_, tables) = text.split_once("#endif").expect("a guard");
        let words = tables.split(|c: char| !(c.is_ascii_alphanumeric() || ".-+".contains(c)));
        let mut written: Vec<u32> = words
            .filter_map(|word| match (word.strip_suffix('F'), word.strip_suffix('U'), word) {
                (Some(number), ..) => number.parse::<f32>().ok().map(f32::to_bits),
                (_, Some(count), _) => count.parse().ok(),
                (.., "INFINITY") => Some(f32::INFINITY.to_bits()),
                _ => None,
            })
            .collect();
        listed.0.push(1e-3_f32.to_bits()); // the step
        written.sort_unstable();
        listed.0.sort_unstable();
        assert!(written.len() > 120 && written == listed.0, "{}", case.name);
    }
}

/// Self-sensing comes after the film, which is the same without it.
#[test]
fn a_film_without_self_sensing_has_nothing_of_it() {
    let case = richest();
    let with = case.film("film_x");
    let without = film(&Film { self_sensing: None, ..with });
    let rest = film(&with);
    let rest = rest.strip_prefix(&without).expect("the film is the same");
    assert!(!without.contains("sensing") && rest.contains("const springpot_self_sensing self_sensing_film_x = {"));
}

/// The header declares what Rust visits. `SPRINGPOT_WRITE=1` writes it.
#[test]
fn the_structures_of_the_header_are_those_of_rust() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/c/2-film.h");
    let declared = declarations(&richest().film("film_x"), &in_series().film("film_x"));
    if std::env::var_os("SPRINGPOT_WRITE").is_some() {
        std::fs::write(path, &declared).expect("written");
        return;
    }
    assert!(HEADER.contains(&declared), "run this test with SPRINGPOT_WRITE=1 to write {path}");
}

#[test]
fn names_of_films_are_names_in_c() {
    for (stem, expected) in [
        ("film", "film"),
        ("film_5s", "film_5s"),
        ("vhb_4910", "film_vhb_4910"),
        ("int", "film_int"),
        ("2", "film_2"),
        ("main", "film_main"),
    ] {
        assert_eq!(symbol(stem), expected);
    }
    for (one, other) in [("Größe", "Grüße"), ("a-b", "a_b"), ("film-2", "film_2"), ("5-s", "5_s")] {
        assert_ne!(symbol(one), symbol(other));
    }
}

/// 20 000 names that differ in any letter, of any script, have symbols that differ and are names in C, C++ and MATLAB, and of an FMU.
#[test]
fn films_of_any_name_have_names_of_their_own() {
    let mut random = Pcg64::seed_from_u64(28);
    let mut stems: BTreeMap<String, String> = BTreeMap::new();
    let letters: Vec<char> = "ab7_- .äöß膜薄ж🎞\u{301}".chars().collect();
    for k in 0..20_000 {
        let length = random.random_range(0..9);
        let any = |random: &mut Pcg64| match k % 2 {
            0 => letters[random.random_range(0..letters.len())],
            _ => char::from_u32(random.random_range(0..0x11_0000)).unwrap_or('-'),
        };
        let stem: String = (0..length).map(|_| any(&mut random)).collect();
        let symbol = symbol(&stem);
        let is_word = |word: &str| !word.is_empty() && word.chars().all(|c| c.is_ascii_alphanumeric());
        assert!(symbol.starts_with("film") && symbol.split('_').all(is_word), "{stem:?}: {symbol}");
        // These two are one: the linker reports films of one name.
        let stem = if stem.starts_with("film") { stem } else { format!("film_{stem}") };
        if let Some(other) = stems.insert(symbol, stem.clone()) {
            assert_eq!(other, stem);
        }
    }
    assert!(stems.len() > 15_000);
}
