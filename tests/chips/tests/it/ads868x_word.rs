//! The output word of the ADS868x: SBAS633E, 7.5.3 with Tables 7-6 and 7-7, and DATAOUT_CTL_REG.

use converter_chips::{Ads868x, FlagOrder, Variant};

use crate::master::Adc;

/// Input in ±5.12 V for a code: LSB 156.25 µV.
fn volts(code: u16) -> f64 {
    f64::from(code) * 156.25e-6 - 5.12
}

/// A chip in ±5.12 V (range 3) with device address 0b0101, an input of this code that is above the alarm's threshold, AVDD
/// too low, and this DATAOUT_CTL. Flags: AVDD high 0, low 1; input high 1, low 0.
fn word(order: FlagOrder, code: u16, dataout: u32) -> u32 {
    let mut adc = Adc::new(Variant::Ads8681);
    adc.chip = Ads868x::new(Variant::Ads8681).with_flag_order(order);
    adc.write(0x02, 0b0101);
    adc.write(0x14, 3);
    adc.write(0x24, 0x0010);
    adc.write(0x10, dataout);
    adc.chip.set_input(volts(code));
    adc.chip.set_avdd_alarm(true, false);
    adc.frame(0);
    adc.frame(0)
}

#[test]
fn words_with_their_flags() {
    use FlagOrder::{AlarmsFirst, RangeFirst};
    for (what, order, code, dataout, lower) in [
        ("no flags", RangeFirst, 0xa686, 0, 0),
        // 16 bits, address 0101, range 0011, AVDD 01, input 10, two parities, 00.
        // 0xa686 has 7 ones: its parity bit is 1. With the flags there are 7 + 2 + 2 + 1 + 1 = 13: 1.
        ("table 7-6", RangeFirst, 0xa686, 0x7d08, 0b0101_0011_01_10_11_00),
        // Without the address and the input flags. 7 ones, and with range and AVDD 7 + 2 + 1 = 10: parities 1 and 0.
        ("table 7-7", RangeFirst, 0xa686, 0x3108, 0b0011_01_10 << 8),
        ("older sheets, all flags", AlarmsFirst, 0xa686, 0x7d08, 0b0101_01_10_0011_11_00),
        ("older sheets, some flags", AlarmsFirst, 0xa686, 0x3108, 0b01_0011_10 << 8),
        ("range alone", RangeFirst, 0xa686, 0x0100, 0x3000),
        ("range alone", AlarmsFirst, 0xa686, 0x0100, 0x3000),
        ("address, range", RangeFirst, 0, 0x4100, 0b0101_0011 << 8),
        ("address alone", RangeFirst, 0, 0x4000, 0b0101 << 12),
        // At code 0 the input is below nothing and above nothing.
        ("AVDD low alone", RangeFirst, 0, 0x2000, 1 << 15),
        ("AVDD high alone", RangeFirst, 0, 0x1000, 0),
        ("input high alone", RangeFirst, 0x8000, 0x0400, 0x8000),
        // Measured by a user of TI's forum: the range at bits 15–12 and the input's high flag at bit 9.
        ("thread 981061", RangeFirst, 0x8000, 0x3d00, 0b0011_01_10 << 8),
        // Shown by TI: only the parity is included, the result is 0xa686, and 0xc follows.
        ("thread 1218070", RangeFirst, 0xa686, 0x0008, 0xc000),
        ("even parity", RangeFirst, 0xa687, 0x0008, 0),
    ] {
        assert_eq!(word(order, code, dataout), u32::from(code) << 16 | lower, "{what}, {order:?}");
    }
}

#[test]
fn patterns_take_the_place_of_everything() {
    for (data_val, pattern) in [(4, 0), (5, 0xffff_ffff), (6, 0x5555_5555), (7, 0x3333_3333)] {
        let mut adc = Adc::new(Variant::Ads8681);
        adc.write(0x10, 0x0100 | data_val);
        adc.frame(0xc810_0000);
        assert_eq!(adc.frame(0), pattern, "DATA_VAL {data_val}, also in place of an answer");
    }
    for data_val in 0..4 {
        assert_eq!(word(FlagOrder::RangeFirst, 0xa686, data_val), 0xa686_0000);
    }
}

#[test]
fn a_new_range_shows_at_once_and_the_result_is_of_the_old_one() {
    let mut adc = Adc::new(Variant::Ads8681);
    adc.write(0x10, 0x0100);
    adc.chip.set_input(3.75);
    adc.frame(0xd014_0003);
    // Sampled in ±12.288 V when the command was carried out.
    assert_eq!(adc.frame(0), 42768 << 16 | 0x3000);
    // (3.75 V + 5.12 V) / 156.25 µV
    assert_eq!(adc.frame(0), 56768 << 16 | 0x3000);
}
