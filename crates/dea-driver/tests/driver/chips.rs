//! The converters, transaction by transaction, against what their data sheets ask for.

use dea_driver::chips::{AdcCode, AdcRange, Calibration, CalibrationError, CommandRange, DacCode};
use dea_driver::{AdcError, Ads868x, Amplifier, AmplifierError, Drive};
use embedded_hal_mock::eh1::MockError;
use embedded_hal_mock::eh1::digital::{Mock as Pin, State, Transaction as OnPin};
use embedded_hal_mock::eh1::spi::{Mock as Spi, Transaction as OnSpi};
use std::io::ErrorKind;

/// One select of the chip, with a write.
fn written(bytes: [u8; 3]) -> [OnSpi<u8>; 3] {
    [OnSpi::transaction_start(), OnSpi::write_vec(bytes.to_vec()), OnSpi::transaction_end()]
}

fn exchanged<const N: usize>(sent: [u8; N], answered: [u8; N]) -> [OnSpi<u8>; 3] {
    [OnSpi::transaction_start(), OnSpi::transfer_in_place(sent.to_vec(), answered.to_vec()), OnSpi::transaction_end()]
}

/// Thermal shutdown and current limit, range of channel A, its register to 0, power.
fn started(range: u8) -> Vec<OnSpi<u8>> {
    [written([0x19, 0, 0xc]), written([0x08, 0, range]), written([0x00, 0, 0]), written([0x10, 0, 1])].concat()
}

/// Disabled, and asked for its power.
fn idle() -> Vec<OnSpi<u8>> {
    [written([0x00, 0, 0]).to_vec(), asked(0x10, [0, 1])].concat()
}

/// A register is asked for, and answers in the next frame.
fn asked(register: u8, [high, low]: [u8; 2]) -> Vec<OnSpi<u8>> {
    [written([0x80 | register, 0, 0]), exchanged([0x18, 0, 0], [0x80 | register, high, low])].concat()
}

/// Started, and protection, range, power and code are read back. The alarms and the power of other
/// channels, and bits that a register does not have, do not matter.
fn enabling(range: u8) -> Vec<OnSpi<u8>> {
    let checked =
        [asked(0x19, [0xff, 0xfc]), asked(0x08, [0xff, 0xf8 | range]), asked(0x10, [0x02, 0x03]), asked(0x00, [0, 0])];
    [started(range), checked.concat()].concat()
}

/// A code is written while the DAC answers with the previous one.
fn commanded(code: [u8; 2], before: [u8; 2]) -> Vec<OnSpi<u8>> {
    [written([0x80, 0, 0]), exchanged([0x00, code[0], code[1]], [0x80, before[0], before[1]])].concat()
}

/// An amplifier on 0 to 10 V whose bus sees `expected`, and whose enable output is set to `levels`, while `work` uses it.
fn amplifier(expected: &[Vec<OnSpi<u8>>], levels: &[OnPin], work: impl FnOnce(&mut Amplifier<Spi<u8>, Pin>)) {
    let (spi, pin) = (Spi::new(&expected.concat()), Pin::new(levels));
    let mut amplifier = Amplifier::new(spi, pin, CommandRange::TenVolts).expect("written");
    work(&mut amplifier);
    let (mut spi, mut pin) = amplifier.destroy();
    spi.done();
    pin.done();
}

fn low() -> OnPin {
    OnPin::set(State::Low)
}

fn high() -> OnPin {
    OnPin::set(State::High)
}

