//! From codes to volts: ranges, power-up, LDAC, CLR, settling, supplies and limits.

use converter_chips::{Ad5754, Rule};

use crate::master::Dac;

fn close(left: f64, right: f64) -> bool {
    (left - right).abs() < 1e-9
}

/// DB10 to DB0 of the power control register.
fn power(dac: &mut Dac) -> u64 {
    dac.read(0x90_0000) & 0x07ff
}

#[test]
fn transfer_function_with_2_5_v() {
    // Data sheet, tables of ideal output voltage: full scale × D / 65536, gains 2, 4, 4.32, 4, 8, 8.64.
    for (range, code, expected) in [
        (0, 0xffff, 5.0 * 65535.0 / 65536.0),
        (0, 0x8000, 2.5),
        (1, 0xffff, 10.0 * 65535.0 / 65536.0),
        (1, 0x0001, 10.0 / 65536.0),
        (2, 0x8000, 5.4),
        (3, 0xffff, 5.0 * 32767.0 / 32768.0),
        (3, 0x0000, -5.0),
        (4, 0x8000, 0.0),
        (4, 0x4000, -5.0),
        (5, 0x0000, -10.8),
    ] {
        let volts = Dac::loaded(range, code).settled();
        assert!(close(volts, expected), "range {range}, code {code:#06x}: {volts} V, not {expected} V");
    }
}

#[test]
fn a_code_for_a_channel_without_power_is_lost() {
    let mut dac = Dac::new();
    dac.chip.set_ldac(false, 0);
    dac.write(0x00_8000);
    assert_eq!(dac.rules(), [Rule::WriteWhilePoweredDown]);
    dac.write(0x10_0001);
    assert_eq!(dac.settled(), 0.0);
    dac.write(0x00_8000);
    assert_eq!(dac.settled(), 2.5);
    dac.write(0x10_0000);
    assert_eq!(dac.settled(), 0.0);
    dac.write(0x10_0001);
    assert_eq!(dac.settled(), 2.5, "the code is kept");
}

#[test]
fn a_channel_is_loaded_10_us_after_its_power_up() {
    for (after_ns, volts, rules) in [(9_999, 0.0, vec![Rule::LoadDuringPowerUp]), (10_000, 5.0, vec![])] {
        let mut dac = Dac::new();
        dac.write(0x08_0001);
        dac.write(0x10_0001);
        let powered = dac.master.now;
        dac.master.high_ns = 200;
        dac.write(0x00_8000);
        dac.chip.set_ldac(false, powered + after_ns);
        dac.master.now = powered + after_ns;
        assert_eq!(dac.settled(), volts);
        assert_eq!(dac.rules(), rules);
    }
}

#[test]
fn ldac_loads_when_it_falls_and_while_it_is_low() {
    let mut dac = Dac::powered(1);
    dac.write(0x00_4000);
    assert_eq!(dac.settled(), 0.0, "LDAC is high");
    assert_eq!(dac.read(0x80_0000) & 0xffff, 0x4000, "a read does not show that");
    dac.chip.set_ldac(false, dac.master.now);
    assert_eq!(dac.settled(), 2.5);
    dac.write(0x00_8000);
    assert_eq!(dac.settled(), 5.0);
}

#[test]
fn an_output_settles_in_10_us() {
    let dac = Dac::loaded(1, 0x8000);
    let loaded = dac.master.now;
    assert_eq!(dac.chip.volts(loaded), 0.0);
    assert!(close(dac.chip.volts(loaded + 5_000), 2.5));
    assert!(dac.chip.volts(loaded + 9_999) < 5.0);
    assert_eq!(dac.chip.volts(loaded + 10_000), 5.0);
}

#[test]
fn clr_clears_and_holds_off_loads() {
    for range in [1, 4] {
        let mut dac = Dac::loaded(range, 0x2000);
        let before = dac.settled();
        assert_ne!(before, 0.0);
        dac.chip.set_clr(false, dac.master.now);
        assert_eq!(dac.settled(), 0.0);
        // Neither LDAC held low nor LDAC that falls gets through.
        dac.write(0x00_2000);
        dac.chip.set_ldac(true, dac.master.now);
        dac.chip.set_ldac(false, dac.master.now);
        assert_eq!(dac.settled(), 0.0);
        assert_eq!(dac.rules(), [Rule::LoadWhileClear; 2]);
        dac.chip.set_clr(true, dac.master.now);
        assert_eq!(dac.settled(), 0.0, "cleared until loaded anew");
        assert_eq!(dac.read(0x80_0000) & 0xffff, 0x2000, "what was written, not what drives the output");
        dac.write(0x00_2000);
        assert_eq!(dac.settled(), before);
    }
}

#[test]
fn dvcc_loss_resets_everything() {
    let mut dac = Dac::loaded(1, 0x8000);
    assert_eq!(dac.settled(), 5.0);
    dac.write(0x19_000c);
    dac.chip.set_dvcc(false, dac.master.now);
    assert_eq!(dac.chip.volts(dac.master.now + 5_000), 2.5, "on its way to 0 V");
    assert_eq!(dac.settled(), 0.0);
    dac.write(0x08_0004);
    assert_eq!(dac.master.floating, 24, "no chip, no SDO");
    dac.chip.set_dvcc(true, dac.master.now);
    assert_eq!(power(&mut dac), 0);
    assert_eq!(dac.read(0x88_0000) & 7, 0);
    assert_eq!(dac.read(0x99_0000) & 15, 0b0100);
    assert_eq!(dac.read(0x80_0000) & 0xffff, 0);
    assert_eq!(dac.settled(), 0.0);
}

#[test]
fn an_ad5754r_without_a_reference_stays_at_0_v() {
    for (mut chip, power_bits, read_back, volts, rules) in [
        (Ad5754::new(), 0x01, 0x01, 5.0, vec![]),
        (Ad5754::new(), 0x11, 0x01, 5.0, vec![]),
        (Ad5754::with_reference(false), 0x01, 0x01, 0.0, vec![]),
        (Ad5754::with_reference(false), 0x11, 0x11, 5.0, vec![]),
        (Ad5754::with_reference(true), 0x01, 0x01, 5.0, vec![]),
        (Ad5754::with_reference(true), 0x11, 0x11, 5.0, vec![Rule::TwoReferences]),
    ] {
        chip.set_ldac(false, 0);
        let mut dac = Dac { chip, ..Dac::new() };
        dac.write(0x08_0001);
        dac.write(0x10_0000 | power_bits);
        dac.wait(10_000);
        dac.write(0x00_8000);
        assert_eq!(dac.settled(), volts, "{power_bits:#x}");
        assert_eq!(dac.rules(), rules, "{power_bits:#x}");
        assert_eq!(dac.read(0x80_0000) & 0xffff, 0x8000, "the code does not show it");
        assert_eq!(power(&mut dac), read_back, "{power_bits:#x}");
        dac.chip.set_dvcc(false, dac.master.now);
        dac.chip.set_dvcc(true, dac.master.now);
        assert_eq!(power(&mut dac), 0, "off after power-up");
    }
}
