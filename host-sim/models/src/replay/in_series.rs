//! A spring in series with a memory, solved exactly in a step: where a law linearises it.

use springpot::Spring;

/// Steps of Newton's method, or of bisection where it leaves what is known: each squares the error, or halves it.
const MAX_NEWTON_STEPS: usize = 50;

/// A spring in series with a memory, before a step.
#[derive(Clone, Copy, Debug)]
pub struct InSeries<'a> {
    /// S, force over elongation.
    pub spring: &'a Spring,
    /// Its elongation before the step, m.
    pub elongation_m: f64,
    /// Stiffness of the memory within the step, N/m.
    pub instant: f64,
    /// The memory's force after the step if it is not moved, N.
    pub past_n: f64,
}

/// Increments of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Increments {
    /// To the memory's displacement, m.
    pub memory_m: f64,
    /// To the elongation of the spring, m.
    pub spring_m: f64,
}

impl InSeries<'_> {
    /// The step that moves both together by `increment` (m).
    pub fn along(self, increment: f64) -> Increments {
        let memory = self.instant;
        let spring_m = self.elongated(memory, self.past_n + memory * (self.elongation_m + increment));
        Increments { memory_m: increment - spring_m, spring_m }
    }

    /// The step under the force `left` (N), of which a stiffness beside them takes `beside` (N/m) of the increment; NaN where nothing
    /// resists it.
    pub fn under(self, left: f64, beside: f64) -> Increments {
        let total = self.instant + beside;
        let (memory, force) = (self.instant / total, self.past_n + self.instant * self.elongation_m);
        let spring_m = if total > 0.0 {
            self.elongated(memory * beside, memory * left + beside / total * force)
        } else {
            f64::NAN
        };
        let force_n = self.spring.force(self.elongation_m + spring_m);
        Increments { memory_m: (force_n - self.past_n) / self.instant, spring_m }
    }

    /// The increment of the elongation (m) to where the spring and a `stiffness` (N/m) that is stretched as far carry `force` (N).
    fn elongated(self, stiffness: f64, force: f64) -> f64 {
        elongation(self.spring, stiffness, force, self.elongation_m) - self.elongation_m
    }
}

/// The elongation (m) at which `spring` and a `stiffness` (N/m) that is stretched as far carry `force` (N), from an estimate `near` it
/// (m); NaN where they fall.
pub fn elongation(spring: &Spring, stiffness: f64, force: f64, near: f64) -> f64 {
    let mut elongation = near;
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    for _ in 0..MAX_NEWTON_STEPS {
        let slope = spring.slope(elongation) + stiffness;
        if slope.is_nan() || slope <= 0.0 {
            return f64::NAN;
        }
        let missing = force - spring.force(elongation) - stiffness * elongation;
        *(if missing > 0.0 { &mut low } else { &mut high }) = elongation;
        let next = elongation + missing / slope;
        let next = if (low..=high).contains(&next) { next } else { 0.5 * (low + high) };
        let moved = next - elongation;
        elongation = next;
        if moved.abs() <= 4.0 * f64::EPSILON * elongation.abs() {
            break;
        }
    }
    elongation
}
