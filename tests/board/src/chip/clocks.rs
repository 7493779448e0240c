//! Frequencies that follow from the registers, RM0090 section 7.2, RM0440 section 7.2, and their limits.

use crate::chip::family::Layout;
use crate::chip::violation::Violation;

/// Clock source of the core, in the order of SW.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    Internal,
    Crystal,
    Loop,
}

impl Source {
    /// The source by SW, where the internal oscillator has the code `internal`.
    pub fn from_bits(cfgr: u32, internal: u32) -> Option<Self> {
        [Self::Internal, Self::Crystal, Self::Loop].into_iter().find(|&source| source as u32 + internal == cfgr & 0b11)
    }
}

/// The phase-locked loop, Hz.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pll {
    pub input_hz: u32,
    pub vco_hz: u32,
    pub output_hz: u32,
}

impl Pll {
    /// Values outside their limits.
    pub fn violations(&self, layout: &Layout) -> impl Iterator<Item = Violation> + use<> {
        let within = |[low, high]: [u32; 2], hz| (low..=high).contains(&hz);
        let input = Violation::LoopInput { hz: self.input_hz };
        let oscillator = Violation::LoopOscillator { hz: self.vco_hz };
        let input = (!within(layout.loop_input, self.input_hz)).then_some(input);
        let oscillator = (!within(layout.loop_oscillator, self.vco_hz)).then_some(oscillator);
        input.into_iter().chain(oscillator)
    }
}

/// All clocks, Hz.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clocks {
    /// While it is on.
    pub pll: Option<Pll>,
    pub sysclk_hz: u32,
    pub hclk_hz: u32,
    pub pclk1_hz: u32,
    pub pclk2_hz: u32,
    /// Timers on APB1.
    pub timers1_hz: u32,
}

impl Clocks {
    pub fn pll(source_hz: u32, m: u32, n: u32, p: u32) -> Pll {
        let m = u64::from(m.max(1));
        let vco_hz = (u64::from(source_hz) * u64::from(n) / m).min(u32::MAX.into()) as u32;
        Pll { input_hz: (u64::from(source_hz) / m) as u32, vco_hz, output_hz: vco_hz / p }
    }

    pub fn new(pll: Option<Pll>, sysclk_hz: u32, cfgr: u32, layout: &Layout) -> Self {
        let hclk_hz = match cfgr >> 4 & 0xf {
            divides @ 8..12 => sysclk_hz >> (divides - 7),
            divides @ 12.. => sysclk_hz >> (divides - 6),
            _ => sysclk_hz,
        };
        let shift = |ppre: u32| if ppre & 0b100 == 0 { 0 } else { (ppre & 0b011) + 1 };
        let [ppre1, ppre2] = layout.ppre.map(|place| shift(cfgr >> place & 0b111));
        let pclk1_hz = hclk_hz >> ppre1;
        Self {
            pll,
            sysclk_hz,
            hclk_hz,
            pclk1_hz,
            pclk2_hz: hclk_hz >> ppre2,
            timers1_hz: if ppre1 == 0 { pclk1_hz } else { 2 * pclk1_hz },
        }
    }

    /// Values outside their limits with these wait states of the flash, and with the regulator for the highest clock or not.
    pub fn violations(&self, wait_states: u32, upper_scale: bool, layout: &Layout) -> Vec<Violation> {
        let mut found: Vec<_> = self.pll.iter().flat_map(|pll| pll.violations(layout)).collect();
        let buses = [
            ("AHB", self.hclk_hz, layout.core[usize::from(!upper_scale)]),
            ("APB1", self.pclk1_hz, layout.buses[0]),
            ("APB2", self.pclk2_hz, layout.buses[1]),
        ];
        let fast = buses.into_iter().filter(|&(_, hz, limit_hz)| hz > limit_hz);
        found.extend(fast.map(|(bus, hz, _)| Violation::BusClock { bus, hz }));
        let needed = self.hclk_hz.saturating_sub(1) / layout.wait_state;
        if wait_states < needed {
            found.push(Violation::WaitStates { set: wait_states, needed });
        }
        found
    }
}
