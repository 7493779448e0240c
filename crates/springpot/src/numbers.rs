//! The constants of a step or a tick, for code in another language that computes the same.

/// Visits the constants that a step or a tick computes with.
///
/// The visits are the one source of the structures of the emitted C: their names, order, fields and comments. Constants computed in f64 are
/// passed as the step uses them, rounded to `T`; so are constants of the code other than 0, ½, 1, 1½, 2, 4 and 8.
pub trait Numbers<T> {
    /// Begins the structure `name`: the constants that follow are its fields.
    fn structure(&mut self, _name: &'static str, _about: &'static str) {}

    /// A constant.
    fn number(&mut self, name: &'static str, value: T, about: &'static str);

    /// A whole number: ticks, harmonics.
    fn count(&mut self, name: &'static str, value: u32, about: &'static str);

    /// An array of constants.
    fn array<const N: usize>(&mut self, name: &'static str, values: [T; N], about: &'static str) {
        for value in values {
            self.number(name, value, about);
        }
    }

    /// A field that is a structure of its own, or several of those: an array.
    fn records<const FIELDS: usize>(
        &mut self,
        name: &'static str,
        _of: &Record<FIELDS>,
        values: impl IntoIterator<Item = [T; FIELDS]>,
        about: &'static str,
    ) {
        values.into_iter().for_each(|values| self.array(name, values, about));
    }
}

/// A structure that is a field of others.
#[derive(Clone, Copy, Debug)]
pub struct Record<const FIELDS: usize> {
    /// Its name.
    pub name: &'static str,
    /// Its comment.
    pub about: &'static str,
    /// Names and comments of its fields.
    pub fields: [(&'static str, &'static str); FIELDS],
}
