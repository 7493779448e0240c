//! Conversions and frames of the ADS868x: SBAS633E, 6.6, 6.8, 7.4.2.3, and 7.5.1.

use converter_chips::{Rule, Sdi, SerialChip, Variant};
use embedded_hal::spi::{MODE_0, MODE_1};

use crate::master::Adc;

const VARIANTS: [Variant; 3] = [Variant::Ads8681, Variant::Ads8685, Variant::Ads8689];

#[test]
fn the_sample_is_taken_when_select_rises_and_read_in_the_next_frame() {
    let mut adc = Adc::new(Variant::Ads8681);
    // 1 mV for each µs: the code of ±12.288 V shows when the sample was taken.
    adc.chip.set_input_fn(|now| now as f64 * 1e-6);
    let before = adc.frame(0);
    assert_eq!(before, 0x8000_0000, "nothing was converted");
    let first = adc.master.now;
    let read = adc.frame(0);
    let code = 32768 + (first as f64 * 1e-6 / 375e-6).round() as u32;
    assert_eq!(read, code << 16);
    assert!(adc.rules().is_empty());
}

#[test]
fn a_frame_that_begins_in_a_conversion_is_not_seen() {
    for variant in VARIANTS {
        let mut adc = Adc::new(variant);
        adc.chip.set_input(3.75);
        // (3.75 V + 12.288 V) / 375 µV
        let first = 42768 << 16;
        adc.frame(0);
        adc.chip.set_input(0.0);
        adc.master.high_ns = variant.conversion_ns() - 1;
        adc.frame(0xd014_0001);
        assert_eq!(adc.master.floating, 32, "{variant:?}: SDO is not driven");
        assert_eq!(adc.chip.range_sel(), 0, "the command is lost");
        assert_eq!(adc.rules(), [Rule::FrameDuringConversion(1)]);
        // Its end samples nothing either: the old result is still there.
        adc.master.high_ns = 100_000;
        assert_eq!(adc.frame(0), first, "{variant:?}");
        adc.master.high_ns = 1;
        adc.frame(0);
        adc.master.high_ns = 100_000;
        assert_eq!(adc.frame(0), 32768 << 16);
        assert_eq!(adc.rules().len(), 2);
    }
}

#[test]
fn the_input_needs_its_time_of_acquisition() {
    for variant in VARIANTS {
        for (missing, share) in [(0, 1.0), (variant.acquisition_ns() / 2, 0.5)] {
            let mut adc = Adc::new(variant);
            adc.chip.set_input(-1.5);
            adc.frame(0);
            let end = adc.master.now + variant.conversion_ns();
            adc.chip.set_input(7.5);
            adc.chip.select(end);
            let acquired = variant.acquisition_ns() - missing;
            adc.chip.deselect(end + acquired);
            let volts = -1.5 + 9.0 * acquired as f64 / variant.acquisition_ns() as f64;
            assert!(((volts + 1.5) / 9.0 - share).abs() < 0.002);
            adc.master.now = end + acquired;
            let code = (32768.0 + volts / 375e-6).round() as u32;
            assert_eq!(adc.frame(0), code << 16, "{variant:?}: on its way from the sample before");
            assert_eq!(adc.rules().contains(&Rule::Acquisition(acquired)), missing > 0);
        }
    }
}

#[test]
fn a_short_frame_reads_and_converts_but_writes_nothing() {
    let mut adc = Adc::new(Variant::Ads8681);
    adc.chip.set_input(3.75);
    adc.frame(0);
    assert_eq!(adc.master.send(&mut adc.chip, 0xd014, 16), 42768, "the upper half");
    adc.chip.set_input(0.0);
    adc.master.send(&mut adc.chip, 0xd014_0001 >> 1, 31);
    assert_eq!(adc.chip.range_sel(), 0);
    assert_eq!(adc.rules(), [Rule::ShortFrame(16), Rule::ShortFrame(31)]);
    assert_eq!(adc.frame(0), 32768 << 16);
}

#[test]
fn sdo_is_valid_12_ns_after_the_falling_edge() {
    let mut adc = Adc::new(Variant::Ads8681);
    adc.chip.set_input(3.75);
    adc.frame(0);
    adc.master.half_ns = 12;
    assert_eq!(adc.frame(0), 42768 << 16);
    adc.master.half_ns = 11;
    // Bit 31 is valid from the select on; each later bit is sampled before it is there.
    let late = (42768 << 16 & 1 << 31) | (42768 << 16 >> 1 & !(1 << 31));
    assert_eq!(adc.frame(0), late);
}

#[test]
fn clocks_keep_7_5_ns_from_the_select() {
    let mut adc = Adc::new(Variant::Ads8681);
    let now = adc.master.now;
    adc.chip.select(now);
    adc.chip.sclk(true, Sdi::stable(true), now + 7);
    adc.chip.sclk(false, Sdi::stable(true), now + 30);
    adc.chip.deselect(now + 1_000);
    assert_eq!(adc.rules(), [Rule::ClockAfterSelect(7)]);
    adc.chip.clear_violations();
    let now = now + 10_000;
    adc.chip.select(now);
    for k in 0..32 {
        // 0xd0140001, its last rising edge 7 ns before the select rises.
        let bit = 0xd014_0001_u32 >> (31 - k) & 1 == 1;
        adc.chip.sclk(true, Sdi::stable(bit), now + 100 + k * 50);
        adc.chip.sclk(false, Sdi::stable(bit), now + 105 + k * 50);
    }
    adc.chip.deselect(now + 100 + 31 * 50 + 7);
    assert_eq!(adc.rules(), [Rule::SelectAfterClock(7), Rule::ShortFrame(31)]);
    assert_eq!(adc.chip.range_sel(), 0);
    adc.chip.clear_violations();
    (adc.master.now, adc.master.half_ns, adc.master.margin_ns) = (now + 10_000, 8, 8);
    adc.frame(0xd014_0001);
    assert_eq!(adc.chip.range_sel(), 1, "8 ns are enough");
    assert_eq!(adc.rules(), []);
}

#[test]
fn in_mode_1_both_directions_are_wrong() {
    let mut adc = Adc::new(Variant::Ads8681);
    adc.chip.set_input(3.75);
    adc.frame(0);
    adc.master.mode = MODE_1;
    // Read one place too high.
    assert_eq!(adc.frame(0xd014_0002), 42768_u32 << 17);
    // Written one place too low: 0x680a0001 is no command.
    assert_eq!(adc.chip.range_sel(), 0);
    adc.master.mode = MODE_0;
    adc.frame(0xd014_0002);
    assert_eq!(adc.chip.range_sel(), 2);
}
