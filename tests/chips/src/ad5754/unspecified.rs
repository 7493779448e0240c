//! Behaviour that the data sheet of the AD5754 does not specify.

/// Which register a read of the DAC register gives.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum DacRegisterReads {
    /// The one that a write fills: a read says nothing about whether the code was loaded.
    Input,
    /// The one that drives the output.
    Loaded,
}

/// Output of a channel from its power-up to its first load.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum FirstOutput {
    /// Its DAC register, which is 0 after a reset: negative full scale in a bipolar range with offset binary.
    DacRegister,
    /// 0 V.
    ClampedUntilLoaded,
}

/// Effect of a thermal shutdown on the PU bits.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum AfterShutdown {
    /// They stay. When the chip is cool again, TSD reads 0 and the outputs are back.
    ComesBack,
    /// They are cleared, as after an over-current.
    StaysDown,
}

/// Where the data sheet is silent or unclear, and what the model does there.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct Unspecified {
    /// DB23 to DB16 of an answer to a read command, and what SDO shows before the first frame.
    pub answer_head: u8,
    /// How don't-care bits read.
    pub dont_care: bool,
    /// Which register a read of the DAC register gives.
    pub dac_register_reads: DacRegisterReads,
    /// Outputs before their first load.
    pub first_output: FirstOutput,
    /// PU bits in a thermal shutdown.
    pub after_shutdown: AfterShutdown,
    /// Whether the loss of AVDD alone puts the registers back to their power-up values.
    pub avdd_dip_resets: bool,
}

impl Unspecified {
    /// The hardest case for a driver: the default of [`Ad5754::new`](super::Ad5754::new).
    #[must_use]
    pub const fn hostile() -> Self {
        Self {
            answer_head: 0x5a,
            dont_care: true,
            dac_register_reads: DacRegisterReads::Input,
            first_output: FirstOutput::DacRegister,
            after_shutdown: AfterShutdown::ComesBack,
            avdd_dip_resets: false,
        }
    }

    /// Behaviour that a reader of the data sheet expects.
    #[must_use]
    pub const fn plain() -> Self {
        Self {
            answer_head: 0,
            dont_care: false,
            dac_register_reads: DacRegisterReads::Loaded,
            first_output: FirstOutput::ClampedUntilLoaded,
            after_shutdown: AfterShutdown::StaysDown,
            avdd_dip_resets: true,
        }
    }
}
