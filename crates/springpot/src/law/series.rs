//! A spring in series with the memory of a law.

use crate::curve::{Knot, MAX_KNOTS, Spring, Table};
use crate::law::response::Tangent;
use crate::numbers::Numbers;
use crate::scalar::Scalar;

/// A spring in series with the memory of a law.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Series<T> {
    /// S, force over elongation.
    pub(super) spring: Table<T, 1>,
    /// Stiffness of slow changes of the memory, N/m, and 1 plus what it is over S'(0).
    pub(super) slow: T,
    pub(super) scale: T,
}

impl<T: Scalar> Series<T> {
    /// The knot of a straight curve, and those of the spring.
    pub(super) fn knots(&self) -> impl Iterator<Item = Knot<T>> + '_ {
        core::iter::once(Knot::straight()).chain(self.spring.knots())
    }

    /// Visits the constants of a step in series with the spring.
    pub(super) fn numbers(&self, take: &mut impl Numbers<T>) {
        self.spring.numbers(take, "pieces", MAX_KNOTS - 1);
        take.structure("series", "The curve is a spring S in series with the memory, force over elongation.");
        take.number("slow", self.slow, "stiffness of slow changes of the memory, N/m");
        take.number("scale", self.scale, "1 plus that over the spring's stiffness at rest");
    }

    /// The film for small changes where the spring has this `slope` (N/m).
    fn tangent(slope: f64) -> Tangent {
        Tangent { memory: 1.0, spring: 0.0, in_series: 1.0 / slope }
    }

    /// The film where the spring is softest.
    #[inline(never)]
    pub(super) fn softest(&self) -> Tangent {
        self.spring.spring().map_or(Tangent::REST, |spring| Self::tangent(spring.min_slope().1))
    }

    /// The film that has been moved to `displacement` (m) within about a second.
    #[inline(never)]
    pub(super) fn tangent_at(&self, displacement: f64) -> Tangent {
        self.spring.spring().map_or(Tangent::REST, |spring| {
            Self::tangent(spring.slope(elongation(&spring, self.slow.to_f64(), displacement)))
        })
    }

    /// [`Law::margin_of`](crate::Law::margin_of) of a film up to `stroke_m` (m): −dx/x over dK/K at its worst, for memories of these stiffnesses (N/m).
    #[inline(never)]
    pub(super) fn growth(&self, stiffnesses: [f64; 2], strokes: impl Iterator<Item = f64>, coupling_per_m: f64) -> f64 {
        let Ok(spring) = self.spring.spring() else { return f64::INFINITY };
        strokes
            .flat_map(|x| {
                let pull = coupling_per_m / (1.0 + coupling_per_m * x);
                let spring = &spring;
                stiffnesses.map(|memory| {
                    let elongation = elongation(spring, memory, x);
                    let compliance = 1.0 / memory + 1.0 / spring.slope(elongation);
                    let left = 1.0 - pull * spring.force(elongation) * compliance;
                    if left > 0.0 { (x - elongation) / (x * left) } else { f64::INFINITY }
                })
            })
            .fold(1.0, f64::max)
    }
}

/// The elongation (m) of `spring` in series with a `memory` (N/m), both together stretched by `displacement` (m).
pub(super) fn elongation(spring: &Spring, memory: f64, displacement: f64) -> f64 {
    // Newton's method between bounds, as the difference falls everywhere: a spring that is steep between soft parts would make it jump to and fro.
    let [mut low, mut high] = [libm::fmin(displacement, 0.0), libm::fmax(displacement, 0.0)];
    let mut elongation = 0.0;
    for _ in 0..100 {
        let off = memory * (displacement - elongation) - spring.force(elongation);
        *(if off > 0.0 { &mut low } else { &mut high }) = elongation;
        let newton = elongation + off / (memory + spring.slope(elongation));
        let next = if (low..=high).contains(&newton) { newton } else { 0.5 * (low + high) };
        let moved = next - elongation;
        elongation = next;
        if moved.abs() <= 4.0 * f64::EPSILON * elongation.abs() {
            break;
        }
    }
    elongation
}
