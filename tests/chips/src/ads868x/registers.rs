//! The registers of the ADS868x, byte by byte, and the commands that reach them.

/// Addresses of the low bytes (SBAS633E, register map).
pub mod address {
    /// DEVICE_ID_REG; the device address is at 02h.
    pub const DEVICE_ID: u16 = 0x00;
    /// RST_PWRCTL_REG.
    pub const RST_PWRCTL: u16 = 0x04;
    /// SDI_CTL_REG.
    pub const SDI_CTL: u16 = 0x08;
    /// SDO_CTL_REG.
    pub const SDO_CTL: u16 = 0x0c;
    /// DATAOUT_CTL_REG.
    pub const DATAOUT_CTL: u16 = 0x10;
    /// RANGE_SEL_REG.
    pub const RANGE_SEL: u16 = 0x14;
    /// ALARM_REG.
    pub const ALARM: u16 = 0x20;
    /// ALARM_H_TH_REG.
    pub const ALARM_H_TH: u16 = 0x24;
    /// ALARM_L_TH_REG.
    pub const ALARM_L_TH: u16 = 0x28;
}

/// The key that opens RST_PWRCTL.
const KEY: u8 = 0x69;
const KEY_ADDRESS: u16 = address::RST_PWRCTL + 1;

/// A byte that is not all reserved: address, writable bits, reset value, bits that only a power-on reset clears.
struct Byte(u16, u8, u8, u8);

/// All other bytes and bits are reserved and read 0. Bits that the tables mark with `<>` survive an application reset.
const BYTES: [Byte; 15] = [
    Byte(0x02, 0x0f, 0x00, 0x00),
    Byte(address::RST_PWRCTL, 0x37, 0x00, 0x06),
    Byte(KEY_ADDRESS, 0xff, 0x00, 0x00),
    Byte(address::SDI_CTL, 0x03, 0x00, 0x03),
    Byte(address::SDO_CTL, 0x43, 0x00, 0x43),
    Byte(0x0d, 0x13, 0x00, 0x00),
    Byte(address::DATAOUT_CTL, 0x0f, 0x00, 0x08),
    Byte(0x11, 0x7d, 0x00, 0x00),
    Byte(address::RANGE_SEL, 0x4f, 0x00, 0x0f),
    Byte(address::ALARM_H_TH, 0xff, 0xff, 0x00),
    Byte(0x25, 0xff, 0xff, 0x00),
    Byte(0x27, 0xfc, 0x00, 0x00),
    Byte(address::ALARM_L_TH, 0xff, 0x00, 0x00),
    Byte(0x29, 0xff, 0x00, 0x00),
    // The read-only flags, which `set_alarm` fills: 20h and 21h.
    Byte(address::ALARM, 0x00, 0x00, 0x00),
];

const SIZE: usize = 0x2c;

/// Contents of all registers.
#[derive(Clone, Debug)]
pub(crate) struct Registers([u8; SIZE]);

impl Registers {
    pub fn power_up() -> Self {
        let mut bytes = [0; SIZE];
        for Byte(address, _, reset, _) in BYTES {
            bytes[usize::from(address)] = reset;
        }
        Self(bytes)
    }

    /// Effect of RST while RSTn_APP is 1.
    pub fn application_reset(&mut self) {
        let fresh = Self::power_up();
        let old = std::mem::replace(&mut self.0, fresh.0);
        for Byte(address, _, _, kept) in BYTES {
            let k = usize::from(address);
            self.0[k] = self.0[k] & !kept | old[k] & kept;
        }
    }

    pub fn byte(&self, address: u16) -> u8 {
        self.0.get(usize::from(address)).copied().unwrap_or(0)
    }

    pub fn half_word(&self, address: u16) -> u16 {
        u16::from_be_bytes([self.byte(address | 1), self.byte(address & !1)])
    }

    pub fn set_alarm(&mut self, flags: u16) {
        let [high, low] = flags.to_be_bytes();
        self.0[usize::from(address::ALARM)] = low;
        self.0[usize::from(address::ALARM) + 1] = high;
    }

    /// Writes the writable bits of a byte. `false` if the key of RST_PWRCTL is missing; the key is used up by a write.
    fn write(&mut self, address: u16, value: u8) -> bool {
        let Some(Byte(_, mask, ..)) = BYTES.iter().find(|byte| byte.0 == address) else { return true };
        if address == address::RST_PWRCTL && std::mem::take(&mut self.0[usize::from(KEY_ADDRESS)]) != KEY {
            return false;
        }
        let byte = &mut self.0[usize::from(address)];
        *byte = *byte & !mask | value & mask;
        true
    }

    /// Carries out a command that writes. `false` as for a missing key.
    pub fn execute(&mut self, command: Command) -> bool {
        match command {
            Command::Write { address, high, low } => {
                // The low byte first: a key in the same half-word is not there yet.
                let written = low.is_none_or(|low| self.write(address, low));
                high.is_none_or(|high| self.write(address | 1, high)) && written
            }
            Command::Clear { address, bits } => self.change(address, self.half_word(address) & !bits),
            Command::Set { address, bits } => self.change(address, self.half_word(address) | bits),
            Command::Nop | Command::Read { .. } | Command::ReadHalfWord { .. } => true,
        }
    }

    fn change(&mut self, address: u16, value: u16) -> bool {
        let [high, low] = value.to_be_bytes();
        self.execute(Command::Write { address, high: Some(high), low: Some(low) })
    }
}

/// A command (SBAS633E, Table 7-5). Half-word commands work on an even address: they take the lowest bit as 0.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Command {
    /// All that is not a command.
    Nop,
    /// 11000: bits that are 1 become 0.
    Clear { address: u16, bits: u16 },
    /// 11001: the answer is 16 bits.
    ReadHalfWord { address: u16 },
    /// 01001: the answer is 8 bits.
    Read { address: u16 },
    /// 11010_00 both bytes, 11010_01 the MS byte, 11010_10 the LS byte.
    Write { address: u16, high: Option<u8>, low: Option<u8> },
    /// 11011: bits that are 1 become 1.
    Set { address: u16, bits: u16 },
}

impl Command {
    pub fn from_word(word: u32) -> Self {
        let [high, low] = (word as u16).to_be_bytes();
        let bits = word as u16;
        let byte_address = (word >> 16 & 0x1ff) as u16;
        let address = byte_address & !1;
        match (word >> 27, word >> 25 & 3) {
            (0b11000, _) => Self::Clear { address, bits },
            (0b11001, _) => Self::ReadHalfWord { address },
            (0b01001, _) => Self::Read { address: byte_address },
            (0b11010, 0) => Self::Write { address, high: Some(high), low: Some(low) },
            (0b11010, 1) => Self::Write { address, high: Some(high), low: None },
            (0b11010, 2) => Self::Write { address, high: None, low: Some(low) },
            (0b11011, _) => Self::Set { address, bits },
            _ => Self::Nop,
        }
    }
}
