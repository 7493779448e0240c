//! A controller with a lean memory: its tick, its blob, its store.

use dea_driver::chips::Converters;
use dea_driver::{
    Blob, BlobError, BlobHeader, Controller, ControllerMemory, DriverState, Inputs, Mode, Parameters, RamFlash, SCHEMA,
    Store,
};
use springpot::{Compressed, Law, LawOptions, Preset};

use crate::bench::{board_parameters, encoded, of_law};

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

/// Voltages of a feedforward run to 0.5 mm and back: amplifier and monitor follow at once.
fn run<M: ControllerMemory>(blob: Blob<M>) -> Vec<f32> {
    let mut controller = Controller::new(blob);
    let (mut dac_v, mut film_m) = (0.0, 0.0);
    let mut tick = |controller: &mut Controller<M>, k: u16| {
        controller.heartbeat();
        // The model, and the sensor's noise: feedforward only checks it.
        let sensor_adc_v = Some(1.0 + 1e3 * film_m + 1e-3 * f32::from(k % 3));
        let outputs = controller.tick(Inputs { interlock_closed: true, monitor_adc_v: Some(dac_v), sensor_adc_v });
        (dac_v, film_m) = (outputs.dac_v, outputs.telemetry.predicted_m);
        outputs.telemetry.command_v
    };
    tick(&mut controller, 0);
    controller.arm().expect("healthy");
    controller.start(Mode::Feedforward).expect("armed");
    let voltages = (0..4000u16)
        .map(|k| {
            controller.set_reference(if k < 2000 { 0.5e-3 } else { 0.1e-3 }).expect("within the limits");
            tick(&mut controller, k)
        })
        .collect();
    assert_eq!(controller.supervisor().state(), DriverState::Running);
    voltages
}

/// The voltages are those of the default memory within its accuracy.
#[test]
fn a_lean_controller_ticks() {
    let lean = run(Blob::new(lean_parameters()).expect("valid"));
    let default = run(Blob::new(board_parameters()).expect("valid"));
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
