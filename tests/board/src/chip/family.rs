//! The families of chips, and where they have what: RM0090 and RM0440, sections of their clock controls.

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Family {
    /// STM32F405 and STM32F407.
    F4,
    /// STM32G474.
    G4,
}

/// Places of registers and bits of the clock control, and limits of its clocks, Hz.
pub struct Layout {
    pub pllcfgr: u32,
    pub csr: u32,
    /// Bits of CR and CSR.
    pub hsion: u32,
    pub hsirdy: u32,
    pub cr_read_only: u32,
    pub rmvf: u32,
    /// The code of the internal oscillator in SW; those of crystal and loop follow.
    pub internal: u32,
    /// PLLSRC, and the crystal in it.
    pub source: [u32; 2],
    /// Places of both bus dividers in CFGR.
    pub ppre: [u32; 2],
    pub reset_values: &'static [(u32, u32)],
    pub loop_input: [u32; 2],
    pub loop_oscillator: [u32; 2],
    /// Core, with the regulator for the highest clock and without.
    pub core: [u32; 2],
    pub buses: [u32; 2],
    /// For each wait state of the flash.
    pub wait_state: u32,
    pub adcs: u32,
}

/// RM0090 sections 3.5.1 (2.7 to 3.6 V), 5.1.4 and 7.3, data sheet tables of general operating conditions and ADC characteristics.
const F4: Layout = Layout {
    pllcfgr: 0x04,
    csr: 0x74,
    hsion: 1 << 0,
    hsirdy: 1 << 1,
    cr_read_only: 1 << 1 | 1 << 17 | 1 << 25 | 1 << 27 | 0xff00,
    rmvf: 1 << 24,
    internal: 0,
    source: [1 << 22, 1 << 22],
    ppre: [10, 13],
    reset_values: &[
        (0x00, 0x0000_0083),
        (0x04, 0x2400_3010),
        (0x30, 0x0010_0000),
        (0x50, 0x7e67_91ff),
        (0x54, 0x0000_00f1),
        (0x58, 0x0000_0001),
        (0x60, 0x36fe_c9ff),
        (0x64, 0x0007_5f33),
        (0x74, 1 << 25 | 1 << 26 | 1 << 27),
        (0x84, 0x2000_3000),
    ],
    loop_input: [1_000_000, 2_000_000],
    loop_oscillator: [100_000_000, 432_000_000],
    core: [168_000_000, 144_000_000],
    buses: [42_000_000, 84_000_000],
    wait_state: 30_000_000,
    adcs: 36_000_000,
};

/// RM0440 sections 3.3.3 (range 1 with boost), 6.1.5 and 7.4, data sheet tables of general operating conditions, loop and ADC characteristics.
const G4: Layout = Layout {
    pllcfgr: 0x0c,
    csr: 0x94,
    hsion: 1 << 8,
    hsirdy: 1 << 10,
    cr_read_only: 1 << 10 | 1 << 17 | 1 << 25,
    rmvf: 1 << 23,
    internal: 1,
    source: [0b11, 0b11],
    ppre: [8, 11],
    reset_values: &[(0x00, 0x0000_0500), (0x08, 0x0000_0005), (0x0c, 0x0000_1000), (0x94, 1 << 26 | 1 << 27)],
    loop_input: [2_660_000, 16_000_000],
    loop_oscillator: [96_000_000, 344_000_000],
    core: [170_000_000, 150_000_000],
    buses: [170_000_000, 170_000_000],
    wait_state: 34_000_000,
    adcs: 52_000_000,
};

impl Family {
    pub const fn layout(self) -> &'static Layout {
        match self {
            Self::F4 => &F4,
            Self::G4 => &G4,
        }
    }
}
