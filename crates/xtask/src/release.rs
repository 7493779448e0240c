//! The files of a release, from a clean copy of the last commit, with the same bytes in every folder. Nothing is uploaded.

mod builds;
mod packing;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs, io};

use crate::process::{Result, at, command, entries, home, make, name, output, read, root, run as run_command, write};
use crate::setup;
use builds::{SYSTEMS, Source, System};

pub use builds::{WINDOWS, windows};

/// All files of a release, with VERSION for the version. docs/CONTRIBUTING.md says what they are for.
const FILES: [&str; 20] = [
    "SHA256SUMS",
    "dea-driver-VERSION.crate",
    "springpot-VERSION-cp311-abi3-manylinux2014_x86_64.manylinux_2_17_x86_64.whl",
    "springpot-VERSION-cp311-abi3-win_amd64.whl",
    "springpot-VERSION.crate",
    "springpot-aarch64-unknown-linux-musl",
    "springpot-arduino.zip",
    "springpot-firmware-nucleo-g474re.bin",
    "springpot-firmware-nucleo-g474re.dfu",
    "springpot-firmware-nucleo-g474re.elf",
    "springpot-firmware-stm32f405.bin",
    "springpot-firmware-stm32f405.dfu",
    "springpot-firmware-stm32f405.elf",
    "springpot-firmware-stm32f407-discovery.bin",
    "springpot-firmware-stm32f407-discovery.dfu",
    "springpot-firmware-stm32f407-discovery.elf",
    "springpot-matlab.zip",
    "springpot-x86_64-pc-windows-gnu.exe",
    "springpot-x86_64-unknown-linux-musl",
    "springpot.cdx.json",
];

/// Tools of cargo: one lists the dependencies in a binary, the other writes them as CycloneDX.
const TOOLS: [(&str, &str); 2] = [("cargo-auditable", "0.7.7"), ("cargo-cyclonedx", "0.5.9")];

/// How often the files of a release are made.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Making {
    /// The files, in target/dist/files.
    Once,
    /// These, and again as another user would; compares their digests.
    Twice,
    /// Only the second time of `Twice`.
    Again,
}

/// Where the sources are copied to the first and the second time, and where the files then are, in target/dist.
const FIRST: [&str; 2] = ["source", "files"];
const SECOND: [&str; 2] = ["another-folder/with-a-longer-name", "files-again"];

/// Makes all files, or of the tool alone that of the system `only`.
pub fn run(only: Option<&str>, making: Making) -> Result<()> {
    let systems: Vec<&System> = SYSTEMS.iter().filter(|system| only.is_none_or(|only| only == system.target)).collect();
    let targets: Vec<&str> = systems.iter().map(|system| system.target).collect();
    if targets.is_empty() {
        return Err(format!("--target: one of {}", SYSTEMS.each_ref().map(|system| system.target).join(", ")));
    }
    let dist = root().join("target").join("dist");
    let made = |[folder, out]: [&str; 2]| files(&systems, only.is_none(), dist.join(folder), &dist.join(out));
    if making == Making::Again {
        return made(SECOND).map(drop);
    }
    if targets.contains(&WINDOWS) && dist.to_string_lossy().contains(' ') {
        return Err(format!("{}: MinGW takes no path with a blank: clone the project to one without", dist.display()));
    }
    setup::toolchain(&targets)?;
    if targets.contains(&WINDOWS) {
        setup::ensure(setup::WINDOWS_LINKER)?;
    }
    for (tool, version) in TOOLS {
        setup::tool(tool, version, "")?;
    }
    let sums = made(FIRST)?;
    println!("{sums}");
    if making == Making::Twice {
        run_command(as_another_user(only, &dist)?)?;
        let again = read(&dist.join(SECOND[1]).join("SHA256SUMS"))?;
        let differ = sums.lines().zip(again.lines()).find(|(one, other)| one != other);
        if let Some((one, other)) = differ {
            return Err(format!("not reproducible: {one} and {other}"));
        }
        println!("twice the same bytes");
    }
    Ok(())
}

/// This program as the user 1000 of a namespace of its own where the system allows that, with another home, umask, language and local time.
fn as_another_user(only: Option<&str>, dist: &Path) -> Result<Command> {
    let user = ["unshare", "--user", "--map-user=1000", "--map-group=1000"];
    let is_allowed = output(command(user[0], &[&user[1..], &["true"]].concat())).is_ok();
    let other_home = dist.join("home");
    make(&other_home)?;
    let mut again = command("sh", &["-c", "umask 077; exec \"$@\"", "sh"]);
    if is_allowed {
        again.args(user);
    } else {
        println!(
            "no other user is possible on this system: the second time differs by home, umask, language and local time"
        );
    }
    again.arg(env::current_exe().map_err(at(&other_home))?).args(["release", "--again"]);
    again.args(only.iter().flat_map(|target| ["--target", target]));
    for (variable, folder) in [("CARGO_HOME", ".cargo"), ("RUSTUP_HOME", ".rustup")] {
        again.env(variable, home(variable, folder).unwrap_or_default());
    }
    again.envs([("USER", "another"), ("LOGNAME", "another"), ("LC_ALL", "C.UTF-8"), ("TZ", "<+14>-14")]);
    again.env("HOME", &other_home);
    Ok(again)
}

/// The folder of tools that a release alone needs.
fn tools() -> PathBuf {
    root().join("target").join("tools")
}

