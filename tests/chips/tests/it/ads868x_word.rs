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
fn without_flags_the_lower_half_is_0() {
    assert_eq!(word(FlagOrder::RangeFirst, 0xa686, 0), 0xa686_0000);
}

#[test]
fn table_7_6_all_flags() {
    // 16 bits, address 0101, range 0011, AVDD 01, input 10, two parities, 00.
    // 0xa686 has 7 ones: its parity bit is 1. With the flags there are 7 + 2 + 2 + 1 + 1 = 13: 1.
    assert_eq!(word(FlagOrder::RangeFirst, 0xa686, 0x7d08), 0xa686_0000 | 0b0101_0011_01_10_11_00);
}

#[test]
fn table_7_7_some_flags() {
    // DEVICE_ADDR_INCL 0, both AVDD flags, no input flags, range, parity: D[15:12] range, D[11:10] AVDD, D[9:8] parity.
    // 7 ones, and with range and AVDD 7 + 2 + 1 = 10: parities 1 and 0.
    assert_eq!(word(FlagOrder::RangeFirst, 0xa686, 0x3108), 0xa686_0000 | 0b0011_01_10 << 8);
}

#[test]
fn the_range_alone_stands_at_bits_15_to_12_in_either_order() {
    for order in [FlagOrder::RangeFirst, FlagOrder::AlarmsFirst] {
        assert_eq!(word(order, 0xa686, 0x0100), 0xa686_3000);
    }
}

#[test]
fn where_a_field_stands_depends_on_those_before_it() {
    assert_eq!(word(FlagOrder::RangeFirst, 0, 0x4100), 0b0101_0011 << 8, "address, range");
    assert_eq!(word(FlagOrder::RangeFirst, 0, 0x4000), 0b0101 << 12);
    // At code 0 the input is below nothing and above nothing.
    assert_eq!(word(FlagOrder::RangeFirst, 0, 0x2000), 1 << 15, "AVDD low alone");
    assert_eq!(word(FlagOrder::RangeFirst, 0, 0x1000), 0, "AVDD high alone");
    assert_eq!(word(FlagOrder::RangeFirst, 0x8000, 0x0400), 0x8000_8000, "input high alone");
}

#[test]
fn what_a_user_of_the_forum_measured() {
    // Thread 981061: DATAOUT_CTL 0x3d00 and RANGE_SEL 3 gave the range at bits 15–12 and the input's high flag at bit 9.
    assert_eq!(word(FlagOrder::RangeFirst, 0x8000, 0x3d00), 0x8000_0000 | 0b0011_01_10 << 8);
}

#[test]
fn the_order_of_the_older_sheets() {
    assert_eq!(word(FlagOrder::AlarmsFirst, 0xa686, 0x7d08), 0xa686_0000 | 0b0101_01_10_0011_11_00);
    assert_eq!(word(FlagOrder::AlarmsFirst, 0xa686, 0x3108), 0xa686_0000 | 0b01_0011_10 << 8);
}

#[test]
fn parity_as_ti_showed_it() {
    // Thread 1218070: only the parity is included, the result is 0xa686, and 0xc follows.
    assert_eq!(word(FlagOrder::RangeFirst, 0xa686, 0x0008), 0xa686_c000);
    assert_eq!(word(FlagOrder::RangeFirst, 0xa687, 0x0008), 0xa687_0000);
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
