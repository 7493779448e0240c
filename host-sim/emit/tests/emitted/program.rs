//! C programs: written, compiled, run.

use std::fmt::Write as _;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::Command;

use host_emit::{HEADER, film};
use tempfile::TempDir;

use crate::films::Case;

/// A folder with the header, films and the sources of `tests/c`.
pub struct Sources {
    pub folder: TempDir,
    films: usize,
}

/// Options that every build has.
pub const STRICT: [&str; 6] = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror"];

/// These options, and more.
pub fn with<'a>(options: &[&'a str], more: &[&'a str]) -> Vec<&'a str> {
    [options, more].concat()
}

impl Sources {
    /// The sources for a program that steps `cases`, as `job_films` in their order.
    pub fn new(cases: &[Case]) -> Self {
        let folder = TempDir::new().expect("a folder");
        let path = |name: &str| folder.path().join(name);
        fs::write(path("springpot.h"), HEADER).expect("written");
        let mut list = String::from("#include \"springpot.h\"\n");
        // Some films in each file: as they are exported, apart from the repeated include.
        for (number, chunk) in cases.chunks(50).enumerate() {
            let mut text = String::new();
            for (k, case) in chunk.iter().enumerate() {
                let symbol = format!("film_{number}_{k}");
                text += &film(&case.film(&symbol));
                let _ = writeln!(list, "SPRINGPOT_FILM({symbol});");
                if case.sensed.is_some() {
                    let _ = writeln!(list, "SPRINGPOT_SELF_SENSING(self_sensing_{symbol});");
                }
            }
            fs::write(path(&format!("films_{number}.c")), text).expect("written");
        }
        list += "extern const springpot_film *const job_films[];\nconst springpot_film *const job_films[] = {\n";
        for k in 0..cases.len() {
            let _ = writeln!(list, "    &film_{}_{},", k / 50, k % 50);
        }
        list += "};\nextern const springpot_self_sensing *const job_sensing[];\nconst springpot_self_sensing *const job_sensing[] = {\n";
        for (k, case) in cases.iter().enumerate() {
            let (file, film) = (k / 50, k % 50);
            let _ = match case.sensed {
                Some(_) => writeln!(list, "    &self_sensing_film_{file}_{film},"),
                None => writeln!(list, "    NULL,"),
            };
        }
        let _ = writeln!(list, "}};\nextern const uint32_t job_count;\nconst uint32_t job_count = {}U;", cases.len());
        fs::write(path("job_films.c"), list).expect("written");
        for name in ["job.h", "host.c", "chip.h", "chip_jobs.c", "chip_costs.c"] {
            fs::copy(source(name), path(name)).expect("copied");
        }
        Self { folder, films: cases.len().div_ceil(50) }
    }

    /// The names of all files that hold films.
    pub fn film_files(&self) -> Vec<String> {
        (0..self.films).map(|k| format!("films_{k}.c")).chain(["job_films.c".into()]).collect()
    }

    /// Compiles the program of the host with `compiler` and `options`, which must succeed.
    pub fn compile(&self, compiler: &str, options: &[&str]) -> PathBuf {
        let mut command = Command::new(compiler);
        command.current_dir(self.folder.path()).args(options).arg("host.c").args(self.film_files());
        command.args(["-o", "program", "-lm"]);
        succeeds(&mut command);
        self.folder.path().join("program")
    }

    /// Runs `command` with `input` on its standard input and returns its standard output.
    pub fn run(&self, command: &mut Command, input: &[u8]) -> Vec<u8> {
        let file = self.folder.path().join("input");
        fs::write(&file, input).expect("written");
        command.stdin(File::open(&file).expect("written"));
        succeeds(command)
    }
}

/// A file of `tests/c`.
pub fn source(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/c").join(name)
}

/// Runs `command` to its end and returns its standard output.
pub fn succeeds(command: &mut Command) -> Vec<u8> {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}\n{errors}");
    output.stdout
}
