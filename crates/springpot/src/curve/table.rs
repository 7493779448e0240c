//! A curve in the numbers of a step.

use heapless::Vec;

use crate::curve::knots::Cubic;
use crate::curve::{Curve, Knot, MAX_KNOTS};
use crate::error::CurveError;
use crate::scalar::Scalar;

/// Pieces of a table.
const PIECES: usize = MAX_KNOTS - 1;

/// A [`Curve`] as a step evaluates it: the same number of operations everywhere.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Table<T> {
    /// Unused pieces begin at infinity.
    pieces: [Piece<T>; PIECES],
    low: T,
    high: T,
    last: Knot<T>,
    three: T,
    used: usize,
}

/// A cubic from `at` on: value + slope u + second u² + third u³.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece<T> {
    at: T,
    value: T,
    slope: T,
    second: T,
    third: T,
}

/// Where a film stands on its curve.
///
/// The value is kept in two parts: that of the knot below, and what is beyond it. Differences of neighbouring values then lose no
/// digits to the size of the value itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Place<T> {
    /// T at the knot below, m.
    pub(crate) knot: T,
    /// T minus that, m.
    pub(crate) beyond: T,
    /// T'.
    pub(crate) slope: T,
    /// Whether the film is beyond the ends of the curve.
    pub(crate) outside: bool,
}

impl<T: Scalar> Place<T> {
    /// The place of a film without a curve.
    pub(crate) fn straight() -> Self {
        Self { knot: T::ZERO, beyond: T::ZERO, slope: T::from_f64(1.0), outside: false }
    }

    /// T here minus T at `other`, m.
    #[inline]
    pub(crate) fn minus(&self, other: &Self) -> T {
        (self.knot - other.knot) + (self.beyond - other.beyond)
    }
}

impl<T: Scalar> Table<T> {
    /// The table of `curve`, of its knots rounded to T.
    pub(crate) fn new(curve: &Curve) -> Self {
        let rounded = |knot: &Knot<f64>| Knot {
            displacement: T::from_f64(knot.displacement),
            value: T::from_f64(knot.value),
            slope: T::from_f64(knot.slope),
        };
        let beyond = T::from_f64(f64::INFINITY);
        let unused = Piece { at: beyond, value: T::ZERO, slope: T::ZERO, second: T::ZERO, third: T::ZERO };
        let mut pieces = [unused; PIECES];
        for (piece, pair) in pieces.iter_mut().zip(curve.knots().windows(2)) {
            let [before, after] = [rounded(&pair[0]), rounded(&pair[1])];
            let cubic = Cubic::between(&before.wide(), &after.wide());
            *piece = Piece {
                at: before.displacement,
                value: before.value,
                slope: before.slope,
                second: T::from_f64(cubic.second),
                third: T::from_f64(cubic.third),
            };
        }
        let used = curve.knots().len() - 1;
        let last = rounded(&curve.knots()[used]);
        Self { low: pieces[0].at, high: last.displacement, last, pieces, three: T::from_f64(3.0), used }
    }

    /// The knots, as rounded.
    pub(crate) fn knots(&self) -> impl Iterator<Item = Knot<T>> + '_ {
        let pieces = self.pieces.iter().take(self.used);
        pieces
            .map(|piece| Knot { displacement: piece.at, value: piece.value, slope: piece.slope })
            .chain(core::iter::once(self.last))
    }

    /// The curve of the rounded knots.
    pub(crate) fn curve(&self) -> Result<Curve, CurveError> {
        let knots: Vec<Knot<T>, MAX_KNOTS> = self.knots().collect();
        Curve::of_rounded(&knots)
    }

    /// The place at `displacement` − `surplus` (m).
    #[inline]
    pub(crate) fn place(&self, displacement: T, surplus: T) -> Place<T> {
        let (below, above) = (displacement.is_below(self.low), self.high.is_below(displacement));
        let within = if below { self.low } else { displacement };
        let within = if above { self.high } else { within };
        let mut index = 0;
        for half in [8, 4, 2, 1] {
            // Never more than 15: the mask shows it to the compiler.
            let candidate = (index + half) & (PIECES - 1);
            index = if within.is_below(self.pieces[candidate].at) { index } else { candidate };
        }
        let piece = &self.pieces[index];
        let u = (within - piece.at) - if below || above { T::ZERO } else { surplus };
        let bent = u * piece.third;
        let slope = piece.slope + u * ((piece.second + piece.second) + self.three * bent);
        let inside = u * (piece.slope + u * (piece.second + bent));
        let straight = slope * (displacement - within);
        Place { knot: piece.value, beyond: inside + straight, slope, outside: below || above }
    }
}
