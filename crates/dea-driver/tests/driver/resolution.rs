//! Limits that are finer than the converters of a board are refused, and the page states what that costs.

use dea_driver::chips::{Calibration, Ceilings, Converters};
use dea_driver::wire::boards;
use dea_driver::{BLOB_LEN, Blob, BlobError, Limits, Parameters, PlausibilityLimits};

use crate::bench::law;
use springpot::Actuator;

/// Volts at an instrument of 0 to 10 V for one at the pins of the chip: 24 and 10 kΩ.
const DIVIDER: f32 = 3.4;
const BOARD: u16 = boards::STM32F407_DISCOVERY;

/// A bench like the paper's at the pins of an STM32F4DISCOVERY.
fn parameters() -> Parameters {
    let sensor = PlausibilityLimits { low: -0.5e-3, high: 8e-3, jump: 0.5e-3, stuck_ticks: 500, stuck_band: 6e-6 };
    Parameters {
        amplifier: Calibration::linear(1000.0 * DIVIDER),
        monitor: Calibration::linear(1000.0 * DIVIDER),
        sensor: Calibration::Parabola { offset: -1e-3, gain: 1e-3 * DIVIDER, quadratic: 0.0 },
        limits: Limits { sensor, ..Limits::bench(160e-6) },
        ..Parameters::bench(&law(), Actuator::KARNER_2022)
    }
}

fn refused(change: impl FnOnce(&mut Parameters)) -> BlobError {
    let mut changed = parameters();
    change(&mut changed);
    changed.encode(BOARD, &mut [0; BLOB_LEN]).expect_err("limits that these converters cannot keep")
}

/// The smallest value of a limit that is kept, and the first below it that is not, by bisection.
fn smallest(board: u16, low: f32, high: f32, set: impl Fn(&mut Parameters, f32)) -> f32 {
    let (mut low, mut high) = (low, high);
    while high / low > 1.0001 {
        let middle = (low * high).sqrt();
        let mut changed = parameters();
        set(&mut changed, middle);
        match changed.encode(board, &mut [0; BLOB_LEN]) {
            Ok(_) => high = middle,
            Err(BlobError::Resolution { value, min, .. }) => {
                assert_eq!(value, middle);
                assert!(min > middle);
                low = middle;
            }
            Err(other) => panic!("{other}"),
        }
    }
    high
}

#[test]
fn limits_that_12_bits_cannot_keep_are_refused() {
    let mut bytes = [0; BLOB_LEN];
    let length = parameters().encode(BOARD, &mut bytes).expect("kept");
    assert!(Blob::decode(&bytes[..length], BOARD).is_ok());
    // A bench at the converters of the other board, in volts that these do not have.
    assert!(matches!(
        Parameters::bench(&law(), Actuator::KARNER_2022).encode(BOARD, &mut bytes),
        Err(BlobError::Reach { instrument: "monitor", .. })
    ));
    let with = |set: fn(&mut Parameters)| match refused(set) {
        BlobError::Resolution { quantity, value, min } => {
            let text = BlobError::Resolution { quantity, value, min }.to_string();
            assert!(text.contains(quantity) && text.contains(&min.to_string()) && !text.contains('\n'), "{text}");
            quantity
        }
        other => panic!("{other}"),
    };
    assert_eq!(with(|p| p.limits.monitor.band_v = 8.0), "monitor.band_v");
    assert_eq!(with(|p| p.limits.sensor.stuck_band = 2e-6), "sensor.stuck_band");
    assert_eq!(with(|p| p.limits.sensor.jump = 8e-6), "sensor.jump");
    // A sensor that is three times as steep.
    let steep = |p: &mut Parameters| p.sensor = Calibration::Parabola { offset: -1e-3, gain: 10e-3, quadratic: 0.0 };
    assert_eq!(with(steep), "sensor.stuck_band");
    // An open input may read a step.
    assert!(matches!(refused(|p| p.limits.sensor.low = -0.998e-3), BlobError::Unplugged { .. }));
    // The ceiling of 50 kV leaves room for a reference that is off by 1 %.
    let below = |voltage_v| {
        let ceilings = Ceilings { voltage_v, ..Converters::STM32F4_ON_CHIP.ceilings };
        let board = Converters { ceilings, ..Converters::STM32F4_ON_CHIP };
        Blob::with_converters(parameters(), &board).err()
    };
    let error = below(6050.0);
    assert!(matches!(error, Some(BlobError::Ceiling { quantity: "max_voltage_v", value: 6000.0, .. })), "{error:?}");
    assert_eq!(below(6061.0), None);
}