/// The outputs of ticks, one after the other: a range for the board's parameters, on at 0 V, a command, off.
#[test]
fn amplifier_applies_the_drive_of_a_tick() {
    let range = CommandRange::FiveVolts;
    let expected = [
        started(1),
        written([0x00, 0, 0]).to_vec(), // off, as it was
        started(0),                     // 0…5 V, 0 V again
        asked(0x10, [0, 1]),
        enabling(0), // on at 0 V
        commanded([0x12, 0x34], [0, 0]),
        commanded([0x56, 0x78], [0x12, 0x34]),
        idle(), // off
    ];
    amplifier(&expected, &[low(), low(), high(), low()], |amplifier| {
        let on = |code| Drive { enable: true, dac_v: DacCode(code).volts(range), range };
        for drive in [Drive::OFF, on(0x1234), on(0x5678), Drive::OFF] {
            amplifier.apply(drive).expect("answers");
        }
    });
}

/// A command that is not known to have arrived at 0 V leaves the amplifier disabled.
#[test]
fn pins_are_low_whatever_the_bus_does() {
    let refuses = |level| OnPin::set(level).with_error(MockError::Io(ErrorKind::Other));
    // The output that refuses to rise.
    let expected = [started(1), enabling(1), written([0x00, 0, 0]).to_vec()];
    amplifier(&expected, &[low(), refuses(State::High), low()], |amplifier| {
        assert_eq!(amplifier.enable(), Err(AmplifierError::Enable));
        amplifier.disable().expect("both are tried");
    });
    // The enable output is tried first, and the command all the same.
    let expected = [started(1), written([0x00, 0, 0]).to_vec()];
    amplifier(&expected, &[low(), refuses(State::Low)], |amplifier| {
        assert_eq!(amplifier.disable(), Err(AmplifierError::Enable));
    });
}

/// A DAC that is not there, without supply, or on another range is not enabled.
#[test]
fn a_dac_that_does_not_hold_what_it_was_sent_is_not_enabled() {
    let (protection, range, power) = (asked(0x19, [0, 0xc]), asked(0x08, [0, 1]), asked(0x10, [0, 1]));
    let ranged = [protection.clone(), range].concat();
    for (answers, wanted, found) in [
        (asked(0x19, [0xff, 0xff]), 0xc, 0xf),
        (asked(0x19, [0, 4]), 0xc, 4),
        ([protection.clone(), asked(0x08, [0xff, 0xff])].concat(), 1, 7),
        ([protection, asked(0x08, [0, 0])].concat(), 1, 0),
        // Without power, at its current limit, too hot.
        ([ranged.clone(), asked(0x10, [0xff, 0x5e])].concat(), 1, 0),
        ([ranged.clone(), asked(0x10, [0x00, 0x81])].concat(), 1, 0x81),
        ([ranged.clone(), asked(0x10, [0x00, 0x21])].concat(), 1, 0x21),
        ([ranged, power, asked(0x00, [0x80, 0])].concat(), 0, 0x8000),
    ] {
        amplifier(&[started(1), started(1), answers], &[low()], |amplifier| {
            let drive = Drive { enable: true, dac_v: 0.0, range: CommandRange::TenVolts };
            assert_eq!(amplifier.apply(drive), Err(AmplifierError::Readback { wanted, found }));
        });
    }
}

/// One that loses its supply while it is enabled has the code 0, or answers nothing, one tick later.
#[test]
fn a_dac_that_dies_is_noticed_with_the_next_command() {
    for found in [0, 0xffff] {
        let (first, second) = (commanded([0x40, 0], [0, 0]), commanded([0x40, 1], u16::to_be_bytes(found)));
        let expected = [started(1), enabling(1), first, second, written([0x00, 0, 0]).to_vec()];
        amplifier(&expected, &[low(), high(), low()], |amplifier| {
            amplifier.enable().expect("answers");
            amplifier.command(DacCode(0x4000)).expect("answers");
            assert_eq!(amplifier.command(DacCode(0x4001)), Err(AmplifierError::Readback { wanted: 0x4000, found }));
            amplifier.disable().expect("both are tried");
        });
    }
}

