//! Messages of commands, their exit statuses, and the files in their folder: `cases/*.trycmd`, each beside its input files.
//! `TRYCMD=overwrite cargo test -p tests --test command_line cases` writes what they print now.

use std::path::Path;

use crate::TOOL;

#[cfg(unix)]
#[test]
fn commands_print_what_is_written() {
    trycmd::TestCases::new()
        .register_bin("host-sim", Path::new(TOOL.0))
        .register_bin("ls", Path::new("/bin/ls"))
        .env("HOST_SIM_PROGRESS_S", "86400")
        .env("LC_ALL", "C")
        .case("command_line/cases/*.trycmd");
}
