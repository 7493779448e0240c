//! Flash interface and power control: RM0090 sections 3.9 and 5.4. Registers that hold what is written.

/// Flash interface. Nothing can be erased or programmed.
pub struct Flash {
    pub acr: u32,
    /// Option bytes; as delivered: watchdog by software, brown-out reset off.
    pub optcr: u32,
}

impl Flash {
    pub const WATCHDOG_BY_SOFTWARE: u32 = 1 << 5;
    pub const BROWN_OUT_OFF: u32 = 0b11 << 2;

    pub fn wait_states(&self) -> u32 {
        self.acr & 0b111
    }

    pub fn read(&self, offset: u32) -> u32 {
        match offset {
            0x00 => self.acr,
            0x10 => 1 << 31,
            0x14 => self.optcr,
            _ => 0,
        }
    }

    pub fn write(&mut self, offset: u32, value: u32) {
        if offset == 0x00 {
            self.acr = value;
        }
    }
}

impl Default for Flash {
    fn default() -> Self {
        Self { acr: 0, optcr: 0x0fff_aaed }
    }
}

/// Power control: the scale of the regulator.
pub struct Power {
    cr: u32,
}

impl Power {
    const VOS: u32 = 1 << 14;

    /// Whether the regulator allows the highest clock.
    pub fn upper_scale(&self) -> bool {
        self.cr & Self::VOS != 0
    }

    pub fn read(&self, offset: u32) -> u32 {
        match offset {
            0x00 => self.cr,
            // The scale is ready.
            0x04 => Self::VOS,
            _ => 0,
        }
    }

    pub fn write(&mut self, offset: u32, value: u32) {
        if offset == 0x00 {
            self.cr = value;
        }
    }
}

impl Default for Power {
    fn default() -> Self {
        Self { cr: Self::VOS }
    }
}