/// A DAC that is not there shows while the amplifier is disabled, and is started again once it is back.
#[test]
fn a_missing_dac_shows_before_arming() {
    let absent = [written([0x00, 0, 0]).to_vec(), asked(0x10, [0, 0])].concat();
    let still_absent = [written([0x00, 0, 0]).to_vec(), started(1), asked(0x10, [0xff, 0xff])].concat();
    let back = [written([0x00, 0, 0]).to_vec(), started(1), asked(0x10, [0, 1])].concat();
    let expected = [started(1), idle(), absent, still_absent, back, idle()];
    amplifier(&expected, &[0; 6].map(|_| low()), |amplifier| {
        let missing = |found| Err(AmplifierError::Readback { wanted: 1, found });
        for answer in [Ok(()), missing(0), missing(0xa1), Ok(()), Ok(())] {
            assert_eq!(amplifier.apply(Drive { range: CommandRange::TenVolts, ..Drive::OFF }), answer);
        }
    });
}

/// The four frames that set an ADC up, as a chip answers them: what was sampled before, then the register.
fn set_up(range: u8) -> Vec<OnSpi<u8>> {
    let set = [exchanged([0xd0, 0x14, 0x00, range], [0x12, 0x34, 0, 0]), exchanged([0xd0, 0x10, 0x01, 0x00], [0; 4])];
    let asked = [exchanged([0xc8, 0x14, 0, 0], [0x12, 0x34, range << 4, 0]), exchanged([0; 4], [0x00, range, 0, 0])];
    [set.concat(), asked.concat()].concat()
}

/// A frame that only reads.
fn sampled(answer: [u8; 4]) -> Vec<OnSpi<u8>> {
    exchanged([0; 4], answer).to_vec()
}

/// Readings of an ADC whose bus sees `expected`. Of those of its first set-up only the last may be another than `Starting`.
fn readings(range: AdcRange, expected: &[Vec<OnSpi<u8>>], readings: &[Result<f32, AdcError>]) {
    let mut adc = Ads868x::new(Spi::new(&expected.concat()), range);
    for _ in 0..3 {
        assert_eq!(adc.volts(), Err(AdcError::Starting));
    }
    for reading in readings {
        assert_eq!(adc.volts(), *reading);
    }
    adc.destroy().done();
}

/// One frame to a reading, and every sample comes with its range: RANGE_SEL and full scale of the data sheet's unipolar ranges.
#[test]
fn adc_sets_its_range_checks_it_and_reads() {
    for (range, register, half_v) in [
        (AdcRange::UpTo12V288, 8, 6.144),
        (AdcRange::UpTo10V24, 9, 5.12),
        (AdcRange::UpTo6V144, 10, 3.072),
        (AdcRange::UpTo5V12, 11, 2.56),
    ] {
        let samples = [[0x80, 0], [0x80, 1]].map(|[high, low]| sampled([high, low, register << 4, 0]));
        let [first, second] = samples;
        let found = [Err(AdcError::Starting), Ok(half_v), Ok(half_v + range.full_scale_v() / 65_536.0)];
        readings(range, &[set_up(register), first, second], &found);
    }
}

/// After a dip of its supply the chip is back on ±12.288 V, where 0 V is half of its codes, and does not report its range. Anything
/// but the range alone beside the sample is no sample.
#[test]
fn an_adc_that_lost_its_range_is_noticed_and_set_up_again() {
    for (lower, found) in [([0, 0], 0), ([0x90, 0x40], 0x9040), ([0xb0, 0], 0xb000), ([0xff, 0xff], 0xffff)] {
        let spoiled = sampled([0x80, 0x00, lower[0], lower[1]]);
        let expected = [set_up(9), sampled([0, 0x40, 0x90, 0]), spoiled, set_up(9), sampled([0, 0x80, 0x90, 0])];
        // Four readings without a sample report the last fault.
        let fault = Err(AdcError::Range { wanted: 0x9000, found });
        let found = [Err(AdcError::Starting), Ok(0.01), fault, fault, fault, fault, fault, Ok(0.02)];
        readings(AdcRange::UpTo10V24, &expected, &found);
    }
}

