//! The example firmware for boards that are not the project's: in QEMU and on this host, with the same bits and as its page states.

use documents::Documents;

use crate::process::{Result, cargo, command, output, root, run as run_command};
use crate::setup::Toolchain;

const FOLDER: &str = "crates/dea-driver/examples/other-board";

/// What the film may be from the sine, µm: a fortieth of its 400 µm from peak to peak. Without a sensor the film, which pulls 3 % harder
/// than its model, would be 18 to 24 µm from it.
const LARGEST_UM: f64 = 10.0;

/// In tick 7000 the monitor does not answer: 0 V in the same tick.
const TRIP: &str = "tick, cause, enable and code of the trip: Some((7000, Bus, false, 0))";
const END: &str = "at the end: enable false, code 0, 0.0 V";

/// Builds the example for these targets and for this host, and runs it.
pub fn run(toolchain: &Toolchain, targets: &[&str]) -> Result<()> {
    let folder = root().join(FOLDER);
    // With what the images for the chips are built with, which need the same macros.
    let built = root().join("tests/embedded/target");
    let mut format = cargo(&["fmt", "--check"]);
    format.current_dir(&folder);
    run_command(format)?;
    let tuple = output(command("rustc", &["--print", "host-tuple"]))?;
    let mut host = cargo(&["run", "--quiet", "--release", "--locked", "--target", tuple.trim()]);
    host.current_dir(&folder).env("CARGO_TARGET_DIR", &built);
    let on_host = output(host)?;
    let furthest_um = judge(&on_host)?;
    let stated_um = Documents::read()?.number(&["furthest from the sine, µm"], "measured");
    if stated_um != Some(furthest_um) {
        return Err(format!("the example is {furthest_um} µm from the sine, docs/own-board.md states {stated_um:?}"));
    }
    for target in targets {
        let in_folder = |arguments: &[&str]| {
            let mut command = toolchain.cargo(&folder, target, arguments);
            command.env("CARGO_TARGET_DIR", &built);
            command
        };
        if matches!(toolchain, Toolchain::Rustup) {
            run_command(in_folder(&["clippy", "--quiet", "--release", "--locked", "--", "-D", "warnings"]))?;
        }
        let printed = output(in_folder(&["run", "--quiet", "--release", "--locked"]))?;
        if printed != on_host {
            return Err(format!("{target}: the example printed\n{printed}and on this host\n{on_host}"));
        }
        println!("{target}: the example follows its sine, trips and ends at 0 V with the bits of this host");
    }
    Ok(())
}

/// How far from the sine the film was (µm), if the rest is as it must be.
fn judge(printed: &str) -> Result<f64> {
    let wrong = |what: &str| Err(format!("the example for other boards: {what}; it printed\n{printed}"));
    let lines: Vec<&str> = printed.lines().collect();
    let [sine, trip, end, _bits] = lines.as_slice() else { return wrong("not four lines") };
    let furthest = sine.strip_prefix("furthest from the sine: ").and_then(|rest| rest.strip_suffix(" um"));
    let Some(furthest_um) = furthest.and_then(|number| number.parse::<f64>().ok()) else {
        return wrong("no distance from the sine");
    };
    if !(furthest_um > 0.0 && furthest_um <= LARGEST_UM) {
        return wrong(&format!("more than {LARGEST_UM} µm from the sine"));
    }
    match (*trip == TRIP, *end == END) {
        (true, true) => Ok(furthest_um),
        (false, _) => wrong(&format!("not {TRIP:?}")),
        (true, false) => wrong(&format!("not {END:?}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn printed(furthest: &str, trip: &str, end: &str) -> String {
        format!("furthest from the sine: {furthest} um\n{trip}\n{end}\nbits: 0123456789abcdef\n")
    }

    #[test]
    fn a_run_that_went_wrong_is_refused() {
        assert_eq!(judge(&printed("4.25", TRIP, END)), Ok(4.25));
        let late = TRIP.replace("7000", "7001");
        let live = END.replace("0.0 V", "0.1 V");
        for (text, cause) in [
            (printed("10.01", TRIP, END), "more than 10 µm"),
            (printed("NaN", TRIP, END), "more than 10 µm"),
            (printed("far", TRIP, END), "no distance"),
            (printed("4.25", &late, END), "Some((7000"),
            (printed("4.25", TRIP, &live), "not \"at the end"),
            ("refused: damaged\n".into(), "not four lines"),
        ] {
            let error = judge(&text).err();
            assert!(error.as_ref().is_some_and(|error| error.contains(cause)), "{text}: {error:?}");
        }
    }
}
