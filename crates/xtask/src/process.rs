//! Commands, as they would be typed, and files.

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs, io};

/// A chore's result: the error is the message for the user.
pub type Result<T> = std::result::Result<T, String>;

/// The root of the project.
pub fn root() -> PathBuf {
    let here = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    here.ancestors().nth(2).map(PathBuf::from).unwrap_or(here)
}

/// A command to be run in the root of the project.
pub fn command(program: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new(program);
    command.args(arguments).current_dir(root());
    command
}

/// This project's cargo with the arguments of `line`. Incremental builds are off: cut into small units, the image that may not panic does
/// not link.
pub fn cargo(line: &str) -> Command {
    let arguments: Vec<&str> = line.split_whitespace().collect();
    let mut cargo = command(&env::var("CARGO").unwrap_or_else(|_| "cargo".into()), &arguments);
    cargo.env("CARGO_INCREMENTAL", "0");
    cargo
}

/// Checks the format of a workspace of its own.
pub fn format(folder: &Path) -> Result<()> {
    let mut format = cargo("fmt --check");
    format.current_dir(folder);
    run(format)
}

/// Runs `command`, its output on the terminal.
pub fn run(mut command: Command) -> Result<()> {
    let line = line(&command);
    println!("$ {line}");
    match command.status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(format!("{status}: {line}")),
        Err(error) => Err(format!("{line}: {error}")),
    }
}

/// Runs `command` and returns what it printed on standard output.
pub fn output(mut command: Command) -> Result<String> {
    let line = line(&command);
    let output = command.output().map_err(|error| format!("{line}: {error}"))?;
    if !output.status.success() {
        return Err(format!("{}: {line}\n{}", output.status, String::from_utf8_lossy(&output.stderr)));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// A command as it would be typed.
pub fn line(command: &Command) -> String {
    let mut words = vec![command.get_program().to_string_lossy().into_owned()];
    words.extend(command.get_args().map(|argument| argument.to_string_lossy().into_owned()));
    words.join(" ")
}

/// Puts a file or a folder before an error of it.
pub fn at<E: Display>(path: &Path) -> impl Fn(E) -> String {
    let path = path.display().to_string();
    move |error| format!("{path}: {error}")
}

pub fn read(path: &Path) -> Result<String> {
    fs::read_to_string(path).map_err(at(path))
}

pub fn write(path: &Path, text: &str) -> Result<()> {
    fs::write(path, text).map_err(at(path))
}

/// The paths in a folder, sorted.
pub fn entries(folder: &Path) -> Result<Vec<PathBuf>> {
    let paths = |entries: fs::ReadDir| entries.map(|entry| Ok(entry?.path())).collect::<io::Result<Vec<PathBuf>>>();
    let mut paths = fs::read_dir(folder).and_then(paths).map_err(at(folder))?;
    paths.sort();
    Ok(paths)
}

/// Names and versions in the lock file of a folder.
pub fn locked(folder: &Path) -> Result<Vec<(String, String)>> {
    let value =
        |line: &str, key: &str| Some(line.strip_prefix(key)?.strip_prefix(" = \"")?.trim_end_matches('"').to_owned());
    let lock = read(&folder.join("Cargo.lock"))?;
    let lines: Vec<&str> = lock.lines().collect();
    Ok(lines.windows(2).filter_map(|pair| Some((value(pair[0], "name")?, value(pair[1], "version")?))).collect())
}

/// The name of a file or a folder.
pub fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// The folder that a `variable` such as CARGO_HOME names, or the one of this `name` at home.
pub fn home(variable: &str, name: &str) -> Option<PathBuf> {
    env::var_os(variable).map(PathBuf::from).or_else(|| Some(env::home_dir()?.join(name)))
}

/// Makes a folder and those that it is in.
pub fn make(folder: &Path) -> Result<()> {
    fs::create_dir_all(folder).map_err(at(folder))
}