/// The register holds the range and nothing else: a last bit that is read wrong, reserved bits, a reference that is off. A bus without a
/// chip reads all ones or zeros.
#[test]
fn an_adc_with_another_register_is_refused() {
    for found in [8u16, 0x0b, 0x49, 0x19, 0x8009, 0xffff, 0] {
        let [high, low] = found.to_be_bytes();
        let asked = set_up(9);
        let expected = [asked[..asked.len() - 3].to_vec(), sampled([high, low, 0, 0])];
        readings(AdcRange::UpTo10V24, &expected, &[Err(AdcError::Range { wanted: 9, found })]);
    }
}

#[test]
fn codes_are_the_nearest_to_their_volts() {
    for range in [CommandRange::FiveVolts, CommandRange::TenVolts] {
        for code in (0..=u16::MAX).step_by(7) {
            assert_eq!(DacCode::from_volts(DacCode(code).volts(range), range), DacCode(code));
        }
        assert_eq!(DacCode::from_volts(range.full_scale_v(), range), DacCode(u16::MAX));
        for (volts, code) in
            [(1e9, u16::MAX), (f32::INFINITY, u16::MAX), (-1.0, 0), (f32::NAN, 0), (f32::NEG_INFINITY, 0)]
        {
            assert_eq!(DacCode::from_volts(volts, range), DacCode(code), "{volts} V");
        }
    }
    for range in [AdcRange::UpTo12V288, AdcRange::UpTo10V24, AdcRange::UpTo6V144, AdcRange::UpTo5V12] {
        assert_eq!(AdcCode(0).volts(range), 0.0);
        assert_eq!(AdcCode(0x8000).volts(range), range.full_scale_v() / 2.0);
        assert_eq!(AdcCode(u16::MAX).volts(range), range.max_v());
        assert!((range.max_v() / range.full_scale_v() - 1.0).abs() < 2e-5);
    }
}

/// Largest error of the inverse of `calibration` up to `full_scale_v`, as a share of the largest y.
fn inverse_error(calibration: &Calibration, full_scale_v: f32) -> f32 {
    let largest = calibration.apply(full_scale_v);
    let errors = (0..=1000).map(|step| {
        let wanted = calibration.apply(step as f32 / 1000.0 * full_scale_v);
        (calibration.apply(calibration.invert(wanted)) - wanted).abs() / largest
    });
    errors.fold(0.0, f32::max)
}

#[test]
fn calibrations_are_inverted() {
    for quadratic in [-9.0f32, 0.0, 9.0] {
        let calibration = Calibration::Parabola { offset: -20.0, gain: 1000.0, quadratic };
        calibration.check(10.0).expect("it rises");
        assert!(inverse_error(&calibration, 10.0) < 1e-6, "{quadratic}");
    }
    // Nearly flat at one end of its range: steps of Newton from the straight line commanded 2.9 times as much.
    for (gain, quadratic) in [(1.0, 100.0), (1e-3, 60.0), (1200.0, -59.99), (2000.0, -99.0), (1e6, 1e-6), (1e-6, 1.0)] {
        let calibration = Calibration::Parabola { offset: 0.0, gain, quadratic };
        calibration.check(10.0).expect("it rises");
        assert!(inverse_error(&calibration, 10.0) < 1e-6, "{calibration:?}");
        // Below its offset, where nothing is to be commanded.
        assert!(calibration.invert(-1e6) <= 0.0 || calibration.invert(-1e6).is_nan());
    }
    for bad in [
        Calibration::linear(0.0),
        Calibration::linear(-1.0),
        Calibration::linear(f32::NAN),
        Calibration::Parabola { offset: f32::INFINITY, gain: 1.0, quadratic: 0.0 },
        Calibration::Parabola { offset: 0.0, gain: 1.0, quadratic: -0.06 },
    ] {
        assert!(matches!(bad.check(10.0), Err(CalibrationError::Falls { .. })), "{bad:?}");
    }
    // The text states the values that were compared.
    let falls = Calibration::Parabola { offset: 0.25, gain: 1.5, quadratic: -0.125 };
    let text = falls.check(10.0).expect_err("refused").to_string();
    assert!(["0.25", "1.5 at 0 V", "-1 at 10 V"].iter().all(|value| text.contains(value)), "{text}");
}

