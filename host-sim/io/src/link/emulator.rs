//! The firmware in QEMU, linked by TCP.

use std::env;
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use super::Port;
use crate::error::{Error, Result};
use crate::interrupt::Child;

/// Name of the emulator.
const QEMU: &str = "qemu-system-arm";
/// How long it may take to start, and its image to answer, on a machine that is busy with other work. It rarely takes as long
/// as that for an emulator that has ended: its connection is gone then.
const PATIENCE: Duration = Duration::from_secs(120);
/// QEMU's arguments for this image, which `firmware/emulate.sh` passes as well.
const ARGUMENTS: &str = include_str!("../../../../firmware/qemu.args");

/// A running image; ends with this value.
#[derive(Debug)]
pub struct Emulator {
    _child: Child,
}

impl Emulator {
    /// The processor's clock in QEMU, Hz. With a nanosecond to every instruction, a cycle of it is 1e9 / this of them.
    pub const CLOCK_HZ: f64 = 168e6;

    /// Starts `image` and returns its link.
    ///
    /// # Errors
    ///
    /// [`Error::Link`] for a QEMU that is missing or does not start, [`Error::File`] for an image that is not there.
    pub fn start(image: &Path) -> Result<(Self, Port)> {
        let fault = |cause: String| Error::Link { port: QEMU.into(), cause };
        if !image.is_file() {
            return Err(Error::file(image, "no image: build it with cargo xtask image"));
        }
        let mut magic = [0; 4];
        let read = File::open(image).and_then(|mut file| file.read_exact(&mut magic));
        if read.is_err() || magic != *b"\x7fELF" {
            let cause = "this is no image: an ELF file is needed, such as cargo xtask image builds";
            return Err(Error::file(image, cause));
        }
        // QEMU connects to us, so that no port has to be guessed.
        let listener = TcpListener::bind(("127.0.0.1", 0)).map_err(|e| fault(e.to_string()))?;
        let address = listener.local_addr().map_err(|e| fault(e.to_string()))?;
        let child = Command::new(QEMU)
            .args(ARGUMENTS.split_whitespace())
            .args(["-serial", &format!("tcp:{address},nodelay=on"), "-kernel"])
            .arg(image)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|e| fault(format!("{e}; cargo xtask setup installs it")))?;
        let child = Child::new(child);
        listener.set_nonblocking(true).map_err(|e| fault(e.to_string()))?;
        let start = Instant::now();
        loop {
            match listener.accept() {
                Ok((stream, _)) => {
                    stream.set_nonblocking(false).map_err(|e| fault(e.to_string()))?;
                    return Ok((Self { _child: child }, Port::over_tcp(QEMU, stream, PATIENCE)?));
                }
                Err(e) if e.kind() == ErrorKind::WouldBlock => {}
                Err(e) => return Err(fault(e.to_string())),
            }
            if child.has_ended() || start.elapsed() > PATIENCE {
                let mut printed = String::new();
                if let Some(mut stderr) = child.end() {
                    // The output so far is enough.
                    let _ = stderr.read_to_string(&mut printed);
                }
                let printed = printed.lines().next().unwrap_or("it printed nothing").to_owned();
                return Err(fault(format!("it does not start: {printed}; version 10 or later is needed")));
            }
            thread::sleep(Duration::from_millis(5));
        }
    }

    /// Whether QEMU is there.
    pub fn is_installed() -> bool {
        let mut version = Command::new(QEMU);
        version.arg("-version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        version.status().is_ok_and(|status| status.success())
    }

    /// The image that this repository builds.
    pub fn default_image() -> PathBuf {
        root().unwrap_or_default().join("firmware/target/thumbv7em-none-eabihf/release/qemu")
    }

    /// Brings that image up to date.
    pub fn build_image() -> Result<()> {
        let fault = |cause: String| Error::Link { port: "firmware".into(), cause };
        let project =
            root().ok_or_else(|| fault("no project here to build it from; name an image with `image`".into()))?;
        let output = Command::new("cargo")
            .args(["xtask", "image"])
            .current_dir(&project)
            .stdin(Stdio::null())
            .output()
            .map_err(|e| fault(format!("cargo: {e}; name an image with `image`")))?;
        if output.status.success() {
            return Ok(());
        }
        let printed = String::from_utf8_lossy(&output.stderr);
        let cause =
            printed.lines().rev().find(|line| line.contains("error") || line.starts_with("xtask")).unwrap_or_default();
        Err(fault(format!("it does not build ({cause}); run cargo xtask image in {}", project.display())))
    }
}

/// The project around this program or around the current folder; a path in the program would differ from folder to folder.
fn root() -> Option<PathBuf> {
    let starts = [env::current_exe(), env::current_dir()].into_iter().flatten();
    let mut folders = starts.flat_map(|start| start.ancestors().map(PathBuf::from).collect::<Vec<_>>());
    folders.find(|folder| folder.join("firmware/qemu.args").is_file())
}
