//! The parameters as a controller takes them, and a recording through the firmware's image where QEMU is there.

use crate::commands::prelude::*;
use crate::files::parameters::Parameters;
use crate::files::recording::Recording;
use crate::link::Emulator;
use crate::replay::memory::RunOptions;
use crate::simulation::processor::{FirmwareLaw, ProcessorTest, Task, TaskOptions};

/// Length of what the image steps, s: some seconds of QEMU.
const STEPPED_S: f64 = 10.0;

/// What the firmware's image made of the first recording.
#[derive(Serialize)]
pub(super) struct FirmwareRun {
    pub(super) firmware: String,
    pub(super) steps: usize,
    /// Steps with other bits than this host's.
    pub(super) mismatches: usize,
    pub(super) instructions_per_step: Option<f64>,
}

/// The run, or why there is none: this tool never builds or installs anything for a demo.
#[derive(Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Firmware {
    Ran(FirmwareRun),
    LeftOut(String),
}

/// The blob for a controller of the demo's rate.
pub(super) fn blob(parameters: &Parameters) -> Result<Vec<u8>> {
    Ok(parameters.checked_blob(RunOptions::default().rate_hz)?.0)
}

/// Steps the beginning of `recording` in the image that this project builds.
pub(super) fn run(parameters: &Parameters, recording: &Recording) -> Firmware {
    if !Emulator::is_installed() {
        return Firmware::LeftOut("QEMU is missing; cargo xtask setup installs it".into());
    }
    if !Emulator::default_image().is_file() {
        return Firmware::LeftOut("its image is not built; cargo xtask image does".into());
    }
    stepped(parameters, recording).map_or_else(|error| Firmware::LeftOut(with_flags(&error.to_string())), Firmware::Ran)
}

fn stepped(parameters: &Parameters, recording: &Recording) -> Result<FirmwareRun> {
    let rate_hz = RunOptions::default().rate_hz;
    let (blob, board) = parameters.checked_blob(rate_hz)?;
    let options = TaskOptions { law: FirmwareLaw::Step, plant: None, rate_hz, duration_s: Some(STEPPED_S) };
    let task = Task::from_recording(recording, &options, parameters.sensor())?;
    let bar = Progress::over(task.steps() as u64, "firmware in QEMU");
    let test = ProcessorTest::new(blob, board.id, bar.clone())?;
    let comparisons = test.in_emulator(Some(&Emulator::default_image()), &[task])?;
    bar.finish_and_clear();
    let cycles = comparisons.iter().flat_map(|comparison| &comparison.cycles).copied();
    let (count, sum) = cycles.fold((0_u32, 0.0), |(count, sum), cycles| (count + 1, sum + cycles));
    Ok(FirmwareRun {
        firmware: comparisons.first().map_or_else(String::new, |comparison| comparison.firmware.clone()),
        steps: comparisons.iter().map(|comparison| comparison.steps).sum(),
        mismatches: comparisons.iter().map(|comparison| comparison.mismatches).sum(),
        instructions_per_step: (count > 0).then(|| sum / f64::from(count) * 1e9 / Emulator::CLOCK_HZ),
    })
}
