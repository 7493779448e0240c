//! Commands and registers of the ADS868x: SBAS633E, 7.5.2 and the register maps.

use converter_chips::{Rule, Variant, address};

use crate::master::Adc;

fn adc() -> Adc {
    Adc::new(Variant::Ads8681)
}

#[test]
fn registers_at_power_up() {
    let mut adc = adc();
    for register in (0..0x40).step_by(2) {
        let expected = if register == u32::from(address::ALARM_H_TH) { 0xffff_0000 } else { 0 };
        assert_eq!(adc.half_word(register), expected, "{register:#04x}");
    }
    assert_eq!(adc.half_word(0x1fe), 0);
}

#[test]
fn reserved_bits_read_0() {
    let mut adc = adc();
    // The registers of the protocol last: they change how the rest is read.
    for (register, bits) in [
        (0x00, 0x0000),
        (0x02, 0x000f),
        (0x06, 0x0000),
        (0x0a, 0x0000),
        (0x0e, 0x0000),
        (0x12, 0x0000),
        (0x14, 0x004f),
        (0x16, 0x0000),
        (0x18, 0x0000),
        (0x20, 0x0000),
        (0x24, 0xffff),
        (0x26, 0xfc00),
        (0x28, 0xffff),
        (0x2a, 0x0000),
        (0x2c, 0x0000),
        (0x10, 0x7d0f),
        (0x0c, 0x1343),
        (0x08, 0x0003),
    ] {
        adc.write(register, 0xffff);
        let byte = |k: u32| u32::from(adc.chip.register((register + k) as u16));
        assert_eq!(byte(1) << 8 | byte(0), bits, "{register:#04x}");
    }
}

#[test]
fn bytes_and_bits_of_a_half_word() {
    let mut adc = adc();
    let mut after = |command: u32| {
        adc.frame(command);
        adc.half_word(0x24) >> 16
    };
    assert_eq!(after(0xd024_1234), 0x1234, "WRITE: both bytes");
    assert_eq!(after(0xd224_5678), 0x5634, "WRITE: the MS byte");
    assert_eq!(after(0xd424_9abc), 0x56bc, "WRITE: the LS byte");
    assert_eq!(after(0xd824_000f), 0x56bf, "SET_HWORD");
    assert_eq!(after(0xc024_5003), 0x06bc, "CLEAR_HWORD");
    assert_eq!(after(0xd625_ffff), 0x06bc, "no command");
    assert_eq!(after(0xd025_4321), 0x4321, "an odd address is the even one below");
    assert_eq!(after(0xd225_00ff), 0x0021);
    assert_eq!(after(0xd425_0001), 0x0001);
}

#[test]
fn bits_25_and_26_do_not_matter_to_the_other_commands() {
    let mut adc = adc();
    for k in 0..4 {
        adc.frame(0xd024_0000);
        adc.frame(0xd824_00f0 | k << 25);
        assert_eq!(adc.half_word(0x24), 0x00f0_0000);
        adc.frame(0xc024_0030 | k << 25);
        adc.frame(0xc824_0000 | k << 25);
        assert_eq!(adc.frame(0), 0x00c0_0000);
        adc.frame(0x4824_0000 | k << 25);
        assert_eq!(adc.frame(0), 0xc000_0000);
    }
}

#[test]
fn answers_are_left_aligned_and_come_once() {
    let mut adc = adc();
    adc.chip.set_input(3.75);
    adc.frame(0xd024_1234);
    adc.frame(0xc824_0000);
    assert_eq!(adc.frame(0x4824_0000), 0x1234_0000, "READ_HWORD: 16 bits");
    assert_eq!(adc.frame(0x4825_0000), 0x3400_0000, "READ: 8 bits");
    assert_eq!(adc.frame(0), 0x1200_0000, "READ: the odd byte");
    assert_eq!(adc.frame(0), 42768 << 16, "a conversion, as before");
}

#[test]
fn the_ninth_bit_of_the_address_counts() {
    let mut adc = adc();
    adc.frame(0xd124_1234);
    assert_eq!(adc.half_word(0x24), 0xffff_0000);
    adc.frame(0xc924_0000);
    assert_eq!(adc.frame(0), 0);
}

#[test]
fn all_else_is_no_operation() {
    let mut adc = adc();
    adc.chip.set_input(3.75);
    adc.frame(0);
    for opcode in (0..32).filter(|opcode| ![0b11000, 0b11001, 0b01001, 0b11010, 0b11011].contains(opcode)) {
        assert_eq!(adc.frame(opcode << 27 | 0x0024_1234), 42768 << 16);
    }
    assert_eq!(adc.half_word(0x24), 0xffff_0000);
    assert_eq!(adc.chip.violations(), []);
}

#[test]
fn rst_pwrctl_needs_its_key_first() {
    let mut adc = adc();
    let low = u32::from(address::RST_PWRCTL);
    adc.frame(0xd004_0037);
    assert_eq!(adc.chip.register(address::RST_PWRCTL), 0);
    adc.frame(0xd004_6937);
    assert_eq!(adc.chip.register(address::RST_PWRCTL), 0, "the key was not there before");
    assert_eq!(adc.half_word(low), 0x6900_0000, "now it is");
    adc.frame(0xd404_0034);
    assert_eq!(adc.half_word(low), 0x0034_0000, "written, and the key is used up");
    adc.frame(0xd404_0000);
    assert_eq!(adc.half_word(low), 0x0034_0000);
    // The other way: the key as a byte.
    adc.frame(0xd204_6900);
    adc.frame(0xd404_0000);
    assert_eq!(adc.half_word(low), 0);
    assert_eq!(adc.rules(), [Rule::WithoutKey; 3]);
}

#[test]
fn alarms_of_the_input() {
    let mut adc = adc();
    // ±12.288 V: 0xc000 is 6.144 V, 0x4000 is −6.144 V.
    adc.write(0x24, 0xc000);
    adc.write(0x28, 0x4000);
    let mut flags = |volts: f64| {
        adc.chip.set_input(volts);
        adc.convert();
        // The read itself converts, and clears the tripped flags.
        (adc.half_word(0x20) >> 16) as u16
    };
    assert_eq!(flags(0.0), 0);
    assert_eq!(flags(6.144), 0, "at the threshold");
    assert_eq!(flags(6.2), 0x0411, "active, tripped, overview");
    // One more conversion over the threshold lay between the read and this change.
    assert_eq!(flags(-7.0), 0x0831);
    assert_eq!(flags(0.0), 0x0021);
    assert_eq!(flags(0.0), 0);
}

#[test]
fn alarms_of_avdd_which_can_be_switched_off() {
    let mut adc = adc();
    adc.chip.set_avdd_alarm(true, false);
    adc.convert();
    assert_eq!(adc.half_word(0x20), 0x8081_0000);
    adc.chip.set_avdd_alarm(false, true);
    adc.convert();
    adc.half_word(0x20);
    assert_eq!(adc.half_word(0x20), 0x4041_0000);
    adc.frame(0xd204_6900);
    adc.frame(0xd404_0030);
    adc.half_word(0x20);
    adc.convert();
    assert_eq!(adc.half_word(0x20), 0);
}
