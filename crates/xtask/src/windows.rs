//! The Windows executable under Wine, beside the tool of this system.

use std::fs;
use std::process::Command;

use crate::process::{Result, at, cargo, make, output, root, run as run_command, write};
use crate::{release, setup};

/// The same figures in a folder with blanks and umlauts, files with Windows' line ends, the name of a port, and a console of a code page.
pub fn run() -> Result<()> {
    setup::wine()?;
    let exe = release::windows()?;
    run_command(cargo("build --release --package host-sim --bin springpot"))?;
    let tool = root().join("target").join("release").join("springpot");
    let folder = root().join("target").join("faces").join("windows").join("Messung für Ärmel");
    make(&folder)?;
    let wine = |arguments: &[&str]| {
        let mut command = Command::new("wine");
        command.arg(&exe).args(arguments).current_dir(&folder);
        command.env("WINEDEBUG", "-all").env("LC_ALL", "C.UTF-8").env("NO_COLOR", "1");
        command
    };
    let native = |arguments: &[&str]| {
        let mut command = Command::new(&tool);
        command.args(arguments).current_dir(&folder);
        command
    };
    let recording = root().join("tests/recordings/hossain-5s.csv");
    let text = fs::read_to_string(&recording).map_err(at(&recording))?.replace('\n', "\r\n");
    write(&folder.join("Aufnahme größer.csv"), &text)?;
    let commands: [&[&str]; 4] = [
        &["replay", "--params", "preset:table3-n2", "Aufnahme größer.csv", "--json"],
        &[
            "simulate",
            "--params",
            "preset:table3-n2",
            "--profile",
            "Aufnahme größer.csv",
            "--out",
            "Antwort für dich.csv",
        ],
        &[
            "reference",
            "--shape",
            "sine",
            "--low",
            "1mm",
            "--high",
            "2mm",
            "--period",
            "10s",
            "--duration",
            "20s",
            "--out",
            "r.csv",
        ],
        &[
            "fit",
            "Aufnahme größer.csv",
            "--branches",
            "1",
            "--topology",
            "parallel",
            "--curve",
            "none",
            "--out",
            "Film.toml",
        ],
    ];
    for arguments in commands {
        let same = |text: String| text.replace("\r\n", "\n").lines().map(without_time).collect::<Vec<_>>();
        let (one, other) = (same(output(native(arguments))?), same(output(wine(arguments))?));
        if one != other {
            return Err(format!("{arguments:?} differs:\n{}\n{}", one.join("\n"), other.join("\n")));
        }
        println!("the same under Wine: {}", arguments[0]);
    }
    // The demo, by its table of figures.
    let one = output(native(&["demo", "--json", "--out", "demo"]))?;
    let other = output(wine(&["demo", "--json", "--out", "demo für Windows"]))?;
    let figures = |text: &str| {
        text.split(['{', ',', '}'])
            .filter(|part| part.starts_with("\"tracking_rms_pct\""))
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    if figures(&one).is_empty() || figures(&one) != figures(&other) {
        return Err(format!("the demo differs: {:?} and {:?}", figures(&one), figures(&other)));
    }
    println!("the same under Wine: demo, {} figures", figures(&one).len());
    let refused = wine(&["link", "--port", "COM3", "identify"]).output().map_err(|error| error.to_string())?;
    let message = String::from_utf8_lossy(&refused.stderr);
    if refused.status.code() != Some(2) || !message.contains("COM3") {
        return Err(format!("COM3: {} {message}", refused.status));
    }
    println!("COM3 is a port name under Wine: {}", message.trim());
    // A console without UTF-8.
    let mut console = wine(&["check", "Aufnahme größer.csv"]);
    console.env("LC_ALL", "C");
    let status = console.output().map_err(|error| error.to_string())?.status;
    if status.code().is_none_or(|code| code > 2) { Err(format!("a console without UTF-8: {status}")) } else { Ok(()) }
}

/// A line without the time that something took.
fn without_time(line: &str) -> String {
    line.split_whitespace().filter(|word| !word.contains("seconds")).collect::<Vec<_>>().join(" ")
}
