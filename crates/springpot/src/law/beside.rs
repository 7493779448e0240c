//! A spring beside the memory of a law, and what a film meets there.

use crate::curve::{Knot, MAX_KNOTS, MAX_SPRING_KNOTS, Place, Table};
use crate::law::response::Tangent;
use crate::law::{LawState, Memory};
use crate::numbers::Numbers;
use crate::scalar::Scalar;

/// A spring beside the memory of a law.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Beside<T> {
    /// T, the memory's strain measure.
    pub(super) measure: Table<T, 1>,
    /// E.
    pub(super) spring: Table<T, 1>,
    /// Shares of E' (per N/m) and of T'² in the stiffness of slow changes, over that at rest.
    pub(super) spring_share: T,
    pub(super) memory_share: T,
}

/// A place of a film: on the curve, how the curve bends there, and the spring there.
#[derive(Clone, Copy)]
pub(super) struct Met<T> {
    pub(super) place: Place<T>,
    /// T'', 1/m.
    pub(super) curvature: T,
    /// E (N) and E' (N/m).
    pub(super) spring: [T; 2],
}

impl<T: Scalar> Beside<T> {
    /// The knots of both curves, as rounded, those of the spring last.
    pub(super) fn knots(&self) -> impl Iterator<Item = Knot<T>> + '_ {
        self.measure.knots().chain(self.spring.knots())
    }

    /// The film where it is softest, as slow changes see it: at a knot of either curve, or between two of them.
    #[inline(never)]
    pub(super) fn softest(&self) -> Tangent {
        let [memory_share, spring_share] = [self.memory_share, self.spring_share].map(Scalar::to_f64);
        let (mut softest, mut least, mut before) = (Tangent::REST, f64::INFINITY, T::ZERO);
        for knot in self.knots() {
            for displacement in [(before + knot.displacement) * T::from_f64(0.5), knot.displacement] {
                let tangent = self.tangent_at(displacement);
                let stiffness = memory_share * tangent.memory + spring_share * tangent.spring;
                if stiffness < least {
                    (softest, least) = (tangent, stiffness);
                }
            }
            before = knot.displacement;
        }
        softest
    }

    /// The film at `displacement` (m), without the force that its memory still has there.
    #[inline(never)]
    pub(super) fn tangent_at(&self, displacement: T) -> Tangent {
        let slope = self.measure.place(displacement, T::ZERO).slope.to_f64();
        let spring = self.spring.place(displacement, T::ZERO).slope.to_f64();
        Tangent { memory: slope * slope, spring, ..Tangent::REST }
    }

    /// [`Law::margin_of`](crate::Law::margin_of) of a film up to `stroke_m` (m): −dx/x over dK/K at its worst, for memories of these stiffnesses (N/m). Not inlined,
    /// as above.
    #[inline(never)]
    pub(super) fn growth(&self, stiffnesses: [f64; 2], strokes: impl Iterator<Item = f64>, coupling_per_m: f64) -> f64 {
        let (Ok(measure), Ok(spring)) = (self.measure.curve(), self.spring.spring()) else { return f64::INFINITY };
        strokes
            .flat_map(|x| {
                let pull = coupling_per_m / (1.0 + coupling_per_m * x);
                let (value, slope) = (measure.value(x), measure.slope(x));
                let steepness = spring.slope(x) - pull * spring.force(x);
                let steepened = slope * slope + measure.curvature(x) * value;
                stiffnesses.map(|memory| {
                    let force = memory * slope * value;
                    let left = steepness + memory * steepened - pull * force;
                    if left > 0.0 { force / (x * left) } else { f64::INFINITY }
                })
            })
            .fold(1.0, f64::max)
    }

    /// Visits the constants of a step beside the spring.
    pub(super) fn numbers(&self, take: &mut impl Numbers<T>, least: T) {
        self.measure.numbers(take, "pieces", MAX_KNOTS - 1);
        take.structure("spring", "A spring E beside the memory, whose force then has the weight T'.");
        take.number("least", least, "least stiffness of a step, N/m");
        take.number("spring_share", self.spring_share, "of E' in the stiffness over that at rest, m/N");
        take.number("memory_share", self.memory_share, "of T'^2");
        self.spring.numbers(take, "spring_pieces", MAX_SPRING_KNOTS - 1);
    }

    /// Returns what the film meets at `displacement` − `surplus` (m).
    #[inline]
    pub(super) fn at<M: Memory<T>>(&self, state: &LawState<T, M>, displacement: T, surplus: T) -> Met<T> {
        let displacement = displacement + state.bend.origin;
        let (mut place, curvature) = self.measure.place_and_curvature(displacement, surplus);
        let elastic = self.spring.place(displacement, surplus);
        place.outside = place.outside + elastic.outside;
        Met { place, curvature, spring: [elastic.knot + elastic.beyond, elastic.slope] }
    }

    /// Returns what the film meets if it goes on with `increment` (m).
    #[inline]
    pub(super) fn look_ahead<M: Memory<T>>(&self, state: &LawState<T, M>, increment: T) -> Met<T> {
        let (position, surplus) = state.ahead(increment);
        self.at(state, position, surplus)
    }
}

impl<T: Scalar> Met<T> {
    /// The same `distance` (m) on, along the tangents.
    #[inline]
    pub(super) fn moved(&self, distance: T) -> Self {
        let [elastic, steepness] = self.spring;
        Self { place: self.place.moved(distance), spring: [elastic + steepness * distance, steepness], ..*self }
    }
}
