//! Pages that show commands and their answers.

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
