//! Reset, supplies, NAP, and power-down of the ADS868x: SBAS633E, 6.7 and 7.4.2.1, and RST_PWRCTL_REG.

use converter_chips::{ADC_POWER_UP_NS, Rule, Variant};

use crate::master::Adc;

/// A chip with every register changed that does not change the protocol.
fn configured() -> Adc {
    let mut adc = Adc::new(Variant::Ads8681);
    for (register, bits) in [(0x02, 5), (0x10, 0x0108), (0x14, 0x0041), (0x24, 0x1234), (0x28, 0x0012), (0x0c, 0x1100)]
    {
        adc.write(register, bits);
    }
    adc.chip.set_external_reference(4.096);
    adc
}

fn reset_pulse(adc: &mut Adc, width: u64) {
    adc.master.now += 10_000;
    adc.chip.set_rst(false, adc.master.now);
    adc.master.now += width;
    adc.chip.set_rst(true, adc.master.now);
}

fn registers(adc: &Adc) -> [u8; 8] {
    [0x02, 0x04, 0x0d, 0x10, 0x11, 0x14, 0x24, 0x28].map(|register| adc.chip.register(register))
}

const FRESH: [u8; 8] = [0, 0, 0, 0, 0, 0, 0xff, 0];

#[test]
fn rst_resets_all_and_takes_20_ms() {
    let mut adc = configured();
    assert_eq!(registers(&adc), [5, 0, 0x11, 8, 1, 0x41, 0x34, 0x12]);
    reset_pulse(&mut adc, 100);
    assert_eq!(registers(&adc), FRESH);
    let risen = adc.master.now;
    adc.master.high_ns = 20_000_000 - 1;
    adc.frame(0xd014_0001);
    assert_eq!(adc.master.floating, 32);
    assert_eq!(registers(&adc), FRESH);
    assert_eq!(adc.chip.violations()[0].rule, Rule::FrameDuringReset);
    assert!(adc.chip.rvs(risen + 20_000_000));
    adc.master.now = risen;
    adc.master.high_ns = 20_000_000;
    adc.frame(0xd014_0001);
    assert_eq!(adc.chip.register(0x14), 1);
}

#[test]
fn rst_is_low_for_100_ns() {
    let mut adc = configured();
    let before = registers(&adc);
    reset_pulse(&mut adc, 99);
    assert_eq!(registers(&adc), before);
    assert_eq!(adc.chip.violations()[0].rule, Rule::RstLow(99));
    adc.frame(0);
    assert_eq!(adc.master.floating, 0);
}

#[test]
fn an_application_reset_keeps_what_only_power_resets() {
    let mut adc = configured();
    adc.frame(0xd204_6900);
    adc.frame(0xd404_0024);
    reset_pulse(&mut adc, 100);
    // Kept: RSTn_APP, PAR_EN, RANGE_SEL. Cleared: VDD_AL_DIS, INTREF_DIS, RANGE_INCL, the device address, SDO1_CONFIG.
    assert_eq!(registers(&adc), [0, 4, 0, 8, 0, 1, 0xff, 0]);
    adc.master.high_ns = 999;
    adc.frame(0);
    assert_eq!(adc.master.floating, 32);
    adc.frame(0);
    assert_eq!(adc.master.floating, 0);
}

#[test]
fn while_rst_is_low_nothing_is_seen() {
    let mut adc = configured();
    adc.chip.set_rst(false, adc.master.now + 1_000);
    adc.frame(0);
    assert_eq!(adc.master.floating, 32);
    assert_eq!(adc.chip.violations()[0].rule, Rule::FrameDuringReset);
}

#[test]
fn a_dip_of_a_supply_puts_the_registers_back() {
    for supply in [converter_chips::Ads868x::set_avdd, converter_chips::Ads868x::set_dvdd] {
        let mut adc = configured();
        adc.master.now += 1_000;
        supply(&mut adc.chip, false, adc.master.now);
        adc.frame(0);
        assert_eq!(adc.master.floating, 32);
        supply(&mut adc.chip, true, adc.master.now);
        assert_eq!(registers(&adc), FRESH);
        adc.master.high_ns = ADC_POWER_UP_NS - 1;
        adc.frame(0);
        assert_eq!(adc.master.floating, 32);
        adc.master.high_ns = 100_000;
        assert_eq!(adc.frame(0), 0x8000_0000, "the old result is gone");
        adc.chip.set_input(3.75);
        assert_eq!(adc.convert(), 42768 << 16);
    }
}

#[test]
fn both_supplies_are_needed() {
    let mut adc = configured();
    adc.chip.set_avdd(false, 2_000_000);
    adc.chip.set_dvdd(false, 2_000_000);
    adc.chip.set_dvdd(true, 3_000_000);
    adc.master.now = 50_000_000;
    adc.frame(0);
    assert_eq!(adc.master.floating, 32);
    adc.chip.set_avdd(true, 60_000_000);
    adc.master.now = 80_000_000;
    adc.frame(0);
    assert_eq!(adc.master.floating, 0);
}

#[test]
fn in_power_down_nothing_is_converted() {
    let mut adc = Adc::new(Variant::Ads8681);
    adc.chip.set_input(3.75);
    adc.frame(0xd204_6900);
    // The sample at the end of this frame is still converted.
    adc.frame(0xd404_0001);
    adc.chip.set_input(0.0);
    assert_eq!(adc.frame(0), 42768 << 16);
    assert_eq!(adc.convert(), 42768 << 16, "the old result, again and again");
    adc.master.now += 50_000_000;
    assert_eq!(adc.convert(), 42768 << 16);
    adc.frame(0xd204_6900);
    adc.frame(0xd404_0000);
    assert_eq!(adc.convert(), 42768 << 16, "not yet awake");
    adc.master.now += 20_000_000;
    assert_eq!(adc.convert(), 32768 << 16);
}

#[test]
fn from_nap_the_chip_wakes_in_20_us() {
    let mut adc = Adc::new(Variant::Ads8681);
    adc.chip.set_input(3.75);
    adc.frame(0xd204_6900);
    adc.frame(0xd404_0002);
    adc.chip.set_input(0.0);
    adc.frame(0);
    assert_eq!(adc.frame(0), 42768 << 16, "asleep at the sample");
    assert!(matches!(adc.chip.violations()[0].rule, Rule::NapWake(_)));
    adc.master.margin_ns = 20_000;
    adc.frame(0);
    assert_eq!(adc.frame(0), 32768 << 16);
}

#[test]
fn the_first_result_can_be_chosen() {
    let mut adc = Adc::new(Variant::Ads8681);
    adc.chip = converter_chips::Ads868x::new(Variant::Ads8681).with_unknown_result(0x1234);
    assert_eq!(adc.frame(0), 0x1234_0000);
}
