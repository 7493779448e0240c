//! Messages of commands, their exit statuses, and the files in their folder: `cases/*.trycmd`, each beside its input files.
//! What `sh` and `sed` of Linux make of their files is a part of them.
//! `TRYCMD=overwrite cargo test -p tests --test command_line cases` writes what they print now.

use std::path::Path;

use crate::TOOL;

#[cfg(target_os = "linux")]
#[test]
fn commands_print_what_is_written() {
    trycmd::TestCases::new()
        .register_bin("springpot", Path::new(TOOL.0))
        .register_bin("cmp", Path::new("/usr/bin/cmp"))
        .register_bin("ls", Path::new("/bin/ls"))
        .register_bin("sh", Path::new("/bin/sh"))
        .env("RECORDINGS", concat!(env!("CARGO_MANIFEST_DIR"), "/recordings"))
        .env("LAB_FILES", concat!(env!("CARGO_MANIFEST_DIR"), "/lab_files"))
        .env("HOST_SIM_PROGRESS_S", "86400")
        .env("LC_ALL", "C")
        .case("command_line/cases/*.trycmd");
}
