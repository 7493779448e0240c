//! Installs what the tests need beyond the host's Rust: the chips' compiler targets, QEMU, and what decodes a log.

use std::env;
use std::ffi::OsString;
use std::fs;
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use crate::process::{Result, cargo, command, line, output, read, root, run as run_command, write};

/// The chips: Cortex-M4F (hard float) and Cortex-M0 (soft float, no compare-and-swap).
pub const TARGETS: [&str; 2] = ["thumbv7em-none-eabihf", "thumbv6m-none-eabi"];

/// Cores of boards that are not the firmware's: Cortex-M33 (hard float) and RISC-V (soft float).
pub const OTHER_TARGETS: [&str; 2] = ["thumbv8m.main-none-eabihf", "riscv32imac-unknown-none-elf"];

/// How images are compiled.
pub enum Toolchain {
    /// The project's own toolchain, with rustup's targets.
    Rustup,
    /// Debian's compiler, which builds the core library from its sources, with rustup's linker.
    Debian {
        /// PATH with the linker.
        path: OsString,
    },
}

/// Where all images are built, whatever folder they are of: what they depend on is compiled once.
pub fn built() -> PathBuf {
    root().join("firmware/target")
}

impl Toolchain {
    /// A cargo command on an image for `target` in `folder`.
    pub fn cargo(&self, folder: &Path, target: &str, line: &str) -> Command {
        let (own, passed) = line.split_once(" -- ").unwrap_or((line, ""));
        let line = format!("{own} --target {target}{}{passed}", if passed.is_empty() { "" } else { " -- " });
        let mut command = match self {
            Self::Rustup => cargo(&line),
            Self::Debian { path } => {
                let mut command = command("/usr/bin/cargo", &line.split_whitespace().collect::<Vec<_>>());
                command
                    .arg("-Zbuild-std=core")
                    .env("CARGO_INCREMENTAL", "0")
                    .env("RUSTC_BOOTSTRAP", "1")
                    // Unstable features for the library's crates alone.
                    .env("RUSTC", root().join("crates/xtask/core-alone.sh"))
                    .env("PATH", path)
                    .env_remove("RUSTUP_TOOLCHAIN");
                command
            }
        };
        command.current_dir(folder).env("CARGO_TARGET_DIR", built());
        // The flags of the host's build are not the chip's.
        command.env_remove("RUSTFLAGS").env_remove("CARGO_ENCODED_RUSTFLAGS");
        command
    }

    /// Lints an image: of the profile that it is built with, which compiles the macros of both once. Debian's compiler has no clippy.
    pub fn lint(&self, folder: &Path, target: &str, options: &str) -> Result<()> {
        let lint = format!("clippy --quiet --release {options} -- -D warnings");
        match self {
            Self::Rustup => run_command(self.cargo(folder, target, &lint)),
            Self::Debian { .. } => Ok(()),
        }
    }
}

/// Whether anything may be installed.
static MAY_INSTALL: AtomicBool = AtomicBool::new(true);

/// Lets a chore install what it needs, or not.
pub fn allow_installing(may: bool) {
    MAY_INSTALL.store(may, Ordering::Relaxed);
}

/// Runs a command that installs something, if that is allowed.
fn install(command: Command) -> Result<()> {
    if MAY_INSTALL.load(Ordering::Relaxed) { run_command(command) } else { Err(forbidden(&line(&command))) }
}

fn forbidden(what: &str) -> String {
    format!("missing, and not installed with --no-install: {what}")
}

