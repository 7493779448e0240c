//! Volts to codes: SBAS633E, 7.3.8 with Table 7-4.

use converter_chips::{AdcRange, Variant};

use crate::master::Adc;

/// RANGE_SEL, negative and positive full scale in V, LSB in µV.
const TABLE: [(u32, f64, f64, f64); 9] = [
    (0, -12.288, 12.288, 375.0),
    (1, -10.24, 10.24, 312.5),
    (2, -6.144, 6.144, 187.5),
    (3, -5.12, 5.12, 156.25),
    (4, -2.56, 2.56, 78.125),
    (8, 0.0, 12.288, 187.5),
    (9, 0.0, 10.24, 156.25),
    (10, 0.0, 6.144, 93.75),
    (11, 0.0, 5.12, 78.125),
];

fn code(adc: &mut Adc, volts: f64) -> u32 {
    adc.chip.set_input(volts);
    adc.convert() >> 16
}

#[test]
fn codes_of_every_range() {
    for (select, low, high, lsb_uv) in TABLE {
        let mut adc = Adc::new(Variant::Ads8681);
        adc.write(0x14, select);
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
fn the_reference_scales_all() {
    let mut adc = Adc::new(Variant::Ads8681);
    adc.chip.set_internal_reference(4.0);
    // (6 V + 12 V) / 24 V
    assert_eq!(code(&mut adc, 6.0), 0xc000);
}

#[test]
fn without_the_internal_reference_the_pin_counts() {
    let mut adc = Adc::new(Variant::Ads8681);
    adc.write(0x14, 0x40);
    assert_eq!(code(&mut adc, 0.1), 0xffff, "nothing at the pin");
    assert_eq!(code(&mut adc, -0.1), 0);
    adc.chip.set_external_reference(4.096);
    assert_eq!(code(&mut adc, 3.75), 42768);
}

#[test]
fn codes_without_a_range() {
    assert_eq!((5..8).chain(12..16).filter_map(AdcRange::from_bits).count(), 0);
    assert_eq!((0..16).filter_map(AdcRange::from_bits).count(), TABLE.len());
}
