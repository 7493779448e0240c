//! Cost of a law on a controller.

use serde::Serialize;
use springpot::{Law, LawState};

use crate::files::parameters::Film;

/// Costs of the default law on a Cortex-M4F. Instructions and cycles are those that docs/results.md states.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Cost {
    /// Instructions of a step of the law.
    pub instructions_per_step: u32,
    /// Instructions of a whole control tick, with tracking.
    pub instructions_per_tick: u32,
    /// Cycles of a whole control tick, modelled.
    pub cycles_per_tick: u32,
    /// Share of a core at 168 MHz with 1000 ticks a second, %.
    pub core_pct: f64,
    /// Size of the law, bytes.
    pub law_bytes: usize,
    /// Size of its state, bytes.
    pub state_bytes: usize,
}

const CORE_HZ: f64 = 168e6;
const TICKS_PER_S: f64 = 1000.0;

impl Cost {
    /// A linear film.
    pub const LINEAR: Self = Self::stated(527, 1830, 3008);
    /// A film behind an elastic curve.
    pub const CURVED: Self = Self::stated(615, 1999, 3262);
    /// A film with two curves.
    pub const TWO_CURVES: Self = Self::stated(698, 2182, 3623);
    /// A film with a spring in series.
    pub const SERIES: Self = Self::stated(650, 2086, 3541);

    /// The cost of `film`.
    pub fn new(film: Film<'_>) -> Self {
        match (film.curve, film.spring) {
            (Some(_), Some(_)) => Self::TWO_CURVES,
            (None, Some(_)) => Self::SERIES,
            (Some(_), None) => Self::CURVED,
            (None, None) => Self::LINEAR,
        }
    }

    const fn stated(instructions_per_step: u32, instructions_per_tick: u32, cycles_per_tick: u32) -> Self {
        Self {
            instructions_per_step,
            instructions_per_tick,
            cycles_per_tick,
            core_pct: 100.0 * cycles_per_tick as f64 * TICKS_PER_S / CORE_HZ,
            law_bytes: size_of::<Law<f32>>(),
            state_bytes: size_of::<LawState<f32>>(),
        }
    }
}
