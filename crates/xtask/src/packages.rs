//! The libraries as packages: their features, what a registry would get, and what their tests build.

use std::path::Path;
use std::{fs, io};

use serde_json::Value;

use crate::process::{Result, cargo, entries, home, name, output, root, run as run_command};

/// The libraries: they are checked with every feature, and packaged.
pub const LIBRARIES: [&str; 2] = ["springpot", "dea-driver"];

/// The package of each library is complete; what is in it is stated in its manifest. Neither the library nor its tests need the host tool.
pub fn run() -> Result<()> {
    for library in LIBRARIES {
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

/// Names of a library's features.
pub fn features_of(library: &str) -> Result<Vec<String>> {
    let mut metadata = cargo("read-manifest");
    metadata.current_dir(root().join("crates").join(library));
    let manifest: Value = serde_json::from_str(&output(metadata)?).map_err(|error| format!("{library}: {error}"))?;
    let features = manifest["features"].as_object().ok_or_else(|| format!("{library}: no features"))?;
    Ok(features.keys().filter(|name| *name != "default").cloned().collect())
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
