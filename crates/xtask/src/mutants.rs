//! Mutants by hand: statements deleted, constants changed.

use std::fs::{copy, read_to_string, write};
use std::path::Path;

use crate::process::{Result, cargo, make, output, root};

/// The list, relative to the root.
const LIST: &str = ".cargo/mutants.txt";

/// A change of a source file, which a test should notice.
struct Mutant {
    name: String,
    /// Below the root.
    file: String,
    from: String,
    to: String,
    survives: Option<String>,
}

fn listed() -> Result<Vec<Mutant>> {
    let text = read(&root().join(LIST))?;
    let lines = |block: &str, sign| {
        let lines: Vec<&str> = block.lines().filter_map(|line| line.strip_prefix(sign)).collect();
        lines.join("\n")
    };
    let mutant = |block: &str| {
        let mut lines_of = block.lines();
        let (name, file) = (lines_of.next().unwrap_or_default(), lines_of.next().unwrap_or_default());
        let survives = block.lines().find_map(|line| line.strip_prefix("= "));
        Mutant {
            name: name.into(),
            file: format!("crates/{file}"),
            from: lines(block, '-'),
            to: lines(block, '+'),
            survives: survives.map(Into::into),
        }
    };
    // The first one says what the others are.
    Ok(text.split("\n\n").skip(1).map(mutant).collect())
}

fn read(path: &Path) -> Result<String> {
    read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))
}

impl Mutant {
    /// The file at `folder`, mutated.
    fn apply(&self, folder: &Path) -> Result<String> {
        let text = read(&folder.join(&self.file))?;
        match text.matches(&self.from).count() {
            1 => Ok(text.replacen(&self.from, &self.to, 1)),
            count => Err(format!("{LIST}: {}: its lines are {count} times in {}; once expected", self.name, self.file)),
        }
    }

    /// Runs the tests of the mutant in the copy of the project at `folder`; whether they notice it.
    fn is_noticed(&self, folder: &Path) -> Result<bool> {
        let path = folder.join(&self.file);
        let (original, mutated) = (read(&path)?, self.apply(folder)?);
        let tests = |line: &str| {
            let mut test = cargo(&format!("test --quiet --profile mutants {line}"));
            test.current_dir(folder).env("CARGO_TARGET_DIR", folder.join("target"));
            output(test)
        };
        let package = if self.file.contains("springpot") { "springpot --test it" } else { "dea-driver --test driver" };
        write(&path, mutated).map_err(|error| error.to_string())?;
        let built = tests(&format!("--package {package} --no-run"));
        let passed = built.as_ref().map(|_| tests(&format!("--package {package}")).is_ok());
        write(&path, original).map_err(|error| error.to_string())?;
        Ok(!passed.map_err(|error| format!("{} does not compile: {error}", self.name))?)
    }
}

/// Runs the tests on each mutant of the list, in a copy of the project.
pub fn run() -> Result<()> {
    let folder = root().join("target/mutants-by-hand");
    let mut list = std::process::Command::new("git");
    list.args(["ls-files", "--cached", "--others", "--exclude-standard"]).current_dir(root());
    for file in output(list)?.lines().filter(|file| root().join(file).is_file()) {
        let copied = folder.join(file);
        make(copied.parent().unwrap_or(&folder))?;
        copy(root().join(file), &copied).map_err(|error| format!("{file}: {error}"))?;
    }
    let mut wrong = Vec::new();
    for mutant in listed()? {
        let is_noticed = mutant.is_noticed(&folder)?;
        println!("{}: {}", if is_noticed { "noticed" } else { "survives" }, mutant.name);
        if is_noticed == mutant.survives.is_some() {
            wrong.push(format!("{LIST}: {} {}", mutant.name, if is_noticed { "is noticed" } else { "survives" }));
        }
    }
    if wrong.is_empty() { Ok(()) } else { Err(wrong.join("\n")) }
}

#[test]
fn every_mutant_has_its_place() {
    let listed = listed().expect("it is read");
    assert!(listed.len() > 50);
    for mutant in listed {
        mutant.apply(&root()).expect("its lines are there");
    }
}