/// Names what `run` and the compiler for `targets` will install and change, and asks once whether they may, on a terminal. Without
/// one it goes ahead.
pub fn agree(targets: &[&str]) -> Result<()> {
    let mut missing = Vec::new();
    if !has("defmt-print") {
        missing.push("defmt-print: cargo install, into cargo's folder of programs".to_owned());
    }
    let absent = absent(targets);
    if !absent.is_empty() && (has("rustup") || !has_debians_compiler()) {
        let debian = "without rustup the Debian packages rustc-web, cargo-web, rust-web-src";
        missing.push(format!("compiler targets {}: rustup target add; {debian}", absent.join(", ")));
    }
    if !knows_the_boards() {
        missing.push(
            "QEMU 10 for Arm: apt-get install qemu-system-arm, as root; on Debian 12 from its backports, which are added to \
             /etc/apt/sources.list.d"
                .to_owned(),
        );
    }
    if missing.is_empty() {
        return Ok(());
    }
    println!("to be installed:\n  {}", missing.join("\n  "));
    let may = MAY_INSTALL.load(Ordering::Relaxed);
    let answer = if may && io::stdin().is_terminal() && io::stdout().is_terminal() {
        print!("Go ahead? [Y/n] ");
        let mut answer = String::new();
        let read = io::stdout().flush().and_then(|()| io::stdin().read_line(&mut answer));
        read.map_err(|error| format!("no answer: {error}"))?;
        Some(answer)
    } else {
        None
    };
    decide(&missing, may, answer.as_deref())
}

/// Returns an error where nothing may be installed, or the answer to the question, if there was one, is not yes.
fn decide(missing: &[String], may_install: bool, answer: Option<&str>) -> Result<()> {
    match answer.map(|answer| answer.trim().to_lowercase()).as_deref() {
        _ if !may_install => Err(forbidden(&missing.join("; "))),
        None | Some("" | "y" | "yes") => Ok(()),
        Some(_) => Err("nothing was installed: the answer was not y".into()),
    }
}

/// Installs what is missing and says what it took.
pub fn run() -> Result<Toolchain> {
    // What decodes the firmware's log is compiled while packages are fetched.
    let (toolchain, decoder) = thread::scope(|scope| {
        let decoder = scope.spawn(decoder);
        let toolchain = toolchain(&TARGETS).and_then(|toolchain| qemu().map(|()| toolchain));
        (toolchain, decoder.join().unwrap_or_else(|_| Err("installing defmt-print panicked".into())))
    });
    let toolchain = toolchain?;
    decoder?;
    match &toolchain {
        Toolchain::Rustup => println!("images are compiled by this toolchain, with rustup's targets"),
        Toolchain::Debian { .. } => {
            println!("images are compiled by Debian's rustc-web, with the core library from source")
        }
    }
    Ok(toolchain)
}

/// Installs what decodes the firmware's log, if it is missing.
fn decoder() -> Result<()> {
    if has("defmt-print") {
        return Ok(());
    }
    // It decodes some lines a second: optimised, it takes 134 s of the processor to build instead of 64.
    let mut cargo = cargo("install --quiet --locked defmt-print@1.2.0");
    cargo.env("CARGO_PROFILE_RELEASE_OPT_LEVEL", "0").env("CARGO_PROFILE_RELEASE_LTO", "off");
    install(cargo)
}

/// Those of `targets` that rustup has not installed.
fn absent<'a>(targets: &[&'a str]) -> Vec<&'a str> {
    let installed = output(command("rustup", &["target", "list", "--installed"])).unwrap_or_default();
    targets.iter().copied().filter(|target| !installed.lines().any(|line| line == *target)).collect()
}

/// Toolchain that compiles images for `targets`, installed if it is missing.
pub fn toolchain(targets: &[&str]) -> Result<Toolchain> {
    // For trying the other way where rustup would do.
    let without_rustup = env::var_os("XTASK_WITHOUT_RUSTUP").is_some();
    if !without_rustup {
        if absent(targets).is_empty() {
            return Ok(Toolchain::Rustup);
        }
        let added = install(command("rustup", &[["target", "add"].as_slice(), targets].concat()));
        if added.is_ok() && absent(targets).is_empty() {
            return Ok(Toolchain::Rustup);
        }
        println!("rustup cannot add {} here; Debian's compiler will build for them", targets.join(", "));
    }
    if !has_debians_compiler() {
        apt_install(&["rustc-web", "cargo-web", "rust-web-src"], None)?;
    }
    let sysroot = output(command("rustc", &["--print", "sysroot"]))?;
    let host = output(command("rustc", &["-vV"]))?;
    let host = host.lines().find_map(|line| line.strip_prefix("host: ")).unwrap_or_default().to_owned();
    let linker = PathBuf::from(sysroot.trim()).join("lib/rustlib").join(host).join("bin");
    let old = env::var_os("PATH").unwrap_or_default();
    let path = env::join_paths(std::iter::once(linker).chain(env::split_paths(&old)))
        .map_err(|error| format!("PATH: {error}"))?;
    Ok(Toolchain::Debian { path })
}

