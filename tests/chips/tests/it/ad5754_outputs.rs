//! From codes to volts: ranges, power-up, LDAC, CLR, settling, supplies and limits.

use converter_chips::{Rule, SerialChip};

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
fn the_output_stays_at_0_v_until_powered_up() {
    let mut dac = Dac::new();
    dac.write(0x08_0004);
    assert_eq!(dac.settled(), 0.0);
    dac.write(0x10_0001);
    assert_eq!(dac.settled(), -10.0, "code 0 in ±10 V");
    assert_eq!(power(&mut dac), 1);
    assert_eq!(dac.chip.violations(), []);
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
fn a_change_under_way_goes_on_from_where_it_is() {
    let mut dac = Dac::loaded(1, 0x8000);
    let cleared = dac.master.now + 5_000;
    dac.chip.set_clr(false, cleared);
    assert!(close(dac.chip.volts(cleared), 2.5));
    assert!(close(dac.chip.volts(cleared + 5_000), 1.25));
    assert_eq!(dac.chip.volts(cleared + 10_000), 0.0);
}

#[test]
fn a_new_range_moves_the_output() {
    let mut dac = Dac::loaded(1, 0x8000);
    assert_eq!(dac.settled(), 5.0);
    dac.write(0x08_0004);
    assert_eq!(dac.settled(), 0.0, "mid-scale of ±10 V");
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
fn a_frame_is_cut_by_a_loss_of_dvcc() {
    let mut dac = Dac::new();
    dac.chip.select(dac.master.now);
    dac.chip.set_dvcc(false, dac.master.now + 100);
    dac.chip.set_dvcc(true, dac.master.now + 200);
    dac.chip.deselect(dac.master.now + 300);
    assert_eq!(dac.chip.violations(), []);
    dac.write(0x08_0001);
    assert_eq!(dac.chip.range(), 1);
}

#[test]
fn over_current_is_reported() {
    let mut dac = Dac::loaded(1, 0x8000);
    dac.chip.set_over_current(true);
    assert_eq!(power(&mut dac), 1 << 7 | 1);
    assert_eq!(dac.settled(), 5.0, "the clamp limits it");
    dac.chip.set_dvcc(false, dac.master.now);
    dac.chip.set_dvcc(true, dac.master.now + 1_000);
    dac.wait(1_000);
    assert_eq!(power(&mut dac), 1 << 7, "a short circuit outlives a reset");
    dac.chip.set_over_current(false);
    assert_eq!(power(&mut dac), 0);
}

#[test]
fn the_thermal_shutdown_acts_once_it_is_on() {
    let mut dac = Dac::loaded(1, 0x8000);
    dac.chip.set_over_temperature(true, dac.master.now);
    assert_eq!((power(&mut dac), dac.settled()), (1, 5.0), "off at power-up");
    dac.write(0x19_000c);
    assert_eq!(dac.chip.control_bits(), 0xc);
    assert_eq!((power(&mut dac), dac.settled()), (0x21, 0.0));
    dac.chip.set_over_temperature(false, dac.master.now);
    assert_eq!((power(&mut dac), dac.settled()), (1, 5.0), "it comes back when it is cool");
}
