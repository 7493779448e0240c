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

/// On 0…10 V.
fn start_up() -> Vec<OnSpi<u8>> {
    started(1)
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
fn commanded(code: [u8; 2], stood: [u8; 2]) -> Vec<OnSpi<u8>> {
    [written([0x80, 0, 0]), exchanged([0x00, code[0], code[1]], [0x80, stood[0], stood[1]])].concat()
}

#[test]
fn amplifier_starts_at_0_v_and_ends_there() {
    let mut expected = start_up();
    expected.extend(enabling(1));
    expected.extend(commanded([0x99, 0x9a], [0, 0])); // 6 V of 10 V
    expected.extend(written([0x00, 0, 0])); // disable
    let pin = Pin::new(&[OnPin::set(State::Low), OnPin::set(State::High), OnPin::set(State::Low)]);
    let mut amplifier = Amplifier::new(Spi::new(&expected), pin, CommandRange::TenVolts).expect("answers");
    amplifier.enable().expect("answers");
    amplifier.command(DacCode::from_volts(6.0, CommandRange::TenVolts)).expect("answers");
    amplifier.disable().expect("answers");
    let (mut spi, mut pin) = amplifier.destroy();
    spi.done();
    pin.done();
}

/// The outputs of ticks, one after the other: a range for the board's parameters, on at 0 V, a command, off.
#[test]
fn amplifier_applies_the_drive_of_a_tick() {
    let mut expected = start_up();
    expected.extend(written([0x00, 0, 0])); // off, as it was
    expected.extend([started(0), asked(0x10, [0, 1])].concat()); // 0…5 V, 0 V again
    expected.extend(enabling(0)); // on at 0 V
    expected.extend([commanded([0x12, 0x34], [0, 0]), commanded([0x56, 0x78], [0x12, 0x34])].concat());
    expected.extend(idle()); // off
    let pin = [State::Low, State::Low, State::High, State::Low].map(OnPin::set);
    let mut amplifier = Amplifier::new(Spi::new(&expected), Pin::new(&pin), CommandRange::TenVolts).expect("answers");
    let range = CommandRange::FiveVolts;
    let on = |code| Drive { enable: true, dac_v: DacCode(code).volts(range), range };
    for drive in [Drive::OFF, on(0x1234), on(0x5678), Drive::OFF] {
        amplifier.apply(drive).expect("answers");
    }
    let (mut spi, mut pin) = amplifier.destroy();
    spi.done();
    pin.done();
}

#[test]
fn the_range_of_five_volts_is_another_code() {
    let expected = started(0);
    let pin = Pin::new(&[OnPin::set(State::Low)]);
    let amplifier = Amplifier::new(Spi::new(&expected), pin, CommandRange::FiveVolts).expect("answers");
    let (mut spi, mut pin) = amplifier.destroy();
    spi.done();
    pin.done();
}

/// A command that is not known to have arrived at 0 V leaves the amplifier disabled.
#[test]
fn pins_are_low_whatever_the_bus_does() {
    // The output that refuses to rise.
    let mut expected = start_up();
    expected.extend(enabling(1));
    expected.extend(written([0x00, 0, 0])); // disable
    let stuck = OnPin::set(State::High).with_error(MockError::Io(ErrorKind::Other));
    let pin = Pin::new(&[OnPin::set(State::Low), stuck, OnPin::set(State::Low)]);
    let mut amplifier = Amplifier::new(Spi::new(&expected), pin, CommandRange::TenVolts).expect("answers");
    assert_eq!(amplifier.enable(), Err(AmplifierError::Enable));
    amplifier.disable().expect("both are tried");
    let (mut spi, mut pin) = amplifier.destroy();
    spi.done();
    pin.done();
    // The enable output is tried first, and the command all the same.
    let mut expected = start_up();
    expected.extend(written([0x00, 0, 0]));
    let stuck = OnPin::set(State::Low).with_error(MockError::Io(ErrorKind::Other));
    let pin = Pin::new(&[OnPin::set(State::Low), stuck]);
    let mut amplifier = Amplifier::new(Spi::new(&expected), pin, CommandRange::TenVolts).expect("answers");
    assert_eq!(amplifier.disable(), Err(AmplifierError::Enable));
    let (mut spi, mut pin) = amplifier.destroy();
    spi.done();
    pin.done();
}

/// A DAC that is not there, without supply, or on another range is not enabled.
#[test]
fn a_dac_that_does_not_hold_what_it_was_sent_is_not_enabled() {
    let protection = asked(0x19, [0, 0xc]);
    let range = asked(0x08, [0, 1]);
    let power = asked(0x10, [0, 1]);
    let ranged = [protection.clone(), range.clone()].concat();
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
        let expected = [start_up(), start_up(), answers].concat();
        let pin = Pin::new(&[OnPin::set(State::Low)]);
        let mut amplifier = Amplifier::new(Spi::new(&expected), pin, CommandRange::TenVolts).expect("written");
        let drive = Drive { enable: true, dac_v: 0.0, range: CommandRange::TenVolts };
        assert_eq!(amplifier.apply(drive), Err(AmplifierError::Readback { wanted, found }));
        let (mut spi, mut pin) = amplifier.destroy();
        spi.done();
        pin.done();
    }
}

