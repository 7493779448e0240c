//! The flags of options whose fields the library names.

use std::sync::LazyLock;

use clap::CommandFactory;

use super::Cli;
use crate::error;

/// The flags of all commands.
static FLAGS: LazyLock<Vec<String>> = LazyLock::new(|| {
    fn collect(command: &clap::Command, flags: &mut Vec<String>) {
        flags.extend(command.get_arguments().filter_map(|argument| argument.get_long().map(str::to_owned)));
        command.get_subcommands().for_each(|command| collect(command, flags));
    }
    let mut flags = Vec::new();
    collect(&Cli::command(), &mut flags);
    flags
});

/// The `text` of an error or a warning of the library with the flags of the options in it: `rate_hz` in backticks becomes --rate.
pub fn with_flags(text: &str) -> String {
    error::with_names(text, flag)
}

/// The flag of `field`: a flag has no unit.
fn flag(field: &str) -> Option<String> {
    // `frequency-response` has one rate, which is that of the law.
    let field = if field == "law_hz" { "rate" } else { field };
    let name = field.replace('_', "-");
    let ends = name.match_indices('-').map(|(end, _)| end).chain([name.len()]);
    let names: Vec<&str> = ends.map(|end| &name[..end]).collect();
    let known = names.into_iter().rev().find(|name| FLAGS.iter().any(|flag| flag == name))?;
    Some(format!("--{known}"))
}
