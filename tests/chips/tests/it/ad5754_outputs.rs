//! From codes to volts: ranges, power-up, LDAC, CLR, settling.

use converter_chips::{Channel, Coding, DacRange, Rule, Unspecified};

use crate::master::Dac;

const PLAIN: Unspecified = Unspecified::plain();

fn close(left: f64, right: f64) -> bool {
    (left - right).abs() < 1e-9
}

/// Codes in the DAC register of channel A, loaded at once.
fn volts(coding: Coding, range: u64, code: u64) -> f64 {
    let mut dac = Dac::powered(coding, PLAIN, range);
    dac.write(code);
    dac.ldac_pulse();
    dac.settled()[0]
}

#[test]
fn transfer_function_with_2_5_v() {
    use Coding::{OffsetBinary, TwosComplement};
    // Data sheet, tables of ideal output voltage: full scale × D / 65536, gains 2, 4, 4.32, 4, 8, 8.64.
    for (coding, range, code, expected) in [
        (OffsetBinary, 0, 0xffff, 5.0 * 65535.0 / 65536.0),
        (OffsetBinary, 0, 0x8000, 2.5),
        (OffsetBinary, 1, 0xffff, 10.0 * 65535.0 / 65536.0),
        (OffsetBinary, 1, 0x0001, 10.0 / 65536.0),
        (OffsetBinary, 2, 0x8000, 5.4),
        (OffsetBinary, 3, 0xffff, 5.0 * 32767.0 / 32768.0),
        (OffsetBinary, 3, 0x0000, -5.0),
        (OffsetBinary, 4, 0x8000, 0.0),
        (OffsetBinary, 4, 0x4000, -5.0),
        (OffsetBinary, 5, 0x0000, -10.8),
        (TwosComplement, 1, 0x8000, 5.0),
        (TwosComplement, 4, 0x7fff, 10.0 * 32767.0 / 32768.0),
        (TwosComplement, 4, 0x8000, -10.0),
        (TwosComplement, 4, 0x0000, 0.0),
        (TwosComplement, 4, 0xffff, -10.0 / 32768.0),
        (TwosComplement, 5, 0x4000, 5.4),
    ] {
        let volts = volts(coding, range, code);
        assert!(close(volts, expected), "{coding:?}, range {range}, code {code:#06x}: {volts} V, not {expected} V");
    }
}

#[test]
fn outputs_stay_at_0_v_until_powered_up() {
    let mut dac = Dac::new(Coding::OffsetBinary, Unspecified::hostile());
    dac.write(0x0c_0004);
    assert_eq!(dac.settled(), [0.0; 4]);
    dac.write(0x10_0002);
    assert_eq!(dac.settled(), [0.0, -10.0, 0.0, 0.0], "code 0 in ±10 V");
    assert_eq!(dac.chip.violations(), []);
}

#[test]
fn a_plain_chip_waits_for_its_first_code() {
    let mut dac = Dac::powered(Coding::OffsetBinary, PLAIN, 4);
    assert_eq!(dac.settled(), [0.0; 4]);
    dac.write(0x02_c000);
    dac.ldac_pulse();
    assert_eq!(dac.settled(), [-10.0, -10.0, 5.0, -10.0], "one pulse of LDAC loads all");
}

#[test]
fn a_code_for_a_channel_without_power_is_lost() {
    let mut dac = Dac::new(Coding::OffsetBinary, PLAIN);
    dac.write(0x0c_0001);
    dac.write(0x10_0001);
    dac.wait(10_000);
    dac.write(0x04_8000);
    assert_eq!(dac.rules(), [1, 2, 3].map(Rule::WriteWhilePoweredDown));
    dac.write(0x10_000f);
    dac.wait(10_000);
    dac.write(0x1d_0000);
    assert_eq!(dac.settled(), [5.0, 0.0, 0.0, 0.0]);
}

