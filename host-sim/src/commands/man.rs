//! `man`: the pages of this tool for `man`.

use clap::Command;
use clap_mangen::Man;

use super::prelude::*;

#[derive(Debug, Args)]
pub(super) struct Arguments {
    /// Folder for a page of each command, such as ~/.local/share/man/man1; the tool's own page is printed if left out.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

#[derive(Serialize)]
struct Report {
    #[serde(skip_serializing_if = "Option::is_none")]
    page: Option<String>,
    files: Vec<String>,
}

pub(super) fn run(arguments: &Arguments, json: bool) -> Result<()> {
    let mut command = super::command_line();
    // Gives the subcommands their full names.
    command.build();
    let report = match &arguments.out {
        None => Report { page: Some(page(command)?), files: Vec::new() },
        Some(folder) => Report { page: None, files: write(command, folder)? },
    };
    terminal::report(json, &report, || match &report.page {
        Some(page) => page.trim_end().to_owned(),
        None => format!("written: {}", report.files.join(", ")),
    })
}

fn page(command: Command) -> Result<String> {
    let mut page = Vec::new();
    Man::new(command).render(&mut page).map_err(|e| Error::Computation(format!("man page: {e}")))?;
    String::from_utf8(page).map_err(|e| Error::Computation(format!("man page: {e}")))
}

/// Writes the pages of `command` and all below it into `folder`.
fn write(command: Command, folder: &Path) -> Result<Vec<String>> {
    let mut commands = Vec::new();
    collect(&command, &mut commands);
    let mut pages = Vec::new();
    for command in commands {
        let path = folder.join(format!("{}.1", command.get_display_name().unwrap_or_else(|| command.get_name())));
        output::check(&path, &[], Folders::AreMade)?;
        pages.push((path, page(command)?));
    }
    // Removed again if it stays empty.
    let _folder = Folder::at(folder)?;
    let staged: Vec<Staged> = pages
        .iter()
        .map(|(path, page)| Staged::new(path, |file| file.write_all(page.as_bytes())))
        .collect::<Result<_>>()?;
    staged.into_iter().try_for_each(Staged::commit)?;
    Ok(pages.iter().map(|(path, _)| shown(path)).collect())
}

fn collect(command: &Command, all: &mut Vec<Command>) {
    all.push(command.clone());
    for below in command.get_subcommands().filter(|below| below.get_name() != "help") {
        collect(below, all);
    }
}
