//! Prints the words of a folder or file that should be others: `cargo run -p documents --bin words -- docs`.

use documents::words::{findings, within};

fn main() -> Result<(), String> {
    let folder = std::env::args().nth(1).unwrap_or_default();
    let (findings, _) = findings()?;
    let findings: Vec<_> = findings.iter().filter(|found| folder.is_empty() || within(&found.path, &folder)).collect();
    for finding in &findings {
        println!("{finding}");
    }
    match findings.len() {
        0 => Ok(()),
        count => Err(format!("{count} words")),
    }
}
