//! The library knows no command line: its errors and warnings name fields, which the tool turns into flags.

use std::fs;
use std::path::{Path, PathBuf};

use host_sim::commands::with_flags;

/// Sources of the library, without tests.
fn sources() -> Vec<(PathBuf, String)> {
    fn collect(folder: &Path, files: &mut Vec<(PathBuf, String)>) {
        for entry in fs::read_dir(folder).expect("a folder of sources") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                collect(&path, files);
            } else if path.extension().is_some_and(|ending| ending == "rs") {
                files.push((path.clone(), fs::read_to_string(&path).expect("a source file")));
            }
        }
    }
    let mut files = Vec::new();
    for library in ["io/src", "models/src", "emit/src"] {
        collect(&Path::new(env!("CARGO_MANIFEST_DIR")).join(library), &mut files);
    }
    assert!(files.len() > 80, "{} files", files.len());
    files
}

/// Flags in the strings of `source`: two dashes and a letter, outside comments.
fn flags(source: &str) -> Vec<&str> {
    let code = source.lines().filter(|line| !line.trim_start().starts_with("//"));
    let is_flag = |line: &&str| {
        line.match_indices("--").any(|(at, _)| line[at + 2..].starts_with(|c: char| c.is_ascii_lowercase()))
    };
    code.filter(is_flag).collect()
}

#[test]
fn no_message_of_the_library_names_a_flag() {
    assert_eq!(flags("f(\"--hold\")\n// --hold\n/// `--hold`\na --b").len(), 2, "the search finds what it should");
    for (path, source) in sources() {
        // Options of another program.
        let own = flags(&source).into_iter().filter(|line| !line.contains(".arg("));
        assert_eq!(own.collect::<Vec<_>>(), Vec::<&str>::new(), "{}", path.display());
    }
}

#[test]
fn every_field_that_an_error_names_has_a_flag() {
    let mut fields = 0;
    for (path, source) in sources() {
        for call in ["Error::field(", "positive(", "at_most("] {
            for (at, _) in source.match_indices(call) {
                let Some(argument) = source[at + call.len()..].trim_start().strip_prefix('"') else { continue };
                let field = argument.split('"').next().unwrap_or_default();
                // Python's dictionary of all limits; each has a flag of its own.
                if field == "limits" {
                    continue;
                }
                assert!(with_flags(&format!("`{field}`")).starts_with("--"), "{}: {field}", path.display());
                fields += 1;
            }
        }
    }
    assert!(fields > 50, "{fields} fields");
}

#[test]
fn flags_have_the_names_of_fields_without_units() {
    assert_eq!(
        with_flags("`max_field_v_per_m`: `from_s`, `law_hz` of `main.alpha`, `colour`, ` and `hold`"),
        "--max-field: --from, --rate of `main.alpha`, `colour`, ` and --hold"
    );
}
