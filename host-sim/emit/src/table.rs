//! Numbers by their names, as C writes them.

use std::collections::BTreeMap;
use std::fmt::Write;

use springpot::Numbers;

/// The numbers of a film, as C writes them. What was written is taken out, so that what is left was forgotten.
#[derive(Default)]
pub(crate) struct Table(BTreeMap<String, Vec<String>>);

impl Numbers<f32> for Table {
    fn number(&mut self, name: &'static str, value: f32) {
        self.0.entry(name.to_owned()).or_default().push(literal(value));
    }

    fn count(&mut self, name: &'static str, value: u32) {
        self.0.entry(name.to_owned()).or_default().push(format!("{value}U"));
    }
}

/// A number as a constant of C: nine significant digits give every number of single precision back. Hexadecimal ones, which are shorter
/// to prove, are not C++11.
fn literal(value: f32) -> String {
    if value.is_infinite() {
        let sign = if value < 0.0 { "-" } else { "" };
        return format!("{sign}(float)INFINITY");
    }
    format!("{value:.8e}F")
}

impl Table {
    /// Whether there is such a number.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.0.contains_key(name)
    }

    /// Takes the numbers of `names`, which are arrays of one length, element by element.
    fn take(&mut self, names: &[&str]) -> Vec<Vec<String>> {
        let mut columns = Vec::new();
        for name in names {
            // Both lists of names stand in this project: a test emits all of them.
            columns.push(self.0.remove(*name).unwrap_or_else(|| panic!("no number {name}")).into_iter());
        }
        let mut rows = Vec::new();
        while let Some(row) = columns.iter_mut().map(Iterator::next).collect::<Option<Vec<_>>>() {
            rows.push(row);
        }
        rows
    }

    /// Lines of an initialiser: for each name of `object` its number, or its array in braces.
    pub(crate) fn fields(&mut self, text: &mut String, indent: &str, object: &str, names: &[&str]) {
        for name in names {
            let values = self.take(&[&format!("{object}.{name}")]).concat();
            let value = match values.as_slice() {
                [value] => value.clone(),
                values => format!("{{{}}}", values.join(", ")),
            };
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{indent}{value}, /* {name} */");
        }
    }

    /// Lines of an initialiser: an array of structures of these `names`.
    pub(crate) fn rows(&mut self, text: &mut String, indent: &str, object: &str, names: &[&str]) {
        let names: Vec<String> = names.iter().map(|name| format!("{object}.{name}")).collect();
        let _ = writeln!(text, "{indent}{{ /* {object} */");
        for row in self.take(&names.iter().map(String::as_str).collect::<Vec<_>>()) {
            let _ = writeln!(text, "{indent}    {{{}}},", row.join(", "));
        }
        let _ = writeln!(text, "{indent}}},");
    }

    /// Asserts that nothing is left.
    pub(crate) fn end(self) {
        assert!(self.0.is_empty(), "numbers that C does not have: {:?}", self.0.keys());
    }
}
