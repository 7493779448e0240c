//! The files of a release, from a clean copy of the last commit, with the same bytes in every folder. Nothing is uploaded.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs, io};

use crate::process::{Result, at, cargo, command, make, output, read, root, run as run_command, write};
use crate::setup;

/// The systems of the command-line tool.
const SYSTEMS: [System; 3] = [
    System { target: "x86_64-unknown-linux-musl", linker: "rust-lld", flags: "-C link-self-contained=yes", end: "" },
    System { target: "aarch64-unknown-linux-musl", linker: "rust-lld", flags: "-C link-self-contained=yes", end: "" },
    System {
        target: WINDOWS,
        linker: "x86_64-w64-mingw32-gcc",
        flags: "-C link-arg=-Wl,--no-insert-timestamp",
        end: ".exe",
    },
];

/// The target of the Windows executable.
pub const WINDOWS: &str = "x86_64-pc-windows-gnu";

/// Lists the dependencies in a binary; the second writes them as CycloneDX.
const TOOLS: [(&str, &str); 2] = [("cargo-auditable", "0.7"), ("cargo-cyclonedx", "0.5")];

struct System {
    target: &'static str,
    linker: &'static str,
    flags: &'static str,
    end: &'static str,
}

/// Makes all files in target/dist/files, of the tool for `only` this target or for all; `twice`: also in another folder, and compares their
/// digests.
pub fn run(only: Option<&str>, twice: bool) -> Result<()> {
    let systems: Vec<&System> = SYSTEMS.iter().filter(|system| only.is_none_or(|only| only == system.target)).collect();
    let targets: Vec<&str> = systems.iter().map(|system| system.target).collect();
    if targets.is_empty() {
        return Err(format!("--target: one of {}", SYSTEMS.each_ref().map(|system| system.target).join(", ")));
    }
    setup::toolchain(&targets)?;
    setup::windows_linker()?;
    for (tool, version) in TOOLS {
        if !tools().join("bin").join(tool).exists() {
            setup::cargo_install(&format!("--root {} {tool} --version ^{version}", tools().display()))?;
        }
    }
    let dist = root().join("target").join("dist");
    let sums = files(&systems, &dist.join("source"), &dist.join("files"))?;
    println!("{sums}");
    if twice {
        let again =
            files(&systems, &dist.join("another folder").join("with a longer name"), &dist.join("files again"))?;
        let differ = sums.lines().zip(again.lines()).find(|(one, other)| one != other);
        return differ.map_or(Ok(()), |(one, other)| Err(format!("not reproducible: {one} and {other}")));
    }
    Ok(())
}

fn tools() -> PathBuf {
    root().join("target").join("tools")
}

/// Copies the last commit to `source`, makes its files in `out`, and returns their digests.
fn files(systems: &[&System], source: &Path, out: &Path) -> Result<String> {
    for folder in [source, out] {
        match fs::remove_dir_all(folder) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(at(folder)(error)),
            _ => make(folder)?,
        }
    }
    let archive = out.with_extension("tar");
    run_command(command("git", &["archive", "--output", &archive.to_string_lossy(), "HEAD"]))?;
    run_command(command("tar", &["-xf", &archive.to_string_lossy(), "-C", &source.to_string_lossy()]))?;
    fs::remove_file(&archive).map_err(at(&archive))?;
    let date = output(command("git", &["log", "-1", "--format=%ct"]))?;
    for system in systems {
        let built = tool(source, system, date.trim())?;
        let name = format!("springpot-{}{}", system.target, system.end);
        fs::copy(&built, out.join(name)).map_err(at(&built))?;
    }
    let mut bill = in_source(source, "cyclonedx --format json --manifest-path host-sim/Cargo.toml", date.trim());
    bill.env("CARGO_NET_OFFLINE", "true");
    run_command(bill)?;
    let bill = source.join("host-sim").join("host-sim.cdx.json");
    // Its folder is in it.
    let text = read(&bill)?.replace(&*source.to_string_lossy(), "").replace(&encoded(source), "");
    write(&out.join("springpot.cdx.json"), &text)?;
    run_command(in_source(
        source,
        "package --quiet --no-verify --allow-dirty --package springpot --package dea-driver",
        date.trim(),
    ))?;
    for entry in fs::read_dir(source.join("target").join("package")).map_err(at(source))? {
        let path = entry.map_err(at(source))?.path();
        if path.extension().is_some_and(|end| end == "crate") {
            fs::copy(&path, out.join(path.file_name().unwrap_or_default())).map_err(at(&path))?;
        }
    }
    let mut digests = Command::new("sh");
    digests.args(["-c", "sha256sum -- *"]).current_dir(out).env("LC_ALL", "C");
    let sums = output(digests)?;
    write(&out.join("SHA256SUMS"), &sums)?;
    Ok(sums)
}

/// A path as in a URL.
fn encoded(path: &Path) -> String {
    path.to_string_lossy().replace(' ', "%20")
}

/// Builds the tool of the sources in `source`, and returns where it is.
fn tool(source: &Path, system: &System, date: &str) -> Result<PathBuf> {
    let target = system.target;
    let line = format!("auditable build --release --locked --package host-sim --bin springpot --target {target}");
    let mut build = in_source(source, &line, date);
    let variable = target.to_uppercase().replace('-', "_");
    build.env(format!("CARGO_TARGET_{variable}_LINKER"), system.linker);
    build.env("CARGO_PROFILE_RELEASE_STRIP", "symbols").env("CARGO_PROFILE_RELEASE_DEBUG", "false");
    let home = env::var_os("CARGO_HOME").map(PathBuf::from).or_else(|| Some(env::home_dir()?.join(".cargo")));
    let remap = |from: &Path, to: &str| format!("--remap-path-prefix={}={to}", from.display());
    let mut flags = vec![remap(source, "/springpot"), remap(&home.unwrap_or_default(), "/cargo")];
    flags.extend(system.flags.split(' ').map(str::to_owned));
    // Folders may have blanks.
    build.env("CARGO_ENCODED_RUSTFLAGS", flags.join("\u{1f}"));
    run_command(build)?;
    Ok(source.join("target").join(target).join("release").join(format!("springpot{}", system.end)))
}

/// The Windows executable alone, of the sources as they are.
pub fn windows() -> Result<PathBuf> {
    setup::toolchain(&[WINDOWS])?;
    setup::windows_linker()?;
    let mut build = cargo(&format!("build --release --locked --package host-sim --bin springpot --target {WINDOWS}"));
    build.env("CARGO_TARGET_X86_64_PC_WINDOWS_GNU_LINKER", "x86_64-w64-mingw32-gcc");
    run_command(build)?;
    Ok(root().join("target").join(WINDOWS).join("release").join("springpot.exe"))
}

fn in_source(source: &Path, line: &str, date: &str) -> Command {
    let mut command = cargo(line);
    let path = env::var_os("PATH").unwrap_or_default();
    let paths = std::iter::once(tools().join("bin")).chain(env::split_paths(&path));
    command.current_dir(source).env("SOURCE_DATE_EPOCH", date).env_remove("RUSTFLAGS");
    command.env("PATH", env::join_paths(paths).unwrap_or(path)).env("CARGO_TARGET_DIR", source.join("target"));
    command
}
