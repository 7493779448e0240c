//! A curve in the numbers of a step.

use heapless::Vec;

use crate::curve::knots::Cubic;
use crate::curve::{Curve, Knot, MAX_KNOTS, Spring};
use crate::error::CurveError;
use crate::numbers::{Numbers, Record};
use crate::scalar::Scalar;

/// A [`Curve`] as a step evaluates it: the same number of operations everywhere.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Table<T, const EIGHTS: usize = 2> {
    /// Pieces in nested pairs, so that a search needs no index: a displacement is in the upper half of a pair unless it is below its first piece.
    /// Unused pieces begin at infinity. Eight of them, or twice as many.
    pieces: [[[Pair<T>; 2]; 2]; EIGHTS],
    /// The last knot: where the curve ends.
    last: Knot<T>,
    used: usize,
}

type Pair<T> = [Piece<T>; 2];

/// A cubic from `at` on: value + slope u + second u² + third u³.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Piece<T> {
    at: T,
    value: T,
    slope: T,
    second: T,
    third: T,
}

/// The place of a film on its curve.
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
    /// How far the film is beyond the ends of the curve, m: 0 within them.
    pub(crate) outside: T,
}

impl<T: Scalar> Place<T> {
    /// The place of a film without a curve.
    pub(crate) fn straight() -> Self {
        Self { knot: T::ZERO, beyond: T::ZERO, slope: T::from_f64(1.0), outside: T::ZERO }
    }

    /// The place `distance` (m) on, along the tangent.
    #[inline]
    pub(crate) fn moved(&self, distance: T) -> Self {
        Self { beyond: self.beyond + self.slope * distance, ..*self }
    }

    /// Whether the film is beyond the ends of the curve.
    #[inline]
    pub(crate) fn is_outside(&self) -> bool {
        self.outside.is_below(T::ZERO) || T::ZERO.is_below(self.outside)
    }

    /// T here minus T at `other`, m.
    #[inline]
    pub(crate) fn minus(&self, other: &Self) -> T {
        (self.knot - other.knot) + (self.beyond - other.beyond)
    }
}

impl<T: Scalar, const EIGHTS: usize> Table<T, EIGHTS> {
    /// The table of these knots, at least two and at most one more than it has pieces, rounded to T.
    #[inline(never)]
    pub(crate) fn new(knots: &[Knot<f64>]) -> Self {
        let rounded = |knot: &Knot<f64>| Knot {
            displacement: T::from_f64(knot.displacement),
            value: T::from_f64(knot.value),
            slope: T::from_f64(knot.slope),
        };
        let at = T::from_f64(f64::INFINITY);
        let unused = Piece { at, value: T::ZERO, slope: T::ZERO, second: T::ZERO, third: T::ZERO };
        const { assert!(EIGHTS == 1 || EIGHTS == 2, "a table of 8 or 16 pieces") };
        let mut pieces = [[[[unused; 2]; 2]; 2]; EIGHTS];
        let flat = pieces.as_flattened_mut().as_flattened_mut().as_flattened_mut();
        for (piece, pair) in flat.iter_mut().zip(knots.windows(2)) {
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
        let used = knots.len() - 1;
        let last = rounded(&knots[used]);
        Self { pieces, last, used }
    }

    /// The knots, as rounded.
    pub(crate) fn knots(&self) -> impl Iterator<Item = Knot<T>> + '_ {
        let pieces = self.pieces.as_flattened().as_flattened().as_flattened().iter().take(self.used);
        pieces
            .map(|piece| Knot { displacement: piece.at, value: piece.value, slope: piece.slope })
            .chain(core::iter::once(self.last))
    }

    /// Visits the constants of a place, with as many pieces as `count`. The pieces of a spring have forces for values.
    pub(crate) fn numbers(&self, take: &mut impl Numbers<T>, name: &'static str, count: usize) {
        let piece = Record {
            name: "piece",
            about: "A cubic from `at` on: value + slope u + second u^2 + third u^3.",
            fields: [
                ("at", "m; infinite where the piece is not used"),
                ("value", "m; N where the piece is one of a spring, and so on"),
                ("slope", ""),
                ("second", "1/m"),
                ("third", "1/m^2"),
            ],
        };
        let pieces = self.pieces.as_flattened().as_flattened().as_flattened();
        take.number("low", self.pieces[0][0][0][0].at, "where it begins, m");
        take.number("high", self.last.displacement, "where it ends, m");
        let values = |piece: &Piece<T>| [piece.at, piece.value, piece.slope, piece.second, piece.third];
        let unused = [T::from_f64(f64::INFINITY), T::ZERO, T::ZERO, T::ZERO, T::ZERO];
        let rows = pieces.iter().map(values).chain(core::iter::repeat(unused)).take(count);
        take.records(name, &piece, rows, "");
    }

    /// The curve of the rounded knots.
    #[inline(never)]
    pub(crate) fn curve(&self) -> Result<Curve, CurveError> {
        let knots: Vec<Knot<T>, MAX_KNOTS> = self.knots().collect();
        Curve::from_rounded(&knots)
    }

    /// The place at `displacement` − `surplus` (m).
    #[inline]
    pub(crate) fn place(&self, displacement: T, surplus: T) -> Place<T> {
        self.place_and_curvature(displacement, surplus).0
    }

    /// The same with the second derivative there, 0 beyond the ends.
    #[inline]
    pub(crate) fn place_and_curvature(&self, displacement: T, surplus: T) -> (Place<T>, T) {
        // A place below the first piece is in it, one above the last piece in the last.
        let upper = |from: T| !displacement.is_below(from);
        let (first, last) = (&self.pieces[0], &self.pieces[EIGHTS - 1]);
        let [lower_quarter, upper_quarter] = if EIGHTS > 1 && upper(last[0][0][0].at) { last } else { first };
        let [lower_pair, upper_pair] = if upper(upper_quarter[0][0].at) { upper_quarter } else { lower_quarter };
        let [lower, higher] = if upper(upper_pair[0].at) { upper_pair } else { lower_pair };
        let piece = if upper(higher.at) { higher } else { lower };

        let (low, high) = (first[0][0][0].at, self.last.displacement);
        let within = if displacement.is_below(low) { low } else { displacement };
        let within = if high.is_below(displacement) { high } else { within };
        let outside = displacement - within;
        let u = (within - piece.at) - surplus;
        let bent = u * piece.third;
        let rise = piece.second + bent;
        // slope + 2 second u + 3 third u²
        let slope = piece.slope + u * (rise + (rise + bent));
        let beyond = u * (piece.slope + u * rise) + slope * outside;
        let place = Place { knot: piece.value, beyond, slope, outside };
        // 2 second + 6 third u
        let half = rise + (bent + bent);
        let curvature = if T::ZERO.is_below(outside * outside) { T::ZERO } else { half + half };
        (place, curvature)
    }
}

impl<T: Scalar> Table<T, 1> {
    /// The spring of the rounded knots.
    #[inline(never)]
    pub(crate) fn spring(&self) -> Result<Spring, CurveError> {
        let knots: Vec<Knot<T>, MAX_KNOTS> = self.knots().collect();
        Spring::from_rounded(&knots)
    }
}
