//! Where a result comes from: when, by what, by which command.

use std::env;
use std::ffi::OsString;

use chrono::Utc;
use maud::{Markup, html};

use super::page::{Row, table, text};
use crate::fit::report::Origin;

/// The running program, now.
pub fn now() -> Origin {
    Origin {
        date: Utc::now().format("%Y-%m-%d %H:%M:%S UTC").to_string(),
        tool: format!("springpot {}", env!("CARGO_PKG_VERSION")),
        command: command(env::args_os().skip(1)),
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

/// `springpot` with `arguments`, quoted for a shell.
fn command(arguments: impl Iterator<Item = OsString>) -> String {
    let mut words = vec!["springpot".to_owned()];
    words.extend(arguments.map(|argument| quoted(&argument.to_string_lossy())));
    words.join(" ")
}

fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', "'\\''"))
    }
}
