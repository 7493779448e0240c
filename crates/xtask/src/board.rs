//! The virtual board: the firmware in QEMU with a simulated film, at a port that springpot talks to.

use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::path::PathBuf;
use std::process::Stdio;

use crate::firmware;
use crate::process::{Result, command};
use crate::setup;

/// The port that the documents name.
const PORT: u16 = 4050;
/// How the image ends its start.
const READY: &str = "waits for parameters";
/// Commands to type next, as in firmware/README.md. TOOL is host-sim, LINK is its `link` at the port.
const NEXT: [&str; 9] = [
    "LINK upload --params preset:table3-n2 --bench --try",
    "LINK status",
    "LINK self-test",
    r"printf 'time_s,voltage_v\n0,0\n0.5,3000\n1,0\n' > ramp.csv",
    "LINK play ramp.csv --out ramp-log.csv",
    "TOOL reference --shape sine --low 0.2e-3 --high 0.8e-3 --period 1.5 --duration 3 --out sine.csv",
    "LINK play sine.csv --mode tracking --out sine-log.csv",
    "LINK stream --duration 0.5 --out stream.csv",
    "LINK drill",
];

/// Builds the image unless one is given, starts it, and says what to type next. Ends with QEMU, or at Ctrl-C.
pub fn run(port: Option<u16>, image: Option<PathBuf>) -> Result<()> {
    let image = match image {
        Some(image) if image.is_file() => image,
        Some(image) => return Err(format!("{}: there is no such image", image.display())),
        None => firmware::virtual_board(&setup::run()?)?,
    };
    let port = port.map_or_else(free_port, Ok)?;
    let mut emulator = command("sh", &["firmware/emulate.sh"]);
    emulator.arg(&image).env("LINK_PORT", port.to_string()).stdin(Stdio::null()).stdout(Stdio::piped());
    let failed = |error| format!("firmware/emulate.sh: {error}");
    let mut child = emulator.spawn().map_err(failed)?;
    let log = child.stdout.take().ok_or("the log has no way out")?;
    let mut is_ready = false;
    for line in BufReader::new(log).lines() {
        let line = line.map_err(failed)?;
        println!("{line}");
        if !is_ready && line.ends_with(READY) {
            is_ready = true;
            println!("{}", next(port));
        }
    }
    let ended = child.wait().map_err(failed)?;
    match (is_ready, ended.success()) {
        (true, true) => Ok(()),
        (true, false) => Err(format!("the virtual board ended: {ended}")),
        (false, _) => Err(format!("the virtual board did not start at port {port}")),
    }
}

/// The port of the documents, or another one if that is taken.
fn free_port() -> Result<u16> {
    let free = |port: u16| TcpListener::bind(("127.0.0.1", port)).and_then(|listener| listener.local_addr());
    let address = free(PORT).or_else(|_| free(0)).map_err(|error| format!("no free port: {error}"))?;
    Ok(address.port())
}

/// The commands for another terminal.
fn next(port: u16) -> String {
    let tool = "cargo run --release -p host-sim --";
    let link = format!("{tool} link --port tcp:127.0.0.1:{port}");
    let lines = NEXT.map(|line| format!("  {}\n", line.replace("TOOL", tool).replace("LINK", &link)));
    format!(
        "\nThe virtual board listens at tcp:127.0.0.1:{port}. Ctrl-C here ends it. In another terminal:\n\n{}",
        lines.concat()
    )
}
