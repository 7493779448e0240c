//! Meaning of the AD5754's registers.

/// A channel of the AD5754; its number is its address (data sheet, table of DAC addresses).
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Channel {
    /// VOUTA, address 0.
    A,
    /// VOUTB, address 1.
    B,
    /// VOUTC, address 2.
    C,
    /// VOUTD, address 3.
    D,
}

impl Channel {
    /// All four, A first.
    pub const ALL: [Self; 4] = [Self::A, Self::B, Self::C, Self::D];

    /// 0 for A to 3 for D.
    #[must_use]
    pub const fn index(self) -> usize {
        self as usize
    }
}

/// How the pin BIN/2sCOMP is strapped. It counts in bipolar ranges only; unipolar ranges are always straight binary.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Coding {
    /// High: 0x0000 is the most negative output, 0x8000 is 0 V.
    OffsetBinary,
    /// Low: 0x8000 is the most negative output, 0x0000 is 0 V.
    TwosComplement,
}

/// Output range select register, DB2 to DB0 (data sheet, table "Output Range Options"). Voltages hold for 2.5 V at REFIN.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum DacRange {
    /// 0: gain 2, 0 V to 5 V, the default.
    #[default]
    Unipolar5,
    /// 1: gain 4, 0 V to 10 V.
    Unipolar10,
    /// 2: gain 4.32, 0 V to 10.8 V.
    Unipolar10V8,
    /// 3: gain 4, −5 V to 5 V.
    Bipolar5,
    /// 4: gain 8, −10 V to 10 V.
    Bipolar10,
    /// 5: gain 8.64, −10.8 V to 10.8 V.
    Bipolar10V8,
}

impl DacRange {
    const ALL: [Self; 6] =
        [Self::Unipolar5, Self::Unipolar10, Self::Unipolar10V8, Self::Bipolar5, Self::Bipolar10, Self::Bipolar10V8];

    /// The range with this code; 6 and 7 do not exist.
    #[must_use]
    pub fn from_bits(bits: u16) -> Option<Self> {
        Self::ALL.get(usize::from(bits)).copied()
    }

    /// Its code.
    #[must_use]
    pub const fn bits(self) -> u16 {
        self as u16
    }

    /// Full scale over REFIN.
    #[must_use]
    pub const fn gain(self) -> f64 {
        match self {
            Self::Unipolar5 => 2.0,
            Self::Unipolar10 | Self::Bipolar5 => 4.0,
            Self::Unipolar10V8 => 4.32,
            Self::Bipolar10 => 8.0,
            Self::Bipolar10V8 => 8.64,
        }
    }

    /// Whether the output goes below 0 V.
    #[must_use]
    pub const fn is_bipolar(self) -> bool {
        matches!(self, Self::Bipolar5 | Self::Bipolar10 | Self::Bipolar10V8)
    }

    /// Output for a code, V (data sheet, "Transfer Function"): gain × REFIN × D / 65536, less half of full scale in a
    /// bipolar range.
    #[must_use]
    pub fn volts(self, code: u16, coding: Coding, reference_v: f64) -> f64 {
        let full_scale_v = self.gain() * reference_v;
        if !self.is_bipolar() {
            return full_scale_v * f64::from(code) / 65536.0;
        }
        let offset_binary = match coding {
            Coding::OffsetBinary => code,
            Coding::TwosComplement => code ^ 0x8000,
        };
        full_scale_v * (f64::from(offset_binary) / 65536.0 - 0.5)
    }

    /// The code that a clear sets (data sheet, table "CLR Select Options"): 0 V, or with `select` mid-scale in a unipolar
    /// range and negative full scale in a bipolar one.
    #[must_use]
    pub fn clear_code(self, select: bool, coding: Coding) -> u16 {
        match (self.is_bipolar(), select, coding) {
            (false, false, _) | (true, false, Coding::TwosComplement) | (true, true, Coding::OffsetBinary) => 0,
            (false, true, _) | (true, false, Coding::OffsetBinary) | (true, true, Coding::TwosComplement) => 0x8000,
        }
    }
}