/// Copies the last commit to `folder`, makes the files in `out`, and returns their digests.
fn files(systems: &[&System], is_whole: bool, folder: PathBuf, out: &Path) -> Result<String> {
    for folder in [&folder, out] {
        match fs::remove_dir_all(folder) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(at(folder)(error)),
            _ => make(folder)?,
        }
    }
    let source = copied(folder)?;
    for system in systems {
        copy(&builds::tool(&source, system)?, &out.join(format!("springpot-{}{}", system.target, system.end)))?;
    }
    if is_whole {
        // Bills of materials lie beside the manifests: packages would have them, with the folder in which they were made.
        crates(&source, out)?;
        materials(&source, out)?;
        builds::wheels(&source, out)?;
        for (image, board) in builds::firmware(&source)? {
            packing::images(&image, &out.join(format!("springpot-firmware-{board}")))?;
        }
        libraries(&source, out)?;
    }
    let mut digests = Command::new("sh");
    digests.args(["-c", "sha256sum -- *"]).current_dir(out).env("LC_ALL", "C");
    let sums = output(digests)?;
    write(&out.join("SHA256SUMS"), &sums)?;
    if is_whole { complete(out).map(|()| sums) } else { Ok(sums) }
}

/// The last commit in `folder`/springpot, and the time of its commit.
fn copied(folder: PathBuf) -> Result<Source> {
    let archive = folder.join("commit.tar");
    let text = |path: &Path| path.to_string_lossy().into_owned();
    run_command(command("git", &["archive", "--prefix", "springpot/", "--output", &text(&archive), "HEAD"]))?;
    run_command(command("tar", &["-xf", &text(&archive), "-C", &text(&folder)]))?;
    fs::remove_file(&archive).map_err(at(&archive))?;
    let date = output(command("git", &["log", "-1", "--format=%ct"]))?.trim().to_owned();
    Ok(Source { root: folder.join("springpot"), folder, date })
}

/// The bill of materials of the tool.
fn materials(source: &Source, out: &Path) -> Result<()> {
    run_command(source.cargo("cyclonedx --format json --manifest-path host-sim/Cargo.toml"))?;
    copy(&without_folders(source, "host-sim/host-sim.cdx.json")?, &out.join("springpot.cdx.json"))
}

/// Takes the folder in which a bill of materials was made out of it, and returns its path.
fn without_folders(source: &Source, file: &str) -> Result<PathBuf> {
    let file = source.root.join(file);
    let folder = source.root.to_string_lossy();
    let text = read(&file)?.replace(&*folder, "").replace(&folder.replace(' ', "%20"), "");
    write(&file, &text).map(|()| file)
}

/// The crates, as a registry would get them.
fn crates(source: &Source, out: &Path) -> Result<()> {
    let line = "package --quiet --no-verify --allow-dirty --package springpot --package dea-driver";
    run_command(source.cargo(line))?;
    let folder = source.target().join("package");
    for path in entries(&folder)? {
        if path.extension().is_some_and(|end| end == "crate") {
            copy(&path, &out.join(name(&path)))?;
        }
    }
    Ok(())
}

/// The law of a published film for Arduino, and for MATLAB with the scripts: the tool writes them for other films.
fn libraries(source: &Source, out: &Path) -> Result<()> {
    let tool = out.join(format!("springpot-{}-unknown-linux-musl", env::consts::ARCH));
    let exported = source.folder.join("exported");
    let [arduino, matlab] = ["table3_n2", "springpot-matlab"].map(|name| exported.join(name));
    make(&matlab)?;
    for (emit, out) in [("arduino", arduino.clone()), ("sfunction", matlab.join("film.c"))] {
        let mut export = Command::new(&tool);
        export.args(["export", "--quiet", "--params", "preset:table3-n2", "--emit", emit, "--out"]).arg(out);
        output(export)?;
    }
    let scripts = source.root.join("matlab");
    for path in entries(&scripts)? {
        copy(&path, &matlab.join(name(&path)))?;
    }
    for name in ["LICENSE-MIT", "LICENSE-APACHE"] {
        copy(&source.root.join(name), &arduino.join(name))?;
        copy(&source.root.join(name), &matlab.join(name))?;
    }
    packing::archive(&arduino, &out.join("springpot-arduino.zip"))?;
    packing::archive(&matlab, &out.join("springpot-matlab.zip"))
}

/// The files in `out` are those of a release.
fn complete(out: &Path) -> Result<()> {
    let found: Vec<String> = entries(out)?.iter().map(|path| name(path)).collect();
    let wanted = FILES.map(|name| name.replace("VERSION", env!("CARGO_PKG_VERSION")));
    if found == wanted { Ok(()) } else { Err(format!("the files of a release are {wanted:?}, not {found:?}")) }
}

/// Copies a file with its permissions.
fn copy(from: &Path, to: &Path) -> Result<()> {
    fs::copy(from, to).map(drop).map_err(at(from))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The page on releases lists the files that a release has, and no others.
    #[test]
    fn the_page_lists_the_files() {
        let page = read(&root().join("docs/CONTRIBUTING.md")).expect("a page");
        let table = page.split("| file of a release |").nth(1).expect("a table").split("\n\n").next().expect("its end");
        let mut listed: Vec<&str> =
            table.lines().filter_map(|row| row.strip_prefix("| `")?.split('`').next()).collect();
        listed.sort_unstable();
        assert_eq!(listed, FILES);
    }

    /// `cargo binstall` is led to files that a release has.
    #[test]
    fn metadata_lead_to_files() {
        let manifest = read(&root().join("host-sim/Cargo.toml")).expect("a manifest");
        let url = "{ repo }/releases/download/v{ version }/springpot-{ target }{ binary-ext }";
        assert!(manifest.contains(&format!("[package.metadata.binstall]\npkg-url = \"{url}\"\npkg-fmt = \"bin\"\n")));
        for system in SYSTEMS {
            assert!(FILES.contains(&&*format!("springpot-{}{}", system.target, system.end)), "{}", system.target);
        }
    }
}
