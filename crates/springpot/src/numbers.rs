//! The numbers that a step or a tick computes with, one by one: for code in another language that computes the same.

/// Takes the numbers of a law or of a law of control: see [`Law::numbers`](crate::Law::numbers),
/// [`Tracking::numbers`](crate::Tracking::numbers) and [`Learning::numbers`](crate::Learning::numbers).
///
/// Names are those of the fields, behind the name of what they belong to, such as `law.stiffness`. The numbers of an array come one
/// after the other under one name. What a construction computed in f64 comes as the step has it, rounded to `T`; constants of the step
/// other than 0, ½, 1, 1½, 2, 4 and 8 come as well, so that they stand in one place.
///
/// ```
/// use springpot::{Law, Numbers, LawOptions, Preset};
///
/// struct Stiffness(f32);
///
/// impl Numbers<f32> for Stiffness {
///     fn number(&mut self, name: &'static str, value: f32) {
///         if name == "law.stiffness" {
///             self.0 = value;
///         }
///     }
///
///     fn count(&mut self, _: &'static str, _: u32) {}
/// }
///
/// # fn main() -> Result<(), Box<dyn core::error::Error>> {
/// let law: Law<f32> = Law::compressed(&Preset::TABLE3_N2.model()?, LawOptions::at_step(1e-3))?;
/// let mut found = Stiffness(0.0);
/// law.numbers(&mut found);
/// assert_eq!(found.0, law.stiffness());
/// # Ok(())
/// # }
/// ```
pub trait Numbers<T> {
    /// A number.
    fn number(&mut self, name: &'static str, value: T);

    /// A whole number: ticks, harmonics.
    fn count(&mut self, name: &'static str, value: u32);

    /// The numbers of an array.
    fn array(&mut self, name: &'static str, values: impl IntoIterator<Item = T>)
    where
        Self: Sized,
    {
        values.into_iter().for_each(|value| self.number(name, value));
    }
}