#[test]
fn a_channel_is_loaded_10_us_after_its_power_up() {
    let mut dac = Dac::new(Coding::OffsetBinary, PLAIN);
    dac.write(0x0c_0001);
    dac.write(0x10_0001);
    let powered = dac.master.now;
    dac.master.high_ns = 200;
    dac.write(0x00_8000);
    dac.chip.set_ldac(false, powered + 9_999);
    dac.chip.set_ldac(true, powered + 10_050);
    dac.master.now = powered + 10_050;
    assert_eq!(dac.settled()[0], 0.0);
    assert!(dac.rules().contains(&Rule::LoadDuringPowerUp(0)));
    dac.ldac_pulse();
    assert_eq!(dac.settled()[0], 5.0);
    assert_eq!(dac.chip.loaded_code(Channel::A), 0x8000);
}

#[test]
fn ten_microseconds_are_enough() {
    let mut dac = Dac::new(Coding::OffsetBinary, PLAIN);
    dac.write(0x10_0001);
    let powered = dac.master.now;
    dac.chip.set_ldac(false, powered + 10_000);
    assert_eq!(dac.chip.violations(), []);
}

#[test]
fn ldac_low_loads_what_a_frame_has_written() {
    let mut dac = Dac::powered(Coding::OffsetBinary, PLAIN, 1);
    dac.write(0x00_4000);
    dac.write(0x01_4000);
    assert_eq!(dac.settled(), [0.0; 4], "LDAC is high");
    dac.chip.set_ldac(false, dac.master.now);
    dac.wait(50);
    assert_eq!(dac.settled(), [2.5, 2.5, 0.0, 0.0]);
    dac.write(0x02_8000);
    assert_eq!(dac.settled(), [2.5, 2.5, 5.0, 0.0]);
    dac.write(0x04_c000);
    assert_eq!(dac.settled(), [7.5; 4]);
}

#[test]
fn ldac_falls_130_ns_after_sync_and_stays_low_for_20_ns() {
    let mut dac = Dac::powered(Coding::OffsetBinary, PLAIN, 1);
    let mut pulse = |after: u64, width: u64| {
        dac.write(0x00_8000);
        dac.wait(after);
        dac.chip.set_ldac(false, dac.master.now);
        dac.wait(width);
        dac.chip.set_ldac(true, dac.master.now);
        dac.settled()[0]
    };
    assert_eq!(pulse(129, 20), 0.0);
    assert_eq!(pulse(130, 19), 0.0);
    assert_eq!(pulse(130, 20), 5.0);
    assert_eq!(dac.rules(), [Rule::LdacAfterSync(129), Rule::LdacLow(19)]);
}

#[test]
fn an_output_settles_in_10_us() {
    let mut dac = Dac::powered(Coding::OffsetBinary, PLAIN, 1);
    dac.write(0x00_8000);
    dac.write(0x1d_0000);
    let loaded = dac.master.now;
    assert_eq!(dac.chip.volts(Channel::A, loaded), 0.0);
    assert!(close(dac.chip.volts(Channel::A, loaded + 5_000), 2.5));
    assert!(dac.chip.volts(Channel::A, loaded + 9_999) < 5.0);
    assert_eq!(dac.chip.volts(Channel::A, loaded + 10_000), 5.0);
}

#[test]
fn a_change_under_way_goes_on_from_where_it_is() {
    let mut dac = Dac::powered(Coding::OffsetBinary, PLAIN, 1);
    dac.write(0x00_8000);
    dac.chip.set_ldac(false, dac.master.now + 200);
    let loaded = dac.master.now + 200;
    dac.chip.set_clr(false, loaded + 5_000);
    assert!(close(dac.chip.volts(Channel::A, loaded + 5_000), 2.5));
    assert!(close(dac.chip.volts(Channel::A, loaded + 10_000), 1.25));
    assert_eq!(dac.chip.volts(Channel::A, loaded + 15_000), 0.0);
}

