//! Examples in the help of each command: a command in brackets, then lines of what is done and how it is called.

use clap::Command;

const EXAMPLES: &str = include_str!("examples.txt");

/// `command` with the examples of its commands at the end of their help.
pub(super) fn added_to(command: Command) -> Command {
    EXAMPLES.split("\n\n").fold(command, |command, examples| {
        let (name, examples) = examples.trim_start_matches('[').split_once("]\n").unwrap_or((examples, ""));
        let lines = examples.lines().filter_map(|line| line.split_once(" => "));
        let text: String = lines.map(|(what, call)| format!("\n  {what}:\n    springpot {call}")).collect();
        added_below(command, &name.split_whitespace().collect::<Vec<_>>(), &format!("Examples:{text}"))
    })
}

fn added_below(command: Command, path: &[&str], text: &str) -> Command {
    match path.split_first() {
        None => command.after_help(text.to_owned()),
        Some((name, rest)) => command.mut_subcommand(*name, |below| added_below(below, rest, text)),
    }
}
