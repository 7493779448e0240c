//! Licences, advisories and yanked versions of what the project depends on.

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use crate::process::{Result, command, make, output, read, root, run as run_command, write};
use crate::setup;

/// The extract of RustSec's database that is committed.
const EXTRACT: &str = ".cargo/advisories.txt";

/// RustSec's database.
const DATABASE: &str = "https://github.com/RustSec/advisory-db";

/// Folders with a Cargo.lock: the images and the Python package are workspaces of their own.
const WORKSPACES: [&str; 6] =
    [".", "crates/dea-driver/examples/other-board", "firmware", "python", "tests/embedded", "tests/fuzz"];

/// An advisory of the extract.
struct Advisory {
    id: String,
    package: String,
    /// Requirements of versions that it does not concern, separated by semicolons.
    safe: String,
}

fn extract() -> Result<Vec<Advisory>> {
    let text = read(&root().join(EXTRACT))?;
    let advisory = |line: &str| {
        let mut words = line.splitn(3, ' ').map(str::to_owned);
        let (id, package) = (words.next().unwrap_or_default(), words.next().unwrap_or_default());
        Advisory { id, package, safe: words.next().unwrap_or_default() }
    };
    Ok(text.lines().filter(|line| line.starts_with("RUSTSEC-")).map(advisory).collect())
}

/// Writes the extract as a database that cargo-deny takes, a Git repository, and returns its folder.
fn database() -> Result<PathBuf> {
    let folder = root().join("target/advisories/extract");
    let _ = fs::remove_dir_all(&folder);
    for Advisory { id, package, safe } in extract()? {
        let list: Vec<String> =
            safe.split(';').filter(|part| !part.is_empty()).map(|part| format!("{:?}", part.trim())).collect();
        let (informational, year) =
            (if list.is_empty() { "informational = \"unmaintained\"\n" } else { "" }, &id[8..12]);
        let page = folder.join("crates").join(&package);
        make(&page)?;
        let advisory =
            format!("[advisory]\nid = \"{id}\"\npackage = \"{package}\"\ndate = \"{year}-01-01\"\n{informational}");
        let versions = format!("\n[versions]\npatched = [{}]\n", list.join(", "));
        write(&page.join(format!("{id}.md")), &format!("```toml\n{advisory}{versions}```\n\n# {id}\n"))?;
    }
    let git = |line: &str| {
        let mut git = command("git", &line.split(' ').collect::<Vec<_>>());
        git.current_dir(&folder);
        output(git).map(drop)
    };
    git("init --quiet --initial-branch=main")?;
    git("add .")?;
    git("-c user.name=xtask -c user.email=xtask@localhost commit --quiet --message=extract")?;
    Ok(folder)
}

/// Checks licences, sources, advisories and yanked versions with cargo-deny, which is installed if it is missing.
pub fn deny() -> Result<()> {
    let deny = setup::tool("cargo-deny", "0.20.2", "")?;
    let is_reachable = output(command("git", &["ls-remote", "--exit-code", DATABASE, "HEAD"])).is_ok();
    let fetched = root().join(if is_reachable { "target/advisories/fetched" } else { "target/advisories/of-extract" });
    let config = read(&root().join("deny.toml"))?;
    let config =
        config.replace("[advisories]\n", &format!("[advisories]\ndb-path = {:?}\n", fetched.display().to_string()));
    let path = root().join("target/deny.toml");
    write(&path, &config)?;
    // Git takes the extract for the database.
    let instead = if is_reachable {
        None
    } else {
        println!("{DATABASE} is not reachable: advisories are those of {EXTRACT}");
        let _ = fs::remove_dir_all(&fetched);
        Some(format!("url.{}.insteadOf", database()?.display()))
    };
    for folder in WORKSPACES {
        let manifest = root().join(folder).join("Cargo.toml");
        let mut check = Command::new(&deny);
        check.current_dir(root()).args(["--log-level", "error", "--workspace", "--all-features", "--manifest-path"]);
        check.arg(manifest).arg("--config").arg(&path).arg("check");
        if let Some(instead) = &instead {
            check.envs([("GIT_CONFIG_COUNT", "1"), ("GIT_CONFIG_KEY_0", instead), ("GIT_CONFIG_VALUE_0", DATABASE)]);
        }
        run_command(check)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use semver::{Version, VersionReq};

    use super::*;
    use crate::process::locked;

    /// Advisories of the extract on these packages, without those that `config` accepts.
    fn found(packages: &[(String, String)], config: &str, extract: &[Advisory]) -> Vec<String> {
        let mut found = Vec::new();
        for (name, version) in packages {
            let version: Version = version.parse().expect("a version");
            let concerns = |advisory: &&Advisory| {
                let mut safe = advisory.safe.split(';').filter(|part| !part.is_empty());
                let is_safe = safe.any(|part| part.parse::<VersionReq>().expect("a requirement").matches(&version));
                advisory.package == *name && !is_safe && !config.contains(&advisory.id)
            };
            let advisories = extract.iter().filter(concerns);
            found.extend(advisories.map(|advisory| format!("{}: {} {version}", advisory.id, advisory.package)));
        }
        found
    }

    #[test]
    fn no_locked_version_has_a_known_advisory() {
        let config = read(&root().join("deny.toml")).expect("it is there");
        let extract = extract().expect("it is there");
        assert!(extract.len() > 20);
        for folder in WORKSPACES {
            let packages = locked(&root().join(folder)).expect("it is there");
            assert!(packages.len() > 20, "{folder}");
            assert_eq!(found(&packages, &config, &extract), [""; 0], "{folder}/Cargo.lock");
        }
        // One that has, and the one that is accepted.
        let packages = [("rand", "0.9.2"), ("ttf-parser", "0.25.1"), ("rand", "0.9.3")];
        let packages = packages.map(|(name, version)| (name.into(), version.into()));
        assert_eq!(found(&packages, &config, &extract), ["RUSTSEC-2026-0097: rand 0.9.2"]);
    }
}
