//! The workspace's test programs: built by cargo, run two at a time.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;
use std::{iter, thread};

use serde_json::Value;

use crate::process::{Result, cargo, output, root};

/// The tests that run the firmware's images.
pub const QEMU: &str = "--features tests/qemu";

/// With it the boards on the host have a channel of the current.
pub const SENSED: &str = "board-on-host/self-sensing";

/// Programs at a time, each of as many threads as there are cores: boards and emulators wait, and a program ends with one test.
const BESIDE: usize = 2;

/// Those that take longest, in the order in which they begin: that of boards, which tick in real time, beside what calculates.
const FIRST: [&str; 4] = ["link_commands", "host-sim/models it", "command_line", "firmware"];

/// The cases of sweeps that tests run.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Cases {
    Sample,
    All,
}

/// A test program.
struct Program {
    /// The folder of its package, in which it runs.
    folder: PathBuf,
    /// The folder within the project, and the name of the target.
    name: String,
    executable: PathBuf,
}

/// Test programs that are built.
pub struct Programs(Vec<Program>);

impl Programs {
    /// Builds those of the workspace that each of the `options` of `cargo test` names, those first that take longest.
    pub fn built(options: &[&str]) -> Result<Self> {
        let mut programs = Vec::new();
        for options in options {
            let line = format!("test --quiet --workspace {options} --no-run --message-format json-render-diagnostics");
            println!("$ cargo {line}");
            let before = programs.len();
            programs.extend(output(cargo(&line))?.lines().filter_map(Program::of_message));
            if programs.len() == before {
                return Err(format!("cargo {line}: it names no program"));
            }
        }
        programs
            .sort_by_key(|program| FIRST.iter().position(|name| program.name.ends_with(name)).unwrap_or(FIRST.len()));
        Ok(Self(programs))
    }

    /// Runs all of them, with these cases. Prints of those that pass how many tests they have, and all that the others print.
    pub fn run(&self, cases: Cases) -> Result<()> {
        let next = AtomicUsize::new(0);
        let failed_of_some = || -> Vec<&str> {
            let begun = iter::repeat_with(|| self.0.get(next.fetch_add(1, Ordering::Relaxed)));
            let failed = begun.map_while(|begun| begun).filter(|program| match program.run(cases) {
                Ok(()) => false,
                Err(error) => {
                    println!("{error}");
                    true
                }
            });
            failed.map(|program| program.name.as_str()).collect()
        };
        let failed = thread::scope(|scope| {
            let beside = [(); BESIDE].map(|()| scope.spawn(failed_of_some));
            beside.map(|thread| thread.join().unwrap_or_else(|_| vec!["a thread of this chore"])).concat()
        });
        if failed.is_empty() {
            Ok(())
        } else {
            Err(format!("tests failed in {}: what they printed is above", failed.join(", ")))
        }
    }
}

impl Program {
    /// The test program that a message of cargo announces, if it announces one.
    fn of_message(message: &str) -> Option<Self> {
        let message: Value = serde_json::from_str(message).ok()?;
        let executable = message["executable"].as_str().filter(|_| message["profile"]["test"] == true)?;
        // Examples are built as tests are, and have none.
        if message["target"]["kind"][0] == "example" {
            return None;
        }
        let folder = Path::new(message["manifest_path"].as_str()?).parent()?.to_owned();
        let within = folder.strip_prefix(root()).ok()?.display().to_string();
        let name = format!("{within} {}", message["target"]["name"].as_str()?);
        Some(Self { folder, name, executable: executable.into() })
    }

    /// Runs it as cargo does. The error is what it printed.
    fn run(&self, cases: Cases) -> Result<()> {
        let start = Instant::now();
        let mut command = Command::new(&self.executable);
        command.arg("--quiet").current_dir(&self.folder).env("CARGO_MANIFEST_DIR", &self.folder);
        if cases == Cases::All {
            command.env("SPRINGPOT_SWEEP", "full");
        }
        let done = command.output().map_err(|error| format!("{}: {error}", self.executable.display()))?;
        let printed = String::from_utf8_lossy(&done.stdout);
        let seconds = start.elapsed().as_secs_f64();
        let summary = printed.lines().find(|line| line.starts_with("test result"));
        let Some(summary) = summary.filter(|_| done.status.success()) else {
            let errors = String::from_utf8_lossy(&done.stderr);
            return Err(format!("{}: {} after {seconds:.0} s\n{printed}\n{errors}", self.name, done.status));
        };
        println!("{seconds:6.0} s  {}: {summary}", self.name);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::{Cases, Program, Programs};
    use crate::process::root;

    fn message(kind: &str, is_test: bool, executable: &str) -> String {
        let manifest = root().join("host-sim/io/Cargo.toml");
        format!(
            r#"{{"reason":"compiler-artifact","manifest_path":{manifest:?},"target":{{"kind":["{kind}"],"name":"it"}},
            "profile":{{"test":{is_test}}},"executable":{executable}}}"#
        )
        .replace('\n', " ")
    }

    #[test]
    fn test_programs_alone_are_run() {
        let program = |kind, is_test, executable| Program::of_message(&message(kind, is_test, executable));
        assert_eq!(program("test", true, "\"/built/it\"").expect("a test program").name, "host-sim/io it");
        assert!(program("example", true, "\"/built/it\"").is_none());
        assert!(program("bin", false, "\"/built/it\"").is_none());
        assert!(program("lib", true, "null").is_none());
        assert!(Program::of_message(r#"{"reason":"build-finished","success":true}"#).is_none());
    }

    #[cfg(unix)]
    #[test]
    fn programs_that_fail_are_named() {
        let program =
            |executable: &str| Program { executable: executable.into(), folder: root(), name: executable.into() };
        // `echo` prints no result, and `false` fails; there is no other one.
        let failed = Programs(["echo", "false", "/nowhere"].map(program).into()).run(Cases::Sample);
        let failed = failed.expect_err("all fail");
        assert!(["echo", "false", "/nowhere"].iter().all(|name| failed.contains(name)), "{failed}");
    }
}
