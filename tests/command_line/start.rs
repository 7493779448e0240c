//! `docs/start.md`: the first ten minutes, as they are written.

use std::fs;
use std::path::Path;
use std::process::Command;

use tempfile::TempDir;
use tests::transcript::{Shown, shown, words};

use crate::TOOL;

/// Every command of the page in its order in one folder, each with its answer: word by word, numbers apart.
#[test]
fn ten_minutes_go_as_written() {
    let page = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/start.md")).expect("readable");
    let folder = TempDir::new().expect("a folder");
    let shown = shown(&page);
    assert!(shown.len() >= 9, "{} commands", shown.len());
    for Shown { command, answer } in &shown {
        let line = match command.strip_prefix("host-sim ") {
            Some(arguments) => format!("'{}' {arguments}", TOOL.0),
            None => command.clone(),
        };
        let output = Command::new("sh").args(["-c", &line]).current_dir(&folder).output().expect("runs");
        let (said, complained) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert!(output.status.success(), "{command}: {complained}");
        // Whether QEMU and the image are there is the machine's matter.
        let stays = |line: &&str| !line.starts_with("the firmware");
        let found: Vec<_> = said.lines().filter(stays).map(words).collect();
        let wanted: Vec<_> = answer.iter().map(String::as_str).filter(stays).map(words).collect();
        assert_eq!(found, wanted, "{command}");
    }
    // What the page says to open is there.
    for file in ["demo/report.html", "film.html", "voltage.html", "following.html"] {
        let page = fs::read_to_string(folder.path().join(file)).expect("written");
        assert!(page.contains("</html>"), "{file}");
    }
}
