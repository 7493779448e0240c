//! The tool as scripts call it.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

use crate::table;

/// The sizes of the paper's film, as a parameter file has them.
pub const SIZES: &str =
    "[actuator]\nrelative_permittivity = 4.7\nlength_m = 0.04\nwidth_m = 0.06\nthickness_m = 160e-6\nmass_kg = 0.316\n";

/// The tool at a path: `Tool(env!("CARGO_BIN_EXE_host-sim-under-test"))`, which only tests know.
#[derive(Clone, Copy, Debug)]
pub struct Tool(pub &'static str);

impl Tool {
    /// The tool with `arguments`, not yet run.
    pub fn with(self, arguments: &[&str]) -> Command {
        let mut command = Command::new(self.0);
        // On a busy machine no line of progress comes between what is tested.
        command.args(arguments).env("HOST_SIM_PROGRESS_S", "86400");
        command
    }

    /// Returns what it prints with `--json`: one document and nothing else.
    pub fn json(self, arguments: &[&str]) -> Value {
        document(self.with(arguments).arg("--json").assert().success().get_output())
    }

    /// Returns what it prints with `--json` for a line of arguments without blanks in them, in a folder.
    pub fn line(self, line: &str, folder: &Path) -> Value {
        let arguments: Vec<&str> = line.split_whitespace().chain(["--json"]).collect();
        document(self.with(&arguments).current_dir(folder).assert().success().get_output())
    }

    /// Its one line on standard error, where it must fail: exit status 2, nothing on standard output.
    pub fn fails(self, arguments: &[&str]) -> String {
        failed(self.with(arguments))
    }
}

/// A temporary folder in which the tool runs. Its arguments are lines, words with blanks between them.
pub struct Bench {
    tool: Tool,
    folder: TempDir,
}

impl Bench {
    /// An empty folder for `tool`.
    pub fn new(tool: Tool) -> Self {
        Self { tool, folder: TempDir::new().expect("a folder") }
    }

    /// Copies the recordings of `plant`, and returns their names as arguments.
    pub fn recordings(&self, plant: &str) -> String {
        let names = crate::recordings(plant).map(|path| {
            let name = path.file_name().expect("a name").to_string_lossy().into_owned();
            fs::copy(&path, self.path(&name)).expect("copied");
            name
        });
        names.join(" ")
    }

    /// The path of a file.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a file.
    pub fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        fs::write(self.path(name), content).expect("written");
    }

    /// Writes a table: its header, and its rows.
    pub fn write_table(&self, name: &str, header: &str, rows: impl IntoIterator<Item = String>) {
        let lines: Vec<String> = rows.into_iter().collect();
        self.write(name, format!("{header}\n{}\n", lines.join("\n")));
    }

    /// The text of a file.
    pub fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    /// The names of the files, sorted.
    pub fn files(&self) -> Vec<String> {
        let entries = fs::read_dir(self.folder.path()).expect("a folder");
        let mut names: Vec<_> =
            entries.map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned()).collect();
        names.sort();
        names
    }

    /// A column of a table.
    pub fn column(&self, name: &str, title: &str) -> Vec<f64> {
        table::column(&self.path(name), title)
    }

    /// The tool with the arguments of `line`, not yet run.
    pub fn with(&self, line: &str) -> Command {
        let mut command = self.tool.with(&line.split_whitespace().collect::<Vec<_>>());
        command.current_dir(self.folder.path());
        command
    }

    /// Runs it, whether or not it succeeds.
    pub fn run(&self, line: &str) -> Output {
        self.with(line).output().expect("runs")
    }

    /// Returns what it prints.
    pub fn prints(&self, line: &str) -> String {
        String::from_utf8(self.with(line).assert().success().get_output().stdout.clone()).expect("UTF-8")
    }

    /// Returns what it prints with `--json`: one document and nothing else.
    pub fn json(&self, line: &str) -> Value {
        self.tool.line(line, self.folder.path())
    }

    /// The same where the answer is no: exit status 1.
    pub fn says_no(&self, line: &str) -> Value {
        document(self.with(line).arg("--json").assert().code(1).get_output())
    }

    /// The same for either answer, and whether it is yes.
    pub fn answers(&self, line: &str) -> (Value, bool) {
        let output = self.run(&format!("{line} --json"));
        let answer = document(&output);
        assert!(matches!(output.status.code(), Some(0 | 1)), "{line}: {}", output.status);
        (answer, output.status.success())
    }

    /// Its one line on standard error, where it must fail and leave nothing behind.
    pub fn fails(&self, line: &str) -> String {
        let before = self.files();
        let line = failed(self.with(line));
        assert_eq!(before, self.files(), "nothing is left behind");
        line
    }
}

fn document(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).expect("one JSON document and nothing else")
}

/// A number of a document.
pub fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is not a number"))
}

/// The rows of a document.
pub fn rows(value: &Value) -> &[Value] {
    value.as_array().unwrap_or_else(|| panic!("{value} is not a list"))
}

/// Whether one of a report's warnings holds `words`.
pub fn warns(report: &Value, words: &str) -> bool {
    rows(&report["warnings"]).iter().any(|warning| warning.as_str().expect("text").contains(words))
}

/// The one line on standard error of a command that must fail: exit status 2, nothing on standard output.
pub fn failed(mut command: Command) -> String {
    let output = command.assert().code(2).get_output().clone();
    let line = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(line.lines().count(), 1, "{line}");
    assert!(line.starts_with("springpot: ") && line.len() < 600, "{line}");
    assert!(output.stdout.is_empty());
    println!("{}", line.trim_end());
    line
}

/// Asserts that `line` holds all `words`.
pub fn names(line: &str, words: &[&str]) {
    for word in words {
        assert!(line.contains(word), "{word:?} is missing in: {line}");
    }
}

/// A path as an argument.
pub fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}