#[test]
fn a_new_range_moves_the_output() {
    let mut dac = Dac::loaded(Coding::OffsetBinary, PLAIN, 1, 0x8000);
    assert_eq!(dac.settled(), [5.0; 4]);
    dac.write(0x08_0004);
    assert_eq!(dac.settled(), [0.0, 5.0, 5.0, 5.0], "mid-scale of ±10 V");
    assert_eq!(dac.chip.range(Channel::A), DacRange::Bipolar10);
}

#[test]
fn clr_clears_and_holds_off_loads() {
    for (coding, range) in
        [(Coding::OffsetBinary, 1), (Coding::OffsetBinary, 4), (Coding::TwosComplement, 1), (Coding::TwosComplement, 4)]
    {
        let mut dac = Dac::loaded(coding, PLAIN, range, 0x2000);
        let before = dac.settled();
        assert_ne!(before, [0.0; 4]);
        dac.chip.set_clr(false, dac.master.now);
        assert_eq!(dac.settled(), [0.0; 4]);
        // Neither a load command, nor LDAC, nor LDAC held low gets through.
        dac.write(0x1d_0000);
        dac.ldac_pulse();
        dac.chip.set_ldac(false, dac.master.now);
        dac.write(0x04_2000);
        assert_eq!(dac.settled(), [0.0; 4]);
        dac.chip.set_clr(true, dac.master.now);
        assert_eq!(dac.settled(), [0.0; 4], "cleared until loaded anew");
        dac.write(0x00_2000);
        assert_eq!(dac.settled(), [before[0], 0.0, 0.0, 0.0]);
    }
}

#[test]
fn the_input_registers_outlive_a_clear() {
    let mut dac = Dac::loaded(Coding::OffsetBinary, Unspecified::hostile(), 1, 0x8000);
    dac.write(0x1c_0000);
    assert_eq!(dac.settled(), [0.0; 4], "the clear command");
    assert_eq!(dac.chip.loaded_code(Channel::A), 0);
    assert_eq!(dac.read(0x80_0000) & 0xffff, 0x8000, "what was written, not what drives the output");
    dac.ldac_pulse();
    assert_eq!(dac.settled(), [5.0; 4], "the old codes are back");
}

#[test]
fn clr_select_chooses_what_a_clear_sets() {
    // Table "CLR Select Options": 1 is mid-scale in unipolar ranges, negative full scale in bipolar ones.
    for (coding, range, expected) in [
        (Coding::OffsetBinary, 1, 5.0),
        (Coding::OffsetBinary, 4, -10.0),
        (Coding::TwosComplement, 1, 5.0),
        (Coding::TwosComplement, 4, -10.0),
    ] {
        let mut dac = Dac::powered(coding, Unspecified::hostile(), range);
        dac.write(0x19_0006);
        dac.chip.set_clr(false, dac.master.now);
        assert_eq!(dac.settled(), [expected; 4], "{coding:?}, range {range}");
    }
}

#[test]
fn clr_takes_20_ns() {
    let mut dac = Dac::loaded(Coding::OffsetBinary, PLAIN, 1, 0x8000);
    dac.settled();
    for (width, expected) in [(19, 5.0), (20, 0.0)] {
        dac.chip.set_clr(false, dac.master.now);
        dac.wait(width);
        dac.chip.set_clr(true, dac.master.now);
        assert_eq!(dac.settled(), [expected; 4], "{width} ns");
    }
    assert_eq!(dac.chip.violations()[0].rule, Rule::ClrLow(19));
}

#[test]
fn a_read_returns_the_register_that_the_model_is_configured_for() {
    for (unspecified, expected) in [(Unspecified::hostile(), 0x1234), (PLAIN, 0)] {
        let mut dac = Dac::powered(Coding::OffsetBinary, unspecified, 1);
        dac.write(0x00_1234);
        assert_eq!(dac.read(0x80_0000) & 0xffff, expected, "before a load");
        dac.write(0x1d_0000);
        assert_eq!(dac.read(0x80_0000) & 0xffff, 0x1234, "after a load");
    }
}
