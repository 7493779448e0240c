//! Pages that show commands and their answers.

use std::iter::zip;

/// A command of the page, and its answer.
pub struct Shown {
    /// As it is typed.
    pub command: String,
    /// Line by line.
    pub answer: Vec<String>,
}

/// The blocks of the page that begin with a `fence`.
pub fn blocks<'a>(page: &'a str, fence: &str) -> Vec<&'a str> {
    let rest = page.split(fence).skip(1);
    rest.filter_map(|rest| rest.split("```").next()).collect()
}

/// The commands of the page's blocks `console`, in their order.
///
/// # Panics
///
/// For a line that answers no command.
pub fn shown(page: &str) -> Vec<Shown> {
    let mut all: Vec<Shown> = Vec::new();
    for line in blocks(page, "```console\n").concat().lines() {
        match (line.strip_prefix("$ "), all.last_mut()) {
            (Some(command), _) => all.push(Shown { command: command.into(), answer: Vec::new() }),
            (None, Some(last)) => last.answer.push(line.into()),
            (None, None) => panic!("{line:?} answers no command"),
        }
    }
    all
}

/// The words of an answer, those with a digit as `#`: what differs from run to run.
pub fn words(line: &str) -> Vec<&str> {
    let is_number = |word: &&str| word.chars().any(|letter| letter.is_ascii_digit());
    line.split_whitespace().map(|word| if is_number(&word) { "#" } else { word }).collect()
}

/// Whether a line depends on what the machine has: QEMU and the firmware's image.
pub fn depends_on_qemu(line: &str) -> bool {
    line.starts_with("the firmware")
}

/// Whether two lines say the same: the same words, and numbers that differ by 3 % at the most and, written without an exponent, by 0.001:
/// the last digits of a fit depend on the processor's rounding. How long something took, and how many evaluations, may be any number.
pub fn same(line: &str, other: &str) -> bool {
    let (here, there): (Vec<&str>, Vec<&str>) = (line.split_whitespace().collect(), other.split_whitespace().collect());
    let is_free = |index: usize| {
        index > 0 && here[index - 1] == "in" || here.get(index + 1).is_some_and(|next| next.starts_with("evaluation"))
    };
    here.len() == there.len()
        && zip(&here, &there).enumerate().all(|(index, (here, there))| match (number(here), number(there)) {
            (Some(_), Some(_)) if is_free(index) => true,
            (Some((a, end)), Some((b, other_end))) => {
                let rounding = if there.contains('e') { 0.0 } else { 0.001 };
                end == other_end && (a - b).abs() <= 0.03 * b.abs() + rounding
            }
            _ => here == there,
        })
}

/// A number, and the punctuation and units behind it.
fn number(word: &str) -> Option<(f64, &str)> {
    let end = word.rfind(|c: char| c.is_ascii_digit())? + 1;
    Some((word[..end].parse().ok()?, &word[end..]))
}