/// One that loses its supply while it is enabled has the code 0, or answers nothing, one tick later.
#[test]
fn a_dac_that_dies_is_noticed_with_the_next_command() {
    for found in [0, 0xffff] {
        let [high, low] = u16::to_be_bytes(found);
        let mut expected = [start_up(), enabling(1)].concat();
        expected.extend(commanded([0x40, 0], [0, 0]));
        expected.extend(commanded([0x40, 1], [high, low]));
        expected.extend(written([0x00, 0, 0])); // disable
        let pin = Pin::new(&[State::Low, State::High, State::Low].map(OnPin::set));
        let mut amplifier = Amplifier::new(Spi::new(&expected), pin, CommandRange::TenVolts).expect("written");
        amplifier.enable().expect("answers");
        amplifier.command(DacCode(0x4000)).expect("answers");
        assert_eq!(amplifier.command(DacCode(0x4001)), Err(AmplifierError::Readback { wanted: 0x4000, found }));
        amplifier.disable().expect("both are tried");
        let (mut spi, mut pin) = amplifier.destroy();
        spi.done();
        pin.done();
    }
}

/// A DAC that is not there shows while the amplifier is disabled, and is started again once it is back.
#[test]
fn a_missing_dac_shows_before_anybody_arms() {
    let absent = [written([0x00, 0, 0]).to_vec(), asked(0x10, [0, 0])].concat();
    let still_absent = [written([0x00, 0, 0]).to_vec(), started(1), asked(0x10, [0xff, 0xff])].concat();
    let back = [written([0x00, 0, 0]).to_vec(), started(1), asked(0x10, [0, 1])].concat();
    let expected = [start_up(), idle(), absent, still_absent, back, idle()].concat();
    let pin = Pin::new(&vec![OnPin::set(State::Low); 6]);
    let mut amplifier = Amplifier::new(Spi::new(&expected), pin, CommandRange::TenVolts).expect("written");
    let off = Drive { range: CommandRange::TenVolts, ..Drive::OFF };
    let missing = |found| Err(AmplifierError::Readback { wanted: 1, found });
    for answer in [Ok(()), missing(0), missing(0xa1), Ok(()), Ok(())] {
        assert_eq!(amplifier.apply(off), answer);
    }
    let (mut spi, mut pin) = amplifier.destroy();
    spi.done();
    pin.done();
}

/// The four frames that set an ADC up, as a chip answers them: what was sampled before, then the register.
fn set_up(range: u8) -> Vec<OnSpi<u8>> {
    let set = [exchanged([0xd0, 0x14, 0x00, range], [0x12, 0x34, 0, 0]), exchanged([0xd0, 0x10, 0x01, 0x00], [0; 4])];
    let asked = [exchanged([0xc8, 0x14, 0, 0], [0x12, 0x34, range << 4, 0]), exchanged([0; 4], [0x00, range, 0, 0])];
    [set.concat(), asked.concat()].concat()
}

/// Set up for the first time.
fn starting(adc: &mut Ads868x<Spi<u8>>) {
    set_up_after(AdcError::Starting, adc);
}

/// Four readings without a sample, which report the last fault.
fn set_up_after(fault: AdcError, adc: &mut Ads868x<Spi<u8>>) {
    for _ in 0..4 {
        assert_eq!(adc.read(), Err(fault));
    }
}

/// One frame to a reading, and every sample comes with its range: 0 to 10.24 V.
#[test]
fn adc_sets_its_range_checks_it_and_reads() {
    let mut expected = set_up(9);
    expected.extend(exchanged([0; 4], [0x80, 0x00, 0x90, 0]));
    expected.extend(exchanged([0; 4], [0x80, 0x01, 0x90, 0]));
    let mut adc = Ads868x::new(Spi::new(&expected), AdcRange::UpTo10V24);
    starting(&mut adc);
    let code = adc.read().expect("answers");
    assert_eq!(code, AdcCode(0x8000));
    assert_eq!(code.volts(AdcRange::UpTo10V24), 5.12);
    assert_eq!(adc.read(), Ok(AdcCode(0x8001)));
    adc.destroy().done();
}

