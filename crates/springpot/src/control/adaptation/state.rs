//! Orders and questions to the state of an [`Adaptation`](super::Adaptation) between ticks.

use super::power_series::{exp, logarithm};
use super::{ABOVE, AGED, AdaptationState, BIAS, BY_CHANCE, EXPECTED, MIN_CHANGE, PARAMETERS, SCALE};
use crate::control::adapted::{Adapted, Adapting, BOUNDS, ROUNDED};
use crate::error::ControlError;
use crate::law::Memory;
use crate::scalar::Real;

impl<T: Real, P> AdaptationState<T, P> {
    /// The film as its law has it.
    pub(crate) fn as_fitted<M: Memory<T, PerMode = P>>() -> Self {
        Self {
            phase: 0,
            stiffer: T::ZERO,
            before: (T::ZERO, T::ZERO),
            slopes: M::per_mode(),
            sums: [T::ZERO; 2],
            estimates: [T::ZERO; PARAMETERS],
            used: [T::ZERO; PARAMETERS],
            stated: [T::ZERO; 2],
            stated_used: [T::ZERO; 2],
            rate: T::ZERO,
            steps: [T::ZERO; 2],
            forces: [T::ZERO; PARAMETERS],
            is_excited: false,
            diagonal: [T::from_f64(1.0); PARAMETERS],
            upper: [T::ZERO; ABOVE],
            misfit: T::from_f64(1.0),
            doubt: T::from_f64(1.0),
            ageing: T::ZERO,
            is_in_use: false,
            adapting: Adapting::Off,
        }
    }

    /// Whether ticks have to [`advance`](super::Adaptation::advance) it.
    #[inline]
    pub(crate) fn is_in_use(&self) -> bool {
        self.is_in_use
    }

    /// Whether something is used, or comes into use, of what was learned.
    pub(crate) fn has_learned(&self) -> bool {
        self.used.iter().chain(&self.estimates).any(|value| *value != T::ZERO)
    }

    /// Whether nothing is used, nor comes into use, of what was learned or stated.
    pub(crate) fn is_as_fitted(&self) -> bool {
        !self.has_learned() && self.stated.iter().chain(&self.stated_used).all(|value| *value == T::ZERO)
    }

    /// [`Adapted::ageing`].
    #[inline]
    pub(crate) fn ageing(&self) -> T {
        self.ageing
    }

    pub(crate) fn adapting(&self) -> Adapting {
        self.adapting
    }

    pub(crate) fn set_adapting<M: Memory<T, PerMode = P>>(&mut self, adapting: Adapting) {
        if adapting == Adapting::Off {
            self.forget();
            self.stated = [T::ZERO; 2];
        } else if !self.is_in_use {
            *self = Self { is_in_use: true, ..Self::as_fitted::<M>() };
        }
        self.adapting = adapting;
    }

    /// Factors of the film's stiffness and times at a temperature, which come into use as estimates do, and beside them.
    ///
    /// # Errors
    ///
    /// [`ControlError::OutOfRange`] for factors beyond the bounds of what is learned.
    pub(crate) fn set_temperature_factors<M: Memory<T, PerMode = P>>(
        &mut self,
        [stiffness, time]: [T; 2],
    ) -> Result<(), ControlError> {
        let stated = [stiffness, time].map(|factor| -logarithm(factor));
        let [scale, _, rate, ..] = BOUNDS;
        let quantities = ["stiffness, its logarithm", "time, its logarithm"];
        for ((quantity, value), most) in quantities.into_iter().zip(stated).zip([scale, rate]) {
            // NaN is out of range.
            let within = value.abs() <= T::from_f64(most * ROUNDED);
            if !within {
                return Err(ControlError::OutOfRange { quantity, value: value.abs().to_f64(), most });
            }
        }
        if self.adapting == Adapting::Off {
            self.set_adapting::<M>(Adapting::Hold);
        }
        self.stated = stated;
        Ok(())
    }

    /// Nothing is known of the film but its temperature, at once; learning goes on. A round leaves the stiffness of the film as its law has it.
    pub(crate) fn reset<M: Memory<T, PerMode = P>>(&mut self) {
        let Self { stated, is_in_use, adapting, .. } = *self;
        *self = Self { stated, is_in_use, adapting, ..Self::as_fitted::<M>() };
    }

    /// Uses what was learned before at once, and holds it; how sure that is begins anew.
    pub(crate) fn restore<M: Memory<T, PerMode = P>>(&mut self, adapted: &Adapted<T>) {
        let used = [logarithm(adapted.force_scale), adapted.memory, adapted.rate, adapted.stretch, adapted.bias_n];
        let stated = self.stated;
        let adapting = Adapting::Hold;
        let ageing = adapted.ageing;
        let doubt = adapted.uncertainty / T::from_f64(EXPECTED[SCALE]);
        let doubt = doubt * doubt;
        *self =
            Self { estimates: used, used, stated, doubt, ageing, is_in_use: true, adapting, ..Self::as_fitted::<M>() };
    }

