//! What the tests share: models to try, and the paper's drive.

#[path = "../../crates/springpot/tests/it/support/defining_sum.rs"]
pub mod defining_sum;
pub mod flash;
#[path = "../../crates/springpot/tests/it/support/models.rs"]
mod models;
#[path = "../../crates/springpot/tests/it/support/sweep.rs"]
pub mod sweep;
pub mod tool;
pub mod virtual_board;

pub use models::{hard_models, paper_force, presets, random_models};

use dea_driver::{Blob, Limits, MonitorLimits, OnSensorFault, Parameters as BoardParameters, PlausibilityLimits};
use host_sim::files::parameters::{Board, Parameters};

/// Limits of a bench with a film like the paper's.
pub fn bench_limits() -> Limits {
    Limits {
        max_voltage_v: 6500.0,
        max_field_v_per_m: 4.2e7,
        thickness_m: 160e-6,
        max_slew_v_per_s: 50e3,
        max_displacement_m: 8e-3,
        monitor: MonitorLimits { slew_v_per_s: 100e3, band_v: 60.0, band_share: 0.03, settle_s: 0.02 },
        sensor: PlausibilityLimits { low: -1e-3, high: 9e-3, jump: 0.4e-3, stuck_ticks: 500 },
        on_sensor_fault: OnSensorFault::Trip,
        heartbeat_s: 0.5,
    }
}

/// Parameters of a board with that bench: the paper's model with two branches, a 1000:1 amplifier, as `export` makes them.
pub fn board_parameters() -> BoardParameters {
    let parameters = Parameters::preset("table3-n2").expect("a preset");
    let board = Board { limits: bench_limits(), ..Board::bench(&parameters.actuator) };
    let blob = parameters.to_blob(&board, 1000.0).expect("valid");
    Blob::decode(&blob, board.id).expect("valid").parameters
}

/// The committed recordings of one plant, fast to slow.
pub fn recordings(plant: &str) -> [std::path::PathBuf; 3] {
    ["5", "7", "13"].map(|period| {
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("recordings/{plant}-{period}s.csv"))
    })
}

/// CRC-32 (ISO-HDLC), bit by bit.
pub fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
    })
}
