//! Actions of a master that a data sheet does not allow.

/// A rule of a data sheet that was broken. Times are in ns: what was given, where less or more than allowed.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Rule {
    /// AD5754, t6: SYNC was high for less than 100 ns. The frame that begins is not seen.
    SyncHigh(u64),
    /// AD5754, t17: SYNC was high for less than 200 ns after a read command. The answer is not there.
    SyncHighBeforeAnswer(u64),
    /// AD5754, t1: the clock was faster than 33 ns a period. The bit is lost.
    ClockPeriod(u64),
    /// AD5754, t4; ADS868x, tSU_CSCK: the clock came too soon after the select. The bit is lost.
    ClockAfterSelect(u64),
    /// AD5754, t5; ADS868x, tHT_CKCS: the select rose too soon after the last clock. The bit is lost.
    SelectAfterClock(u64),
    /// Fewer bits than a command has. It is not carried out.
    ShortFrame(u32),
    /// AD5754: more than 24 bits, but no multiple of it. The last 24 are carried out.
    OddFrame(u32),
    /// A command, register or setting that does not exist, or that the model does not have. It is ignored.
    UnknownCommand(u32),
    /// AD5754: a code was written while the channel is powered down. It did not take it.
    WriteWhilePoweredDown,
    /// AD5754: the channel was loaded less than 10 µs after power-up. It did not take the code.
    LoadDuringPowerUp,
    /// AD5754: a load or an update came while CLR was low. It had no effect.
    LoadWhileClear,
    /// AD5754R: its reference was switched on while another one drives the pin. They drive against each other.
    TwoReferences,
    /// ADS868x: CONVST/CS fell while a conversion ran, so many ns before its end. The frame is not seen.
    FrameDuringConversion(u64),
    /// ADS868x: CONVST/CS fell while the chip was powering up. The frame is not seen.
    FrameDuringReset,
    /// ADS868x: less than tACQ from the end of a conversion to the next sample. The sample is not settled.
    Acquisition(u64),
}

/// When a rule was broken.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub struct Violation {
    /// Time, ns.
    pub at_ns: u64,
    /// Which rule.
    pub rule: Rule,
}

/// Violations so far, in order.
#[derive(Clone, Debug, Default)]
pub(crate) struct Violations(Vec<Violation>);

impl Violations {
    pub(crate) fn note(&mut self, at_ns: u64, rule: Rule) {
        self.0.push(Violation { at_ns, rule });
    }

    pub(crate) fn all(&self) -> &[Violation] {
        &self.0
    }

    pub(crate) fn clear(&mut self) {
        self.0.clear();
    }
}
