//! The Windows executable under Wine, beside the tool of this system.

use std::path::Path;
use std::process::Command;

use crate::process::{Result, cargo, command, make, output, read, root, run as run_command, write};
use crate::{release, setup};

/// The same figures in a folder with blanks and umlauts, files with Windows' line ends, the name of a port, and a console of a code page.
pub fn run() -> Result<()> {
    setup::ensure(setup::WINE)?;
    let exe = release::windows()?;
    random_numbers(&exe)?;
    run_command(cargo("build --release --package host-sim --bin springpot"))?;
    let tool = root().join("target").join("release").join("springpot");
    let folder = root().join("target").join("faces").join("windows").join("Messung für Ärmel");
    make(&folder)?;
    // The words of a line, then arguments that may have blanks.
    let with = |mut program: Command, line: &str, more: &[&str]| {
        program.args(line.split_whitespace()).args(more).current_dir(&folder);
        program
    };
    let native = |line: &str, more: &[&str]| with(Command::new(&tool), line, more);
    let wine = |line: &str, more: &[&str]| {
        let mut wine = Command::new("wine");
        wine.arg(&exe).env("WINEDEBUG", "-all").env("LC_ALL", "C.UTF-8").env("NO_COLOR", "1");
        with(wine, line, more)
    };
    let recording = root().join("tests/recordings/hossain-5s.csv");
    let text = read(&recording)?.replace('\n', "\r\n");
    write(&folder.join("Aufnahme größer.csv"), &text)?;
    let commands: [(&str, &[&str]); 3] = [
        ("replay --params preset:table3-n2", &["Aufnahme größer.csv"]),
        ("simulate --params preset:table3-n2 --profile", &["Aufnahme größer.csv", "--out", "Antwort für dich.csv"]),
        ("reference --shape sine --low 1mm --high 2mm --period 10s --duration 20s --out r.csv", &[]),
    ];
    for (line, more) in commands {
        let same = |text: String| text.replace("\r\n", "\n").lines().map(str::to_owned).collect::<Vec<_>>();
        let (one, other) = (same(output(native(line, more))?), same(output(wine(line, more))?));
        if one != other {
            return Err(format!("{line} {more:?} differs:\n{}\n{}", one.join("\n"), other.join("\n")));
        }
        println!("the same under Wine: {}", line.split(' ').next().unwrap_or_default());
    }
    // The demo, by its table of figures.
    let one = output(native("demo --json --out demo", &[]))?;
    let other = output(wine("demo --json --out", &["demo für Windows"]))?;
    let figures = |text: &str| -> Vec<f64> {
        let values = text.split(['{', ',', '}']).filter_map(|part| part.strip_prefix("\"nrmse_pct\":"));
        values.filter_map(|value| value.parse().ok()).collect()
    };
    let (one, other) = (figures(&one), figures(&other));
    // The two systems' functions differ in the last digits, and so do the ends of the searches; three digits are printed.
    let is_same = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-5 * a.abs();
    if one.is_empty() || one.len() != other.len() || !one.iter().zip(&other).all(is_same) {
        return Err(format!("the demo differs: {one:?} and {other:?}"));
    }
    println!("the same under Wine: demo, {} figures", one.len());
    let refused = wine("link --port COM3 identify", &[]).output().map_err(|error| error.to_string())?;
    let message = String::from_utf8_lossy(&refused.stderr);
    if refused.status.code() != Some(2) || !message.contains("COM3") {
        return Err(format!("COM3: {} {message}", refused.status));
    }
    println!("COM3 is a port name under Wine: {}", message.trim());
    // A console without UTF-8, in a folder whose name it has letters for.
    let mut console = wine("replay --params preset:table3-n2 tests/recordings/hossain-5s.csv", &[]);
    console.env("LC_ALL", "C").current_dir(root());
    output(console).map(drop)
}

/// Puts a library beside the executable that Windows has and Wine 8 lacks: Rust's library takes random numbers from it.
fn random_numbers(exe: &Path) -> Result<()> {
    const SOURCE: &str = "__declspec(dllimport) unsigned char __stdcall SystemFunction036(void *, unsigned long);\n\
        __declspec(dllexport) int __stdcall ProcessPrng(unsigned char *data, unsigned long long length)\n\
        {\n    return SystemFunction036(data, (unsigned long)length);\n}\n";
    let (source, library) = (exe.with_file_name("random.c"), exe.with_file_name("bcryptprimitives.dll"));
    write(&source, SOURCE)?;
    let (source, library) = (source.to_string_lossy(), library.to_string_lossy());
    run_command(command("x86_64-w64-mingw32-gcc", &["-shared", "-O1", "-o", &library, &source, "-ladvapi32"]))
}