/// A converter that needs 0.6 V before it starts and bends up to 0.8 V: the best parabola through 0 V at rest is off by 400 V.
fn bent_converter_v(command_v: f32) -> f32 {
    let above = command_v - 0.7;
    // From flat to straight within a tenth of a volt, 1400 V per volt.
    700.0 * (above + (above * above + 0.01f32).sqrt()) - 700.0 * (-0.7 + (0.49 + 0.01f32).sqrt())
}

#[test]
fn points_follow_an_amplifier_that_starts_late() {
    let measured = [0.0, 0.4, 0.6, 0.7, 0.8, 1.0, 2.0, 5.0].map(|u| [u, bent_converter_v(u)]);
    let points = Calibration::points(&measured).expect("rising");
    assert!(inverse_error(&points, 5.0) < 1e-6);
    for step in 0..=500 {
        let wanted = step as f32 / 500.0 * bent_converter_v(5.0);
        let got = bent_converter_v(points.invert(wanted));
        assert!((got - wanted).abs() < 15.0, "{got} V for {wanted} V");
    }
    // Beyond the ends nothing is extrapolated.
    assert_eq!(points.invert(-100.0), 0.0);
    assert_eq!(points.invert(1e9), 5.0);
    assert_eq!(points.apply(7.0), bent_converter_v(5.0));
    assert!(points.invert(f32::NAN).is_nan() && points.apply(f32::NAN).is_nan());
}

#[test]
fn points_that_are_no_calibration_are_refused() {
    let refused = |points: &[[f32; 2]]| Calibration::points(points).expect_err("refused");
    assert_eq!(refused(&[]), CalibrationError::Number);
    assert_eq!(refused(&[[0.0, 0.0]]), CalibrationError::Number);
    let many: Vec<_> = (0u8..9).map(|k| [f32::from(k), f32::from(k)]).collect();
    assert_eq!(refused(&many), CalibrationError::Number);
    let late = refused(&[[0.1, 0.0], [1.0, 1.0]]);
    assert_eq!(late, CalibrationError::Start { first_v: 0.1 });
    assert!(late.to_string().contains("at 0.1 V"), "{late}");
    let number = |points: &[[f32; 2]]| match refused(points) {
        CalibrationError::Point { number, .. } => number,
        error => panic!("{error}"),
    };
    for (second, third) in [([1.0, 0.0], [2.0, 1.0]), ([0.0, 1.0], [2.0, 2.0]), ([f32::NAN, 1.0], [2.0, 2.0])] {
        assert_eq!(number(&[[0.0, 0.0], second, third]), 1);
    }
    for third in [[2.0, 0.5], [0.5, 2.0], [2.0, f32::NAN], [f32::INFINITY, 3.0], [2.0, f32::INFINITY]] {
        assert_eq!(number(&[[0.0, 0.0], [1.0, 1.0], third]), 2);
    }
    assert_eq!(number(&[[0.0, f32::NEG_INFINITY], [1.0, 1.0]]), 1);
    assert!(matches!(refused(&[[f32::NAN, 0.0], [1.0, 1.0]]), CalibrationError::Start { .. }));
    let falls = refused(&[[0.0, 0.0], [2.5, 3000.0], [1.5, 7000.0]]).to_string();
    assert!(["point 2 (2.5 V, 3000)", "point 3 (1.5 V, 7000)"].iter().all(|point| falls.contains(point)), "{falls}");
}
