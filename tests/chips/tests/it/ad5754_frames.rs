//! The serial port of the AD5754: frames, read-back, and the table "Timing Characteristics".

use converter_chips::{Rule, Sdi, SerialChip};
use embedded_hal::spi::MODE_0;

use crate::master::Dac;

#[test]
fn registers_at_power_up() {
    let mut dac = Dac::new();
    // Head 0x5a; ones outside of DB15–0, DB2–0, DB10–0, and DB3–0. The clamp is enabled.
    for (register, answer) in [(0x80, 0x5a_0000), (0x88, 0x5a_fff8), (0x90, 0x5a_f800), (0x99, 0x5a_fff4)] {
        assert_eq!(dac.read(register << 16), answer, "{register:#x}");
    }
    assert_eq!(dac.rules(), []);
}

#[test]
fn fewer_than_24_bits_are_ignored() {
    let mut dac = Dac::new();
    for count in [0, 1, 8, 16, 23] {
        // The bits that a frame of 24 would have begun with.
        dac.master.send(&mut dac.chip, 0x08_0005 >> (24 - count), count);
    }
    assert_eq!(dac.chip.range(), 0);
    assert_eq!(dac.rules(), [0, 1, 8, 16, 23].map(Rule::ShortFrame));
}

#[test]
fn of_more_bits_the_last_24_count() {
    let mut dac = Dac::new();
    dac.master.send(&mut dac.chip, 0x08_0005_08_0003, 48);
    assert_eq!(dac.chip.range(), 3);
    assert!(dac.rules().is_empty(), "two chips in a chain are allowed");
    dac.master.send(&mut dac.chip, 0x1_08_0004, 25);
    assert_eq!(dac.chip.range(), 4);
    // 0x0c0001 with a bit too many at its end is 0x180002, no operation.
    dac.master.send(&mut dac.chip, 0x0c_0001 << 1, 25);
    assert_eq!(dac.chip.range(), 4);
    assert_eq!(dac.rules(), [Rule::OddFrame(25), Rule::OddFrame(25)]);
}

#[test]
fn sync_is_high_for_100_ns_between_frames() {
    let mut dac = Dac::new();
    dac.write(0x18_0000);
    dac.master.high_ns = 99;
    dac.write(0x08_0001);
    assert_eq!(dac.chip.range(), 0, "the frame was not seen");
    assert_eq!(dac.rules(), [Rule::SyncHigh(99)]);
    dac.master.high_ns = 100;
    dac.write(0x08_0001);
    assert_eq!(dac.chip.range(), 1);
}

#[test]
fn an_answer_needs_200_ns() {
    let mut dac = Dac::new();
    dac.write(0x08_0004);
    dac.write(0x88_0000);
    dac.master.high_ns = 199;
    assert_eq!(dac.write(0x18_0000), 0x88_0000, "the command comes back");
    assert_eq!(dac.rules(), [Rule::SyncHighBeforeAnswer(199)]);
    dac.write(0x88_0000);
    dac.master.high_ns = 200;
    assert_eq!(dac.write(0x18_0000) & 7, 4);
}

#[test]
fn sdo_is_valid_40_ns_after_the_rising_edge() {
    let mut dac = Dac::new();
    dac.write(0x08_0005);
    dac.master.half_ns = 40;
    assert_eq!(dac.read(0x88_0000), 0x5a_fffd);
    dac.master.half_ns = 39;
    // Each bit is sampled before it is valid, and the first one is the last of the frame before: all comes one place too low.
    assert_eq!(dac.read(0x88_0000), 0x5a_fffd >> 1);
    assert_eq!(dac.chip.range(), 5, "writes are as before");
}

#[test]
fn the_clock_has_33_ns_and_13_ns_at_its_ends() {
    let mut dac = Dac::new();
    dac.master.half_ns = 16;
    dac.write(0x08_0001);
    assert_eq!(dac.chip.range(), 0);
    assert!(dac.rules().contains(&Rule::ClockPeriod(32)));
    dac.master.half_ns = 17;
    dac.write(0x08_0001);
    assert_eq!(dac.chip.range(), 1, "34 ns");

    dac.chip.clear_violations();
    dac.master.half_ns = 50;
    dac.master.margin_ns = 12;
    dac.write(0x08_0003);
    assert_eq!(dac.chip.range(), 1, "SYNC rose 12 ns after the last edge");
    assert_eq!(dac.rules(), [Rule::SelectAfterClock(12), Rule::ShortFrame(23)]);
    dac.master.margin_ns = 13;
    dac.write(0x08_0003);
    assert_eq!(dac.chip.range(), 3);
}

#[test]
fn a_clock_right_after_sync_is_lost() {
    let mut dac = Dac::new();
    let now = dac.master.now;
    dac.chip.select(now);
    dac.chip.sclk(true, Sdi::stable(true), now + 2);
    dac.chip.sclk(false, Sdi::stable(true), now + 12);
    dac.chip.deselect(now + 100);
    assert_eq!(dac.rules(), [Rule::ClockAfterSelect(12), Rule::ShortFrame(0)]);

    // 13 ns after SYNC, then every 33 ns: 0x080001 is taken.
    let now = now + 1_000;
    dac.chip.select(now);
    for k in 0..24 {
        let bit = Sdi::stable(0x08_0001 >> (23 - k) & 1 == 1);
        dac.chip.sclk(true, bit, now + k * 33);
        dac.chip.sclk(false, bit, now + 13 + k * 33);
    }
    dac.chip.deselect(now + 1_000);
    assert_eq!(dac.chip.range(), 1);
    assert_eq!(dac.rules().len(), 2);
}

#[test]
fn what_does_not_exist_is_ignored() {
    let mut dac = Dac::new();
    // DB22 set, register 4, range code 6, power to channel B, DAC address 5, control address 2, a clamp that switches off.
    let unknown = [0x48_0001, 0x20_0000, 0x08_0006, 0x10_0003, 0x0d_0001, 0x1a_0000, 0x19_0008];
    for word in unknown {
        dac.write(word);
    }
    assert_eq!(dac.chip.range(), 0);
    assert_eq!(dac.rules(), unknown.map(|word| Rule::UnknownCommand(word as u32)));
}

#[test]
fn reads_of_what_does_not_exist_give_nothing_known() {
    let mut dac = Dac::new();
    // Addresses 4 and 5 of the DAC and range registers, 1 of power control, 0 and 4 of control, register 4.
    let unknown = [0x84_0000, 0x85_0000, 0x8c_0000, 0x8d_0000, 0x91_0000, 0x98_0000, 0x9c_0000, 0xa0_0000];
    for word in unknown {
        assert_eq!(dac.read(word), 0x5a_ffff, "{word:#08x}");
    }
    assert_eq!(dac.rules(), unknown.map(|word| Rule::UnknownCommand(word as u32)));
}

#[test]
fn in_mode_0_both_directions_are_wrong() {
    let mut dac = Dac::new();
    dac.write(0x08_0004);
    dac.master.mode = MODE_0;
    // The chip takes what follows each bit: 0x880000 becomes 0x110000, which is no command.
    dac.write(0x88_0000);
    assert_eq!(dac.write(0x18_0000) & 0xffff, 0, "no answer");
    dac.master.mode = embedded_hal::spi::MODE_1;
    dac.write(0x88_0000);
    dac.master.mode = MODE_0;
    assert_eq!(dac.write(0x18_0000) & 7, 0b110, "0b1100 comes one place too low");
}
