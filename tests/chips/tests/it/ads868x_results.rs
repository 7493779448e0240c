//! Results and registers of the ADS868x: SBAS633E, 7.3.8 with Table 7-4, 7.5.2, 7.5.3 with Tables 7-6 and 7-7; supplies: 6.7.

use converter_chips::{ADC_POWER_UP_NS, Ads868x, Rule, Variant};

use crate::master::Adc;

fn adc() -> Adc {
    Adc::new(Variant::Ads8681)
}

fn code(adc: &mut Adc, volts: f64) -> u32 {
    adc.chip.set_input(volts);
    adc.convert() >> 16
}

#[test]
fn codes_of_every_range() {
    // RANGE_SEL, negative and positive full scale in V, LSB in µV.
    for (select, low, high, lsb_uv) in [
        (0, -12.288, 12.288, 375.0),
        (1, -10.24, 10.24, 312.5),
        (2, -6.144, 6.144, 187.5),
        (3, -5.12, 5.12, 156.25),
        (4, -2.56, 2.56, 78.125),
        (8, 0.0, 12.288, 187.5),
        (9, 0.0, 10.24, 156.25),
        (10, 0.0, 6.144, 93.75),
        (11, 0.0, 5.12, 78.125),
    ] {
        let mut adc = adc();
        adc.frame(0xd014_0000 | select);
        let lsb = lsb_uv * 1e-6;
        for (volts, expected) in [
            (low, 0),
            (low + lsb, 1),
            (low + 0.4 * lsb, 0),
            (low + 0.6 * lsb, 1),
            ((low + high) / 2.0, 0x8000),
            ((low + high) / 2.0 - lsb, 0x7fff),
            (high - lsb, 0xffff),
        ] {
            assert_eq!(code(&mut adc, volts), expected, "RANGE_SEL {select}: {volts} V");
        }
        for beyond in [0.001, 1.0, 20.0] {
            assert_eq!(code(&mut adc, low - beyond), 0);
            assert_eq!(code(&mut adc, high + beyond), 0xffff);
        }
    }
}

#[test]
fn answers_are_left_aligned_and_come_once() {
    let mut adc = adc();
    adc.chip.set_input(3.75);
    adc.frame(0xd014_000b);
    adc.frame(0xc814_0000);
    assert_eq!(adc.frame(0xc815_0000), 0x000b_0000);
    assert_eq!(adc.frame(0xc810_0000), 0x000b_0000, "an odd address is the even one below");
    assert_eq!(adc.frame(0), 0);
    // 3.75 V / 78.125 µV
    assert_eq!(adc.frame(0), 48000 << 16, "a conversion, as before");
    assert_eq!(adc.rules(), []);
}

#[test]
fn the_range_follows_the_result_at_once_and_the_result_is_of_the_old_one() {
    let mut adc = adc();
    adc.frame(0xd010_0100);
    adc.chip.set_input(3.75);
    adc.frame(0xd014_0003);
    // Sampled in ±12.288 V when the command was carried out.
    assert_eq!(adc.frame(0), 42768 << 16 | 0x3000);
    // (3.75 V + 5.12 V) / 156.25 µV
    assert_eq!(adc.frame(0), 56768 << 16 | 0x3000);
}

#[test]
fn what_the_model_does_not_have_is_ignored_and_noted() {
    let mut adc = adc();
    // A range without a code, the reference off, other fields, another register, the ninth bit of an address; bytes, bits, no command.
    let unknown = [
        0xd014_0005,
        0xd014_0049,
        0xd010_0108,
        0xd024_1234,
        0xd114_0001,
        0xd214_0001,
        0xd814_0001,
        0xc014_0001,
        0x4814_0000,
        0x0014_0001,
    ];
    for word in unknown {
        adc.frame(word);
    }
    assert_eq!(adc.chip.range_sel(), 0);
    assert_eq!(adc.rules(), unknown.map(Rule::UnknownCommand));
}

#[test]
fn a_dip_of_a_supply_puts_the_registers_back() {
    for supply in [Ads868x::set_avdd, Ads868x::set_dvdd] {
        let mut adc = adc();
        adc.frame(0xd014_0001);
        adc.frame(0xd010_0100);
        adc.wait(1_000);
        supply(&mut adc.chip, false, adc.master.now);
        adc.frame(0);
        assert_eq!(adc.master.floating, 32);
        assert_eq!(adc.rules(), [Rule::FrameDuringReset]);
        supply(&mut adc.chip, true, adc.master.now);
        assert_eq!(adc.chip.range_sel(), 0);
        adc.master.high_ns = ADC_POWER_UP_NS - 1;
        adc.frame(0);
        assert_eq!(adc.master.floating, 32);
        adc.master.high_ns = 100_000;
        assert_eq!(adc.frame(0), 0x8000_0000, "the old result is gone");
        assert_eq!(code(&mut adc, 3.75), 42768);
    }
}
