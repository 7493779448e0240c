//! Supplies, over-current, over-temperature, and the power control register.

use converter_chips::{AfterShutdown, Channel, Coding, DacRange, Unspecified};

use crate::master::Dac;

/// All channels at 5 V in 0 V to 10 V.
fn running(unspecified: Unspecified) -> Dac {
    let mut dac = Dac::loaded(Coding::OffsetBinary, unspecified, 1, 0x8000);
    assert_eq!(dac.settled(), [5.0; 4]);
    dac
}

/// DB10 to DB0 of the power control register.
fn power(dac: &mut Dac) -> u64 {
    dac.read(0x90_0000) & 0x07ff
}

#[test]
fn power_control_reads_its_bits() {
    let mut dac = Dac::plain();
    for bits in [0b0001, 0b1000, 0b0110, 0b1111, 0] {
        dac.write(0x10_0000 | bits);
        assert_eq!(power(&mut dac), bits);
        assert_eq!(Channel::ALL.map(|channel| dac.chip.is_powered(channel)), [0, 1, 2, 3].map(|k| bits >> k & 1 == 1));
    }
    // Flags and the place of the AD5754R's reference cannot be written.
    dac.write(0x10_ffff);
    assert_eq!(power(&mut dac), 0b1111);
}

#[test]
fn a_channel_that_is_powered_down_goes_to_0_v_and_keeps_its_code() {
    let mut dac = running(Unspecified::plain());
    dac.write(0x10_000d);
    assert_eq!(dac.settled(), [5.0, 0.0, 5.0, 5.0]);
    dac.write(0x10_000f);
    assert_eq!(dac.settled(), [5.0; 4]);
}

#[test]
fn dvcc_loss_resets_everything() {
    let mut dac = running(Unspecified::hostile());
    dac.write(0x19_0008);
    dac.chip.set_dvcc(false, dac.master.now);
    assert_eq!(dac.chip.volts(Channel::A, dac.master.now + 5_000), 2.5, "on its way to 0 V");
    assert_eq!(dac.settled(), [0.0; 4]);
    dac.write(0x0c_0004);
    assert_eq!(dac.master.floating, 24, "no chip, no SDO");
    dac.chip.set_dvcc(true, dac.master.now);
    assert_eq!(dac.read(0x90_0000) & 0x07ff, 0);
    assert_eq!(dac.read(0x88_0000) & 7, 0);
    assert_eq!(dac.read(0x99_0000) & 15, 0b0100);
    assert_eq!(dac.read(0x80_0000) & 0xffff, 0);
    assert_eq!(dac.settled(), [0.0; 4]);
}

#[test]
fn a_frame_is_cut_by_a_loss_of_dvcc() {
    use converter_chips::SerialChip;
    let mut dac = Dac::plain();
    dac.chip.select(dac.master.now);
    dac.chip.set_dvcc(false, dac.master.now + 100);
    dac.chip.set_dvcc(true, dac.master.now + 200);
    dac.chip.deselect(dac.master.now + 300);
    assert_eq!(dac.chip.violations(), []);
    dac.write(0x0c_0001);
    assert_eq!(dac.chip.range(Channel::A), DacRange::Unipolar10);
}

#[test]
fn the_first_frame_is_lost_where_lines_are_driven_before_dvcc() {
    let mut dac = Dac::plain();
    dac.chip.set_lines_before_dvcc(true);
    dac.chip.set_dvcc(false, dac.master.now);
    dac.wait(1_000);
    dac.chip.set_dvcc(true, dac.master.now);
    dac.write(0x0c_0001);
    assert_eq!(dac.chip.range(Channel::A), DacRange::Unipolar5);
    dac.write(0x0c_0001);
    assert_eq!(dac.chip.range(Channel::A), DacRange::Unipolar10);
}

