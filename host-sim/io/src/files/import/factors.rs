//! Factors in titles of columns, which their numbers may have or not.

use super::units;
use super::words::{FACTORS, is_of, letter_quantity, without_brackets, words};

/// Whether `word` is a factor such as x2.
pub(super) fn is_factor(word: &str) -> bool {
    let number = word.strip_prefix('x').or_else(|| word.strip_suffix('x'));
    number.is_some_and(|number| number.parse::<u32>().is_ok_and(|number| number > 1))
}

/// Whether `name` has a factor or a power in it: x10, (x2), 2 x, x 10, ×1000, 2*, /100, ^2, 1000:1, 1 V = 5 mm, % of 5 mm, tenths of mm or 10fach.
pub(super) fn is_scaled(name: &str) -> bool {
    let begins_in_number = |word: &str| word.starts_with(|c: char| c.is_ascii_digit());
    let words = words(name);
    let is_multiple = |word: &String| {
        is_of(FACTORS, word) || (begins_in_number(word) && (word.ends_with("fach") || word.ends_with("fold")))
    };
    let is_times = |pair: &[String]| matches!(pair[0].as_str(), "times" | "mal" | "fois") && begins_in_number(&pair[1]);
    if name.contains(['=', '%', '÷', '≙']) || words.iter().any(is_multiple) || words.windows(2).any(is_times) {
        return true;
    }
    let number = |text: &str| text.parse::<f64>().ok().filter(|_| text.len() > 1 && text != "1.0");
    let is_other = |text: &str| text.parse::<f64>().is_ok_and(|number| number != 1.0);
    let parts: Vec<&str> =
        name.split(|c: char| c.is_whitespace() || "()[]{},;_".contains(c)).filter(|p| !p.is_empty()).collect();
    let is_apart = |pair: &[&str]| matches!(pair[0], "x" | "X" | "×" | "·" | "*" | "/") && is_other(pair[1]);
    let is_first = matches!(parts.as_slice(), [first, "x" | "X" | "×", _, ..] if is_other(first));
    let is_in_brackets = || without_brackets(name).1.iter().any(|text| is_factor(&text.trim().to_lowercase()));
    name.contains('^')
        || is_first
        || is_in_brackets()
        || parts.windows(2).any(is_apart)
        || parts.iter().any(|part| {
            let factor = part.strip_prefix(['x', 'X', '×']).or_else(|| part.strip_suffix(['x', 'X', '×']));
            let ratio =
                part.split_once(':').is_some_and(|(a, b)| a != b && [a, b].iter().all(|p| p.parse::<f64>().is_ok()));
            let is_product = part.contains(['*', '×', '·']);
            let product = part.split(['*', '×', '·']).any(|side| is_product && is_other(side));
            // In `CH 2/mm` the number is the channel's.
            let is_divided = part.contains('/')
                && (part.split('/').any(|side| number(side).is_some()) || part.split('/').skip(1).any(is_other))
                || is_ratio(part);
            // A second laser is x2.
            let is_large =
                |factor: &str| number(factor).is_some() || factor.parse::<u32>().is_ok_and(|factor| factor > 2);
            // Alone, x10 is the tenth of them.
            let is_factor = parts.len() > 1 && factor.is_some_and(is_large);
            ratio || product || is_divided || is_factor
        })
}

/// Whether `part` is what one unit of a signal is worth: 2.5mm/V, mm/V or 1V/kV, but not s/mm and V/kV, a symbol in front of its unit.
fn is_ratio(part: &str) -> bool {
    let Some((value, unit)) = part.split_once('/') else { return false };
    let bare = value.trim_start_matches(|c: char| c.is_ascii_digit() || c == '.');
    let is_symbol = value == bare && (bare.chars().count() == 1 || letter_quantity(bare).is_some());
    !is_symbol && [bare, unit].iter().all(|text| units::read(text, false).is_some())
}
