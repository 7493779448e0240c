//! States as numbers: what a program stores to go on with a film later.

use crate::law::LawState;
use crate::law::compressed::Compressed;
use crate::scalar::Scalar;

impl<T: Scalar, const HEAD: usize, const FAST: usize, const SLOW: usize> LawState<T, Compressed<T, HEAD, FAST, SLOW>> {
    /// Visits every number of the state, always in the same order. A visitor that stores them saves the state; one that replaces them in
    /// another state of the same law restores it.
    ///
    /// ```
    /// use springpot::{Law, LawOptions, Preset};
    ///
    /// # fn main() -> Result<(), Box<dyn core::error::Error>> {
    /// let law: Law<f32> = Law::compressed(&Preset::TABLE3_N2.model()?, LawOptions::at_step(1e-3))?;
    /// let mut state = law.state();
    /// law.displacement(&mut state, 10.0);
    /// let mut saved = Vec::new();
    /// state.visit(|number| saved.push(*number));
    ///
    /// let (mut restored, mut numbers) = (law.state(), saved.into_iter());
    /// restored.visit(|number| *number = numbers.next().unwrap_or_default());
    /// assert_eq!(restored, state);
    /// # Ok(())
    /// # }
    /// ```
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, clippy::cast_precision_loss)] // a slot, or it saturates
    pub fn visit(&mut self, mut visit: impl FnMut(&mut T)) {
        let Self { position, position_surplus, increment, base, bend, history } = self;
        let place = &mut bend.ahead;
        [position, position_surplus, increment, base, &mut bend.origin, &mut bend.predicted, &mut bend.past]
            .into_iter()
            .chain([&mut bend.stiffness, &mut bend.slope, &mut bend.memory, &mut bend.inertia])
            .chain([&mut bend.elongation, &mut bend.elongation_surplus])
            .chain([&mut place.knot, &mut place.beyond, &mut place.slope, &mut place.outside])
            .chain([&mut history.left, &mut history.left_surplus])
            .chain(history.increments.as_flattened_mut())
            .chain(&mut history.fast)
            .chain(history.slow.iter_mut().flat_map(|dashpot| [&mut dashpot.displacement, &mut dashpot.surplus]))
            .for_each(&mut visit);
        // A small whole number, which every number type holds.
        let mut newest = T::from_f64(history.newest as f64);
        visit(&mut newest);
        history.newest = (newest.to_f64() as usize).min(HEAD - 1);
    }
}
