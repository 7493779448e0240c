//! Where a result comes from: when, by what, by which command.

use std::{env, iter};

use chrono::Utc;
use maud::{Markup, html};

use super::page::{Row, table, text};
use crate::fit::report::Origin;

/// The running program, now.
pub fn now() -> Origin {
    let arguments = env::args_os().skip(1).map(|argument| quoted(&argument.to_string_lossy()));
    let words = iter::once("springpot".to_owned()).chain(arguments);
    Origin {
        date: Utc::now().format("%Y-%m-%d %H:%M:%S UTC").to_string(),
        tool: format!("springpot {}", env!("CARGO_PKG_VERSION")),
        command: words.collect::<Vec<String>>().join(" "),
    }
}

/// The table of `files`, each with its SHA-256.
pub fn files_table<'a>(caption: &str, files: impl IntoIterator<Item = (&'a str, &'a str)>) -> Markup {
    let row = |(file, sha256): (&str, &str)| Row::new(vec![text(file), html! { code.digest { (sha256) } }]);
    table(caption, &["file", "SHA-256"], &files.into_iter().map(row).collect::<Vec<Row>>())
}

/// Rows that state when something was made (`date`), by which `tool` and by which `command`.
pub fn rows([date, tool, command]: [&str; 3]) -> [Row; 3] {
    [("made", date), ("by", tool), ("command", command)]
        .map(|(name, value)| Row::new(vec![text(name), html! { code { (value) } }]))
}

/// A word as a shell takes it.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}
