//! The words of the project: pages, sources, messages and names against the lists in `words/`.

use std::borrow::Cow;
use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

use crate::root;

/// Folders and files whose words are not the project's.
const NOT_OURS: [&str; 3] = ["host-sim/emit/fmu/standard", "host-sim/src/report/assets", "tests/fuzz/corpus"];

/// Ends of the names of pages and sources.
const KINDS: [&str; 9] = [".md", ".rs", ".c", ".h", ".ino", ".py", ".pyi", ".toml", ".m"];

/// A word that should be another one.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Path relative to the root, with `/` between folders.
    pub path: String,
    /// Number of the line, from 1.
    pub line: usize,
    /// The line.
    pub text: String,
    /// The word, and what to write.
    pub cause: String,
}

impl std::fmt::Display for Finding {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}: {}\n    {}", self.path, self.line, self.cause, self.text.trim())
    }
}

/// The lists.
#[derive(Clone, Debug)]
pub struct Words {
    /// By their first word: the further ones, and what to write instead.
    phrases: HashMap<String, Vec<(Vec<String>, String)>>,
    names: Vec<(String, String)>,
}

impl Default for Words {
    fn default() -> Self {
        let mut phrases: HashMap<String, Vec<_>> = HashMap::new();
        for (phrase, instead) in entries(include_str!("../words/list.txt")) {
            let mut words = phrase.split_whitespace().map(str::to_owned);
            let first = words.next().unwrap_or_default();
            phrases.entry(first).or_default().push((words.collect(), instead.to_owned()));
        }
        let names = entries(include_str!("../words/names.txt"));
        Self { phrases, names: names.map(|(name, instead)| (name.to_owned(), instead.to_owned())).collect() }
    }
}

/// Phrases or names of a list, and what to write instead.
fn entries(list: &str) -> impl Iterator<Item = (&str, &str)> {
    lines(list).filter_map(|line| line.split_once(" -> ")).flat_map(|(phrases, instead)| {
        let phrases = phrases.split(',').map(str::trim);
        phrases.map(move |phrase| (phrase, instead))
    })
}

/// The lines of a list that are not comments.
fn lines(list: &str) -> impl Iterator<Item = &str> {
    list.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'))
}

/// Whether `path` is `folder` or in it.
#[must_use]
pub fn within(path: &str, folder: &str) -> bool {
    path.strip_prefix(folder.trim_end_matches('/')).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
}

/// Places that keep a word: path, part of the line, reason.
///
/// # Panics
/// A line of the list lacks one of the three.
#[must_use]
pub fn exceptions() -> Vec<[&'static str; 3]> {
    let three = |line: &'static str| -> [&'static str; 3] {
        let parts: Vec<_> = line.split(" | ").map(str::trim).collect();
        parts.try_into().unwrap_or_else(|parts| panic!("path | text | reason: {parts:?}"))
    };
    lines(include_str!("../words/exceptions.txt")).map(three).collect()
}

