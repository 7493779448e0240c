//! The tool as scripts call it.

use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;

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
        let output = self.with(arguments).arg("--json").assert().success().get_output().stdout.clone();
        serde_json::from_slice(&output).expect("one JSON document and nothing else")
    }

    /// Returns what it prints with `--json` for a line of arguments without blanks in them, in a folder.
    pub fn line(self, line: &str, folder: &Path) -> Value {
        let arguments: Vec<&str> = line.split_whitespace().chain(["--json"]).collect();
        let output = self.with(&arguments).current_dir(folder).assert().success().get_output().stdout.clone();
        serde_json::from_slice(&output).expect("one JSON document and nothing else")
    }

    /// Returns what it prints with `--json` where the answer is no: exit status 1.
    pub fn says_no(self, arguments: &[&str]) -> Value {
        let output = self.with(arguments).arg("--json").assert().code(1).get_output().stdout.clone();
        serde_json::from_slice(&output).expect("one JSON document and nothing else")
    }

    /// Its one line on standard error, where it must fail: exit status 2, nothing on standard output.
    pub fn fails(self, arguments: &[&str]) -> String {
        let output = self.with(arguments).assert().code(2).get_output().clone();
        let line = String::from_utf8(output.stderr).expect("UTF-8");
        assert_eq!(line.lines().count(), 1, "{line}");
        assert!(line.starts_with("host-sim: ") && line.len() < 600, "{line}");
        assert!(output.stdout.is_empty());
        println!("{}", line.trim_end());
        line
    }
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
