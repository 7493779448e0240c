//! `docs/start.md`: the first ten minutes, as they are written.

use std::fs;
use std::path::Path;
use std::process::Command;

use tempfile::TempDir;
use tests::transcript::{Shown, depends_on_qemu, same, shown};

use crate::TOOL;

/// Every command of the page in its order in one folder, each with its answer.
#[test]
fn ten_minutes_go_as_written() {
    let page = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/start.md")).expect("readable");
    let folder = TempDir::new().expect("a folder");
    let shown = shown(&page);
    assert!(shown.len() >= 9, "{} commands", shown.len());
    for Shown { command, answer } in &shown {
        let line = match command.strip_prefix("springpot ") {
            Some(arguments) => format!("'{}' {arguments}", TOOL.0),
            None => command.clone(),
        };
        let output = Command::new("sh").args(["-c", &line]).current_dir(&folder).output().expect("runs");
        let (printed, complained) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        assert!(output.status.success(), "{command}: {complained}");
        let found: Vec<&str> = printed.lines().filter(|line| !depends_on_qemu(line)).collect();
        let wanted: Vec<&String> = answer.iter().filter(|line| !depends_on_qemu(line)).collect();
        assert_eq!(found.len(), wanted.len(), "{command}: {printed}");
        for (found, wanted) in found.iter().zip(wanted) {
            assert!(same(found, wanted), "{command}\n{found}\n{wanted}");
        }
    }
    // What the page says to open is there.
    for file in ["demo/report.html", "film.html", "voltage.html", "following.html"] {
        let page = fs::read_to_string(folder.path().join(file)).expect("written");
        assert!(page.contains("</html>"), "{file}");
    }
}