/// Paths of all files of the project that are checked, relative to its root.
///
/// # Errors
/// A folder cannot be read.
pub fn checked_files() -> Result<Vec<PathBuf>, String> {
    let (mut files, mut folders) = (Vec::new(), vec![root().to_owned()]);
    while let Some(folder) = folders.pop() {
        let entries = fs::read_dir(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
        for path in entries.filter_map(|entry| Some(entry.ok()?.path())) {
            let relative = path.strip_prefix(root()).unwrap_or(&path);
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            let hidden = name.starts_with('.') && name != ".cargo" || name == "target" || name == "demo";
            if hidden || NOT_OURS.iter().any(|folder| relative == Path::new(folder)) {
                continue;
            }
            if path.is_dir() {
                folders.push(path);
            } else if KINDS.iter().any(|kind| name.ends_with(kind)) {
                files.push(relative.to_owned());
            }
        }
    }
    files.sort();
    Ok(files)
}

/// Findings in all checked files, exceptions left out, and the exceptions that nothing needed.
///
/// # Errors
/// A file cannot be read.
pub fn findings() -> Result<(Vec<Finding>, Vec<[&'static str; 3]>), String> {
    let (words, exceptions) = (Words::default(), exceptions());
    let mut used = vec![false; exceptions.len()];
    let mut findings = Vec::new();
    for path in checked_files()? {
        let text = fs::read_to_string(root().join(&path)).map_err(|error| format!("{}: {error}", path.display()))?;
        let name = path.to_string_lossy().replace('\\', "/");
        for finding in words.findings(&name, &text) {
            let excepted = |[path, text, _]: &[&str; 3]| {
                within(&finding.path, path) && (*text == "*" || finding.text.contains(text))
            };
            match exceptions.iter().position(excepted) {
                Some(exception) => used[exception] = true,
                None => findings.push(finding),
            }
        }
    }
    let unused = exceptions.into_iter().zip(used).filter(|(_, used)| !used).map(|(exception, _)| exception).collect();
    Ok((findings, unused))
}

impl Words {
    /// Words of `text`, the contents of the file `path`, that should be others.
    #[must_use]
    pub fn findings(&self, path: &str, text: &str) -> Vec<Finding> {
        let mut found = self.phrases_in(text);
        found.extend(self.names_in(text));
        if !path.ends_with(".md") {
            found.extend(openings(text));
        }
        if path.ends_with(".rs") {
            let constructors = text.match_indices(concat!("fn", " of("));
            found.extend(constructors.map(|(at, _)| (at, "a constructor `of`: new, from_... or with_...".to_owned())));
        }
        found.sort();
        let finding = |(at, cause): (usize, String)| {
            let begin = text[..at].rfind('\n').map_or(0, |end| end + 1);
            let line = text[..at].matches('\n').count() + 1;
            let text = text[begin..].lines().next().unwrap_or_default().to_owned();
            Finding { path: path.to_owned(), line, text, cause }
        };
        found.into_iter().map(finding).collect()
    }

    fn phrases_in(&self, prose: &str) -> Vec<(usize, String)> {
        let is_part = |letter: char| letter.is_alphanumeric() || "-_'’".contains(letter);
        let prose = without_code(prose);
        let words: Vec<(usize, &str)> = pieces(&prose, is_part);
        let mut found = Vec::new();
        for (index, &(at, word)) in words.iter().enumerate() {
            let first = uncapitalised(word.trim_end_matches("'s"));
            for (further, instead) in self.phrases.get(first.as_ref()).into_iter().flatten() {
                let goes_on = further.iter().zip(index..).all(|(wanted, before)| {
                    let (before, next) = (words[before], words.get(before + 1));
                    // A phrase may go over the end of a line of comments.
                    let is_mark = |letter: char| letter.is_whitespace() || "/!#%*".contains(letter);
                    let is_blank = |to: usize| prose[before.0 + before.1.len()..to].trim_matches(is_mark).is_empty();
                    next.is_some_and(|&(at, word)| word == wanted && is_blank(at))
                });
                if goes_on {
                    let phrase: Vec<_> =
                        [first.as_ref()].into_iter().chain(further.iter().map(String::as_str)).collect();
                    found.push((at, format!("\"{}\": {instead}", phrase.join(" "))));
                }
            }
        }
        found
    }

    fn names_in(&self, code: &str) -> Vec<(usize, String)> {
        let matches = |name: &str, pattern: &str| match (pattern.strip_prefix('*'), pattern.strip_suffix('*')) {
            (Some(end), _) => name.ends_with(end),
            (_, Some(begin)) => name.starts_with(begin),
            _ => name == pattern,
        };
        let names = pieces(code, |letter| letter.is_alphanumeric() || letter == '_').into_iter();
        names
            .filter_map(|(at, name)| {
                let (_, instead) = self.names.iter().find(|(pattern, _)| matches(name, pattern))?;
                Some((at, format!("the name `{name}`: {instead}")))
            })
            .collect()
    }
}

/// Documentation comments that begin with Of, What or Whether, the last one for anything but a bool.
fn openings(text: &str) -> Vec<(usize, String)> {
    let (mut found, mut at, mut within) = (Vec::new(), 0, "");
    for line in text.split_inclusive('\n') {
        let trimmed = line.trim_start();
        let mark = ["///", "//!", "/**", "\"\"\""].into_iter().find(|mark| trimmed.starts_with(mark)).unwrap_or("");
        let begins = !mark.is_empty() && (mark != within || !mark.starts_with("//"));
        let first = trimmed[mark.len()..].trim_start().split(' ').next().unwrap_or_default();
        let begins_badly = match first {
            "Of" | "What" => begins,
            "Whether" => begins && !item(&text[at..]).to_lowercase().contains("bool"),
            _ => false,
        };
        if begins_badly {
            found.push((at, format!("documentation that begins with \"{first}\": say what the item is or does")));
        }
        within = mark;
        at += line.len();
    }
    found
}

/// The head of the item below the documentation that `text` begins with, attributes left out.
fn item(text: &str) -> &str {
    let mut code = text.trim_start();
    while let Some(end) =
        code.strip_prefix("///").and(code.find('\n')).or(code.strip_prefix("#[").and(code.find("]\n")))
    {
        code = code[end + 1..].trim_start();
    }
    let ends: &[char] =
        if code[..code.find('\n').unwrap_or(code.len())].contains("fn ") { &['{', ';'] } else { &[',', '\n', '}'] };
    &code[..code.find(ends).unwrap_or(code.len())]
}

/// `prose` with the code that it quotes between backticks on one line replaced by what is no part of a phrase.
fn without_code(prose: &str) -> String {
    let without = |line: &str| -> String {
        let parts: Vec<&str> = line.split('`').collect();
        if line.contains("```") || parts.len().is_multiple_of(2) {
            return line.to_owned();
        }
        let part = |(index, part): (usize, &&str)| {
            if index.is_multiple_of(2) { (*part).to_owned() } else { "\u{1}".repeat(part.len()) }
        };
        parts.iter().enumerate().map(part).collect::<Vec<_>>().join("`")
    };
    prose.split('\n').map(without).collect::<Vec<_>>().join("\n")
}

/// The longest pieces of `text` that consist of letters that are part of one, and where they are.
fn pieces(text: &str, is_part: impl Fn(char) -> bool) -> Vec<(usize, &str)> {
    let mut pieces = Vec::new();
    let mut begin = None;
    for (at, letter) in text.char_indices().chain([(text.len(), ' ')]) {
        match begin {
            None if at < text.len() && is_part(letter) => begin = Some(at),
            Some(from) if !is_part(letter) => {
                pieces.push((from, text[from..at].trim_matches(['\'', '-'])));
                begin = None;
            }
            _ => {}
        }
    }
    pieces
}

/// A word whose only capital is its first letter, without it.
fn uncapitalised(word: &str) -> Cow<'_, str> {
    let mut letters = word.chars();
    match letters.next() {
        Some(first) if first.is_uppercase() && !letters.as_str().contains(char::is_uppercase) => {
            first.to_lowercase().chain(letters).collect()
        }
        _ => word.into(),
    }
}
