//! `completions`: what makes a shell complete the options of this tool.

use clap_complete::Shell;

use super::prelude::*;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Which shell.
    #[arg(value_enum)]
    shell: Shell,
}

#[derive(Serialize)]
struct Report {
    shell: String,
    script: String,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let mut command = super::command_line();
    let name = command.get_name().to_owned();
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut command, name, &mut script);
    let script = String::from_utf8(script).map_err(|e| Error::Computation(format!("completions: {e}")))?;
    let report = Report { shell: arguments.shell.to_string(), script };
    terminal::report(json, &report, || report.script.trim_end().to_owned())
}
