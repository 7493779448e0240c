//! The 32 bits that the ADS868x sends.

use super::registers::{Registers, address};

/// In which order the flags follow the conversion result.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum FlagOrder {
    /// Device address, range, AVDD alarm, input alarm, parity: SBAS633E (August 2022), Tables 7-6 and 7-7, and a chip that a
    /// user of TI's forum measured (thread 981061).
    #[default]
    RangeFirst,
    /// Device address, AVDD alarm, input alarm, range, parity: TI's answer in that thread, and the sheets of the ADS866x.
    AlarmsFirst,
}

/// Bits of DATAOUT_CTL_REG (SBAS633E).
mod bit {
    pub const PAR_EN: u16 = 1 << 3;
    pub const RANGE_INCL: u16 = 1 << 8;
    pub const IN_H_INCL: u16 = 1 << 10;
    pub const IN_L_INCL: u16 = 1 << 11;
    pub const VDD_H_INCL: u16 = 1 << 12;
    pub const VDD_L_INCL: u16 = 1 << 13;
    pub const DEVICE_ADDR_INCL: u16 = 1 << 14;
}

/// Bits of ALARM_REG (SBAS633E).
pub mod alarm {
    /// ACTIVE_VDD_L_FLAG.
    pub const VDD_L: u16 = 1 << 15;
    /// ACTIVE_VDD_H_FLAG.
    pub const VDD_H: u16 = 1 << 14;
    /// ACTIVE_IN_L_FLAG.
    pub const IN_L: u16 = 1 << 11;
    /// ACTIVE_IN_H_FLAG.
    pub const IN_H: u16 = 1 << 10;
    /// TRP_VDD_L_FLAG.
    pub const TRIPPED_VDD_L: u16 = 1 << 7;
    /// TRP_VDD_H_FLAG.
    pub const TRIPPED_VDD_H: u16 = 1 << 6;
    /// TRP_IN_L_FLAG.
    pub const TRIPPED_IN_L: u16 = 1 << 5;
    /// TRP_IN_H_FLAG.
    pub const TRIPPED_IN_H: u16 = 1 << 4;
    /// OVW_ALARM: any of the tripped flags.
    pub const OVERVIEW: u16 = 1;
}

/// The word is filled from its highest bit on; what is not included takes no place.
struct Word {
    bits: u32,
    free: u32,
}

impl Word {
    fn push(&mut self, value: u16, width: u32) {
        self.free -= width;
        self.bits |= u32::from(value) << self.free;
    }
}

/// The output word without a read command: a test pattern, or the conversion result with the flags that DATAOUT_CTL_REG
/// includes (SBAS633E, 7.5.3).
pub(crate) fn conversion(registers: &Registers, result: u16, order: FlagOrder) -> u32 {
    let control = registers.half_word(address::DATAOUT_CTL);
    let flags = registers.half_word(address::ALARM);
    let mut word = Word { bits: 0, free: 32 };
    word.push(result, 16);
    if control & bit::DEVICE_ADDR_INCL != 0 {
        word.push(u16::from(registers.byte(address::DEVICE_ID + 2)), 4);
    }
    let range = |word: &mut Word| {
        if control & bit::RANGE_INCL != 0 {
            word.push(u16::from(registers.byte(address::RANGE_SEL)) & 0x0f, 4);
        }
    };
    if order == FlagOrder::RangeFirst {
        range(&mut word);
    }
    for (included, flag) in [
        (bit::VDD_H_INCL, alarm::VDD_H),
        (bit::VDD_L_INCL, alarm::VDD_L),
        (bit::IN_H_INCL, alarm::IN_H),
        (bit::IN_L_INCL, alarm::IN_L),
    ] {
        if control & included != 0 {
            word.push(u16::from(flags & flag != 0), 1);
        }
    }
    if order == FlagOrder::AlarmsFirst {
        range(&mut word);
    }
    if control & bit::PAR_EN != 0 {
        let even = |bits: u32| (bits.count_ones() & 1) as u16;
        let (of_result, of_frame) = (even(u32::from(result)), even(word.bits));
        word.push(of_result, 1);
        word.push(of_frame, 1);
    }
    word.bits
}

/// DATA_VAL\[2:0\] = 1xx: a pattern in place of everything else.
pub(crate) fn pattern(registers: &Registers) -> Option<u32> {
    match registers.byte(address::DATAOUT_CTL) & 7 {
        0b100 => Some(0),
        0b101 => Some(u32::MAX),
        0b110 => Some(0x5555_5555),
        0b111 => Some(0x3333_3333),
        _ => None,
    }
}