#[test]
fn avdd_loss_holds_the_outputs_at_0_v() {
    // Hostile: the registers stay, and a read-back shows nothing.
    let mut dac = running(Unspecified::hostile());
    dac.chip.set_avdd(false, dac.master.now);
    assert_eq!(dac.settled(), [0.0; 4]);
    assert_eq!(power(&mut dac), 0b1111);
    dac.chip.set_avdd(true, dac.master.now);
    assert_eq!(dac.settled(), [5.0; 4]);
    // Plain: a power-on reset.
    let mut dac = running(Unspecified::plain());
    dac.chip.set_avdd(false, dac.master.now);
    assert_eq!(power(&mut dac), 0);
    dac.write(0x0c_0004);
    dac.chip.set_avdd(true, dac.master.now);
    assert_eq!(dac.settled(), [0.0; 4]);
    assert_eq!(dac.chip.range(Channel::A), DacRange::Bipolar10, "what is written meanwhile stays");
}

#[test]
fn a_short_circuit_outlives_a_reset() {
    let mut dac = Dac::plain();
    dac.chip.set_over_current(Channel::A, true, 0);
    dac.chip.set_dvcc(false, 1_000);
    dac.chip.set_dvcc(true, 2_000);
    assert_eq!(power(&mut dac), 1 << 7);
}

#[test]
fn without_a_reference_there_is_no_output() {
    let mut dac = running(Unspecified::plain());
    dac.chip.set_reference(0.0, dac.master.now);
    assert_eq!(dac.settled(), [0.0; 4]);
    dac.chip.set_reference(2.0, dac.master.now);
    assert_eq!(dac.settled(), [4.0; 4]);
}

#[test]
fn over_current_with_the_clamp_is_only_reported() {
    let mut dac = running(Unspecified::plain());
    for (k, channel) in Channel::ALL.into_iter().enumerate() {
        dac.chip.set_over_current(channel, true, dac.master.now);
        assert_eq!(power(&mut dac), 1 << (7 + k) | 0b1111);
        assert_eq!(dac.settled(), [5.0; 4]);
        dac.chip.set_over_current(channel, false, dac.master.now);
        assert_eq!(power(&mut dac), 0b1111);
    }
}

#[test]
fn over_current_without_the_clamp_powers_the_channel_down() {
    let mut dac = running(Unspecified::plain());
    dac.write(0x19_0000);
    dac.chip.set_over_current(Channel::C, true, dac.master.now);
    dac.chip.set_over_current(Channel::C, false, dac.master.now + 1);
    assert_eq!(power(&mut dac), 1 << 9 | 0b1011);
    assert_eq!(dac.settled(), [5.0, 5.0, 0.0, 5.0]);
    dac.write(0x10_000f);
    assert_eq!(power(&mut dac), 0b1111);
    assert_eq!(dac.settled(), [5.0; 4]);
    // While the cause is there, it goes down again.
    dac.chip.set_over_current(Channel::C, true, dac.master.now);
    dac.write(0x10_000f);
    assert_eq!(power(&mut dac), 1 << 9 | 0b1011);
}

#[test]
fn the_thermal_shutdown_is_off_at_first() {
    let mut dac = running(Unspecified::plain());
    dac.chip.set_over_temperature(true, dac.master.now);
    assert_eq!(power(&mut dac), 0b1111);
    assert_eq!(dac.settled(), [5.0; 4]);
}

#[test]
fn the_thermal_shutdown_switches_off_and_says_so() {
    for (after_shutdown, hot, cool, volts) in
        [(AfterShutdown::ComesBack, 0x2f, 0x0f, 5.0), (AfterShutdown::StaysDown, 0x20, 0x00, 0.0)]
    {
        let mut dac = running(Unspecified { after_shutdown, ..Unspecified::plain() });
        dac.write(0x19_000c);
        dac.chip.set_over_temperature(true, dac.master.now);
        assert_eq!(power(&mut dac), hot, "{after_shutdown:?}");
        assert_eq!(dac.settled(), [0.0; 4]);
        dac.chip.set_over_temperature(false, dac.master.now);
        assert_eq!(power(&mut dac), cool, "{after_shutdown:?}");
        assert_eq!(dac.settled(), [volts; 4]);
    }
}