/// Whether Debian's compiler is there, with the library's sources.
fn has_debians_compiler() -> bool {
    let sysroot = output(command("/usr/bin/rustc", &["--print", "sysroot"]));
    let has_sources = |sysroot: String| Path::new(sysroot.trim()).join("lib/rustlib/src/rust/library").exists();
    has("/usr/bin/cargo") && sysroot.is_ok_and(has_sources)
}

/// Boards that QEMU for Arm has to know.
const BOARDS: [&str; 3] = ["olimex-stm32-h405", "microbit", "mps2-an505"];

fn knows_the_boards() -> bool {
    let boards = output(command("qemu-system-arm", &["-M", "help"])).unwrap_or_default();
    BOARDS.iter().all(|board| boards.lines().any(|line| line.starts_with(board)))
}

/// Installs `packages`, from a further suite of the distribution if one is named, unless `what` is there.
fn need(what: &str, is_there: impl Fn() -> bool, packages: &[&str], further: Option<&str>) -> Result<()> {
    if !is_there() {
        apt_install(packages, further)?;
    }
    let missing = || format!("{what} is needed: install {} and run again", packages.join(" and "));
    is_there().then_some(()).ok_or_else(missing)
}

fn qemu() -> Result<()> {
    let what = format!("QEMU 10 or later with the boards {}", BOARDS.join(", "));
    // Debian 12 has it in its backports.
    let install = |further| need(&what, knows_the_boards, &["qemu-system-arm"], further);
    install(None).or_else(|_| install(Some("backports")))
}

