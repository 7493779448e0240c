//! Targets of fuzzing: functions that run on any bytes from outside, and their invariants.
//!
//! Each function takes any bytes and panics where a promise of the documents does not hold: [`frames`] dea-driver/doc/link.md, [`blobs`]
//! dea-driver/doc/blob.md, [`recordings`] and [`parameter_files`] docs/formats.md. What is expected is written here again from those pages,
//! not taken from the code under test. The fuzzers in the folder above call these functions; this package's tests run them on the
//! committed corpora.
#![forbid(unsafe_code)]
#![deny(missing_docs)]

mod blob;
mod frame;
mod line;
mod parameter_file;
mod place;
mod recording;

pub use blob::run as blobs;
pub use frame::run as frames;
pub use line::{crc32, seal};
pub use parameter_file::run as parameter_files;
pub use recording::run as recordings;

use dea_driver::{BLOB_LEN, Parameters};
use springpot::{Actuator, Law, LawOptions, Preset};
use std::sync::LazyLock;

/// The board that the blobs of these tests are for.
pub const BOARD: u16 = 7;

/// A valid blob: the paper's film on the paper's bench, at 1 kHz.
pub static GOOD_BLOB: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let model = Preset::TABLE3_N2.model().expect("valid");
    let law: Law<f32> = Law::compressed(&model, LawOptions::at_step(1e-3)).expect("valid");
    let mut parameters = Parameters::bench(&law, Actuator::KARNER_2022);
    // The film of these benches does not move, which no model explains.
    parameters.limits.max_disturbance_share = 0.4;
    let mut bytes = vec![0; BLOB_LEN];
    let length = parameters.encode(BOARD, &mut bytes).expect("valid");
    bytes.truncate(length);
    bytes
});
