//! Builds of a release, from a copy of the sources.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

use super::tools;
use crate::firmware::{BOARDS, Image};
use crate::process::{Result, at, cargo, home, read, root, run as run_command, write};
use crate::{python, setup};

/// The systems of the command-line tool.
pub const SYSTEMS: [System; 3] = [
    System {
        target: "x86_64-unknown-linux-musl",
        linker: Some("rust-lld"),
        flags: "-C link-self-contained=yes",
        end: "",
    },
    System {
        target: "aarch64-unknown-linux-musl",
        linker: Some("rust-lld"),
        flags: "-C link-self-contained=yes",
        end: "",
    },
    // Names of symbols have that of a temporary folder in which the compiler imports the system's libraries.
    System {
        target: WINDOWS,
        linker: Some(MINGW),
        flags: "-C link-arg=-Wl,--no-insert-timestamp,--strip-all",
        end: ".exe",
    },
];

/// The target of the Windows executable, and its linker.
pub const WINDOWS: &str = "x86_64-pc-windows-gnu";
const MINGW: &str = "x86_64-w64-mingw32-gcc";

/// Tools that build wheels: maturin, and a linker that keeps to the symbols of an old libc.
const WHEEL_TOOLS: [&str; 2] = ["maturin==1.16.0", "ziglang==0.17.1"];

/// A system that the tool is built for.
pub struct System {
    pub target: &'static str,
    /// None where maturin sets Zig's, which an environment variable would override.
    linker: Option<&'static str>,
    flags: &'static str,
    pub end: &'static str,
}

/// A copy of the sources.
pub struct Source {
    /// The folder around it.
    pub folder: PathBuf,
    /// Its root.
    pub root: PathBuf,
    /// Time of its commit, s since 1970.
    pub date: String,
}

impl Source {
    /// Where it is built.
    pub fn target(&self) -> PathBuf {
        self.folder.join("target")
    }

    /// A cargo command in it.
    pub fn cargo(&self, line: &str) -> Command {
        self.prepared(cargo(line))
    }

    /// A command in it, with the tools of a release on its path.
    fn prepared(&self, mut command: Command) -> Command {
        let path = env::var_os("PATH").unwrap_or_default();
        let paths =
            [tools().join("python").join("bin"), tools().join("bin")].into_iter().chain(env::split_paths(&path));
        command.env("PATH", env::join_paths(paths).unwrap_or(path)).env("CARGO_TARGET_DIR", self.target());
        command.env("CARGO_PROFILE_RELEASE_STRIP", "symbols").env("CARGO_PROFILE_RELEASE_DEBUG", "false");
        command.current_dir(&self.root).env("SOURCE_DATE_EPOCH", &self.date).env_remove("RUSTFLAGS");
        command
    }

    /// The compiler's options that keep folders out of what it writes.
    fn remap(&self) -> Vec<String> {
        let home = home("CARGO_HOME", ".cargo");
        let remap = |from: &Path, to: &str| format!("--remap-path-prefix={}={to}", from.display());
        vec![remap(&self.folder, "/build"), remap(&home.unwrap_or_default(), "/cargo")]
    }

    /// The command with the options of `system`.
    fn linked(&self, mut command: Command, system: &System) -> Command {
        if let Some(linker) = system.linker {
            let variable = system.target.to_uppercase().replace('-', "_");
            command.env(format!("CARGO_TARGET_{variable}_LINKER"), linker);
        }
        let flags: Vec<String> = self.remap().into_iter().chain(system.flags.split(' ').map(str::to_owned)).collect();
        // Folders may have blanks.
        command.env("CARGO_ENCODED_RUSTFLAGS", flags.join("\u{1f}"));
        command
    }

    /// Makes `member`, a workspace of its own, one of a workspace around the copy. Names of symbols depend on paths within the workspace, and
    /// those of packages outside of it on whole paths.
    fn enclose(&self, member: &str) -> Result<()> {
        let manifest = self.root.join(member).join("Cargo.toml");
        let text = read(&manifest)?;
        let (package, profiles) = text.split_once("[profile").unwrap_or((&text, ".release]"));
        let outside = ["crates", "host-sim", "tests"].map(|folder| format!("\"springpot/{folder}\"")).join(", ");
        let members = format!("resolver = \"3\"\nmembers = [\"springpot/{member}\"]\nexclude = [{outside}]");
        write(&self.folder.join("Cargo.toml"), &format!("[workspace]\n{members}\n\n[profile{profiles}"))?;
        write(&manifest, &package.replace("\n[workspace]\n", "\n"))?;
        let lock = manifest.with_file_name("Cargo.lock");
        fs::copy(&lock, self.folder.join("Cargo.lock")).map(drop).map_err(at(&lock))
    }
}

