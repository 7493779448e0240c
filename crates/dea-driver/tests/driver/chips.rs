//! The converters, transaction by transaction, against what their data sheets ask for.

use dea_driver::chips::{AdcCode, AdcRange, Calibration, CommandRange, DacCode};
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

/// Range of channel A to 0…10 V, its register to 0, power.
fn start_up() -> Vec<OnSpi<u8>> {
    [written([0x08, 0, 1]), written([0x00, 0, 0]), written([0x10, 0, 1])].concat()
}

#[test]
fn amplifier_starts_at_0_v_and_ends_there() {
    let mut expected = start_up();
    expected.extend(start_up()); // enable
    expected.extend(written([0x00, 0x99, 0x9a])); // 6 V of 10 V
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
    expected.extend([written([0x08, 0, 0]), written([0x00, 0, 0])].concat()); // 0…5 V, 0 V again
    let again = [written([0x08, 0, 0]), written([0x00, 0, 0]), written([0x10, 0, 1])];
    expected.extend(again.concat()); // on at 0 V
    expected.extend([written([0x00, 0x12, 0x34]), written([0x00, 0x56, 0x78])].concat());
    expected.extend(written([0x00, 0, 0])); // off
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
    let expected = [written([0x08, 0, 0]), written([0x00, 0, 0]), written([0x10, 0, 1])].concat();
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
    expected.extend(start_up()); // enable
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

#[test]
fn adc_sets_its_range_checks_it_and_reads() {
    let mut expected = Vec::new();
    expected.extend(exchanged([0xd0, 0x14, 0x00, 0x09], [0; 4]));
    expected.extend(exchanged([0xc8, 0x14, 0, 0], [0x12, 0x34, 0, 0]));
    expected.extend(exchanged([0; 4], [0x00, 0x09, 0, 0]));
    expected.extend(exchanged([0; 4], [0x80, 0x00, 0, 0]));
    let mut adc = Ads868x::new(Spi::new(&expected), AdcRange::UpTo10V24);
    assert_eq!(adc.read(), Err(AdcError::Unconfigured), "before it is configured");
    adc.configure().expect("answers");
    let code = adc.read().expect("answers");
    assert_eq!(code, AdcCode(0x8000));
    assert_eq!(code.volts(AdcRange::UpTo10V24), 5.12);
    adc.destroy().done();
}

/// The other unipolar ranges of the data sheet: RANGE_SEL and full scale.
#[test]
fn adc_ranges_are_those_of_the_data_sheet() {
    for (range, register, half_v) in
        [(AdcRange::UpTo12V288, 8, 6.144), (AdcRange::UpTo6V144, 10, 3.072), (AdcRange::UpTo5V12, 11, 2.56)]
    {
        let mut expected = Vec::new();
        expected.extend(exchanged([0xd0, 0x14, 0x00, register], [0; 4]));
        expected.extend(exchanged([0xc8, 0x14, 0, 0], [0; 4]));
        expected.extend(exchanged([0; 4], [0x00, register, 0, 0]));
        expected.extend(exchanged([0; 4], [0x80, 0x00, 0, 0]));
        let mut adc = Ads868x::new(Spi::new(&expected), range);
        adc.configure().expect("answers");
        assert_eq!(adc.volts(), Ok(half_v));
        adc.destroy().done();
    }
}

/// A bus without a chip reads all ones or zeros.
#[test]
fn an_adc_that_is_not_there_is_refused() {
    for (byte, found) in [(0xff, 0xffff), (0x00, 0x0000)] {
        let mut expected = Vec::new();
        for sent in [[0xd0, 0x14, 0x00, 0x09], [0xc8, 0x14, 0, 0], [0; 4]] {
            expected.extend(exchanged(sent, [byte; 4]));
        }
        let mut adc = Ads868x::new(Spi::new(&expected), AdcRange::UpTo10V24);
        assert_eq!(adc.configure(), Err(AdcError::Range { found }));
        assert_eq!(adc.read(), Err(AdcError::Unconfigured));
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

#[test]
fn calibrations_are_inverted() {
    for quadratic in [-9.0f32, 0.0, 9.0] {
        let calibration = Calibration { offset: -20.0, gain: 1000.0, quadratic };
        assert!(calibration.rises_up_to(10.0));
        for step in 0..=100 {
            let volts = step as f32 / 10.0;
            let back = calibration.invert(calibration.apply(volts));
            assert!((back - volts).abs() < 1e-5, "{quadratic}: {volts} V comes back as {back} V");
        }
    }
    for bad in [
        Calibration::linear(0.0),
        Calibration::linear(-1.0),
        Calibration::linear(f32::NAN),
        Calibration { offset: f32::INFINITY, gain: 1.0, quadratic: 0.0 },
        Calibration { offset: 0.0, gain: 1.0, quadratic: -0.06 },
    ] {
        assert!(!bad.rises_up_to(10.0), "{bad:?}");
    }
}
