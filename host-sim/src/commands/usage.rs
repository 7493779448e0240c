//! Errors of a command line, each with the help that shows the usage.

use std::any::TypeId;
use std::ffi::OsString;

use clap::Command;
use clap::error::ErrorKind;

use crate::error::Error;

/// `command` whose numbers may begin with a minus sign: `--low -1e-3` is a value, no option.
pub(super) fn with_signed_numbers(command: Command) -> Command {
    command
        .mut_args(|option| {
            let is_number = option.get_value_parser().type_id() == TypeId::of::<f64>();
            if is_number { option.allow_hyphen_values(true) } else { option }
        })
        .mut_subcommands(with_signed_numbers)
}

/// The error of a command line that clap refuses: one line, with the help that shows the usage.
pub(super) fn error(error: &clap::Error, arguments: &[OsString]) -> Error {
    let called = called(arguments);
    if error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
        return Error::Usage(format!("no command given ({called} --help lists them)"));
    }
    let text = error.render().to_string();
    let lines = text
        .lines()
        .map(str::trim)
        .take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more"))
        // An option that is misspelt is hardly a file.
        .filter(|line| !line.starts_with("tip: to pass"));
    let words: Vec<String> = lines.flat_map(str::split_whitespace).map(shortened).collect();
    let cause = words.join(" ").replace(" tip: ", "; ");
    Error::Usage(format!("{} ({called} --help shows the usage)", cause.strip_prefix("error: ").unwrap_or(&cause)))
}

/// A word that fits in a line.
fn shortened(word: &str) -> String {
    const MAX_WORD: usize = 60;
    if word.chars().count() <= MAX_WORD {
        word.into()
    } else {
        word.chars().take(MAX_WORD).chain("…'".chars()).collect()
    }
}

/// The command that `arguments` call, with its subcommands.
fn called(arguments: &[OsString]) -> String {
    let root = super::command_line();
    let mut command = &root;
    let mut name = root.get_name().to_owned();
    for word in arguments.iter().skip(1).filter_map(|word| word.to_str()).take_while(|word| *word != "--") {
        if let Some(found) = command.find_subcommand(word) {
            command = found;
            name = format!("{name} {}", command.get_name());
        }
    }
    name
}
