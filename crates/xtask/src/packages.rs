//! The libraries as packages: what a registry would get, and what their tests build.

use crate::process::{Result, cargo, output, run as run_command};
use crate::test::LIBRARIES;

/// Files in the root of a package: its own, and those that cargo adds.
const FILES: [&str; 7] = [
    ".cargo_vcs_info.json",
    "Cargo.lock",
    "Cargo.toml",
    "Cargo.toml.orig",
    "LICENSE-APACHE",
    "LICENSE-MIT",
    "README.md",
];

/// Folders of a package, and what files in them end in.
const FOLDERS: [(&str, &[&str]); 3] =
    [("src/", &[".rs"]), ("examples/", &[".rs"]), ("tests/", &[".rs", ".csv", ".bin"])];

/// Each package holds the library's own files, nothing else, and is complete. Neither the library nor its tests need the host
/// tool.
pub fn run() -> Result<()> {
    for library in LIBRARIES {
        let list = output(cargo(&["package", "--quiet", "--list", "--allow-dirty", "--package", library]))?;
        let stray: Vec<&str> = list.lines().filter(|file| !belongs(file)).collect();
        if !stray.is_empty() {
            return Err(format!("the package of {library} holds {}", stray.join(", ")));
        }
        println!("the package of {library} holds {} files, all its own", list.lines().count());
        let kinds = "normal,build,dev";
        let tree =
            output(cargo(&["tree", "--package", library, "--edges", kinds, "--prefix", "none", "--all-features"]))?;
        if let Some(tool) = tree.lines().find(|line| line.starts_with("host-sim ") || line.starts_with("tests ")) {
            return Err(format!("the tests of {library} build {tool}"));
        }
        println!("the tests of {library} do not build the host tool");
    }
    // Builds them from their packages: a file that they include from outside would be missing.
    let [springpot, driver] = LIBRARIES;
    run_command(cargo(&["package", "--quiet", "--allow-dirty", "--package", springpot, "--package", driver]))
}

fn belongs(file: &str) -> bool {
    FILES.contains(&file)
        || FOLDERS.iter().any(|(folder, ends)| file.starts_with(folder) && ends.iter().any(|end| file.ends_with(end)))
}

#[cfg(test)]
mod tests {
    use super::belongs;

    #[test]
    fn strays_are_found() {
        for own in ["Cargo.toml", "README.md", "src/law/mod.rs", "examples/hold.rs", "tests/oracle/continuous.csv"] {
            assert!(belongs(own), "{own}");
        }
        for stray in ["notes.txt", "src/law/mod.rs.orig", "target/debug/x", "../README.md", "docs/x.svg", "data.csv"] {
            assert!(!belongs(stray), "{stray}");
        }
    }
}
