//! Input ranges of the ADS868x.

/// RANGE_SEL\[3:0\] (SBAS633E, register RANGE_SEL_REG and Table 7-4). Ranges are multiples of the reference.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum AdcRange {
    /// 0: ±3 × VREF, ±12.288 V with the internal reference. The power-up value.
    Bipolar3,
    /// 1: ±2.5 × VREF, ±10.24 V.
    Bipolar2V5,
    /// 2: ±1.5 × VREF, ±6.144 V.
    Bipolar1V5,
    /// 3: ±1.25 × VREF, ±5.12 V.
    Bipolar1V25,
    /// 4: ±0.625 × VREF, ±2.56 V.
    Bipolar0V625,
    /// 8: 0 to 3 × VREF, 12.288 V.
    Unipolar3,
    /// 9: 0 to 2.5 × VREF, 10.24 V.
    Unipolar2V5,
    /// 10: 0 to 1.5 × VREF, 6.144 V.
    Unipolar1V5,
    /// 11: 0 to 1.25 × VREF, 5.12 V.
    Unipolar1V25,
}

impl AdcRange {
    /// The range with this code, or `None`.
    #[must_use]
    pub const fn from_bits(bits: u8) -> Option<Self> {
        Some(match bits {
            0 => Self::Bipolar3,
            1 => Self::Bipolar2V5,
            2 => Self::Bipolar1V5,
            3 => Self::Bipolar1V25,
            4 => Self::Bipolar0V625,
            8 => Self::Unipolar3,
            9 => Self::Unipolar2V5,
            10 => Self::Unipolar1V5,
            11 => Self::Unipolar1V25,
            _ => return None,
        })
    }

    /// Ends of the range in multiples of the reference.
    #[must_use]
    pub const fn ends(self) -> (f64, f64) {
        match self {
            Self::Bipolar3 => (-3.0, 3.0),
            Self::Bipolar2V5 => (-2.5, 2.5),
            Self::Bipolar1V5 => (-1.5, 1.5),
            Self::Bipolar1V25 => (-1.25, 1.25),
            Self::Bipolar0V625 => (-0.625, 0.625),
            Self::Unipolar3 => (0.0, 3.0),
            Self::Unipolar2V5 => (0.0, 2.5),
            Self::Unipolar1V5 => (0.0, 1.5),
            Self::Unipolar1V25 => (0.0, 1.25),
        }
    }

    /// Straight binary code of a voltage, to the nearest; beyond the ends it stays at 0x0000 and 0xffff (SBAS633E, 7.3.8).
    #[must_use]
    pub fn code(self, volts: f64, reference_v: f64) -> u16 {
        let (low, high) = self.ends();
        let lsb_v = (high - low) * reference_v / 65536.0;
        // `as` saturates, and takes a NaN, as from 0 V over 0 V, to 0.
        ((volts - low * reference_v) / lsb_v).round() as u16
    }
}