    /// The changes that are in use; of a law that follows no film the observer's `force_scale`.
    pub(crate) fn adapted(&self, force_scale: T) -> Adapted<T> {
        let [scale, memory, rate, stretch, bias_n] = self.used;
        let force_scale = if self.is_in_use { exp(scale) } else { force_scale };
        Adapted { force_scale, uncertainty: self.uncertainty(), memory, rate, stretch, bias_n, ageing: self.ageing }
    }

    /// Standard deviation of the force scale, over it.
    fn uncertainty(&self) -> T {
        self.misfit.sqrt() * (T::from_f64(EXPECTED[SCALE]) * self.variance(SCALE).sqrt())
    }

    /// Variance of an estimate, in squares of what is expected, if forces are explained as well as is expected.
    #[inline]
    fn variance(&self, parameter: usize) -> T {
        self.entry(parameter, parameter)
    }

    /// Covariance of two estimates, likewise.
    #[inline(never)] // sixteen calls, outside of ticks
    fn covariance(&self, row: usize, column: usize) -> T {
        self.entry(row, column)
    }

    /// An entry of U D Uᵀ.
    #[inline]
    fn entry(&self, row: usize, column: usize) -> T {
        let above = |row: usize, along: usize| {
            let entry = || self.upper.get(along * along.saturating_sub(1) / 2 + row).copied().unwrap_or(T::ZERO);
            if along == row { T::from_f64(1.0) } else { entry() }
        };
        let parts = self.diagonal.iter().enumerate().skip(row.max(column));
        parts.fold(T::ZERO, |sum, (along, &variance)| sum + above(row, along) * above(column, along) * variance)
    }

    /// The largest change, less its part that may be chance, over the one that is an ageing of 1.
    #[inline]
    fn aged(&self) -> T {
        let chance = T::from_f64(BY_CHANCE) * T::from_f64(BY_CHANCE) * self.misfit;
        let changes = self.used.iter().zip(EXPECTED).zip(AGED).enumerate();
        changes.fold(T::ZERO, |largest, (parameter, ((used, expected), aged))| {
            let used = used.abs();
            let by_chance = chance * (T::from_f64(expected) * T::from_f64(expected) * self.variance(parameter));
            if used * used > by_chance {
                let change = (used - by_chance / used) * T::from_f64(1.0 / aged);
                if change > largest { change } else { largest }
            } else {
                largest
            }
        })
    }

    /// Judges what was learned now. It counts until something is learned again, although nothing is known of what changes meanwhile.
    #[inline]
    pub(super) fn judge(&mut self) {
        self.doubt = self.misfit * self.variance(SCALE);
        self.ageing = self.aged();
    }

    /// [`TrackingState::stiffness_change`](crate::TrackingState::stiffness_change).
    pub(crate) fn stiffness_change(&self) -> T {
        // The estimate of the scale if memory, rate and stretch are 0, whatever the bias is: what they explain goes, one after another.
        let mut left = self.estimates;
        for (left, expected) in left.iter_mut().zip(EXPECTED) {
            *left = *left / T::from_f64(expected);
        }
        let mut covariance: [[T; BIAS]; BIAS] =
            core::array::from_fn(|row| core::array::from_fn(|column| self.covariance(row, column)));
        for from in (1..BIAS).rev() {
            let (open, own) = (left[from], covariance[from]);
            for row in 0..from {
                let share = own[row] / own[from];
                left[row] = left[row] - share * open;
                for column in 0..from {
                    covariance[row][column] = covariance[row][column] - share * own[column];
                }
            }
        }
        let scale = T::from_f64(EXPECTED[SCALE]) * left[SCALE];
        let by_chance = T::from_f64(BY_CHANCE) * (T::from_f64(EXPECTED[SCALE]) * self.doubt.sqrt());
        let is_shown = scale.abs() > T::from_f64(MIN_CHANGE) && scale.abs() > by_chance;
        if is_shown { exp(-scale) - T::from_f64(1.0) } else { T::ZERO }
    }

    /// Factors of stiffness and times at the temperature that was stated.
    pub(crate) fn temperature_factors(&self) -> [T; 2] {
        self.stated.map(|stated| exp(-stated))
    }

    /// The law comes back into use, and nothing is known of the film.
    pub(crate) fn forget(&mut self) {
        self.estimates = [T::ZERO; PARAMETERS];
        self.diagonal = [T::from_f64(1.0); PARAMETERS];
        self.upper = [T::ZERO; ABOVE];
        self.misfit = T::from_f64(1.0);
        self.doubt = T::from_f64(1.0);
        self.ageing = T::ZERO;
    }
}
