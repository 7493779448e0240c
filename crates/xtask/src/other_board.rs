//! The example firmware for boards that are not the project's: in QEMU and on this host, with the bits that its page states.

use std::path::PathBuf;

use crate::process::{Result, cargo, command, format, output, read, root};
use crate::setup::{OTHER_TARGETS, Toolchain, built};

/// The output of the example is here.
const PAGE: &str = "docs/own-board.md";

/// Largest distance of the film from the sine, µm: a fortieth of its 400 µm from peak to peak. Without a sensor the film, which pulls 3 % harder
/// than its model, would be 18 to 24 µm from it.
const MAX_ERROR_UM: f64 = 10.0;

/// In tick 7000 the monitor does not answer: 0 V in the same tick.
const TRIP: &str = "tick, cause, enable and code of the trip: Some((7000, Bus, false, 0))";
const END: &str = "at the end: enable false, code 0, 0.0 V";

/// Builds the example for the Cortex-M33 and runs it: it does what it must and prints what its page states.
pub fn on_cortex_m33(toolchain: &Toolchain) -> Result<()> {
    format(&folder())?;
    on_chip(toolchain, OTHER_TARGETS[0])
}

/// The same on every core that it knows and as a program of this host, with its lints.
pub fn everywhere(toolchain: &Toolchain) -> Result<()> {
    on_cortex_m33(toolchain)?;
    on_chip(toolchain, OTHER_TARGETS[1])?;
    let tuple = output(command("rustc", &["--print", "host-tuple"]))?;
    let mut host = cargo(&format!("run --quiet --release --locked --target {}", tuple.trim()));
    host.current_dir(folder()).env("CARGO_TARGET_DIR", built());
    judge("this host", &output(host)?)?;
    OTHER_TARGETS.iter().try_for_each(|target| toolchain.lint(&folder(), target, "--locked"))
}

fn on_chip(toolchain: &Toolchain, target: &str) -> Result<()> {
    judge(target, &output(toolchain.cargo(&folder(), target, "run --quiet --release --locked"))?)
}

fn folder() -> PathBuf {
    root().join("crates/dea-driver/examples/other-board")
}

fn judge(place: &str, printed: &str) -> Result<()> {
    let refused = |error: String| format!("the example for other boards, on {place}: {error}; it printed\n{printed}");
    went_well(printed).map_err(refused)?;
    let page = read(&root().join(PAGE))?;
    if !page.contains(&format!("```text\n{printed}```\n")) {
        return Err(refused(format!("not what {PAGE} states")));
    }
    println!("{place}: the example follows its sine, trips and ends at 0 V, with the bits that its page states");
    Ok(())
}

/// Checks that the film was near the sine, and trip and end are as they must be.
fn went_well(printed: &str) -> Result<()> {
    let lines: Vec<&str> = printed.lines().collect();
    let [sine, trip, end, _bits] = lines.as_slice() else { return Err("not four lines".into()) };
    let furthest = sine.strip_prefix("furthest from the sine: ").and_then(|rest| rest.strip_suffix(" um"));
    let Some(furthest_um) = furthest.and_then(|number| number.parse::<f64>().ok()) else {
        return Err("no distance from the sine".into());
    };
    if !(furthest_um > 0.0 && furthest_um <= MAX_ERROR_UM) {
        return Err(format!("more than {MAX_ERROR_UM} µm from the sine"));
    }
    match (*trip == TRIP, *end == END) {
        (true, true) => Ok(()),
        (false, _) => Err(format!("not {TRIP:?}")),
        (true, false) => Err(format!("not {END:?}")),
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
        assert_eq!(went_well(&printed("4.25", TRIP, END)), Ok(()));
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
            let error = went_well(&text).err();
            assert!(error.as_ref().is_some_and(|error| error.contains(cause)), "{text}: {error:?}");
        }
    }
}