/// Section of an executable in which cargo-auditable lists its dependencies.
const DEPENDENCIES: &[u8] = b".dep-v0";

/// Builds the tool, and returns where it is.
pub fn tool(source: &Source, system: &System) -> Result<PathBuf> {
    let target = system.target;
    let line = format!("build --release --locked --package host-sim --bin springpot --target {target}");
    let mut build = source.linked(source.cargo(&line), system);
    // As `cargo auditable` does, but by its name: names of symbols depend on the path of a wrapper.
    build.env("RUSTC_WORKSPACE_WRAPPER", "cargo-auditable");
    build.env("CARGO_AUDITABLE_ORIG_ARGS", r#"{"offline":false,"locked":true,"frozen":false,"config":[]}"#);
    run_command(build)?;
    let tool = source.target().join(target).join("release").join(format!("springpot{}", system.end));
    let bytes = fs::read(&tool).map_err(at(&tool))?;
    match bytes.windows(DEPENDENCIES.len()).any(|window| window == DEPENDENCIES) {
        true => Ok(tool),
        false => Err(format!("{}: cargo-auditable has not listed its dependencies", tool.display())),
    }
}

/// Builds the Python package for Linux and Windows on x86-64, for every Python from 3.11 on.
pub fn wheels(source: &Source, out: &Path) -> Result<()> {
    let interpreter = python::environment(&tools().join("python"))?;
    run_command(python::pip(&interpreter, "install", &WHEEL_TOOLS))?;
    source.enclose("python")?;
    run_command(source.cargo("cyclonedx --format json --manifest-path python/Cargo.toml"))?;
    let materials = super::without_folders(source, "python/springpot-python.cdx.json")?;
    const LINUX: System =
        System { target: "x86_64-unknown-linux-gnu", linker: None, flags: "-C strip=symbols", end: "" };
    for (system, options) in [(&LINUX, "--zig --compatibility manylinux2014"), (&SYSTEMS[2], "")] {
        let mut build = Command::new("maturin");
        let line =
            format!("build --release --locked --manifest-path python/Cargo.toml --target {} {options}", system.target);
        build.args(line.split_whitespace()).arg("--out").arg(out);
        build.arg("--sbom-include").arg(&materials);
        run_command(source.linked(source.prepared(build), system))?;
    }
    Ok(())
}

/// Builds the firmware for each board, and returns the images with the names of the boards.
pub fn firmware(source: &Source) -> Result<Vec<(PathBuf, &'static str)>> {
    let [target, _] = setup::TARGETS;
    let toolchain = setup::toolchain(&[target])?;
    source.enclose("firmware")?;
    let flags: Vec<String> = source.remap().iter().map(|flag| format!("'{flag}'")).collect();
    for (Image { program, options, .. }, _) in BOARDS {
        let line = format!("build --release --locked --bin {program} {options}");
        let mut build = toolchain.cargo(&source.root.join("firmware"), target, &line);
        build
            .arg("--config")
            .arg(format!("target.{target}.rustflags=[{}]", flags.join(", ")))
            .env("CARGO_TARGET_DIR", source.target());
        run_command(build)?;
    }
    let folder = source.target().join(target).join("release");
    Ok(BOARDS.map(|(image, board)| (folder.join(image.program), board)).to_vec())
}

/// The Windows executable alone, of the sources as they are.
pub fn windows() -> Result<PathBuf> {
    setup::toolchain(&[WINDOWS])?;
    setup::ensure(setup::WINDOWS_LINKER)?;
    let mut build = cargo(&format!("build --release --locked --package host-sim --bin springpot --target {WINDOWS}"));
    build.env("CARGO_TARGET_X86_64_PC_WINDOWS_GNU_LINKER", MINGW);
    run_command(build)?;
    Ok(root().join("target").join(WINDOWS).join("release").join("springpot.exe"))
}