/// After a dip of its supply the chip is back on ±12.288 V, where 0 V is half of its codes, and does not report its range. Anything
/// but the range alone beside the sample is no sample.
#[test]
fn an_adc_that_lost_its_range_is_noticed_and_set_up_again() {
    for (lower, found) in [([0, 0], 0), ([0x90, 0x40], 0x9040), ([0xb0, 0], 0xb000), ([0xff, 0xff], 0xffff)] {
        let mut expected = set_up(9);
        expected.extend(exchanged([0; 4], [0x00, 0x40, 0x90, 0]));
        expected.extend(exchanged([0; 4], [0x80, 0x00, lower[0], lower[1]]));
        expected.extend(set_up(9));
        expected.extend(exchanged([0; 4], [0x00, 0x80, 0x90, 0]));
        let mut adc = Ads868x::new(Spi::new(&expected), AdcRange::UpTo10V24);
        starting(&mut adc);
        assert_eq!(adc.volts(), Ok(0.01));
        let fault = AdcError::Range { wanted: 0x9000, found };
        assert_eq!(adc.volts(), Err(fault));
        set_up_after(fault, &mut adc);
        assert_eq!(adc.volts(), Ok(0.02));
        adc.destroy().done();
    }
}

/// The register holds the range and nothing else: a last bit that is read wrong, reserved bits, a reference that is off.
#[test]
fn an_adc_with_another_register_is_refused() {
    for found in [8u16, 0x0b, 0x49, 0x19, 0x8009] {
        let mut expected = set_up(9);
        let [high, low] = found.to_be_bytes();
        expected.truncate(expected.len() - 3);
        expected.extend(exchanged([0; 4], [high, low, 0, 0]));
        let mut adc = Ads868x::new(Spi::new(&expected), AdcRange::UpTo10V24);
        for _ in 0..3 {
            assert_eq!(adc.read(), Err(AdcError::Starting));
        }
        assert_eq!(adc.read(), Err(AdcError::Range { wanted: 9, found }));
        adc.destroy().done();
    }
}

/// The other unipolar ranges of the data sheet: RANGE_SEL and full scale.
#[test]
fn adc_ranges_are_those_of_the_data_sheet() {
    for (range, register, half_v) in
        [(AdcRange::UpTo12V288, 8, 6.144), (AdcRange::UpTo6V144, 10, 3.072), (AdcRange::UpTo5V12, 11, 2.56)]
    {
        let mut expected = set_up(register);
        expected.extend(exchanged([0; 4], [0x80, 0x00, register << 4, 0]));
        let mut adc = Ads868x::new(Spi::new(&expected), range);
        starting(&mut adc);
        assert_eq!(adc.volts(), Ok(half_v));
        adc.destroy().done();
    }
}

/// A bus without a chip reads all ones or zeros.
#[test]
fn an_adc_that_is_not_there_is_refused() {
    for (byte, found) in [(0xff, 0xffff), (0x00, 0x0000)] {
        let mut expected = Vec::new();
        for sent in [[0xd0, 0x14, 0x00, 0x09], [0xd0, 0x10, 0x01, 0x00], [0xc8, 0x14, 0, 0], [0; 4]] {
            expected.extend(exchanged(sent, [byte; 4]));
        }
        let mut adc = Ads868x::new(Spi::new(&expected), AdcRange::UpTo10V24);
        for _ in 0..3 {
            assert_eq!(adc.read(), Err(AdcError::Starting));
        }
        assert_eq!(adc.read(), Err(AdcError::Range { wanted: 9, found }));
        adc.destroy().done();
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
        assert_eq!(AdcCode(u16::MAX).volts(range), range.largest_v());
        assert!((range.largest_v() / range.full_scale_v() - 1.0).abs() < 2e-5);
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

/// A converter that needs 0.6 V before it starts and bends up to 0.8 V: no parabola is within 400 V of it and 0 V at rest.
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
    // The best parabola through 0 V at rest.
    let (mut uu, mut uv, mut vv, mut uy, mut vy) = (0.0f64, 0.0f64, 0.0f64, 0.0f64, 0.0f64);
    for step in 0..=500 {
        let (u, y) = (f64::from(step) / 100.0, f64::from(bent_converter_v(step as f32 / 100.0)));
        (uu, uv, vv) = (uu + u * u, uv + u * u * u, vv + u * u * u * u);
        (uy, vy) = (uy + u * y, vy + u * u * y);
    }
    let determinant = uu * vv - uv * uv;
    let (gain, quadratic) = ((uy * vv - vy * uv) / determinant, (uu * vy - uv * uy) / determinant);
    let worst = (0..=500)
        .map(|step| f64::from(step) / 100.0)
        .map(|u| (u * (gain + u * quadratic) - f64::from(bent_converter_v(u as f32))).abs());
    assert!(worst.fold(0.0, f64::max) > 400.0);
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
