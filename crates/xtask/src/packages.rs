//! The libraries as packages: their features, what a registry would get, and what their tests build.

use std::path::Path;
use std::{fs, io};

use crate::process::{Result, cargo, entries, home, name, output, read, root, run as run_command};

/// The libraries: they are checked with every feature, and packaged.
pub const LIBRARIES: [&str; 2] = ["springpot", "dea-driver"];

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
const FOLDERS: [(&str, &[&str]); 4] =
    [("src/", &[".rs"]), ("doc/", &[".md"]), ("examples/", &[".rs"]), ("tests/", &[".rs", ".csv", ".bin"])];

/// The package of each library holds the library's own files, nothing else, and is complete. Neither
/// the library nor its tests need the host tool.
pub fn run() -> Result<()> {
    for library in LIBRARIES {
        let list = output(cargo(&format!("package --quiet --list --allow-dirty --package {library}")))?;
        let stray: Vec<&str> = list.lines().filter(|file| !belongs(file)).collect();
        if !stray.is_empty() {
            return Err(format!("the package of {library} holds {}", stray.join(", ")));
        }
        println!("the package of {library} holds {} files, all its own", list.lines().count());
        let tree = format!("tree --package {library} --edges normal,build,dev --prefix none --all-features");
        let tree = output(cargo(&tree))?;
        if let Some(tool) = tree.lines().find(|line| line.starts_with("host-sim ") || line.starts_with("tests ")) {
            return Err(format!("the tests of {library} build {tool}"));
        }
        println!("the tests of {library} do not build the host tool");
    }
    // Builds them from their packages: a file that they include from outside would be missing.
    forget_unpacked()?;
    let [springpot, driver] = LIBRARIES;
    let packages = format!("--package {springpot} --package {driver} --target-dir {TARGET}");
    let mut package = cargo(&format!("package --quiet --allow-dirty {packages}"));
    // That they compile is all that is asked.
    package.env("CARGO_PROFILE_DEV_DEBUG", "false");
    run_command(package)
}

/// Names in the table of features in a library's manifest.
pub fn features_of(library: &str) -> Result<Vec<String>> {
    let path = root().join("crates").join(library).join("Cargo.toml");
    let manifest = read(&path)?;
    let table = manifest.lines().skip_while(|line| line.trim() != "[features]").skip(1);
    let names = table
        .take_while(|line| !line.starts_with('['))
        .filter(|line| !line.starts_with([' ', '#', ']']))
        .filter_map(|line| Some(line.split_once('=')?.0.trim().trim_matches('"').to_owned()))
        .filter(|name| name != "default");
    Ok(names.collect())
}

/// Where the packages are built, apart from everything else.
const TARGET: &str = "target/packages";

/// Removes what an earlier run unpacked and built. Cargo takes a package of the same version for the same package: the driver would be
/// built on what the other library was then.
fn forget_unpacked() -> Result<()> {
    let removed = |path: &Path| match fs::remove_dir_all(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            Err(format!("cannot remove what an earlier run unpacked: {error}"))
        }
        _ => Ok(()),
    };
    removed(&root().join(TARGET))?;
    let Some(home) = home("CARGO_HOME", ".cargo") else { return Ok(()) };
    // Registries without a name are those that `cargo package` makes for itself.
    let registries = entries(&home.join("registry").join("src")).unwrap_or_default();
    for registry in registries.iter().filter(|registry| name(registry).starts_with('-')) {
        for package in entries(registry)? {
            if LIBRARIES.iter().any(|library| name(&package).starts_with(&format!("{library}-"))) {
                removed(&package)?;
            }
        }
    }
    Ok(())
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
