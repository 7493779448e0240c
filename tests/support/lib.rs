//! Shared parts of the tests: models to try, and the paper's drive.

/// The driver's bench, as its own tests have it.
#[path = "../../crates/dea-driver/tests/driver/bench.rs"]
pub mod bench;
#[path = "../../crates/springpot/tests/it/support/defining_sum.rs"]
pub mod defining_sum;
#[path = "../../crates/springpot/tests/it/support/models.rs"]
mod models;
mod recordings;
#[path = "../../crates/springpot/tests/it/support/sweep.rs"]
pub mod sweep;
pub mod table;
pub mod tool;
pub mod transcript;
pub mod virtual_board;

pub use models::{hard_models, paper_force, presets, random_models};
pub use recordings::{recordings, thinned_recordings};

/// CRC-32 (ISO-HDLC), bit by bit.
pub fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
    })
}
