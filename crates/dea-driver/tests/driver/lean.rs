//! A controller with a lean memory: its tick, its blob, its store.

use dea_driver::chips::Converters;
use dea_driver::{
    Blob, BlobError, BlobHeader, Controller, ControllerMemory, DriverState, Mode, Parameters, RamFlash, SCHEMA, Store,
};
use springpot::{Compressed, Law, LawOptions, Preset};

use crate::bench::{board_parameters, encoded, of_law};
use crate::film_bench::FilmBench;

const BOARD: u16 = 0x0405;

/// 8 + 18 weights instead of 12 + 36, true to 1e-4 over an hour.
type Lean = Compressed<f32, 8, 14, 4>;

fn lean_blob(bytes: &[u8]) -> Result<Blob<Lean>, BlobError> {
    Blob::decode_for(bytes, BOARD, &Converters::AD5754_ADS868X)
}

fn lean_parameters() -> Parameters<Lean> {
    let model = Preset::TABLE3_N2.model().expect("valid");
    let options = LawOptions::at_step(1e-3).with_horizon(3600.0).with_tolerance(1e-3);
    let law: Law<f32, Lean> = Law::compressed(&model, options).expect("valid");
    of_law(&law)
}

/// Voltages of a feedforward run to 0.5 mm and back.
fn run<M: ControllerMemory>(parameters: Parameters<M>) -> Vec<f32> {
    let mut bench = FilmBench::with(parameters);
    bench.start(Mode::Feedforward);
    let mut tick = |reference_m| {
        bench.set_reference(reference_m);
        bench.tick(|_| ()).telemetry.command_v
    };
    let voltages = (0..4000).map(|k| tick(if k < 2000 { 0.5e-3 } else { 0.1e-3 })).collect();
    assert_eq!(bench.state(), DriverState::Running);
    voltages
}

/// The voltages are those of the default memory within its accuracy.
#[test]
fn a_lean_controller_ticks() {
    let (lean, default) = (run(lean_parameters()), run(board_parameters()));
    let furthest = lean.iter().zip(&default).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    let largest = default.iter().copied().fold(0.0, f32::max);
    println!("lean and default differ by at most {furthest} V of {largest} V");
    assert!(largest > 2000.0 && furthest < 1e-3 * largest);
    assert!(size_of::<Controller<Lean>>() < size_of::<Controller>());
}

#[test]
fn a_blob_of_a_law_of_other_sizes_is_refused() {
    let (lean, default) = (encoded(&lean_parameters(), BOARD), encoded(&board_parameters(), BOARD));
    let (lean_sizes, default_sizes) = ([8, 14, 4], [12, 12, 24]);
    assert_eq!(lean_blob(&lean).expect("its own").into_parameters(), lean_parameters());
    let error = Blob::decode(&lean, BOARD).expect_err("lean");
    assert_eq!(error, BlobError::LawSizes { found: lean_sizes, expected: default_sizes });
    let error = lean_blob(&default).expect_err("of the default sizes");
    assert_eq!(error, BlobError::LawSizes { found: default_sizes, expected: lean_sizes });
    assert_eq!(error.to_string(), "the law in the blob has 12 + 12 + 24 weights, the controller's 8 + 14 + 4");

    // The default blob states no sizes: its bytes are those of the first version.
    assert_eq!(BlobHeader::read(&default).expect("a blob").schema, SCHEMA - 2);
    assert_eq!(BlobHeader::read(&lean).expect("a blob").schema, (SCHEMA - 2) | 0x100);
    for length in 0..lean.len() {
        assert_eq!(lean_blob(&lean[..length]).err(), Some(BlobError::Truncated), "{length} bytes");
    }
}

#[test]
fn a_lean_blob_is_kept() {
    let store = Store::<_, Lean>::with_converters(RamFlash::default(), BOARD, Converters::AD5754_ADS868X);
    let mut store = store.expect("two sectors");
    store.save(&encoded(&lean_parameters(), BOARD)).expect("valid");
    assert_eq!(*store.load().expect("saved").blob.parameters(), lean_parameters());
    assert!(store.save(&encoded(&board_parameters(), BOARD)).is_err());
    assert_eq!(*store.load().expect("still there").blob.parameters(), lean_parameters());
}
