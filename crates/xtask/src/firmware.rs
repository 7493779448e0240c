//! The firmware: its images, and the tests that run them in QEMU.

use std::fs;
use std::path::{Path, PathBuf};

use crate::process::{Result, at, cargo, output, root, run as run_command};
use crate::setup::{TARGETS, Toolchain, built};

/// An image: the program in `firmware`, what it is for, and the options of its build.
pub struct Image {
    pub program: &'static str,
    what: &'static str,
    pub options: &'static str,
}

const F4: &str = "--no-default-features --features stm32f4";
const G4: &str = "--no-default-features --features stm32g4";
/// The images for boards, with the names of the boards in a release.
pub const BOARDS: [(Image, &str); 3] = [
    (Image { program: "firmware", what: "an STM32-H405", options: F4 }, "stm32f405"),
    (Image { program: "stm32f407-discovery", what: "an STM32F4DISCOVERY", options: F4 }, "stm32f407-discovery"),
    (Image { program: "nucleo-g474re", what: "a NUCLEO-G474RE", options: G4 }, "nucleo-g474re"),
];
const F4_SENSED: &str = "--no-default-features --features stm32f4,self-sensing";
/// The same with a channel of the current.
const SENSED: [Image; 3] = [
    Image { program: "firmware", what: "an STM32-H405 with a current", options: F4_SENSED },
    Image { program: "stm32f407-discovery", what: "an STM32F4DISCOVERY with a current", options: F4_SENSED },
    Image {
        program: "nucleo-g474re",
        what: "a NUCLEO-G474RE with a current",
        options: "--no-default-features --features stm32g4,self-sensing",
    },
];
const QEMU: Image = Image { program: "qemu", what: "QEMU", options: "" };
const VIRTUAL_BOARD: Image = Image { program: "virtual-board", what: "the virtual board", options: F4_SENSED };

/// Builds the image that runs in QEMU: what `springpot pil` starts.
pub fn image(toolchain: &Toolchain) -> Result<()> {
    build(toolchain, &QEMU).map(drop)
}

/// Builds the image of the virtual board, and returns where it is.
pub fn virtual_board(toolchain: &Toolchain) -> Result<PathBuf> {
    build(toolchain, &VIRTUAL_BOARD)
}

/// The lints of all images.
pub fn lint(toolchain: &Toolchain) -> Result<()> {
    for image in BOARDS.iter().map(|(image, _)| image).chain(&SENSED).chain([&QEMU, &VIRTUAL_BOARD]) {
        toolchain.lint(&folder(), TARGETS[0], &format!("--bin {} {}", image.program, image.options))?;
    }
    Ok(())
}

/// Builds all images. The linker fails beyond their budget of flash and RAM.
pub fn images(toolchain: &Toolchain) -> Result<()> {
    build(toolchain, &QEMU)?;
    let virtual_board = build(toolchain, &VIRTUAL_BOARD)?;
    // Those with a current are linted, and as large as one of them. Of two images of one name that without it is the one that stays.
    for board in SENSED[..1].iter().chain(BOARDS.iter().map(|(board, _)| board)) {
        no_virtual_bench_on_a_board(&build(toolchain, board)?, &virtual_board)?;
    }
    Ok(())
}

/// The image for a board does not contain the virtual bench, which would drive no pins and report a film that is not there. Its log has a line
/// that the image of the virtual board contains.
fn no_virtual_bench_on_a_board(board: &Path, virtual_board: &Path) -> Result<()> {
    const LINE: &[u8] = b"a simulated film instead of pins and converters";
    let contains = |image: &Path| -> Result<bool> {
        let bytes = fs::read(image).map_err(at(image))?;
        Ok(bytes.windows(LINE.len()).any(|window| window == LINE))
    };
    match (contains(board)?, contains(virtual_board)?) {
        (false, true) => {
            println!("the image for a board does not contain the virtual bench");
            Ok(())
        }
        (true, _) => Err(format!("{}: it contains the virtual bench", board.display())),
        (_, false) => Err(format!("{}: it does not contain the virtual bench", virtual_board.display())),
    }
}

/// Builds all images and runs their tests in QEMU.
pub fn run(toolchain: &Toolchain) -> Result<()> {
    images(toolchain)?;
    // With the features of the whole workspace, as `cargo xtask test` builds them: nothing is built twice.
    run_command(cargo("test --quiet --workspace --features tests/qemu --test firmware"))
}

/// Builds an image, and returns where it is.
fn build(toolchain: &Toolchain, image: &Image) -> Result<PathBuf> {
    let build = format!("build --quiet --release --bin {} {}", image.program, image.options);
    output(toolchain.cargo(&folder(), TARGETS[0], &build))?;
    println!("the image for {} is built, within its budget", image.what);
    Ok(built().join(TARGETS[0]).join("release").join(image.program))
}

/// Where the images are.
pub fn folder() -> PathBuf {
    root().join("firmware")
}