/// Everything that the other board kept before is still kept by it.
#[test]
fn the_converters_of_16_bits_refuse_nothing_finer() {
    let mut fine = Parameters::bench(&law(), Actuator::KARNER_2022);
    fine.limits.monitor.band_v = 0.2;
    fine.limits.sensor = PlausibilityLimits { jump: 1e-9, stuck_band: 1e-12, ..fine.limits.sensor };
    assert!(Blob::new(fine).is_ok());
}

/// The page states, for a usual bench, what follows from the constants of each board.
#[test]
fn the_page_states_what_the_converters_cost() {
    for (column, board, supply_v, [low_v, high_v]) in
        [(3, BOARD, 3.0, Converters::STM32F4_SUPPLY_V), (4, boards::NUCLEO_G474RE, 3.3, Converters::STM32G4_SUPPLY_V)]
    {
        let page = include_str!("../../../../docs/boards.md");
        let states = |row: &str, value: String| {
            let line = page.lines().find(|line| line.starts_with(&format!("| {row} |")));
            let line = line.unwrap_or_else(|| panic!("no row {row}"));
            let cell = line.split('|').nth(column).expect("a cell").trim();
            assert!(cell.starts_with(&value), "{row}: {cell}, computed {value}");
        };
        let smallest = |low, high, set: fn(&mut Parameters, f32)| smallest(board, low, high, set);
        let code = supply_v / 4096.0 * DIVIDER;
        states("step of the voltage", format!("{:.1} V", 1000.0 * code));
        states("step of the sensor", format!("{:.1} µm", 1e3 * code));
        let band_v = smallest(1.0, 60.0, |p, v| p.limits.monitor.band_v = v);
        states("smallest `monitor.band_v`", format!("{band_v:.1} V"));
        let band_m = smallest(1e-6, 60e-6, |p, v| p.limits.sensor.stuck_band = v);
        states("smallest `sensor.stuck_band`", format!("{:.1} µm", 1e6 * band_m));
        let jump_m = smallest(1e-6, 60e-6, |p, v| p.limits.sensor.jump = v);
        states("smallest `sensor.jump`", format!("{:.1} µm", 1e6 * jump_m));
        let full_scale_v = Converters::of_board(board).monitor_v * DIVIDER;
        states("full scale of command, monitor and sensor", format!("{full_scale_v:.2} V"));
        let monitor = parameters().limits.monitor;
        let largest_v = (1000.0 * full_scale_v - monitor.band_v) / (1.0 + monitor.band_share);
        states("largest `max_voltage_v` at 1000 V per volt", format!("{} V", largest_v.floor()));
        let mut largest = parameters();
        for (max_voltage_v, kept) in [(largest_v - 1.0, true), (largest_v + 1.0, false)] {
            largest.limits.max_voltage_v = max_voltage_v;
            largest.limits.max_field_v_per_m = 1e8;
            assert_eq!(largest.encode(board, &mut [0; BLOB_LEN]).is_ok(), kept, "{max_voltage_v} V");
        }
        states("voltage beyond `max_voltage_v` that is not noticed, chip in order", "1 %".into());
        states(
            "the same with a reference that was off when it was switched on",
            format!("{:.0} %", 100.0 * (high_v / low_v - 1.0)),
        );
    }
}