/// Control register at address 1 (data sheet, table "Explanation of Control Register Options").
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) struct Control {
    /// DB3: switch off when too hot.
    pub tsd_enable: bool,
    /// DB2: limit the current instead of switching off.
    pub clamp_enable: bool,
    /// DB1: what a clear sets.
    pub clear_select: bool,
    /// DB0: SDO is not driven.
    pub sdo_disable: bool,
}

impl Control {
    /// The bits of DB15 to DB0 that have a meaning.
    pub const MASK: u16 = 0x000f;

    /// At power-up: only the clamp is on.
    pub const POWER_UP: Self = Self { tsd_enable: false, clamp_enable: true, clear_select: false, sdo_disable: false };

    pub fn from_bits(bits: u16) -> Self {
        Self {
            tsd_enable: bits & 8 != 0,
            clamp_enable: bits & 4 != 0,
            clear_select: bits & 2 != 0,
            sdo_disable: bits & 1 != 0,
        }
    }

    pub fn bits(self) -> u16 {
        u16::from(self.tsd_enable) << 3
            | u16::from(self.clamp_enable) << 2
            | u16::from(self.clear_select) << 1
            | u16::from(self.sdo_disable)
    }
}

/// Power control register (data sheet, table "Power Control Register"): DB3 to DB0 PU_D to PU_A, DB5 TSD, DB10 to DB7 OC_D
/// to OC_A. DB4, which powers the reference of the AD5754R, and DB6 are 0; DB15 to DB11 are don't-cares.
pub(crate) struct PowerControl;

impl PowerControl {
    /// The bits of DB15 to DB0 that are not don't-cares.
    pub const MASK: u16 = 0x07ff;
    pub const TSD: u16 = 1 << 5;

    pub fn power_up(channel: usize) -> u16 {
        1 << channel
    }

    pub fn over_current(channel: usize) -> u16 {
        1 << (7 + channel)
    }
}

/// A frame of 24 bits: R/W, 0, REG2 to REG0, A2 to A0, DB15 to DB0 (data sheet, table "Input Shift Register Format").
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Frame {
    Dac { channels: Channels, code: u16 },
    Range { channels: Channels, bits: u16 },
    Power { bits: u16 },
    Nop,
    SetControl { bits: u16 },
    Clear,
    Load,
    Read(Readable),
    Unknown,
}

/// A register that can be read; its channel, where there are four.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Readable {
    Dac(usize),
    Range(usize),
    Power,
    Control,
}

/// Channels that an address names: one, or with address 4 all.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) struct Channels {
    first: usize,
    count: usize,
}

impl Channels {
    pub const ALL: Self = Self { first: 0, count: 4 };

    fn from_address(address: u8) -> Option<Self> {
        match address {
            0..=3 => Some(Self { first: usize::from(address), count: 1 }),
            4 => Some(Self::ALL),
            _ => None,
        }
    }

    pub fn indices(self) -> std::ops::Range<usize> {
        self.first..self.first + self.count
    }
}

impl Frame {
    pub fn from_bits(word: u32) -> Self {
        let head = (word >> 16) as u8;
        let bits = word as u16;
        let (read, reserved, register, address) = (head & 0x80 != 0, head & 0x40 != 0, head >> 3 & 7, head & 7);
        let channels = Channels::from_address(address);
        match (read, register) {
            _ if reserved => Self::Unknown,
            (false, 0) => channels.map_or(Self::Unknown, |channels| Self::Dac { channels, code: bits }),
            (false, 1) => channels.map_or(Self::Unknown, |channels| Self::Range { channels, bits: bits & 7 }),
            (false, 2) if address == 0 => Self::Power { bits },
            (false, 3) => match address {
                0 => Self::Nop,
                1 => Self::SetControl { bits: bits & Control::MASK },
                4 => Self::Clear,
                5 => Self::Load,
                _ => Self::Unknown,
            },
            (true, 0) if address < 4 => Self::Read(Readable::Dac(usize::from(address))),
            (true, 1) if address < 4 => Self::Read(Readable::Range(usize::from(address))),
            (true, 2) if address == 0 => Self::Read(Readable::Power),
            (true, 3) if address == 1 => Self::Read(Readable::Control),
            _ => Self::Unknown,
        }
    }
}