/// Programs, each with the packages that have it.
pub type Programs<'a> = &'a [(&'a str, &'a [&'a str])];

/// The linker of Windows executables.
pub const WINDOWS_LINKER: Programs = &[("x86_64-w64-mingw32-gcc", &["gcc-mingw-w64-x86-64"])];
/// Wine, for the Windows executable.
pub const WINE: Programs = &[("wine", &["wine", "wine64"])];
/// The compiler for libFuzzer.
pub const CPP_COMPILER: Programs = &[("c++", &["g++"])];
/// Compiler and make for an FMU that is built anew.
pub const MAKE: Programs = &[("gcc", &["gcc", "libc6-dev"]), ("make", &["make"])];

/// Installs what is missing of these programs.
pub fn ensure(needed: Programs) -> Result<()> {
    needed.iter().try_for_each(|(program, packages)| need(program, || has(program), packages, None))
}

/// Installs what compiles the emitted C and runs it: gcc and clang with their sanitizers, cross-compilers for Cortex-M and RISC-V with their C
/// libraries, QEMU with boards of both.
pub fn c_compilers() -> Result<()> {
    ensure(CPP_COMPILER)?;
    // Clang's sanitizers are a package of their own.
    let sanitizes = || {
        let folder = output(command("clang", &["-print-runtime-dir"])).unwrap_or_default();
        has("clang++") && Path::new(folder.trim()).exists()
    };
    need("clang with its sanitizers", sanitizes, &["clang", "libclang-rt-dev"], None)?;
    ensure(&[
        ("arm-none-eabi-gcc", &["gcc-arm-none-eabi", "libnewlib-arm-none-eabi"]),
        ("riscv64-unknown-elf-gcc", &["gcc-riscv64-unknown-elf", "picolibc-riscv64-unknown-elf"]),
    ])?;
    qemu_for_both()
}

/// QEMU with boards of Cortex-M and of RISC-V.
pub fn qemu_for_both() -> Result<()> {
    qemu()?;
    // Of the release that QEMU for Arm is of: they share files. Older ones have it in another package.
    let install = |further| need("QEMU for RISC-V", || has("qemu-system-riscv32"), &["qemu-system-riscv"], further);
    install(None).or_else(|_| install(Some("backports")))
}

/// Octave, what builds MEX functions for it, and what draws without a window, installed if they are missing.
pub fn octave() -> Result<()> {
    ensure(CPP_COMPILER)?;
    // mkoctfile's headers, and what draws: packages of their own, which Debian's Octave only recommends. PNG takes gnuplot and Ghostscript.
    ensure(&[
        ("octave-cli", &["octave"]),
        ("mkoctfile", &["octave-dev"]),
        ("gnuplot", &["gnuplot-nox"]),
        ("gs", &["ghostscript"]),
    ])?;
    // Without its font Octave draws no axes.
    let draws = || {
        let script = ["--no-init-file", "--eval", "figure('visible', 'off'); plot(1:3); title('x'); exit(0)"];
        output(command("octave-cli", &script)).is_ok()
    };
    need("a font for Octave", draws, &["fonts-freefont-otf"], None)
}

/// A Python that makes environments, installed if it is missing.
pub fn python() -> Result<&'static str> {
    const PYTHON: &str = "python3";
    // Debian has what an environment needs in a package of its own.
    let program = "import ensurepip, venv, sys; assert sys.version_info >= (3, 11)";
    let makes_environments = || output(command(PYTHON, &["-c", program])).is_ok();
    need("Python 3.11 or newer with venv", makes_environments, &["python3", "python3-venv"], None)?;
    Ok(PYTHON)
}

/// A browser without a window, installed if it is missing: 300 MB with what it needs.
pub fn chromium() -> Result<&'static str> {
    let there = || ["chromium", "chromium-browser", "google-chrome"].into_iter().find(|name| has(name));
    need("a browser", || there().is_some(), &["chromium"], None)?;
    Ok(there().unwrap_or("chromium"))
}

/// Path of a program of cargo in this version, installed into target/tools if it is missing there. Not optimised: building it takes longer than all
/// that it does.
pub fn tool(name: &str, version: &str, options: &str) -> Result<PathBuf> {
    let tools = root().join("target").join("tools");
    let program = tools.join("bin").join(name);
    // Some do not know their version: cargo's own list does.
    let listed = read(&tools.join(".crates.toml")).unwrap_or_default();
    if !(program.exists() && listed.contains(&format!("\"{name} {version} "))) {
        let mut tool = cargo(&format!("install --quiet --debug --locked --force {options} {name}@{version} --root"));
        tool.arg(&tools).env("CARGO_PROFILE_DEV_DEBUG", "0");
        install(tool)?;
    }
    Ok(program)
}

fn has(program: &str) -> bool {
    output(command(program, &["--version"])).is_ok()
}

/// Installs packages, from a further suite of the distribution if one is named.
fn apt_install(packages: &[&str], further: Option<&str>) -> Result<()> {
    if !has("apt-get") {
        return Err(format!("{} must be installed by hand: there is no apt-get here", packages.join(", ")));
    }
    let suite = further.map(|name| format!("{}-{name}", codename()));
    if let Some(suite) = &suite {
        add_suite(suite)?;
    }
    install(as_root("apt-get", &["update", "-qq"]))?;
    let mut arguments = vec!["install", "-y", "-qq", "--no-install-recommends"];
    if let Some(suite) = &suite {
        arguments.extend(["-t", suite]);
    }
    arguments.extend(packages);
    let mut packages = as_root("apt-get", &arguments);
    packages.env("DEBIAN_FRONTEND", "noninteractive");
    install(packages)
}

fn as_root(program: &str, arguments: &[&str]) -> Command {
    let root = output(command("id", &["-u"])).is_ok_and(|id| id.trim() == "0");
    if root { command(program, arguments) } else { command("sudo", &[&[program], arguments].concat()) }
}

fn codename() -> String {
    let release = fs::read_to_string("/etc/os-release").unwrap_or_default();
    release.lines().find_map(|line| line.strip_prefix("VERSION_CODENAME=")).unwrap_or_default().trim_matches('"').into()
}

/// Adds a suite from the mirror that the distribution itself comes from.
fn add_suite(suite: &str) -> Result<()> {
    let known =
        output(command("apt-get", &["indextargets", "--format", "$(SUITE) $(CODENAME) $(REPO_URI) $(COMPONENT)"]))?;
    let fields: Vec<Vec<&str>> = known.lines().map(|line| line.split_whitespace().collect()).collect();
    if fields.iter().any(|line| line[..2].contains(&suite)) {
        return Ok(());
    }
    let base = codename();
    let mirror = fields
        .iter()
        .find(|line| line.len() == 4 && line[1] == base && line[3] == "main")
        .map(|line| line[2])
        .ok_or_else(|| format!("no mirror of {base} is known to apt; add the suite {suite} by hand"))?;
    // From a folder that is this user's own: a file in a shared one could be replaced before root reads it.
    let folder = root().join("target");
    fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let list = folder.join(format!("{suite}.list"));
    write(&list, &format!("deb {mirror} {suite} main\n"))?;
    install(as_root("cp", &[&list.to_string_lossy(), "/etc/apt/sources.list.d/"]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::process::entries;

    #[test]
    fn nothing_is_installed_against_an_answer_or_the_option() {
        let missing = ["QEMU".to_owned()];
        for answer in [None, Some("\n"), Some("Y\n"), Some("yes\n")] {
            assert_eq!(decide(&missing, true, answer), Ok(()), "{answer:?}");
        }
        assert!(decide(&missing, true, Some("n\n")).is_err());
        assert!(
            decide(&missing, false, None).is_err_and(|error| error.contains("QEMU") && error.contains("--no-install"))
        );
    }

    /// A file with a predictable name in a folder that all users write to could be another by the time that root reads it.
    #[test]
    fn nothing_is_installed_from_a_shared_folder() {
        let mut folders = vec![root().join("crates/xtask/src")];
        while let Some(folder) = folders.pop() {
            for entry in entries(&folder).expect("it is there") {
                if entry.is_dir() {
                    folders.push(entry);
                } else if !entry.ends_with("circles.rs") {
                    let text = fs::read_to_string(&entry).expect("a text");
                    let program = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
                    assert!(
                        !["temp_dir", "/tmp", "TMPDIR"].iter().any(|word| program.contains(word)),
                        "{}",
                        entry.display()
                    );
                }
            }
        }
    }

    /// Unstable features are for the crates of the compiler's own library, whatever the environment says.
    #[cfg(unix)]
    #[test]
    fn unstable_features_are_for_the_library_alone() {
        let compiler = Toolchain::Debian { path: OsString::new() }.cargo(Path::new("."), TARGETS[0], "build");
        let wrapper = compiler.get_envs().find_map(|(name, value)| value.filter(|_| name == "RUSTC"));
        let passed = |arguments: &str| {
            let mut wrapped = Command::new(wrapper.expect("it is set"));
            wrapped.args(arguments.split(' ')).env("DEBIANS_RUSTC", "echo");
            output(wrapped).expect("it runs").trim().to_owned()
        };
        assert_eq!(passed("--crate-name a"), "-Z allow-features= --crate-name a");
        assert_eq!(
            passed("--crate-name core -Z force-unstable-if-unmarked"),
            "--crate-name core -Z force-unstable-if-unmarked"
        );
    }

    /// Cut into small units, the image that may not panic does not link.
    #[test]
    fn no_image_is_built_incrementally() {
        for toolchain in [Toolchain::Rustup, Toolchain::Debian { path: OsString::new() }] {
            let cargo = toolchain.cargo(Path::new("."), TARGETS[0], "build");
            let off = ("CARGO_INCREMENTAL".as_ref(), Some("0".as_ref()));
            assert!(cargo.get_envs().any(|variable| variable == off), "{:?}", cargo.get_program());
        }
    }
}
